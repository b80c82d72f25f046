// Sphere on a layer by ray firing, in closed form (docs/theory.md, "Closed forms"): C is above or below A on the vertical,
// with w = sqrt(R^2 - r^2), a = R - D:  AC = w - a,  cos(theta) = w / R,  d = AC cos(theta) / cos(theta/2).
//
// Tolerance 1e-4 in every quantity. Whole cells err like N^-2.5 in the force and N^-1.5 in the area, N cells per contact
// radius, with factors below 1 and 0.55; N = 396 makes that 3e-7 and 7e-5.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "contact/Scenes.h"

namespace genu::contact {
namespace {

using namespace test;

constexpr double kTolerance = 1e-4;
constexpr double R = 0.030, h = 0.006, D = 0.2e-3, a = R - D;

const Mat3 kSomeRotation = (Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized())).toRotationMatrix();

ContactPairDefinition makeSphereByRay(const Material& material, StrainMeasure strain, double half, int n, double cx = 0,
                                      double cz = 0) {
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), material, half, n,
                     cx, cz);
  d.rule = ContactRule::centre;
  d.distance = DistanceMethod::ray;
  d.strain = strain;
  return d;
}

ContactResult press(const ContactPair& pair) {
  return pair.evaluate(calcCoordinates(Pose{kSomeRotation, Vec3(0, h + R - D, 0)}));
}

/** Closed forms for a law p(d): integrals over r by the midpoint rule in w, where all is smooth: r dr = -w dw. */
struct Expected {
  double force = 0, scalar = 0, peak = 0, mean = 0;
};
Expected integrate(const std::function<double(double)>& pressure) {
  Expected e;
  constexpr int kPieces = 200000;
  for (int i = 0; i < kPieces; ++i) {
    const double dw = (R - a) / kPieces, w = a + (i + 0.5) * dw, half = std::cos(0.5 * std::acos(w / R));
    const double pdA = pressure((w - a) * w / R / half) * 2 * kPi * w * dw;
    e.scalar += pdA;
    e.force += pdA * half;
  }
  e.peak = pressure(D);
  e.mean = e.scalar / (kPi * (2 * R * D - D * D));
  return e;
}

struct Case {
  const char* name;
  Material material;
  StrainMeasure strain;
  double force, peak;
};

class SphereByRay : public testing::TestWithParam<Case> {};

TEST_P(SphereByRay, EveryQuantity) {
  const Case& c = GetParam();
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  const Expected e = integrate([&](double d) {
    if (c.material.law == MaterialLaw::linear) return c.strain == StrainMeasure::small ? K * d / h : -K * std::log(1 - d / h);
    // (e0/2)(s + 3 s^3) = c d/h: s = (2/3) sinh(asinh(9 y / 2) / 3), y = 2 c d / (h e0)
    const double y = 2 * c.material.confinementFactor() * d / h / c.material.eps0;
    return c.material.p0_Pa * 2 / 3 * std::sinh(std::asinh(4.5 * y) / 3);
  });
  EXPECT_NEAR(e.force, c.force, 1e-5);  // computed independently; the midpoint rule errs by 1e-11 of it
  EXPECT_NEAR(e.peak / c.peak, 1, 1e-7);
  for (const ContactRule rule : {ContactRule::centre, ContactRule::smooth}) {
    // The smooth rule errs like the fourth power of the cell size: 1e-6 with 28 cells across the contact.
    auto d = makeSphereByRay(c.material, c.strain, 0.0035, rule == ContactRule::centre ? 801 : 40);
    d.rule = rule;
    const ContactResult r = press(ContactPair(d));
    ASSERT_EQ(r.status, EvaluationStatus::ok);
    EXPECT_LT((r.total.forceOnM_F - Vec3(0, c.force, 0)).norm() / c.force, kTolerance) << r.total.forceOnM_F.transpose();
    EXPECT_LT(r.total.momentOnM_Fo_F.norm(), kTolerance * c.force * 1e-3) << r.total.momentOnM_Fo_F.transpose();
    EXPECT_NEAR(r.total.scalarForce_N / e.scalar, 1, kTolerance);
    EXPECT_NEAR(r.total.peakPressure_Pa / c.peak, 1, kTolerance);
    EXPECT_NEAR(r.total.meanPressure_Pa / e.mean, 1, kTolerance);
    EXPECT_NEAR(r.total.area_m2 / 37.573448e-6, 1, kTolerance);
  }
}

std::string nameOf(const testing::TestParamInfo<Case>& c) { return c.param.name; }

INSTANTIATE_TEST_SUITE_P(R1R2R3, SphereByRay,
                         testing::Values(Case{"R1Linear", uhmwpe(), StrainMeasure::small, 1338.999787, 71.352740e6},
                                         Case{"R2Logarithmic", uhmwpe(), StrainMeasure::large, 1354.128512, 72.569058e6},
                                         Case{"R3PowerLaw", uhmwpePowerLaw(), StrainMeasure::small, 531.927652, 20.347493e6}),
                         nameOf);

TEST(SphereByRayElement, R1OneElement) {
  // One cell whose centre is at r = 2 mm.
  auto d = makeSphereByRay(uhmwpe(), StrainMeasure::small, 1e-5, 1, 0.002 * std::cos(0.3), 0.002 * std::sin(0.3));
  for (const Correction correction : {Correction::midsurface, Correction::none}) {
    d.correction = correction;
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(Pose{kSomeRotation, Vec3(0, h + R - D, 0)}, workspace, {}, r);
    const ElementField f = pair.calcFields(workspace)[0][0];
    ASSERT_TRUE(f.active);
    EXPECT_NEAR(f.distance_m, -1.332590942e-4, 1e-13);  // digits of the reference
    if (correction == Correction::midsurface) {
      EXPECT_NEAR(f.d_m, 1.330366452e-4, 1e-13);
      EXPECT_NEAR(f.p_Pa, 47462645.61, 0.1);
      const double theta = 2 * std::acos(f.forceDirection_F.y());
      EXPECT_NEAR(theta, 6.671614841e-2, 1e-10);
      EXPECT_NEAR(-f.distance_m * std::cos(theta), 1.329626331e-4, 1e-13);  // AE
    } else {
      EXPECT_NEAR(f.d_m, 1.332590942e-4, 1e-13);
      EXPECT_LT((f.forceDirection_F - Vec3::UnitY()).norm(), 1e-12);
    }
  }
}

}  // namespace
}  // namespace genu::contact
