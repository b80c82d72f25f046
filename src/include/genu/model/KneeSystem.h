#pragma once

#include <Simbody.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "genu/model/Analysis.h"
#include "genu/model/ArticularContactSubsystem.h"
#include "genu/model/TimeCurve.h"
#include "genu/model/UrdfModel.h"
#include "genu/scene/Scene.h"

namespace genu::model {

/** The Simbody system of a scene, open for extension.

 Built by the constructor: the bodies of the URDF (root welded to ground), a MobilizedBody::Bushing for the floating
 joint (q = contact::JointCoordinates, u = their rates), one Constraint::PrescribedMotion per prescribed coordinate,
 the contact pairs, loads, generalized loads, gravity and damping where the scene has them; nothing the scene does
 not need is added. Then
   KneeSystem knee(scene);
   SimTK::Force::TwoPointLinearSpring(knee.forces(), knee.body("tibia"), ..., knee.body("femur"), ...);
   StaticResult result = runStatic(knee, scene);
 Ground is the root link's frame. SI units, y up in F [BF2004 §2.1]. */
class KneeSystem {
 public:
  /** @throws InputError see Analysis.h */
  explicit KneeSystem(const scene::Scene& scene);
  /** With contact pairs built before (scene::makeContactPairs), in the scene's order. */
  KneeSystem(const scene::Scene& scene, const std::vector<std::shared_ptr<const contact::ContactPair>>& pairs);
  KneeSystem(const KneeSystem&) = delete;
  KneeSystem& operator=(const KneeSystem&) = delete;

  SimTK::MultibodySystem& system() { return system_; }
  const SimTK::MultibodySystem& system() const { return system_; }
  SimTK::SimbodyMatterSubsystem& matter() { return matter_; }
  const SimTK::SimbodyMatterSubsystem& matter() const { return matter_; }
  SimTK::GeneralForceSubsystem& forces() { return forces_; }
  ArticularContactSubsystem& contact() { return contact_; }
  const ArticularContactSubsystem& contact() const { return contact_; }
  SimTK::MobilizedBody::Bushing& joint() { return joint_; }
  const SimTK::MobilizedBody::Bushing& joint() const { return joint_; }
  /** The mobilized body of a link. @throws InputError when there is no such link */
  SimTK::MobilizedBody& body(const std::string& link);
  const UrdfModel& urdf() const { return urdf_; }

  bool isPrescribed(int coordinate) const { return static_cast<bool>(prescribed_[static_cast<size_t>(coordinate)]); }
  /** The curve of a prescribed coordinate. */
  const TimeCurve& motion(int coordinate) const { return *prescribed_[static_cast<size_t>(coordinate)]; }
  const SimTK::Constraint& constraint(int coordinate) const { return constraints_[static_cast<size_t>(coordinate)]; }

  /** Sets time and the prescribed coordinates; their rates too, or zero when `atRest`. */
  void prescribe(SimTK::State& state, double time_s, bool atRest) const;

  /** @throws InputError when a table does not reach from t0 to t1 */
  void checkTablesCover(double t0_s, double t1_s) const;

 private:
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  ArticularContactSubsystem contact_;
  UrdfModel urdf_;
  std::vector<SimTK::MobilizedBody> bodies_;  // by link
  SimTK::MobilizedBody::Bushing joint_;
  std::array<std::shared_ptr<const TimeCurve>, 6> prescribed_;
  std::array<SimTK::Constraint, 6> constraints_;
  struct NamedCurve {
    std::string use;
    std::shared_ptr<const TimeCurve> curve;
  };
  std::vector<NamedCurve> curves_;  // every curve, for checkTablesCover
};

/** As runStatic(scene, progress) and runGait(scene, progress), on a system that may hold more forces. The joint's
 coordinates must be its only mobilities. Realizes the topology. */
StaticResult runStatic(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress = {});
GaitResult runGait(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress = {});

}  // namespace genu::model
