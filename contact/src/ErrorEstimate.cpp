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

/** Fall of the pressure from the largest value at a centre to the mean of the centres around it: p'' h^2 / 2. */
double calcFall(const Compartment& c, const CompartmentMemory& m, std::vector<double>& pressure) {
  const Active* peak = nullptr;
  for (const Active& a : m.active) {
    pressure[static_cast<size_t>(a.element)] = a.p_Pa;
    if (peak == nullptr || a.p_Pa > peak->p_Pa) peak = &a;
  }
  double fall = 0;
  if (peak != nullptr) {
    const auto& stencil = c.stencil[static_cast<size_t>(peak->element)];
    double sum = 0;
    int count = 0;
    for (size_t k = 1; k < 5; ++k) {
      if (stencil[k] < 0) continue;
      ++count;
      if (stencil[k] < c.elements) sum += pressure[static_cast<size_t>(stencil[k])];
    }
    if (count > 0) fall = std::max(0.0, peak->p_Pa - sum / count);
  }
  for (const Active& a : m.active) pressure[static_cast<size_t>(a.element)] = 0;
  return fall;
}

}  // namespace

void ErrorEstimator::Impl::build() {
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
  other.emplace(ContactPair(std::move(d)));
  workspace.emplace(*other);
  const size_t n = pair.impl_->compartments.size();
  raw.resize(n);
  cells.resize(n);
  parent.resize(n);
  pressure.resize(n);
  for (size_t k = 0; k < n; ++k) {
    const Compartment& own = pair.impl_->compartments[k];
    cells[k].resize(own.size() + 1);
    pressure[k].resize(own.size());
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
      const auto it = at.find(key(cell.level, cell.ix / 2, cell.iz / 2));
      parent[k][e] = it == at.end() ? own.elements : it->second;
    }
  }
}

ErrorEstimator::ErrorEstimator(const ContactPair& pair, Companion companion)
    : impl_(new Impl{pair, companion, {}, {}, {}, {}, {}, {}, {}}) {
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
  const ContactWorkspace::Impl& own = *ownWorkspace.impl_;
  const size_t n = m.pair.impl_->compartments.size();
  estimate.compartments.assign(n, LoadError{});
  estimate.total = LoadError{};
  estimate.companionStatus = EvaluationStatus::ok;
  if (!own.hasStored) return;
  if (!m.other) m.build();
  estimate.companionElements = m.other->numElements();
  m.other->evaluate(own.storedQ, *m.workspace, {}, m.result);
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
    raw.difference = difference(own.stored.compartments[k], m.result.compartments[k]);
    raw.cells = LoadError{};
    raw.activeElements = own.stored.compartments[k].activeElements;
    raw.cells.peakPressure_Pa = calcFall(c, own.compartments[k], m.pressure[k]);
    if (m.companion == Companion::fine) {
      const Compartment& fine = m.other->impl_->compartments[k];
      std::vector<CellDifference>& cells = m.cells[k];
      std::fill(cells.begin(), cells.end(), CellDifference{});
      const auto add = [&](CellDifference& d, const Compartment& grid, const Active& a, double sign) {
        const auto i = static_cast<size_t>(a.element);
        d.force_N += sign * a.force_N;
        d.area_m2 += sign * a.share * grid.area_m2[i];
      };
      for (const Active& a : own.compartments[k].active) add(cells[static_cast<size_t>(a.element)], c, a, 1);
      for (const Active& a : m.workspace->impl_->compartments[k].active) {
        CellDifference& d = cells[static_cast<size_t>(m.parent[k][static_cast<size_t>(a.element)])];
        add(d, fine, a, -1);
        // Arm of the cell's force: of its children in contact, any of them.
        d.moment_Nm = std::max(d.moment_Nm, fine.p_FA[static_cast<size_t>(a.element)].cross(a.direction_F).norm());
      }
      for (const Active& a : own.compartments[k].active) {
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
    }
    total.cells.force_N += raw.cells.force_N;
    total.cells.moment_Nm += raw.cells.moment_Nm;
    total.cells.area_m2 += raw.cells.area_m2;
    total.activeElements += raw.activeElements;
    if (own.stored.compartments[k].peakPressure_Pa >= own.stored.total.peakPressure_Pa) total.cells.peakPressure_Pa = raw.cells.peakPressure_Pa;
    raw.cells.force_N = std::sqrt(raw.cells.force_N);
    raw.cells.moment_Nm = std::sqrt(raw.cells.moment_Nm);
    raw.cells.area_m2 = std::sqrt(raw.cells.area_m2);
    estimate.compartments[k] = finish(raw, own.stored.compartments[k]);
  }
  total.cells.force_N = std::sqrt(total.cells.force_N);
  total.cells.moment_Nm = std::sqrt(total.cells.moment_Nm);
  total.cells.area_m2 = std::sqrt(total.cells.area_m2);
  total.difference = difference(own.stored.total, m.result.total);
  m.total = total;
  estimate.total = finish(total, own.stored.total);
}

}  // namespace genu::contact
