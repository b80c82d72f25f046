#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>

#include "ErrorGrowth.h"
#include "GaitError.h"
#include "KneeOde.h"
#include "QuietStart.h"
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

/** Where an integrator has to stop: a curve of an input changes there, or the run ends. What is at rest, or moves evenly, would be followed in a step across a pulse. */
struct Stop {
  double time_s;
  bool jump;
};

std::vector<Stop> listStops(const KneeSystem& knee, double end_s) {
  std::vector<Stop> stops;
  for (const KneeSystem::InputBreak& entry : knee.listInputBreaks()) {
    if (entry.time_s > 1e-12 * end_s && entry.time_s < end_s * (1 - 1e-12)) stops.push_back({entry.time_s, entry.jump});
  }
  stops.push_back({end_s, false});
  return stops;
}

bool isFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

class Run {
 public:
  Run(const KneeSystem& knee, KneeOde& ode, OdeIntegrator& integrator, const scene::GaitSpec& gait, const scene::Progress& progress,
      GaitResult& result)
      : knee_(knee), ode_(ode), growth_(ode), integrator_(integrator), gait_(gait), progress_(progress), result_(result),
        times_(makeOutputTimes(gait.duration_s, gait.outputInterval_s)), stops_(listStops(knee, times_.back())) {}

  void integrate(const std::vector<double>& y0) {
    if (ode_.size() == 0) {  // all coordinates prescribed: nothing to integrate
      for (double t : times_) {
        if (!mayContinue(t) || !addFrame(t, t, y0)) return;
      }
    } else if (!advance(y0)) {
      return;
    }
    result_.complete = true;
    result_.statusText = "complete";
  }

  /** Impacts whose speed is not large against the error of a step: measured on dropped bodies (docs/stability.md), forces within 5 % want a tolerance of
   5e-4 of it. Slow touches, below 20 mm/s, are part of walking. */
  std::string describeImpact(double tolerance_mPerS) const {
    constexpr double kShare = 5e-4, kSlow_mPerS = 0.02;
    if (fastestImpact_ < kSlow_mPerS || tolerance_mPerS <= kShare * fastestImpact_) return {};
    std::ostringstream text;
    text.precision(3);
    text << "at t = " << impactTime_ << " s contact begins with " << 1e3 * fastestImpact_ << " mm/s: what follows such an impact, its time and its forces above all, is uncertain at an error of "
         << 1e3 * tolerance_mPerS << " mm/s a step; try accuracy: " << kShare * fastestImpact_ / 10;
    return text.str();
  }

  /** None where errors of steps are not known. */
  std::optional<GaitErrorPrediction> predictError() const {
    if (!followed_) return {};
    return GaitErrorPrediction{kReach * growth_.pose_m(), kReach * growth_.force()};
  }

  const OdeIntegrator::Statistics& statistics() const { return counts_; }

 private:
  bool advance(const std::vector<double>& y0) {
    size_t stop = 0;
    std::vector<double> y = y0;
    seeUpTo(stops_[0]);
    if (!integrator_.initialize(0, y, stops_[0].time_s)) return fail(0);
    const auto close = [this](bool ok) {
      count();
      return ok;
    };
    if (!addFrame(0, 0, y)) return close(false);
    capped_ = knee_.contact().numContactPairs() > 0;
    if (capped_) {
      integrator_.limitStep(ode_.findLongestStep(y));
      touching_ = ode_.countTouching();
      followed_ = ode_.hasJacobian();
    }
    long steps = 0;
    const auto start = std::chrono::steady_clock::now();
    for (size_t next = 1; next < times_.size();) {
      if (!mayContinue(integrator_.time())) return close(false);
      if (++steps > gait_.maxSteps) return close(endEarly("more than " + std::to_string(gait_.maxSteps) + " steps", "max_steps"));
      if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > gait_.maxWallTime_s) {
        std::ostringstream text;
        text << "more than " << gait_.maxWallTime_s << " s of wall time";
        return close(endEarly(text.str(), "max_wall_time"));
      }
      const double from = integrator_.time();
      if (!integrator_.step()) return close(fail(integrator_.time()));
      const double reached = integrator_.time();
      if (capped_) {
        if (!integrator_.interpolate(reached, y)) return close(fail(reached));
        followed_ = followed_ && integrator_.getStepErrors(stepErrors_);
        if (followed_) growth_.addStep(reached, reached - from, y, stepErrors_);
        integrator_.limitStep(ode_.findLongestStep(y));
        const int touching = ode_.countTouching();
        if (touching > touching_) noteImpact(reached, ode_.findSpeed(y));
        touching_ = touching;
      }
      for (; next < times_.size() && times_[next] <= reached * (1 + 1e-14); ++next) {
        const double t = std::min(times_[next], reached);
        if (!integrator_.interpolate(t, y)) return close(fail(t));
        if (!addFrame(t, times_[next], y)) return close(false);
      }
      if (reached < stops_[stop].time_s * (1 - 1e-14) || stop + 1 == stops_.size()) continue;
      const bool jump = stops_[stop].jump;
      const double begin = stops_[stop++].time_s;
      seeUpTo(stops_[stop]);
      if (!jump && integrator_.continueTo(stops_[stop].time_s)) continue;
      if (!integrator_.interpolate(reached, y)) return close(fail(reached));
      count();
      if (!integrator_.initialize(begin, y, stops_[stop].time_s)) return fail(begin);
      growth_.restart();
      if (capped_) integrator_.limitStep(ode_.findLongestStep(y));
    }
    return close(true);
  }

  /** What jumps at a stop belongs to the part after it. */
  void seeUpTo(const Stop& stop) { ode_.stopAt(stop.jump ? stop.time_s : std::numeric_limits<double>::infinity()); }

  void noteImpact(double t, double speed) {
    if (speed <= fastestImpact_) return;
    fastestImpact_ = speed;
    impactTime_ = t;
  }

  /** Adds what the integrator has done since it was initialized. */
  void count() {
    const OdeIntegrator::Statistics more = integrator_.statistics();
    counts_.stepsTaken += more.stepsTaken;
    counts_.stepsAttempted += more.stepsAttempted;
    counts_.errorTestFailures += more.errorTestFailures;
    counts_.convergenceFailures += more.convergenceFailures;
    counts_.evaluations += more.evaluations;
    counts_.jacobians += more.jacobians;
  }

  bool fail(double t) {
    result_.failed = true;
    result_.statusText = "failed at " + atTime(t) + ": " + (ode_.failure().empty() ? integrator_.errorText() : ode_.failure());
    const int worst = ode_.failure().empty() ? integrator_.worstComponent() : -1;
    if (worst >= 0) result_.statusText += " (limited by the " + ode_.describeComponent(worst) + ")";
    result_.statusText += ode_.advice();
    return false;
  }

  bool endEarly(const std::string& what, const char* key) {
    result_.failed = true;
    result_.statusText = "stopped at " + atTime(integrator_.time()) + ": " + what + "; raise analysis.gait." + key +
                         " if the run is worth it, or try another integrator, accuracy or some damping";
    return false;
  }

  bool addFrame(double t, double outputTime, const std::vector<double>& y) {
    scene::Frame frame;
    if (!ode_.makeFrame(t, y, frame)) return fail(t);
    if (!isFinite(y) || !isFinite(frame.qddot) || !isFinite(frame.elements) || !isFinite(frame.constraintForce)) {
      result_.failed = true;
      result_.statusText = "failed at " + atTime(t) + ": a coordinate, acceleration or output is not finite" + ode_.advice();
      return false;
    }
    frame.time_s = outputTime;
    result_.frames.push_back(std::move(frame));
    return true;
  }

  bool mayContinue(double t) {
    if (!progress_ || progress_(t / times_.back())) return true;
    result_.statusText = "interrupted at " + atTime(t);
    return false;
  }

  const KneeSystem& knee_;
  KneeOde& ode_;
  bool capped_ = false;  // no step across a contact
  int touching_ = 0;
  double fastestImpact_ = 0, impactTime_ = 0;
  static constexpr double kReach = 1.5;  // of true errors over those followed: docs/stability.md has how far both agree
  bool followed_ = false;  // errors of steps are known, and where they lead
  ErrorGrowth growth_;
  std::vector<double> stepErrors_;
  OdeIntegrator& integrator_;
  const scene::GaitSpec& gait_;
  const scene::Progress& progress_;
  GaitResult& result_;
  std::vector<double> times_;
  std::vector<Stop> stops_;
  OdeIntegrator::Statistics counts_;
};

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

namespace {

struct Start {
  scene::Coordinates q, qdot;
};

/** What an integration from the start leaves in `result`: frames, status, remarks, statistics. */
struct Integration {
  bool touched = false;
  double fixedStep_s = 0;
};

Integration integrate(const KneeSystem& knee, const GaitMethod& method, const scene::GaitSpec& gait, const SimTK::State& state, const Start& start,
                      const scene::Progress& progress, GaitResult& result) {
  const OdeTolerances tolerances = OdeTolerances::of(gait);
  KneeOde ode(knee, state, tolerances, method.constraints ? KneeOde::Prescribed::constraints : KneeOde::Prescribed::eliminated);
  const std::unique_ptr<OdeIntegrator> integrator = method.kind->make(ode, {gait.maxOrder, gait.step_s});
  Run run(knee, ode, *integrator, gait, progress, result);
  run.integrate(ode.start(start.q, start.qdot));
  result.prediction = run.predictError();
  const OdeIntegrator::Statistics& counts = run.statistics();
  if (integrator->fixedStep_s() == 0) {
    const std::string impact = run.describeImpact(tolerances.speed_mPerS);
    if (!impact.empty()) result.remarks.push_back(impact);
  }
  const ArticularContactSubsystem::Counters work = ode.counters();
  scene::IntegratorStatistics& out = result.statistics;
  out.name = integrator->name();
  out.prescribed = method.constraints ? "constraints" : "eliminated";
  out.jacobians = counts.jacobians;
  out.stepsTaken = counts.stepsTaken;
  out.stepsAttempted = counts.stepsAttempted;
  out.errorTestFailures = counts.errorTestFailures;
  out.convergenceFailures = counts.convergenceFailures;
  out.realizations = counts.evaluations;
  out.contactEvaluations = work.evaluations;
  out.contactCopies = work.copies;
  out.distanceQueries = work.distanceQueries;
  return {ode.touched(), integrator->fixedStep_s()};
}

}  // namespace

GaitResult runGait(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress) {
  const auto wallStart = std::chrono::steady_clock::now();
  const double cpuStart = cpuTime_s();
  const scene::GaitSpec gait = scene.gait.value_or(scene::GaitSpec{});
  const GaitMethod method = chooseGaitMethod(scene);
  knee.checkTablesCover(0, gait.duration_s);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);

  GaitResult result;
  result.elementColumns = knee.listElementColumns();
  const auto finish = [&] {
    result.wallTime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wallStart).count();
    result.cpuTime_s = cpuTime_s() - cpuStart;
  };

  const auto n = static_cast<size_t>(knee.numCoordinates());
  Start start{scene::Coordinates(n, 0.0), scene::Coordinates(n, 0.0)};
  if (gait.settleFirst) {
    scene::StaticSpec settings = scene.staticAnalysis.value_or(scene::StaticSpec{});
    settings.time_s = 0;
    settings.search.reset();
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
    const QuietStart quiet = findQuietStart(knee, state, result.settling->q);
    start.q = quiet.q;
    start.qdot = quiet.qdot;
  } else {
    for (int i = 0; i < knee.numCoordinates(); ++i) {
      if (knee.isPrescribed(i)) continue;
      const auto& free = std::get<scene::FreeCoordinate>(scene.model->coordinates[static_cast<size_t>(i)]);
      start.q[static_cast<size_t>(i)] = free.start.value_or(0.0);
    }
  }

  // The whole of the progress is both runs.
  const double secondCost = gait.errorEstimate ? planSecondRun(gait, gait.step_s).cost : 0;
  double done = 0, share = 1 / (1 + secondCost);
  const scene::Progress part = [&](double of) { return !progress || progress(done + share * of); };
  const Integration first = integrate(knee, method, gait, state, start, part, result);
  if (result.complete && knee.contact().numContactPairs() > 0 && knee.elements().empty() && !first.touched) {
    throw ComputationError(scene.file.string() +
                           ": contact is never made during the run; check that the surfaces lie above each other in "
                           "the fixed frame, that the grid covers them, the start pose and the direction of the loads");
  }
  if (!result.complete) {
    finish();
    return result;
  }
  const auto remark = [&result](const std::string& text) {
    if (!text.empty()) result.remarks.push_back(text);
  };
  remark(describeImbalance(scene, result));
  finish();
  if (!gait.errorEstimate) {
    if (result.prediction) remark(describeError(*result.prediction, gait));
    return result;
  }

  const SecondRun plan = planSecondRun(gait, first.fixedStep_s);
  GaitResult second;
  const double secondStart = cpuTime_s();
  std::string problem;
  try {
    done = share;
    share = 1 - done;
    scene::Scene again = scene;
    again.gait = plan.gait;
    integrate(knee, chooseGaitMethod(again), plan.gait, state, start, part, second);
    if (!second.complete) problem = "the second run, " + plan.description + ", " + second.statusText;
  } catch (const ComputationError& error) {
    problem = "the second run, " + plan.description + ": " + error.what();
  }
  second.cpuTime_s = cpuTime_s() - secondStart;
  if (problem.empty()) {
    result.errorEstimate = estimateError(scene, plan, result, second);
  } else {
    GaitErrorEstimate& none = result.errorEstimate.emplace();
    none.statusText = problem;
    none.second = plan.description;
    none.cpuTime_s = second.cpuTime_s;
  }
  remark(describeError(*result.errorEstimate, gait, first.fixedStep_s));
  return result;
}

GaitResult runGait(const scene::Scene& scene, const scene::Progress& progress) {
  KneeSystem knee(scene);
  return runGait(knee, scene, progress);
}

}  // namespace genu::model
