#pragma once

// Exact division of a patch into several, by knot insertion.

#include <algorithm>
#include <utility>
#include <vector>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact::test {

/** Knot insertion (Boehm) in u, one knot at a time, until `x` has multiplicity `degree`. Polynomial patches. */
inline void insertKnotU(NurbsPatchData& d, double x) {
  const auto p = static_cast<size_t>(d.degreeU);
  while (std::count(d.knotsU.begin(), d.knotsU.end(), x) < d.degreeU) {
    const auto numV = static_cast<size_t>(d.numV);
    const size_t k = static_cast<size_t>(std::upper_bound(d.knotsU.begin(), d.knotsU.end(), x) - d.knotsU.begin()) - 1;
    std::vector<Vec3> points;
    for (size_t i = 0; i <= static_cast<size_t>(d.numU); ++i) {
      const double a = i + p <= k ? 1 : i > k ? 0 : (x - d.knotsU[i]) / (d.knotsU[i + p] - d.knotsU[i]);
      for (size_t j = 0; j < numV; ++j) {
        Vec3 point = Vec3::Zero();
        if (a > 0) point += a * d.points[i * numV + j];
        if (a < 1) point += (1 - a) * d.points[(i - 1) * numV + j];
        points.push_back(point);
      }
    }
    d.points = std::move(points);
    d.knotsU.insert(d.knotsU.begin() + static_cast<std::ptrdiff_t>(k) + 1, x);
    ++d.numU;
  }
}

/** Swaps u and v; the normal turns around and is flipped back. */
inline NurbsPatchData swapped(const NurbsPatchData& d) {
  NurbsPatchData s = d;
  std::swap(s.degreeU, s.degreeV);
  std::swap(s.numU, s.numV);
  std::swap(s.knotsU, s.knotsV);
  for (int i = 0; i < d.numU; ++i) {
    for (int j = 0; j < d.numV; ++j) s.points[static_cast<size_t>(j * d.numU + i)] = d.points[static_cast<size_t>(i * d.numV + j)];
  }
  s.flipNormal = !d.flipNormal;
  return s;
}

/** Exact split into pieces along u; the cuts are not the knots of the whole. */
inline std::vector<NurbsPatchData> splitU(NurbsPatchData d, int pieces) {
  const double lo = d.knotsU.front(), hi = d.knotsU.back();
  std::vector<NurbsPatchData> out;
  std::vector<double> cuts;
  for (int k = 0; k <= pieces; ++k) cuts.push_back(k == pieces ? hi : lo + (hi - lo) * (k + 0.013 * (k % 2)) / pieces);
  for (int k = 1; k < pieces; ++k) insertKnotU(d, cuts[static_cast<size_t>(k)]);
  for (size_t k = 0; k + 1 < cuts.size(); ++k) {
    NurbsPatchData part = d;
    const auto first = std::lower_bound(d.knotsU.begin(), d.knotsU.end(), cuts[k]);
    const auto last = std::upper_bound(d.knotsU.begin(), d.knotsU.end(), cuts[k + 1]);
    const auto begin = k == 0 ? 0 : first - d.knotsU.begin() - 1;
    std::vector<double> knots(first, last);
    if (k > 0) knots.insert(knots.begin(), cuts[k]);
    if (k + 2 < cuts.size()) knots.push_back(cuts[k + 1]);
    part.knotsU = knots;
    part.numU = static_cast<int>(knots.size()) - d.degreeU - 1;
    part.points.assign(d.points.begin() + begin * d.numV, d.points.begin() + (begin + part.numU) * d.numV);
    out.push_back(part);
  }
  return out;
}

}  // namespace genu::contact::test
