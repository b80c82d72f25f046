#include "genu/contact/NurbsPatch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using test::makeCondyle;
using testing::HasSubstr;

class EveryDegree : public testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(EveryDegree, TablesAgreeWithBasisFunctions) {
  const auto [degree, rational] = GetParam();
  const NurbsPatch patch(makeCondyle(rational, 0.0003, 11, 13, degree));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(patch.uMin(), patch.uMax()), v(patch.vMin(), patch.vMax());
  for (int i = 0; i < 2000; ++i) {
    const double uu = u(random), vv = v(random);
    const auto a = patch.evaluate(uu, vv), b = patch.evaluateByBasisFunctions(uu, vv);
    // Rounding of points of 0.04 m, amplified per derivative by the inverse span width (10) and the degree.
    const double eps = 1e-16 * 0.04 * 50;
    const double g = 10.0 * degree;
    EXPECT_LT((a.S - b.S).norm(), eps);
    EXPECT_LT((a.Su - b.Su).norm(), eps * g);
    EXPECT_LT((a.Sv - b.Sv).norm(), eps * g);
    EXPECT_LT((a.Suu - b.Suu).norm(), eps * g * g);
    EXPECT_LT((a.Suv - b.Suv).norm(), eps * g * g);
    EXPECT_LT((a.Svv - b.Svv).norm(), eps * g * g);
  }
}

TEST_P(EveryDegree, DerivativesAreThoseOfThePosition) {
  const auto [degree, rational] = GetParam();
  const NurbsPatch patch(makeCondyle(rational, 0.0003, 11, 13, degree));
  std::mt19937 random(4);
  std::uniform_real_distribution<double> u(0.05, 0.95), v(-0.9, 0.9);
  const double e = 1e-5;
  for (int i = 0; i < 200; ++i) {
    double uu = u(random), vv = v(random);
    // Keep the stencil inside one span, where the surface is smooth.
    const auto tooClose = [&](const std::vector<double>& breaks, double t) {
      for (const double b : breaks) {
        if (std::abs(b - t) < 3 * e) return true;
      }
      return false;
    };
    if (tooClose(patch.breaksU(), uu) || tooClose(patch.breaksV(), vv)) continue;
    const auto d = patch.evaluate(uu, vv);
    const Vec3 Su = (patch.calcPoint(uu + e, vv) - patch.calcPoint(uu - e, vv)) / (2 * e);
    const Vec3 Sv = (patch.calcPoint(uu, vv + e) - patch.calcPoint(uu, vv - e)) / (2 * e);
    const Vec3 Suu = (patch.evaluate(uu + e, vv).Su - patch.evaluate(uu - e, vv).Su) / (2 * e);
    const Vec3 Suv = (patch.evaluate(uu, vv + e).Su - patch.evaluate(uu, vv - e).Su) / (2 * e);
    const Vec3 Svv = (patch.evaluate(uu, vv + e).Sv - patch.evaluate(uu, vv - e).Sv) / (2 * e);
    // Central differences: e^2/6 times the third derivative (0.04 m * 30^3 at most) = 2e-8, rounding 1e-17/1e-5.
    EXPECT_LT((d.Su - Su).norm(), 5e-8);
    EXPECT_LT((d.Sv - Sv).norm(), 5e-8);
    EXPECT_LT((d.Suu - Suu).norm(), 2e-6);
    EXPECT_LT((d.Suv - Suv).norm(), 2e-6);
    EXPECT_LT((d.Svv - Svv).norm(), 2e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(Degrees, EveryDegree, testing::Combine(testing::Values(1, 2, 3, 4, 5), testing::Bool()));

TEST(NurbsPatch, EndsInterpolateTheCorners) {
  const auto data = makeCondyle(true);
  const NurbsPatch patch(data);
  EXPECT_LT((patch.calcPoint(patch.uMin(), patch.vMin()) - data.points.front()).norm(), 1e-15);
  EXPECT_LT((patch.calcPoint(patch.uMax(), patch.vMax()) - data.points.back()).norm(), 1e-15);
}

TEST(NurbsPatch, TransformedMovesPointsAndNormals) {
  const NurbsPatch patch(makeCondyle(true));
  const Pose X = calcPose({0.3, -0.7, 1.1, 0.01, -0.02, 0.03});
  const NurbsPatch moved = patch.transformed(X);
  EXPECT_LT((moved.calcPoint(0.4, 0.2) - X.apply(patch.calcPoint(0.4, 0.2))).norm(), 1e-16 * 10);
  EXPECT_LT((moved.calcNormal(0.4, 0.2) - X.R * patch.calcNormal(0.4, 0.2)).norm(), 1e-13);
  EXPECT_LT((patch.flipped().calcNormal(0.4, 0.2) + patch.calcNormal(0.4, 0.2)).norm(), 1e-15);
}

TEST(NurbsPatch, RejectsBadDefinitionsByName) {
  const auto message = [](const std::function<void(NurbsPatchData&)>& spoil) {
    NurbsPatchData d = makeCondyle(true);
    spoil(d);
    try {
      NurbsPatch patch(std::move(d));
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(message([](auto& d) { d.degreeU = 6; }), HasSubstr("degree in u is 6; allowed: 1 to 5"));
  EXPECT_THAT(message([](auto& d) { d.knotsU[6] = 0.9; }), HasSubstr("knots_u must not decrease"));
  EXPECT_THAT(message([](auto& d) { d.knotsV.pop_back(); }), HasSubstr("knots_v has 23 values"));
  EXPECT_THAT(message([](auto& d) { d.knotsV[7] = std::nan(""); }), HasSubstr("knots_v[7] is not a finite number"));
  EXPECT_THAT(message([](auto& d) { d.weights[5] = -1; }), HasSubstr("weight 5 is -1"));
  EXPECT_THAT(message([](auto& d) { d.points[7].x() = std::numeric_limits<double>::infinity(); }), HasSubstr("point 7 is not finite"));
  EXPECT_THAT(message([](auto& d) { d.points.pop_back(); }), HasSubstr("has 299 points; needed: 300"));
  EXPECT_THAT(message([](auto& d) { d.knotsU[5] = d.knotsU[6] = d.knotsU[7] = d.knotsU[4]; }), HasSubstr("occurs 4 times; allowed: 3"));
  EXPECT_THAT(message([](auto& d) { d.points.assign(300, Vec3(1, 2, 3)); }), HasSubstr("all points coincide"));
  EXPECT_EQ(message([](auto&) {}), "accepted");
}

}  // namespace
}  // namespace genu::contact
