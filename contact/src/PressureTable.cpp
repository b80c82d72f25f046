#include "detail/PressureTable.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>

#include "genu/contact/Types.h"

namespace genu::contact::detail {

namespace {

constexpr int kCoefficients = 8;

double calcPressure(const PressureLaw& law, double e) {
  return std::visit([&](const auto& l) { return l.template calcResponse<false>(e, 1.0).p_Pa; }, law);
}

std::uint64_t highBits(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits >> 48;
}

double fromHighBits(std::uint64_t high) {
  const std::uint64_t bits = high << 48;
  double x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

}  // namespace

PressureTable::PressureTable(const PressureLaw& law, double strainScale) : law_(law), scale_(strainScale), firstBits_(highBits(strainScale)) {
  scale_ = fromHighBits(firstBits_);  // the first piece starts at e = 0
  const std::uint64_t last = highBits(kLargestStrain + scale_);
  // Interpolation in Chebyshev points, in powers of t.
  Eigen::Matrix<double, kCoefficients, kCoefficients> vandermonde;
  std::array<double, kCoefficients> node{};
  for (int i = 0; i < kCoefficients; ++i) {
    node[static_cast<size_t>(i)] = std::cos(kPi * (i + 0.5) / kCoefficients);
    for (int k = 0; k < kCoefficients; ++k) vandermonde(i, k) = std::pow(node[static_cast<size_t>(i)], k);
  }
  const auto solver = vandermonde.fullPivLu();
  double energy = 0;  // at the start of the piece
  for (std::uint64_t b = firstBits_; b <= last; ++b) {
    const double from = fromHighBits(b), to = fromHighBits(b + 1);
    Piece piece{};
    piece.center = 0.5 * (from + to);
    const double half = 0.5 * (to - from);
    piece.invHalfWidth = 1 / half;
    Eigen::Matrix<double, kCoefficients, 1> value;
    for (int i = 0; i < kCoefficients; ++i) {
      value[i] = calcPressure(law, piece.center + half * node[static_cast<size_t>(i)] - scale_);
    }
    const Eigen::Matrix<double, kCoefficients, 1> c = solver.solve(value);
    std::copy(c.data(), c.data() + kCoefficients, piece.c);
    const auto integral = [&](double t) {
      double sum = 0;
      for (int k = kCoefficients - 1; k >= 0; --k) sum = sum * t + piece.c[k] / (k + 1);
      return sum * t * half;
    };
    piece.energy = energy - integral(-1);
    energy = piece.energy + integral(1);
    pieces_.push_back(piece);
    for (int i = 0; i <= 2 * kCoefficients; ++i) {
      const double t = -1 + i / static_cast<double>(kCoefficients), e = piece.center + half * t - scale_;
      if (!(e > 1e-9) || e >= kLargestStrain) continue;
      const double exact = calcPressure(law, e);
      double table = 0;
      for (int k = kCoefficients - 1; k >= 0; --k) table = table * t + piece.c[k];
      relativeError_ = std::max(relativeError_, std::abs(table / exact - 1));
    }
  }
}

void PressureTable::calcBeyond(double e, double& p, double& dpde, double& energy) const {
  const LayerResponse r = std::visit([&](const auto& l) { return l.template calcResponse<true>(e, 1.0); }, law_);
  p = r.p_Pa;
  dpde = r.dpdd_PaPerM;
  energy = r.energy_JPerM2;
}

}  // namespace genu::contact::detail
