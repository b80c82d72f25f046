#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {

/** The free coordinates of a KneeSystem at a given time, scaled so that all have the unit of length: z_i = q_i for a
 translation, kAngleLength_m q_i for an angle. Forces on them are r_i [N]: force, or moment / kAngleLength_m.
 Prescribed coordinates are at their value of that time and at rest; force elements with states of their own (muscles) are at
 the equilibrium of these. */
class ReducedDynamics {
 public:
  /** @throws InputError when the system has mobilities other than the scene's coordinates */
  ReducedDynamics(const KneeSystem& knee, const SimTK::State& defaultState, double time_s);

  int numFree() const { return static_cast<int>(free_.size()); }
  const std::vector<int>& freeCoordinates() const { return free_; }
  int findFree(int coordinate) const;  ///< position in z, -1 when prescribed
  double time() const { return time_; }

  scene::Coordinates coordinates(const Eigen::VectorXd& z) const;
  Eigen::VectorXd scaled(const scene::Coordinates& q) const;
  /** Rates of all coordinates, 0 for prescribed ones. */
  scene::Coordinates coordinateRates(const Eigen::VectorXd& v) const;
  /** q = scales z. */
  Eigen::VectorXd scales() const;

  /** False: the contact result has no meaning there (full penetration, failed query). */
  static bool isValid(contact::EvaluationStatus status) { return status <= contact::EvaluationStatus::extrapolated; }

  /** Force on the free coordinates at rest. `stiffnessToo`: calcStiffness() at the same z is likely to follow; contact is then evaluated once for both. */
  contact::EvaluationStatus calcStaticForce(const Eigen::VectorXd& z, Eigen::VectorXd& r, bool stiffnessToo = false);
  /** Force minus inertia, r = f(z, v) - M a - bias(z, v): 0 for a motion that obeys the equations of motion. */
  contact::EvaluationStatus calcDynamicResidual(const Eigen::VectorXd& z, const Eigen::VectorXd& v,
                                                const Eigen::VectorXd& a, Eigen::VectorXd& r);
  /** Stiffness K = -dr/dz at rest. Smooth rule: differences of the multibody system in which contact is linear, with its exact stiffness:
   one evaluation of contact. Otherwise by forward differences of step kDifference_m from r0, the force at z; columns where
   the shifted pose is not valid take the backward difference. @return false when there is none */
  bool calcStiffness(const Eigen::VectorXd& z, const Eigen::VectorXd& r0, Eigen::MatrixXd& K);
  static constexpr double kDifference_m = 1e-8;

  /** Largest |acceleration| [m/s^2, rad/s^2] of the body released at rest, with force r on it; at the pose of the last
   evaluation. */
  double calcRestAcceleration(const Eigen::VectorXd& r);
  /** Generalized forces that hold the coordinates at rest at the pose of the last evaluation: 0 for free ones in
   equilibrium. [N, N m] */
  std::vector<double> calcHoldingForces();

  /** Sets the pose and returns the State, realized to Position. */
  const SimTK::State& setPose(const Eigen::VectorXd& z);
  bool hasContact() const;
  /** What an element said of the last evaluation, KneeSystem::findElementProblem(); empty: nothing. */
  const std::string& elementProblem() const { return problem_; }
  const SimTK::State& state() const { return state_; }
  const KneeSystem& knee() const { return knee_; }

 private:
  contact::EvaluationStatus evaluate(const SimTK::Vector& udot, Eigen::VectorXd& r);
  void calcForce(SimTK::State& state, const SimTK::Vector& udot, Eigen::VectorXd& r);
  void setPose(SimTK::State& state, const Eigen::VectorXd& z) const;
  bool canLinearize() const { return knee_.contact().numContactPairs() > 0 && knee_.contact().canLinearize(); }
  void linearize(const Eigen::VectorXd& z);

  const KneeSystem& knee_;
  SimTK::State state_, linear_;    // linear_: contact is linear, for the stiffness
  double time_;
  std::vector<int> free_, index_;  // coordinate, and its place in the State's q and u
  std::vector<double> scale_;      // q = scale z
  SimTK::Vector residual_, zeroUDot_, udot_;
  std::vector<ArticularContactSubsystem::Linearization> about_;  // of contact at aboutZ_
  Eigen::VectorXd aboutZ_;
  std::string problem_;
};

}  // namespace genu::model
