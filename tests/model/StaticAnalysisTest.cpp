#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ElementFixtures.h"
#include "genu/model/Analysis.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {
namespace {

using namespace testing_support;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Method = scene::StaticSpec::Method;

template <class Error, class Function>
std::string messageOf(Function f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  } catch (const std::exception& error) {
    return std::string("another error: ") + error.what();
  }
  return "no error";
}

StaticResult settle(scene::Scene scene, Method method) {
  if (!scene.staticAnalysis) scene.staticAnalysis.emplace();
  scene.staticAnalysis->method = method;
  return runStatic(scene);
}

double largestDifference(const scene::Coordinates& a, const scene::Coordinates& b) {
  double largest = 0;
  for (size_t i = 0; i < 6; ++i) largest = std::max(largest, (i < 3 ? kAngleLength_m : 1.0) * std::abs(a[i] - b[i]));
  return largest;
}

/** F = (pi K D^2/h)(R - 2D/3): sphere R = 30 mm, h = 6 mm, uhmwpe, minimum distance. */
double sphereForce_N(double D) {
  const double K = 2140.582192e6;
  return contact::kPi * K * D * D / 6e-3 * (0.03 - 2 * D / 3);
}

class SphereSettles : public ::testing::TestWithParam<Method> {};

// 60 x 60 whole cells over a contact radius of 41 cells' width: the midpoint sum errs by less than 3e-4 in the force,
// half of that in the depth, because F ~ D^2.
TEST_P(SphereSettles, AtTheClosedFormDepth) {
  const TemporaryFile urdf("sphere.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  const double D = 0.2e-3;
  scene.loads.push_back(verticalLoad(-sphereForce_N(D)));
  const StaticResult result = settle(scene, GetParam());
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  EXPECT_NEAR((36e-3 - result.q[y]) / D, 1, 1.5e-4);
  EXPECT_NEAR(result.contacts[0].total.forceOnM_F.y() / sphereForce_N(D), 1, 1e-5);
  EXPECT_GT(result.contacts[0].total.energy_J, 0);
  EXPECT_GT(result.iterations, 0);
  EXPECT_GT(result.contactEvaluations, 0);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(result.constraintForce[static_cast<size_t>(i)], 0, 1e-3) << i;
}

// The same with whole cells: analyses ask for no stiffness, which the centre rule does not have.
TEST(StaticAnalysis, CentreRuleSettlesToo) {
  const TemporaryFile urdf("sphere.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene.contacts[0].definition.rule = contact::ContactRule::centre;
  const double D = 0.2e-3;
  scene.loads.push_back(verticalLoad(-sphereForce_N(D)));
  const StaticResult result = settle(scene, Method::implicitEuler);
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  EXPECT_NEAR((36e-3 - result.q[y]) / D, 1, 1.5e-4);
}

INSTANTIATE_TEST_SUITE_P(Methods, SphereSettles, ::testing::Values(Method::newton, Method::implicitEuler));

TEST(StaticAnalysis, GravityIsALoad) {
  const TemporaryFile urdf("gravity.urdf", kneeUrdf(50));
  scene::Scene scene = sphereScene(urdf.path());
  scene.model->gravity_mPerS2 = {0, -9.81, 0};
  EXPECT_NEAR(settle(scene, Method::newton).contacts[0].total.forceOnM_F.y(), 50 * 9.81, 1e-5);
}

// The residual left by implicit Euler is at most maxAcceleration * mass = 3 mN; over the softest stiffness of this
// scene, some 1e5 N/m for the medial-lateral translation, that is 3e-8 m.
TEST(StaticAnalysis, BothMethodsAgreeOnTheKnee) {
  const TemporaryFile urdf("both.urdf", kneeUrdf());
  const StaticResult result = settle(kneeScene(urdf.path()), Method::both);
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  ASSERT_TRUE(result.methodDifference_m);
  EXPECT_LT(*result.methodDifference_m, 3e-8);
  EXPECT_LT(result.residual_N, 1e-6);
  EXPECT_EQ(result.method, "newton");
  // The load 9 mm medial of the middle, compartments 44 mm apart: 0.5 + 9/44 = 70 % medial, give or take the tilt.
  const contact::ContactResult& contact = result.contacts[0];
  EXPECT_NEAR(contact.compartments[0].scalarForce_N / contact.total.scalarForce_N, 0.70, 0.02);
  EXPECT_NEAR(contact.total.forceOnM_F.y(), 1500, 1e-5);
}

struct Start {
  double rx, y, z;
};
class KneeStarts : public ::testing::TestWithParam<Start> {};

TEST_P(KneeStarts, SettleIntoTheSamePose) {
  const TemporaryFile urdf("starts.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 20);
  const StaticResult reference = settle(scene, Method::newton);
  ASSERT_EQ(reference.status, StaticResult::Status::converged);
  const Start start = GetParam();
  scene.model->coordinates[Coordinate::rx] = scene::FreeCoordinate{start.rx};
  scene.model->coordinates[Coordinate::y] = scene::FreeCoordinate{start.y};
  scene.model->coordinates[Coordinate::z] = scene::FreeCoordinate{start.z};
  for (const Method method : {Method::newton, Method::implicitEuler}) {
    const StaticResult result = settle(scene, method);
    ASSERT_EQ(result.status, StaticResult::Status::converged) << result.method << ": " << result.statusText;
    // Newton leaves 1e-6 N; implicit Euler: see BothMethodsAgreeOnTheKnee.
    EXPECT_LT(largestDifference(result.q, reference.q), method == Method::newton ? 1e-10 : 3e-8) << result.method;
  }
}
// Separated by 0.1 to 10 mm, pressed in by 0.3 mm, tilted by up to 8 degrees (3.5 mm at a condyle), shifted by 3 mm.
INSTANTIATE_TEST_SUITE_P(SeparatedAndTilted, KneeStarts,
                         ::testing::Values(Start{0, 38.1e-3, 0}, Start{0, 48e-3, 0}, Start{0, 37.7e-3, 0},
                                           Start{8 * kDegree, 45e-3, 0}, Start{-8 * kDegree, 45e-3, 2e-3},
                                           Start{3 * kDegree, 40e-3, -3e-3}, Start{-5 * kDegree, 42e-3, 3e-3}));

/** Along lines a gap is closed at once, however long, also where the nearest points of tilted bodies are far from where they touch: no distance is asked on the
 way, so that the work does not depend on it. Lowered by distances, the queries of the two longer gaps are 8 and 10 % more. */
TEST(StaticAnalysis, LongGapsCostNoMoreThanShortOnes) {
  const TemporaryFile urdf("knee.urdf", kneeUrdf());
  std::vector<double> queries, heights;
  for (const double y_m : {45e-3, 60e-3, 0.3}) {
    scene::Scene scene = kneeScene(urdf.path());
    scene.model->coordinates[rx] = scene::FreeCoordinate{8 * kDegree};
    scene.model->coordinates[y] = scene::FreeCoordinate{y_m};
    const StaticResult result = runStatic(scene);
    ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
    heights.push_back(result.q[y]);
    queries.push_back(static_cast<double>(result.distanceQueries));
  }
  for (size_t i = 1; i < heights.size(); ++i) {
    EXPECT_NEAR(queries[i], queries[0], 0.01 * queries[0]);  // the pose of touching differs by rounding
    EXPECT_NEAR(heights[i], heights[0], 1e-9);
  }
}

TEST(StaticAnalysis, StartPushedThroughIsLifted) {
  const TemporaryFile urdf("through.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 20);
  const StaticResult reference = settle(scene, Method::newton);
  scene.model->coordinates[Coordinate::y] = scene::FreeCoordinate{20e-3};
  EXPECT_LT(largestDifference(settle(scene, Method::newton).q, reference.q), 1e-10);
}

// Where the tibia stands in ground does not matter: F moves with its link and the joint's origin. The pose goes through
// ground (meters) and back, which costs 1e-16 m of rounding; over 1e5 N/m and up the residual of 1e-6 N is 1e-11 m.
TEST(StaticAnalysis, MovingTheWholeSceneChangesNothing) {
  const TemporaryFile here("here.urdf", kneeUrdf());
  const TemporaryFile there("there.urdf", kneeUrdf(3, "xyz='0.7 -1.1 0.4' rpy='0.5 -1.2 2.0'"));
  const StaticResult a = settle(kneeScene(here.path()), Method::newton);
  const StaticResult b = settle(kneeScene(there.path()), Method::newton);
  EXPECT_LT(largestDifference(a.q, b.q), 1e-10);
  EXPECT_LT((a.contacts[0].total.momentOnM_Fo_F - b.contacts[0].total.momentOnM_Fo_F).norm(), 1e-6);
  EXPECT_NEAR(a.contacts[0].total.energy_J / b.contacts[0].total.energy_J, 1, 1e-8);
}

TEST(StaticAnalysis, LoadFrameAndPointAreRespected) {
  const TemporaryFile urdf("frames.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene.model->coordinates[rz] = scene::PrescribedCoordinate{90 * kDegree};
  // In the femur's axes, turned by 90 degrees about z, the tibia's -y is -x; a point 5 mm along the femur's y lies
  // 5 mm along the tibia's -x of the femur's origin.
  scene::LoadSpec load = verticalLoad(0.0, {0, 5e-3, 0});
  load.frame = "femur";
  load.force_N = {-1000.0, 0.0, 0.0};
  scene.loads.push_back(load);
  scene::LoadSpec push = verticalLoad(0.0);
  push.force_N = {20.0, 0.0, -30.0};
  scene.loads.push_back(push);
  const StaticResult result = settle(scene, Method::newton);
  EXPECT_NEAR(result.contacts[0].total.forceOnM_F.y(), 1000, 1e-5);
  // The constraints hold against the loads: forces opposite to `push`, and the moment of -1000 N at -5 mm, +5 N m.
  EXPECT_NEAR(result.constraintForce[x], -20, 1e-3);
  EXPECT_NEAR(result.constraintForce[z], 30, 1e-3);
  EXPECT_NEAR(result.constraintForce[rz], -5, 1e-3);
  EXPECT_EQ(result.constraintForce[y], 0);
}

TEST(StaticAnalysis, GeneralizedLoadActsOnItsCoordinate) {
  const TemporaryFile urdf("generalized.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene.generalizedLoads.push_back({"push", y, -800.0});
  EXPECT_NEAR(settle(scene, Method::newton).contacts[0].total.forceOnM_F.y(), 800, 1e-5);
  scene.generalizedLoads[0].coordinate = rz;
  EXPECT_THAT(messageOf<InputError>([&] { settle(scene, Method::newton); }),
              AllOf(HasSubstr("load 'push'"), HasSubstr("'rz'"), HasSubstr("prescribed")));
}

TEST(StaticAnalysis, TablesAreReadAtTheGivenTime) {
  const TemporaryFile urdf("time.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene::TimeSeries load{{0, 1}, {-500, -900}, "load.csv, column fy_N"};
  scene.loads.push_back(verticalLoad(load));
  scene.staticAnalysis.emplace().time_s = 0.25;
  EXPECT_NEAR(settle(scene, Method::newton).contacts[0].total.forceOnM_F.y(), 600, 1e-5);
  scene.staticAnalysis->time_s = 1.5;
  EXPECT_THAT(messageOf<InputError>([&] { settle(scene, Method::newton); }),
              AllOf(HasSubstr("load.csv, column fy_N"), HasSubstr("0 s to 1 s")));
}

TEST(StaticAnalysis, ContactNeverMade) {
  const TemporaryFile urdf("never.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene.loads.push_back(verticalLoad(-1000.0));
  scene.model->coordinates[x] = scene::PrescribedCoordinate{60e-3};  // beside the grid
  for (const Method method : {Method::newton, Method::implicitEuler}) {
    EXPECT_THAT(messageOf<ComputationError>([&] { settle(scene, method); }),
                AllOf(HasSubstr("contact is never made"), HasSubstr("grid covers")));
  }
  scene.model->coordinates[x] = scene::PrescribedCoordinate{0.0};
  scene.loads[0] = verticalLoad(1000.0);  // upwards
  for (const Method method : {Method::newton, Method::implicitEuler}) {
    EXPECT_THAT(messageOf<ComputationError>([&] { settle(scene, method); }), HasSubstr("contact is"));
  }
  scene.model->coordinates[y] = scene::PrescribedCoordinate{37e-3};  // 1 mm above, held there
  EXPECT_THAT(messageOf<ComputationError>([&] { settle(scene, Method::newton); }), HasSubstr("contact is never made"));
}

TEST(StaticAnalysis, FullPenetration) {
  const TemporaryFile urdf("full.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.contacts[0].definition.material.E_Pa = 1e3;  // a layer far too soft
  scene.loads.push_back(verticalLoad(-1000.0));
  for (const Method method : {Method::newton, Method::implicitEuler}) {
    EXPECT_THAT(messageOf<ComputationError>([&] { settle(scene, method); }),
                AllOf(HasSubstr("full penetration"), HasSubstr("too soft")));
  }
  scene.model->coordinates[y] = scene::PrescribedCoordinate{20e-3};
  EXPECT_THAT(messageOf<ComputationError>([&] { settle(scene, Method::newton); }), HasSubstr("full penetration"));
}

// A free spin of a sphere about the vertical under a constant torque: nothing holds it.
TEST(StaticAnalysis, NoEquilibriumIsAStatus) {
  const TemporaryFile urdf("spin.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.model->coordinates[ry] = scene::FreeCoordinate{};
  scene.loads.push_back(verticalLoad(-1000.0));
  scene.generalizedLoads.push_back({"torque", ry, 5.0});
  scene.staticAnalysis.emplace().maxTime_s = 1;
  const StaticResult result = settle(scene, Method::newton);
  EXPECT_EQ(result.status, StaticResult::Status::notConverged);
  EXPECT_THAT(result.statusText, AllOf(HasSubstr("no equilibrium"), HasSubstr("free coordinate")));
}

// Without a torque the same coordinate is indifferent: it stays where it is.
TEST(StaticAnalysis, IndifferentCoordinateStays) {
  const TemporaryFile urdf("indifferent.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  scene.model->coordinates[ry] = scene::FreeCoordinate{0.1};
  scene.loads.push_back(verticalLoad(-1000.0));
  const StaticResult result = settle(scene, Method::newton);
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  EXPECT_NEAR(result.q[ry], 0.1, 1e-3);
}

TEST(StaticAnalysis, StopsWhenAsked) {
  const TemporaryFile urdf("stop.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 10);
  int calls = 0;
  const StaticResult result = runStatic(scene, [&](double fraction) {
    EXPECT_GE(fraction, 0);
    EXPECT_LE(fraction, 1);
    return ++calls < 3;
  });
  EXPECT_EQ(result.status, StaticResult::Status::interrupted);
  EXPECT_EQ(calls, 3);
}

TEST(StaticAnalysis, ExtendedSystemSettlesWithItsOwnForces) {
  const TemporaryFile urdf("extended.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path());
  KneeSystem knee(scene);
  // A preloaded spring from the tibia up to the femur's origin pulls it down: F = k (y - length).
  SimTK::Force::TwoPointLinearSpring(knee.forces(), knee.body("tibia"), SimTK::Vec3(0), knee.body("femur"),
                                     SimTK::Vec3(0), 1e5, 0.03);
  const StaticResult result = runStatic(knee, scene);
  ASSERT_EQ(result.status, StaticResult::Status::converged);
  EXPECT_NEAR(result.contacts[0].total.forceOnM_F.y(), 1e5 * (result.q[y] - 0.03), 1e-5);
}

TEST(StaticAnalysis, RepeatsBitForBit) {
  const TemporaryFile urdf("repeat.urdf", kneeUrdf());
  const scene::Scene scene = kneeScene(urdf.path(), 20);
  const StaticResult a = settle(scene, Method::newton), b = settle(scene, Method::newton);
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.residual_N, b.residual_N);
}

/** A body of the lift's slider held by a strut of 12 mm, 10 N/mm, whose foot is 10 mm beside the slider: it snaps to either side, y = +-sqrt(144 - 100) mm,
 where its stiffness along y is k (y/L)^2. Between them, at y = 0, the strut is pressed to 10 mm and pushes away with k (1 - 12/10). */
std::string strutScene(const std::filesystem::path& urdf, const std::string& search) {
  return "genu: 1\nmodel:\n  urdf: " + urdf.string() +
         "\n  joints: {lift: {translation: {free: {start: 4 mm}}}}\nsprings:\n  strut: {stiffness: 10 N/mm, acts: both, "
         "rest: {length: 12 mm}, path: [{body: ground, at: \"10 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 0 mm, 0 mm\"}]}\n"
         "analysis: {static: {search: " +
         search + "}}\n";
}

TEST(StaticAnalysis, SearchFindsTheOtherEquilibrium) {
  const TemporaryFile urdf("strut.urdf", testing_support::liftUrdf());
  const TemporaryFile yaml("strut.yaml", strutScene(urdf.path(), "{starts: 20, translation: 15 mm}"));
  const StaticResult result = runStatic(scene::readScene(yaml.path(), {{}, true, {}}));
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  const double y = std::sqrt(144e-6 - 100e-6), k = 1e4 * 44 / 144;
  EXPECT_NEAR(result.q[0], y, 1e-9);  // 1e-6 N over 3 N/mm
  ASSERT_EQ(result.stiffness_NPerM.size(), 1u);
  EXPECT_NEAR(result.stiffness_NPerM[0], k, 1e-4 * k);  // differences of 10 nm
  ASSERT_TRUE(result.search);
  EXPECT_EQ(result.search->starts, 20);
  EXPECT_EQ(result.search->converged, 20);
  EXPECT_TRUE(result.search->failures.empty());
  ASSERT_EQ(result.search->others.size(), 2u);
  const StaticResult::Equilibrium &other = result.search->others[0], &between = result.search->others[1];
  EXPECT_NEAR(other.q[0], -y, 1e-9);
  EXPECT_NEAR(other.stiffness_NPerM[0], k, 1e-4 * k);
  EXPECT_FALSE(other.unstable);
  EXPECT_NEAR(between.q[0], 0, 1e-9);
  EXPECT_NEAR(between.stiffness_NPerM[0], -2e3, 1);  // N/m
  EXPECT_TRUE(between.unstable);
  EXPECT_EQ(result.search->backToFirst + other.starts + between.starts, 20);
  EXPECT_THAT(result.statusText, HasSubstr("2 other equilibria found"));
}

// A search that may take no time, or that the user ends, hands back what it has; the equilibrium itself stands.
TEST(StaticAnalysis, SearchEndsWithWhatItHas) {
  const TemporaryFile urdf("strut.urdf", testing_support::liftUrdf());
  const TemporaryFile yaml("strut.yaml", strutScene(urdf.path(), "{starts: 20, translation: 15 mm, max_wall_time: 1e-9 s}"));
  scene::Scene scene = scene::readScene(yaml.path(), {{}, true, {}});
  const StaticResult late = runStatic(scene);
  EXPECT_EQ(late.status, StaticResult::Status::converged);
  EXPECT_FALSE(late.search->complete);
  EXPECT_EQ(late.search->starts, 0);
  EXPECT_THAT(late.statusText, HasSubstr("search ended after 0 of 20 starts: search.max_wall_time of 1e-09 s is over"));
  scene.staticAnalysis->search->maxWallTime_s = 600;
  double last = 0;
  const StaticResult stopped = runStatic(scene, [&last](double share) {
    EXPECT_GE(share, last - 0.05);  // within a start it may fall back
    last = std::max(last, share);
    return share < 0.5;
  });
  EXPECT_EQ(stopped.status, StaticResult::Status::converged);
  EXPECT_FALSE(stopped.search->complete);
  EXPECT_GT(stopped.search->starts, 5);
  EXPECT_LT(stopped.search->starts, 15);
  EXPECT_EQ(stopped.search->stopped, "interrupted");
}

// Spun about the vertical a ball stays where it is put: one family of equilibria, not one for every start.
TEST(StaticAnalysis, AFamilyOfEquilibriaIsFoundOnce) {
  const TemporaryFile urdf("family.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.model->coordinates[ry] = scene::FreeCoordinate{0.1};
  scene.loads.push_back(verticalLoad(-1000.0));
  scene.staticAnalysis.emplace().search.emplace().starts = 6;
  const StaticResult result = runStatic(scene);
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  EXPECT_EQ(result.search->converged, 6);
  EXPECT_EQ(result.search->others.size(), 0u);
}

TEST(StaticAnalysis, SearchNeedsAFreeCoordinate) {
  const TemporaryFile urdf("held.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.model->coordinates[y] = scene::PrescribedCoordinate{35.8e-3};
  scene.staticAnalysis.emplace().search.emplace();
  EXPECT_THAT(messageOf<InputError>([&] { runStatic(scene); }), HasSubstr("analysis.static.search: no coordinate is free"));
}

/** A conforming insert that is bistable: two spherical dishes, radius 25 mm, that meet in a ridge 3.5 mm beside the lowest point of each; on it a ball of 20 mm under a vertical
 load W, free to translate. Layers of constant thickness h and no correction: a pressure k d along the line to the ball's centre C, k = K/h, which is a gradient. With D the largest
 penetration, s the distance of an element from C, and e = Rd - R + D that of C from a dish's centre (s ds = Rd e sin(angle) d(angle)), the energy of a dish that contact does not leave is

   U(e) = k/2 int d^2 dA = pi k Rd/e int_0^D t^2 (R - t) dt = pi k Rd/e (R D^3/3 - D^4/4),

 central: at a dish's lowest point the ball is in equilibrium where U'(e) = W, with stiffness U''(e) vertically and W/e along both horizontals. By the symmetry about the plane of the
 ridge and that across it there is one more equilibrium on top of the ridge. */
struct Bistable {
  static constexpr double kBall_m = 20e-3, kDish_m = 25e-3, kBeside_m = 3.5e-3, kLayer_m = 6e-3, kW_N = 200, kTop_m = kLayer_m + kDish_m;

  static scene::Scene scene(const std::filesystem::path& urdf, double startX_m, double startZ_m) {
    scene::Scene scene = sphereScene(urdf, 20, contact::Correction::none);
    for (const Coordinate c : {x, y, z}) scene.model->coordinates[c] = scene::FreeCoordinate{};
    std::get<scene::FreeCoordinate>(scene.model->coordinates[x]).start = startX_m;
    std::get<scene::FreeCoordinate>(scene.model->coordinates[z]).start = startZ_m;
    scene.contacts[0].definition.compartments.clear();
    for (const double side : {1.0, -1.0}) {
      contact::CompartmentDefinition& part = scene.contacts[0].definition.compartments.emplace_back();
      part.name = side > 0 ? "left" : "right";
      part.x0_m = -17e-3;
      part.x1_m = 17e-3;
      part.z0_m = side > 0 ? 0 : -20e-3;
      part.z1_m = side > 0 ? 20e-3 : 0;
      part.nx = 68;
      part.nz = 60;
      part.fixedSurface = testing_support::makeSurface(contact::makeDish(kLayer_m, kDish_m, kDish_m, contact::Solid::below, 24e-3), {0, 0, side * kBeside_m});
      part.movingSurface = testing_support::makeSurface(contact::makeSphere(kBall_m));
    }
    scene.loads.push_back(verticalLoad(-kW_N));
    scene.staticAnalysis.emplace().search = scene::StaticSpec::Search{12, 8e-3, 0.1};
    return scene;
  }

  static double k() { return 2140.582192e6 / kLayer_m; }
  /** U' and U''. */
  static std::pair<double, double> differentiate(double e) {
    const double R = kBall_m, D = e - (kDish_m - R), c = contact::kPi * k() * kDish_m;
    const double g = R * D * D * D / 3 - D * D * D * D / 4, g1 = R * D * D - D * D * D, g2 = 2 * R * D - 3 * D * D;
    return {c * (g1 / e - g / (e * e)), c * (g2 / e - 2 * g1 / (e * e) + 2 * g / (e * e * e))};
  }
  static double distanceInDish() {
    double low = kDish_m - kBall_m, high = low + 1e-3;
    for (int i = 0; i < 60; ++i) (differentiate(0.5 * (low + high)).first < kW_N ? low : high) = 0.5 * (low + high);
    return low;
  }

  struct Sums {
    double force_N = 0, alongX = 0, alongZ = 0, vertical = 0;
  };
  /** Force and stiffness of the ball on the ridge, at height y, by a sum over the dish on one side, doubled: stiffness k int (u u^T - d/s (1 - u u^T)) dA, u = (C - A)/s. */
  static Sums sumOnRidge(double y) {
    constexpr int kN = 500;
    constexpr double kX_m = 10e-3, kZ_m = 4e-3;
    Sums sums;
    for (int i = 0; i < kN; ++i) {
      for (int j = 0; j < kN; ++j) {
        const double px = kX_m * (i + 0.5) / kN, pz = kZ_m * (j + 0.5) / kN, beside = pz - kBeside_m;
        const double drop = std::sqrt(kDish_m * kDish_m - px * px - beside * beside), py = kTop_m - drop;
        const double s = std::sqrt(px * px + (y - py) * (y - py) + pz * pz), d = kBall_m - s;
        if (d <= 0) continue;
        const double kdA = 4 * k() * kDish_m / drop * (kX_m / kN) * (kZ_m / kN);  // of four quarters
        const double ux = px / s, uy = (y - py) / s, uz = pz / s;
        sums.force_N += kdA * d * uy;
        sums.alongX += kdA * (ux * ux - d / s * (1 - ux * ux));
        sums.vertical += kdA * (uy * uy - d / s * (1 - uy * uy));
        sums.alongZ += kdA * (uz * uz - d / s * (1 - uz * uz));
      }
    }
    return sums;
  }
};

// A dozen cells across each contact, whose forces err with their fourth power: observed 1e-4 of a stiffness on the ridge, which the grid's border follows, and 1e-5 in the dishes; poses by 1 nm.
TEST(BistableInsert, SearchFindsBothRestsAndTheRidgeBetween) {
  const TemporaryFile urdf("bistable.urdf", kneeUrdf());
  const double e = Bistable::distanceInDish(), tangential = Bistable::kW_N / e, radial = Bistable::differentiate(e).second;
  double low = 27e-3, high = 24e-3;
  for (int i = 0; i < 30; ++i) (Bistable::sumOnRidge(0.5 * (low + high)).force_N < Bistable::kW_N ? low : high) = 0.5 * (low + high);
  const Bistable::Sums ridge = Bistable::sumOnRidge(low);
  // A rigid ball would have -W/R; the width of the contact holds this one a little.
  EXPECT_LT(ridge.alongZ, -0.5 * Bistable::kW_N / Bistable::kBall_m);
  EXPECT_GT(ridge.alongZ, -1.02 * Bistable::kW_N / Bistable::kBall_m);

  for (const auto& [startX, startZ] : {std::pair{0.0, 0.5e-3}, {2e-3, 7e-3}, {-1e-3, -0.5e-3}, {0.5e-3, -6e-3}, {0.0, 0.0}}) {
    SCOPED_TRACE(startZ);
    const StaticResult result = runStatic(Bistable::scene(urdf.path(), startX, startZ));
    ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
    ASSERT_TRUE(result.search->complete);
    EXPECT_EQ(result.search->converged, 12) << (result.search->failures.empty() ? "" : result.search->failures[0]);
    std::vector<StaticResult::Equilibrium> all = result.search->others;
    all.push_back({result.q, result.stiffness_NPerM, result.unstable, 0});
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.q[z] < b.q[z]; });
    ASSERT_EQ(all.size(), 3u);
    for (const size_t side : {0u, 2u}) {
      EXPECT_FALSE(all[side].unstable);
      EXPECT_NEAR(all[side].q[z], side == 0 ? -Bistable::kBeside_m : Bistable::kBeside_m, 1e-8);
      EXPECT_NEAR(all[side].q[x], 0, 1e-8);
      EXPECT_NEAR(all[side].q[y], Bistable::kTop_m - e, 1e-8);
      EXPECT_NEAR(all[side].stiffness_NPerM[0] / tangential, 1, 1e-4);
      EXPECT_NEAR(all[side].stiffness_NPerM[1] / tangential, 1, 1e-4);
      EXPECT_NEAR(all[side].stiffness_NPerM[2] / radial, 1, 1e-4);
    }
    EXPECT_TRUE(all[1].unstable);
    EXPECT_NEAR(all[1].q[z], 0, 1e-9);
    EXPECT_NEAR(all[1].q[x], 0, 1e-9);
    EXPECT_NEAR(all[1].q[y], low, 1e-8);
    EXPECT_NEAR(all[1].stiffness_NPerM[0] / ridge.alongZ, 1, 1e-3);
    EXPECT_NEAR(all[1].stiffness_NPerM[1] / ridge.alongX, 1, 1e-3);
    EXPECT_NEAR(all[1].stiffness_NPerM[2] / ridge.vertical, 1, 1e-3);
  }
}

TEST(StaticAnalysis, NeedsAModel) {
  scene::Scene scene;
  scene.file = "contact.yaml";
  EXPECT_THAT(messageOf<InputError>([&] { runStatic(scene); }), AllOf(HasSubstr("contact.yaml"), HasSubstr("'model'")));
}

}  // namespace
}  // namespace genu::model
