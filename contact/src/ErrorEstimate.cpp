#include "genu/contact/ErrorEstimate.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "detail/ErrorEstimateImpl.h"

namespace genu::contact {

using namespace detail;

namespace {

/** The grid with every cell split: doubled, so that (level, ix, iz) names a cell half as large. */
void splitEveryCell(CompartmentDefinition& c) {
  std::vector<GridCell> refined;
  for (const GridCell& cell : c.refined) {
    if (cell.level > 0) refined.push_back({cell.level - 1, cell.ix, cell.iz});
  }
  for (const GridCell& cell : findLeaves(c)) {
    if (cell.level > 0) refined.push_back({cell.level - 1, cell.ix, cell.iz});
  }
  c.nx *= 2;
  c.nz *= 2;
  c.refined = std::move(refined);
}

double square(double x) { return x * x; }

/** Fall of the pressure from the largest value at a centre to the mean of the centres around it: p'' h^2 / 2. `around`:
 the elements there; `atEdge`: the fixed surface ends beside it. */
double calcFall(const Compartment& c, const std::vector<Active>& active, std::vector<double>& pressure, std::vector<int>& around, bool& atEdge) {
  const Active* peak = nullptr;
  for (const Active& a : active) {
    pressure[static_cast<size_t>(a.element)] = a.p_Pa;
    if (peak == nullptr || a.p_Pa > peak->p_Pa) peak = &a;
  }
  double fall = 0;
  atEdge = false;
  around.clear();
  if (peak != nullptr) {
    const auto& stencil = c.stencil[static_cast<size_t>(peak->element)];
    for (const int k : stencil) {
      if (k >= 0 && k < c.elements) around.push_back(k);
    }
    double sum = 0;
    int count = 0;
    for (size_t k = 1; k < 5; ++k) {
      if (stencil[k] < 0) continue;
      ++count;
      if (stencil[k] < c.elements) sum += pressure[static_cast<size_t>(stencil[k])];
    }
    if (count > 0) fall = std::max(0.0, peak->p_Pa - sum / count);
    atEdge = count < 4;
  }
  for (const Active& a : active) pressure[static_cast<size_t>(a.element)] = 0;
  return fall;
}

/** Sides of an element beside which there is no surface. */
int countEnds(const Compartment& c, int element) {
  int ends = 0;
  for (size_t k = 1; k < 5; ++k) ends += c.stencil[static_cast<size_t>(element)][k] < 0;
  return ends;
}

/** What the active cells carry beside which the fixed surface ends: its end lies anywhere within half a cell of where the grid
 puts it, and two grids often put it at the same place. */
LoadError calcEdge(const Compartment& c, const std::vector<Active>& active, const NetLoad& load) {
  LoadError e;
  for (const Active& a : active) {
    const auto i = static_cast<size_t>(a.element);
    const int ends = countEnds(c, a.element);
    if (ends == 0) continue;
    e.force_N += ends * a.force_N;
    e.area_m2 += ends * a.share * c.area_m2[i];
    e.moment_Nm += ends * a.force_N * c.p_FA[i].cross(a.direction_F).norm();
  }
  if (load.area_m2 > 0) e.meanPressure_Pa = std::abs(e.force_N - load.meanPressure_Pa * e.area_m2) / load.area_m2;
  return e;
}

/** Whether some cell in contact lacks a neighbor, because a surface ends. */
bool reachesEdge(const Compartment& c, const CompartmentMemory& m, const std::vector<Active>& active, const NetLoad& load, bool smooth) {
  if (load.boundaryElements > 0) return true;
  for (const Active& a : active) {
    for (const int k : c.stencil[static_cast<size_t>(a.element)]) {
      if (k < 0) return true;
      if (!smooth) continue;
      const auto node = static_cast<size_t>(k);
      if (!m.usable[node] || m.feet[node].status == QueryStatus::onBoundary) return true;
    }
  }
  return false;
}

}  // namespace

// Factors, measured on the training set of tests/contact/ErrorCases.h (30 problems of each kind) by
// error_estimate_table --training --csv; each is the smallest round number that covers 95 % there with some room.
namespace {

/** One number for each of force, moment, peak, mean, area. */
struct Factors {
  double force, moment, peak, mean, area;
};
struct Calibration {
  Factors a, aAtEdge;   // of the difference
  double growth;        // a grows by 1 + growth / n with few active cells n
  Factors known;        // of Q n^-rate, the error that the rule is known to make (coarse companion)
  Factors rate;
};
constexpr double kEdge = 0.4;        // share of half a cell's width of the end of the surface: 0.29 is its standard deviation
constexpr double kCellsOfMean = 0.3; // the mean is less sensitive than force and area are, which err together
constexpr Calibration kFineSmooth = {{1.5, 1.5, 1.5, 1.5, 1.5}, {2, 2, 1.5, 2, 2}, 0, {}, {}};
constexpr Calibration kFineCentre = {{2, 2, 2, 2, 2}, {2, 2, 2, 2, 2}, 0, {}, {}};
constexpr double kCellsSmooth = 1.0, kCellsCentre = 0.6;  // fine companion: of the root of the cells' squares, times a
constexpr Calibration kCoarseSmooth = {{0.28, 0.28, 0.01, 0.45, 0.5}, {1.5, 1.5, 0.02, 1.5, 3}, 3, {0.03, 0.03, 0, 0.04, 0.03},
                                       {2, 2, 2, 2, 2}};
constexpr Calibration kCoarseCentre = {{1, 1, 2, 1, 1}, {1.5, 1.5, 2, 1, 1}, 1, {1.5, 1.5, 0.7, 1.2, 1}, {1.25, 1.25, 1, 0.75, 0.75}};

// Peak pressure, centre rule: of the fall from the largest centre to its neighbors.
constexpr double kFall = 0.35;
// Peak pressure, smooth rule. It is the pressure p at the top x_h of a polynomial, asked of the surfaces; what is wrong is the place. The
// polynomial's slope errs by e h^2 (t^2/2 - 1/6) at t cells from its point, e the third derivative, so that
//   x_h - x = O(h^2),  p(x) - p(x_h) = p'' (x_h - x)^2 / 2 = O(h^4),
// O(h^6) where symmetry takes e away. The same from places a quarter of a cell apart errs by a sixteenth of that slope at most: the rise
// from x_h to their top is the error, to 7/8 squared where t = 0. The difference from the companion is there for what lies elsewhere: a
// contact of a few cells, another hill. The coarse companion's own error is 16 to 64 times the evaluation's, as h^4 to h^6, unless cells
// are few: a share 1/n^2 of it, n ~ h^-2. Beyond the end of the fixed surface, half a cell off at most, places reach half the way.
constexpr double kRise = 1.5, kRiseAtEnd = 0.05;

double norm(double a, double b, double c) { return std::sqrt(a * a + b * b + c * c); }

}  // namespace

LoadError detail::calcEstimate(const RawDifference& raw, const NetLoad& load, bool smooth, Companion companion) {
  const bool isFine = companion == Companion::fine;
  const Calibration& k = isFine ? (smooth ? kFineSmooth : kFineCentre) : (smooth ? kCoarseSmooth : kCoarseCentre);
  const double n = std::max(raw.activeElements, 1), few = 1 + k.growth / n;
  const double cells = isFine ? (smooth ? kCellsSmooth : kCellsCentre) : 0;
  const double force = load.forceOnM_F.norm(), moment = load.momentOnM_Fo_F.norm();
  const Factors a = raw.atEdge ? k.aAtEdge : k.a;
  const auto estimate = [&](double Factors::*of, double LoadError::*q, double value, double cellSum) {
    return norm(few * a.*of * std::hypot(raw.difference.*q, cellSum), k.known.*of * value * std::pow(n, -(k.rate.*of)), kEdge * raw.edge.*q);
  };
  LoadError e;
  e.force_N = estimate(&Factors::force, &LoadError::force_N, force, cells * raw.cells.force_N);
  e.moment_Nm = estimate(&Factors::moment, &LoadError::moment_Nm, moment, cells * raw.cells.moment_Nm);
  e.area_m2 = estimate(&Factors::area, &LoadError::area_m2, load.area_m2, cells * raw.cells.area_m2);
  double meanCells = 0;
  if (isFine && load.scalarForce_N > 0 && load.area_m2 > 0) {
    meanCells = kCellsOfMean * load.meanPressure_Pa * std::hypot(raw.cells.force_N / load.scalarForce_N, raw.cells.area_m2 / load.area_m2);
  }
  e.meanPressure_Pa = estimate(&Factors::mean, &LoadError::meanPressure_Pa, load.meanPressure_Pa, meanCells);
  if (smooth) {
    const double share = a.peak + (isFine ? 0 : 1 / square(n));
    e.peakPressure_Pa = norm(share * raw.difference.peakPressure_Pa, kRise * raw.peakRise_Pa, kRiseAtEnd * raw.edge.peakPressure_Pa);
  } else {
    e.peakPressure_Pa = std::hypot(estimate(&Factors::peak, &LoadError::peakPressure_Pa, load.peakPressure_Pa, 0), kFall * raw.cells.peakPressure_Pa);
  }
  return e;
}

void ErrorEstimator::Impl::build(const ContactPair* known) {
  ContactPairDefinition d = pair.definition();
  d.copyTolerance = 0;
  for (CompartmentDefinition& c : d.compartments) {
    if (companion == Companion::fine) {
      splitEveryCell(c);
    } else {
      c.nx = (c.nx + 1) / 2;
      c.nz = (c.nz + 1) / 2;
    }
  }
  if (known) {
    std::vector<std::vector<GridCell>> refined;
    for (CompartmentDefinition& c : d.compartments) refined.push_back(std::move(c.refined));
    other.emplace(known->withRefinedCells(std::move(refined)));
  } else {
    other.emplace(std::move(d));
  }
  workspace.emplace(*other);
  const size_t n = pair.impl_->compartments.size();
  raw.resize(n);
  cells.resize(n);
  parent.resize(n);
  pressure.resize(n);
  cellOf.resize(n);
  elements.resize(n);
  peakCells.resize(n);
  size_t largest = 0, largestOther = 0;
  for (size_t k = 0; k < n; ++k) {
    const Compartment& own = pair.impl_->compartments[k];
    elements[k] = own.elements;
    largest = std::max(largest, own.size());
    largestOther = std::max(largestOther, other->impl_->compartments[k].size());
    pressure[k].resize(own.size());
    cellOf[k].assign(own.cell.begin(), own.cell.begin() + own.elements);
    peakCells[k].reserve(16);
    if (companion == Companion::coarse) continue;
    const Compartment& fine = other->impl_->compartments[k];
    // A cell of the companion at level L is a quarter of the cell (L, ix / 2, iz / 2).
    std::unordered_map<std::uint64_t, int> at;
    const auto key = [](int level, int ix, int iz) {
      return (static_cast<std::uint64_t>(level) << 56) | (static_cast<std::uint64_t>(ix) << 28) | static_cast<std::uint64_t>(iz);
    };
    for (int e = 0; e < own.elements; ++e) {
      const GridCell& cell = own.cell[static_cast<size_t>(e)];
      at.emplace(key(cell.level, cell.ix, cell.iz), e);
    }
    parent[k].resize(fine.size());
    for (size_t e = 0; e < fine.size(); ++e) {
      const GridCell& cell = fine.cell[e];
      const GridCell larger{cell.level, cell.ix / 2, cell.iz / 2};
      const auto [it, isNew] = at.emplace(key(larger.level, larger.ix, larger.iz), static_cast<int>(cellOf[k].size()));
      if (isNew) cellOf[k].push_back(larger);
      parent[k][e] = it->second;
    }
    cells[k].resize(cellOf[k].size());
  }
  active.reserve(largest);
  otherActive.reserve(largestOther);
}

ErrorEstimator::ErrorEstimator(const ContactPair& pair, Companion companion)
    : impl_(std::make_unique<Impl>(pair, companion)) {
  if (companion == Companion::fine) return;
  for (const CompartmentDefinition& c : pair.definition().compartments) {
    if (!c.refined.empty()) {
      fail("error estimate: compartment ", c.name, " has refined cells, so that a coarser companion is not defined; use the fine one");
    }
  }
}
ErrorEstimator::~ErrorEstimator() = default;
ErrorEstimator::ErrorEstimator(ErrorEstimator&&) noexcept = default;
ErrorEstimator& ErrorEstimator::operator=(ErrorEstimator&&) noexcept = default;

const ContactResult& ErrorEstimator::companionResult() const { return impl_->result; }

void ErrorEstimator::evaluate(const ContactWorkspace& ownWorkspace, ContactErrorEstimate& estimate) {
  Impl& m = *impl_;
  ContactWorkspace::Impl& own = *ownWorkspace.impl_;  // is only read
  const size_t n = m.pair.impl_->compartments.size();
  estimate.compartments.assign(n, LoadError{});
  estimate.total = LoadError{};
  estimate.companionStatus = EvaluationStatus::ok;
  if (!own.hasStored) return;
  if (!m.other) m.build();
  estimate.companionElements = m.other->numElements();
  m.workspace->setTaskRunner(own.runner);
  m.other->evaluate(own.storedQ, own.storedRates, *m.workspace, {}, m.result);
  estimate.companionStatus = m.result.status;

  const auto difference = [](const NetLoad& a, const NetLoad& b) {
    LoadError e;
    e.force_N = (a.forceOnM_F - b.forceOnM_F).norm();
    e.moment_Nm = (a.momentOnM_Fo_F - b.momentOnM_Fo_F).norm();
    e.peakPressure_Pa = std::abs(a.peakPressure_Pa - b.peakPressure_Pa);
    e.meanPressure_Pa = std::abs(a.meanPressure_Pa - b.meanPressure_Pa);
    e.area_m2 = std::abs(a.area_m2 - b.area_m2);
    return e;
  };
  const bool smooth = m.pair.definition().rule == ContactRule::smooth;
  const auto finish = [&](const RawDifference& raw, const NetLoad& load) { return calcEstimate(raw, load, smooth, m.companion); };
  RawDifference total;
  for (size_t k = 0; k < n; ++k) {
    const Compartment& c = m.pair.impl_->compartments[k];
    RawDifference& raw = m.raw[k];
    m.pair.impl_->findActive(c, own.compartments[k], m.active);
    raw.difference = difference(own.stored.compartments[k], m.result.compartments[k]);
    raw.cells = LoadError{};
    raw.activeElements = own.stored.compartments[k].activeElements;
    raw.atEdge = reachesEdge(c, own.compartments[k], m.active, own.stored.compartments[k], smooth);
    bool peakAtEdge = false;
    raw.cells.peakPressure_Pa = calcFall(c, m.active, m.pressure[k], m.peakCells[k], peakAtEdge);
    raw.edge = calcEdge(c, m.active, own.stored.compartments[k]);
    if (peakAtEdge) raw.edge.peakPressure_Pa = raw.cells.peakPressure_Pa;
    raw.peakRise_Pa = smooth ? m.pair.impl_->calcPeakRise(c, own.compartments[k], own.X_evaluated, own.stored.compartments[k]) : 0;
    if (m.companion == Companion::fine) {
      const Compartment& fine = m.other->impl_->compartments[k];
      std::vector<CellDifference>& cells = m.cells[k];
      std::fill(cells.begin(), cells.end(), CellDifference{});
      const auto add = [&](CellDifference& d, const Compartment& grid, const Active& a, double sign) {
        const auto i = static_cast<size_t>(a.element);
        d.force_N += sign * a.force_N;
        d.area_m2 += sign * a.share * grid.area_m2[i];
      };
      for (const Active& a : m.active) add(cells[static_cast<size_t>(a.element)], c, a, 1);
      const Active* peak = nullptr;
      m.other->impl_->findActive(fine, m.workspace->impl_->compartments[k], m.otherActive);
      for (const Active& a : m.otherActive) {
        if (peak == nullptr || a.p_Pa > peak->p_Pa) peak = &a;
        CellDifference& d = cells[static_cast<size_t>(m.parent[k][static_cast<size_t>(a.element)])];
        add(d, fine, a, -1);
        // Arm of the cell's force: of its children in contact, any of them.
        d.moment_Nm = std::max(d.moment_Nm, fine.p_FA[static_cast<size_t>(a.element)].cross(a.direction_F).norm());
      }
      if (peak != nullptr) m.peakCells[k].push_back(m.parent[k][static_cast<size_t>(peak->element)]);
      for (const Active& a : m.active) {
        CellDifference& d = cells[static_cast<size_t>(a.element)];
        d.moment_Nm = std::max(d.moment_Nm, c.p_FA[static_cast<size_t>(a.element)].cross(a.direction_F).norm());
      }
      for (CellDifference& d : cells) {
        d.force_N = std::abs(d.force_N);
        d.area_m2 = std::abs(d.area_m2);
        d.moment_Nm *= d.force_N;
        raw.cells.force_N += square(d.force_N);
        raw.cells.moment_Nm += square(d.moment_Nm);
        raw.cells.area_m2 += square(d.area_m2);
      }
      // What the end of the surface may hide belongs to its cells too: the adaptive grid looks there.
      for (const Active& a : m.active) {
        const double share = kEdge * countEnds(c, a.element);
        if (share == 0) continue;
        const auto i = static_cast<size_t>(a.element);
        cells[i].force_N = std::hypot(cells[i].force_N, share * a.force_N);
        cells[i].area_m2 = std::hypot(cells[i].area_m2, share * a.share * c.area_m2[i]);
        cells[i].moment_Nm = std::hypot(cells[i].moment_Nm, share * a.force_N * c.p_FA[i].cross(a.direction_F).norm());
      }
    }
    total.cells.force_N += raw.cells.force_N;
    total.cells.moment_Nm += raw.cells.moment_Nm;
    total.cells.area_m2 += raw.cells.area_m2;
    total.edge.force_N += raw.edge.force_N;
    total.edge.moment_Nm += raw.edge.moment_Nm;
    total.edge.area_m2 += raw.edge.area_m2;
    total.atEdge = total.atEdge || raw.atEdge;
    total.activeElements += raw.activeElements;
    if (own.stored.compartments[k].peakPressure_Pa >= own.stored.total.peakPressure_Pa) {
      total.cells.peakPressure_Pa = raw.cells.peakPressure_Pa;
      total.edge.peakPressure_Pa = raw.edge.peakPressure_Pa;
      total.peakRise_Pa = raw.peakRise_Pa;
    }
    raw.cells.force_N = std::sqrt(raw.cells.force_N);
    raw.cells.moment_Nm = std::sqrt(raw.cells.moment_Nm);
    raw.cells.area_m2 = std::sqrt(raw.cells.area_m2);
    estimate.compartments[k] = finish(raw, own.stored.compartments[k]);
  }
  total.cells.force_N = std::sqrt(total.cells.force_N);
  total.cells.moment_Nm = std::sqrt(total.cells.moment_Nm);
  total.cells.area_m2 = std::sqrt(total.cells.area_m2);
  if (own.stored.total.area_m2 > 0) {
    total.edge.meanPressure_Pa = std::abs(total.edge.force_N - own.stored.total.meanPressure_Pa * total.edge.area_m2) / own.stored.total.area_m2;
  }
  total.difference = difference(own.stored.total, m.result.total);
  m.total = total;
  estimate.total = finish(total, own.stored.total);
}

}  // namespace genu::contact
