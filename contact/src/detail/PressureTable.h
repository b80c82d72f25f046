#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "genu/contact/PressureLaw.h"

namespace genu::contact::detail {

/** A pressure law p(e), e = d/h, as polynomials of degree 7 on pieces that grow geometrically with e (16 per octave), built
 once: the same few nanoseconds for every law, root finding or not. The slope is the polynomial's derivative and the
 energy density (int p de) its integral, so the three agree to rounding.
 Range 0 <= e <= 0.9; larger strains use the law itself (its continuation starts at 0.95).
 relativeError() is measured at construction between the fitting points; the engine uses the table only below 1e-9. */
class PressureTable {
 public:
  PressureTable(const PressureLaw& law, double strainScale);

  double relativeError() const { return relativeError_; }
  static constexpr double kLargestStrain = 0.9;

  template <bool WithEnergy>
  void calcResponse(double e, double& p, double& dpde, double& energy) const {
    if (!(e < kLargestStrain)) {
      calcBeyond(e, p, dpde, energy);
      return;
    }
    const double x = e + scale_;
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    const auto index = static_cast<size_t>((bits >> 48) - firstBits_);  // sign, exponent and 4 bits of the mantissa
    const Piece& piece = pieces_[index];
    const double t = (x - piece.center) * piece.invHalfWidth;
    const double* c = piece.c;
    double value = c[7], slope = 7 * c[7];
    for (int k = 6; k >= 1; --k) {
      value = value * t + c[k];
      slope = slope * t + k * c[k];
    }
    p = value * t + c[0];
    dpde = slope * piece.invHalfWidth;
    if (WithEnergy) {
      double sum = c[7] / 8;
      for (int k = 6; k >= 0; --k) sum = sum * t + c[k] / (k + 1);
      energy = piece.energy + sum * t / piece.invHalfWidth;
    }
  }

 private:
  struct Piece {
    double center, invHalfWidth;
    double energy;  // at the center
    double c[8];
  };
  void calcBeyond(double e, double& p, double& dpde, double& energy) const;

  PressureLaw law_;
  double scale_;
  std::uint64_t firstBits_;
  double relativeError_ = 0;
  std::vector<Piece> pieces_;
};

}  // namespace genu::contact::detail
