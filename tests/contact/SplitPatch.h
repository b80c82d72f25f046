#pragma once

// Exact division of a patch into several, by knot insertion.

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact::test {

/** Knot insertion (Boehm) in u, one knot at a time, until `x` has multiplicity `degree`; homogeneous where there are weights. */
inline void insertKnotU(NurbsPatchData& d, double x) {
  const auto p = static_cast<size_t>(d.degreeU);
  while (std::count(d.knotsU.begin(), d.knotsU.end(), x) < d.degreeU) {
    const auto numV = static_cast<size_t>(d.numV);
    const size_t k = static_cast<size_t>(std::upper_bound(d.knotsU.begin(), d.knotsU.end(), x) - d.knotsU.begin()) - 1;
    std::vector<Vec3> points;
    std::vector<double> weights;
    for (size_t i = 0; i <= static_cast<size_t>(d.numU); ++i) {
      const double a = i + p <= k ? 1 : i > k ? 0 : (x - d.knotsU[i]) / (d.knotsU[i + p] - d.knotsU[i]);
      for (size_t j = 0; j < numV; ++j) {
        Vec3 point = Vec3::Zero();
        double weight = 0;
        const auto add = [&](double share, size_t from) {
          const double w = share * (d.isRational() ? d.weights[from] : 1);
          point += w * d.points[from];
          weight += w;
        };
        if (a > 0) add(a, i * numV + j);
        if (a < 1) add(1 - a, (i - 1) * numV + j);
        points.push_back(d.isRational() ? Vec3(point / weight) : point);
        if (d.isRational()) weights.push_back(weight);
      }
    }
    d.points = std::move(points);
    d.weights = std::move(weights);
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
    for (int j = 0; j < d.numV; ++j) {
      const auto to = static_cast<size_t>(j * d.numU + i), from = static_cast<size_t>(i * d.numV + j);
      s.points[to] = d.points[from];
      if (d.isRational()) s.weights[to] = d.weights[from];
    }
  }
  s.flipNormal = !d.flipNormal;
  return s;
}

/** Exact split into pieces along u. Cuts are beside the knots of the whole, or at one. */
inline std::vector<NurbsPatchData> splitU(NurbsPatchData d, int pieces) {
  const double lo = d.knotsU.front(), hi = d.knotsU.back();
  std::vector<NurbsPatchData> out;
  std::vector<double> cuts;
  for (int k = 0; k <= pieces; ++k) cuts.push_back(k == pieces ? hi : lo + (hi - lo) * (k + 0.013 * (k % 2)) / pieces);
  for (double& cut : cuts) {
    for (const double knot : d.knotsU) cut = std::abs(cut - knot) < 1e-9 * (hi - lo) ? knot : cut;
  }
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
    if (d.isRational()) part.weights.assign(d.weights.begin() + begin * d.numV, d.weights.begin() + (begin + part.numU) * d.numV);
    out.push_back(part);
  }
  return out;
}

/** The whole in pieces x pieces patches, neighbours with their directions exchanged. */
inline std::vector<NurbsPatch> splitBothWays(const NurbsPatchData& whole, int pieces) {
  std::vector<NurbsPatch> patches;
  for (const NurbsPatchData& strip : splitU(whole, pieces)) {
    for (const NurbsPatchData& part : splitU(swapped(strip), pieces)) patches.emplace_back(patches.size() % 2 == 1 ? part : swapped(part));
  }
  return patches;
}

}  // namespace genu::contact::test
