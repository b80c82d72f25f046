#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "KneeFixtures.h"
#include "genu/model/Analysis.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {
namespace {

using namespace testing_support;
using ::testing::AllOf;
using ::testing::HasSubstr;

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

/** The first fifth of the gait cycle on a coarse grid. */
scene::Scene shortGait(const std::filesystem::path& urdf) {
  scene::Scene scene = kneeScene(urdf, 15);
  addGait(scene);
  scene.gait->duration_s = 0.2;
  return scene;
}

// y'' = -w^2 y exactly, by the integrator alone: second order, so the error follows the tolerance to the power 2/3 or
// better; after one period it must stay below 200 local errors of 1e-7.
TEST(OdeIntegrator, CPodesFollowsAnOscillator) {
  class Oscillator : public OdeProblem {
   public:
    int size() const override { return 2; }
    Evaluation evaluate(double, const double* y, double* ydot) noexcept override {
      ydot[0] = y[1];
      ydot[1] = -100 * y[0];
      return Evaluation::ok;
    }
    const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
    std::vector<double> tolerances_ = {1e-7, 1e-6};
  } problem;
  const auto integrator = makeOdeIntegrator("cpodes", problem, {}, "test");
  ASSERT_TRUE(integrator->initialize(0, {1, 0}, 0.6)) << integrator->errorText();
  std::vector<double> y;
  double largest = 0;
  while (integrator->time() < 0.6) {
    ASSERT_TRUE(integrator->step()) << integrator->errorText();
    integrator->interpolate(integrator->time(), y);
    largest = std::max(largest, std::abs(y[0] - std::cos(10 * integrator->time())));
  }
  EXPECT_DOUBLE_EQ(integrator->time(), 0.6) << "the stop time is not passed";
  EXPECT_LT(largest, 2e-4);
  EXPECT_GT(integrator->statistics().stepsTaken, 100);
}

TEST(OdeIntegrator, FailureIsReportedNotThrown) {
  class Wall : public OdeProblem {
   public:
    int size() const override { return 1; }
    Evaluation evaluate(double, const double* y, double* ydot) noexcept override {
      ydot[0] = 1;
      return y[0] > 0.5 ? Evaluation::retry : Evaluation::ok;
    }
    const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
    std::vector<double> tolerances_ = {1e-6};
  } problem;
  const auto integrator = makeOdeIntegrator("cpodes", problem, {}, "test");
  ASSERT_TRUE(integrator->initialize(0, {0}, 1));
  bool going = true;
  for (int i = 0; i < 10000 && going; ++i) going = integrator->step();
  EXPECT_FALSE(going);
  EXPECT_FALSE(integrator->errorText().empty());
  EXPECT_NEAR(integrator->time(), 0.5, 0.01);
}

TEST(OdeIntegrator, UnknownNameListsTheKnownOnes) {
  const TemporaryFile urdf("unknown.urdf", kneeUrdf());
  scene::Scene scene = shortGait(urdf.path());
  scene.gait->integrator = "dassl";
  EXPECT_THAT(messageOf<InputError>([&] { runGait(scene); }),
              AllOf(HasSubstr("knee.yaml"), HasSubstr("\"dassl\""), HasSubstr("known: cpodes")));
}

// Small vibration of the sphere about D0: k = dF/dD = (2 pi K/h)(R D - D^2). Amplitude a = D0/100 changes the period by
// about (a/D0)^2/24 < 1e-5; whole cells change the stiffness by up to 1 % at 60 x 60, half of that in the frequency.
TEST(GaitAnalysis, SphereVibratesWithTheContactStiffness) {
  const TemporaryFile urdf("vibration.urdf", kneeUrdf(3));
  scene::Scene scene = sphereScene(urdf.path(), 60);
  const double K = 2140.582192e6, h = 6e-3, R = 0.03, D = 0.2e-3, amplitude = D / 100;
  scene.loads.push_back(verticalLoad(-contact::kPi * K * D * D / h * (R - 2 * D / 3)));
  const double center = runStatic(scene).q[y];
  scene.model->coordinates[y] = scene::FreeCoordinate{center + amplitude};
  const double omega = std::sqrt(2 * contact::kPi * K / h * (R * D - D * D) / 3), period = 2 * contact::kPi / omega;
  scene::GaitSpec& gait = scene.gait.emplace();
  gait.settleFirst = false;
  gait.duration_s = 2 * period;
  gait.outputInterval_s = period / 40;
  gait.accuracy = 1e-8;
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  EXPECT_FALSE(result.settling);
  ASSERT_EQ(result.frames.size(), 81u);
  for (const scene::Frame& frame : result.frames) {
    EXPECT_NEAR((frame.q[y] - center) / amplitude, std::cos(omega * frame.time_s), 2 * contact::kPi * 2 * 0.005);
  }
}

/** The start follows the equilibrium without ringing: its acceleration is that of the path z_e of the equilibrium, y'' = z_e'' (1 + O((W/w)^2)), W the load's and
 w the contact's angular frequency; a start in the equilibrium itself would swing between none and twice that. Here (W/w)^2 < 0.005; second differences of z_e
 over the 0.5 ms of the output add (W h)^2 / 12 < 1e-4. */
TEST(GaitAnalysis, StartsWithoutRinging) {
  const TemporaryFile urdf("knee.urdf", kneeUrdf(3.0));
  scene::Scene scene = sphereScene(urdf.path());
  scene::TimeSeries load;
  load.source = "load";
  const double frequency = 2 * contact::kPi * 15;
  for (int i = 0; i <= 60; ++i) {
    load.time_s.push_back(1e-3 * i);
    load.value.push_back(-1000 - 300 * std::cos(frequency * load.time_s.back()));
  }
  scene.loads.push_back(verticalLoad(load));
  scene::GaitSpec& gait = scene.gait.emplace();
  gait.duration_s = 0.02;
  gait.outputInterval_s = 5e-4;
  gait.accuracy = 1e-7;
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  std::vector<double> equilibrium;
  for (const scene::Frame& frame : result.frames) {
    scene.staticAnalysis.emplace();
    scene.staticAnalysis->time_s = frame.time_s;
    scene.staticAnalysis->maxResidual_N = 1e-6;
    equilibrium.push_back(runStatic(scene).q[y]);
  }
  double largest = 0, worst = 0;
  for (size_t i = 1; i + 1 < equilibrium.size(); ++i) {
    const double path = (equilibrium[i - 1] - 2 * equilibrium[i] + equilibrium[i + 1]) / (gait.outputInterval_s * gait.outputInterval_s);
    largest = std::max(largest, std::abs(path));
    worst = std::max(worst, std::abs(result.frames[i].qddot[y] - path));
  }
  EXPECT_GT(largest, 0.1);  // [m/s^2]: the residual of the equilibria, 1e-6 N / 1e7 N/m over (0.5 ms)^2, is 4e-7 of it
  EXPECT_LT(worst, 0.02 * largest);
}

TEST(GaitAnalysis, PrescribedCoordinatesFollowTheirCurves) {
  const TemporaryFile urdf("prescribed.urdf", kneeUrdf());
  const scene::Scene scene = shortGait(urdf.path());
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  ASSERT_EQ(result.frames.size(), 21u);
  EXPECT_DOUBLE_EQ(result.frames.back().time_s, 0.2);
  for (const Coordinate i : {ry, rz, x}) {
    const TimeCurve curve(std::get<scene::PrescribedCoordinate>(scene.model->coordinates[i]).motion);
    for (const scene::Frame& frame : result.frames) {
      EXPECT_DOUBLE_EQ(frame.q[i], curve.calcValue(frame.time_s));
      EXPECT_DOUBLE_EQ(frame.qdot[i], curve.calcDerivative(frame.time_s, 1));
      // The second derivative comes back through Simbody's constraint equations.
      EXPECT_NEAR(frame.qddot[i], curve.calcDerivative(frame.time_s, 2), 1e-9 * (1 + std::abs(frame.qddot[i])));
    }
  }
  EXPECT_GT(result.statistics.stepsTaken, 10);
  EXPECT_GE(result.statistics.stepsAttempted, result.statistics.stepsTaken);
  EXPECT_GT(result.statistics.contactEvaluations, result.statistics.stepsTaken);
  EXPECT_EQ(result.statistics.name, "cpodes");
  ASSERT_TRUE(result.settling);
  EXPECT_EQ(result.settling->status, StaticResult::Status::converged);
  // Inertia puts the start beside the equilibrium, by 0.1 mm at most.
  for (const Coordinate i : {rx, y, z}) EXPECT_NEAR(result.settling->q[i], result.frames.front().q[i], i == rx ? 1e-4 / kAngleLength_m : 1e-4);
}

// y prescribed: m y'' = contact + load + constraint force, with the mass at the joint's origin.
TEST(GaitAnalysis, ConstraintForceBalancesLoadContactAndInertia) {
  const TemporaryFile urdf("balance.urdf", kneeUrdf(3, "xyz='0 0 0' rpy='0 0 0'", "xyz='0 0 0'"));
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene::TimeSeries motion;
  for (int i = 0; i <= 40; ++i) {
    motion.time_s.push_back(i * 0.0025);
    motion.value.push_back(35.85e-3 + 0.1e-3 * std::sin(100 * i * 0.0025));
  }
  scene.model->coordinates[y] = scene::PrescribedCoordinate{motion};
  scene.model->coordinates[z] = scene::FreeCoordinate{};
  scene.loads.push_back(verticalLoad(-250.0));
  scene.gait.emplace().duration_s = 0.1;
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  for (const scene::Frame& frame : result.frames) {
    const double contact = frame.contacts[0].total.forceOnM_F.y();
    EXPECT_NEAR(frame.constraintForce[y], 3 * frame.qddot[y] - contact + 250, 1e-8 * (contact + 250));
    EXPECT_EQ(frame.constraintForce[z], 0);
  }
}

TEST(GaitAnalysis, AllPrescribedIsInverseDynamics) {
  const TemporaryFile urdf("inverse.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.model->coordinates[y] = scene::PrescribedCoordinate{35.8e-3};
  scene.gait.emplace().duration_s = 0.05;
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  ASSERT_EQ(result.frames.size(), 6u);
  EXPECT_EQ(result.statistics.stepsTaken, 0);
  const double contact = result.frames[3].contacts[0].total.forceOnM_F.y();
  EXPECT_GT(contact, 1000);
  EXPECT_NEAR(result.frames[3].constraintForce[y], -contact, 1e-9 * contact);
}

// Default accuracy against a run a hundred times tighter. BDF of order 2 damps the undamped contact modes numerically,
// so the difference is not the local tolerance of 1e-4 mm alone: a micrometer in height and tilt, 1 % of a body weight
// in the force.
TEST(GaitAnalysis, DefaultAccuracyIsWithinAMicrometerOfATightRun) {
  const TemporaryFile urdf("accuracy.urdf", kneeUrdf());
  scene::Scene scene = shortGait(urdf.path());
  const GaitResult standard = runGait(scene);
  scene.gait->accuracy = 1e-6;
  const GaitResult tight = runGait(scene);
  ASSERT_EQ(standard.frames.size(), tight.frames.size());
  EXPECT_GT(tight.statistics.stepsTaken, 2 * standard.statistics.stepsTaken);
  for (size_t i = 0; i < tight.frames.size(); ++i) {
    EXPECT_NEAR(standard.frames[i].q[y], tight.frames[i].q[y], 1e-6);
    EXPECT_NEAR(standard.frames[i].q[rx] * kAngleLength_m, tight.frames[i].q[rx] * kAngleLength_m, 2e-6);
    EXPECT_NEAR(standard.frames[i].contacts[0].total.scalarForce_N, tight.frames[i].contacts[0].total.scalarForce_N, 7);
  }
}

TEST(GaitAnalysis, RepeatsBitForBit) {
  const TemporaryFile urdf("gaitrepeat.urdf", kneeUrdf());
  const scene::Scene scene = shortGait(urdf.path());
  const GaitResult a = runGait(scene), b = runGait(scene);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].q, b.frames[i].q);
    EXPECT_EQ(a.frames[i].qddot, b.frames[i].qddot);
    EXPECT_EQ(a.frames[i].contacts[0].total.forceOnM_F, b.frames[i].contacts[0].total.forceOnM_F);
  }
}

// Same grid, same poses: the run's own results, up to the warm start (1e-12) and the way through ground.
TEST(GaitAnalysis, ReplayOnTheSameGridReturnsTheRunsContact) {
  const TemporaryFile urdf("replay.urdf", kneeUrdf(3, "xyz='0.1 0.9 0.2' rpy='0.1 0 -0.3'"));
  const scene::Scene scene = shortGait(urdf.path());
  const GaitResult run = runGait(scene);
  std::vector<double> time;
  std::vector<scene::Coordinates> q;
  for (const scene::Frame& frame : run.frames) {
    time.push_back(frame.time_s);
    q.push_back(frame.q);
  }
  const scene::Trajectory again = replay(time, q, scene);
  ASSERT_TRUE(again.complete);
  ASSERT_EQ(again.frames.size(), run.frames.size());
  for (size_t i = 0; i < q.size(); ++i) {
    const contact::NetLoad& a = run.frames[i].contacts[0].total;
    const contact::NetLoad& b = again.frames[i].contacts[0].total;
    EXPECT_NEAR(a.scalarForce_N / b.scalarForce_N, 1, 1e-9);
    EXPECT_NEAR(a.peakPressure_Pa / b.peakPressure_Pa, 1, 1e-9);
    EXPECT_NEAR(a.energy_J / b.energy_J, 1, 1e-9);
    EXPECT_EQ(a.activeElements, b.activeElements);
  }
  // A finer grid: same force to the grid's error, 3 % for 15 x 15 whole cells.
  scene::Scene fine = scene;
  for (contact::CompartmentDefinition& part : fine.contacts[0].definition.compartments) part.nx = part.nz = 50;
  const scene::Trajectory finer = replay(time, q, fine);
  EXPECT_NEAR(finer.frames[10].contacts[0].total.scalarForce_N / run.frames[10].contacts[0].total.scalarForce_N, 1,
              0.03);
}

TEST(GaitAnalysis, ReplayEstimatesTheErrorsOfItsGridUnlessToldNotTo) {
  scene::Scene coarse = sphereScene("");
  coarse.model.reset();
  scene::Scene fine = coarse;
  for (contact::CompartmentDefinition& part : coarse.contacts[0].definition.compartments) part.nx = part.nz = 12;
  for (contact::CompartmentDefinition& part : fine.contacts[0].definition.compartments) part.nx = part.nz = 120;
  std::vector<double> time;
  std::vector<scene::Coordinates> q;
  for (int i = 0; i < 40; ++i) {
    time.push_back(0.1 * i);
    q.push_back({0, 0, 0, 2e-5 * i, 35.95e-3 - 5e-6 * i, 1e-5 * i});
  }
  const scene::Trajectory a = replay(time, q, coarse), b = replay(time, q, fine, {}, false);
  int covered = 0;
  for (size_t i = 0; i < q.size(); ++i) {
    ASSERT_EQ(a.frames[i].errors.size(), a.frames[i].contacts.size());
    EXPECT_TRUE(b.frames[i].errors.empty());
    const double error = (a.frames[i].contacts[0].total.forceOnM_F - b.frames[i].contacts[0].total.forceOnM_F).norm();
    EXPECT_GT(a.frames[i].errors[0].total.force_N, 0);
    covered += error <= a.frames[i].errors[0].total.force_N;
  }
  EXPECT_GE(covered, 38);  // 95 %
}

TEST(GaitAnalysis, ReplayChecksItsInputAndStopsWhenAsked) {
  scene::Scene scene = sphereScene("");
  scene.model.reset();
  const std::vector<scene::Coordinates> q(3, {0, 0, 0, 0, 35.8e-3, 0});
  EXPECT_THAT(messageOf<InputError>([&] { replay({0, 1}, q, scene); }), HasSubstr("2 times but 3 poses"));
  EXPECT_THAT(messageOf<InputError>([&] { replay({0, 1, std::nan("")}, q, scene); }), HasSubstr("frame 3"));
  const scene::Trajectory part = replay({0, 1, 2}, q, scene, [](double fraction) { return fraction < 0.5; });
  EXPECT_FALSE(part.complete);
  EXPECT_FALSE(part.failed);
  EXPECT_EQ(part.frames.size(), 2u);
  scene.contacts[0].movingBody = "femur";
  EXPECT_THAT(messageOf<InputError>([&] { replay({0, 1, 2}, q, scene); }), HasSubstr("no model section"));
}

TEST(GaitAnalysis, StopsWhenAskedWithWhatItHas) {
  const TemporaryFile urdf("gaitstop.urdf", kneeUrdf());
  const scene::Scene scene = shortGait(urdf.path());
  const GaitResult result = runGait(scene, [](double fraction) { return fraction < 0.5; });
  EXPECT_FALSE(result.complete);
  EXPECT_FALSE(result.failed);
  EXPECT_THAT(result.statusText, HasSubstr("interrupted at t = 0.1"));
  EXPECT_GE(result.frames.size(), 10u);
  EXPECT_LT(result.frames.size(), 21u);
}

TEST(GaitAnalysis, FullPenetrationEndsTheRunWithWhatItHas) {
  const TemporaryFile urdf("gaitfull.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.loads.push_back(verticalLoad(scene::TimeSeries{{0, 0.1}, {-1e3, -1e9}, "load"}));
  scene.gait.emplace().duration_s = 0.1;
  const GaitResult result = runGait(scene);
  EXPECT_TRUE(result.failed);
  EXPECT_FALSE(result.complete);
  EXPECT_THAT(result.statusText, AllOf(HasSubstr("failed at t ="), HasSubstr("penetration"), HasSubstr("too soft")));
  EXPECT_GE(result.frames.size(), 1u);
}

TEST(GaitAnalysis, ContactNeverMade) {
  const TemporaryFile urdf("gaitnever.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 20);
  scene.model->coordinates[y] = scene::FreeCoordinate{40e-3};
  scene.loads.push_back(verticalLoad(10.0));  // upwards
  scene.gait.emplace().duration_s = 0.05;
  scene.gait->settleFirst = false;
  EXPECT_THAT(messageOf<ComputationError>([&] { runGait(scene); }), HasSubstr("contact is never made during the run"));
  scene.gait->settleFirst = true;
  EXPECT_THAT(messageOf<ComputationError>([&] { runGait(scene); }), HasSubstr("contact is"));
}

TEST(GaitAnalysis, RejectsBadSettingsAndShortTables) {
  const TemporaryFile urdf("gaitbad.urdf", kneeUrdf());
  scene::Scene scene = shortGait(urdf.path());
  scene.gait->duration_s = 1.2;
  EXPECT_THAT(messageOf<InputError>([&] { runGait(scene); }), AllOf(HasSubstr("0 s to 1 s"), HasSubstr("1.2 s")));
  scene.gait->duration_s = -1;
  EXPECT_THAT(messageOf<InputError>([&] { runGait(scene); }), HasSubstr("analysis.gait.duration: is -1 s; allowed: > 0"));
  scene.gait->duration_s = 0.1;
  scene.gait->accuracy = 0;
  EXPECT_THAT(messageOf<InputError>([&] { runGait(scene); }), HasSubstr("analysis.gait.accuracy: is 0; allowed: > 0"));
}

}  // namespace
}  // namespace genu::model
