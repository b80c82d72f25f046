#include "KneeOde.h"

#include <Eigen/Dense>
#include <cmath>

namespace genu::model {

using contact::EvaluationStatus;

OdeTolerances OdeTolerances::of(double accuracy) {
  const double length = 1e-3 * accuracy, speed = 10 * accuracy;
  return {length, length / kAngleLength_m, speed, speed / kAngleLength_m, accuracy};
}

OdeTolerances OdeTolerances::of(const scene::GaitSpec& gait) {
  OdeTolerances all = of(gait.accuracy);
  all.translation_m = gait.tolerances.translation_m.value_or(all.translation_m);
  all.angle_rad = gait.tolerances.angle_rad.value_or(all.angle_rad);
  all.speed_mPerS = gait.tolerances.speed_mPerS.value_or(all.speed_mPerS);
  all.angularSpeed_radPerS = gait.tolerances.angularSpeed_radPerS.value_or(all.angularSpeed_radPerS);
  return all;
}

KneeOde::KneeOde(const KneeSystem& knee, const SimTK::State& defaultState, const OdeTolerances& tolerances, Prescribed prescribed)
    : knee_(knee), state_(defaultState), linear_(defaultState), prescribed_(prescribed), eliminated_(prescribed == Prescribed::eliminated) {
  std::vector<bool> isAngle;
  for (int i = 0; i < knee.numCoordinates(); ++i) {
    if (prescribed == Prescribed::eliminated && knee.isPrescribed(i)) continue;
    unknown_.push_back(i);
    index_.push_back(knee.stateIndex(i));
    isAngle.push_back(knee.coordinates()[static_cast<size_t>(i)].isAngle);
  }
  // Differences for the Jacobian: 10 nm and 0.1 um/s at the surfaces, above rounding and far below any radius; inertia forces are quadratic in
  // the rates.
  for (const double step : {1e-8, 1e-7}) {
    for (const bool angle : isAngle) steps_.push_back(angle ? step / kAngleLength_m : step);
  }
  for (int i = 0; i < knee.numCoordinates(); ++i) {
    const scene::CoordinateInfo& c = knee.coordinates()[static_cast<size_t>(i)];
    if (c.axis == 1 && c.isAngle) middleAngles_.push_back(knee.stateIndex(i));
  }
  for (const bool angle : isAngle) tolerances_.push_back(angle ? tolerances.angle_rad : tolerances.translation_m);
  for (const bool angle : isAngle) tolerances_.push_back(angle ? tolerances.angularSpeed_radPerS : tolerances.speed_mPerS);
  for (const auto& element : knee.elements()) {
    for (const ForceElement::OwnState& own : element->states(state_)) {
      own_.push_back(own.index);
      ownNames_.push_back(element->definition().key());
      tolerances_.push_back(tolerances.share * own.unit);
      steps_.push_back(1e-7);
    }
  }
  // States of elements get their rates from Simbody at Stage::Acceleration, where the constraints are solved too.
  if (!own_.empty()) eliminated_ = false;
  if (prescribed == Prescribed::constraints) {
    knee.system().realize(state_, SimTK::Stage::Instance);
    constraints_ = state_.getNQErr();
    if (state_.getNUErr() != constraints_ || state_.getNMultipliers() != constraints_) {
      throw std::logic_error("constraints other than on coordinates cannot be integrated yet");
    }
    lambda_.resize(constraints_);
    mu_.resize(constraints_);
  }
  udot_.resize(knee.matter().getNumMobilities());
  const auto n = static_cast<Eigen::Index>(index_.size());
  massFree_.resize(n, n);
  forceFree_.resize(n);
}

void KneeOde::setState(SimTK::State& state, double t, const double* y) const {
  const double time = t < end_ ? t : std::nextafter(end_, -SimTK::Infinity);
  if (prescribed_ == Prescribed::eliminated) {
    knee_.prescribe(state, time, false);
  } else {
    state.setTime(time);
  }
  const size_t n = index_.size();
  SimTK::Vector& q = state.updQ();
  for (size_t k = 0; k < n; ++k) q[index_[k]] = y[k];
  SimTK::Vector& u = state.updU();
  for (size_t k = 0; k < n; ++k) u[index_[k]] = y[n + k];
  if (own_.empty()) return;
  SimTK::Vector& z = state.updZ();
  for (size_t k = 0; k < own_.size(); ++k) z[own_[k]] = y[2 * n + k];
}

const SimTK::State& KneeOde::setState(double t, const double* y) {
  setState(state_, t, y);
  knee_.system().realize(state_, SimTK::Stage::Time);
  return state_;
}

void KneeOde::readState(const SimTK::State& state, double* y) const {
  const size_t n = index_.size();
  for (size_t k = 0; k < n; ++k) y[k] = state.getQ()[index_[k]];
  for (size_t k = 0; k < n; ++k) y[n + k] = state.getU()[index_[k]];
  for (size_t k = 0; k < own_.size(); ++k) y[2 * n + k] = state.getZ()[own_[k]];
}

std::string KneeOde::describeComponent(int component) const {
  const auto k = static_cast<size_t>(component);
  const size_t n = index_.size();
  if (k >= 2 * n) return "the state of " + ownNames_[k - 2 * n];
  const std::string& name = knee_.coordinates()[static_cast<size_t>(unknown_[k % n])].name;
  return k < n ? "coordinate " + name : "rate of coordinate " + name;
}

OdeProblem::Evaluation KneeOde::project(double t, double* y, double* error) noexcept {
  try {
    setState(state_, t, y);
    const size_t n = index_.size();
    SimTK::Vector qError, uError;
    if (error != nullptr) {
      qError.resize(state_.getNQ());
      uError.resize(state_.getNU());
      qError = 0.0;
      uError = 0.0;
      for (size_t k = 0; k < n; ++k) qError[index_[k]] = error[k], uError[index_[k]] = error[n + k];
    }
    // Far below the tolerances of a step, far above rounding.
    SimTK::ProjectOptions options(1e-13);
    options.setOption(SimTK::ProjectOptions::ForceProjection);
    SimTK::ProjectResults results;
    knee_.system().realize(state_, SimTK::Stage::Position);
    knee_.system().projectQ(state_, qError, options, results);
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    knee_.system().projectU(state_, uError, options, results);
    readState(state_, y);
    if (error != nullptr) {
      for (size_t k = 0; k < n; ++k) error[k] = qError[index_[k]], error[n + k] = uError[index_[k]];
    }
    return Evaluation::ok;
  } catch (const std::exception& problem) {
    failure_ = problem.what();
    return Evaluation::retry;
  }
}

void KneeOde::calcResidual(SimTK::State& state, const double* y, const double* ydot, const double* multipliers, double* residual) {
  const SimTK::MultibodySystem& system = knee_.system();
  const size_t n = index_.size(), m = static_cast<size_t>(constraints_), z = own_.size();
  system.realize(state, own_.empty() ? SimTK::Stage::Dynamics : SimTK::Stage::Acceleration);
  for (size_t k = 0; k < n; ++k) udot_[index_[k]] = ydot[n + k];
  for (size_t k = 0; k < m; ++k) {
    lambda_[static_cast<int>(k)] = multipliers[k];
    mu_[static_cast<int>(k)] = multipliers[m + k];
  }
  knee_.matter().calcResidualForce(state, system.getMobilityForces(state, SimTK::Stage::Dynamics),
                                   system.getRigidBodyForces(state, SimTK::Stage::Dynamics), udot_, lambda_, residual_);
  knee_.matter().multiplyByGTranspose(state, mu_, GTransposeMu_);
  for (size_t k = 0; k < n; ++k) residual[k] = ydot[k] - y[n + k] - GTransposeMu_[index_[k]];
  for (size_t k = 0; k < n; ++k) residual[n + k] = residual_[index_[k]];
  for (size_t k = 0; k < z; ++k) residual[2 * n + k] = ydot[2 * n + k] - state.getZDot()[own_[k]];
  double* constraints = residual + 2 * n + z;
  for (size_t k = 0; k < m; ++k) constraints[k] = state.getQErr()[static_cast<int>(k)];
  for (size_t k = 0; k < m; ++k) constraints[m + k] = state.getUErr()[static_cast<int>(k)];
}

OdeProblem::Evaluation KneeOde::calcResidual(double t, const double* y, const double* ydot, const double* multipliers, double* residual) noexcept {
  try {
    setState(state_, t, y);
    if (isNearGimbalLock()) return Evaluation::retry;
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    if (!checkStatus()) return Evaluation::retry;
    calcResidual(state_, y, ydot, multipliers, residual);
    for (size_t i = 0; i < tolerances_.size() + 2 * static_cast<size_t>(constraints_); ++i) {
      if (std::isfinite(residual[i])) continue;
      failure_ = "a force or the rate of an element's state is not finite";
      return Evaluation::retry;
    }
    touched_ = touched_ || hasContact();
    lastRates_.assign(ydot, ydot + size());
    failure_.clear();
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

OdeProblem::Evaluation KneeOde::calcResidualJacobian(double t, const double* y, const double* ydot, const double* multipliers, double c,
                                                     double* jacobian) noexcept {
  try {
    setState(state_, t, y);
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    if (!checkStatus()) return Evaluation::retry;
    knee_.contact().useLinearization(linear_, knee_.contact().linearize(state_));
    const size_t n = tolerances_.size(), m = 2 * static_cast<size_t>(constraints_), all = n + m;
    yShifted_.assign(y, y + n);
    ydotShifted_.assign(ydot, ydot + n);
    std::vector<double> shifted(multipliers, multipliers + m);
    rates_.resize(all);
    ratesShifted_.resize(all);
    setState(linear_, t, y);
    calcResidual(linear_, y, ydot, multipliers, rates_.data());
    for (size_t j = 0; j < all; ++j) {
      double step = 1;  // the residual is linear in the multipliers
      if (j < n) {
        yShifted_[j] = y[j] + steps_[j];
        step = yShifted_[j] - y[j];
        ydotShifted_[j] = ydot[j] + c * step;
      } else {
        shifted[j - n] += 1;
      }
      setState(linear_, t, yShifted_.data());
      calcResidual(linear_, yShifted_.data(), ydotShifted_.data(), shifted.data(), ratesShifted_.data());
      for (size_t i = 0; i < all; ++i) jacobian[j * all + i] = (ratesShifted_[i] - rates_[i]) / step;
      if (j < n) {
        yShifted_[j] = y[j];
        ydotShifted_[j] = ydot[j];
      } else {
        shifted[j - n] = multipliers[j - n];
      }
    }
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

OdeProblem::Evaluation KneeOde::calcMultipliers(double t, const double* y, double* ydot, double* multipliers) noexcept {
  const Evaluation evaluation = evaluate(t, y, ydot);
  if (evaluation != Evaluation::ok) return evaluation;
  for (int k = 0; k < constraints_; ++k) {
    multipliers[k] = state_.getMultipliers()[k];
    multipliers[constraints_ + k] = 0;
  }
  return Evaluation::ok;
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
    if (isNearGimbalLock()) return Evaluation::retry;
    knee_.system().realize(state_, SimTK::Stage::Velocity);
    if (!checkStatus()) return Evaluation::retry;
    if (!calcRates(state_, t, y, ydot)) {
      failure_ = "an acceleration or the rate of an element's state is not finite";
      return Evaluation::retry;
    }
    touched_ = touched_ || hasContact();
    lastRates_.assign(ydot, ydot + size());
    failure_.clear();
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

bool KneeOde::isNearGimbalLock() {
  // The rotations' rates grow by 1/cos: at 1e-7 rad nine digits of the accelerations are left.
  constexpr double kNearest_rad = 1e-7;
  for (const int k : middleAngles_) {
    if (std::abs(std::cos(state_.getQ()[k])) > kNearest_rad) continue;
    failure_ = "ry of a floating joint is at 90 degrees, where rx and rz turn about the same axis (gimbal lock); give the joint another frame, or keep ry below 89 degrees";
    gimbal_ = true;
    return true;
  }
  gimbal_ = false;
  return false;
}

double KneeOde::findLongestStep(const std::vector<double>& y) const {
  double longest = SimTK::Infinity;
  const size_t n = index_.size();
  if (knee_.contact().numContactPairs() == 0 || lastRates_.size() != y.size()) return longest;
  // Near gimbal lock angles run without anything moving.
  bool anglesCount = true;
  for (const int k : middleAngles_) anglesCount = anglesCount && std::abs(std::cos(state_.getQ()[k])) > 0.05;
  for (size_t k = 0; k < n; ++k) {
    const bool isAngle = knee_.coordinates()[static_cast<size_t>(unknown_[k])].isAngle;
    if (knee_.isPrescribed(unknown_[k]) || (isAngle && !anglesCount)) continue;
    const double length = isAngle ? kMostMove_m / kAngleLength_m : kMostMove_m;
    // |v| h + |a| h^2 / 2 = length
    const double v = std::abs(y[n + k]), a = std::abs(lastRates_[n + k]);
    if (v > 0 || a > 0) longest = std::min(longest, 2 * length / (v + std::sqrt(v * v + 2 * a * length)));
  }
  return longest;
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
    lastJacobian_.assign(jacobian, jacobian + n * n);
    newJacobian_ = true;
    return Evaluation::ok;
  } catch (const std::exception& error) {
    failure_ = error.what();
    return Evaluation::retry;
  }
}

std::vector<double> KneeOde::start(const scene::Coordinates& q, const scene::Coordinates& qdot) {
  SimTK::State settled = state_;
  knee_.prescribe(settled, 0, false);
  for (size_t k = 0; k < index_.size(); ++k) {
    if (knee_.isPrescribed(unknown_[k])) continue;  // from its curve
    settled.updQ()[index_[k]] = q[static_cast<size_t>(unknown_[k])];
    settled.updU()[index_[k]] = qdot[static_cast<size_t>(unknown_[k])];
  }
  std::vector<double> y(tolerances_.size());
  if (!own_.empty()) {
    const SimTK::Vector u = settled.getU();
    settled.updU() = 0.0;
    knee_.settleElements(settled);
    settled.updU() = u;
  }
  readState(settled, y.data());
  return y;
}

bool KneeOde::makeFrame(double t, const std::vector<double>& y, scene::Frame& frame) {
  try {
    if (constraints_ > 0) {  // between steps an interpolated state is off the constraints
      std::vector<double> projected = y;
      if (project(t, projected.data(), nullptr) != Evaluation::ok) return false;
      setState(state_, t, projected.data());
    } else {
      setState(state_, t, y.data());
    }
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
    SimTK::Vector force;
    if (constraints_ > 0) {
      knee_.matter().multiplyByGTranspose(state_, state_.getMultipliers(), force);
      force *= -1.0;
    } else {  // what inverse dynamics without the constraints asks for is what they would supply
      knee_.matter().calcResidualForceIgnoringConstraints(state_, system.getMobilityForces(state_, SimTK::Stage::Dynamics),
                                                          system.getRigidBodyForces(state_, SimTK::Stage::Dynamics), state_.getUDot(), force);
    }
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

ArticularContactSubsystem::Counters KneeOde::counters() const {
  ArticularContactSubsystem::Counters all = knee_.contact().getCounters(state_);
  all.evaluations += otherCounters_.evaluations;
  all.copies += otherCounters_.copies;
  all.distanceQueries += otherCounters_.distanceQueries;
  return all;
}

std::string KneeOde::advice() const {
  if (!failure_.empty() && fullPenetration_) {
    return "; the layer is too thin or too soft for the load, or the prescribed motion pushes one body through the "
           "other; check units of modulus, thickness and load";
  }
  if (elementProblem_ || gimbal_) return {};  // it says itself what to do
  return "; check loads, mass and prescribed motion, or try another accuracy";
}

bool KneeOde::checkStatus(const SimTK::State& state) {
  const EvaluationStatus status = knee_.contact().getStatus(state);
  if (status > EvaluationStatus::extrapolated) {
    fullPenetration_ = status == EvaluationStatus::fullPenetration;
    failure_ = fullPenetration_ ? "full penetration" : "a closest-point query did not converge";
    return false;
  }
  const std::string problem = knee_.findElementProblem(state);
  elementProblem_ = !problem.empty();
  if (!elementProblem_) return true;
  failure_ = problem;
  return false;
}

int KneeOde::countTouching() const {
  int touching = 0;
  for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
    for (const contact::NetLoad& load : knee_.contact().getDampedResult(state_, i).compartments) touching += load.activeElements > 0 ? 1 : 0;
  }
  return touching;
}

bool KneeOde::takeJacobian(std::vector<double>& jacobian) {
  if (!newJacobian_) return false;
  jacobian = lastJacobian_;
  newJacobian_ = false;
  return true;
}

double KneeOde::calcScalarForce_N() const {
  double force = 0;
  for (int i = 0; i < knee_.contact().numContactPairs(); ++i) force += knee_.contact().getDampedResult(state_, i).total.scalarForce_N;
  return force;
}

Eigen::MatrixXd KneeOde::calcMass() {
  knee_.matter().calcM(state_, mass_);
  const size_t n = index_.size();
  Eigen::MatrixXd mass(n, n);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j < n; ++j) mass(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = mass_(index_[i], index_[j]);
  }
  return mass;
}

double KneeOde::findSpeed(const std::vector<double>& y) const {
  double fastest = 0;
  for (size_t k = 0; k < index_.size(); ++k) {
    if (knee_.isPrescribed(unknown_[k]) || knee_.coordinates()[static_cast<size_t>(unknown_[k])].isAngle) continue;
    fastest = std::max(fastest, std::abs(y[index_.size() + k]));
  }
  return fastest;
}

bool KneeOde::hasContact() const {
  for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
    if (knee_.contact().getDampedResult(state_, i).total.activeElements > 0) return true;
  }
  return false;
}

}  // namespace genu::model
