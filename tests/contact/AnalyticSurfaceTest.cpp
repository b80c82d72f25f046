#include "genu/contact/AnalyticSurface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

#include "genu/contact/ContactSurface.h"

namespace genu::contact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/** Every point of every patch obeys the implicit equation, and the outward normal points to where it is > 0. */
void expectImplicit(const std::vector<NurbsPatch>& patches, const std::function<double(const Vec3&)>& f, double tolerance) {
  for (const NurbsPatch& p : patches) {
    for (int i = 0; i <= 60; ++i) {
      for (int j = 0; j <= 60; ++j) {
        const double u = p.uMin() + (p.uMax() - p.uMin()) * i / 60, v = p.vMin() + (p.vMax() - p.vMin()) * j / 60;
        const Vec3 S = p.calcPoint(u, v), n = p.calcNormal(u, v);
        ASSERT_NEAR(f(S), 0, tolerance) << S.transpose();
        ASSERT_NEAR(n.norm(), 1, 1e-12);
        if (i % 20 != 0 && j % 20 != 0) {
          ASSERT_GT(f(S + 1e-6 * n), f(S - 1e-6 * n)) << S.transpose();
        }
      }
    }
  }
}

// Tolerances: rounding, 1e-16 times the largest coordinate times a handful of operations.
TEST(AnalyticSurface, PlaneIsExact) {
  const auto above = [](const Vec3& p) { return p.y() - (0.006 + 0.3 * p.x() - 0.2 * p.z()); };
  expectImplicit(makePlane(0.006, 0.3, -0.2, Solid::below, 0.1), above, 1e-16);
  expectImplicit(makePlane(0.006, 0.3, -0.2, Solid::above, 0.1), [&](const Vec3& p) { return -above(p); }, 1e-16);
}

TEST(AnalyticSurface, ParaboloidsAndSaddlesAreExact) {
  for (const auto& [Rx, Rz] : {std::pair{0.05, 0.03}, std::pair{-0.05, 0.03}, std::pair{-0.05, -0.1}, std::pair{kInf, 0.03}}) {
    const double rx = Rx, rz = Rz;
    expectImplicit(makeParaboloid(0.001, rx, rz, Solid::below, 0.03),
                   [&](const Vec3& p) { return p.y() - 0.001 - p.x() * p.x() / (2 * rx) - p.z() * p.z() / (2 * rz); }, 2e-17);
  }
}

TEST(AnalyticSurface, ClosedSurfacesAreExact) {
  expectImplicit(makeSphere(0.03), [](const Vec3& p) { return p.norm() - 0.03; }, 5e-17);
  expectImplicit(makeEllipsoid(0.03, 0.02, 0.05),
                 [](const Vec3& p) { return p.cwiseQuotient(Vec3(0.03, 0.02, 0.05)).norm() - 1; }, 2e-15);
  expectImplicit(makeCylinder(0.025, 0.02), [](const Vec3& p) { return std::hypot(p.x(), p.y()) - 0.025; }, 5e-17);
  for (const double Rf : {0.01, 0.025}) {  // ring and spindle
    const double Rs = 0.038;
    expectImplicit(makeTorus(Rs, Rf),
                   [&](const Vec3& p) { return std::hypot(std::hypot(p.x(), p.y()) - (Rs - Rf), p.z()) - Rf; }, 2e-16);
  }
}

TEST(AnalyticSurface, DishFollowsItsFormula) {
  for (const auto& [Rs, Rf] : {std::pair{0.058, 0.037}, std::pair{0.04, 0.04}, std::pair{0.03, 0.05}, std::pair{0.05, kInf},
                               std::pair{kInf, 0.05}, std::pair{kInf, kInf}}) {
    const double rs = Rs, rf = Rf;
    for (const Solid solid : {Solid::below, Solid::above}) {
      const double sign = solid == Solid::below ? 1 : -1;
      expectImplicit(makeDish(0.007, rs, rf, solid, 0.02),
                     [&](const Vec3& p) {
                       double y = 0.007;
                       if (std::isinf(rs) && !std::isinf(rf)) {
                         y += rf - std::sqrt(rf * rf - p.z() * p.z());
                       } else if (!std::isinf(rs)) {
                         const double section = std::isinf(rf) ? 0 : rf - std::sqrt(rf * rf - p.z() * p.z());
                         const double rho = rs - section;
                         y += rs - std::sqrt(rho * rho - p.x() * p.x());
                       }
                       return sign * (p.y() - y);
                     },
                     1e-16);
    }
  }
}

TEST(AnalyticSurface, SphereChartsCoverEverythingWithMargin) {
  const ContactSurface sphere(makeSphere(0.03));
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 direction = Vec3(normal(random), normal(random), normal(random)).normalized();
    const auto foot = sphere.findClosestPoint(0.029 * direction);
    ASSERT_EQ(foot.status, QueryStatus::converged);
    // Tangential error 1e-13 m on a depth of 1 mm: distance error (1e-13)^2/1e-3; rounding 1e-17 dominates.
    ASSERT_NEAR(foot.distance_m, -0.001, 1e-16);
    ASSERT_LT((foot.normal_M - direction).norm(), 1e-10);
  }
}

TEST(AnalyticSurface, RejectsBadParametersByName) {
  const auto message = [](const std::function<void()>& make) {
    try {
      make();
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  using testing::HasSubstr;
  EXPECT_THAT(message([] { makeSphere(-1); }), HasSubstr("sphere: R = -1"));
  EXPECT_THAT(message([] { makeSphere(0); }), HasSubstr("sphere: R = 0"));
  EXPECT_THAT(message([] { makeTorus(0.03, 0.04); }), HasSubstr("torus: Rf = 0.04"));
  EXPECT_THAT(message([] { makeParaboloid(0, 0, 1, Solid::above, 1); }), HasSubstr("paraboloid: Rx = 0"));
  EXPECT_THAT(message([] { makeDish(std::nan(""), 1, 1, Solid::below, 1); }), HasSubstr("dish: y0 = nan"));
  EXPECT_THAT(message([] { makeCylinder(0.1, 0); }), HasSubstr("cylinder: length = 0"));
  EXPECT_THAT(message([] { makePlane(0, kInf, 0, Solid::below, 1); }), HasSubstr("plane: sx = inf"));
}

}  // namespace
}  // namespace genu::contact
