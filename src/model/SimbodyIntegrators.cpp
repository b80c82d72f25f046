#include <Simbody.h>

#include <algorithm>
#include <cmath>

#include "KneeOde.h"
#include "OdeIntegrators.h"

namespace genu::model {

namespace {

/** Simbody's integrators on the system itself, prescribed coordinates as constraints. They weigh errors in their own way: here every rate by its tolerance,
 and coordinates by the same number without the unit of time. */
class SimbodyDriver : public OdeIntegrator {
 public:
  using Make = std::unique_ptr<SimTK::Integrator> (*)(const SimTK::System&);
  SimbodyDriver(std::string name, OdeProblem& problem, Make make)
      : name_(std::move(name)), problem_(dynamic_cast<KneeOde*>(&problem)), make_(make) {}

  std::string name() const override { return name_; }

  bool initialize(double t0, const std::vector<double>& y0, double stopTime) override {
    if (problem_ == nullptr) return fail(name_ + " integrates multibody systems only");
    if (integrator_) done_ = countWork();
    integrator_ = make_(problem_->knee().system());
    SimTK::State state = problem_->setState(t0, y0.data());
    const auto& tolerances = problem_->absoluteTolerances();
    const int n = problem_->numCoordinates();
    double tightest = tolerances[static_cast<size_t>(n)];
    for (int k = n; k < 2 * n; ++k) tightest = std::min(tightest, tolerances[static_cast<size_t>(k)]);
    for (int k = 0; k < n; ++k) {
      state.updUWeights()[problem_->stateIndexOf(k)] = tightest / tolerances[static_cast<size_t>(n + k)];
    }
    // SimTK's accuracy is relative to what it takes for the size of a variable, 1 in its unit.
    integrator_->setAccuracy(std::min(0.1, tightest));
    integrator_->setUseInfinityNorm(true);
    integrator_->setReturnEveryInternalStep(true);
    integrator_->setAllowInterpolation(false);
    stop_ = stopTime;
    integrator_->setFinalTime(stopTime);
    integrator_->setMinimumStepSize(kSmallestStep * (stopTime - t0));
    y_ = previousY_ = y0;
    rate_.assign(y0.size(), 0.0);
    if (problem_->evaluate(t0, y_.data(), rate_.data()) != OdeProblem::Evaluation::ok) return fail("the start is not a valid state");
    previousRate_ = rate_;
    time_ = previousTime_ = t0;
    try {
      before_ = countIn(state);  // the copy brings along what was counted before
      integrator_->initialize(state);
    } catch (const std::exception& error) {
      return fail(error.what());
    }
    return true;
  }

  bool step() override {
    if (time_ >= stop_) return false;
    try {
      integrator_->stepTo(stop_);
      // Its first return is that of the start.
      if (integrator_->getTime() <= time_) integrator_->stepTo(stop_);
    } catch (const std::exception& error) {
      return fail(error.what());
    }
    previousTime_ = time_;
    previousY_ = y_;
    previousRate_ = rate_;
    time_ = integrator_->getTime();
    problem_->readState(integrator_->getState(), y_.data());
    // They integrate on through full penetration; the problem does not.
    if (problem_->evaluate(time_, y_.data(), rate_.data()) != OdeProblem::Evaluation::ok) return fail("a step ended in a state that is not valid");
    return true;
  }

  double time() const override { return time_; }
  void limitStep(double longest) override { integrator_->setMaximumStepSize(std::min(longest, 1e30)); }

  bool interpolate(double t, std::vector<double>& y) override {
    interpolateCubic(t, previousTime_, previousY_, previousRate_, time_, y_, rate_, y);
    return true;
  }

  Statistics statistics() override {
    Statistics s;
    if (!integrator_) return s;
    s.stepsTaken = integrator_->getNumStepsTaken();
    s.stepsAttempted = integrator_->getNumStepsAttempted();
    s.errorTestFailures = integrator_->getNumErrorTestFailures();
    s.convergenceFailures = integrator_->getNumConvergenceTestFailures();
    s.evaluations = integrator_->getNumRealizations();
    problem_->setOtherCounters(countWork());
    return s;
  }
  const std::string& errorText() const override { return error_; }

 private:
  using Counters = ArticularContactSubsystem::Counters;
  Counters countIn(const SimTK::State& state) const { return problem_->knee().contact().getCounters(state); }
  /** Work on States of the integrator's own, of all parts of the run. */
  Counters countWork() const {
    const Counters now = countIn(integrator_->getAdvancedState());
    return {done_.evaluations + now.evaluations - before_.evaluations, done_.copies + now.copies - before_.copies,
            done_.distanceQueries + now.distanceQueries - before_.distanceQueries};
  }

  static constexpr double kSmallestStep = 1e-10;  // of the run

  bool fail(const std::string& what) {
    error_ = what.substr(0, what.find('\n'));
    return false;
  }

  std::string name_;
  KneeOde* problem_;
  Make make_;
  std::unique_ptr<SimTK::Integrator> integrator_;
  double time_ = 0, previousTime_ = 0, stop_ = 0;
  Counters done_, before_;
  std::vector<double> y_, rate_, previousY_, previousRate_;
  std::string error_;
};

}  // namespace

std::unique_ptr<OdeIntegrator> makeRungeKuttaMerson(OdeProblem& problem, const OdeSettings&) {
  return std::make_unique<SimbodyDriver>("runge-kutta-merson", problem, [](const SimTK::System& system) -> std::unique_ptr<SimTK::Integrator> {
    return std::make_unique<SimTK::RungeKuttaMersonIntegrator>(system);
  });
}

std::unique_ptr<OdeIntegrator> makeSemiExplicitEuler(OdeProblem& problem, const OdeSettings&) {
  return std::make_unique<SimbodyDriver>("semi-explicit-euler", problem, [](const SimTK::System& system) -> std::unique_ptr<SimTK::Integrator> {
    return std::make_unique<SimTK::SemiExplicitEuler2Integrator>(system);
  });
}

}  // namespace genu::model
