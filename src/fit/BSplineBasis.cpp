#include "BSplineBasis.h"

#include <algorithm>

namespace genu::fit {

CubicBasis::CubicBasis(double min, double max, int numFunctions) {
  const int spans = numFunctions - 3;
  knots_.assign(3, min);
  for (int i = 0; i <= spans; ++i) knots_.push_back(i == spans ? max : min + (max - min) * i / spans);
  knots_.insert(knots_.end(), 3, max);
}

int CubicBasis::findSpan(double t) const {
  const auto begin = knots_.begin() + 3, end = knots_.end() - 3;
  const auto it = std::upper_bound(begin, end, t);
  return std::clamp(static_cast<int>(it - begin) - 1, 0, numFunctions() - 4);
}

void CubicBasis::insertKnot(double t) { knots_.insert(std::upper_bound(knots_.begin(), knots_.end(), t), t); }

CubicBasis::Row CubicBasis::calc(double t) const {
  Row row;
  row.first = findSpan(t);
  // Cox-de Boor, degree by degree: B[d][r] is function first + 3 - d + r of degree d.
  double B[4][4] = {};
  const auto knot = [&](int i) { return knots_[static_cast<size_t>(i)]; };
  const int span = row.first + 3;
  B[0][0] = 1;
  for (int d = 1; d <= 3; ++d) {
    for (int r = 0; r <= d; ++r) {
      const int i = span - d + r;
      if (r > 0) B[d][r] += (t - knot(i)) / (knot(i + d) - knot(i)) * B[d - 1][r - 1];
      if (r < d) B[d][r] += (knot(i + d + 1) - t) / (knot(i + d + 1) - knot(i + 1)) * B[d - 1][r];
    }
  }
  for (int r = 0; r < 4; ++r) row.N[static_cast<size_t>(r)] = B[3][r];
  // Derivatives from those of lower degree (Piegl & Tiller eq. 2.7), twice for the second.
  double D[4] = {};  // first derivatives of the degree-2 functions
  for (int r = 0; r <= 2; ++r) {
    const int i = span - 2 + r;
    if (r > 0) D[r] += 2 / (knot(i + 2) - knot(i)) * B[1][r - 1];
    if (r < 2) D[r] -= 2 / (knot(i + 3) - knot(i + 1)) * B[1][r];
  }
  for (int r = 0; r <= 3; ++r) {
    const int i = span - 3 + r;
    const auto k = static_cast<size_t>(r);
    if (r > 0) {
      const double f = 3 / (knot(i + 3) - knot(i));
      row.dN[k] += f * B[2][r - 1];
      row.ddN[k] += f * D[r - 1];
    }
    if (r < 3) {
      const double f = 3 / (knot(i + 4) - knot(i + 1));
      row.dN[k] -= f * B[2][r];
      row.ddN[k] -= f * D[r];
    }
  }
  return row;
}

}  // namespace genu::fit
