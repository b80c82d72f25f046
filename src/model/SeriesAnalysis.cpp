#include <chrono>
#include <sstream>

#include "StaticAnalysis.h"

namespace genu::model {

scene::Trajectory runSeries(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress) {
  const auto wallStart = std::chrono::steady_clock::now();
  const double cpuStart = cpuTime_s();
  const scene::SeriesSpec series = scene.series.value_or(scene::SeriesSpec{});
  knee.checkTablesCover(0, series.duration_s);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);

  scene::StaticSpec settings = scene.staticAnalysis.value_or(scene::StaticSpec{});
  settings.search.reset();  // one equilibrium after another, not all of each time
  scene::Trajectory result;
  result.elementColumns = knee.listElementColumns();
  result.statistics.name = "static equilibria";
  const std::vector<double> times = makeOutputTimes(series.duration_s, series.outputInterval_s);
  const auto describe = [](const char* what, double t) {
    std::ostringstream text;
    text.precision(4);
    text << what << " at t = " << t << " s";
    return text.str();
  };
  for (const double t : times) {
    settings.time_s = t;
    const auto ask = [&](double) { return !progress || progress(t / series.duration_s); };
    StaticResult one;
    try {
      one = settle(knee, state, scene, settings, ask, result.frames.empty() ? nullptr : &result.frames.back().q);
    } catch (const ComputationError& error) {
      if (result.frames.empty()) throw;
      one.statusText = error.what();
    }
    result.statistics.stepsTaken += one.iterations;
    result.statistics.contactEvaluations += one.contactEvaluations;
    result.statistics.distanceQueries += one.distanceQueries;
    if (one.status == StaticResult::Status::interrupted) {
      result.statusText = describe("interrupted", t);
      break;
    }
    if (one.status == StaticResult::Status::notConverged) {
      if (result.frames.empty()) throw ComputationError(scene.file.string() + ": " + describe("series", t) + ": " + one.statusText);
      result.failed = true;
      result.statusText = describe("failed", t) + ": " + one.statusText;
      break;
    }
    scene::Frame& frame = result.frames.emplace_back();
    frame.time_s = t;
    frame.q = one.q;
    frame.contacts = std::move(one.contacts);
    frame.constraintForce = std::move(one.constraintForce);
    frame.elements = std::move(one.elements);
  }
  result.complete = result.frames.size() == times.size();
  if (result.complete) result.statusText = "complete";
  result.wallTime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wallStart).count();
  result.cpuTime_s = cpuTime_s() - cpuStart;
  return result;
}

scene::Trajectory runSeries(const scene::Scene& scene, const scene::Progress& progress) {
  KneeSystem knee(scene);
  return runSeries(knee, scene, progress);
}

}  // namespace genu::model
