#include "detail/PressureTable.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "genu/contact/Types.h"

namespace genu::contact::detail {

namespace {

constexpr int kCoefficients = 6;

double calcPressure(const PressureLaw& law, double e) {
  return std::visit([&](const auto& l) { return l.template calcResponse<false>(e, 1.0).p_Pa; }, law);
}

std::uint64_t highBits(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits >> LawTable::kShift;
}

double fromHighBits(std::uint64_t high) {
  const std::uint64_t bits = high << LawTable::kShift;
  double x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

}  // namespace

PressureTable::PressureTable(const PressureLaw& law, double strainScale) : law_(law) {
  const std::uint64_t first = highBits(strainScale);
  const double scale = fromHighBits(first);  // the first piece starts at e = 0
  const std::uint64_t last = highBits(kLargestStrain + scale);
  // Interpolation in Chebyshev points, in powers of t.
  Eigen::Matrix<double, kCoefficients, kCoefficients> vandermonde;
  std::array<double, kCoefficients> node{};
  for (int i = 0; i < kCoefficients; ++i) {
    node[static_cast<size_t>(i)] = std::cos(kPi * (i + 0.5) / kCoefficients);
    for (int k = 0; k < kCoefficients; ++k) vandermonde(i, k) = std::pow(node[static_cast<size_t>(i)], k);
  }
  const auto solver = vandermonde.fullPivLu();
  double energy = 0;  // at the start of the piece
  for (std::uint64_t b = first; b <= last; ++b) {
    const double from = fromHighBits(b), to = fromHighBits(b + 1);
    const double center = 0.5 * (from + to), half = 0.5 * (to - from);
    Eigen::Matrix<double, kCoefficients, 1> value;
    for (int i = 0; i < kCoefficients; ++i) {
      value[i] = calcPressure(law, center + half * node[static_cast<size_t>(i)] - scale);
    }
    const Eigen::Matrix<double, kCoefficients, 1> c = solver.solve(value);
    const auto integral = [&](double t) {
      double sum = 0;
      for (int k = kCoefficients - 1; k >= 0; --k) sum = sum * t + c[k] / (k + 1);
      return sum * t * half;
    };
    const double energyAtCenter = energy - integral(-1);
    energy = energyAtCenter + integral(1);
    pieces_.insert(pieces_.end(), {center, energyAtCenter});
    for (int k = 0; k < kCoefficients; ++k) pieces_.push_back(c[k] / std::pow(half, k));
    pieces_.resize(pieces_.size() + LawTable::kStride - 2 - kCoefficients);
    for (int i = 0; i <= 2 * kCoefficients; ++i) {
      const double t = -1 + i / static_cast<double>(kCoefficients), e = center + half * t - scale;
      if (!(e > 1e-9) || e >= kLargestStrain) continue;
      const double exact = calcPressure(law, e);
      double table = 0;
      for (int k = kCoefficients - 1; k >= 0; --k) table = table * t + c[k];
      relativeError_ = std::max(relativeError_, std::abs(table / exact - 1));
    }
  }
  view_ = {pieces_.data(), first, scale, kLargestStrain};
}

void PressureTable::calcBeyond(double e, double& p, double& dpde, double& energy) const {
  const LayerResponse r = std::visit([&](const auto& l) { return l.template calcResponse<true>(e, 1.0); }, law_);
  p = r.p_Pa;
  dpde = r.dpdd_PaPerM;
  energy = r.energy_JPerM2;
}

LawShape calcLawShape(const Material& material, StrainMeasure strain) {
  constexpr double kNowhere = 1e300;
  LawShape shape = {kNowhere, strain == StrainMeasure::large ? 1.0 : kNowhere, gradedRules()};
  if (material.law == MaterialLaw::linear || material.n == 1) return shape;
  // s + m s^n = y has a singularity where dy/ds = 1 + m n s^(n-1) vanishes: |s|^(n-1) = 1/(m n), there |y| = |s| (1 - 1/n).
  const double n = material.n, m = material.law == MaterialLaw::powerLaw ? n : 1;
  const double s = std::pow(m * n, -1 / (n - 1));
  shape.atZero = s * (1 - 1 / n) * material.eps0 / (2 * material.confinementFactor());
  return shape;
}

}  // namespace genu::contact::detail
