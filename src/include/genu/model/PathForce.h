#pragma once

#include <Simbody.h>

#include <memory>
#include <string>
#include <utility>

#include "genu/model/KneeSystem.h"
#include "genu/model/Path.h"

namespace genu::model {

/** A Simbody force that is a tension along a Path. The path's geometry is kept in the State's cache. */
class PathForce : public SimTK::Force::Custom::Implementation {
 public:
  PathForce(KneeSystem& knee, Path path) : knee_(knee), path_(std::move(path)) {}

  const KneeSystem& knee() const { return knee_; }
  const Path& path() const { return path_; }

  void realizeTopology(SimTK::State& state) const override {
    geometryIndex_ = knee_.forces().allocateLazyCacheEntry(state, SimTK::Stage::Position, new SimTK::Value<Path::Geometry>());
  }

  /** Stage::Position; lazy. */
  const Path::Geometry& getGeometry(const SimTK::State& state) const {
    const SimTK::GeneralForceSubsystem& forces = knee_.forces();
    if (!forces.isCacheValueRealized(state, geometryIndex_)) {
      path_.calcGeometry(knee_, state, SimTK::Value<Path::Geometry>::updDowncast(forces.updCacheEntry(state, geometryIndex_)));
      forces.markCacheValueRealized(state, geometryIndex_);
    }
    return SimTK::Value<Path::Geometry>::downcast(forces.getCacheEntry(state, geometryIndex_));
  }
  double calcRate_MPerS(const SimTK::State& state) const { return Path::calcRate_MPerS(knee_, state, getGeometry(state)); }
  /** Stage::Velocity, or Stage::Dynamics where it needs own states. */
  virtual double calcTension_N(const SimTK::State& state) const = 0;

  void calcForce(const SimTK::State& state, SimTK::Vector_<SimTK::SpatialVec>& bodyForces, SimTK::Vector_<SimTK::Vec3>&,
                 SimTK::Vector& mobilityForces) const override {
    Path::applyTension(knee_, state, getGeometry(state), calcTension_N(state), bodyForces, mobilityForces);
  }

  /** For ForceElement::findProblem. */
  std::string findPathProblem(const SimTK::State& state) const {
    if (getGeometry(state).numNotConverged == 0) return {};
    return "the path over its wrapping surface was not found; move its ends away from the surface, or use a surface that is less flat";
  }

 private:
  const KneeSystem& knee_;
  Path path_;
  mutable SimTK::CacheEntryIndex geometryIndex_;
};

/** The place of an element's path, for messages. */
inline std::string whereIsPath(const KneeSystem& knee, const scene::ElementDefinition& definition) {
  return knee.scene().where(definition.key() + ".path");
}

/** Length of a path in a pose that the scene names. */
inline double calcLengthInPose_m(const KneeSystem& knee, const Path& path, const std::string& pose) {
  return path.calcLength_m(knee.urdf(), knee.scene().poses.at(pose).data());
}

}  // namespace genu::model
