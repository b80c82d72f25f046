// Ray firing: free-form bodies, against the list of all crossings; warm starts; open borders.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace test;

/** A wavy condyle in a dish, so that neither normal is vertical. */
ContactPairDefinition makeCondyleInDish(int n, DistanceMethod distance) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle());
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.016)), share(condyle), constantThickness(0.008),
                     uhmwpe(), 0.010, n);
  d.rule = ContactRule::centre;
  d.distance = distance;
  d.copyTolerance = -1;
  return d;
}

JointCoordinates somePose(double depth) { return {0.01, 0.02, -0.1, 0.0005, 0.0421 - depth, -0.0004}; }

TEST(RayRule, EveryElementIsThatOfTheListOfCrossings) {
  const auto d = makeCondyleInDish(40, DistanceMethod::ray);
  const ContactPair pair(d), minimum(makeCondyleInDish(40, DistanceMethod::minimum));
  const ContactSurface& moving = *d.compartments[0].movingSurface;
  ContactWorkspace workspace(pair), minimumWorkspace(minimum);
  ContactResult r;
  const JointCoordinates q = somePose(0.001);
  const Pose X = calcPose(q);
  pair.evaluate(q, workspace, {}, r);
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  ContactResult byMinimum;
  minimum.evaluate(q, minimumWorkspace, {}, byMinimum);
  const auto fields = pair.calcFields(workspace)[0], minimumFields = minimum.calcFields(minimumWorkspace)[0];
  int active = 0;
  Vec3 force = Vec3::Zero();
  std::vector<LineHit> all;
  for (size_t i = 0; i < fields.size(); ++i) {
    const ElementField& f = fields[i];
    const Vec3 A = X.applyInverse(f.p_FA), n = X.R.transpose() * f.normal_F;
    moving.findLineHits(A, n, -1, 0, all);
    const bool inside = !all.empty() && all.back().normal.dot(n) < 0;
    ASSERT_EQ(f.active, inside) << i;
    // Both methods agree on who is in contact: inside is inside.
    ASSERT_EQ(f.active, minimumFields[i].active) << i;
    if (!inside) continue;
    ++active;
    const double AC = -all.back().t_m;
    const Vec3 u = -all.back().normal;
    const double cosine = u.dot(n), half = std::cos(0.5 * std::acos(std::min(1.0, cosine)));
    ASSERT_NEAR(f.distance_m, -AC, 1e-12);
    ASSERT_NEAR(f.d_m, AC * cosine / half, 1e-11);  // acos loses half the digits near 0, cos gains them back
    ASSERT_LT((f.forceDirection_F - X.R * (n + u).normalized()).norm(), 1e-10);
    // |AC| >= |AB|, and after the corrections both estimate the same penetration: they differ by the moving surface's
    // curvature (below 1/8 mm with the waves) over the foot's shift AB sin(theta).
    ASSERT_GE(AC, -minimumFields[i].distance_m - 1e-13);
    const double shift = AC * std::sqrt(1 - cosine * cosine);
    ASSERT_NEAR(f.d_m, minimumFields[i].d_m, shift * shift / 0.008 + 1e-12);
    force += f.p_Pa * f.area_m2 * f.forceDirection_F;
  }
  EXPECT_GT(active, 50);
  EXPECT_LT((force - r.total.forceOnM_F).norm(), 1e-10 * force.norm());
}

class RayTracked : public testing::TestWithParam<Tracking> {};

TEST_P(RayTracked, WarmEqualsColdOverARandomWalk) {
  auto d = makeCondyleInDish(25, DistanceMethod::ray);
  d.tracking = GetParam();
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult warm;
  std::mt19937 random(9);
  std::normal_distribution<double> unit(0, 1);
  std::uniform_real_distribution<double> exponent(-7, -3);
  int touching = 0, apart = 0;
  for (int step = 0; step < 400; ++step) {
    const double size = std::pow(10, exponent(random));
    JointCoordinates q = somePose(0.0004 + 0.0008 * std::sin(0.05 * step));
    for (size_t k = 0; k < 6; ++k) q[k] += size * unit(random);
    pair.evaluate(q, workspace, {}, warm);
    const ContactResult cold = pair.evaluate(q, ContactPair::Options{});
    ASSERT_EQ(warm.total.activeElements, cold.total.activeElements) << step;
    ASSERT_EQ(warm.status, cold.status);
    // Distances agree to 1e-12 m; the pressure's slope is K/h = 2.7e11 Pa/m, the area below 4e-4 m^2.
    ASSERT_LT((warm.total.forceOnM_F - cold.total.forceOnM_F).norm(), 1e-12 * 2.7e11 * 4e-4) << step;
    ASSERT_LT((warm.total.momentOnM_Fo_F - cold.total.momentOnM_Fo_F).norm(), 1e-12 * 2.7e11 * 4e-4) << step;
    (cold.total.activeElements > 0 ? touching : apart)++;
  }
  EXPECT_GT(touching, 100);
  EXPECT_GT(apart, 20);
}

INSTANTIATE_TEST_SUITE_P(Modes, RayTracked, testing::Values(Tracking::all, Tracking::lipschitz, Tracking::breadthFirst));

TEST(RayRule, ARayThroughTheOpenSideCarriesNothing) {
  // The sheet ends on its flanks at z = +-20 mm, y = -22 mm. Rays of a layer that leans by 27 degrees about x pass by that border
  // although their elements lie behind the sheet.
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto d = makeScene(share(makePlane(0.008, 0, 0.5, Solid::below, 0.05)), share(condyle), constantThickness(0.008), uhmwpe(),
                     0.020, 40);
  d.rule = ContactRule::centre;
  d.distance = DistanceMethod::ray;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.008 + 0.034 - 0.015, 0}, workspace, {}, r);
  EXPECT_GT(r.total.boundaryElements, 0);
  EXPECT_EQ(r.total.notConvergedQueries, 0);
  const auto fields = pair.calcFields(workspace);
  for (const ElementField& f : fields[0]) EXPECT_FALSE(f.active && f.footOnBorder);
}

TEST(RayRule, SmoothRuleOfEveryTrackingIsThatOfEveryElement) {
  // Random walk with jumps and lift-off, hits found warm to 1e-13 m: relative to depths of 1e-5 m and more, 1e-8.
  auto d = makeCondyleInDish(30, DistanceMethod::ray);
  d.rule = ContactRule::smooth;
  d.tracking = Tracking::all;
  const ContactPair all(d);
  for (const Tracking tracking : {Tracking::lipschitz, Tracking::breadthFirst}) {
    d.tracking = tracking;
    const ContactPair pair(d);
    ContactWorkspace workspace(pair), other(all);
    ContactResult r, expected;
    std::mt19937 random(11);
    std::normal_distribution<double> unit(0, 1);
    JointCoordinates q = somePose(0.001);
    int inContact = 0, out = 0;
    for (int i = 0; i < 150; ++i) {
      const double step = i % 15 == 0 ? 12 : 1;
      const JointCoordinates home = somePose(0.0009);
      for (size_t k = 0; k < 6; ++k) q[k] = home[k] + 0.8 * (q[k] - home[k]) + step * unit(random) * (k < 3 ? 1e-3 : 2e-5);
      pair.evaluate(q, workspace, {}, r);
      all.evaluate(q, other, {}, expected);
      ASSERT_NEAR(r.total.forceOnM_F.y(), expected.total.forceOnM_F.y(), 1e-8 * std::max(1.0, expected.total.forceOnM_F.norm()));
      ASSERT_EQ(r.total.activeElements, expected.total.activeElements);
      ++(expected.total.activeElements > 0 ? inContact : out);
    }
    EXPECT_GT(inContact, 50);
    EXPECT_GT(out, 2);
  }
}

TEST(RayRule, TheEnergyFormNeedsTheMinimumDistance) {
  auto d = makeCondyleInDish(5, DistanceMethod::ray);
  d.rule = ContactRule::smooth;
  d.correction = Correction::energy;
  try {
    const ContactPair pair(d);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("correction energy is not available with the distance by ray"));
  }
}

}  // namespace
}  // namespace genu::contact
