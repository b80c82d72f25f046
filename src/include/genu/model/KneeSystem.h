#pragma once

#include <Simbody.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "genu/model/Analysis.h"
#include "genu/model/ArticularContactSubsystem.h"
#include "genu/model/ForceElement.h"
#include "genu/model/TimeCurve.h"
#include "genu/model/UrdfModel.h"
#include "genu/scene/Scene.h"

namespace genu::model {

/** The Simbody system of a scene, open for extension.

 Built by the constructor: the bodies of the URDF (root welded to ground), a MobilizedBody::Bushing for each floating joint
 (q = contact::JointCoordinates), Pin and Slider for simple ones (u = dq/dt for all), one Constraint::PrescribedMotion per
 prescribed coordinate, the contact pairs, loads, generalized loads, stops, gravity, damping and force elements where the scene has
 them; nothing the scene does not need is added. Then
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
  ~KneeSystem();
  KneeSystem(const KneeSystem&) = delete;
  KneeSystem& operator=(const KneeSystem&) = delete;

  SimTK::MultibodySystem& system() { return system_; }
  const SimTK::MultibodySystem& system() const { return system_; }
  SimTK::SimbodyMatterSubsystem& matter() { return matter_; }
  const SimTK::SimbodyMatterSubsystem& matter() const { return matter_; }
  SimTK::GeneralForceSubsystem& forces() { return forces_; }
  const SimTK::GeneralForceSubsystem& forces() const { return forces_; }
  ArticularContactSubsystem& contact() { return contact_; }
  const ArticularContactSubsystem& contact() const { return contact_; }
  /** The only joint, or the first floating one. @throws std::logic_error when there is none */
  const SimTK::MobilizedBody::Bushing& joint() const;
  /** The mobilized body of a link. @throws InputError when there is no such link */
  SimTK::MobilizedBody& body(const std::string& link);
  const SimTK::MobilizedBody& body(int link) const { return bodies_[static_cast<size_t>(link)]; }
  const UrdfModel& urdf() const { return urdf_; }
  const scene::Scene& scene() const { return scene_; }

  int numCoordinates() const { return static_cast<int>(coordinates_.size()); }
  const std::vector<scene::CoordinateInfo>& coordinates() const { return coordinates_; }
  /** Index of a coordinate in the State's q and in its u. */
  int stateIndex(int coordinate) const { return stateIndex_[static_cast<size_t>(coordinate)]; }
  /** The mobilized body whose joint has it, and its index there. */
  const SimTK::MobilizedBody& bodyOfCoordinate(int coordinate) const;
  int axisOfCoordinate(int coordinate) const { return coordinates_[static_cast<size_t>(coordinate)].axis; }

  bool isPrescribed(int coordinate) const { return static_cast<bool>(prescribed_[static_cast<size_t>(coordinate)]); }
  /** The curve of a prescribed coordinate. */
  const TimeCurve& motion(int coordinate) const { return *prescribed_[static_cast<size_t>(coordinate)]; }
  const SimTK::Constraint& constraint(int coordinate) const { return constraints_[static_cast<size_t>(coordinate)]; }

  const std::vector<std::unique_ptr<ForceElement>>& elements() const { return elements_; }
  /** Columns of all elements' outputs, and their values. Stage::Dynamics. */
  std::vector<scene::ElementColumn> listElementColumns() const;
  std::vector<double> calcElementOutputs(const SimTK::State& state) const;
  std::vector<scene::ElementPath> calcElementPaths(const SimTK::State& state) const;
  /** First problem of an element, with its key; empty: none. Stage::Position. */
  std::string findElementProblem(const SimTK::State& state) const;
  /** Settles the states of all elements; `state` at rest. Realizes it to Stage::Position. */
  void settleElements(SimTK::State& state) const;

  /** Sets time and the prescribed coordinates; their rates too, or zero when `atRest`. */
  void prescribe(SimTK::State& state, double time_s, bool atRest) const;
  scene::Coordinates readCoordinates(const SimTK::State& state) const;

  /** A function of time whose table is to cover every run; `use` names it in messages. */
  std::shared_ptr<const TimeCurve> addCurve(const scene::TimeFunction& function, const std::string& use);
  /** @throws InputError when a table does not reach from t0 to t1 */
  void checkTablesCover(double t0_s, double t1_s) const;
  /** Kinks and jumps of all tables, in the order of time; a time at which one jumps counts as a jump. */
  struct InputBreak {
    double time_s;
    bool jump;
  };
  std::vector<InputBreak> listInputBreaks() const;
  /** Every table over time: its source, and in brackets what it is for. */
  std::vector<std::string> listTables() const;
  /** Tables whose curve leaves the range of their values by more than 2 % of it: a jump with too few rows. */
  std::vector<std::string> listTableWarnings() const;

 private:
  void addBodies();
  void addCoordinates();
  void addContacts(const std::vector<std::shared_ptr<const contact::ContactPair>>& pairs);
  void addLoads();
  void addElements();

  const scene::Scene scene_;  // a copy: elements keep using it
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  ArticularContactSubsystem contact_;
  UrdfModel urdf_;
  std::vector<SimTK::MobilizedBody> bodies_;  // by link
  std::optional<SimTK::MobilizedBody::Bushing> joint_;
  std::vector<scene::CoordinateInfo> coordinates_;
  std::vector<int> stateIndex_, linkOfCoordinate_;
  std::vector<std::shared_ptr<const TimeCurve>> prescribed_;
  std::vector<SimTK::Constraint> constraints_;
  std::vector<std::unique_ptr<ForceElement>> elements_;
  struct NamedCurve {
    std::string use;
    std::shared_ptr<const TimeCurve> curve;
  };
  std::vector<NamedCurve> curves_;  // every curve, for checkTablesCover
};

/** As runStatic(scene, progress) and runGait(scene, progress), on a system that may hold more forces. The
 coordinates of the scene must be its only mobilities. Realizes the topology. */
StaticResult runStatic(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress = {});
GaitResult runGait(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress = {});
scene::Trajectory runSeries(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress = {});

}  // namespace genu::model
