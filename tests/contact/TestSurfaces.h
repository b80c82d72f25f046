#pragma once

// Free-form surfaces for tests: reproducible, no stored data.

#include <cmath>
#include <random>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact::test {

inline std::vector<double> clampedKnots(int num, int degree, double from = 0, double to = 1) {
  std::vector<double> knots(static_cast<size_t>(degree + 1), from);
  const int inner = num - degree - 1;
  for (int i = 1; i <= inner; ++i) knots.push_back(from + (to - from) * i / (inner + 1));
  knots.insert(knots.end(), static_cast<size_t>(degree + 1), to);
  return knots;
}

/** A wavy condyle-like sheet of 15 x 20 points: canal surface about z, radii like a femoral component, waves of `wave`. */
inline NurbsPatchData makeCondyle(bool rational = false, double wave = 0.0003, int numU = 15, int numV = 20, int degree = 3) {
  NurbsPatchData d;
  d.degreeU = d.degreeV = degree;
  d.numU = numU;
  d.numV = numV;
  d.knotsU = clampedKnots(numU, degree);
  d.knotsV = clampedKnots(numV, degree, -1, 1);
  for (int i = 0; i < numU; ++i) {
    for (int j = 0; j < numV; ++j) {
      const double phi = -1.0 + 3.0 * i / (numU - 1);    // sagittal angle [rad], 0 distal
      const double psi = -1.1 + 2.2 * j / (numV - 1);    // frontal angle
      const double rs = 0.034 - 0.006 * (phi > 0 ? phi : 0.3 * phi);
      const double rf = 0.022;
      const double rho = rs - rf + rf * std::cos(psi) + wave * std::sin(5 * phi) * std::cos(4 * psi);
      d.points.push_back(Vec3(rho * std::sin(phi), -rho * std::cos(phi), rf * std::sin(psi)));
      if (rational) d.weights.push_back(1 + 0.2 * std::sin(1.0 + i) * std::cos(2.0 * j));
    }
  }
  const NurbsPatch trial(d);
  d.flipNormal = trial.calcNormal(0.3, 0).y() > 0;  // outward is down at the distal point
  return d;
}

}  // namespace genu::contact::test
