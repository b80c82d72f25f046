#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <random>

#include "../../src/model/KneeOde.h"
#include "ElementFixtures.h"

namespace genu::model {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Each;
using testing_support::addGait;
using testing_support::kneeScene;
using testing_support::kneeUrdf;
using testing_support::liftUrdf;
using testing_support::TemporaryFile;
using Prescribed = scene::GaitSpec::Prescribed;

struct Ode {
  Ode(const scene::Scene& scene, KneeOde::Prescribed prescribed) : knee(scene) {
    SimTK::State state = knee.system().realizeTopology();
    knee.system().realizeModel(state);
    ode = std::make_unique<KneeOde>(knee, state, OdeTolerances::of(1e-4), prescribed);
  }
  KneeSystem knee;
  std::unique_ptr<KneeOde> ode;
};

scene::Scene gaitScene(const std::filesystem::path& urdf, int cells = 12) {
  scene::Scene scene = kneeScene(urdf, cells);
  addGait(scene);
  return scene;
}

/** A pose at time 0 near equilibrium, moving. */
scene::Coordinates poseOf(const scene::Scene& scene) {
  const StaticResult rest = runStatic(scene);
  EXPECT_EQ(rest.status, StaticResult::Status::converged) << rest.statusText;
  return rest.q;
}

// One state, two descriptions: what holds the prescribed coordinates is the multiplier of the constraint, or what inverse dynamics asks for. Equal up to
// rounding of the largest force, 1e4 N on 2 m.
TEST(Constraints, ReactionLoadsAreThoseOfElimination) {
  const TemporaryFile urdf("reactions.urdf", kneeUrdf());
  const scene::Scene scene = gaitScene(urdf.path());
  const scene::Coordinates q = poseOf(scene);
  scene::Coordinates qdot(6, 0.0);
  qdot[testing_support::y] = 0.02;
  qdot[testing_support::rx] = -0.3;
  Ode eliminated(scene, KneeOde::Prescribed::eliminated), constrained(scene, KneeOde::Prescribed::constraints);
  EXPECT_EQ(eliminated.ode->size(), 6);
  EXPECT_EQ(constrained.ode->size(), 12);
  EXPECT_EQ(constrained.ode->numConstraints(), 3);
  scene::Frame a, b;
  ASSERT_TRUE(eliminated.ode->makeFrame(0, eliminated.ode->start(q, qdot), a));
  ASSERT_TRUE(constrained.ode->makeFrame(0, constrained.ode->start(q, qdot), b));
  double largest = 0;
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(a.q[i], b.q[i], 1e-14);
    EXPECT_NEAR(a.qddot[i], b.qddot[i], 1e-8 * (1 + std::abs(a.qddot[i])));
    EXPECT_NEAR(a.constraintForce[i], b.constraintForce[i], 1e-8 * (1 + std::abs(a.constraintForce[i])));
    largest = std::max(largest, std::abs(a.constraintForce[i]));
  }
  EXPECT_GT(largest, 1);
}

// Steps as in Jacobian.OfAKneeIsThatOfDifferences; c = 1e4/s weighs rates as a step of 0.1 ms does.
TEST(Constraints, JacobianOfTheResidualIsThatOfDifferences) {
  const TemporaryFile urdf("residual.urdf", kneeUrdf());
  const scene::Scene scene = gaitScene(urdf.path());
  Ode knee(scene, KneeOde::Prescribed::constraints);
  scene::Coordinates qdot(6, 0.01);
  std::vector<double> y = knee.ode->start(poseOf(scene), qdot);
  const int n = knee.ode->size(), all = n + 2 * knee.ode->numConstraints();
  std::vector<double> rate(static_cast<size_t>(n)), multipliers(static_cast<size_t>(all - n));
  ASSERT_EQ(knee.ode->calcMultipliers(0, y.data(), rate.data(), multipliers.data()), OdeProblem::Evaluation::ok);
  Eigen::VectorXd r(all), more(all), less(all);
  ASSERT_EQ(knee.ode->calcResidual(0, y.data(), rate.data(), multipliers.data(), r.data()), OdeProblem::Evaluation::ok);
  // A solution: forces of 1e3 N cancel to rounding.
  EXPECT_LT(r.cwiseAbs().maxCoeff(), 1e-8);
  Eigen::MatrixXd J(all, all);
  const double c = 1e4;
  ASSERT_EQ(knee.ode->calcResidualJacobian(0, y.data(), rate.data(), multipliers.data(), c, J.data()), OdeProblem::Evaluation::ok);
  const auto shift = [&](int j, double step, Eigen::VectorXd& out) {
    std::vector<double> ys = y, rs = rate, ms = multipliers;
    if (j < n) {
      ys[static_cast<size_t>(j)] += step;
      rs[static_cast<size_t>(j)] += c * step;
    } else {
      ms[static_cast<size_t>(j - n)] += step;
    }
    ASSERT_EQ(knee.ode->calcResidual(0, ys.data(), rs.data(), ms.data(), out.data()), OdeProblem::Evaluation::ok);
  };
  for (int j = 0; j < all; ++j) {
    const double step = j < n / 2 ? 2e-8 : j < n ? 1e-5 : 1;
    shift(j, step, more);
    shift(j, -step, less);
    const Eigen::VectorXd D = (more - less) / (2 * step);
    EXPECT_LT((J.col(j) - D).cwiseAbs().maxCoeff(), 2e-5 * std::max(1.0, D.cwiseAbs().maxCoeff())) << j;
  }
}

double largestDifference_m(const GaitResult& a, const GaitResult& b) {
  EXPECT_EQ(a.frames.size(), b.frames.size());
  double largest = 0;
  for (size_t k = 0; k < std::min(a.frames.size(), b.frames.size()); ++k) {
    for (size_t i = 0; i < 6; ++i) largest = std::max(largest, (i < 3 ? kAngleLength_m : 1.0) * std::abs(a.frames[k].q[i] - b.frames[k].q[i]));
  }
  return largest;
}

// Steps of an accuracy of 1e-5 err by 0.01 um; the runs of a third of a second by some hundred of that.
TEST(Constraints, GiveTheMotionOfElimination) {
  const TemporaryFile urdf("motion.urdf", kneeUrdf());
  scene::Scene scene = gaitScene(urdf.path());
  scene.gait->duration_s = 0.3;
  scene.gait->accuracy = 1e-5;
  const GaitResult eliminated = runGait(scene);
  ASSERT_TRUE(eliminated.complete) << eliminated.statusText;
  EXPECT_EQ(eliminated.statistics.prescribed, "eliminated");
  scene.gait->prescribed = Prescribed::constraints;
  const GaitResult constrained = runGait(scene);
  ASSERT_TRUE(constrained.complete) << constrained.statusText;
  EXPECT_EQ(constrained.statistics.prescribed, "constraints");
  EXPECT_LT(largestDifference_m(eliminated, constrained), 2e-6);
  // Every frame is on the constraints.
  KneeSystem knee(scene);
  for (const scene::Frame& frame : constrained.frames) {
    EXPECT_NEAR(frame.q[testing_support::rz], knee.motion(testing_support::rz).calcValue(frame.time_s), 1e-12);
    EXPECT_NEAR(frame.qdot[testing_support::rz], knee.motion(testing_support::rz).calcDerivative(frame.time_s, 1), 1e-10);
  }
}

// Simbody's explicit integrators on the same scene, with damping, that rates do not need thousands of steps.
TEST(Constraints, SimbodysIntegratorsAgree) {
  const TemporaryFile urdf("simbody.urdf", kneeUrdf());
  scene::Scene scene = gaitScene(urdf.path(), 8);
  scene.gait->duration_s = 0.05;
  scene.gait->accuracy = 1e-5;
  const GaitResult reference = runGait(scene);
  for (const char* name : {"runge-kutta-merson", "semi-explicit-euler"}) {
    scene.gait->integrator = name;
    const GaitResult result = runGait(scene);
    ASSERT_TRUE(result.complete) << name << ": " << result.statusText;
    EXPECT_LT(largestDifference_m(result, reference), 1e-5) << name;
    // Every realization evaluates contact or copies it, in all parts of the run (the table's rows end five of them).
    EXPECT_GE(result.statistics.contactEvaluations + result.statistics.contactCopies, result.statistics.realizations) << name;
    EXPECT_LT(result.statistics.contactEvaluations, 2 * result.statistics.realizations) << name;
  }
}

TEST(Constraints, AreRefusedWhereTheyCannotBeKept) {
  const TemporaryFile urdf("refused.urdf", kneeUrdf());
  scene::Scene scene = gaitScene(urdf.path());
  const auto errorOf = [&](const char* integrator, Prescribed prescribed) -> std::string {
    scene.gait->integrator = integrator;
    scene.gait->prescribed = prescribed;
    try {
      runGait(scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  };
  EXPECT_THAT(errorOf("generalized-alpha", Prescribed::constraints),
              HasSubstr("analysis.gait.prescribed: is constraints, but generalized-alpha cannot keep constraints; allowed: auto, eliminated; constraints with cpodes"));
  EXPECT_THAT(errorOf("runge-kutta-merson", Prescribed::eliminated), HasSubstr("works with constraints; allowed: auto, constraints; eliminated with cpodes"));
}

// What a run refuses before it begins is refused by the same function when a scene is checked.
TEST(Settings, AreRefusedAlikeByRunAndCheck) {
  const TemporaryFile urdf("alike.urdf", kneeUrdf());
  const scene::Scene good = gaitScene(urdf.path(), 6);
  const auto expectBoth = [&](const std::string& part, auto&& change) {
    scene::Scene scene = good;
    change(*scene.gait);
    for (const bool run : {true, false}) {
      try {
        if (run) {
          runGait(scene);
        } else {
          checkAnalyses(KneeSystem(scene), scene);
        }
        ADD_FAILURE() << part << ": no InputError from the " << (run ? "run" : "check");
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), HasSubstr(part)) << run;
      }
    }
  };
  EXPECT_NO_THROW(checkAnalyses(KneeSystem(good), good));
  expectBoth("analysis.gait.prescribed", [](scene::GaitSpec& g) { g.integrator = "generalized-alpha", g.prescribed = Prescribed::constraints; });
  expectBoth("analysis.gait.prescribed", [](scene::GaitSpec& g) { g.integrator = "semi-explicit-euler", g.prescribed = Prescribed::eliminated; });
  expectBoth("analysis.gait.max_order", [](scene::GaitSpec& g) { g.integrator = "generalized-alpha", g.maxOrder = 2; });
  expectBoth("analysis.gait.max_order", [](scene::GaitSpec& g) { g.integrator = "cpodes", g.maxOrder = 6; });
  expectBoth("analysis.gait.step: is 0.001 s, but cpodes chooses its steps", [](scene::GaitSpec& g) { g.integrator = "cpodes", g.step_s = 1e-3; });
  expectBoth("analysis.gait.integrator: cvode-adams is not part of this program (built without SUNDIALS)", [](scene::GaitSpec& g) { g.integrator = "cvode-adams"; });
  expectBoth("analysis.gait.step: is 1e-09 s: 1e+09 steps in 1 s, more than max_steps; allowed: >= 1e-06 s", [](scene::GaitSpec& g) { g.integrator = "generalized-alpha", g.step_s = 1e-9; });
  expectBoth("did you mean \"cpodes\"", [](scene::GaitSpec& g) { g.integrator = "cpode"; });
  expectBoth("analysis.gait.tolerances.angle: would be ignored", [](scene::GaitSpec& g) { g.integrator = "runge-kutta-merson", g.tolerances.angle_rad = 1e-5; });
  expectBoth("analysis.gait.duration", [](scene::GaitSpec& g) { g.duration_s = std::nan(""); });
  scene::Scene kinsol = good;
  kinsol.staticAnalysis.emplace().method = scene::StaticSpec::Method::kinsol;
  for (const auto& run : std::vector<std::function<void()>>{[&] { runStatic(kinsol); }, [&] { runGait(kinsol); }, [&] { checkAnalyses(KneeSystem(kinsol), kinsol); }}) {
    try {
      run();
      ADD_FAILURE() << "no InputError";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("analysis.static.method: kinsol is not part of this program"));
    }
  }
}

/** A body of 2 kg on a slider, pushed by a table that begins at 0.1 s. */
scene::Scene pushed(const std::filesystem::path& urdf, const std::filesystem::path& table, const std::string& interpolation) {
  const TemporaryFile yaml("pushed.yaml", "genu: 1\nmodel:\n  urdf: " + urdf.string() +
                                              "\n  joints: {lift: {translation: free}}\nloads:\n  push: {coordinate: lift.translation, value: {table: " +
                                              table.string() + ", column: f, unit: N, interpolation: " + interpolation +
                                              "}}\nanalysis:\n  gait: {duration: 0.3 s, output_interval: 50 ms, settle_first: false}\n");
  return scene::readScene(yaml.path(), {{}, true, {}});
}

// A force of 4 N from 0.1 s on: y = (t - 0.1)^2, which a method of second order follows exactly if a step ends at the jump, whatever its length. A spline through the
// same rows errs by more.
TEST(Breaks, AJumpEndsAStep) {
  const TemporaryFile urdf("jump.urdf", liftUrdf()), table("jump.csv", "time,f\n0,0\n0.1,4\n0.3,4\n");
  scene::Scene scene = pushed(urdf.path(), table.path(), "step");
  const auto end = [&scene](const char* integrator, double step_s) {
    scene.gait->integrator = integrator;
    scene.gait->step_s = step_s;
    const GaitResult result = runGait(scene);
    EXPECT_TRUE(result.complete) << result.statusText;
    return result;
  };
  for (const double step : {7e-3, 33e-3}) {
    const GaitResult result = end("generalized-alpha", step);
    for (const scene::Frame& frame : result.frames) {
      const double s = std::max(0.0, frame.time_s - 0.1);
      EXPECT_NEAR(frame.q[0], s * s, 1e-12) << step << " " << frame.time_s;
      EXPECT_NEAR(frame.qddot[0], frame.time_s > 0.1 ? 2 : 0, 1e-12);  // at the jump itself: what was before
    }
  }
  // BDF: steps err by up to 0.1 um and 1 mm/s.
  EXPECT_NEAR(end("cpodes", 0).frames.back().q[0], 0.04, 3e-5);
  scene = pushed(urdf.path(), table.path(), "spline");
  EXPECT_GT(std::abs(end("generalized-alpha", 7e-3).frames.back().q[0] - 0.04), 1e-3);
}

// A ramp of 20 N/s from 0.1 s on: y = 5/3 (t - 0.1)^3. Second order: halving the step quarters the error.
TEST(Breaks, AKinkEndsAStep) {
  const TemporaryFile urdf("kink.urdf", liftUrdf()), table("kink.csv", "time,f\n0,0\n0.1,0\n0.3,4\n");
  scene::Scene scene = pushed(urdf.path(), table.path(), "linear");
  scene.gait->integrator = "generalized-alpha";
  const auto error = [&scene](double step_s) {
    scene.gait->step_s = step_s;
    const GaitResult result = runGait(scene);
    EXPECT_TRUE(result.complete) << result.statusText;
    return result.frames.back().q[0] - 5.0 / 3 * 0.008;
  };
  const double coarse = error(13.3e-3), fine = error(6.65e-3);
  EXPECT_GT(std::abs(coarse), 1e-7);
  EXPECT_NEAR(coarse / fine, 4, 0.5);
}

// A pulse of 2 ms, 4 mN s, on a body at rest, which an integrator that chooses its steps would step over: y = 2 mm/s from its middle on.
TEST(Breaks, NarrowPulsesAreSeen) {
  const TemporaryFile urdf("pulse.urdf", liftUrdf()), table("pulse.csv", "time,f\n0,0\n0.1,0\n0.101,4\n0.102,0\n0.3,0\n");
  for (const char* interpolation : {"linear", "spline"}) {
    scene::Scene scene = pushed(urdf.path(), table.path(), interpolation);
    scene.gait->accuracy = 1e-6;
    scene.gait->integrator = "cpodes";
    const GaitResult result = runGait(scene);
    ASSERT_TRUE(result.complete) << result.statusText;
    if (std::string(interpolation) == "linear") {
      EXPECT_NEAR(result.frames.back().q[0], 2e-3 * (0.3 - 0.101), 4e-6);
    }
    // Long rows beside a short pulse make a spline swing far (warned of); what counts here is that the swing is followed.
    scene.gait->integrator = "generalized-alpha";
    scene.gait->step_s = 1e-4;
    EXPECT_NEAR(result.frames.back().q[0], runGait(scene).frames.back().q[0], 1e-2 * std::abs(result.frames.back().q[0])) << interpolation;
  }
}

/** The ball of sphereScene 20 mm above the layer, which would be reached after 63 ms with 0.63 m/s; no damping. */
TEST(Flight, TakesNoStepAcrossAContact) {
  const TemporaryFile urdf("drop.urdf", kneeUrdf());
  scene::Scene scene = testing_support::sphereScene(urdf.path(), 20, contact::Correction::energy);
  scene.model->coordinates[testing_support::y] = scene::FreeCoordinate{36e-3 + 20e-3};
  scene.loads.push_back(testing_support::verticalLoad(-30.0));
  scene::GaitSpec& gait = scene.gait.emplace();
  gait.settleFirst = false;
  gait.duration_s = 0.13;
  gait.accuracy = 1e-5;
  for (const auto& [name, step_s] : {std::pair{"cpodes", 0.0}, {"generalized-alpha", 20e-3}}) {
    gait.integrator = name;
    gait.step_s = step_s;
    const GaitResult result = runGait(scene);
    ASSERT_TRUE(result.complete) << name << ": " << result.statusText;
    double lowest = 1;
    for (const scene::Frame& frame : result.frames) lowest = std::min(lowest, frame.q[testing_support::y]);
    EXPECT_LT(lowest, 40e-3) << name;
    // Thrown back: 1 % of the height for the errors of the impact; the structural method takes some of a vibration that fast.
    EXPECT_GT(result.frames.back().q[testing_support::y], step_s > 0 ? 40e-3 : 55e-3) << name;
    // 0.63 m/s against 0.1 mm/s: within 5e-4. Ten times as loose it is said; the fixed step has no accuracy to be told of.
    // It is of the energy that the structural method takes.
    EXPECT_EQ(result.remarks.size(), step_s > 0 ? 1u : 0u) << name;
    EXPECT_THAT(result.remarks, Each(HasSubstr("energy is not kept"))) << name;
    if (step_s > 0) continue;
    gait.accuracy = 1e-4;
    EXPECT_THAT(runGait(scene).remarks, Contains(HasSubstr("contact begins with 6")));
  }
}

TEST(Flight, GimbalLockIsNamed) {
  const TemporaryFile urdf("gimbal.urdf", kneeUrdf());
  scene::Scene scene = testing_support::sphereScene(urdf.path(), 8);
  scene.contacts.clear();
  scene.model->coordinates[testing_support::ry] = scene::PrescribedCoordinate{90 * testing_support::kDegree};
  scene.gait.emplace().settleFirst = false;
  const GaitResult result = runGait(scene);
  EXPECT_TRUE(result.failed);
  EXPECT_THAT(result.statusText, HasSubstr("gimbal lock"));
}

// IDA evaluates residuals, not rates: they are refused there too, and no further away.
TEST(Flight, GimbalLockIsNamedInTheResidual) {
  const TemporaryFile urdf("gimbal.urdf", kneeUrdf());
  scene::Scene scene = testing_support::sphereScene(urdf.path(), 8);
  scene.contacts.clear();
  scene.model->coordinates[testing_support::ry] = scene::FreeCoordinate{};
  Ode free(scene, KneeOde::Prescribed::constraints);
  const auto n = static_cast<size_t>(free.ode->size()), m = static_cast<size_t>(free.ode->numConstraints());
  std::vector<double> y(n), rate(n), multipliers(2 * m), residual(n + 2 * m);
  y[testing_support::ry] = 89.999 * testing_support::kDegree;
  EXPECT_EQ(free.ode->calcResidual(0, y.data(), rate.data(), multipliers.data(), residual.data()), OdeProblem::Evaluation::ok) << free.ode->failure();
  y[testing_support::ry] = 90 * testing_support::kDegree;
  EXPECT_EQ(free.ode->calcResidual(0, y.data(), rate.data(), multipliers.data(), residual.data()), OdeProblem::Evaluation::retry);
  EXPECT_THAT(free.ode->failure(), HasSubstr("gimbal lock"));
}

TEST(Breaks, PrescribedCoordinatesNeedACurve) {
  const TemporaryFile urdf("curve.urdf", liftUrdf()), table("curve.csv", "time,y\n0,0\n1,4\n");
  const TemporaryFile yaml("curve.yaml", "genu: 1\nmodel:\n  urdf: " + urdf.path().string() +
                                             "\n  joints: {lift: {translation: {prescribed: {table: " + table.path().string() +
                                             ", column: y, unit: mm, interpolation: linear}}}}\nanalysis: {gait: {duration: 1 s}}\n");
  try {
    runGait(scene::readScene(yaml.path(), {{}, true, {}}));
    FAIL() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("interpolation linear or step; allowed: spline"));
  }
}

TEST(Limits, EndARunWithWhatItHas) {
  const TemporaryFile urdf("limits.urdf", kneeUrdf());
  scene::Scene scene = gaitScene(urdf.path(), 8);
  scene.gait->maxSteps = 100;
  GaitResult result = runGait(scene);
  EXPECT_TRUE(result.failed);
  EXPECT_FALSE(result.complete);
  EXPECT_GT(result.frames.size(), 1u);
  EXPECT_THAT(result.statusText, HasSubstr("more than 100 steps; raise analysis.gait.max_steps"));
  EXPECT_EQ(result.statistics.stepsTaken, 100);
  scene.gait->maxSteps = 1000000;
  scene.gait->maxWallTime_s = 1e-6;
  result = runGait(scene);
  EXPECT_TRUE(result.failed);
  EXPECT_THAT(result.statusText, HasSubstr("of wall time; raise analysis.gait.max_wall_time"));
}

TEST(Tolerances, AreReadWithTheirUnits) {
  const TemporaryFile urdf("tolerances.urdf", liftUrdf());
  const auto read = [&urdf](const std::string& tolerances) {
    const TemporaryFile yaml("tolerances.yaml", "genu: 1\nmodel:\n  urdf: " + urdf.path().string() +
                                                    "\n  joints: {lift: {translation: free}}\nanalysis:\n  gait: {duration: 1 s, accuracy: 1e-4, tolerances: " + tolerances +
                                                    ", max_steps: 70, max_wall_time: 2 min, prescribed: constraints}\n");
    return scene::readScene(yaml.path(), {{}, true, {}});
  };
  const scene::GaitSpec gait = read("{translation: 1e-3 mm, angular_speed: 2 deg/s}").gait.value();
  const OdeTolerances tolerances = OdeTolerances::of(gait);
  EXPECT_DOUBLE_EQ(tolerances.translation_m, 1e-6);
  EXPECT_DOUBLE_EQ(tolerances.angularSpeed_radPerS, 2 * testing_support::kDegree);
  EXPECT_DOUBLE_EQ(tolerances.speed_mPerS, 1e-3);
  EXPECT_DOUBLE_EQ(tolerances.angle_rad, 1e-7 / 0.025);
  EXPECT_EQ(gait.maxSteps, 70);
  EXPECT_EQ(gait.maxWallTime_s, 120);
  EXPECT_EQ(gait.prescribed, Prescribed::constraints);
  for (const auto& [text, part] : {std::pair{"{translation: 1 N}", "analysis.gait.tolerances.translation"},
                                   {"{speed: 0 mm/s}", "allowed: 1e-08 mm/s to 1000 mm/s"},
                                   {"{translation: 2 mm}", "allowed: 1e-12 mm to 1 mm"},
                                   {"{height: 1 mm}", "height"}}) {
    try {
      read(text);
      ADD_FAILURE() << text << ": no InputError";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), ::testing::AllOf(HasSubstr("tolerances.yaml:6"), HasSubstr(part))) << text;
    }
  }
}

// The search belongs to static analyses: a gait starts from one equilibrium.
TEST(Limits, AGaitDoesNotSearch) {
  const TemporaryFile urdf("search.urdf", kneeUrdf());
  scene::Scene scene = gaitScene(urdf.path(), 8);
  scene.gait->duration_s = 0.01;
  scene.staticAnalysis.emplace().search.emplace();
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  ASSERT_TRUE(result.settling);
  EXPECT_FALSE(result.settling->search);
}

TEST(Failures, NameTheCoordinate) {
  const TemporaryFile urdf("named.urdf", kneeUrdf());
  const Ode knee(gaitScene(urdf.path(), 8), KneeOde::Prescribed::eliminated);
  EXPECT_EQ(knee.ode->describeComponent(0), "coordinate rx");
  EXPECT_EQ(knee.ode->describeComponent(2), "coordinate z");
  EXPECT_EQ(knee.ode->describeComponent(4), "rate of coordinate y");
}

// What a relative tolerance of 1e-3, the standard of many programs, is on a height of 33 mm: 33 um of a layer that carries tens of newtons a micrometre. And it would change with
// the place of the origin. Genu's standard is 0.1 um wherever the origin is.
TEST(Tolerances, RelativeToAHeightWouldBeATrap) {
  const TemporaryFile urdf("trap.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 12);
  addGait(scene, 21);  // few rows: steps end at each
  scene.gait->duration_s = 0.3;
  scene.gait->accuracy = 1e-6;
  const GaitResult reference = runGait(scene);
  const auto forceError = [&](const GaitResult& result) {
    EXPECT_TRUE(result.complete) << result.statusText;
    double largest = 0;
    for (size_t k = 0; k < reference.frames.size(); ++k) {
      largest = std::max(largest, std::abs(result.frames[k].contacts[0].total.scalarForce_N - reference.frames[k].contacts[0].total.scalarForce_N));
    }
    return largest;
  };
  scene.gait->accuracy = 1e-4;
  const double standard = forceError(runGait(scene));
  const double height = reference.frames.front().q[testing_support::y];
  EXPECT_NEAR(height, 38e-3, 2e-3);
  scene.gait->tolerances.translation_m = 1e-3 * height;
  scene.gait->tolerances.speed_mPerS = 0.1;
  const double relative = forceError(runGait(scene));
  // Measured from the floor instead of the insert's bottom.
  scene.gait->tolerances.translation_m = 1e-3 * (height + 0.5);
  scene.gait->tolerances.speed_mPerS = 1;
  const double fromFloor = forceError(runGait(scene));
  EXPECT_LT(standard, 2);
  EXPECT_GT(relative, 3 * standard);
  EXPECT_GT(fromFloor, 3 * standard);
}

}  // namespace
}  // namespace genu::model
