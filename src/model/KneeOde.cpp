#include "KneeOde.h"

#include <Eigen/Dense>
#include <cmath>

namespace genu::model {

using contact::EvaluationStatus;

KneeOde::KneeOde(const KneeSystem& knee, const SimTK::State& defaultState, double accuracy, bool eliminated)
    : knee_(knee), state_(defaultState), linear_(defaultState), eliminated_(eliminated) {
  std::vector<double> units;
  for (int i = 0; i < knee.numCoordinates(); ++i) {
    if (knee.isPrescribed(i)) continue;
    free_.push_back(i);
    index_.push_back(knee.stateIndex(i));
    units.push_back(knee.coordinates()[static_cast<size_t>(i)].isAngle ? 1 / kAngleLength_m : 1.0);
  }
  // Differences for the Jacobian: 10 nm and 0.1 um/s at the surfaces, above rounding and far below any radius; inertia forces are quadratic in
  // the rates.
  for (const double step : {1e-8, 1e-7}) {
    for (const double unit : units) steps_.push_back(step * unit);
  }
  for (const double scale : {1e-3, 10.0}) {
    for (const double unit : units) tolerances_.push_back(accuracy * scale * unit);
  }
  for (const auto& element : knee.elements()) {
    for (const ForceElement::OwnState& own : element->states(state_)) {
      own_.push_back(own.index);
      tolerances_.push_back(accuracy * own.unit);
      steps_.push_back(1e-7);
    }
  }
  // States of elements get their rates from Simbody at Stage::Acceleration, where the constraints are solved too.
  if (!own_.empty()) eliminated_ = false;
  udot_.resize(knee.matter().getNumMobilities());
  const auto n = static_cast<Eigen::Index>(index_.size());
  massFree_.resize(n, n);
  forceFree_.resize(n);
}

void KneeOde::setState(SimTK::State& state, double t, const double* y) const {
  knee_.prescribe(state, t, false);
  const size_t n = index_.size();
  SimTK::Vector& q = state.updQ();
  for (size_t k = 0; k < n; ++k) q[index_[k]] = y[k];
  SimTK::Vector& u = state.updU();
  for (size_t k = 0; k < n; ++k) u[index_[k]] = y[n + k];
  if (own_.empty()) return;
  SimTK::Vector& z = state.updZ();
  for (size_t k = 0; k < own_.size(); ++k) z[own_[k]] = y[2 * n + k];
}

bool KneeOde::calcRates(SimTK::State& state, double t, const double* y, double* ydot) {
  const SimTK::MultibodySystem& system = knee_.system();
  const size_t n = index_.size();
  for (size_t k = 0; k < n; ++k) ydot[k] = y[n + k];
  if (eliminated_) {
    system.realize(state, SimTK::Stage::Dynamics);
    udot_ = 0.0;
    for (int i = 0; i < knee_.numCoordinates(); ++i) {
      if (knee_.isPrescribed(i)) udot_[knee_.stateIndex(i)] = knee_.motion(i).calcDerivative(t, 2);
    }
    knee_.matter().calcResidualForceIgnoringConstraints(state, system.getMobilityForces(state, SimTK::Stage::Dynamics),
                                                        system.getRigidBodyForces(state, SimTK::Stage::Dynamics), udot_, residual_);
    knee_.matter().calcM(state, mass_);
    for (size_t k = 0; k < n; ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      forceFree_[row] = -residual_[index_[k]];
      for (size_t j = 0; j < n; ++j) massFree_(row, static_cast<Eigen::Index>(j)) = mass_(index_[k], index_[j]);
    }
    forceFree_ = massFree_.ldlt().solve(forceFree_);
    for (size_t k = 0; k < n; ++k) ydot[n + k] = forceFree_[static_cast<Eigen::Index>(k)];
  } else {
    system.realize(state, SimTK::Stage::Acceleration);
    for (size_t k = 0; k < n; ++k) ydot[n + k] = state.getUDot()[index_[k]];
    for (size_t k = 0; k < own_.size(); ++k) ydot[2 * n + k] = state.getZDot()[own_[k]];
  }
  for (int i = 0; i < size(); ++i) {
    if (!std::isfinite(ydot[i])) return false;
  }
  return true;
}

OdeProblem::Evaluation KneeOde::evaluate(double t, const double* y, double* ydot) noexcept {
  try {
    setState(state_, t, y);
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    if (!checkStatus()) return Evaluation::retry;
    if (!calcRates(state_, t, y, ydot)) {
      failure_ = "an acceleration or the rate of an element's state is not finite";
      return Evaluation::retry;
    }
    touched_ = touched_ || hasContact();
    failure_.clear();
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

OdeProblem::Evaluation KneeOde::calcJacobian(double t, const double* y, double* jacobian) noexcept {
  try {
    setState(state_, t, y);
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    if (!checkStatus()) return Evaluation::retry;
    knee_.contact().useLinearization(linear_, knee_.contact().linearize(state_));
    const size_t n = tolerances_.size();
    yShifted_.assign(y, y + n);
    rates_.resize(n);
    ratesShifted_.resize(n);
    setState(linear_, t, y);
    if (!calcRates(linear_, t, y, rates_.data())) return Evaluation::retry;
    for (size_t j = 0; j < n; ++j) {
      yShifted_[j] = y[j] + steps_[j];
      setState(linear_, t, yShifted_.data());
      if (!calcRates(linear_, t, yShifted_.data(), ratesShifted_.data())) return Evaluation::retry;
      const double step = yShifted_[j] - y[j];
      for (size_t i = 0; i < n; ++i) jacobian[j * n + i] = (ratesShifted_[i] - rates_[i]) / step;
      yShifted_[j] = y[j];
    }
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

std::vector<double> KneeOde::start(const scene::Coordinates& q, const scene::Coordinates& qdot) {
  std::vector<double> y;
  for (int i : free_) y.push_back(q[static_cast<size_t>(i)]);
  for (int i : free_) y.push_back(qdot[static_cast<size_t>(i)]);
  if (own_.empty()) return y;
  SimTK::State settled = state_;
  knee_.prescribe(settled, 0, true);
  settled.updU() = 0.0;
  for (size_t k = 0; k < index_.size(); ++k) settled.updQ()[index_[k]] = y[k];
  knee_.settleElements(settled);
  for (const int index : own_) y.push_back(settled.getZ()[index]);
  return y;
}

bool KneeOde::makeFrame(double t, const std::vector<double>& y, scene::Frame& frame) {
  try {
    setState(state_, t, y.data());
    const SimTK::MultibodySystem& system = knee_.system();
    system.realize(state_, SimTK::Stage::Position);
    for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
      frame.contacts.push_back(knee_.contact().getResultWithEnergy(state_, i));
    }
    if (!checkStatus()) return false;
    system.realize(state_, SimTK::Stage::Acceleration);
    for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
      if (knee_.contact().contactPair(i).definition().damping_sPerM > 0) {
        frame.contacts[static_cast<size_t>(i)] = knee_.contact().calcDampedResultWithEnergy(state_, i);
      }
    }
    frame.time_s = t;
    frame.elements = knee_.calcElementOutputs(state_);
    touched_ = touched_ || hasContact();
    // What inverse dynamics without the constraints asks for is what the constraints supply.
    SimTK::Vector force;
    knee_.matter().calcResidualForceIgnoringConstraints(state_, system.getMobilityForces(state_, SimTK::Stage::Dynamics),
                                                        system.getRigidBodyForces(state_, SimTK::Stage::Dynamics), state_.getUDot(), force);
    for (int i = 0; i < knee_.numCoordinates(); ++i) {
      const int k = knee_.stateIndex(i);
      frame.q.push_back(state_.getQ()[k]);
      frame.qdot.push_back(state_.getU()[k]);
      frame.qddot.push_back(state_.getUDot()[k]);
      frame.constraintForce.push_back(knee_.isPrescribed(i) ? force[k] : 0.0);
    }
    return true;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return false;
  }
}

std::string KneeOde::advice() const {
  if (!failure_.empty() && fullPenetration_) {
    return "; the layer is too thin or too soft for the load, or the prescribed motion pushes one body through the "
           "other; check units of modulus, thickness and load";
  }
  if (elementProblem_) return {};  // it says itself what to do
  return "; check loads, mass and prescribed motion, or try another accuracy";
}

bool KneeOde::checkStatus() {
  const EvaluationStatus status = knee_.contact().getStatus(state_);
  if (status > EvaluationStatus::extrapolated) {
    fullPenetration_ = status == EvaluationStatus::fullPenetration;
    failure_ = fullPenetration_ ? "full penetration" : "a closest-point query did not converge";
    return false;
  }
  const std::string problem = knee_.findElementProblem(state_);
  elementProblem_ = !problem.empty();
  if (!elementProblem_) return true;
  failure_ = problem;
  return false;
}

bool KneeOde::hasContact() const {
  for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
    if (knee_.contact().getDampedResult(state_, i).total.activeElements > 0) return true;
  }
  return false;
}

}  // namespace genu::model
