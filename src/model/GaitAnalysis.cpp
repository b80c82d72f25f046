#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "ReducedDynamics.h"
#include "StaticAnalysis.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

namespace {

using contact::EvaluationStatus;

/** y = (q, u) of the free coordinates, then the states of force elements; prescribed coordinates are set from their curves, where the
 constraints then hold exactly and nothing needs to be projected. */
class KneeOde : public OdeProblem {
 public:
  KneeOde(const KneeSystem& knee, const SimTK::State& defaultState, double accuracy)
      : knee_(knee), state_(defaultState) {
    std::vector<double> units;
    for (int i = 0; i < knee.numCoordinates(); ++i) {
      if (knee.isPrescribed(i)) continue;
      free_.push_back(i);
      index_.push_back(knee.stateIndex(i));
      units.push_back(knee.coordinates()[static_cast<size_t>(i)].isAngle ? 1 / kAngleLength_m : 1.0);
    }
    // See runGait(): 1 mm and 10 m/s at the surfaces.
    for (const double scale : {1e-3, 10.0}) {
      for (const double unit : units) tolerances_.push_back(accuracy * scale * unit);
    }
    for (const auto& element : knee.elements()) {
      for (const ForceElement::OwnState& own : element->states(state_)) {
        own_.push_back(own.index);
        tolerances_.push_back(accuracy * own.unit);
      }
    }
  }

  int size() const override { return static_cast<int>(tolerances_.size()); }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }

  Evaluation evaluate(double t, const double* y, double* ydot) noexcept override {
    try {
      setState(t, y);
      knee_.system().realize(state_, SimTK::Stage::Velocity);
      if (!checkStatus()) return Evaluation::retry;
      knee_.system().realize(state_, SimTK::Stage::Acceleration);
      const SimTK::Vector& udot = state_.getUDot();
      const size_t n = index_.size();
      for (size_t k = 0; k < n; ++k) {
        ydot[k] = y[n + k];
        ydot[n + k] = udot[index_[k]];
        if (!std::isfinite(ydot[n + k])) {
          failure_ = "the acceleration is not finite";
          return Evaluation::retry;
        }
      }
      for (size_t k = 0; k < own_.size(); ++k) {
        ydot[2 * n + k] = state_.getZDot()[own_[k]];
        if (!std::isfinite(ydot[2 * n + k])) {
          failure_ = "the rate of a muscle's state is not finite";
          return Evaluation::retry;
        }
      }
      touched_ = touched_ || hasContact();
      failure_.clear();
      return Evaluation::ok;
    } catch (const std::exception& error) {
      failure_ = error.what();
      return Evaluation::retry;
    }
  }

  /** The state that begins a run: coordinates and rates, and force elements settled there. */
  std::vector<double> start(const scene::Coordinates& q, const scene::Coordinates& qdot) {
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

  /** False when the pose is not valid; failure() then says why. */
  bool makeFrame(double t, const std::vector<double>& y, scene::Frame& frame) {
    try {
      setState(t, y.data());
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
      knee_.matter().calcResidualForceIgnoringConstraints(
          state_, system.getMobilityForces(state_, SimTK::Stage::Dynamics),
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

  bool touched() const { return touched_; }
  /** Why the last evaluation was refused; empty when it was not. */
  const std::string& failure() const { return failure_; }
  std::string advice() const {
    if (!failure_.empty() && fullPenetration_) {
      return "; the layer is too thin or too soft for the load, or the prescribed motion pushes one body through the "
             "other; check units of modulus, thickness and load";
    }
    if (elementProblem_) return {};  // it says itself what to do
    return "; check loads, mass and prescribed motion, or try another accuracy";
  }
  const ArticularContactSubsystem::Counters& counters() const { return knee_.contact().getCounters(state_); }

 private:
  void setState(double t, const double* y) {
    knee_.prescribe(state_, t, false);
    const size_t n = index_.size();
    SimTK::Vector& q = state_.updQ();
    for (size_t k = 0; k < n; ++k) q[index_[k]] = y[k];
    SimTK::Vector& u = state_.updU();
    for (size_t k = 0; k < n; ++k) u[index_[k]] = y[n + k];
    if (own_.empty()) return;
    SimTK::Vector& z = state_.updZ();
    for (size_t k = 0; k < own_.size(); ++k) z[own_[k]] = y[2 * n + k];
  }

  bool checkStatus() {
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

  bool hasContact() const {
    for (int i = 0; i < knee_.contact().numContactPairs(); ++i) {
      if (knee_.contact().getDampedResult(state_, i).total.activeElements > 0) return true;
    }
    return false;
  }

  const KneeSystem& knee_;
  SimTK::State state_;
  std::vector<int> free_, index_;  // coordinates, and their places in the State's q and u
  std::vector<int> own_;
  std::vector<double> tolerances_;
  std::string failure_;
  bool touched_ = false, fullPenetration_ = false, elementProblem_ = false;
};

std::string atTime(double t) {
  std::ostringstream text;
  text.precision(4);
  text << "t = " << t << " s";
  return text.str();
}

void checkSettings(const scene::Scene& scene, const scene::GaitSpec& gait) {
  const auto check = [&](double value, const char* key, const char* unit) {
    if (value > 0 && std::isfinite(value)) return;
    std::ostringstream text;
    text << scene.file.string() << ": gait " << key << " is " << value << unit << "; it must be positive";
    throw InputError(text.str());
  };
  check(gait.duration_s, "duration", " s");
  check(gait.outputInterval_s, "output interval", " s");
  check(gait.accuracy, "accuracy", "");
}

void integrate(KneeOde& ode, OdeIntegrator& integrator, const std::vector<double>& y0, const scene::GaitSpec& gait,
               const scene::Progress& progress, GaitResult& result) {
  const std::vector<double> times = makeOutputTimes(gait.duration_s, gait.outputInterval_s);
  const auto fail = [&](double t) {
    result.failed = true;
    result.statusText = "failed at " + atTime(t) + ": " +
                        (ode.failure().empty() ? integrator.errorText() : ode.failure()) + ode.advice();
  };
  const auto addFrame = [&](double t, double outputTime, const std::vector<double>& y) {
    scene::Frame frame;
    if (!ode.makeFrame(t, y, frame)) {
      fail(t);
      return false;
    }
    frame.time_s = outputTime;
    result.frames.push_back(std::move(frame));
    return true;
  };
  const auto mayContinue = [&](double t) {
    if (!progress || progress(t / times.back())) return true;
    result.statusText = "interrupted at " + atTime(t);
    return false;
  };

  if (ode.size() == 0) {  // all coordinates prescribed: nothing to integrate
    for (double t : times) {
      if (!mayContinue(t) || !addFrame(t, t, y0)) return;
    }
  } else {
    if (!integrator.initialize(0, y0, times.back())) {
      fail(0);
      return;
    }
    if (!addFrame(0, 0, y0)) return;
    std::vector<double> y;
    for (size_t next = 1; next < times.size();) {
      if (!mayContinue(integrator.time())) return;
      if (!integrator.step()) {
        fail(integrator.time());
        return;
      }
      const double reached = integrator.time();
      for (; next < times.size() && times[next] <= reached * (1 + 1e-14); ++next) {
        const double t = std::min(times[next], reached);
        if (!integrator.interpolate(t, y)) {
          fail(t);
          return;
        }
        if (!addFrame(t, times[next], y)) return;
      }
    }
  }
  result.complete = true;
  result.statusText = "complete";
}

}  // namespace

std::vector<double> makeOutputTimes(double duration_s, double interval_s) {
  std::vector<double> times;
  // An interval that divides the duration up to rounding gives no extra last frame.
  const long count = static_cast<long>(std::floor(duration_s / interval_s + 1e-9));
  for (long k = 0; k <= count; ++k) times.push_back(static_cast<double>(k) * interval_s);
  if (times.back() < duration_s * (1 - 1e-9)) times.push_back(duration_s);
  times.back() = std::min(times.back(), duration_s);
  return times;
}

GaitResult runGait(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress) {
  const auto wallStart = std::chrono::steady_clock::now();
  const double cpuStart = cpuTime_s();
  const scene::GaitSpec gait = scene.gait.value_or(scene::GaitSpec{});
  checkSettings(scene, gait);
  knee.checkTablesCover(0, gait.duration_s);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);

  KneeOde ode(knee, state, gait.accuracy);
  const std::unique_ptr<OdeIntegrator> integrator =
      makeOdeIntegrator(gait.integrator, ode, scene.file.string() + ": gait integrator");

  GaitResult result;
  result.elementColumns = knee.listElementColumns();
  const auto finish = [&] {
    result.wallTime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wallStart).count();
    result.cpuTime_s = cpuTime_s() - cpuStart;
  };

  const auto n = static_cast<size_t>(knee.numCoordinates());
  scene::Coordinates q(n, 0.0), qdot(n, 0.0);
  if (gait.settleFirst) {
    scene::StaticSpec settings = scene.staticAnalysis.value_or(scene::StaticSpec{});
    settings.time_s = 0;
    if (settings.method == scene::StaticSpec::Method::both) settings.method = scene::StaticSpec::Method::newton;
    bool stopped = false;
    // Settling takes a few per cent of a run: it only asks whether to stop.
    const scene::Progress settlingProgress = [&](double) {
      stopped = stopped || (progress && !progress(0));
      return !stopped;
    };
    result.settling = settle(knee, state, scene, settings, settlingProgress);
    if (result.settling->status == StaticResult::Status::notConverged) {
      throw ComputationError(scene.file.string() + ": settling before the gait: " + result.settling->statusText);
    }
    if (stopped) {
      result.statusText = "interrupted while settling";
      finish();
      return result;
    }
    q = result.settling->q;
    qdot = calcEquilibriumRates(knee, state, q, 0);
  } else {
    for (int i = 0; i < knee.numCoordinates(); ++i) {
      if (knee.isPrescribed(i)) continue;
      const auto& free = std::get<scene::FreeCoordinate>(scene.model->coordinates[static_cast<size_t>(i)]);
      q[static_cast<size_t>(i)] = free.start.value_or(0.0);
    }
  }

  integrate(ode, *integrator, ode.start(q, qdot), gait, progress, result);
  const OdeIntegrator::Statistics counts = ode.size() > 0 ? integrator->statistics() : OdeIntegrator::Statistics{};
  const ArticularContactSubsystem::Counters& work = ode.counters();
  scene::IntegratorStatistics& out = result.statistics;
  out.name = integrator->name();
  out.stepsTaken = counts.stepsTaken;
  out.stepsAttempted = counts.stepsAttempted;
  out.errorTestFailures = counts.errorTestFailures;
  out.convergenceFailures = counts.convergenceFailures;
  out.realizations = counts.evaluations;
  out.contactEvaluations = work.evaluations;
  out.contactCopies = work.copies;
  out.distanceQueries = work.distanceQueries;
  finish();
  if (result.complete && knee.contact().numContactPairs() > 0 && knee.elements().empty() && !ode.touched()) {
    throw ComputationError(scene.file.string() +
                           ": contact is never made during the run; check that the surfaces lie above each other in "
                           "the fixed frame, that the grid covers them, the start pose and the direction of the loads");
  }
  return result;
}

GaitResult runGait(const scene::Scene& scene, const scene::Progress& progress) {
  KneeSystem knee(scene);
  return runGait(knee, scene, progress);
}

}  // namespace genu::model
