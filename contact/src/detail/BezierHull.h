#pragma once

#include "genu/contact/Types.h"

namespace genu::contact::detail {

/** Calls visit(P) for the Bezier control points of the sub-rectangle [s0, s1] x [t0, t1] (scaled span parameters) of a
 power-basis span; their hull contains the surface piece (weights > 0). */
template <class Visit>
void visitHull(const double* c, int pu, int pv, double s0, double s1, double t0, double t1, const Visit& visit) {
  using Homogeneous = Eigen::Vector4d;
  Homogeneous work[6][6];
  const auto at = [&](int a, int b) {
    const double* p = c + (a * (pv + 1) + b) * 4;
    return Homogeneous(p[0], p[1], p[2], p[3]);
  };
  // Polynomial in the local parameter of [lo, hi] mapped to [0, 1], then Bernstein coefficients.
  const auto toBernstein = [](Homogeneous* a, int n, double lo, double hi) {
    const double w = hi - lo;
    for (int i = 0; i < n; ++i) {  // Taylor shift to lo
      for (int j = n - 1; j >= i; --j) a[j] += lo * a[j + 1];
    }
    double f = 1;
    for (int i = 0; i <= n; ++i, f *= w) a[i] *= f;
    static const double binomial[6][6] = {{1},          {1, 1},         {1, 2, 1},
                                          {1, 3, 3, 1}, {1, 4, 6, 4, 1}, {1, 5, 10, 10, 5, 1}};
    Homogeneous out[6];
    for (int k = 0; k <= n; ++k) {
      out[k].setZero();
      for (int i = 0; i <= k; ++i) out[k] += binomial[k][i] / binomial[n][i] * a[i];
    }
    for (int k = 0; k <= n; ++k) a[k] = out[k];
  };
  for (int a = 0; a <= pu; ++a) {
    for (int b = 0; b <= pv; ++b) work[a][b] = at(a, b);
    toBernstein(work[a], pv, t0, t1);
  }
  for (int b = 0; b <= pv; ++b) {
    Homogeneous column[6];
    for (int a = 0; a <= pu; ++a) column[a] = work[a][b];
    toBernstein(column, pu, s0, s1);
    for (int a = 0; a <= pu; ++a) visit(Vec3(column[a].head<3>() / column[a][3]));
  }
}

}  // namespace genu::contact::detail
