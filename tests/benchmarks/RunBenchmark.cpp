// The two applications on the shipped models, error against a fine reference beside the time.
//   build/release/bin/run_benchmark
// Times include everything but reading the scene and building the grids, which "setup_ms" gives. Errors: largest difference
// of a free coordinate over the run (angles times 25 mm) and of the scalar force of a compartment, against the same scene on
// a 100 x 100 grid, smooth rule, with 100 times tighter integration. Rows of the centre rule stand beside those of the smooth
// one. Memory is the peak of the whole process so far: run one case alone (--benchmark_filter) to read it.

#include <benchmark/benchmark.h>
#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>

#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"

namespace {

using namespace genu;

const std::filesystem::path kModels = std::filesystem::path(GENU_SOURCE_DIR) / "models";

double peakMemory_MB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

scene::Scene read(const std::string& file, int n, contact::ContactRule rule = contact::ContactRule::smooth) {
  scene::ReadOptions options;
  options.requireModel = true;
  if (n > 0) options.gridOverride = std::pair{n, n};
  auto scene = scene::readScene(kModels / file, options);
  for (scene::ContactSpec& contact : scene.contacts) contact.definition.rule = rule;
  return scene;
}

double coordinateDifference_mm(const scene::Coordinates& a, const scene::Coordinates& b) {
  double largest = 0;
  for (size_t k = 0; k < 6; ++k) largest = std::max(largest, std::abs(a[k] - b[k]) * (k < 3 ? model::kAngleLength_m : 1) * 1e3);
  return largest;
}

void gait(benchmark::State& state, const std::string& file, contact::ContactRule rule) {
  const int n = static_cast<int>(state.range(0));
  static std::map<std::string, model::GaitResult> references;
  if (references.count(file) == 0) {
    auto scene = read(file, 100);
    scene.gait->accuracy *= 1e-2;
    references[file] = model::runGait(scene);
  }
  const model::GaitResult& reference = references[file];
  const auto start = std::chrono::steady_clock::now();
  const scene::Scene scene = read(file, n, rule);
  const double setup = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  model::GaitResult result;
  for (auto _ : state) result = model::runGait(scene);
  if (!result.complete || result.frames.size() != reference.frames.size()) {
    state.SkipWithError(result.statusText.c_str());
    return;
  }
  double pose = 0, force = 0;
  for (size_t i = 0; i < result.frames.size(); ++i) {
    pose = std::max(pose, coordinateDifference_mm(result.frames[i].q, reference.frames[i].q));
    for (size_t c = 0; c < result.frames[i].contacts.size(); ++c) {
      const auto &a = result.frames[i].contacts[c].compartments, &b = reference.frames[i].contacts[c].compartments;
      for (size_t k = 0; k < a.size(); ++k) force = std::max(force, std::abs(a[k].scalarForce_N - b[k].scalarForce_N));
    }
  }
  state.counters["pose_err_mm"] = pose;
  state.counters["force_err_N"] = force;
  state.counters["evaluations"] = static_cast<double>(result.statistics.contactEvaluations);
  state.counters["steps"] = static_cast<double>(result.statistics.stepsTaken);
  state.counters["setup_ms"] = setup;
  state.counters["peak_MB"] = peakMemory_MB();
}

void statics(benchmark::State& state, const std::string& file) {
  static std::map<std::string, model::StaticResult> references;
  if (references.count(file) == 0) references[file] = model::runStatic(read(file, 100));
  const model::StaticResult& reference = references[file];
  const auto start = std::chrono::steady_clock::now();
  const scene::Scene scene = read(file, 0);
  const double setup = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  model::StaticResult result;
  for (auto _ : state) result = model::runStatic(scene);
  state.counters["pose_err_mm"] = coordinateDifference_mm(result.q, reference.q);
  double force = 0;
  for (size_t k = 0; k < result.contacts[0].compartments.size(); ++k) {
    force = std::max(force, std::abs(result.contacts[0].compartments[k].scalarForce_N -
                                     reference.contacts[0].compartments[k].scalarForce_N));
  }
  state.counters["force_err_N"] = force;
  state.counters["residual_N"] = result.residual_N;
  state.counters["iterations"] = result.iterations;
  state.counters["setup_ms"] = setup;
  state.counters["peak_MB"] = peakMemory_MB();
}

#define GENU_GAIT(name, file, rule) BENCHMARK_CAPTURE(gait, name, file, contact::ContactRule::rule)->Unit(benchmark::kMillisecond)->Iterations(3)
GENU_GAIT(artificial_linear_smooth, "artificial_knee/gait.yaml", smooth)->Arg(20)->Arg(30)->Arg(50);
GENU_GAIT(artificial_linear_centre, "artificial_knee/gait.yaml", centre)->Arg(20)->Arg(30)->Arg(50);
GENU_GAIT(artificial_power_law_smooth, "artificial_knee/gait_power_law.yaml", smooth)->Arg(30);
GENU_GAIT(artificial_power_law_centre, "artificial_knee/gait_power_law.yaml", centre)->Arg(30);
BENCHMARK_CAPTURE(statics, natural_small_strain, "natural_knee/static.yaml")->Unit(benchmark::kMillisecond)->Iterations(3);
BENCHMARK_CAPTURE(statics, natural_large_strain, "natural_knee/static_large_strain.yaml")->Unit(benchmark::kMillisecond)->Iterations(3);

}  // namespace

BENCHMARK_MAIN();
