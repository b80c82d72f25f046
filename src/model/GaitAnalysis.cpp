#include <algorithm>
#include <chrono>
#include <cmath>
#include <sstream>

#include "KneeOde.h"
#include "StaticAnalysis.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

namespace {

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
      makeOdeIntegrator(gait.integrator, ode, {gait.maxOrder, gait.step_s}, scene.where("analysis.gait.integrator"));

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
