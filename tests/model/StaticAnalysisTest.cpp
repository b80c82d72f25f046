#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
 where its stiffness along y is k (y/L)^2. */
TEST(StaticAnalysis, SearchFindsTheOtherEquilibrium) {
  const TemporaryFile urdf("strut.urdf", testing_support::liftUrdf());
  const TemporaryFile yaml("strut.yaml", "genu: 1\nmodel:\n  urdf: " + urdf.path().string() +
                                             "\n  joints: {lift: {translation: {free: {start: 4 mm}}}}\nsprings:\n  strut: {stiffness: 10 N/mm, acts: both, "
                                             "rest: {length: 12 mm}, path: [{body: ground, at: \"10 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 0 mm, 0 mm\"}]}\n"
                                             "analysis: {static: {search: {starts: 20, translation: 15 mm}}}\n");
  const StaticResult result = runStatic(scene::readScene(yaml.path(), {{}, true, {}}));
  ASSERT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  const double y = std::sqrt(144e-6 - 100e-6), k = 1e4 * 44 / 144;
  EXPECT_NEAR(result.q[0], y, 1e-9);  // 1e-6 N over 3 N/mm
  ASSERT_EQ(result.stiffness_NPerM.size(), 1u);
  EXPECT_NEAR(result.stiffness_NPerM[0], k, 1e-4 * k);  // differences of 10 nm
  ASSERT_TRUE(result.search);
  EXPECT_EQ(result.search->starts, 20);
  EXPECT_EQ(result.search->converged, 20);
  ASSERT_EQ(result.search->others.size(), 1u);
  EXPECT_NEAR(result.search->others[0].q[0], -y, 1e-9);
  EXPECT_NEAR(result.search->others[0].stiffness_NPerM[0], k, 1e-4 * k);
  EXPECT_THAT(result.statusText, ::testing::HasSubstr("1 other equilibrium found"));
}

TEST(StaticAnalysis, NeedsAModel) {
  scene::Scene scene;
  scene.file = "contact.yaml";
  EXPECT_THAT(messageOf<InputError>([&] { runStatic(scene); }), AllOf(HasSubstr("contact.yaml"), HasSubstr("'model'")));
}

}  // namespace
}  // namespace genu::model
