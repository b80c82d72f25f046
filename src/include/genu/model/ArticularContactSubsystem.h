#pragma once

#include <Simbody.h>

#include <memory>
#include <string>

#include "genu/contact/ContactPair.h"

namespace genu::model {

/** Applies the net loads of contact::ContactPair to pairs of mobilized bodies, equal and opposite, beside any other
 force of the same MultibodySystem.

 A pair has a fixed frame F on one body and a moving frame M on another, both anywhere in the tree: the pose X_FM and
 the velocity V_FM are computed from the two bodies, not from a joint.
   Stage::Position  pose and net loads, evaluated when first asked for, kept in the State's cache
   Stage::Velocity  V_FM, the power of the contact force, and the damped net loads of pairs with damping
   potential energy evaluated only when asked for
 NetLoad is {force on M, moment about Fo} in F; SimTK::SpatialVec is (moment, force) in G. toSpatialVecInG() is the
 only place where order and frame change.

 Units: SI. Everything that includes Simbody must be compiled with -UNDEBUG (the Debian library is, and its headers
 change class layout with it); linking the Genu::model target does that.

 States and threads: warm-start memory lives in the State's cache, so a State used by one thread at a time is enough
 for safety; a copied State starts cold. Results depend on the history of a State only within the tolerance of the
 closest-point query (contact::ContactSurface::kDefaultTolerance_m), and the same sequence of poses gives
 bit-identical results. Numerical failure is reported by ContactResult::status, never thrown: the caller decides. */
class ArticularContactSubsystem : public SimTK::ForceSubsystem {
 public:
  explicit ArticularContactSubsystem(SimTK::MultibodySystem& system);

  /** Where a pair is attached: frame F on `fixed`, frame M on `moving`. */
  struct Attachment {
    SimTK::MobilizedBodyIndex fixed;
    SimTK::Transform X_FixedF;  ///< F in the fixed body's frame
    SimTK::MobilizedBodyIndex moving;
    SimTK::Transform X_MovingM;
  };
  /** Adds a pair (a topological change). @return its index */
  int addContactPair(const std::string& name, std::shared_ptr<const contact::ContactPair> pair,
                     const Attachment& attachment);

  /** Threads for all evaluations (a topological change); nullptr: none. It must outlive every State. */
  void setTaskRunner(const contact::TaskRunner* runner);

  int numContactPairs() const;
  const std::string& name(int pair) const;
  const contact::ContactPair& contactPair(int pair) const;
  const Attachment& attachment(int pair) const;

  /** Stage::Position. */
  contact::Pose calcPose(const SimTK::State& state, int pair) const;
  /** Net loads at rest, without energy unless that was asked for at this pose. Stage::Position; lazy. */
  const contact::ContactResult& getResult(const SimTK::State& state, int pair) const;
  /** Net loads at rest, with energy. Stage::Position; lazy. */
  const contact::ContactResult& getResultWithEnergy(const SimTK::State& state, int pair) const;
  /** The net loads that act: with the damping of the pair and the State's rates; without damping the same as getResult().
   Stage::Velocity, or Stage::Position without damping; lazy. */
  const contact::ContactResult& getDampedResult(const SimTK::State& state, int pair) const;
  /** The same with the elastic energy. */
  contact::ContactResult calcDampedResultWithEnergy(const SimTK::State& state, int pair) const;
  /** Worst status of all pairs, which does not depend on rates. Stage::Position. */
  contact::EvaluationStatus getStatus(const SimTK::State& state) const;

  struct Rates {
    contact::SpatialVelocity V_FM;
    double power_W = 0;  ///< of the contact force on M relative to F; negative while energy is stored
    double dissipated_W = 0;  ///< taken by the damping, >= 0; part of -power_W
  };
  /** Stage::Velocity; lazy. */
  const Rates& getRates(const SimTK::State& state, int pair) const;

  /** Element values at the State's pose and at rest, one vector per compartment. Stage::Position. */
  std::vector<std::vector<contact::ElementField>> calcFields(const SimTK::State& state, int pair) const;

  /** The same from the memory of the State's own evaluations, much faster: distances of elements that cannot touch are lower bounds. */
  std::vector<std::vector<contact::ElementField>> calcTrackedFields(const SimTK::State& state, int pair) const;

  /** The load on M as a spatial force (moment, force) on a body whose origin is `p_GBo`, all in ground. The fixed body
   gets the opposite of the same load, about its own origin. */
  static SimTK::SpatialVec toSpatialVecInG(const contact::NetLoad& load, const SimTK::Transform& X_GF,
                                           const SimTK::Vec3& p_GBo);

  /** Rates of the coordinates q that give the velocity V, the inverse of contact::calcSpatialVelocity. At gimbal lock there are none for
   some velocities: ry closer than 1e-10 rad to it is moved to that distance, which turns the pose by no more. */
  static contact::JointCoordinates calcCoordinateRates(contact::JointCoordinates& q, const contact::SpatialVelocity& V);

  /** The load of a pair as a linear function of its six coordinates and their rates, exact to first order where it was taken. */
  struct Linearization {
    contact::JointCoordinates q{}, qdot{};  ///< X_FM as coordinates, and their rates
    contact::ContactResult at;              ///< there, with stiffness and damping
  };
  /** All pairs have a stiffness (smooth rule). */
  bool canLinearize() const;
  /** Evaluates every pair with its stiffness; the loads then are those of the State, too. Stage::Velocity.
   @throws std::invalid_argument a pair without (centre rule) */
  std::vector<Linearization> linearize(const SimTK::State& state) const;
  /** From now on the loads of this State are these, extrapolated, one per pair; empty: evaluated again. Poses near, where the multibody
   system is to be differenced without evaluating contact. Takes effect with the next change of the State's coordinates. */
  void useLinearization(const SimTK::State& state, std::vector<Linearization> linearizations) const;

  /** Work done through this State so far, over all pairs. */
  struct Counters {
    long evaluations = 0, copies = 0, distanceQueries = 0;
  };
  const Counters& getCounters(const SimTK::State& state) const;

  SimTK_PIMPL_DOWNCAST(ArticularContactSubsystem, SimTK::ForceSubsystem);

 private:
  class Guts;
  const Guts& guts() const;
  Guts& updGuts();
};

}  // namespace genu::model
