#include "genu/musculoskeletal/MuscleCurves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

namespace genu::musculoskeletal {
namespace {

using Curve = std::function<CurvePoint(double)>;
using Integral = std::function<double(double)>;

TEST(MuscleCurves, GoThroughTheirPoints) {
  const MuscleCurves c;
  EXPECT_NEAR(c.calcActive(1).value, 1, 2e-3);  // the three terms are a fit
  EXPECT_LT(c.calcActive(1.8).value, 0.05);
  EXPECT_NEAR(c.calcPassive(0.2).value, 0, 1e-15);
  EXPECT_NEAR(c.calcPassive(1.6).value, 1, 1e-15);
  EXPECT_NEAR(c.calcVelocity(0).value, 1, 1e-14);
  EXPECT_NEAR(c.calcVelocity(-1).value, 0, 1e-14);
  EXPECT_NEAR(c.calcTendon(1).value, 0, 1e-16);
  EXPECT_NEAR(c.calcTendon(1.049).value, 1, 1e-14);
  EXPECT_NEAR(c.calcTendon(1.001).slope / c.calcTendon(1).slope, 1.0372, 1e-4);  // exp(36.567 * 0.001), kT of the default
}

TEST(MuscleCurves, SlopesAndIntegralsBelongToTheCurves) {
  const MuscleCurves c;
  const auto check = [](const Curve& curve, const Integral& integral, double from, double to, double kink) {
    for (double x = from; x <= to; x += (to - from) / 40) {
      const double h = 1e-5;
      // Central differences: h^2 of the third derivative over the value's scale, and 1e-16/h.
      EXPECT_NEAR(curve(x).slope, (curve(x + h).value - curve(x - h).value) / (2 * h), kink) << x;
      if (integral) {
        EXPECT_NEAR(curve(x).value, (integral(x + h) - integral(x - h)) / (2 * h), kink) << x;
      }
    }
  };
  check([&](double x) { return c.calcActive(x); }, nullptr, 0.3, 1.8, 1e-6);
  check([&](double x) { return c.calcPassive(x); }, [&](double x) { return c.calcPassiveEnergy(x); }, 0.2, 1.8, 1e-7);
  check([&](double x) { return c.calcVelocity(x); }, nullptr, -1.2, 1.2, 1e-7);
  check([&](double x) { return c.calcTendon(x); }, [&](double x) { return c.calcTendonEnergy(x); }, 0.95, 1.06, 1e-5);
  EXPECT_EQ(c.calcTendonEnergy(1), 0);
  EXPECT_NEAR(c.calcPassiveEnergy(0.2), 0, 1e-18);
}

TEST(MuscleCurves, InversesInvert) {
  const MuscleCurves c;
  for (double f = -0.19; f < 4; f += 0.1) EXPECT_NEAR(c.calcTendon(c.calcTendonLength(f)).value, f, 1e-13);
  for (double f = 0.01; f < 1.8; f += 0.05) EXPECT_NEAR(c.calcVelocity(c.calcVelocityOfForce(f)).value, f, 1e-13);
}

TEST(MuscleCurves, AreMonotoneWhereSolversRelyOnIt) {
  const MuscleCurves c;
  for (double x = kShortestFibre; x <= kLongestFibre; x += 0.01) EXPECT_GT(c.calcPassive(x).slope, 0);
  for (double v = -1.5; v <= 1.5; v += 0.01) EXPECT_GT(c.calcVelocity(v).slope, 0);
  for (double x = 0.9; x <= 1.1; x += 0.001) EXPECT_GT(c.calcTendon(x).slope, 0);
}

TEST(MuscleCurves, RefuseWhatHasNoMeaning) {
  MuscleCurves c;
  c.validate();
  c.tendonStrain = 0;
  EXPECT_THROW(c.validate(), std::invalid_argument);
  c = {};
  c.passiveStrain = -0.1;
  EXPECT_THROW(c.validate(), std::invalid_argument);
  c = {};
  c.passiveShape = 0;
  EXPECT_THROW(c.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace genu::musculoskeletal
