#pragma once

#include <string>
#include <vector>

#include "ReducedDynamics.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

/** A KneeSystem as an initial value problem: y = (q, u) of the free coordinates, then the states of force elements. Prescribed coordinates
 are set from their curves, where the constraints hold exactly and nothing needs to be projected.

 Accelerations: M_ff u'_f = f_f - bias_f - M_fp u'_p with u'_p of the curves (`eliminated`), or Simbody's with multipliers of the
 constraints. Both are the same equations.

 Jacobian: differences of the multibody system, in which contact is linear: one evaluation of contact with its exact stiffness and damping, and
 2n of the rest. Error: about 1e-6 of the largest entry of a column. */
class KneeOde : public OdeProblem {
 public:
  /** Absolute tolerances at accuracy 1: 1 mm and 10 m/s at the surfaces (angles: over kAngleLength_m), OwnState::unit of elements' states. */
  KneeOde(const KneeSystem& knee, const SimTK::State& defaultState, double accuracy, bool eliminated = true);

  int size() const override { return static_cast<int>(tolerances_.size()); }
  int numCoordinates() const override { return static_cast<int>(index_.size()); }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double t, const double* y, double* ydot) noexcept override;
  bool hasJacobian() const override { return knee_.contact().canLinearize(); }
  Evaluation calcJacobian(double t, const double* y, double* jacobian) noexcept override;

  /** The state that begins a run: coordinates and rates, and force elements settled there. */
  std::vector<double> start(const scene::Coordinates& q, const scene::Coordinates& qdot);
  /** False when the pose is not valid; failure() then says why. */
  bool makeFrame(double t, const std::vector<double>& y, scene::Frame& frame);

  bool touched() const { return touched_; }
  /** Why the last evaluation was refused; empty when it was not. */
  const std::string& failure() const { return failure_; }
  std::string advice() const;
  const ArticularContactSubsystem::Counters& counters() const { return knee_.contact().getCounters(state_); }

 private:
  void setState(SimTK::State& state, double t, const double* y) const;
  /** y' at a State set by setState(). @return false: not finite */
  bool calcRates(SimTK::State& state, double t, const double* y, double* ydot);
  bool checkStatus();
  bool hasContact() const;

  const KneeSystem& knee_;
  SimTK::State state_, linear_;    // linear_: contact is linear, for the Jacobian
  bool eliminated_;
  std::vector<int> free_, index_;  // coordinates, and their places in the State's q and u
  std::vector<int> own_;
  std::vector<double> tolerances_, steps_;
  SimTK::Vector udot_, residual_;
  SimTK::Matrix mass_;
  Eigen::MatrixXd massFree_;
  Eigen::VectorXd forceFree_;
  std::vector<double> yShifted_, rates_, ratesShifted_;
  std::string failure_;
  bool touched_ = false, fullPenetration_ = false, elementProblem_ = false;
};

}  // namespace genu::model
