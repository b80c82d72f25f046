#pragma once

#include <string>
#include <vector>

#include "ReducedDynamics.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

/** Absolute tolerances of a step. */
struct OdeTolerances {
  double translation_m, angle_rad, speed_mPerS, angularSpeed_radPerS;
  double share;  ///< of OwnState::unit, of elements' states
  /** 1 mm and 10 m/s times accuracy, angles at kAngleLength_m. */
  static OdeTolerances of(double accuracy);
  static OdeTolerances of(const scene::GaitSpec& gait);
};

/** A KneeSystem as an initial value problem: y = (q, u), then the states of force elements.

 Prescribed coordinates `eliminated`: q are the free coordinates; the others are set from their curves, where the constraints hold exactly and
 nothing needs to be projected. Accelerations: M_ff u'_f = f_f - bias_f - M_fp u'_p with u'_p of the curves; scenes with states of elements
 need Simbody's, with multipliers of the constraints. Both are the same equations.
 `constraints`: q are all coordinates, and numConstraints() that of Simbody's constraints.

 Jacobian: differences of the multibody system, in which contact is linear: one evaluation of contact with its exact stiffness and damping, and
 2n of the rest. Error: about 1e-6 of the largest entry of a column. */
class KneeOde : public OdeProblem {
 public:
  enum class Prescribed { eliminated, constraints };
  KneeOde(const KneeSystem& knee, const SimTK::State& defaultState, const OdeTolerances& tolerances, Prescribed prescribed);

  int size() const override { return static_cast<int>(tolerances_.size()); }
  int numCoordinates() const override { return static_cast<int>(index_.size()); }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double t, const double* y, double* ydot) noexcept override;
  bool hasJacobian() const override { return knee_.contact().canLinearize(); }
  Evaluation calcJacobian(double t, const double* y, double* jacobian) noexcept override;
  std::string describeComponent(int component) const override;
  int numConstraints() const override { return constraints_; }
  Evaluation project(double t, double* y, double* error) noexcept override;
  Evaluation calcResidual(double t, const double* y, const double* ydot, const double* multipliers, double* residual) noexcept override;
  Evaluation calcResidualJacobian(double t, const double* y, const double* ydot, const double* multipliers, double c,
                                  double* jacobian) noexcept override;
  Evaluation calcMultipliers(double t, const double* y, double* ydot, double* multipliers) noexcept override;

  /** The input after `end` is not seen: what jumps there belongs to the next part. */
  void stopAt(double end) { end_ = end; }

  const KneeSystem& knee() const { return knee_; }
  /** The place in the State's u of unknown k. */
  int stateIndexOf(int k) const { return index_[static_cast<size_t>(k)]; }
  /** The coordinate that unknown k is. */
  int coordinateOf(int k) const { return unknown_[static_cast<size_t>(k)]; }
  /** The State with y in it, realized to Stage::Time. */
  const SimTK::State& setState(double t, const double* y);
  /** y of a State. */
  void readState(const SimTK::State& state, double* y) const;
  /** Whether contact and elements are valid at a State; failure() then says why not. */
  bool checkStatus(const SimTK::State& state);

  /** The state that begins a run: coordinates and rates, and force elements settled there. */
  std::vector<double> start(const scene::Coordinates& q, const scene::Coordinates& qdot);
  /** False when the pose is not valid; failure() then says why. */
  bool makeFrame(double t, const std::vector<double>& y, scene::Frame& frame);

  /** The longest step from y in which no free coordinate moves by more than kMostMove_m, with the accelerations of the last evaluation: a body in flight takes no step across
   a contact. Infinity without contact pairs. */
  double findLongestStep(const std::vector<double>& y) const;
  static constexpr double kMostMove_m = 0.5e-3;

  /** Compartments with pressure at the last evaluation. */
  int countTouching() const;
  /** The Jacobian that was made since this was last asked for; false: none. */
  bool takeJacobian(std::vector<double>& jacobian);
  /** Sum of the scalar forces of all compartments at the last evaluation. */
  double calcScalarForce_N() const;
  /** Mass matrix of the unknown coordinates at the last evaluation. */
  Eigen::MatrixXd calcMass();
  /** Fastest free translation of y [m/s]. */
  double findSpeed(const std::vector<double>& y) const;

  bool touched() const { return touched_; }
  /** Why the last evaluation was refused; empty when it was not. */
  const std::string& failure() const { return failure_; }
  std::string advice() const;
  /** Of all evaluations, also those of an integrator with a State of its own, which tells what its State has counted. */
  ArticularContactSubsystem::Counters counters() const;
  void setOtherCounters(const ArticularContactSubsystem::Counters& counters) { otherCounters_ = counters; }

 private:
  void setState(SimTK::State& state, double t, const double* y) const;
  /** y' at a State set by setState(). @return false: not finite */
  bool calcRates(SimTK::State& state, double t, const double* y, double* ydot);
  void calcResidual(SimTK::State& state, const double* y, const double* ydot, const double* multipliers, double* residual);
  bool checkStatus() { return checkStatus(state_); }
  bool hasContact() const;
  bool isNearGimbalLock();

  const KneeSystem& knee_;
  SimTK::State state_, linear_;    // linear_: contact is linear, for the Jacobian
  Prescribed prescribed_;
  bool eliminated_;                // accelerations without multipliers
  int constraints_ = 0;
  double end_ = SimTK::Infinity;
  std::vector<int> unknown_, index_;  // coordinates, and their places in the State's q and u
  std::vector<int> own_;
  std::vector<std::string> ownNames_;
  std::vector<double> tolerances_, steps_;
  SimTK::Vector udot_, residual_, lambda_, mu_, GTransposeMu_;
  SimTK::Matrix mass_;
  Eigen::MatrixXd massFree_;
  Eigen::VectorXd forceFree_;
  std::vector<double> lastRates_, lastJacobian_;
  bool newJacobian_ = false;
  std::vector<int> middleAngles_;  // second angles of floating joints: places in the State's q
  std::vector<double> yShifted_, ydotShifted_, rates_, ratesShifted_;
  ArticularContactSubsystem::Counters otherCounters_;
  std::string failure_;
  bool touched_ = false, fullPenetration_ = false, elementProblem_ = false, gimbal_ = false;
};

}  // namespace genu::model
