// Cost of the contact engine, error beside time. Compare ratios within one run: absolute times depend on the machine.
//   build/release/bin/engine_benchmark [--benchmark_filter=...]
// All laws and modes in one table, with ratios: engine_table.
// Scene: two condyles (bicubic, 15 x 20 control points) on two dishes or flat layers, about 300 of 2 x 30 x 30 elements
// active. Error: force against the same pose on a 240 x 240 grid.

#include <benchmark/benchmark.h>

#include <cmath>
#include <map>
#include <random>

#include "benchmarks/KneeScene.h"

namespace {

using namespace genu::contact;
using namespace genu::contact::test;

void evaluate(benchmark::State& state, bool dished, Material material, StrainMeasure strain, Tracking tracking, bool contact, int n = 30,
              bool withEnergy = false, bool withStiffness = false) {
  static std::map<bool, double> heights;  // by shape
  if (heights.count(dished) == 0) heights[dished] = findHeight(ContactPair(makeKnee(30, dished, uhmwpe(), StrainMeasure::small)), 300);
  const double height = heights[dished] + (contact ? 0 : 0.005);
  auto definition = makeKnee(n, dished, material, strain);
  definition.tracking = tracking;
  const ContactPair pair(definition);
  ContactWorkspace workspace(pair);
  ContactResult r;
  int i = 0;
  long queries = 0, active = 0;
  for (auto _ : state) {
    pair.evaluate(wander(i++, height), workspace, {withEnergy, withStiffness}, r);
    benchmark::DoNotOptimize(r.total.forceOnM_F);
    queries += r.distanceQueries;
    active += r.total.activeElements;
  }
  state.counters["active"] = static_cast<double>(active) / i;
  state.counters["queries"] = static_cast<double>(queries) / i;
  if (contact) {
    // Not timed: root mean square force error over 12 poses.
    const ContactPair fine(makeKnee(240, dished, material, strain));
    double sum = 0;
    for (int k = 0; k < 12; ++k) {
      const JointCoordinates q = wander(97 * k, height);
      const double reference = fine.evaluate(q, {false}).total.scalarForce_N;
      sum += std::pow(pair.evaluate(q, {false}).total.scalarForce_N / reference - 1, 2);
    }
    state.counters["force_err_%"] = 100 * std::sqrt(sum / 12);
  }
}

#define GENU_EVALUATE(name, ...) \
  BENCHMARK_CAPTURE(evaluate, name, __VA_ARGS__)->Unit(benchmark::kMicrosecond)->UseRealTime()

GENU_EVALUATE(flat_linear, false, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true);
GENU_EVALUATE(dished_linear, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true);
GENU_EVALUATE(dished_linear_energy, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 30, true);
GENU_EVALUATE(flat_linear_stiffness, false, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 30, false, true);
GENU_EVALUATE(dished_linear_stiffness, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 30, false, true);
GENU_EVALUATE(dished_power_n3_stiffness, true, uhmwpePowerLaw(), StrainMeasure::small, Tracking::lipschitz, true, 30, false, true);
GENU_EVALUATE(dished_log, true, uhmwpe(), StrainMeasure::large, Tracking::lipschitz, true);
GENU_EVALUATE(dished_power_n3, true, uhmwpePowerLaw(), StrainMeasure::small, Tracking::lipschitz, true);
GENU_EVALUATE(dished_breadth_first, true, uhmwpe(), StrainMeasure::small, Tracking::breadthFirst, true);
GENU_EVALUATE(dished_breadth_first_unguarded, true, uhmwpe(), StrainMeasure::small, Tracking::breadthFirstUnguarded, true);
GENU_EVALUATE(dished_every_element, true, uhmwpe(), StrainMeasure::small, Tracking::all, true);
GENU_EVALUATE(dished_out_of_contact, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, false);
GENU_EVALUATE(dished_20x20, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 20);
GENU_EVALUATE(dished_50x50, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 50);
GENU_EVALUATE(dished_100x100, true, uhmwpe(), StrainMeasure::small, Tracking::lipschitz, true, 100);

void coldEvaluation(benchmark::State& state) {
  const ContactPair pair(makeKnee(30, true, uhmwpe(), StrainMeasure::small));
  const double height = findHeight(pair, 300);
  ContactWorkspace workspace(pair);
  ContactResult r;
  for (auto _ : state) {
    workspace.reset();
    pair.evaluate(wander(0, height), workspace, {}, r);
    benchmark::DoNotOptimize(r);
  }
}
BENCHMARK(coldEvaluation)->Unit(benchmark::kMicrosecond)->UseRealTime();

enum class Start { warm, cold };

void closestPoint(benchmark::State& state, Start start, bool rational) {
  const auto surface = makeCondyleSurface(rational);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0.1, 0.9), v(-0.8, 0.8), depth(-0.0005, 0.001);
  std::normal_distribution<double> step(0, 1e-5 / std::sqrt(3.0));
  std::vector<Vec3> points;
  std::vector<SurfaceParameter> seeds;
  for (int i = 0; i < 1000; ++i) {
    const double uu = u(random), vv = v(random);
    const Vec3 Q = surface->patch(0).calcPoint(uu, vv) + depth(random) * surface->patch(0).calcNormal(uu, vv);
    seeds.push_back(surface->findClosestPoint(Q).at);
    points.push_back(Q + Vec3(step(random), step(random), step(random)));  // moved by 0.01 mm
  }
  size_t i = 0;
  double worst = 0;
  for (auto _ : state) {
    const auto foot = surface->findClosestPoint(points[i], start == Start::warm ? &seeds[i] : nullptr);
    worst = std::max(worst, foot.residual_m);
    benchmark::DoNotOptimize(foot.distance_m);
    i = i + 1 == points.size() ? 0 : i + 1;
  }
  state.counters["worst_residual_m"] = worst;
}
BENCHMARK_CAPTURE(closestPoint, warm, Start::warm, false);
BENCHMARK_CAPTURE(closestPoint, warm_rational, Start::warm, true);
BENCHMARK_CAPTURE(closestPoint, cold, Start::cold, false);
BENCHMARK_CAPTURE(closestPoint, cold_rational, Start::cold, true);

void surfaceEvaluation(benchmark::State& state, bool rational, bool tables) {
  const NurbsPatch patch(makeCondyle(rational, 0));
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0, 1), v(-1, 1);
  std::vector<Vec2> at;
  for (int i = 0; i < 1000; ++i) at.emplace_back(u(random), v(random));
  size_t i = 0;
  for (auto _ : state) {
    const auto d = tables ? patch.evaluate(at[i].x(), at[i].y()) : patch.evaluateByBasisFunctions(at[i].x(), at[i].y());
    benchmark::DoNotOptimize(d);
    i = i + 1 == at.size() ? 0 : i + 1;
  }
}
BENCHMARK_CAPTURE(surfaceEvaluation, tables, false, true);
BENCHMARK_CAPTURE(surfaceEvaluation, tables_rational, true, true);
BENCHMARK_CAPTURE(surfaceEvaluation, basis_functions, false, false);

}  // namespace

BENCHMARK_MAIN();
