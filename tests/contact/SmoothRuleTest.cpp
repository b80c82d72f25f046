#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "../../contact/src/detail/CellRule.h"
#include "../../contact/src/detail/Kernels.h"
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
    double expected[kMoments], area[16];
    calcAreaByManyLines(S, expected);
    activeKernels().cells.calcRimArea(S, area);
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
  double area[16];
  activeKernels().cells.calcRimArea(inside, area);  // must agree with the closed form that full cells use
  for (int k = 0; k < kMoments; ++k) EXPECT_NEAR(area[k], kFullArea[k], 1e-15);
  const double outside[kMonomials] = {-1, 0.2, -0.3, 0.1, 0.1, 0.05};
  ASSERT_LT(upperBound(outside), 0);
  activeKernels().cells.calcRimArea(outside, area);
  for (int k = 0; k < kMoments; ++k) EXPECT_EQ(area[k], 0);
}

TEST(CellRule, PointRulesAreExactToTheirDegree) {
  const auto check = [](const PointRule& rule, int degree) {
    for (int a = 0; a <= degree; ++a) {
      for (int b = 0; a + b <= degree; ++b) {
        double sum = 0;
        for (int i = 0; i < rule.used; ++i) sum += rule.w[i] * std::pow(rule.xi[i], a) * std::pow(rule.eta[i], b);
        const auto moment = [](int k) { return k % 2 == 1 ? 0 : std::pow(0.5, k) / (k + 1); };
        EXPECT_NEAR(sum, moment(a) * moment(b), 1e-15) << a << " " << b;
      }
    }
  };
  check(kRadonRule, 5);
  check(kTensorRule, 7);
}

TEST(CellRule, LawsAreReadTheSameWhateverTheRounding) {
  // Caps of the region over one side of the cell: the strain vanishes at both ends of a piece, and where the points crowd must not
  // hang on the sign of 1e-17. The law bends at +-i a.
  const double a = 1e-3;
  const LawShape shape = {a, 1e300, gradedRules()};
  const double R[kSmooth] = {1, 0, 0, 0, 0};
  std::mt19937 random(8);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto integrate = [&](const double S[kMonomials]) {
    LawPoints points;
    activeKernels().cells.listLawPoints(S, R, false, shape, points);
    double sum = 0;
    for (int i = 0; i < points.count; ++i) sum += points.w[i] * std::asinh(larger(evaluateAt(S, points.xi[i], points.eta[i]), 0.0) / a);
    return sum;
  };
  /** Every second one turned, so that lines run the other way. */
  const auto checkRounded = [&](double S[kMonomials], int i) {
    if (i % 2 == 1) {
      std::swap(S[1], S[2]);
      std::swap(S[3], S[4]);
    }
    const double value = integrate(S);
    for (int k = 0; k < 20; ++k) {
      double T[kMonomials];
      for (int m = 0; m < kMonomials; ++m) T[m] = S[m] * (1 + 4e-16 * unit(random));
      EXPECT_NEAR(integrate(T), value, 1e-11 * value) << i;
    }
    return value;
  };
  for (int i = 0; i < 200; ++i) {
    // The rim leaves the side eta = 1/2 at xi = -w and w beside a shift.
    const double w = 0.1 + 0.3 * std::abs(unit(random)), at = 0.1 * unit(random), slope = 0.02, bend = 0.004 + 0.004 * std::abs(unit(random));
    double S[kMonomials] = {bend * (w * w - at * at) - 0.5 * slope, 2 * bend * at, slope, -bend, 0, 0};
    const double value = checkRounded(S, i);
    // Closed form along the steep direction, midpoint sum across it; depth: of the rim below the side.
    double sum = 0;
    constexpr int kLines = 20000;
    for (int k = 0; k < kLines; ++k) {
      const double xi = at + w * (2 * (k + 0.5) / kLines - 1), depth = bend * (w * w - (xi - at) * (xi - at)), t = depth / a;
      if (std::abs(xi) < 0.5) sum += t * std::asinh(t) - t * t / (1 + std::sqrt(1 + t * t));
    }
    EXPECT_NEAR(value, sum * 2 * w / kLines * a / slope, 2e-5 * value) << i;
  }
  // Ridges that end within the cell: beyond where the rim crosses the side, lines reach depth in their middle only.
  for (int i = 0; i < 200; ++i) {
    double S[kMonomials] = {6.8e-3, 26e-3, 15e-3, -69e-3, -5e-3, 1e-3};
    for (double& c : S) c *= 1 + 0.1 * unit(random);
    checkRounded(S, i);
  }
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
  int grid = 30;
  DistanceMethod distance = DistanceMethod::minimum;
  bool rational = false;  // the condyle
};

class Stiffness : public testing::TestWithParam<StiffnessCase> {};

/** A condyle in a dish. */
ContactPairDefinition makePressedDish(const StiffnessCase& c) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(c.rational, 0));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), c.material,
                     0.012, c.grid);
  d.strain = c.strain;
  d.movingThickness = c.moving;
  d.movingMaterial = c.movingMaterial;
  d.correction = c.correction;
  d.distance = c.distance;
  d.copyTolerance = -1;
  return d;
}

JointCoordinates findPoseOfLoad(const ContactPair& pair, double force_N) {
  double low = 0.03, high = 0.06;
  while (high - low > 1e-9) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0.01, 0.02, 0.2, 0.0003, y, 0.0001}, {}).total.scalarForce_N > force_N ? low : high) = y;
  }
  return {0.01, 0.02, 0.2, 0.0003, high, 0.0001};
}

Thickness abovePlane(double y_m) {
  Thickness t;
  t.source = HeightAbovePlane{y_m};
  return t;
}

Thickness backOfCondyle() {
  Thickness t;
  std::vector<NurbsPatch> patches;
  auto data = makeCondyle(false, 0);
  for (Vec3& p : data.points) p *= 0.94 - 0.02 * p.z() / 0.02;  // thickness varies over the map
  patches.emplace_back(std::move(data));
  t.source = BackSurface{share(std::move(patches)), BackDirection::closest};
  return t;
}

/** A map so coarse that the contact lies in one piece: the energy form's force jumps, by 1e-8 of itself, where a foot goes from one to the next. */
Thickness smoothMap() {
  Thickness t = backOfCondyle();
  t.mapSamplesU = t.mapSamplesV = 4;
  t.missing_m = 0.002;
  return t;
}

TEST_P(Stiffness, IsTheDerivativeOfTheLoad) {
  const StiffnessCase& c = GetParam();
  const ContactPair pair(makePressedDish(c));
  const JointCoordinates q = findPoseOfLoad(pair, 1000);
  ContactPair::Options options;
  options.withStiffness = true;
  const Matrix6 K = pair.evaluate(q, options).stiffness;
  double worst = 0;
  for (size_t j = 0; j < 6; ++j) {
    // Five-point differences: step^4 of the fifth derivative, 1e-11 here, and rounding: 1e-16 times the distance of the load over the
    // step, 3e-8 here.
    const double step = j < 3 ? 5e-6 : 1e-7;
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
    EXPECT_LT((column - expected).head<3>().norm(), 1e-7 * expected.head<3>().norm()) << "coordinate " << j;
    // A small moment may be the difference of large ones: forces times arms of 10 mm.
    const double moment = std::max(expected.tail<3>().norm(), 0.01 * expected.head<3>().norm());
    EXPECT_LT((column - expected).tail<3>().norm(), 1e-7 * moment) << "coordinate " << j;
    worst = std::max({worst, (column - expected).head<3>().norm() / expected.head<3>().norm(),
                      (column - expected).tail<3>().norm() / moment});
  }
  std::printf("worst relative difference %.1e\n", worst);
}

/** Generalized forces: rates of the coordinates times these make the power. */
Eigen::Matrix<double, 6, 1> calcGeneralizedForce(const JointCoordinates& q, const NetLoad& load) {
  Eigen::Matrix<double, 6, 1> force;
  for (size_t k = 0; k < 6; ++k) {
    JointCoordinates rate{};
    rate[k] = 1;
    force[static_cast<Eigen::Index>(k)] = ContactPair::calcPower(load, calcSpatialVelocity(q, rate), Vec3(q[3], q[4], q[5]));
  }
  return force;
}

class EnergyForm : public Stiffness {};

TEST_P(EnergyForm, ItsForceIsTheGradientAndItsStiffnessSymmetric) {
  const ContactPair pair(makePressedDish(GetParam()));
  const JointCoordinates q = findPoseOfLoad(pair, 1000);
  ContactPair::Options options;
  options.withEnergy = options.withStiffness = true;
  const ContactResult r = pair.evaluate(q, options);
  const Eigen::Matrix<double, 6, 1> force = calcGeneralizedForce(q, r.total);
  Matrix6 hessian;  // of the energy, up to its sign: derivative of the generalized force along q
  for (size_t j = 0; j < 6; ++j) {
    const double step = j < 3 ? 5e-6 : 1e-7;
    const auto at = [&](double times) {
      JointCoordinates moved = q;
      moved[j] += times * step;
      return moved;
    };
    const auto energy = [&](double times) { return pair.evaluate(at(times), options).total.energy_J; };
    const double slope = (energy(-2) - 8 * energy(-1) + 8 * energy(1) - energy(2)) / (12 * step);
    // Rounding of the energy over the step, 1e-16 / 1e-3, against the largest force: 1e-9 of it suffices for all coordinates.
    const double scale = j < 3 ? force.head<3>().norm() : force.tail<3>().norm();
    EXPECT_NEAR(force[static_cast<Eigen::Index>(j)], -slope, 1e-7 * scale) << "coordinate " << j;
    // d(J^T w) = J^T K + dJ^T w, the second by differences of J alone.
    const NetLoad& load = r.total;
    const Eigen::Matrix<double, 6, 1> turn =
        (calcGeneralizedForce(at(-2), load) - 8 * calcGeneralizedForce(at(-1), load) + 8 * calcGeneralizedForce(at(1), load) -
         calcGeneralizedForce(at(2), load)) / (12 * step);
    NetLoad change;
    change.forceOnM_F = r.stiffness.col(static_cast<Eigen::Index>(j)).head<3>();
    change.momentOnM_Fo_F = r.stiffness.col(static_cast<Eigen::Index>(j)).tail<3>();
    hessian.col(static_cast<Eigen::Index>(j)) = calcGeneralizedForce(q, change) + turn;
  }
  // Differences of J leave 1e-9 of its entries; the stiffness itself is exact.
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      EXPECT_NEAR(hessian(i, j), hessian(j, i), 1e-7 * std::sqrt(std::abs(hessian(i, i) * hessian(j, j)))) << i << ", " << j;
    }
  }
}

TEST(EnergyFormOfASphere, DiffersFromThePapersByTheSquareOfTheAngle) {
  // Sphere on a flat layer: theta grows with sqrt(d), so that the difference of the resultants grows like the depth. At R = 30 mm and
  // D = 0.2 mm theta is at most 0.115 (6.6 deg) at the rim.
  std::vector<double> difference;
  for (const double depth : {0.05e-3, 0.1e-3, 0.2e-3}) {
    auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.01)), share(makeSphere(0.030)), aboveZero(), uhmwpe(), 0.005, 60);
    const JointCoordinates q{0, 0, 0, 0, 0.036 - depth, 0};
    const double paper = ContactPair(d).evaluate(q).total.forceOnM_F.y();
    d.correction = Correction::energy;
    difference.push_back(ContactPair(d).evaluate(q).total.forceOnM_F.y() / paper - 1);
    std::printf("depth %.2f mm: energy form %+.3e of the paper's force\n", 1e3 * depth, difference.back());
  }
  // Closed form, linear law: d = (R - rho)/cos(theta/2) with rho = |A - centre|, cos theta = a/rho, a = R - D. E = (K/2h) 2 pi int d^2 r dr
  // with cos^2(theta/2) = (1 + a/rho)/2 gives E = (2 pi K/h) int_a^R (R - rho)^2 rho^2/(rho + a) drho, whose derivative by D is the force.
  const double R = 0.030, K = uhmwpe().confinementFactor() * uhmwpe().E_Pa, h = 0.006;
  const auto energy = [&](double depth) {
    const double a = R - depth;
    double sum = 0;
    constexpr int n = 2000;  // Simpson
    for (int i = 0; i <= n; ++i) {
      const double rho = a + depth * i / n;
      sum += (i == 0 || i == n ? 1 : i % 2 == 1 ? 4 : 2) * std::pow(R - rho, 2) * rho * rho / (rho + a);
    }
    return 2 * kPi * K / h * sum * depth / (3 * n);
  };
  const double depth = 0.2e-3, step = 1e-7;
  const double force = (energy(depth + step) - energy(depth - step)) / (2 * step);
  const double paper = kPi * K * depth * depth / h * (R - 2 * depth / 3);
  // Fourth-order grid: 60 cells over 10 mm resolve the force to 2e-6 of itself.
  EXPECT_NEAR(difference[2], force / paper - 1, 5e-6);
  EXPECT_NEAR(difference[2] / difference[1], 2, 0.05);
  EXPECT_NEAR(difference[1] / difference[0], 2, 0.05);
}

// The load is C1: its second derivative jumps as the rim crosses nodes, which differences see as step times jump. A law that bends
// within a cell jumps most (4e-7 for n = 3, 1e-5 for n = 3.7 at 30 x 30), and less on a finer grid.
const auto energyCases = testing::Values(
        StiffnessCase{"energy", uhmwpe(), StrainMeasure::small, {}, {}, Correction::energy},
        StiffnessCase{"energy_log_two_layers", cartilage(), StrainMeasure::large, constantThickness(0.002), {}, Correction::energy},
        StiffnessCase{"energy_series", uhmwpe(), StrainMeasure::small, constantThickness(0.002), cartilage(), Correction::energy},
        StiffnessCase{"energy_power_law", uhmwpePowerLaw(), StrainMeasure::small, {}, {}, Correction::energy, 60},
        StiffnessCase{"energy_layer_over_plane", uhmwpe(), StrainMeasure::small, abovePlane(0.1), {}, Correction::energy},
        StiffnessCase{"energy_map", cartilage(), StrainMeasure::large, smoothMap(), {}, Correction::energy},
        StiffnessCase{"energy_rational", uhmwpe(), StrainMeasure::small, abovePlane(0.1), {}, Correction::energy, 30,
                      DistanceMethod::minimum, true});
INSTANTIATE_TEST_SUITE_P(Energy, Stiffness, energyCases, [](const auto& testCase) { return testCase.param.name; });
INSTANTIATE_TEST_SUITE_P(Laws, EnergyForm, energyCases, [](const auto& testCase) { return testCase.param.name; });
INSTANTIATE_TEST_SUITE_P(
    Laws, Stiffness,
    testing::Values(
        StiffnessCase{"linear", uhmwpe(), StrainMeasure::small, {}, {}, Correction::midsurface},
        StiffnessCase{"uncorrected", uhmwpe(), StrainMeasure::small, {}, {}, Correction::none},
        StiffnessCase{"log", uhmwpe(), StrainMeasure::large, {}, {}, Correction::midsurface},
        StiffnessCase{"two_layers", cartilage(), StrainMeasure::large, constantThickness(0.002), {}, Correction::midsurface},
        StiffnessCase{"series", uhmwpe(), StrainMeasure::small, constantThickness(0.002), cartilage(), Correction::midsurface},
        StiffnessCase{"layer_over_plane", uhmwpe(), StrainMeasure::small, abovePlane(0.1), {}, Correction::midsurface},
        StiffnessCase{"ray", uhmwpe(), StrainMeasure::small, {}, {}, Correction::midsurface, 30, DistanceMethod::ray},
        StiffnessCase{"ray_uncorrected", uhmwpe(), StrainMeasure::small, {}, {}, Correction::none, 30, DistanceMethod::ray},
        StiffnessCase{"ray_log_two_layers", cartilage(), StrainMeasure::large, constantThickness(0.002), {}, Correction::midsurface, 30,
                      DistanceMethod::ray},
        StiffnessCase{"ray_layer_over_plane", uhmwpe(), StrainMeasure::small, abovePlane(0.1), {}, Correction::midsurface, 30,
                      DistanceMethod::ray},
        StiffnessCase{"power_law", uhmwpePowerLaw(), StrainMeasure::small, {}, {}, Correction::midsurface, 60},
        StiffnessCase{"power_law_any_n", [] { Material m = uhmwpePowerLaw(); m.n = 3.7; return m; }(), StrainMeasure::large, {}, {}, Correction::midsurface, 60}),
    [](const auto& testCase) { return testCase.param.name; });

TEST(ThicknessMapWithHoles, CullingStaysExact) {
  // The bone ends inside the cartilage: nodes go out of use as their feet move over its end. A walk that slides over that end, with
  // jumps; feet warm or cold to 1e-13 m, relative to depths of 1e-5 m and more.
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto bone = makeCondyle(false, 0);
  for (Vec3& p : bone.points) p = 0.94 * Vec3(0.55 * p.x(), p.y(), 0.8 * p.z());
  std::vector<NurbsPatch> back;
  back.emplace_back(std::move(bone));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), cartilage(), 0.012, 30);
  d.strain = StrainMeasure::large;
  d.movingThickness.source = BackSurface{share(std::move(back)), BackDirection::normal};
  d.copyTolerance = -1;
  const ContactPair culled(d);
  ASSERT_GT(culled.thicknessMapReports()[0].missed, 0);
  d.tracking = Tracking::all;
  const ContactPair all(d);
  const JointCoordinates home = findPoseOfLoad(culled, 100);
  ContactWorkspace workspace(culled), other(all);
  ContactResult r, expected;
  std::mt19937 random(17);
  std::normal_distribution<double> unit(0, 1);
  JointCoordinates q = home;
  int withHoles = 0, saved = 0;
  for (int i = 0; i < 300; ++i) {
    const double step = i % 20 == 0 ? 10 : 1;
    for (size_t k = 0; k < 6; ++k) q[k] = home[k] + 0.9 * (q[k] - home[k]) + step * unit(random) * (k == 2 ? 1e-2 : k < 3 ? 1e-3 : 2e-5);
    culled.evaluate(q, workspace, {}, r);
    all.evaluate(q, other, {}, expected);
    ASSERT_LT((r.total.forceOnM_F - expected.total.forceOnM_F).norm(), 1e-8 * std::max(1.0, expected.total.forceOnM_F.norm())) << i;
    ASSERT_EQ(r.total.activeElements, expected.total.activeElements) << i;
    withHoles += expected.total.noThicknessElements > 0;
    saved += expected.distanceQueries - r.distanceQueries;
  }
  EXPECT_GT(withHoles, 5);
  EXPECT_GT(saved, 0);
}

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
    const double step = j < 3 ? 5e-6 : 1e-7;
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

/** y = x^2/(2 R) + g(z) over |x| < 10 mm, -12 mm < z: g is 0 up to 4 mm. There the surface ends, or rises 1.5 times as fast as z within
 half a millimetre and ends at 9 mm. */
std::shared_ptr<const ContactSurface> makeRunner(double R, bool turns) {
  constexpr double half = 0.010, step = 0.0005, from = -0.012, edge = 0.004;
  NurbsPatchData d;
  d.degreeU = d.degreeV = 2;
  d.knotsU = {0, 0, 0, 1, 1, 1};
  d.numU = 3;
  const double to = turns ? 0.009 : edge;
  d.numV = static_cast<int>(std::lround((to - from) / step)) + 2;
  d.knotsV = clampedKnots(d.numV, 2, from, to);
  const double x[3] = {-half, 0, half}, y[3] = {half * half / (2 * R), -half * half / (2 * R), half * half / (2 * R)};  // Bezier, exact
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < static_cast<size_t>(d.numV); ++j) {
      const double z = 0.5 * (d.knotsV[j + 1] + d.knotsV[j + 2]);  // Greville: z is linear in v
      d.points.push_back(Vec3(x[i], y[i] + 1.5 * std::max(0.0, z - edge), z));
    }
  }
  d.flipNormal = NurbsPatch(d).calcNormal(0.5, 0).y() > 0;
  std::vector<NurbsPatch> patches;
  patches.emplace_back(std::move(d));
  return share(std::move(patches));
}

TEST(SmoothRule, ThePeakBesideAnEdgeIsOneThatTheSurfacesHave) {
  // The runner's lowest line lies D deep in a flat layer: nowhere more than K D / h, and that all along it. Cells of 1.5 mm: beside the
  // edge one neighbor is up to 2 mm above the layer, and a parabola through its centre overshoots by an eighth of that, ten times D.
  // The place is found up to what a parabola leaves out of the distance, dx^4/(8 R^3) = 2.3e-8 m, 1.2e-3 of D, which is met within
  // 0.025 dx of the line. Above is only the distance's tolerance of 1e-13 m, 1e-8 of D.
  const double R = 0.030, h = 0.006, D = 0.02e-3;
  const double peak = uhmwpe().confinementFactor() * uhmwpe().E_Pa * D / h;
  for (const bool turns : {true, false}) {
    const auto runner = makeRunner(R, turns);
    for (const DistanceMethod distance : {DistanceMethod::minimum, DistanceMethod::ray}) {
      for (int phase = 0; phase < 12; ++phase) {
        auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), runner, constantThickness(h), uhmwpe(), 0.009, 12, 1.3e-4 * phase,
                           1.5e-3 * phase / 12);
        d.distance = distance;
        const ContactResult r = ContactPair(d).evaluate(JointCoordinates{0, 0, 0, 0, h - D, 0});
        EXPECT_LT(r.total.peakPressure_Pa, peak * (1 + 1e-7)) << turns << ' ' << phase;
        EXPECT_GT(r.total.peakPressure_Pa, peak * (1 - 1.2e-3)) << turns << ' ' << phase;
        EXPECT_NEAR(r.total.maxStrain, D / h, 1.2e-3 * D / h);
        EXPECT_LT(std::abs(r.total.peakPoint_F.x()), 0.025 * 1.5e-3);
        EXPECT_LT(r.total.peakPoint_F.z(), 4e-3);
      }
    }
  }
}

TEST(SmoothRule, ElementsThatTheGridDoesNotResolveAreMarked) {
  // The runner's line from z = -12 to 4 mm, 20 um deep: on cells of 1.5 mm the row of elements beside the turn is wrong, and only that row;
  // a sphere's gap is a parabola, of which every cell knows the same. Those that disagree by less than a tenth of the largest strain are
  // wrong by less than a tenth of the largest pressure times their area.
  const double R = 0.030, h = 0.006, D = 0.02e-3;
  const auto plane = share(makePlane(h, 0, 0, Solid::below, 0.05));
  const auto turning = makeRunner(R, true);
  const JointCoordinates q{0, 0, 0, 0, h - D, 0};
  const double tenth_N = 0.1 * uhmwpe().confinementFactor() * uhmwpe().E_Pa * D / h * 1.5e-3 * 1.5e-3;
  for (int phase = 0; phase < 8; ++phase) {
    const double dz = 1.5e-3, z = dz * phase / 8;
    const ContactPair pair(makeScene(plane, turning, constantThickness(h), uhmwpe(), 0.009, 12, 1.3e-4, z));
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(q, workspace, {}, r);
    // Elements of 1/20 of the size say what each carries: sums of 20 x 20 of them.
    const ContactPair fine(makeScene(plane, turning, constantThickness(h), uhmwpe(), 0.009, 240, 1.3e-4, z));
    ContactWorkspace fineWorkspace(fine);
    ContactResult fineResult;
    fine.evaluate(q, fineWorkspace, {}, fineResult);
    std::vector<double> exact_N(12 * 12);
    const auto fields = pair.calcFields(workspace), fineFields = fine.calcFields(fineWorkspace);
    for (const ElementField& f : fineFields[0]) exact_N[static_cast<size_t>(12 * (f.ix / 20) + f.iz / 20)] += f.force_N;
    int marked = 0;
    double worstMarked_N = 0, worstOther_N = 0;
    for (const ElementField& f : fields[0]) {
      const double error_N = std::abs(f.force_N - exact_N[static_cast<size_t>(12 * f.ix + f.iz)]);
      (f.unresolved ? worstMarked_N : worstOther_N) = std::max(f.unresolved ? worstMarked_N : worstOther_N, error_N);
      if (!f.unresolved) continue;
      ++marked;
      EXPECT_TRUE(f.active);
      EXPECT_LT(std::abs(f.p_FA.z() - 0.004), 1.5 * dz) << phase;
    }
    EXPECT_GT(marked, 0) << phase;
    EXPECT_GT(worstMarked_N, tenth_N) << phase;
    EXPECT_LT(worstOther_N, tenth_N) << phase;
  }
  for (const int n : {6, 12, 30}) {
    const ContactPair pair(makeScene(plane, share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.009, n, 1.3e-4, 2.1e-4));
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(JointCoordinates{0, 0, 0, 0, h + R - 1e-4, 0}, workspace, {}, r);
    EXPECT_GT(r.total.activeElements, 0);
    const auto fields = pair.calcFields(workspace);
    for (const ElementField& f : fields[0]) EXPECT_FALSE(f.unresolved) << n;
  }
}

TEST(SmoothRule, TheQueryOfThePeakIsCounted) {
  // Under a grid point the polynomials have their top there, by symmetry, and nothing is asked between the points.
  const double R = 0.030, h = 0.006;
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.009, 9);
  d.tracking = Tracking::all;
  d.copyTolerance = -1;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  const auto count = [&](double x, double lift) {
    pair.evaluate(JointCoordinates{0, 0, 0, x, h + R + lift, 0}, workspace, {}, r);
    return r.distanceQueries;
  };
  const int points = 11 * 11;  // the elements and the ring around them
  EXPECT_EQ(count(0, 0.001), points);
  EXPECT_EQ(count(0, -1e-4), points);
  EXPECT_NEAR(r.total.peakPoint_F.x(), 0, 1e-15);
  EXPECT_EQ(count(0.0007, -1e-4), points + 1);
  EXPECT_NEAR(r.total.peakPoint_F.x(), 0.0007, 1e-6);  // fourth order: the cells are of 2 mm, but a sphere's gap is nearly a parabola
}

TEST(SmoothRule, ThePeakIsTheSameForEveryInstructionSet) {
  // Sums are fused or not, so that bits differ. A distance is known to 1e-14 m (FootTest), a ray's to 1e-13 m (RayTest); the place of the
  // peak follows from differences of some 1e-6 m, to 1e-7 of a cell at most, and beside it the pressure falls by the square of that.
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  const auto moving = share(std::move(condyle));
  const auto dish = share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02));
  int between = 0, poses = 0;
  for (const DistanceMethod distance : {DistanceMethod::minimum, DistanceMethod::ray}) {
    for (const Material& material : {uhmwpe(), uhmwpePowerLaw()}) {
      auto d = makeScene(dish, moving, aboveZero(), material, 0.012, 20);
      d.distance = distance;
      const ContactPair pair(d);
      const JointCoordinates home = findPoseOfLoad(pair, 500);
      std::mt19937 random(23);
      std::uniform_real_distribution<double> unit(-1, 1);
      for (int i = 0; i < 20; ++i) {
        JointCoordinates q = home;
        for (size_t k = 0; k < 6; ++k) q[k] += unit(random) * (k < 3 ? 0.02 : k == 4 ? 2e-5 : 5e-4);
        ASSERT_TRUE(detail::forceInstructionSet("baseline"));
        const ContactResult expected = pair.evaluate(q, {});
        if (!(expected.total.maxStrain > 0)) continue;
        ++poses;
        double nearest_m = 1;
        ContactWorkspace workspace(pair);
        ContactResult r;
        pair.evaluate(q, workspace, {}, r);
        const auto fields = pair.calcFields(workspace);
        for (const ElementField& f : fields[0]) nearest_m = std::min(nearest_m, (f.p_FA - r.total.peakPoint_F).norm());
        between += nearest_m > 1e-6;
        for (const char* name : {"avx2", "avx512"}) {
          if (!detail::forceInstructionSet(name)) continue;
          const ContactResult other = pair.evaluate(q, {});
          const double depth_m = expected.total.maxStrain * 0.008;
          const double tolerance = (distance == DistanceMethod::ray ? 2e-13 : 2e-14) / depth_m;
          EXPECT_NEAR(other.total.maxStrain / expected.total.maxStrain, 1, tolerance) << name << ' ' << i;
          // The power law's slope over its secant is at most 1, its table good to 1e-9 but the same for all.
          EXPECT_NEAR(other.total.peakPressure_Pa / expected.total.peakPressure_Pa, 1, tolerance) << name << ' ' << i;
          EXPECT_LT((other.total.peakPoint_F - expected.total.peakPoint_F).norm(), 1e-7 * 0.0012) << name << ' ' << i;
        }
        EXPECT_TRUE(detail::forceInstructionSet(nullptr));
      }
    }
  }
  EXPECT_GT(poses, 60);
  EXPECT_GT(between, poses / 2);
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
