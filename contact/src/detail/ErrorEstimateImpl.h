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
  int activeElements = 0;
};

}  // namespace detail

struct ErrorEstimator::Impl {
  const ContactPair& pair;
  const Companion companion;
  std::optional<ContactPair> other;
  std::optional<ContactWorkspace> workspace;
  ContactResult result;
  // Of each compartment:
  std::vector<std::vector<int>> parent;  // of each companion element: the element it is a quarter of, or the number of elements
  std::vector<std::vector<detail::CellDifference>> cells;  // of each element, then of what has no parent
  std::vector<detail::RawDifference> raw;

  void build();
};

}  // namespace genu::contact
