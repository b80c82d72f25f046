#pragma once

// Reading of PressureTable's pieces. Plain data and internal linkage, see CellRule.h.

namespace genu::contact::detail {

/** Pieces of a pressure law in strain, 32 an octave of x = strain + scale, found by the leading bits of x. */
struct LawTable {
  static constexpr int kStride = 8;  // center, energy at the center, coefficients 0 to 5 of x - center
  static constexpr int kShift = 47;  // keeps sign, exponent and 5 bits of the mantissa
  const double* pieces;
  unsigned long firstBits;
  double scale;
  double largestStrain;
};

namespace {

/** @pre 0 <= strain < largestStrain */
template <bool WithEnergy>
inline void readTable(const LawTable& table, double strain, double& p, double& dp, double& energy) {
  const double x = strain + table.scale;
  unsigned long bits;
  __builtin_memcpy(&bits, &x, sizeof bits);
  const double* c = table.pieces + ((bits >> LawTable::kShift) - table.firstBits) * LawTable::kStride;
  const double t = x - c[0];
  const double* a = c + 2;
  p = a[0] + t * (a[1] + t * (a[2] + t * (a[3] + t * (a[4] + t * a[5]))));
  dp = a[1] + t * (2 * a[2] + t * (3 * a[3] + t * (4 * a[4] + t * (5 * a[5]))));
  if (WithEnergy) {
    energy = c[1] + t * (a[0] + t * (a[1] * (1.0 / 2) + t * (a[2] * (1.0 / 3) + t * (a[3] * (1.0 / 4) +
                    t * (a[4] * (1.0 / 5) + t * (a[5] * (1.0 / 6)))))));
  }
}

}  // namespace
}  // namespace genu::contact::detail
