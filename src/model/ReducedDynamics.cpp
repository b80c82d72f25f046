#include "ReducedDynamics.h"

#include <Eigen/Dense>
#include <cmath>

namespace genu::model {

using contact::EvaluationStatus;
using Eigen::VectorXd;

ReducedDynamics::ReducedDynamics(const KneeSystem& knee, const SimTK::State& defaultState, double time_s)
    : knee_(knee), state_(defaultState), linear_(defaultState), time_(time_s) {
  const int n = knee.numCoordinates();
  if (state_.getNU() != n) {
    throw InputError("the system has " + std::to_string(state_.getNU()) + " mobilities; static and gait analyses work on the " +
                     std::to_string(n) + " coordinates of the scene");
  }
  for (int i = 0; i < n; ++i) {
    if (knee.isPrescribed(i)) continue;
    free_.push_back(i);
    index_.push_back(knee.stateIndex(i));
    scale_.push_back(knee.coordinates()[static_cast<size_t>(i)].isAngle ? 1 / kAngleLength_m : 1.0);
  }
  zeroUDot_.resize(n);
  zeroUDot_ = 0.0;
  udot_ = zeroUDot_;
  state_.updU() = 0.0;
  knee_.prescribe(state_, time_, true);
  linear_.updU() = 0.0;
  knee_.prescribe(linear_, time_, true);
}

int ReducedDynamics::findFree(int coordinate) const {
  for (size_t k = 0; k < free_.size(); ++k) {
    if (free_[k] == coordinate) return static_cast<int>(k);
  }
  return -1;
}

scene::Coordinates ReducedDynamics::coordinates(const VectorXd& z) const {
  scene::Coordinates q(static_cast<size_t>(knee_.numCoordinates()));
  for (int i = 0; i < knee_.numCoordinates(); ++i) {
    const int k = findFree(i);
    q[static_cast<size_t>(i)] = k < 0 ? knee_.motion(i).calcValue(time_) : scale_[static_cast<size_t>(k)] * z[k];
  }
  return q;
}

VectorXd ReducedDynamics::scaled(const scene::Coordinates& q) const {
  VectorXd z(numFree());
  for (int k = 0; k < numFree(); ++k) {
    z[k] = q[static_cast<size_t>(free_[static_cast<size_t>(k)])] / scale_[static_cast<size_t>(k)];
  }
  return z;
}

scene::Coordinates ReducedDynamics::coordinateRates(const VectorXd& v) const {
  scene::Coordinates qdot(static_cast<size_t>(knee_.numCoordinates()), 0.0);
  for (int k = 0; k < numFree(); ++k) qdot[static_cast<size_t>(free_[static_cast<size_t>(k)])] = scale_[static_cast<size_t>(k)] * v[k];
  return qdot;
}

VectorXd ReducedDynamics::scales() const { return Eigen::Map<const VectorXd>(scale_.data(), numFree()); }

void ReducedDynamics::setPose(SimTK::State& state, const VectorXd& z) const {
  SimTK::Vector& q = state.updQ();
  for (int k = 0; k < numFree(); ++k) q[index_[static_cast<size_t>(k)]] = scale_[static_cast<size_t>(k)] * z[k];
  knee_.system().realize(state, SimTK::Stage::Position);
  for (const auto& element : knee_.elements()) element->settle(state);
}

const SimTK::State& ReducedDynamics::setPose(const VectorXd& z) {
  setPose(state_, z);
  return state_;
}

EvaluationStatus ReducedDynamics::evaluate(const SimTK::Vector& udot, VectorXd& r) {
  EvaluationStatus status = knee_.contact().getStatus(state_);
  problem_ = isValid(status) ? knee_.findElementProblem(state_) : std::string();
  if (!problem_.empty()) status = EvaluationStatus::notConverged;
  calcForce(state_, udot, r);
  return r.allFinite() ? status : EvaluationStatus::notConverged;
}

void ReducedDynamics::calcForce(SimTK::State& state, const SimTK::Vector& udot, VectorXd& r) {
  const SimTK::MultibodySystem& system = knee_.system();
  r.resize(numFree());
  system.realize(state, SimTK::Stage::Dynamics);
  // M udot + bias - applied forces: the force that would have to be added.
  knee_.matter().calcResidualForceIgnoringConstraints(state, system.getMobilityForces(state, SimTK::Stage::Dynamics),
                                                      system.getRigidBodyForces(state, SimTK::Stage::Dynamics), udot,
                                                      residual_);
  for (int k = 0; k < numFree(); ++k) {
    r[k] = -scale_[static_cast<size_t>(k)] * residual_[index_[static_cast<size_t>(k)]];
  }
}

/** At rest. */
void ReducedDynamics::linearize(const VectorXd& z) {
  state_.updU() = 0.0;
  setPose(z);
  knee_.system().realize(state_, SimTK::Stage::Velocity);
  about_ = knee_.contact().linearize(state_);
  aboutZ_ = z;
}

EvaluationStatus ReducedDynamics::calcStaticForce(const VectorXd& z, VectorXd& r, bool stiffnessToo) {
  if (stiffnessToo && canLinearize()) {
    linearize(z);
    return evaluate(zeroUDot_, r);
  }
  state_.updU() = 0.0;
  setPose(z);
  return evaluate(zeroUDot_, r);
}

EvaluationStatus ReducedDynamics::calcDynamicResidual(const VectorXd& z, const VectorXd& v, const VectorXd& a,
                                                      VectorXd& r) {
  SimTK::Vector& u = state_.updU();
  u = 0.0;
  udot_ = 0.0;
  for (int k = 0; k < numFree(); ++k) {
    const int i = index_[static_cast<size_t>(k)];
    u[i] = scale_[static_cast<size_t>(k)] * v[k];
    udot_[i] = scale_[static_cast<size_t>(k)] * a[k];
  }
  setPose(z);
  return evaluate(udot_, r);
}

bool ReducedDynamics::calcStiffness(const VectorXd& z, const VectorXd& r0, Eigen::MatrixXd& K) {
  K.resize(numFree(), numFree());
  VectorXd shifted = z, r;
  if (canLinearize()) {
    if (aboutZ_.size() != z.size() || aboutZ_ != z) linearize(z);
    for (const auto& about : about_) {
      if (!isValid(about.at.status)) return false;
    }
    knee_.contact().useLinearization(linear_, about_);
    VectorXd at;
    setPose(linear_, z);
    calcForce(linear_, zeroUDot_, at);
    for (int k = 0; k < numFree(); ++k) {
      shifted[k] = z[k] + kDifference_m;
      setPose(linear_, shifted);
      calcForce(linear_, zeroUDot_, r);
      K.col(k) = (at - r) / (shifted[k] - z[k]);
      shifted[k] = z[k];
    }
    return K.allFinite();
  }
  for (int k = 0; k < numFree(); ++k) {
    double step = kDifference_m;
    bool valid = false;
    for (int attempt = 0; attempt < 2 && !valid; ++attempt, step = -step) {
      shifted[k] = z[k] + step;
      if (isValid(calcStaticForce(shifted, r))) {
        K.col(k) = (r0 - r) / (shifted[k] - z[k]);
        valid = true;
      }
    }
    if (!valid) return false;
    shifted[k] = z[k];
  }
  return true;
}

double ReducedDynamics::calcRestAcceleration(const VectorXd& r) {
  const int n = numFree();
  if (n == 0) return 0;
  SimTK::Matrix M;
  knee_.matter().calcM(state_, M);
  Eigen::MatrixXd Mff(n, n);
  VectorXd force(n);
  for (int k = 0; k < n; ++k) {
    force[k] = r[k] / scale_[static_cast<size_t>(k)];
    for (int j = 0; j < n; ++j) Mff(k, j) = M(index_[static_cast<size_t>(k)], index_[static_cast<size_t>(j)]);
  }
  return Mff.ldlt().solve(force).cwiseAbs().maxCoeff();
}

std::vector<double> ReducedDynamics::calcHoldingForces() {
  VectorXd r;
  evaluate(zeroUDot_, r);
  std::vector<double> forces;
  for (int i = 0; i < knee_.numCoordinates(); ++i) forces.push_back(residual_[knee_.stateIndex(i)]);
  return forces;
}

bool ReducedDynamics::hasContact() const {
  for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
    if (knee_.contact().getResult(state_, i).total.activeElements > 0) return true;
  }
  return false;
}

}  // namespace genu::model
