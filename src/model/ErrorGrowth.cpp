#include "ErrorGrowth.h"

#include <algorithm>
#include <cmath>

#include "genu/model/Analysis.h"

namespace genu::model {

ErrorGrowth::ErrorGrowth(KneeOde& ode) : ode_(ode), size_(ode.size()), n_(ode.numCoordinates()) {
  scale_.resize(n_);
  for (int k = 0; k < n_; ++k) {
    const int coordinate = ode.coordinateOf(k);
    scale_[k] = ode.knee().coordinates()[static_cast<size_t>(coordinate)].isAngle ? kAngleLength_m : 1.0;
    if (!ode.knee().isPrescribed(coordinate)) free_.push_back(k);
  }
  error_ = Eigen::VectorXd::Zero(size_);
}

bool ErrorGrowth::updateJacobian(double t, const std::vector<double>& y) {
  const double force_N = ode_.calcScalarForce_N();
  const int touching = ode_.countTouching();
  const bool fresh = ode_.takeJacobian(values_);
  supplied_ = supplied_ || fresh;
  const bool changed = jacobian_.size() == 0 || touching != touching_ || (!supplied_ && (std::abs(force_N - force_N_) > 0.25 * force_N_ || ++age_ >= kMostSteps));
  if (!fresh && !changed) return true;
  if (!fresh) {
    values_.resize(static_cast<size_t>(size_ * size_));
    if (ode_.calcJacobian(t, y.data(), values_.data()) != OdeProblem::Evaluation::ok) return false;
    ode_.takeJacobian(values_);
  }
  jacobian_ = Eigen::Map<const Eigen::MatrixXd>(values_.data(), size_, size_);
  mass_ = ode_.calcMass();
  touching_ = touching;
  force_N_ = force_N;
  age_ = 0;
  return true;
}

void ErrorGrowth::addStep(double t, double h, const std::vector<double>& y, const std::vector<double>& stepErrors) {
  if (!updateJacobian(t, y)) return;
  const double a = first_ ? 1 : 1.5;
  first_ = false;
  const Eigen::MatrixXd hJ = h * jacobian_, one = Eigen::MatrixXd::Identity(size_, size_);
  const Eigen::Map<const Eigen::VectorXd> d(stepErrors.data(), size_);
  error_ = (one - 0.5 * hJ).partialPivLu().solve(error_ + 0.5 * hJ * error_) + (a * one - hJ).partialPivLu().solve(a * d);

  const Eigen::VectorXd forces = mass_ * (jacobian_.middleRows(n_, n_) * error_);
  double worst = 0;
  for (const int k : free_) {
    pose_m_ = std::max(pose_m_, scale_[k] * std::abs(error_[k]));
    worst = std::max(worst, std::abs(forces[k]) / scale_[k]);
  }
  errorSum_ += h * worst;
  forceSum_ += h * ode_.calcScalarForce_N();
}

}  // namespace genu::model
