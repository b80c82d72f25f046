#include "genu/contact/PressureLaw.h"

#include <array>
#include <sstream>
#include <stdexcept>

namespace genu::contact {

namespace {

void require(bool ok, const char* name, double value, const char* allowed) {
  if (ok) return;
  std::ostringstream out;
  out.precision(10);
  out << "material: " << name << " = " << value << " is not allowed; allowed: " << allowed;
  throw std::invalid_argument(out.str());
}

/** Strain d/h that a pressure causes in one layer, and its derivative: the inverse of PressureLaw. */
struct InverseResponse {
  double e, dedp;
  bool extrapolated;
};

InverseResponse calcInverse(const Material& m, bool large, double p) {
  const double c = m.confinementFactor();
  double x, dxdp;
  if (m.law == MaterialLaw::linear) {
    dxdp = 1 / (c * m.E_Pa);
    x = p * dxdp;
  } else {
    const double factor = m.law == MaterialLaw::powerLaw ? m.n : 1.0;
    const double s = p / m.p0_Pa, a = m.eps0 / (2 * c);
    const double power = factor * std::pow(s, m.n - 1);
    x = a * (s + power * s);
    dxdp = a * (1 + m.n * power) / m.p0_Pa;
  }
  if (!large) return {x, dxdp, x > kExtrapolationStrain};
  static const double start = -std::log1p(-kExtrapolationStrain);
  if (x <= start) return {-std::expm1(-x), std::exp(-x) * dxdp, false};
  return {kExtrapolationStrain + (x - start) * (1 - kExtrapolationStrain), (1 - kExtrapolationStrain) * dxdp, true};
}

}  // namespace

void Material::validate() const {
  require(nu >= 0 && nu < 0.5, "nu", nu, "0 <= nu < 0.5 (0.5 is incompressible: the confined modulus is infinite)");
  if (law == MaterialLaw::linear) {
    require(E_Pa > 0 && std::isfinite(E_Pa), "E [Pa]", E_Pa, "> 0");
  } else {
    require(eps0 > 0 && std::isfinite(eps0), "eps0", eps0, "> 0");
    require(p0_Pa > 0 && std::isfinite(p0_Pa), "p0 [Pa]", p0_Pa, "> 0");
    require(n >= 1 && n <= 100, "n", n, "1 <= n <= 100");
  }
}

bool Material::operator==(const Material& o) const {
  return law == o.law && E_Pa == o.E_Pa && nu == o.nu && eps0 == o.eps0 && p0_Pa == o.p0_Pa && n == o.n;
}

LinearLayer::LinearLayer(const Material& material, StrainMeasure strain)
    : K_(material.confinementFactor() * material.E_Pa), large_(strain == StrainMeasure::large) {
  material.validate();
}

PowerLawLayer::PowerLawLayer(const Material& material, StrainMeasure strain)
    : c_(material.confinementFactor()),
      eps0_(material.eps0),
      p0_(material.p0_Pa),
      n_(material.n),
      m_(material.law == MaterialLaw::powerLaw ? material.n : 1.0),
      large_(strain == StrainMeasure::large) {
  material.validate();
}

double PowerLawLayer::calcEnergyPerLayer(double e, double x, double s) const {
  const double a = eps0_ / (2 * c_);  // x = a (s + m s^n)
  // Integral of p dx = p0 a int s (1 + m n s^(n-1)) ds.
  const auto integralOverX = [&](double sigma) {
    return p0_ * a * sigma * sigma * (0.5 + m_ * n_ / (n_ + 1) * std::pow(sigma, n_ - 1));
  };
  if (!large_) return integralOverX(s);
  const double ec = std::min(e, kExtrapolationStrain);
  const double xc = e > kExtrapolationStrain ? -std::log1p(-ec) : x;
  const double sc = e > kExtrapolationStrain ? solve(xc / a) : s;
  // int_0^s p0 sigma exp(-x) dx/dsigma dsigma (positive throughout, no cancellation), 10-point Gauss-Legendre on pieces that
  // shrink geometrically, so that x changes by a factor of at most 4 in each, until the power term is a trace.
  static const std::array<double, 5> node = {0.1488743389816312, 0.4333953941292472, 0.6794095682990244,
                                             0.8650633666889845, 0.9739065285171717};
  static const std::array<double, 5> weight = {0.2955242247147529, 0.2692667193099963, 0.2190863625159820,
                                               0.1494513491505806, 0.0666713443086881};
  const double ratio = std::pow(4.0, -1 / n_);
  double sum = 0, upper = sc;
  for (bool last = false; !last;) {
    last = m_ * n_ * std::pow(upper, n_ - 1) < 1e-4 || upper < 1e-6 * sc;
    const double lower = last ? 0 : upper * ratio;
    const double mid = 0.5 * (lower + upper), width = 0.5 * (upper - lower);
    for (size_t k = 0; k < node.size(); ++k) {
      for (const double sign : {-1.0, 1.0}) {
        const double sigma = mid + sign * width * node[k];
        const double power = m_ * std::pow(sigma, n_ - 1);
        sum += width * weight[k] * p0_ * sigma * std::exp(-a * (sigma + power * sigma)) * a * (1 + n_ * power);
      }
    }
    upper = lower;
  }
  if (e > kExtrapolationStrain) sum += (1 - kExtrapolationStrain) * (integralOverX(s) - integralOverX(sc));
  return sum;
}

PressureLaw makePressureLaw(const Material& material, StrainMeasure strain) {
  material.validate();
  if (material.law == MaterialLaw::linear) return LinearLayer(material, strain);
  return PowerLawLayer(material, strain);
}

SeriesLayers::SeriesLayers(const Material& fixedMaterial, const Material& movingMaterial, StrainMeasure strain)
    : materialF_(fixedMaterial),
      materialM_(movingMaterial),
      lawF_(makePressureLaw(fixedMaterial, strain)),
      lawM_(makePressureLaw(movingMaterial, strain)),
      strain_(strain) {}

template <bool WithEnergy>
SeriesResponse SeriesLayers::calcResponse(double d, double hF, double hM) const {
  SeriesResponse result;
  if (!(d > 0)) return result;
  const bool large = strain_ == StrainMeasure::large;
  const auto alone = [d](const PressureLaw& law, double h) {
    return std::visit([&](const auto& l) { return l.template calcResponse<WithEnergy>(d, h); }, law);
  };
  if (!(hM > 0) || !(hF > 0)) {
    static_cast<LayerResponse&>(result) = hM > 0 ? alone(lawM_, hM) : alone(lawF_, hF);
    result.dpdhF_PaPerM = -result.dpdd_PaPerM * calcInverse(materialF_, large, result.p_Pa).e;
    result.dpdhM_PaPerM = -result.dpdd_PaPerM * calcInverse(materialM_, large, result.p_Pa).e;
    return result;
  }
  // The root lies below the pressure that either layer alone would need; bisection guards Newton.
  const auto pressureAlone = [d](const PressureLaw& law, double h) {
    return std::visit([&](const auto& l) { return l.template calcResponse<false>(d, h).p_Pa; }, law);
  };
  double low = 0, high = std::min(pressureAlone(lawF_, hF), pressureAlone(lawM_, hM));
  double p = 0.5 * high;
  InverseResponse f{}, m{};
  for (int i = 0; i < 200; ++i) {
    f = calcInverse(materialF_, large, p);
    m = calcInverse(materialM_, large, p);
    const double g = hF * f.e + hM * m.e - d, slope = hF * f.dedp + hM * m.dedp;
    (g > 0 ? high : low) = p;
    double next = p - g / slope;
    // A step within rounding of g ends it, also where the bracket's own end is the root.
    const bool done = std::abs(next - p) <= 4e-16 * p;
    if (!(next > low && next < high) && !done) next = 0.5 * (low + high);
    if (done || next == p) break;
    p = next;
  }
  result.p_Pa = p;
  result.dpdd_PaPerM = 1 / (hF * f.dedp + hM * m.dedp);
  result.dpdhF_PaPerM = -f.e * result.dpdd_PaPerM;
  result.dpdhM_PaPerM = -m.e * result.dpdd_PaPerM;
  result.extrapolated = f.extrapolated || m.extrapolated;
  if (WithEnergy) {
    // The energy of the pair is the sum of both layers' energies at the common pressure.
    const auto energy = [&](const PressureLaw& law, double e, double h) {
      return std::visit([&](const auto& l) { return l.template calcResponse<true>(e * h, h).energy_JPerM2; }, law);
    };
    result.energy_JPerM2 = energy(lawF_, f.e, hF) + energy(lawM_, m.e, hM);
  }
  return result;
}

template SeriesResponse SeriesLayers::calcResponse<true>(double, double, double) const;
template SeriesResponse SeriesLayers::calcResponse<false>(double, double, double) const;

}  // namespace genu::contact
