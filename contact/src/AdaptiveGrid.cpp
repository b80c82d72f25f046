#include "genu/contact/AdaptiveGrid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <unordered_map>
#include <utility>

#include "detail/ErrorEstimateImpl.h"

namespace genu::contact {

using namespace detail;

const char* toString(AdaptiveStatus status) {
  switch (status) {
    case AdaptiveStatus::converged: return "converged";
    case AdaptiveStatus::elementLimit: return "element_limit";
    case AdaptiveStatus::levelLimit: return "level_limit";
    case AdaptiveStatus::iterationLimit: return "iteration_limit";
    case AdaptiveStatus::doubtful: return "doubtful";
  }
  return "unknown";
}

namespace {

enum Quantity { kForce, kMoment, kPeak, kMean, kArea, kQuantities };
const char* const kNames[kQuantities] = {"force", "moment", "peak pressure", "mean pressure", "area"};

struct Cell {
  size_t compartment;
  int index;
};

}  // namespace

struct AdaptiveContact::Impl {
  AdaptiveOptions options;
  std::array<std::optional<double>, kQuantities> tolerance;
  std::vector<std::vector<GridCell>> base, refined;  // of each compartment
  std::unique_ptr<ContactPair> pair;
  std::optional<ContactWorkspace> workspace;
  std::optional<ErrorEstimator> estimator;
  AdaptiveResult out;
  bool isBase = true;
  std::vector<std::vector<char>> marked;
  std::vector<std::pair<double, Cell>> order;

  Impl(ContactPairDefinition definition, const AdaptiveOptions& o) : options(o) {
    tolerance = {o.tolerance.force, o.tolerance.moment, o.tolerance.peakPressure, o.tolerance.meanPressure, o.tolerance.area};
    bool any = false;
    for (int j = 0; j < kQuantities; ++j) {
      const auto& t = tolerance[static_cast<size_t>(j)];
      if (!t) continue;
      any = true;
      if (!(*t >= 1e-12 && *t <= 1)) fail("adaptive grid: tolerance of the ", kNames[j], " is ", *t, "; allowed: 1e-12 to 1 (relative)");
    }
    if (!any) fail("adaptive grid: no tolerance is given; give at least one of force, moment, peak pressure, mean pressure, area");
    if (o.maxElements < 1) fail("adaptive grid: at most ", o.maxElements, " elements; allowed: at least 1");
    if (o.maxLevel < 0 || o.maxLevel >= kMaxGridLevel) {
      fail("adaptive grid: finest level ", o.maxLevel, "; allowed: 0 to ", kMaxGridLevel - 1);
    }
    if (!(o.marking > 0 && o.marking <= 1)) fail("adaptive grid: marking ", o.marking, "; allowed: above 0, up to 1");
    if (o.maxIterations < 1) fail("adaptive grid: at most ", o.maxIterations, " iterations; allowed: at least 1");
    for (const CompartmentDefinition& c : definition.compartments) base.push_back(c.refined);
    refined = base;
    definition.copyTolerance = 0;
    pair = std::make_unique<ContactPair>(std::move(definition));
    workspace.emplace(*pair);
    estimator.emplace(*pair);
  }

  /** Puts `cells` in force. */
  void setGrid(std::vector<std::vector<GridCell>> cells) {
    refined = std::move(cells);
    auto next = std::make_unique<ContactPair>(pair->withRefinedCells(refined));
    ErrorEstimator estimate(*next);
    if (estimator->impl_->other) estimate.impl_->build(&*estimator->impl_->other);
    workspace.emplace(*next);
    estimator = std::move(estimate);
    pair = std::move(next);
    isBase = refined == base;
  }

  void start() {
    if (!isBase) setGrid(base);
    isBase = true;
  }

  double share(int quantity) const {  // estimated error as a share of the quantity
    const NetLoad& load = out.result.total;
    const LoadError& e = out.estimate.total;
    const double force = load.forceOnM_F.norm();
    const auto ratio = [](double error, double value) { return error == 0 ? 0 : value > 0 ? error / value : 1e300; };
    switch (quantity) {
      case kForce: return ratio(e.force_N, force);
      case kMoment: return ratio(e.moment_Nm, std::max(load.momentOnM_Fo_F.norm(), 1e-3 * force));
      case kPeak: return ratio(e.peakPressure_Pa, load.peakPressure_Pa);
      case kMean: return ratio(e.meanPressure_Pa, load.meanPressure_Pa);
      default: return ratio(e.area_m2, load.area_m2);
    }
  }

  /** Marks the cells with the largest `weight` that together hold the share `marking` of its sum. */
  template <class Weight>
  void mark(const Weight& weight) {
    const ErrorEstimator::Impl& m = *estimator->impl_;
    order.clear();
    double sum = 0;
    for (size_t k = 0; k < m.cells.size(); ++k) {
      for (size_t i = 0; i < m.cells[k].size(); ++i) {
        const double w = weight(m.cells[k][i]);
        if (!(w > 0)) continue;
        sum += w;
        order.push_back({w, Cell{k, static_cast<int>(i)}});
      }
    }
    // Largest first; among equals the order of cells, so that the grid does not depend on the sort.
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    double held = 0;
    for (const auto& [w, cell] : order) {
      if (held >= options.marking * sum) break;
      held += w;
      marked[cell.compartment][static_cast<size_t>(cell.index)] = 1;
    }
  }

  void markFor(int quantity) {
    const ErrorEstimator::Impl& m = *estimator->impl_;
    const double F = std::max(out.result.total.scalarForce_N, 1e-300), A = std::max(out.result.total.area_m2, 1e-300);
    switch (quantity) {
      case kForce: mark([](const CellDifference& d) { return d.force_N * d.force_N; }); break;
      case kMoment: mark([](const CellDifference& d) { return d.moment_Nm * d.moment_Nm; }); break;
      case kArea: mark([](const CellDifference& d) { return d.area_m2 * d.area_m2; }); break;
      case kMean:
        mark([&](const CellDifference& d) { return std::pow(d.force_N / F, 2) + std::pow(d.area_m2 / A, 2); });
        break;
      default: {
        // The compartment with the peak, or where the companion puts it.
        for (size_t k = 0; k < m.peakCells.size(); ++k) {
          const double own = out.result.compartments[k].peakPressure_Pa, other = m.result.compartments[k].peakPressure_Pa;
          if (own < out.result.total.peakPressure_Pa && other < m.result.total.peakPressure_Pa) continue;
          for (const int i : m.peakCells[k]) marked[k][static_cast<size_t>(i)] = 1;
        }
      }
    }
  }

  /** Marks the cells around the marked ones that are not finer than they. A whole cell that the rim cuts can agree with its four
   children, all in or all out, and be wrong; beside it the rim cuts cells that do not agree. */
  void markAround() {
    const ErrorEstimator::Impl& m = *estimator->impl_;
    const auto key = [](const GridCell& c) {
      return (static_cast<std::uint64_t>(c.level) << 56) | (static_cast<std::uint64_t>(c.ix) << 28) | static_cast<std::uint64_t>(c.iz);
    };
    for (size_t k = 0; k < marked.size(); ++k) {
      const CompartmentDefinition& c = pair->definition().compartments[k];
      std::unordered_map<std::uint64_t, size_t> at;
      for (size_t i = 0; i < m.cellOf[k].size(); ++i) at.emplace(key(m.cellOf[k][i]), i);
      const std::vector<char> before = marked[k];
      for (size_t i = 0; i < before.size(); ++i) {
        if (!before[i]) continue;
        const GridCell& cell = m.cellOf[k][i];
        for (int dx = -1; dx <= 1; ++dx) {
          for (int dz = -1; dz <= 1; ++dz) {
            GridCell next{cell.level, cell.ix + dx, cell.iz + dz};
            if (next.ix < 0 || next.iz < 0 || next.ix >= c.nx << next.level || next.iz >= c.nz << next.level) continue;
            for (;; next = {next.level - 1, next.ix / 2, next.iz / 2}) {
              const auto it = at.find(key(next));
              if (it != at.end()) marked[k][it->second] = 1;
              if (it != at.end() || next.level == 0) break;
            }
          }
        }
      }
    }
  }

  void describeGrid() {
    out.elementsPerLevel.assign(1, 0);
    const ErrorEstimator::Impl& m = *estimator->impl_;
    for (size_t k = 0; k < m.cellOf.size(); ++k) {
      for (int e = 0; e < m.elements[k]; ++e) {
        const auto level = static_cast<size_t>(m.cellOf[k][static_cast<size_t>(e)].level);
        if (level >= out.elementsPerLevel.size()) out.elementsPerLevel.resize(level + 1, 0);
        ++out.elementsPerLevel[level];
      }
    }
    out.elements = pair->numElements();
  }

  /** Share of the split cells' area, in cells, that is in contact. */
  bool isMostlyIdle() const {
    int fine = 0, active = 0;
    const auto fields = pair->calcFields(*workspace);
    for (const auto& compartment : fields) {
      for (const ElementField& f : compartment) {
        fine += f.level > 0;
        active += f.level > 0 && f.active;
      }
    }
    return fine > 0 && 4 * active < fine;
  }

  void stop(AdaptiveStatus status, int worst, const char* what) {
    out.status = status;
    const auto text = [](double x) {
      char buffer[32];
      std::snprintf(buffer, sizeof buffer, "%.3g", x);
      return std::string(buffer);
    };
    out.advice = std::string("the estimated error of the ") + kNames[worst] + " is " + text(share(worst)) + " of its value, wanted " +
                 text(*tolerance[static_cast<size_t>(worst)]) + ", on " + std::to_string(out.elements) + " elements: " + what;
  }

  void run(const JointCoordinates& q) {
    // The first of several grids that passes is taken, so that estimates which are small by chance are preferred. Those of the
    // centre rule are largely chance.
    const bool isCentre = pair->definition().rule == ContactRule::centre;
    const double caution = isCentre ? 2 : 1;
    out.iterations = 0;
    out.advice.clear();
    bool fresh = isBase;
    for (;;) {
      ++out.iterations;
      pair->evaluate(q, *workspace, options.evaluation, out.result);
      if (!fresh && out.iterations == 1 && isMostlyIdle()) {
        start();
        fresh = true;
        continue;
      }
      if (out.result.status == EvaluationStatus::fullPenetration || out.result.status == EvaluationStatus::notConverged) {
        out.estimate = ContactErrorEstimate{};
        out.estimate.compartments.resize(out.result.compartments.size());
        if (!estimator->impl_->other) estimator->impl_->build();
        describeGrid();
        out.status = AdaptiveStatus::doubtful;
        out.advice = std::string("the evaluation ended with the status ") + toString(out.result.status) +
                     ": correct the pose or the scene, a finer grid does not help";
        return;
      }
      estimator->evaluate(*workspace, out.estimate);
      describeGrid();
      int worst = -1;
      double excess = 1;
      const ErrorEstimator::Impl& m = *estimator->impl_;
      marked.resize(m.cellOf.size());
      for (size_t k = 0; k < marked.size(); ++k) marked[k].assign(m.cellOf[k].size(), 0);
      for (int j = 0; j < kQuantities; ++j) {
        const auto& t = tolerance[static_cast<size_t>(j)];
        if (!t) continue;
        const double over = caution * share(j) / *t;
        if (over <= 1) continue;
        markFor(j);
        if (over > excess) {
          excess = over;
          worst = j;
        }
      }
      if (worst < 0) {
        out.status = AdaptiveStatus::converged;
        return;
      }
      if (isCentre) markAround();
      if (out.iterations >= options.maxIterations) {
        return stop(AdaptiveStatus::iterationLimit, worst, "allow more iterations or a larger tolerance");
      }
      auto next = refined;
      int added = 0;
      bool isLimited = false;
      for (size_t k = 0; k < marked.size(); ++k) {
        for (size_t i = 0; i < marked[k].size(); ++i) {
          const GridCell& cell = m.cellOf[k][i];
          if (!marked[k][i]) continue;
          if (cell.level >= options.maxLevel) {
            isLimited = true;
            continue;
          }
          next[k].push_back(cell);
          ++added;
        }
      }
      if (added == 0) {
        return stop(AdaptiveStatus::levelLimit, worst,
                    isLimited ? "allow finer levels or a larger tolerance" : "no cell shows where it comes from; use a finer base grid");
      }
      if (out.elements + 3 * added > options.maxElements) {
        if (!fresh) {  // what earlier poses refined may be in the way
          start();
          fresh = true;
          continue;
        }
        return stop(AdaptiveStatus::elementLimit, worst, "allow more elements or a larger tolerance");
      }
      setGrid(std::move(next));
    }
  }
};

AdaptiveContact::AdaptiveContact(ContactPairDefinition definition, const AdaptiveOptions& options)
    : impl_(std::make_unique<Impl>(std::move(definition), options)) {}
AdaptiveContact::~AdaptiveContact() = default;
AdaptiveContact::AdaptiveContact(AdaptiveContact&&) noexcept = default;

const AdaptiveResult& AdaptiveContact::evaluate(const JointCoordinates& q) {
  impl_->run(q);
  return impl_->out;
}
const AdaptiveResult& AdaptiveContact::evaluate(const Pose& X_FM) { return evaluate(calcCoordinates(X_FM)); }
void AdaptiveContact::start() { impl_->start(); }
const ContactPair& AdaptiveContact::pair() const { return *impl_->pair; }
const ContactWorkspace& AdaptiveContact::workspace() const { return *impl_->workspace; }

}  // namespace genu::contact
