#include "genu/musculoskeletal/MuscleCurves.h"

#include <cmath>

#include "Range.h"

namespace genu::musculoskeletal {

namespace {

constexpr double kB1[3] = {0.8150671134243542, 0.433004984392647, 0.1};
constexpr double kB2[3] = {1.055033428970575, 0.716775413397760, 1.0};
constexpr double kB3[3] = {0.162384573599574, -0.029947116970696, 0.353553390593274};
constexpr double kB4[3] = {0.063303448465465, 0.200356847296188, 0.0};
constexpr double kD[4] = {-0.3211346127989808, -8.149, -0.374, 0.8825327733249912};
constexpr double kC1 = 0.200, kC2 = 1.0, kC3 = 0.200;

double calcTendonStiffness(double strain) { return std::log((1 + kC3) / kC1) / (1 + strain - kC2); }

}  // namespace

void MuscleCurves::validate() const {
  require(passiveStrain > 0, "muscle: passive strain at the largest isometric force", passiveStrain, "", "> 0");
  require(passiveShape > 0, "muscle: shape of the passive curve", passiveShape, "", "> 0");
  require(tendonStrain > 0 && tendonStrain <= 0.5, "muscle: tendon strain at the largest isometric force", tendonStrain, "", "above 0 to 0.5");
}

CurvePoint MuscleCurves::calcActive(double length) const {
  CurvePoint f = {0, 0};
  for (int i = 0; i < 3; ++i) {
    const double width = kB3[i] + kB4[i] * length, x = (length - kB2[i]) / width;
    const double bell = kB1[i] * std::exp(-0.5 * x * x);
    f.value += bell;
    f.slope -= bell * x * (1 - x * kB4[i]) / width;
  }
  return f;
}

CurvePoint MuscleCurves::calcPassive(double length) const {
  const double q = std::exp(passiveShape * (kShortestFibre - 1) / passiveStrain), scale = 1 / (std::exp(passiveShape) - q);
  const double rise = std::exp(passiveShape * (length - 1) / passiveStrain) * scale;
  return {rise - q * scale, rise * passiveShape / passiveStrain};
}

CurvePoint MuscleCurves::calcVelocity(double velocity) const {
  const double x = kD[1] * velocity + kD[2];
  return {kD[0] * std::asinh(x) + kD[3], kD[0] * kD[1] / std::sqrt(x * x + 1)};
}

CurvePoint MuscleCurves::calcTendon(double length) const {
  const double k = calcTendonStiffness(tendonStrain), rise = kC1 * std::exp(k * (length - kC2));
  return {rise - kC3, rise * k};
}

double MuscleCurves::calcTendonLength(double force) const { return kC2 + std::log((force + kC3) / kC1) / calcTendonStiffness(tendonStrain); }

double MuscleCurves::calcVelocityOfForce(double force) const { return (std::sinh((force - kD[3]) / kD[0]) - kD[2]) / kD[1]; }

double MuscleCurves::calcTendonEnergy(double length) const {
  const double k = calcTendonStiffness(tendonStrain);
  return kC1 / k * std::expm1(k * (length - kC2)) - kC3 * (length - kC2);
}

double MuscleCurves::calcPassiveEnergy(double length) const {
  const double q = std::exp(passiveShape * (kShortestFibre - 1) / passiveStrain), scale = 1 / (std::exp(passiveShape) - q);
  const double rise = std::exp(passiveShape * (length - 1) / passiveStrain);
  return scale * ((rise - q) * passiveStrain / passiveShape - q * (length - kShortestFibre));
}

}  // namespace genu::musculoskeletal
