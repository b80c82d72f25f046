#pragma once

// What an error estimator holds, for the adaptive grid too.

#include <optional>
#include <vector>

#include "ContactPairImpl.h"
#include "genu/contact/ErrorEstimate.h"

namespace genu::contact {

namespace detail {

/** Difference between a cell and its four children on the companion grid; absolute values. */
struct CellDifference {
  double force_N = 0, moment_Nm = 0, area_m2 = 0;
};

/** Numbers an estimate is made of, before the factors: tests/benchmarks/ErrorEstimateTable.cpp fits the factors to them. */
struct RawDifference {
  LoadError difference;  // |Q_h - Q_companion|
  LoadError cells;       // root of the sum of squares of the cells' differences; peak: fall to the neighbors. Fine companion only.
  double peakRise_Pa = 0;  // smooth rule: what the pressure rises beside the place of the peak
  LoadError edge;        // what the active cells at the end of the fixed surface carry; peak: fall to the neighbors if it is there
  int activeElements = 0;
  bool atEdge = false;       // contact reaches the end of a surface: the rule has lost an order there
};

/** The estimate of the header from its parts. */
LoadError calcEstimate(const RawDifference& raw, const NetLoad& load, bool smooth, Companion companion);

}  // namespace detail

struct ErrorEstimator::Impl {
  const ContactPair& pair;
  const Companion companion;
  std::optional<ContactPair> other;
  std::optional<ContactWorkspace> workspace;
  ContactResult result;
  // Of each compartment:
  std::vector<int> elements;
  std::vector<std::vector<GridCell>> cellOf;  // elements, then cells that are none but hold companion elements
  std::vector<std::vector<int>> parent;       // of each companion element: the cell it is a quarter of
  std::vector<std::vector<detail::CellDifference>> cells;  // of each cell; fine companion only
  std::vector<std::vector<int>> peakCells;    // cells at and around the largest pressure of either grid
  std::vector<detail::Active> active, otherActive;  // of one compartment
  std::vector<detail::RawDifference> raw;
  detail::RawDifference total;
  std::vector<std::vector<double>> pressure;  // at the elements' centres, zero between evaluations

  Impl(const ContactPair& p, Companion c) : pair(p), companion(c) {}
  /** The companion; `known` is that of the same pair on another refinement. */
  void build(const ContactPair* known = nullptr);
};

/** Reads the parts of the last estimate: of one compartment, or the total's (-1). For the program that fits the factors. */
struct ErrorEstimatorProbe {
  static const detail::RawDifference& raw(const ErrorEstimator& e, int compartment) {
    return compartment < 0 ? e.impl_->total : e.impl_->raw[static_cast<size_t>(compartment)];
  }
};

}  // namespace genu::contact
