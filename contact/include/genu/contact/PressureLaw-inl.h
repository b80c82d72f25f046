#pragma once

// Inline bodies of PressureLaw.h: they sit in the element loop.

#include <algorithm>
#include <cmath>

namespace genu::contact {

namespace detail {

/** Largest measure before the continuation, and the strain measure x(e), e = d/h, continued along its tangent. */
struct Strain {
  double x, dxde;
  bool extrapolated;
};

inline Strain calcStrain(double e, bool large) {
  if (!large) return {e, 1.0, e > kExtrapolationStrain};
  if (e <= kExtrapolationStrain) return {-std::log1p(-e), 1.0 / (1.0 - e), false};
  constexpr double slope = 1.0 / (1.0 - kExtrapolationStrain);
  static const double start = -std::log1p(-kExtrapolationStrain);
  return {start + (e - kExtrapolationStrain) * slope, slope, true};
}

}  // namespace detail

template <bool WithEnergy>
inline LayerResponse LinearLayer::calcResponse(double d, double h) const {
  LayerResponse r;
  if (!(d > 0)) return r;
  const double e = d / h;
  const detail::Strain s = detail::calcStrain(e, large_);
  r.p_Pa = K_ * s.x;
  r.dpdd_PaPerM = K_ * s.dxde / h;
  r.extrapolated = s.extrapolated;
  if (WithEnergy) {
    if (!large_) {
      r.energy_JPerM2 = 0.5 * K_ * e * d;
    } else {
      // Integral of -K ln(1 - e) de = K [(1 - e) ln(1 - e) + e], then of the straight continuation.
      const double ec = std::min(e, kExtrapolationStrain), xc = -std::log1p(-ec);
      // (1 - e) ln(1 - e) + e loses digits for small e: e^2/2 + e^3/6 + e^4/12 + ...
      double w = ec < 1e-3 ? ec * ec * (0.5 + ec * (1.0 / 6 + ec * (1.0 / 12 + ec * (1.0 / 20 + ec / 30))))
                           : ec - (1 - ec) * xc;
      if (s.extrapolated) w += (1 - kExtrapolationStrain) * 0.5 * (s.x * s.x - xc * xc);
      r.energy_JPerM2 = K_ * h * w;
    }
  }
  return r;
}

inline double PowerLawLayer::solve(double y) const {
  if (!(y > 0)) return 0;
  if (n_ == 1) return y / (1 + m_);
  if (n_ == 3) {
    // m s^3 + s = y: s = 2/sqrt(3m) sinh(asinh(y 3 sqrt(3m) / 2) / 3), then one Newton step against rounding.
    const double k = std::sqrt(3 * m_);
    const double s = 2 / k * std::sinh(std::asinh(1.5 * k * y) / 3);
    return s - (s + m_ * s * s * s - y) / (1 + 3 * m_ * s * s);
  }
  // g(s) = s + m s^n - y is convex and increasing: Newton from above decreases monotonically to the root.
  double s = std::min(y, std::pow(y / m_, 1 / n_));
  for (int i = 0; i < 60; ++i) {
    const double t = m_ * std::pow(s, n_ - 1);
    const double step = (s + t * s - y) / (1 + n_ * t);
    s -= step;
    if (std::abs(step) <= 4e-16 * s) break;
  }
  return s;
}

template <bool WithEnergy>
inline LayerResponse PowerLawLayer::calcResponse(double d, double h) const {
  LayerResponse r;
  if (!(d > 0)) return r;
  const double e = d / h;
  const detail::Strain strain = detail::calcStrain(e, large_);
  const double toY = 2 * c_ / eps0_;  // s + m s^n = toY x
  const double s = solve(toY * strain.x);
  const double t = n_ == 1 ? m_ : m_ * std::pow(s, n_ - 1);
  r.p_Pa = p0_ * s;
  r.dpdd_PaPerM = p0_ * toY * strain.dxde / (h * (1 + n_ * t));
  r.extrapolated = strain.extrapolated;
  if (WithEnergy) r.energy_JPerM2 = h * calcEnergyPerLayer(e, strain.x, s);
  return r;
}

}  // namespace genu::contact
