#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "../../contact/src/detail/CellRule.h"
#include "../../contact/src/detail/PressureTable.h"
#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace detail;
using namespace test;

// ---- one cell ------------------------------------------------------------------------------------------------------

/** Moments of the region s > 0 by brute force: exact along lines in eta, midpoint sum of many lines in xi. */
void calcAreaByManyLines(const double S[kMonomials], double area[kMoments]) {
  std::fill(area, area + kMoments, 0.0);
  constexpr int kLines = 200000;
  for (int i = 0; i < kLines; ++i) {
    const double xi = (i + 0.5) / kLines - 0.5;
    const double a = S[0] + xi * (S[1] + S[3] * xi), b = S[2] + S[5] * xi, c = S[4];
    double at[4] = {-0.5, 0.5, 0.5, 0.5}, root[2];
    int m = 1;
    const int count = solveQuadratic(a, b, c, root);
    for (int k = 0; k < count; ++k) {
      if (std::abs(root[k]) < 0.5) at[m++] = root[k];
    }
    at[m] = 0.5;
    for (int k = 0; k < m; ++k) {
      const double middle = 0.5 * (at[k] + at[k + 1]);
      if (!(a + middle * (b + c * middle) > 0)) continue;
      for (int p = 0; p <= 4; ++p) {
        for (int q = 0; p + q <= 4; ++q) {
          area[momentIndex(p, q)] += std::pow(xi, p) * (std::pow(at[k + 1], q + 1) - std::pow(at[k], q + 1)) / (q + 1) / kLines;
        }
      }
    }
  }
}

TEST(CellRule, AreaMomentsOfRandomRegions) {
  // Rims of every kind: through one, two or four sides, closed inside the cell, hyperbolas. The reference's midpoint sum
  // errs where its integrand has corners (1e-5^2) or square roots (1e-5^1.5 = 3e-8).
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 60; ++i) {
    const double curvature = i % 3 == 0 ? 4.0 : i % 3 == 1 ? 0.5 : 0.02;
    const double S[kMonomials] = {0.4 * unit(random),          unit(random),          unit(random),
                                  curvature * unit(random), curvature * unit(random), curvature * unit(random)};
    double expected[kMoments], area[kMoments];
    calcAreaByManyLines(S, expected);
    calcRimArea(S, area);
    // Five Gauss points on an analytic piece converge with the distance to the turn of the rim: strongly curved cells (4: the gap
    // bends by itself within a cell) are far beyond any sensible grid, 0.02 is that of a knee at 30 x 30.
    const double tolerance = curvature > 1 ? 5e-4 : curvature > 0.1 ? 2e-5 : 1e-7;
    for (int k = 0; k < kMoments; ++k) {
      EXPECT_NEAR(area[k], expected[k], tolerance) << "case " << i << ", moment " << k;
    }
  }
}

TEST(CellRule, FullAndEmptyCells) {
  const double inside[kMonomials] = {1, 0.2, -0.3, 0.1, 0.1, 0.05};
  ASSERT_GT(lowerBound(inside), 0);
  double area[kMoments];
  calcRimArea(inside, area);  // must agree with the closed form that full cells use
  for (int k = 0; k < kMoments; ++k) EXPECT_NEAR(area[k], kFullArea[k], 1e-15);
  const double outside[kMonomials] = {-1, 0.2, -0.3, 0.1, 0.1, 0.05};
  ASSERT_LT(upperBound(outside), 0);
  calcRimArea(outside, area);
  for (int k = 0; k < kMoments; ++k) EXPECT_EQ(area[k], 0);
}

TEST(CellRule, BoundsHold) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 2000; ++i) {
    double S[kMonomials];
    for (double& c : S) c = unit(random);
    double xi = 0, eta = 0;
    const double peak = findMaximum(S, xi, eta);
    EXPECT_LE(peak, upperBound(S) + 1e-12);
    for (int k = 0; k < 50; ++k) {
      const double value = evaluateAt(S, 0.5 * unit(random), 0.5 * unit(random));
      EXPECT_LE(value, peak + 1e-12);
      EXPECT_GE(value, lowerBound(S) - 1e-12);
    }
  }
}

TEST(CellRule, NodesThatMoveByOneChangeTheCellByAtMostTheGain) {
  for (int mask = 0; mask < 32; ++mask) {
    const StencilWeights& w = stencilWeights(mask);
    double worst = 0;
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; j <= 20; ++j) {
        const double xi = i / 20.0 - 0.5, eta = j / 20.0 - 0.5;
        const double monomial[kMonomials] = {1, xi, eta, xi * xi, eta * eta, xi * eta};
        double sum = 0;
        for (int n = 0; n < kStencil; ++n) {
          double phi = 0;
          for (int m = 0; m < kMonomials; ++m) phi += w.T[m][n] * monomial[m];
          sum += std::abs(phi);
        }
        worst = std::max(worst, sum);
      }
    }
    EXPECT_LE(worst, largestGain(mask) + 1e-12) << "neighbors " << mask;
  }
}

TEST(PressureTable, IsTheLaw) {
  Material steep = uhmwpePowerLaw();
  steep.n = 7.3;
  for (const Material& material : {uhmwpe(), uhmwpePowerLaw(), uhmwpePowerLaw(MaterialLaw::powerLawConsistent), steep}) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const PressureLaw law = makePressureLaw(material, strain);
      const bool linear = material.law == MaterialLaw::linear;
      const PressureTable table(law, linear ? 0.05 : 0.01 * material.eps0 / (2 * material.confinementFactor()));
      EXPECT_LT(table.relativeError(), 1e-9);
      for (double e = 1e-6; e < 1.2; e *= 1.07) {
        double p = 0, dp = 0, energy = 0;
        table.calcResponse<true>(e, p, dp, energy);
        const LayerResponse r = std::visit([&](const auto& l) { return l.template calcResponse<true>(e, 1.0); }, law);
        EXPECT_NEAR(p / r.p_Pa, 1, 1e-9) << e;
        EXPECT_NEAR(dp / r.dpdd_PaPerM, 1, 1e-6) << e;  // one order less than the value: 16 pieces an octave
        EXPECT_NEAR(energy / r.energy_JPerM2, 1, 1e-8) << e;
      }
    }
  }
}

// ---- stiffness -----------------------------------------------------------------------------------------------------

struct StiffnessCase {
  const char* name;
  Material material;
  StrainMeasure strain;
  Thickness moving;
  std::optional<Material> movingMaterial;
  Correction correction;
  double tolerance;
};

class Stiffness : public testing::TestWithParam<StiffnessCase> {};

Thickness backOfCondyle() {
  Thickness t;
  std::vector<NurbsPatch> patches;
  auto data = makeCondyle(false, 0);
  for (Vec3& p : data.points) p *= 0.94 - 0.02 * p.z() / 0.02;  // thickness varies over the map
  patches.emplace_back(std::move(data));
  t.source = BackSurface{share(std::move(patches)), BackDirection::closest};
  return t;
}

TEST_P(Stiffness, IsTheDerivativeOfTheLoad) {
  const StiffnessCase& c = GetParam();
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), c.material,
                     0.012, 30);
  d.strain = c.strain;
  d.movingThickness = c.moving;
  d.movingMaterial = c.movingMaterial;
  d.correction = c.correction;
  d.copyTolerance = -1;
  const ContactPair pair(d);
  double low = 0.03, high = 0.06;
  while (high - low > 1e-9) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0.01, 0.02, 0.2, 0.0003, y, 0.0001}).total.scalarForce_N > 1000 ? low : high) = y;
  }
  const JointCoordinates q{0.01, 0.02, 0.2, 0.0003, high, 0.0001};
  ContactPair::Options options;
  options.withStiffness = true;
  const Matrix6 K = pair.evaluate(q, options).stiffness;
  for (size_t j = 0; j < 6; ++j) {
    // Five-point differences: step^4 of the fifth derivative, 1e-11 here, and rounding 1e-16 / step = 1e-10.
    const double step = j < 3 ? 2e-5 : 5e-7;
    const auto load = [&](double times) {
      JointCoordinates at = q;
      at[j] += times * step;
      const auto r = pair.evaluate(at, {});
      Eigen::Matrix<double, 6, 1> w;
      w << r.total.forceOnM_F, r.total.momentOnM_Fo_F;
      return w;
    };
    const Eigen::Matrix<double, 6, 1> expected = (load(-2) - 8 * load(-1) + 8 * load(1) - load(2)) / (12 * step);
    const auto column = K.col(static_cast<Eigen::Index>(j));
    EXPECT_LT((column - expected).head<3>().norm(), c.tolerance * expected.head<3>().norm()) << "coordinate " << j;
    EXPECT_LT((column - expected).tail<3>().norm(), c.tolerance * expected.tail<3>().norm()) << "coordinate " << j;
  }
}

// A law that bends within a cell makes the quadrature at the rim depend on where its points lie; the derivative is that of
// the integral, not of the points: 2e-5 at 30 x 30 for the power law, whose scale (strain 1e-3) is a tenth of a cell's range.
INSTANTIATE_TEST_SUITE_P(
    Laws, Stiffness,
    testing::Values(
        StiffnessCase{"linear", uhmwpe(), StrainMeasure::small, {}, {}, Correction::midsurface, 1e-7},
        StiffnessCase{"uncorrected", uhmwpe(), StrainMeasure::small, {}, {}, Correction::none, 1e-7},
        StiffnessCase{"log", uhmwpe(), StrainMeasure::large, {}, {}, Correction::midsurface, 1e-7},
        StiffnessCase{"two_layers", cartilage(), StrainMeasure::large, constantThickness(0.002), {}, Correction::midsurface, 1e-7},
        StiffnessCase{"series", uhmwpe(), StrainMeasure::small, constantThickness(0.002), cartilage(), Correction::midsurface, 1e-7},
        StiffnessCase{"power_law", uhmwpePowerLaw(), StrainMeasure::small, {}, {}, Correction::midsurface, 2e-5}),
    [](const auto& test_info) { return test_info.param.name; });

TEST(StiffnessWithThicknessMap, FollowsTheMapInsideItsCells) {
  // The map is bilinear: its slope jumps between its cells, so that the stiffness is right where no foot of weight sits on
  // such a line within the step, and nearly right elsewhere. 300 nodes cross lines of a 65 x 65 map in about 1 of 100 steps.
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), cartilage(),
                     0.012, 30);
  d.movingThickness = backOfCondyle();
  const ContactPair pair(d);
  double low = 0.03, high = 0.06;
  while (high - low > 1e-9) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0, 0, 0.2, 0, y, 0}).total.scalarForce_N > 100 ? low : high) = y;
  }
  const JointCoordinates q{0, 0, 0.2, 0, high, 0};
  ContactPair::Options options;
  options.withStiffness = true;
  const Matrix6 K = pair.evaluate(q, options).stiffness;
  for (size_t j = 0; j < 6; ++j) {
    const double step = j < 3 ? 1e-6 : 2e-8;
    JointCoordinates lo = q, hi = q;
    lo[j] -= step;
    hi[j] += step;
    const Vec3 expected = (pair.evaluate(hi, {}).total.forceOnM_F - pair.evaluate(lo, {}).total.forceOnM_F) / (2 * step);
    EXPECT_LT((K.col(static_cast<Eigen::Index>(j)).head<3>() - expected).norm(), 1e-4 * expected.norm()) << "coordinate " << j;
  }
}

TEST(SmoothRule, TheCentreRuleHasNoStiffness) {
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.05)), share(makeSphere(0.03)), constantThickness(0.006), uhmwpe(), 0.005, 8);
  d.rule = ContactRule::centre;
  const ContactPair pair(d);
  ContactPair::Options options;
  options.withStiffness = true;
  EXPECT_THROW(pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.0358, 0}, options), std::invalid_argument);
}

// ---- smoothness ----------------------------------------------------------------------------------------------------

TEST(SmoothRule, ASphereSlidesOverTheGridWithoutRipple) {
  // On a flat layer the force does not depend on where the sphere is: every difference is the grid's.
  const double R = 0.030, h = 0.006, D = 0.2e-3;
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.010, 30);
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  double sum = 0;
  constexpr int kSteps = 500;
  for (int i = 0; i < kSteps; ++i) {
    pair.evaluate(JointCoordinates{0, 0, 0, 2e-3 * i / kSteps, h + R - D, 3e-4}, workspace, {}, r);
    sum += std::pow(r.total.forceOnM_F.y() / 1338.989824 - 1, 2);
  }
  // Five cells per contact radius; the fourth power of that times the measured constant (0.01) is 2e-5, the goal.
  EXPECT_LT(std::sqrt(sum / kSteps), 2e-5);
}

TEST(SmoothRule, ContactSmallerThanACell) {
  // R = 30 mm, D = 1 um: contact radius 0.24 mm on cells of 1 mm. The gap is nearly a paraboloid, so that the polynomial of a
  // cell knows it: the area to (cell/R)^2/12 = 1e-4 of curvature, relative to D that is cell^4/(8 R^3 D) < 5e-3.
  const double R = 0.030, h = 0.006, D = 1e-6;
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.010, 20);
  const ContactPair pair(d);
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  const double F = kPi * K * D * D / h * (R - 2 * D / 3);
  for (const double x : {0.0, 0.2e-3, 0.5e-3, 0.37e-3}) {
    for (const double z : {0.0, 0.5e-3, 0.11e-3}) {
      const auto r = pair.evaluate(JointCoordinates{0, 0, 0, x, h + R - D, z});
      EXPECT_NEAR(r.total.forceOnM_F.y() / F, 1, 0.02) << x << ' ' << z;
      EXPECT_NEAR(r.total.peakPressure_Pa / (K * D / h), 1, 0.01);
      EXPECT_NEAR(r.total.area_m2 / (kPi * (2 * R * D - D * D)), 1, 0.01);
    }
  }
}

}  // namespace
}  // namespace genu::contact
