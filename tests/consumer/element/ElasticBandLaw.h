#pragma once

#include <algorithm>
#include <cmath>

namespace bands {

/** A band that stiffens as it is stretched:

   T = max(0, k L0 (exp(c e) - 1) / c + d dL/dt),   e = (L - L0) / L0;   T = 0 while e <= 0
   energy = (k L0^2 / c) ((exp(c e) - 1) / c - e)

 T tension [N], L length [m], L0 rest length [m], k stiffness where it becomes taut [N/m], c rise of the stiffness [-],
 d damping [N s/m]. Doubles are too small for exp(c e) beyond c e = 700. @pre k > 0, L0 > 0, c > 0, d >= 0 */
struct ElasticBandLaw {
  double stiffness_NPerM = 0;  ///< k
  double restLength_m = 0;     ///< L0
  double rise = 0;             ///< c
  double damping_NSPerM = 0;   ///< d
};

struct ElasticBandResponse {
  double tension_N = 0;
  double dTdL_NPerM = 0;  ///< at rest
  double energy_J = 0;
};

/** expm1(x) - x for x >= 0. Below 0.001, where the difference would lose digits, its series: both are right to 1e-12. */
inline double calcExpMinusLine(double x) {
  return x < 1e-3 ? x * x / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5))) : std::expm1(x) - x;
}

inline ElasticBandResponse calcResponse(const ElasticBandLaw& law, double length_m, double rate_mPerS = 0) {
  const double k = law.stiffness_NPerM, L0 = law.restLength_m, c = law.rise;
  const double x = c * (length_m - L0) / L0;
  ElasticBandResponse r;
  if (!(x > 0)) return r;
  r.tension_N = std::max(0.0, k * L0 / c * std::expm1(x) + law.damping_NSPerM * rate_mPerS);
  r.dTdL_NPerM = k * std::exp(x);
  r.energy_J = k * L0 * L0 / (c * c) * calcExpMinusLine(x);
  return r;
}

}  // namespace bands
