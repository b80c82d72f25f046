// Closed-form cases of the element computation: sphere, paraboloid and cylinder on a layer. The formulas are derived in
// docs/theory.md ("Closed forms"); numbers beside them were computed independently from the same formulas.
//
// Tolerances. The smooth rule integrates over the overlap with the gap's own curvature: force, area and peak err like the
// fourth power of the cell (OrderOfConvergenceInTheGrid). With 10 cells per contact radius that is below 1e-6; R4 also
// carries 5e-6 of the formulas' own small-slope error. 1e-4 is what the cases promise.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "contact/Scenes.h"

namespace genu::contact {
namespace {

using namespace test;

constexpr double kForceTolerance = 1e-4;  // relative
constexpr double kAreaTolerance = 1e-4;

constexpr double R = 0.030, h = 0.006, D = 0.2e-3;  // R1-R3
constexpr double a = R - D;

const Mat3 kSomeRotation = (Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized())).toRotationMatrix();

struct Expected {
  Vec3 force, moment;
  double scalar, peak, mean, area;
};

void expectClose(const ContactResult& r, const Expected& e, double forceTolerance = kForceTolerance,
                 double areaTolerance = kAreaTolerance) {
  ASSERT_EQ(r.status, EvaluationStatus::ok);
  const double F = e.force.norm();
  EXPECT_LT((r.total.forceOnM_F - e.force).norm() / F, forceTolerance) << r.total.forceOnM_F.transpose();
  const double T = std::max(e.moment.norm(), F * 1e-3);  // a zero moment: 1e-4 of the force at 1 mm
  EXPECT_LT((r.total.momentOnM_Fo_F - e.moment).norm() / T, forceTolerance) << r.total.momentOnM_Fo_F.transpose();
  if (e.scalar > 0) {
    EXPECT_NEAR(r.total.scalarForce_N / e.scalar, 1, forceTolerance);
  }
  EXPECT_NEAR(r.total.peakPressure_Pa / e.peak, 1, forceTolerance);
  if (e.mean > 0) {
    EXPECT_NEAR(r.total.meanPressure_Pa / e.mean, 1, areaTolerance);
  }
  EXPECT_NEAR(r.total.area_m2 / e.area, 1, areaTolerance);
}

/** Adaptive-free quadrature of a smooth function: Gauss-Legendre with 5 points on 2000 pieces. */
double integrate(const std::function<double(double)>& f, double from, double to) {
  static const double x[] = {0, 0.5384693101056831, -0.5384693101056831, 0.9061798459386640, -0.9061798459386640};
  static const double w[] = {0.5688888888888889, 0.4786286704993665, 0.4786286704993665, 0.2369268850561891, 0.2369268850561891};
  double sum = 0;
  const int pieces = 2000;
  const double half = 0.5 * (to - from) / pieces;
  for (int i = 0; i < pieces; ++i) {
    for (int k = 0; k < 5; ++k) sum += w[k] * half * f(from + half * (2 * i + 1 + x[k]));
  }
  return sum;
}

ContactPair makeSphereOnLayer(const Material& material, StrainMeasure strain, int n, double cx = 0, double cz = 0,
                              ContactRule rule = ContactRule::smooth) {
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), material, 0.005, n,
                     cx, cz);
  d.rule = rule;
  d.strain = strain;
  return ContactPair(std::move(d));
}

JointCoordinates at(const Vec3& p, const Mat3& rotation = Mat3::Identity()) { return calcCoordinates(Pose{rotation, p}); }

// 40 cells on 10 mm: N = 14 per contact radius; an even grid, so that the peak lies between the element centres.
constexpr int kFine = 40;

TEST(ReferenceCases, R1SphereOnLinearLayer) {
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  EXPECT_NEAR(K, 2140.582192e6, 1);
  const double Fy = kPi * K * D * D / h * (R - 2 * D / 3);
  EXPECT_NEAR(Fy, 1338.989824, 1e-6);
  const ContactPair pair = makeSphereOnLayer(uhmwpe(), StrainMeasure::small, kFine);
  const Expected e{{0, Fy, 0}, {0, 0, 0}, 1339.737967, 71.352740e6, 35.656508e6, 37.573448e-6};
  expectClose(pair.evaluate(at({0, h + R - D, 0})), e);
  expectClose(pair.evaluate(at({0, h + R - D, 0}, kSomeRotation)), e);
}

TEST(ReferenceCases, R2SphereOnLogarithmicLayer) {
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  // Fy = 2 pi int p(d) cos(theta/2) r dr, r dr = rho drho
  const double Fy = 2 * kPi * integrate(
                                  [&](double rho) {
                                    const double half = std::cos(0.5 * std::acos(std::min(1.0, a / rho)));
                                    return -K * std::log(1 - (R - rho) / half / h) * half * rho;
                                  },
                                  a, R);
  EXPECT_NEAR(Fy, 1354.118397, 1e-4);
  const ContactPair pair = makeSphereOnLayer(uhmwpe(), StrainMeasure::large, kFine);
  expectClose(pair.evaluate(at({0, h + R - D, 0}, kSomeRotation)),
              {{0, 1354.118397, 0}, {0, 0, 0}, 1354.872860, 72.569058e6, 36.059317e6, 37.573448e-6});
}

TEST(ReferenceCases, R3SphereOnPowerLawLayer) {
  const ContactPair pair = makeSphereOnLayer(uhmwpePowerLaw(), StrainMeasure::small, kFine);
  expectClose(pair.evaluate(at({0, h + R - D, 0}, kSomeRotation)),
              {{0, 531.924701, 0}, {0, 0, 0}, 532.285405, 20.347493e6, 14.166531e6, 37.573448e-6});
}

TEST(ReferenceCases, R1OneElement) {
  // One cell whose center is at r = 2 mm: everything about it in closed form.
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 1e-5, 1,
                     0.002 * std::cos(0.3), 0.002 * std::sin(0.3));
  const ContactPair pair(std::move(d));
  ContactWorkspace workspace(pair);
  ContactResult r;
  pair.evaluate(at({0, h + R - D, 0}, kSomeRotation), workspace, {}, r);
  const auto fields = pair.calcFields(workspace);
  ASSERT_EQ(fields[0].size(), 1u);
  const ElementField& f = fields[0][0];
  // Ten digits are given; the query's own error (1e-13 m across, its square over the radius along) is far below.
  EXPECT_NEAR(f.distance_m, -1.329613118e-4, 1e-13);
  EXPECT_NEAR(f.d_m, 1.330359850e-4, 1e-13);
  EXPECT_NEAR(f.p_Pa, 47462410.05, 0.05);
  const double theta = 2 * std::acos(f.forceDirection_F.y());
  EXPECT_NEAR(theta, 6.701359804e-2, 1e-10);
}

TEST(ReferenceCases, R1WholeCellGridsToTheirOwnError) {
  // The reference states the error of coarse whole-cell grids: 6e-4 at 30 x 30, 1.5e-4 at 50 x 50 over +-5 mm.
  const double Fy = 1338.989824;
  const auto error = [&](int n) {
    const ContactPair pair = makeSphereOnLayer(uhmwpe(), StrainMeasure::small, n, 0, 0, ContactRule::centre);
    return std::abs(pair.evaluate(at({0, h + R - D, 0})).total.forceOnM_F.y() / Fy - 1);
  };
  EXPECT_LT(error(30), 1.1 * 6e-4);
  EXPECT_LT(error(50), 1.1 * 1.5e-4);
}

/** Root mean square errors of force and area over 5 grid sizes and 16 shifts of the grid. */
std::pair<double, double> calcGridErrors(ContactRule rule, int factor) {
  const double Fy = 1338.989824, A = 37.573448e-6;
  double force = 0, area = 0;
  for (const int base : {17, 18, 19, 21, 22}) {
    const int n = base * factor;
    for (int k = 0; k < 16; ++k) {
      const double cell = 0.01 / n;
      const auto r = makeSphereOnLayer(uhmwpe(), StrainMeasure::small, n, cell * (k % 4) / 4.0, cell * (k / 4) / 4.0, rule)
                         .evaluate(at({0, h + R - D, 0}), {});
      force += std::pow(r.total.forceOnM_F.y() / Fy - 1, 2);
      area += std::pow(r.total.area_m2 / A - 1, 2);
    }
  }
  return {std::sqrt(force / 80), std::sqrt(area / 80)};
}

TEST(ReferenceCases, OrderOfConvergenceOfTheCentreRule) {
  // N^-2.5 for the force, N^-1.5 for the area: a cell that the rim cuts is counted whole or not at all, O(N) such cells of
  // weight N^-3 (area: N^-2) and random sign. Between N and 4N the scatter of 80 samples each leaves the order uncertain by
  // about sqrt(2/80)/ln 4 = 0.11; three times that is allowed.
  const auto coarse = calcGridErrors(ContactRule::centre, 1), fine = calcGridErrors(ContactRule::centre, 4);
  EXPECT_NEAR(std::log(coarse.first / fine.first) / std::log(4.0), 2.5, 0.33);
  EXPECT_NEAR(std::log(coarse.second / fine.second) / std::log(4.0), 1.5, 0.33);
}

TEST(ReferenceCases, OrderOfConvergenceOfTheSmoothRule) {
  // The cell's polynomial misses third differences of the gap, N^-3 each; the odd ones cancel over full cells, what is left
  // is N^-4. The same scatter as above.
  const auto coarse = calcGridErrors(ContactRule::smooth, 1), fine = calcGridErrors(ContactRule::smooth, 3);
  const double forceOrder = std::log(coarse.first / fine.first) / std::log(3.0);
  const double areaOrder = std::log(coarse.second / fine.second) / std::log(3.0);
  RecordProperty("force_order", std::to_string(forceOrder));
  RecordProperty("area_order", std::to_string(areaOrder));
  EXPECT_GT(forceOrder, 3.6);
  EXPECT_GT(areaOrder, 3.6);
  // Section 3's bounds at about 30 x 30 with a wide margin.
  EXPECT_LT(fine.first, 1e-6);
}

// R4: paraboloid of small slope; full geometry is smaller than the formula by 4e-6 to 5e-6.
struct ParaboloidCase {
  const char* name;
  Material material;
  StrainMeasure strain;
  double Fy, peak;
};

class Paraboloid : public testing::TestWithParam<ParaboloidCase> {};

TEST_P(Paraboloid, R4OnLayer) {
  const ParaboloidCase& c = GetParam();
  const double Rp = 2, hp = 0.003, Dp = 0.03e-3;
  auto d = makeScene(share(makePlane(hp, 0, 0, Solid::below, 0.1)), share(makeParaboloid(0, Rp, Rp, Solid::above, 0.1)),
                     constantThickness(hp), c.material, 0.012, kFine);
  d.strain = c.strain;
  const ContactPair pair(std::move(d));
  expectClose(pair.evaluate(at({0, hp - Dp, 0})), {{0, c.Fy, 0}, {0, 0, 0}, -1, c.peak, -1, 376.9911e-6});
}

INSTANTIATE_TEST_SUITE_P(Laws, Paraboloid,
                         testing::Values(ParaboloidCase{"linear", cartilage(), StrainMeasure::small, 28.599326, 0.151724138e6},
                                         ParaboloidCase{"log", cartilage(), StrainMeasure::large, 28.695137, 0.152487854e6},
                                         ParaboloidCase{"power", uhmwpePowerLaw(), StrainMeasure::small, 2965.7035, 12.241914e6}),
                         [](const auto& test_info) { return test_info.param.name; });

TEST(ReferenceCases, R4UnequalRadii) {
  // R = sqrt(Rx Rz)
  const double hp = 0.003, Dp = 0.03e-3, Rx = 1, Rz = 4;
  auto d = makeScene(share(makePlane(hp, 0, 0, Solid::below, 0.1)), share(makeParaboloid(0, Rx, Rz, Solid::above, 0.1)),
                     constantThickness(hp), cartilage(), 0.016, 401);
  const ContactPair pair(std::move(d));
  expectClose(pair.evaluate(at({0, hp - Dp, 0})), {{0, 28.599326, 0}, {0, 0, 0}, -1, 0.151724138e6, -1, 376.9911e-6});
}

TEST(ReferenceCases, R5OffsetSphereTorque) {
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.005,
                     kFine, 0.012, -0.018);
  const ContactPair pair(std::move(d));
  expectClose(pair.evaluate(at({0.012, h + R - D, -0.018}, kSomeRotation)),
              {{0, 1338.989824, 0}, {24.101817, 0, 16.067878}, 1339.737967, 71.352740e6, 35.656508e6, 37.573448e-6});
}

TEST(ReferenceCases, R6CylinderOnLayer) {
  const double Rc = 0.025, Dc = 0.3e-3, L = 0.020, ac = Rc - Dc;
  const double xc = std::sqrt(2 * Rc * Dc - Dc * Dc);
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  const double Fy = K * L / h * (Rc * xc - ac * ac * std::asinh(xc / ac));
  EXPECT_NEAR(Fy, 11007.391085, 1e-6);
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeCylinder(Rc, 0.03)), constantThickness(h), uhmwpe(),
                     0.010, 20);
  // The strip's rim is a straight line along the grid: the rim cells do not average out as on a circle, the area errs by
  // up to one cell of 2 xc, hence 1e-3 needs > 2500 cells across; the pressure vanishes there, so the force converges fast.
  d.compartments[0].x0_m = -0.005;
  d.compartments[0].x1_m = 0.005;
  d.compartments[0].nx = 4001;
  const ContactPair pair(std::move(d));
  for (const double turn : {0.0, 0.5 * kPi, 1.3, kPi, -2.2}) {  // about its own axis, seams included
    expectClose(pair.evaluate({0, 0, turn, 0, h + ac, 0}), {{0, Fy, 0}, {0, 0, 0}, -1, 107.029110e6, -1, 154.453877e-6});
  }
}

TEST(ReferenceCases, R7InclinedLayer) {
  auto d = makeScene(share(makePlane(h, std::tan(kPi / 6), 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(),
                     0.005, 401, 0, 0);
  // Contact center: the sphere's center projected on the layer; the height of the plane there gives x = 0.
  const ContactPair pair(std::move(d));
  expectClose(pair.evaluate(at({-0.0149, 0.031807557, 0}, kSomeRotation)),
              {{-669.494912, 1159.599203, 0}, {0, 0, 4.016969}, -1, 71.352740e6, -1, 37.573448e-6});
}

}  // namespace
}  // namespace genu::contact
