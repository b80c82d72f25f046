// How often the error estimate covers the true error, by how much, and what it costs.
//   build/release/bin/error_estimate_table [--training] [--problems N] [--csv FILE]
// Cases: tests/contact/ErrorCases.h; N problems of every kind (default 6), each on grids of 8, 12, 17, 24, 32, 45, 60 cells each
// way at three phases, smooth and centre rule, totals and compartments. --csv writes the raw numbers the factors are fitted to.
// Coverage: share of cases with true error <= estimate. Ratio: estimate / true error. Errors below 1e-9 of the quantity (the
// reference's own error) count as covered and have no ratio; cases without contact in reference and grid are left out.

#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>

#include "contact/ErrorCases.h"
#include "detail/ErrorEstimateImpl.h"
#include "genu/contact/AdaptiveGrid.h"

namespace {

using namespace genu::contact;
using namespace genu::contact::test;

const char* const kQuantities[] = {"force", "moment", "peak", "mean", "area"};

std::array<double, 5> toArray(const LoadError& e) {
  return {e.force_N, e.moment_Nm, e.peakPressure_Pa, e.meanPressure_Pa, e.area_m2};
}

struct Sample {
  double ratio;  // estimate / error
  bool covered;
  std::string where;
};

double percentile(std::vector<double> v, double p) {
  if (v.empty()) return 0;
  std::sort(v.begin(), v.end());
  return v[static_cast<size_t>(p * static_cast<double>(v.size() - 1) + 0.5)];
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/** Elements and times of adaptive and plain grids of the same estimated errors: force, area and peak of a condyle on a dish. */
void compareAdaptive() {
  const ErrorProblem p = makeErrorProblem(ErrorSet::test, 5, 0);
  std::printf("\ncondyle on a dish, force, area and peak to a tolerance (true errors in brackets); times in ms, minimum of 3\n");
  std::printf("%-9s | %-8s %9s %9s %10s %s | %-8s %9s %9s %10s\n", "tolerance", "adaptive", "set-up", "first", "next pose", "", "plain", "set-up",
              "estimate", "next pose");
  for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
    AdaptiveOptions options;
    options.tolerance.force = options.tolerance.area = options.tolerance.peakPressure = tolerance;
    double time[2][3] = {{1e9, 1e9, 1e9}, {1e9, 1e9, 1e9}}, worst = 0;
    int elements = 0, n = 10;
    const auto relative = [&](const NetLoad& load) {
      const LoadError e = calcError(load, p.reference.total);
      const NetLoad& t = p.reference.total;
      return std::max({e.force_N / t.forceOnM_F.norm(), e.area_m2 / t.area_m2, e.peakPressure_Pa / t.peakPressure_Pa});
    };
    JointCoordinates next = p.q;
    next[3] += 1e-5;
    for (int repeat = 0; repeat < 3; ++repeat) {
      const double t0 = now();
      AdaptiveContact contact(makeErrorGrid(p, ContactRule::smooth, 10, 0.5, 0.5), options);
      const double t1 = now();
      const AdaptiveResult& r = contact.evaluate(p.q);
      const double t2 = now();
      worst = relative(r.result.total);
      elements = r.elements;
      contact.evaluate(next);
      const double t3 = now();
      time[0][0] = std::min(time[0][0], t1 - t0);
      time[0][1] = std::min(time[0][1], t2 - t1);
      time[0][2] = std::min(time[0][2], t3 - t2);
    }
    double plainWorst = 0;
    for (bool done = false; !done && n < 1000; n = done ? n : n * 9 / 8) {
      for (int repeat = 0; repeat < 3; ++repeat) {
        const double t0 = now();
        const ContactPair pair(makeErrorGrid(p, ContactRule::smooth, n, 0.5, 0.5));
        ContactWorkspace workspace(pair);
        const double t1 = now();
        ContactResult r;
        pair.evaluate(p.q, workspace, {}, r);
        ErrorEstimator estimator(pair);
        ContactErrorEstimate e;
        estimator.evaluate(workspace, e);
        const double t2 = now();
        done = e.total.force_N <= tolerance * r.total.forceOnM_F.norm() && e.total.area_m2 <= tolerance * r.total.area_m2 &&
               e.total.peakPressure_Pa <= tolerance * r.total.peakPressure_Pa;
        if (!done) break;
        plainWorst = relative(r.total);
        pair.evaluate(next, workspace, {}, r);
        estimator.evaluate(workspace, e);
        const double t3 = now();
        time[1][0] = std::min(time[1][0], t1 - t0);
        time[1][1] = std::min(time[1][1], t2 - t1);
        time[1][2] = std::min(time[1][2], t3 - t2);
      }
    }
    std::printf("%-9g | %-8d %9.2f %9.2f %10.3f (%.1e) | %-8d %9.2f %9.2f %10.3f (%.1e)\n", tolerance, elements, time[0][0] * 1e3,
                time[0][1] * 1e3, time[0][2] * 1e3, worst, n * n, time[1][0] * 1e3, time[1][1] * 1e3, time[1][2] * 1e3, plainWorst);
  }
}

}  // namespace

int main(int argc, char** argv) {
  ErrorSet set = ErrorSet::test;
  int problems = 6;
  std::string csvFile;
  for (int i = 1; i < argc; ++i) {
    const std::string a = argv[i];
    if (a == "--training") {
      set = ErrorSet::training;
    } else if (a == "--problems" && i + 1 < argc) {
      problems = std::atoi(argv[++i]);
    } else if (a == "--csv" && i + 1 < argc) {
      csvFile = argv[++i];
    } else {
      std::fprintf(stderr, "usage: error_estimate_table [--training] [--problems N] [--csv FILE]\n");
      return 2;
    }
  }
  std::ofstream csv;
  if (!csvFile.empty()) {
    csv.open(csvFile);
    csv << "kind,number,n,rule,companion,level,active,edge,quantity,value,error,difference,cells,end,rise,estimate\n";
  }
  std::vector<Sample> samples[2][2][5];  // rule, companion, quantity
  double cost[2] = {}, own = 0;
  int doubtful = 0;
  for (int kind = 0; kind < numKinds(set); ++kind) {
    for (int number = 0; number < problems; ++number) {
      const ErrorProblem p = makeErrorProblem(set, kind, number);
      std::mt19937 random(static_cast<unsigned>(77 + number));
      std::uniform_real_distribution<double> phase(0, 1);
      for (const int n : {8, 12, 17, 24, 32, 45, 60}) {
        for (int shift = 0; shift < (p.mayShift ? 3 : 1); ++shift) {
          const double px = phase(random), pz = phase(random);
          for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
            const ContactPair pair(makeErrorGrid(p, rule, n, px, pz));
            ContactWorkspace workspace(pair);
            ContactResult r;
            pair.evaluate(p.q, workspace, {}, r);
            if (r.status == EvaluationStatus::fullPenetration) {
              ++doubtful;
              continue;
            }
            for (const Companion companion : {Companion::fine, Companion::coarse}) {
              ErrorEstimator estimator(pair, companion);
              ContactErrorEstimate estimate;
              estimator.evaluate(workspace, estimate);
              const int c = companion == Companion::coarse, ru = rule == ContactRule::centre;
              if (n == 32 && shift == 0 && rule == ContactRule::smooth) {  // warm: a small motion there and back
                JointCoordinates q = p.q;
                double least[2] = {1e9, 1e9};
                for (int k = 0; k < 8; ++k) {
                  q[4] += (k % 2 ? 1 : -1) * 1e-6;
                  const double t0 = now();
                  pair.evaluate(q, workspace, {}, r);
                  const double t1 = now();
                  estimator.evaluate(workspace, estimate);
                  const double t2 = now();
                  least[0] = std::min(least[0], t1 - t0);
                  least[1] = std::min(least[1], t2 - t1);
                }
                if (c == 0) own += least[0];
                cost[c] += least[1];
                pair.evaluate(p.q, workspace, {}, r);
                estimator.evaluate(workspace, estimate);
              }
              for (size_t k = 0; k <= (r.compartments.size() > 1 ? r.compartments.size() : 0); ++k) {
                const bool isTotal = k == 0;
                const NetLoad& load = isTotal ? r.total : r.compartments[k - 1];
                const NetLoad& ref = isTotal ? p.reference.total : p.reference.compartments[k - 1];
                if (!(ref.area_m2 > 0) && !(load.area_m2 > 0)) continue;
                const auto error = toArray(calcError(load, ref)), e = toArray(isTotal ? estimate.total : estimate.compartments[k - 1]);
                const auto value = toArray(calcError(ref, NetLoad{}));
                const detail::RawDifference raw = ErrorEstimatorProbe::raw(estimator, isTotal ? -1 : static_cast<int>(k) - 1);
                const auto difference = toArray(raw.difference), cells = toArray(raw.cells), end = toArray(raw.edge);
                for (size_t j = 0; j < 5; ++j) {
                  const double scale = j == 1 ? std::max(value[1], 1e-3 * value[0]) : value[j];
                  const bool exact = error[j] <= 1e-9 * scale;
                  samples[ru][c][j].push_back({exact ? -1 : e[j] / error[j], exact || error[j] <= e[j],
                                               p.kind + " " + std::to_string(number) + ", " + std::to_string(n) + " cells"});
                  if (csv.is_open()) {
                    csv << p.kind << ',' << number << ',' << n << ',' << ru << ',' << c << ',' << k << ',' << load.activeElements << ',' << raw.atEdge << ','
                        << kQuantities[j] << ',' << scale << ',' << error[j] << ',' << difference[j] << ',' << cells[j] << ',' << end[j] << ','
                        << (j == 2 ? raw.peakRise_Pa : 0) << ',' << e[j] << '\n';
                  }
                }
              }
            }
          }
        }
      }
    }
  }
  std::printf("%s set, %d problems of each of %d kinds; %d evaluations with full penetration left out\n",
              set == ErrorSet::training ? "training" : "test", problems, numKinds(set), doubtful);
  std::printf("%-7s %-7s %-7s %6s %9s %8s %8s %8s %8s   worst\n", "rule", "against", "", "cases", "covered", "not", "p05", "median", "p95");
  for (int ru = 0; ru < 2; ++ru) {
    for (int c = 0; c < 2; ++c) {
      for (size_t j = 0; j < 5; ++j) {
        const auto& v = samples[ru][c][j];
        std::vector<double> ratio;
        int covered = 0;
        const Sample* worst = nullptr;
        for (const Sample& s : v) {
          covered += s.covered;
          if (s.ratio < 0) continue;
          ratio.push_back(s.ratio);
          if (worst == nullptr || s.ratio < worst->ratio) worst = &s;
        }
        std::printf("%-7s %-7s %-7s %6zu %8.1f%% %8d %8.2f %8.2f %8.1f   %.2f (%s)\n", ru ? "centre" : "smooth", c ? "coarse" : "fine",
                    kQuantities[j], v.size(), 100.0 * covered / static_cast<double>(v.size()), static_cast<int>(v.size()) - covered,
                    percentile(ratio, 0.05), percentile(ratio, 0.5), percentile(ratio, 0.95), worst ? worst->ratio : 0.0,
                    worst ? worst->where.c_str() : "-");
      }
    }
  }
  std::printf("cost of an estimate, smooth rule, 32 x 32, warm: fine %.2f, coarse %.2f of an evaluation\n", cost[0] / own, cost[1] / own);
  if (set == ErrorSet::test) compareAdaptive();
  return 0;
}
