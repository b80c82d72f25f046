#include <Simbody.h>
#include <simmath/internal/SimTKcpodes.h>

#include <algorithm>
#include <cmath>

#include "OdeIntegrators.h"

namespace genu::model {

namespace {

using SimTK::CPodes;
using SimTK::Vector;

/** Simbody's CPODES through its own interface instead of SimTK::CPodesIntegrator: that class fixes the tolerances at
 accuracy (relative) and accuracy/10 (absolute, the same for m, rad, m/s and rad/s). */
class CPodesDriver : public OdeIntegrator, private SimTK::CPodesSystem {
 public:
  CPodesDriver(OdeProblem& problem, int maxOrder)
      : problem_(problem), maxOrder_(maxOrder), y_(problem.size()), yDot_(problem.size()) {}

  std::string name() const override { return "cpodes"; }

  bool initialize(double t0, const std::vector<double>& y0, double stopTime) override {
    cpodes_ = std::make_unique<CPodes>(CPodes::ExplicitODE, CPodes::BDF, CPodes::Newton);
    error_.clear();
    evaluations_ = 0;
    time_ = t0;
    for (int i = 0; i < y_.size(); ++i) y_[i] = y0[static_cast<size_t>(i)];
    if (explicitODE(t0, y_, yDot_) != CPodes::Success) {
      error_ = "the start is not a valid state";
      return false;
    }
    if (cpodes_->init(*this, t0, y_, yDot_, CPodes::WeightFunction, 0, nullptr) != CPodes::Success) {
      error_ = "CPODES could not be initialized: " + message_;
      return false;
    }
    if (problem_.numConstraints() > 0) {
      cpodes_->projDefine();
      cpodes_->setProjUpdateErrEst(true);
    }
    cpodes_->setErrHandlerFn();
    cpodes_->setEwtFn();
    cpodes_->setMaxOrd(maxOrder_);
    cpodes_->lapackDense(y_.size());
    stop_ = stopTime;
    cpodes_->setStopTime(stopTime);
    // CPODES derives its first step from y'; from y' = 0 it makes NaN. The error test corrects a step that is too long.
    bool atRest = true;
    for (int i = 0; i < yDot_.size(); ++i) atRest = atRest && yDot_[i] == 0;
    if (atRest) cpodes_->setInitStep(kFirstStepAtRest * (stopTime - t0));
    // Ends the creeping towards a state that cannot be passed, such as full penetration.
    cpodes_->setMinStep(kSmallestStep * (stopTime - t0));
    return true;
  }

  bool step() override {
    const int flag = cpodes_->step(kFarAhead_s, &time_, y_, yDot_, CPodes::OneStepTstop);
    if (flag >= 0) return true;
    error_ = message_.empty() ? "CPODES failed with code " + std::to_string(flag) : message_;
    return false;
  }

  double time() const override { return time_; }

  bool continueTo(double stopTime) override {
    stop_ = stopTime;
    return cpodes_->setStopTime(stopTime) == CPodes::Success;
  }

  void limitStep(double longest) override {
    cpodes_->setMaxStep(std::min(longest, 1e30));
    cpodes_->setStopTime(std::min(stop_, time_ + longest));  // the length of the next step is chosen already
  }

  int worstComponent() override {
    Vector errors(y_.size());
    if (cpodes_->getEstLocalErrors(errors) != CPodes::Success) return -1;
    return findWorst(&errors[0], problem_.absoluteTolerances());
  }

  bool getStepErrors(std::vector<double>& errors) override {
    Vector values(y_.size());
    if (cpodes_->getEstLocalErrors(values) != CPodes::Success) return false;
    errors.assign(&values[0], &values[0] + values.size());
    return true;
  }

  bool interpolate(double t, std::vector<double>& y) override {
    Vector dense(y_.size());
    if (cpodes_->getDky(t, 0, dense) != CPodes::Success) return false;
    y.assign(static_cast<size_t>(y_.size()), 0.0);
    for (int i = 0; i < y_.size(); ++i) y[static_cast<size_t>(i)] = dense[i];
    return true;
  }

  Statistics statistics() override {
    Statistics statistics;
    int steps = 0, errorFailures = 0, convergenceFailures = 0;
    cpodes_->getNumSteps(&steps);
    cpodes_->getNumErrTestFails(&errorFailures);
    cpodes_->getNumNonlinSolvConvFails(&convergenceFailures);
    statistics.stepsTaken = steps;
    statistics.errorTestFailures = errorFailures;
    statistics.convergenceFailures = convergenceFailures;
    statistics.stepsAttempted = steps + errorFailures + convergenceFailures;
    statistics.evaluations = evaluations_;
    return statistics;
  }

  const std::string& errorText() const override { return error_; }

 private:
  int explicitODE(double t, const Vector& y, Vector& yDot) const override {
    ++evaluations_;
    yDot.resize(y.size());
    switch (problem_.evaluate(t, &y[0], &yDot[0])) {
      case OdeProblem::Evaluation::ok:
        return CPodes::Success;
      case OdeProblem::Evaluation::retry:
        return CPodes::RecoverableError;
      default:
        return CPodes::UnrecoverableError;
    }
  }

  int project(SimTK::Real t, const Vector& y, Vector& correction, SimTK::Real, Vector& error) const override {
    ++evaluations_;
    correction = y;
    const bool withError = error.size() == y.size();
    if (problem_.project(t, &correction[0], withError ? &error[0] : nullptr) != OdeProblem::Evaluation::ok) return CPodes::RecoverableError;
    correction -= y;
    return CPodes::Success;
  }

  int weight(const Vector& y, Vector& weights) const override {
    weights.resize(y.size());
    for (int i = 0; i < y.size(); ++i) weights[i] = 1 / problem_.absoluteTolerances()[static_cast<size_t>(i)];
    return CPodes::Success;
  }

  void errorHandler(int code, const char*, const char*, char* message) const override {
    if (code < 0) message_ = message;
  }

  static constexpr double kSmallestStep = 1e-10, kFirstStepAtRest = 1e-5;  // of the run
  static constexpr double kFarAhead_s = 1e300;    // the stop time ends the run; this is only a direction

  OdeProblem& problem_;
  int maxOrder_;
  std::unique_ptr<CPodes> cpodes_;
  Vector y_, yDot_;
  double time_ = 0, stop_ = 0;
  std::string error_;
  mutable std::string message_;
  mutable long evaluations_ = 0;
};

}  // namespace

std::unique_ptr<OdeIntegrator> makeCPodesDriver(OdeProblem& problem, const OdeSettings& settings) {
  return std::make_unique<CPodesDriver>(problem, settings.maxOrder > 0 ? settings.maxOrder : 2);
}

}  // namespace genu::model
