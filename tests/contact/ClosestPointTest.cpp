#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact {
namespace {

using test::makeCondyle;

ContactSurface makeCondyleSurface(bool rational) {
  std::vector<NurbsPatch> patches;
  patches.emplace_back(makeCondyle(rational));
  return ContactSurface(std::move(patches));
}

class CondyleQuery : public testing::TestWithParam<bool> {};

TEST_P(CondyleQuery, ConvergedMeansTheResidualIsSmall) {
  const ContactSurface surface = makeCondyleSurface(GetParam());
  std::mt19937 random(12);
  std::uniform_real_distribution<double> u(0.02, 0.98), v(-0.95, 0.95), depth(-0.003, 0.01);
  for (int i = 0; i < 20000; ++i) {
    const double uu = u(random), vv = v(random), t = depth(random);
    const Vec3 Q = surface.patch(0).calcPoint(uu, vv) + t * surface.patch(0).calcNormal(uu, vv);
    const auto foot = surface.findClosestPoint(Q);
    ASSERT_NE(foot.status, QueryStatus::notConverged);
    if (foot.status != QueryStatus::converged) continue;
    const auto d = surface.patch(0).evaluate(foot.at.u, foot.at.v);
    EXPECT_LE(std::abs((d.S - Q).dot(d.Su)), 1.01e-13 * d.Su.norm());
    EXPECT_LE(std::abs((d.S - Q).dot(d.Sv)), 1.01e-13 * d.Sv.norm());
    EXPECT_LE(foot.residual_m, 1.01e-13);
    EXPECT_GT(std::abs(foot.distance_m) + 1e-15, 0);
    if (std::abs(t) < surface.safeDistanceInside_m()) {
      EXPECT_NEAR(foot.distance_m, t, 1e-14);
    }
  }
}

TEST_P(CondyleQuery, WarmEqualsCold) {
  const ContactSurface surface = makeCondyleSurface(GetParam());
  std::mt19937 random(13);
  std::uniform_real_distribution<double> u(0, 1), v(-1, 1), depth(-0.02, 0.02);
  std::normal_distribution<double> step(0, 0.002);
  SurfaceParameter seed;
  Vec3 Q = surface.patch(0).calcPoint(0.5, 0);
  for (int i = 0; i < 6000; ++i) {
    Q += Vec3(step(random), step(random), step(random));
    if (i % 50 == 0) {  // a jump
      const double uu = u(random), vv = v(random);
      Q = surface.patch(0).calcPoint(uu, vv) + depth(random) * surface.patch(0).calcNormal(uu, vv);
    }
    const auto cold = surface.findClosestPoint(Q);
    const auto warm = surface.findClosestPoint(Q, seed.patch >= 0 ? &seed : nullptr);
    seed = warm.at;
    if (warm.status == cold.status && std::abs(warm.distance_m - cold.distance_m) < 1e-13) continue;
    // Only a tie may differ: two feet at the same distance, beyond the reach of any contact.
    ADD_FAILURE() << "warm " << warm.distance_m << " cold " << cold.distance_m << " status " << int(warm.status) << int(cold.status);
  }
}

INSTANTIATE_TEST_SUITE_P(PolynomialAndRational, CondyleQuery, testing::Bool());

TEST(ClosestPoint, OnAnOpenBorderSaysSo) {
  const ContactSurface surface(makePlane(0, 0, 0, Solid::above, 0.01));
  const auto foot = surface.findClosestPoint(Vec3(0.013, 0.001, -0.004));
  EXPECT_EQ(foot.status, QueryStatus::onBoundary);
  EXPECT_LT((foot.p_MB - Vec3(0.01, 0, -0.004)).norm(), 1e-15);
  EXPECT_NEAR(foot.distance_m, -std::hypot(0.003, 0.001), 1e-15);  // behind the sheet, sideways
  const auto corner = surface.findClosestPoint(Vec3(0.013, -0.001, -0.014));
  EXPECT_EQ(corner.status, QueryStatus::onBoundary);
  EXPECT_LT((corner.p_MB - Vec3(0.01, 0, -0.01)).norm(), 1e-15);
  EXPECT_GT(corner.distance_m, 0);
}

TEST(ClosestPoint, ClosedDirectionsWrapAcrossTheSeam) {
  const ContactSurface cylinder(makeCylinder(0.025, 0.04));
  EXPECT_TRUE(cylinder.patch(0).isClosedU());
  EXPECT_FALSE(cylinder.patch(0).isClosedV());
  SurfaceParameter seed;
  for (int i = 0; i <= 2000; ++i) {  // ten turns, warm all the way
    const double angle = 20 * kPi * i / 2000;
    const Vec3 Q(0.024 * std::cos(angle), 0.024 * std::sin(angle), 0.003);
    const auto foot = cylinder.findClosestPoint(Q, i > 0 ? &seed : nullptr);
    ASSERT_EQ(foot.status, QueryStatus::converged) << angle;
    ASSERT_NEAR(foot.distance_m, -0.001, 1e-16);
    seed = foot.at;
  }
}

TEST(ClosestPoint, PolesOfASurfaceOfRevolutionAreOrdinaryPoints) {
  // A spindle torus ends in two poles; so does a sphere of revolution given as a user's NURBS patch.
  NurbsPatchData sphere;
  const double R = 0.03, s = std::sqrt(0.5);
  sphere.degreeU = sphere.degreeV = 2;
  sphere.numU = 9;
  sphere.numV = 5;
  sphere.knotsU = {0, 0, 0, .25, .25, .5, .5, .75, .75, 1, 1, 1};
  sphere.knotsV = {0, 0, 0, .5, .5, 1, 1, 1};
  const double cx[] = {1, 1, 0, -1, -1, -1, 0, 1, 1}, cy[] = {0, 1, 1, 1, 0, -1, -1, -1, 0};
  const double rho[] = {0, 1, 1, 1, 0}, z[] = {-1, -1, 0, 1, 1};
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 5; ++j) {
      sphere.points.push_back(R * Vec3(rho[j] * cx[i], rho[j] * cy[i], z[j]));
      sphere.weights.push_back((i % 2 ? s : 1) * (j % 2 ? s : 1));
    }
  }
  std::vector<NurbsPatch> patches;
  patches.emplace_back(sphere);
  const ContactSurface surface(std::move(patches));
  EXPECT_TRUE(surface.patch(0).isClosedU());
  std::mt19937 random(21);
  std::uniform_real_distribution<double> angle(0, 2 * kPi), logRadius(-16, -2);
  for (int i = 0; i < 5000; ++i) {
    // Directions ever closer to a pole, the pole itself included.
    const double tilt = i == 0 ? 0 : std::pow(10, logRadius(random)), turn = angle(random);
    const Vec3 direction(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn), (i % 2 ? 1 : -1) * std::cos(tilt));
    const auto foot = surface.findClosestPoint(0.0295 * direction);
    ASSERT_EQ(foot.status, QueryStatus::converged) << tilt << " " << turn;
    // The foot may be off by the hair kept from the pole (1e-12 of the patch) times its size; the distance by its square.
    ASSERT_NEAR(foot.distance_m, -0.0005, 1e-15) << tilt;
    // Beside a pole S_u is ~1e-10 m and carries a rounding of 1e-17 m, which tilts that tangent by 1e-7.
    ASSERT_LT((foot.normal_M - direction).norm(), 1e-7) << tilt;
  }
  // Warm, straight across the pole.
  SurfaceParameter seed;
  for (int i = 0; i <= 400; ++i) {
    const double tilt = 0.2 * (i - 200) / 200.0;
    const Vec3 direction(std::sin(tilt) * 0.6, std::sin(tilt) * 0.8, std::cos(tilt));
    const auto foot = surface.findClosestPoint(0.0295 * direction, i > 0 ? &seed : nullptr);
    ASSERT_EQ(foot.status, QueryStatus::converged) << tilt;
    ASSERT_NEAR(foot.distance_m, -0.0005, 1e-15) << tilt;
    seed = foot.at;
  }
}

TEST(ClosestPoint, TheDimpleOfASpindleTorusIsACorner) {
  // A spindle torus is an apple: two dimples that end in sharp points on the axis. Below one, in the solid, the point
  // itself is nearest; above it, outside, a flank is.
  const double Rs = 0.038, Rf = 0.022, tip = std::sqrt(Rf * Rf - (Rs - Rf) * (Rs - Rf));
  const ContactSurface torus(makeTorus(Rs, Rf));
  std::mt19937 random(41);
  std::uniform_real_distribution<double> small(-2e-4, 2e-4), turn(0, 2 * kPi);
  for (int i = 0; i < 2000; ++i) {
    const double side = i % 2 ? 1 : -1;
    const Vec3 point(0, 0, side * tip);
    const Vec3 inside(0.1 * small(random), 0.1 * small(random), side * (tip - 0.001));
    const auto below = torus.findClosestPoint(inside);
    ASSERT_EQ(below.status, QueryStatus::converged) << inside.transpose();
    // The patch is kept 1e-12 of its parameter range from the point: 3e-12 rad of a circle of 22 mm.
    ASSERT_NEAR(below.distance_m, -(inside - point).norm(), 1e-12);
    ASSERT_LT((below.normal_M - (point - inside).normalized()).norm(), 1e-9);
    const double angle = turn(random), r = 1e-6 + std::abs(small(random));
    const Vec3 Q(r * std::cos(angle), r * std::sin(angle), side * (tip + 0.001));
    const auto foot = torus.findClosestPoint(Q);
    ASSERT_EQ(foot.status, QueryStatus::converged) << Q.transpose();
    // Distance to the circle on the far side of the axis or the near one, centers at radius Rs - Rf.
    ASSERT_NEAR(foot.distance_m, std::hypot((Rs - Rf) - r, Q.z()) - Rf, 1e-14) << Q.transpose();
  }
}

TEST(ClosestPoint, SafeDistanceIsHalfTheSmallestRadiusOfCurvatureOfASphere) {
  // All medial balls of a sphere have its radius inside, and none exists outside.
  const ContactSurface sphere(makeSphere(0.03));
  EXPECT_NEAR(sphere.safeDistanceInside_m(), 0.015, 1e-9);
  EXPECT_TRUE(std::isinf(sphere.safeDistanceOutside_m()));
  const ContactSurface dish(makeDish(0, 0.05, 0.03, Solid::below, 0.02));
  EXPECT_NEAR(dish.safeDistanceOutside_m(), 0.015, 1e-4);  // the hollow side of a fixed dish, frontal radius 30 mm
}

TEST(ClosestPoint, NearTheMiddleOfASphereTheSearchIsShort) {
  const double R = 0.03;
  const ContactSurface sphere(makeSphere(R));
  std::mt19937 random(5);
  std::normal_distribution<double> unit(0, 1);
  // The boxes of most of the 4000 pieces are nearer than the foot: searches from all of them take 6000, 40000 and 200000
  // iterations. 512 searches of at most 60 are allowed.
  const std::pair<double, int> cases[] = {{0.05, 600}, {1e-3, 512 * 60}, {1e-6, 512 * 60}, {1e-9, 512 * 60}};
  for (const auto& [offset, most] : cases) {
    for (int i = 0; i < 100; ++i) {
      const Vec3 Q = offset * R * Vec3(unit(random), unit(random), unit(random)).normalized();
      const auto foot = sphere.findClosestPoint(Q);
      ASSERT_LE(foot.iterations, most);
      if (offset > 0.01) {
        ASSERT_EQ(foot.status, QueryStatus::converged);
        ASSERT_NEAR(foot.distance_m, -(1 - offset) * R, 1e-14);
        continue;
      }
      // Not all pieces that tie were searched, which must show: the distance is an upper bound within a tenth.
      ASSERT_EQ(foot.status, QueryStatus::notConverged);
      ASSERT_GE(-foot.distance_m, (1 - offset) * R * (1 - 1e-12));
      ASSERT_LE(-foot.distance_m, (1 - offset) * R / 0.9);
    }
  }
}

TEST(ClosestPoint, FarAwayTheFootIsFoundAsWellAsItCanBe) {
  const double R = 0.03;
  const ContactSurface sphere(makeSphere(R));
  std::mt19937 random(6);
  std::normal_distribution<double> unit(0, 1);
  for (const double far_m : {1e2, 1e3, 1e6, 1e9}) {
    for (int i = 0; i < 100; ++i) {
      const Vec3 n = Vec3(unit(random), unit(random), unit(random)).normalized();
      const auto foot = sphere.findClosestPoint(far_m * n);
      ASSERT_EQ(foot.status, QueryStatus::converged) << far_m;
      // Q is rounded, and so is its distance.
      ASSERT_NEAR(foot.distance_m, far_m - R, 1e-15 * far_m);
      // The tangential residual, 8e-16 of the distance, turns the foot by as much.
      ASSERT_LE((foot.p_MB - R * n).norm(), 2e-15 * R + 1e-13) << far_m;
    }
  }
}

/** y = slope (|x| + |z|), solid above: four planes, four creases and a corner at the origin. */
ContactSurface makePyramid(double slope, double half) {
  NurbsPatchData d;
  d.degreeU = d.degreeV = 1;
  d.numU = d.numV = 3;
  d.knotsU = d.knotsV = {0, 0, 0.5, 1, 1};
  for (const double x : {-half, 0.0, half}) {
    for (const double z : {-half, 0.0, half}) d.points.push_back(Vec3(x, slope * (std::abs(x) + std::abs(z)), z));
  }
  d.flipNormal = NurbsPatch(d).calcNormal(0.1, 0.1).y() > 0;
  std::vector<NurbsPatch> patches;
  patches.emplace_back(d);
  return ContactSurface(std::move(patches));
}

TEST(ClosestPoint, FeetOnACreaseAndWhereTwoCross) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-0.01, 0.01), height(0.001, 0.01);
  for (const double slope : {0.1, 1.0, -0.1, -1.0}) {
    // Points below the pyramid that points down are outside, above the one that points up they are in the solid.
    const ContactSurface surface = makePyramid(slope, 0.03);
    const double sign = slope > 0 ? -1 : 1, steep = std::abs(slope);
    int onCrease = 0, onCorner = 0;
    for (int i = 0; i < 5000; ++i) {
      const Vec3 Q(place(random), sign * height(random), place(random));
      const auto foot = surface.findClosestPoint(Q);
      ASSERT_EQ(foot.status, QueryStatus::converged) << slope << " " << Q.transpose();
      // By symmetry: the point (a, steep (a + b), b), a, b >= 0, nearest to (x, -y, z).
      const double x = std::abs(Q.x()), y = std::abs(Q.y()), z = std::abs(Q.z());
      const double fall = steep * (steep * (x + z) + y) / (1 + 2 * steep * steep);
      double a = x - fall, b = z - fall;
      if (a < 0 || b < 0) {
        const double along = std::max((std::max(x, z) - steep * y) / (1 + steep * steep), 0.0);
        a = x > z ? along : 0;
        b = x > z ? 0 : along;
        ++(along > 0 ? onCrease : onCorner);
      }
      const double distance = Vec3(a - x, steep * (a + b) + y, b - z).norm();
      ASSERT_NEAR(foot.distance_m, -sign * distance, 1e-15) << slope << " " << Q.transpose();
      ASSERT_NEAR((Q - foot.p_MB - foot.distance_m * foot.normal_M).norm(), 0, 1e-15);
    }
    EXPECT_GT(onCrease, 100);
    EXPECT_GT(onCorner, 5);
  }
}

TEST(ClosestPoint, NotANumberIsNotConverged) {
  const ContactSurface sphere(makeSphere(0.03));
  EXPECT_EQ(sphere.findClosestPoint(Vec3(std::nan(""), 0, 0)).status, QueryStatus::notConverged);
}

TEST(LineHits, FindBothSidesOfASphereInOrder) {
  const ContactSurface sphere(makeSphere(0.03));
  std::vector<LineHit> hits;
  std::mt19937 random(31);
  std::uniform_real_distribution<double> offset(-0.02, 0.02);
  for (int i = 0; i < 2000; ++i) {
    const double x = offset(random), z = offset(random);
    const double half = std::sqrt(0.03 * 0.03 - x * x - z * z);
    sphere.findLineHits(Vec3(x, -0.1, z), Vec3::UnitY(), 0, 1, hits);
    ASSERT_EQ(hits.size(), 2u) << x << " " << z;
    EXPECT_NEAR(hits[0].t_m, 0.1 - half, 1e-12);  // 1e-13 across the line, slope up to 1.9
    EXPECT_NEAR(hits[1].t_m, 0.1 + half, 1e-12);
    EXPECT_LT(hits[0].normal.y(), 0);
    EXPECT_GT(hits[1].normal.y(), 0);
  }
  sphere.findLineHits(Vec3(0.031, -0.1, 0), Vec3::UnitY(), 0, 1, hits);
  EXPECT_TRUE(hits.empty());
}

}  // namespace
}  // namespace genu::contact
