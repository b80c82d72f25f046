#pragma once

#include <Simbody.h>

#include <string>
#include <vector>

#include "genu/model/UrdfModel.h"
#include "genu/scene/Scene.h"

namespace genu::model {

class KneeSystem;

/** A string through points of several bodies, over wrapping surfaces: its length, its rate and what a tension in it does.

   L(q) = sum of its segments, each the shortest way outside its surface (WrapSurface.h)
   unit load: force and moment on each body, and generalized force on the coordinate of each moving point, of a tension of 1 N
   generalized force of a tension T = -T dL/dq = T x unit load;   dL/dt = -(power of the unit load)

 Two points that coincide pull in no direction: that segment has no load. A path with an end inside a surface goes straight through it
 (numInside). */
class Path {
 public:
  /** @param where begins messages, "scene.yaml:31: ligaments.ACL.path" @throws InputError a link or wrap that does not exist */
  Path(const scene::PathDefinition& definition, const scene::Scene& scene, const UrdfModel& urdf, const std::string& where);

  struct BodyLoad {
    int link = 0;
    contact::Vec3 force_G = contact::Vec3::Zero();
    contact::Vec3 moment_G = contact::Vec3::Zero();  ///< about the link's origin
  };
  struct CoordinateLoad {
    int coordinate = 0;
    double force = 0;
  };
  struct Geometry {
    double length_m = 0;
    int numWrapped = 0, numInside = 0, numNotConverged = 0;
    std::vector<BodyLoad> unitLoads;              ///< one per link of links()
    std::vector<CoordinateLoad> coordinateLoads;  ///< one per moving point
  };

  const std::vector<int>& links() const { return links_; }

  /** At the scene's coordinates. */
  void calcGeometry(const std::vector<contact::Pose>& linkPoses, const double* q, Geometry& geometry) const;
  double calcLength_m(const UrdfModel& urdf, const double* q) const;
  /** Stage::Position. */
  void calcGeometry(const KneeSystem& knee, const SimTK::State& state, Geometry& geometry) const;
  /** dL/dt. Stage::Velocity. */
  static double calcRate_MPerS(const KneeSystem& knee, const SimTK::State& state, const Geometry& geometry);
  /** Adds the load of a tension. */
  static void applyTension(const KneeSystem& knee, const SimTK::State& state, const Geometry& geometry, double tension_N,
                           SimTK::Vector_<SimTK::SpatialVec>& bodyForces, SimTK::Vector& mobilityForces);
  /** Polyline in ground, with `arcPoints` on each wrapped arc. */
  std::vector<contact::Vec3> calcLine(const KneeSystem& knee, const SimTK::State& state, int arcPoints = 16) const;

 private:
  struct Point {
    int body = 0;  // index in links_
    contact::Vec3 point_m;
    int coordinate = -1;
    std::vector<double> q;
    std::vector<contact::Vec3> p_m, second;  // natural spline

    void evaluate(double at, contact::Vec3& p, contact::Vec3& dp) const;
  };
  struct Wrap {
    int body = 0;
    contact::Pose X_BodyW;
    musculoskeletal::WrapSurface surface;
  };
  template <class PoseOf>
  void calc(const PoseOf& poseOf, const double* q, Geometry& geometry) const;
  int addLink(int link);
  std::vector<double> readCoordinates(const KneeSystem& knee, const SimTK::State& state) const;

  std::vector<int> links_;
  std::vector<Point> points_;
  std::vector<int> wrapOf_;  // per segment, index in wraps_ or -1
  std::vector<Wrap> wraps_;
  bool moving_ = false;
};

}  // namespace genu::model
