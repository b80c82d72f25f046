// The fast solver behind the distance queries: every instruction set, moving points, surfaces in several patches.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "contact/SplitPatch.h"
#include "contact/TestSurfaces.h"
#include "detail/Kernels.h"
#include "detail/TrackedFoot.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact {
namespace {

using detail::FootDerivatives;
using detail::TrackedFoot;

ContactSurface makeSurface(const NurbsPatchData& data) {
  std::vector<NurbsPatch> patches;
  patches.emplace_back(data);
  return ContactSurface(std::move(patches));
}

Vec3 pointBeside(const NurbsPatch& patch, double u, double v, double depth) {
  return patch.calcPoint(u, v) + depth * patch.calcNormal(u, v);
}

std::vector<TrackedFoot> makeFeet(size_t count) {
  std::vector<TrackedFoot> feet(count);
  for (TrackedFoot& foot : feet) foot.patch = -1;
  return feet;
}

class Feet : public testing::TestWithParam<bool> {};

TEST_P(Feet, EveryInstructionSetGivesTheSameFoot) {
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam()));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(0.02, 0.98), v(-0.95, 0.95), depth(-0.002, 0.004);
  std::vector<Vec3> points;
  for (int i = 0; i < 3000; ++i) points.push_back(pointBeside(surface.patch(0), u(random), v(random), depth(random)));
  ASSERT_TRUE(detail::forceInstructionSet("baseline"));
  EXPECT_STREQ(activeInstructionSet(), "baseline");
  std::vector<ClosestPoint> expected;
  for (const Vec3& Q : points) expected.push_back(surface.findClosestPoint(Q));
  for (const char* name : {"avx2", "avx512"}) {
    if (!detail::forceInstructionSet(name)) continue;
    EXPECT_STREQ(activeInstructionSet(), name);
    for (size_t i = 0; i < points.size(); ++i) {
      const ClosestPoint foot = surface.findClosestPoint(points[i]);
      ASSERT_EQ(foot.status, expected[i].status);
      // A few roundings of coordinates of 50 mm, 7e-18 m each.
      ASSERT_NEAR(foot.distance_m, expected[i].distance_m, 1e-14) << name;
      // Both residuals are below 1e-13 m; the Hessian of these points is at least a half.
      ASSERT_LT((foot.p_MB - expected[i].p_MB).norm(), 6e-13) << name;
    }
  }
  EXPECT_FALSE(detail::forceInstructionSet("no such thing"));
  EXPECT_TRUE(detail::forceInstructionSet(nullptr));
}

/** Feet of wandering points, spread over a part of the surface: many share a knot span (side by side in the lanes of vectors) or few do. */
void compareWithCold(const ContactSurface& surface, double part, FootDerivatives derivatives) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> u(0.5 - 0.45 * part, 0.5 + 0.45 * part), v(-0.9 * part, 0.9 * part), depth(-0.002, 0.004),
      exponent(-8, -3);
  std::normal_distribution<double> unit(0, 1);
  constexpr int kCount = 200;
  std::vector<double> Q;
  std::vector<int> ids;
  for (int i = 0; i < kCount; ++i) {
    const Vec3 p = pointBeside(surface.patch(0), u(random), v(random), depth(random));
    Q.insert(Q.end(), {p.x(), p.y(), p.z()});
    ids.push_back(kCount - 1 - i);
  }
  std::vector<TrackedFoot> feet = makeFeet(kCount);
  for (int step = 0; step < 60; ++step) {
    detail::trackFeet(surface, Q.data(), ids.data(), kCount, feet.data(), derivatives);
    for (size_t i = 0; i < kCount; ++i) {
      const TrackedFoot& foot = feet[static_cast<size_t>(ids[i])];
      const Vec3 q(Q[3 * i], Q[3 * i + 1], Q[3 * i + 2]);
      const ClosestPoint cold = surface.findClosestPoint(q);
      ASSERT_EQ(foot.status, cold.status);
      ASSERT_NEAR(foot.distance_m, cold.distance_m, 1e-14);
      if (foot.status != QueryStatus::converged) continue;
      const auto d = surface.patch(foot.patch).evaluate(foot.u, foot.v);
      const Vec3 B(foot.calcFoot_m(0), foot.calcFoot_m(1), foot.calcFoot_m(2)), normal(foot.normal[0], foot.normal[1], foot.normal[2]);
      ASSERT_EQ(q, Vec3(foot.Q[0], foot.Q[1], foot.Q[2]));
      ASSERT_NEAR((d.S - B).dot(normal), 0, 1e-15);  // the Taylor step agrees with an evaluation
      ASSERT_LT((d.S - B).norm(), 1.5e-13);          // the residual
      ASSERT_LE(std::abs((d.S - q).dot(d.Su)), 1.01e-13 * d.Su.norm());
      ASSERT_LE(std::abs((d.S - q).dot(d.Sv)), 1.01e-13 * d.Sv.norm());
    }
    const double length = std::pow(10, exponent(random));  // from 10 nm to 1 mm
    for (double& x : Q) x += 0.5 * length * unit(random);
  }
}

TEST_P(Feet, TrackedEqualsColdWhileThePointsWander) {
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam()));
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    if (!detail::forceInstructionSet(name)) continue;
    for (const double part : {1.0, 0.2}) {
      SCOPED_TRACE(std::string(name) + " " + std::to_string(part));
      compareWithCold(surface, part, FootDerivatives::first);
    }
  }
  EXPECT_TRUE(detail::forceInstructionSet(nullptr));
}

TEST(FeetInLanes, BesideEachOtherOrAloneTheyAreTheSame) {
  // One at a time, the vectors' lanes are not used; together they are. Derivatives of a converged foot to a few roundings.
  std::mt19937 random(16);
  std::uniform_real_distribution<double> u(0.45, 0.55), v(-0.1, 0.1), depth(-0.002, 0.004);
  for (const bool rational : {false, true}) {
    const ContactSurface surface = makeSurface(test::makeCondyle(rational));
    constexpr int kCount = 100;
    std::vector<double> Q;
    std::vector<int> ids;
    for (int i = 0; i < kCount; ++i) {
      const Vec3 p = pointBeside(surface.patch(0), u(random), v(random), depth(random));
      Q.insert(Q.end(), {p.x(), p.y(), p.z()});
      ids.push_back(i);
    }
    std::vector<TrackedFoot> together = makeFeet(kCount), alone = makeFeet(kCount);
    for (int pass = 0; pass < 3; ++pass) {
      detail::trackFeet(surface, Q.data(), ids.data(), kCount, together.data());
      for (int i = 0; i < kCount; ++i) detail::trackFeet(surface, Q.data() + 3 * i, &ids[static_cast<size_t>(i)], 1, alone.data());
      for (size_t i = 0; i < kCount; ++i) {
        const TrackedFoot &a = together[i], &b = alone[i];
        ASSERT_EQ(a.status, b.status);
        ASSERT_EQ(a.patch, b.patch);
        ASSERT_NEAR(a.distance_m, b.distance_m, 1e-15);
        // Both feet lie within 2e-13 m of each other, on radii of 10 mm and more; second derivatives are those at the start of the last
        // step, up to 3e-8 m away.
        for (int k = 0; k < 3; ++k) {
          ASSERT_NEAR(a.normal[k], b.normal[k], 1e-10);
          ASSERT_NEAR(a.nu[k], b.nu[k], 1e-5);
          ASSERT_NEAR(a.nv[k], b.nv[k], 1e-5);
        }
        for (int k = 0; k < 6; ++k) ASSERT_NEAR(a.duvdQ[k], b.duvdQ[k], 1e-4);  // of 30, over 3e-8 m
      }
      for (double& x : Q) x += 1e-5;
    }
  }
}

TEST_P(Feet, DerivativesAreThoseOfTheFoot) {
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam()));
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.1, 0.9), v(-0.8, 0.8), depth(-0.001, 0.001);
  const double h = 1e-6;
  for (int i = 0; i < 200; ++i) {
    const Vec3 q = pointBeside(surface.patch(0), u(random), v(random), depth(random));
    std::vector<TrackedFoot> feet = makeFeet(1);
    const int id = 0;
    detail::trackFeet(surface, q.data(), &id, 1, feet.data());
    const TrackedFoot& f = feet[0];
    ASSERT_EQ(f.status, QueryStatus::converged);
    for (int k = 0; k < 3; ++k) {
      const auto high = surface.findClosestPoint(q + h * Vec3::Unit(k)), low = surface.findClosestPoint(q - h * Vec3::Unit(k));
      // du/dQ is about 30 1/m and the foot resolves 1e-13 m: 1e-5 by rounding; the second-order term h^2 is smaller.
      ASSERT_NEAR(f.duvdQ[k], (high.at.u - low.at.u) / (2 * h), 1e-4);
      ASSERT_NEAR(f.duvdQ[3 + k], (high.at.v - low.at.v) / (2 * h), 1e-4);
      for (int m = 0; m < 3; ++m) {
        const double hessian = f.nu[m] * f.duvdQ[k] + f.nv[m] * f.duvdQ[3 + k];
        ASSERT_NEAR(hessian, (high.normal_M[m] - low.normal_M[m]) / (2 * h), 1e-3);  // of about 50 1/m
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(PolynomialAndRational, Feet, testing::Bool());

TEST(PatchBorders, ASplitCondyleHasTheDistanceOfTheWholeOne) {
  const NurbsPatchData whole = test::makeCondyle(false);
  const ContactSurface surface = makeSurface(whole);
  for (const int pieces : {2, 4}) {
    std::vector<NurbsPatch> patches = test::splitBothWays(whole, pieces);
    ASSERT_EQ(static_cast<int>(patches.size()), pieces * pieces);
    const ContactSurface split(std::move(patches));
    std::vector<TrackedFoot> feet = makeFeet(1);
    const int id = 0;
    int crossings = 0, last = -1;
    const double depth = -0.0004;
    for (int i = 0; i <= 4000; ++i) {
      const double t = 2 * kPi * i / 4000;
      const Vec3 q = pointBeside(surface.patch(0), 0.5 + 0.4 * std::sin(3 * t), 0.8 * std::cos(2 * t), depth);
      detail::trackFeet(split, q.data(), &id, 1, feet.data());
      ASSERT_EQ(feet[0].status, QueryStatus::converged) << pieces << " " << i;
      // The depth is far below the radius of curvature: the foot is the point the query started from.
      ASSERT_NEAR(feet[0].distance_m, depth, 1e-13) << pieces << " " << i;
      const ClosestPoint expected = surface.findClosestPoint(q);
      ASSERT_NEAR(feet[0].distance_m, expected.distance_m, 1e-13);
      ASSERT_LT((expected.p_MB - Vec3(feet[0].calcFoot_m(0), feet[0].calcFoot_m(1), feet[0].calcFoot_m(2))).norm(), 1e-12);
      crossings += last >= 0 && feet[0].patch != last;
      last = feet[0].patch;
    }
    EXPECT_GE(crossings, 8);
  }
}

}  // namespace
}  // namespace genu::contact
