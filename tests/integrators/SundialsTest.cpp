#include "genu/integrators/Sundials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../../src/model/KneeOde.h"
#include "../model/KneeFixtures.h"
#include "genu/model/Analysis.h"
#include "genu/model/EquilibriumSolver.h"
#include "genu/model/OdeIntegrator.h"
#include "genu/scene/SceneFile.h"
#include "model/KneeFixtures.h"

namespace genu::integrators {
namespace {

using model::OdeProblem;

class Sundials : public testing::Test {
 protected:
  static void SetUpTestSuite() { registerSundials(); }
};

/** y'' = -w^2 y, with its Jacobian where asked for. */
class Oscillator : public OdeProblem {
 public:
  Oscillator(double tolerance, bool withJacobian) : tolerances_{tolerance, 10 * tolerance}, withJacobian_(withJacobian) {}
  int size() const override { return 2; }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double, const double* y, double* rate) noexcept override {
    rate[0] = y[1];
    rate[1] = -100 * y[0];
    return Evaluation::ok;
  }
  bool hasJacobian() const override { return withJacobian_; }
  Evaluation calcJacobian(double, const double*, double* jacobian) noexcept override {
    jacobian[0] = 0, jacobian[1] = -100, jacobian[2] = 1, jacobian[3] = 0;
    return Evaluation::ok;
  }

 private:
  std::vector<double> tolerances_;
  bool withJacobian_;
};

double largestError(const std::string& name, const model::OdeSettings& settings, double tolerance, bool withJacobian) {
  Oscillator problem(tolerance, withJacobian);
  const auto integrator = model::makeOdeIntegrator(name, problem, settings, "test");
  EXPECT_TRUE(integrator->initialize(0, {1, 0}, 0.6)) << integrator->errorText();
  std::vector<double> y;
  double largest = 0;
  for (double previous = 0; integrator->time() < 0.6; previous = integrator->time()) {
    if (!integrator->step()) {
      ADD_FAILURE() << name << ": " << integrator->errorText();
      break;
    }
    for (const double t : {0.5 * (previous + integrator->time()), integrator->time()}) {
      EXPECT_TRUE(integrator->interpolate(t, y));
      largest = std::max(largest, std::abs(y[0] - std::cos(10 * t)));
    }
  }
  EXPECT_DOUBLE_EQ(integrator->time(), 0.6) << "the stop time is not passed";
  const auto counts = integrator->statistics();
  EXPECT_GT(counts.stepsTaken, 5);
  EXPECT_EQ(counts.jacobians > 0, withJacobian && name != "cvode-adams");
  return largest;
}

// One period; the error may be some hundred times the tolerance of a step, with and without the Jacobian, also between the steps.
TEST_F(Sundials, FollowsAnOscillator) {
  for (const bool withJacobian : {true, false}) {
    SCOPED_TRACE(withJacobian);
    EXPECT_LT(largestError("cvode-bdf", {}, 1e-7, withJacobian), 2e-4);
    EXPECT_LT(largestError("cvode-bdf", {5, 0}, 1e-7, withJacobian), 1e-4);
    EXPECT_LT(largestError("cvode-adams", {}, 1e-7, withJacobian), 1e-4);
    for (const int order : {2, 3, 4, 5}) EXPECT_LT(largestError("arkode-dirk", {order, 0}, 1e-7, withJacobian), 2e-4) << order;
  }
}

/** y' = 1, refused twice after a time: two halvings of a fixed step. */
class Reluctant : public OdeProblem {
 public:
  int size() const override { return 1; }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double t, const double*, double* rate) noexcept override {
    rate[0] = 1;
    return t > 0.2251 && refusals++ < 2 ? Evaluation::retry : Evaluation::ok;
  }
  int refusals = 0;

 private:
  std::vector<double> tolerances_ = {1e-6};
};

// Between and at the ends of steps the solution is that of the steps: y' = 1 is followed exactly by backward Euler, and lines between its steps are.
TEST_F(Sundials, ImplicitEulerIsNotLate) {
  Reluctant problem;
  problem.refusals = 2;  // no more
  const auto integrator = model::makeOdeIntegrator("implicit-euler", problem, {0, 0.1}, "test");
  ASSERT_TRUE(integrator->initialize(0, {0}, 1));
  std::vector<double> y;
  while (integrator->time() < 1) {
    ASSERT_TRUE(integrator->step()) << integrator->errorText();
    for (const double before : {0.0, 0.03, 0.1}) {
      ASSERT_TRUE(integrator->interpolate(integrator->time() - before, y));
      EXPECT_NEAR(y[0], integrator->time() - before, 1e-9);
    }
  }
}

// Backward Euler is of first order: half the step, half the error. Of y it damps w^2 h/2 per second: 1 - exp(-50 h 0.6) = 0.03 at 1 ms.
TEST_F(Sundials, ImplicitEulerIsOfFirstOrder) {
  const double coarse = largestError("implicit-euler", {0, 2e-3}, 1e-7, true), fine = largestError("implicit-euler", {0, 1e-3}, 1e-7, true);
  EXPECT_NEAR(coarse / fine, 2, 0.1);
  EXPECT_NEAR(fine, 0.03, 0.005);
}

TEST_F(Sundials, FailureIsReportedNotThrown) {
  class Wall : public OdeProblem {
   public:
    int size() const override { return 1; }
    Evaluation evaluate(double, const double* y, double* rate) noexcept override {
      rate[0] = 1;
      return y[0] > 0.5 ? Evaluation::retry : Evaluation::ok;
    }
    const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
    std::vector<double> tolerances_ = {1e-6};
  };
  for (const char* name : {"cvode-bdf", "cvode-adams", "arkode-dirk"}) {
    SCOPED_TRACE(name);
    Wall problem;
    const auto integrator = model::makeOdeIntegrator(name, problem, {}, "test");
    ASSERT_TRUE(integrator->initialize(0, {0}, 1));
    bool going = true;
    for (int i = 0; i < 100000 && going; ++i) going = integrator->step();
    EXPECT_FALSE(going);
    EXPECT_FALSE(integrator->errorText().empty());
    EXPECT_NEAR(integrator->time(), 0.5, 0.02);
  }
}

/** A pendulum of length 1 and mass 1 in x and y, g = 1, at 0.5 rad from the lowest point at rest: one constraint, (x^2 + y^2 - 1)/2 = 0. */
class Pendulum : public OdeProblem {
 public:
  int size() const override { return 4; }
  int numCoordinates() const override { return 2; }
  int numConstraints() const override { return 1; }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double, const double* y, double* rate) noexcept override {
    const double lambda = (y[2] * y[2] + y[3] * y[3] - y[1]) / (y[0] * y[0] + y[1] * y[1]);
    rate[0] = y[2], rate[1] = y[3];
    rate[2] = -y[0] * lambda, rate[3] = -1 - y[1] * lambda;
    return Evaluation::ok;
  }
  Evaluation project(double, double* y, double* error) noexcept override {
    const double length = std::hypot(y[0], y[1]);
    y[0] /= length, y[1] /= length;
    const double along = y[0] * y[2] + y[1] * y[3];
    y[2] -= along * y[0], y[3] -= along * y[1];
    for (int k = 0; error != nullptr && k < 4; k += 2) {
      const double part = y[0] * error[k] + y[1] * error[k + 1];
      error[k] -= part * y[0], error[k + 1] -= part * y[1];
    }
    ++projections;
    return Evaluation::ok;
  }
  Evaluation calcResidual(double, const double* y, const double* rate, const double* multipliers, double* r) noexcept override {
    for (int k = 0; k < 2; ++k) {
      r[k] = rate[k] - y[2 + k] - y[k] * multipliers[1];
      r[2 + k] = rate[2 + k] + y[k] * multipliers[0] + k;
    }
    r[4] = 0.5 * (y[0] * y[0] + y[1] * y[1] - 1);
    r[5] = y[0] * y[2] + y[1] * y[3];
    return Evaluation::ok;
  }
  Evaluation calcMultipliers(double t, const double* y, double* rate, double* multipliers) noexcept override {
    multipliers[0] = (y[2] * y[2] + y[3] * y[3] - y[1]) / (y[0] * y[0] + y[1] * y[1]);
    multipliers[1] = 0;
    return evaluate(t, y, rate);
  }
  int projections = 0;

 private:
  std::vector<double> tolerances_ = {1e-7, 1e-7, 1e-7, 1e-7};
};

// After the exact period 4 K(sin(1/4)) [Abramowitz & Stegun 17.3] it is back; steps of 1e-7, a few hundred, and an order of 2 leave 1e-4. On the constraint: to
// rounding where it is projected, to the tolerance of Newton's iteration where it is solved for, and for CVODE without projection it would drift by as much as the rest.
TEST_F(Sundials, ConstraintsAreKept) {
  const double period = 4 * std::comp_ellint_1(std::sin(0.25));
  for (const char* name : {"cvode-bdf", "ida", "cpodes"}) {
    SCOPED_TRACE(name);
    Pendulum problem;
    const auto integrator = model::makeOdeIntegrator(name, problem, {}, "test");
    ASSERT_TRUE(integrator->initialize(0, {std::sin(0.5), -std::cos(0.5), 0, 0}, period)) << integrator->errorText();
    std::vector<double> y;
    while (integrator->time() < period) {
      ASSERT_TRUE(integrator->step()) << integrator->errorText();
      ASSERT_TRUE(integrator->interpolate(integrator->time(), y));
      ASSERT_NEAR(std::hypot(y[0], y[1]), 1, 3e-7);
      ASSERT_NEAR(y[0] * y[2] + y[1] * y[3], 0, 3e-7);
    }
    EXPECT_NEAR(y[0], std::sin(0.5), 3e-4);
    EXPECT_NEAR(y[2], 0, 3e-4);
    EXPECT_EQ(problem.projections > 10, std::string(name) != "ida");
    EXPECT_GE(integrator->worstComponent(), 0);
    EXPECT_LT(integrator->worstComponent(), 4);
  }
  Pendulum problem;
  for (const char* name : {"cvode-adams", "arkode-dirk", "generalized-alpha"}) {
    EXPECT_THROW(model::makeOdeIntegrator(name, problem, {}, "test"), InputError) << name;
  }
}

// SUNDIALS has errors of a step where it chooses the step; those of an oscillator are at most the tolerances, with signs, and not all nothing.
TEST_F(Sundials, ErrorsOfAStepAreWithinTheTolerances) {
  for (const char* name : {"cvode-bdf", "cvode-adams", "arkode-dirk", "cpodes"}) {
    SCOPED_TRACE(name);
    Oscillator problem(1e-7, true);
    const auto integrator = model::makeOdeIntegrator(name, problem, {}, "test");
    ASSERT_TRUE(integrator->initialize(0, {1, 0}, 0.6));
    std::vector<double> errors;
    double largest = 0, lowest = 0;
    while (integrator->time() < 0.6) {
      ASSERT_TRUE(integrator->step()) << integrator->errorText();
      ASSERT_TRUE(integrator->getStepErrors(errors));
      ASSERT_EQ(errors.size(), 2u);
      // The norm is the root of the mean of squares.
      EXPECT_LE(std::sqrt(0.5 * (std::pow(errors[0] / 1e-7, 2) + std::pow(errors[1] / 1e-6, 2))), 1 + 1e-9);
      largest = std::max(largest, errors[0] / 1e-7);
      lowest = std::min(lowest, errors[0] / 1e-7);
    }
    EXPECT_GT(largest, 1e-3);
    EXPECT_LT(lowest, -1e-3);
  }
  Oscillator problem(1e-7, true);
  const auto fixed = model::makeOdeIntegrator("implicit-euler", problem, {0, 1e-3}, "test");
  ASSERT_TRUE(fixed->initialize(0, {1, 0}, 0.6));
  ASSERT_TRUE(fixed->step());
  std::vector<double> errors;
  EXPECT_FALSE(fixed->getStepErrors(errors));
  EXPECT_DOUBLE_EQ(fixed->fixedStep_s(), 1e-3);
}

// As ErrorEstimate.IsOfTheSizeOfTheError of Simbody's integrators: a ball let go 20 um above its layer, under 300 N.
TEST_F(Sundials, ErrorEstimatesAreOfTheSizeOfTheError) {
  const model::testing_support::TemporaryFile urdf("estimate.urdf", model::testing_support::kneeUrdf());
  scene::Scene scene = model::testing_support::sphereScene(urdf.path(), 12, contact::Correction::energy);
  scene.model->coordinates[model::testing_support::y] = scene::FreeCoordinate{35.95e-3};
  scene.loads.push_back(model::testing_support::verticalLoad(-300.0));
  scene::GaitSpec& gait = scene.gait.emplace();
  gait.settleFirst = false;
  gait.duration_s = 0.01;
  gait.outputInterval_s = 1e-4;
  gait.integrator = "cvode-bdf";
  gait.accuracy = 1e-10;
  const model::GaitResult tight = model::runGait(scene);
  ASSERT_TRUE(tight.complete) << tight.statusText;
  gait.errorEstimate = true;
  for (const char* name : {"cvode-bdf", "cvode-adams", "ida", "arkode-dirk", "implicit-euler"}) {
    SCOPED_TRACE(name);
    gait.integrator = name;
    gait.accuracy = 1e-6;
    gait.step_s = name == std::string("implicit-euler") ? 1e-5 : 0;
    const model::GaitResult run = model::runGait(scene);
    ASSERT_TRUE(run.complete) << run.statusText;
    ASSERT_TRUE(run.errorEstimate && run.errorEstimate->complete);
    double error = 0;
    for (size_t i = 0; i < run.frames.size(); ++i) error = std::max(error, std::abs(run.frames[i].q[4] - tight.frames[i].q[4]));
    EXPECT_GT(run.errorEstimate->coordinates[4].error, 0.5 * error);
    EXPECT_LT(run.errorEstimate->coordinates[4].error, 3 * error);
    EXPECT_EQ(run.prediction.has_value(), gait.step_s == 0);
    // The same, from the errors of the steps.
    if (run.prediction) {
      EXPECT_GT(run.prediction->pose_m, error / 5);
      EXPECT_LT(run.prediction->pose_m, 5 * error);
    }
  }
}

// Stopped and started again where it is told to, whatever the method.
TEST_F(Sundials, ContinueBeyondAStop) {
  for (const char* name : {"cvode-bdf", "cvode-adams", "arkode-dirk", "implicit-euler"}) {
    SCOPED_TRACE(name);
    Oscillator problem(1e-7, true);
    const auto integrator = model::makeOdeIntegrator(name, problem, {}, "test");
    ASSERT_TRUE(integrator->initialize(0, {1, 0}, 0.1003));
    for (const double stop : {0.1003, 0.2511, 0.3}) {
      if (stop > 0.2) {
        ASSERT_TRUE(integrator->continueTo(stop));
      }
      while (integrator->time() < stop) ASSERT_TRUE(integrator->step()) << integrator->errorText();
      EXPECT_DOUBLE_EQ(integrator->time(), stop);
    }
    std::vector<double> y;
    ASSERT_TRUE(integrator->interpolate(0.3, y));
    EXPECT_NEAR(y[0], std::cos(3), std::string(name) == "implicit-euler" ? 0.03 : 2e-4);
  }
}

// Steps of 25 ms (four in the first 0.1 s) up to 0.225; the last one before the jump at 0.23 is halved twice, and the jump cuts its first quarter short. What comes after the jump
// begins anew: 0.2 s in seven whole steps, none halved.
TEST_F(Sundials, AJumpEndsTheHalvingOfImplicitEuler) {
  Reluctant problem;
  const auto integrator = model::makeOdeIntegrator("implicit-euler", problem, {0, 0.03}, "test");
  ASSERT_TRUE(integrator->initialize(0, {0}, 0.1));
  while (integrator->time() < 0.1) ASSERT_TRUE(integrator->step()) << integrator->errorText();
  ASSERT_TRUE(integrator->continueTo(0.23));
  while (integrator->time() < 0.23) ASSERT_TRUE(integrator->step()) << integrator->errorText();
  EXPECT_EQ(integrator->statistics().convergenceFailures, 2);
  std::vector<double> y;
  ASSERT_TRUE(integrator->interpolate(0.23, y));
  EXPECT_NEAR(y[0], 0.23, 1e-9);
  ASSERT_TRUE(integrator->initialize(0.23, y, 0.43));
  while (integrator->time() < 0.43) ASSERT_TRUE(integrator->step()) << integrator->errorText();
  EXPECT_EQ(integrator->statistics().stepsTaken, 7);
  EXPECT_EQ(integrator->statistics().convergenceFailures, 0);
  ASSERT_TRUE(integrator->interpolate(0.43, y));
  EXPECT_NEAR(y[0], 0.43, 1e-9);
}

// A ball of 3 kg, 120 mm above its layer and pushed with 3 N, from 12 ms on with 3000 N: the cap of the step follows from IDA's own accelerations, 1000 m/s^2, no longer those of the
// start; with 1 m/s^2 steps of 1 m/s and more would be 0.6 mm long. A step's acceleration is that at its beginning, so the cap holds but for what the end of the ramp has not shown yet: here nothing, the force is constant.
TEST_F(Sundials, IdaTakesNoStepAcrossAContact) {
  const model::testing_support::TemporaryFile urdf("ida.urdf", model::testing_support::kneeUrdf());
  scene::Scene scene = model::testing_support::sphereScene(urdf.path(), 10);
  scene.loads.push_back(model::testing_support::verticalLoad(scene::TimeSeries{{0, 0.01, 0.012, 1}, {-3, -3, -3000, -3000}, "push"}));
  std::get<scene::TimeSeries>(scene.loads[0].force_N[1]).interpolation = scene::Interpolation::linear;
  model::KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  model::KneeOde ode(knee, state, model::OdeTolerances::of(1e-3), model::KneeOde::Prescribed::constraints);
  const auto integrator = model::makeOdeIntegrator("ida", ode, {}, "test");
  scene::Coordinates q(6, 0.0);
  q[4] = 156e-3;
  std::vector<double> y = ode.start(q, scene::Coordinates(6, 0.0));
  const std::vector<double> stops = {0.01, 0.012, 0.022};
  ASSERT_TRUE(integrator->initialize(0, y, stops[0])) << integrator->errorText();
  integrator->limitStep(ode.findLongestStep(y));
  double longest = 0, last = y[4];
  for (const double stop : stops) {
    if (stop > stops[0]) {
      ASSERT_TRUE(integrator->continueTo(stop));
      integrator->limitStep(ode.findLongestStep(y));
    }
    while (integrator->time() < stop) {
      ASSERT_TRUE(integrator->step()) << integrator->errorText();
      ASSERT_TRUE(integrator->interpolate(integrator->time(), y));
      integrator->limitStep(ode.findLongestStep(y));
      if (stop == stops[2]) {
        longest = std::max(longest, std::abs(y[4] - last));
        const double v = std::abs(y[10]), a = 3000.0 / 3;  // v h + a h^2/2 = kMostMove_m; IDA's y' still has something of the ramp
        EXPECT_NEAR(ode.findLongestStep(y) * (v + std::sqrt(v * v + 2 * a * model::KneeOde::kMostMove_m)) / (2 * model::KneeOde::kMostMove_m), 1, 2e-2);
      }
      last = y[4];
    }
  }
  // 0.05 mm before the ramp and 10 mm/s, 0.69 mm and 1.001 m/s on it, then 1.011 m/s * 10 ms + 500 m/s^2 * (10 ms)^2; steps may err by 10 mm/s.
  EXPECT_NEAR(y[4], 156e-3 - 60.85e-3, 0.3e-3);
  EXPECT_GT(longest, 0.24e-3);  // IDA doubles steps or leaves them: between half the cap and the cap
  EXPECT_LT(longest, 1.01 * model::KneeOde::kMostMove_m);
}

scene::Scene gait(const std::string& integrator, double accuracy, double step_s = 0) {
  scene::Scene scene = scene::readScene(std::string(GENU_SOURCE_DIR) + "/models/artificial_knee/gait.yaml", {{}, true, std::pair{15, 15}});
  scene.gait->duration_s = 0.3;
  scene.gait->integrator = integrator;
  scene.gait->accuracy = accuracy;
  scene.gait->step_s = step_s;
  return scene;
}

double difference_mm(const model::GaitResult& a, const model::GaitResult& b) {
  EXPECT_EQ(a.frames.size(), b.frames.size());
  double largest = 0;
  for (size_t i = 0; i < std::min(a.frames.size(), b.frames.size()); ++i) {
    largest = std::max(largest, 1e3 * std::abs(a.frames[i].q[4] - b.frames[i].q[4]));
    largest = std::max(largest, 1e3 * model::kAngleLength_m * std::abs(a.frames[i].q[0] - b.frames[i].q[0]));
  }
  return largest;
}

// Height and varus angle of the artificial knee over the loading response, undamped, against CPODES at accuracy 1e-6. Each meets a
// micrometre at the default accuracy, ten of its step tolerances of 1e-4 mm; Runge-Kutta, whose steps are long and err by more of it, at 1e-6. CPODES gives the same bits before and after SUNDIALS ran: Simbody's library exports
// old functions of the same names, which neither may call in place of the other's.
TEST_F(Sundials, IntegratorsAgreeOnAGait) {
  const model::GaitResult reference = model::runGait(gait("cpodes", 1e-6));
  ASSERT_TRUE(reference.complete) << reference.statusText;
  for (const char* name : {"cpodes", "cvode-bdf", "ida", "arkode-dirk"}) {
    const model::GaitResult result = model::runGait(gait(name, std::string(name) == "arkode-dirk" ? 1e-6 : 1e-4));
    ASSERT_TRUE(result.complete) << name << ": " << result.statusText;
    EXPECT_LT(difference_mm(result, reference), 1e-3) << name;
  }
  const model::GaitResult alpha = model::runGait(gait("generalized-alpha", 1e-4, 2e-3));
  ASSERT_TRUE(alpha.complete) << alpha.statusText;
  EXPECT_LT(difference_mm(alpha, reference), 1e-3);
  const model::GaitResult again = model::runGait(gait("cpodes", 1e-6));
  ASSERT_EQ(again.frames.size(), reference.frames.size());
  for (size_t i = 0; i < again.frames.size(); ++i) EXPECT_EQ(again.frames[i].q, reference.frames[i].q);
}

// A swing phase that a step of 1 ms does not get through: the steps are halved there. First order: the error of a run is that of its steps, here 10 um.
TEST_F(Sundials, ImplicitEulerHalvesStepsThatDoNotConverge) {
  scene::Scene scene = gait("implicit-euler", 1e-4, 2e-3);
  scene.gait->duration_s = 1;
  const model::GaitResult result = model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  scene = gait("cpodes", 1e-5);
  scene.gait->duration_s = 1;
  EXPECT_LT(difference_mm(result, model::runGait(scene)), 0.05);
}

// KINSOL on the same forces and stiffness: the same equilibrium as Newton's, to the residual of 1e-6 N.
TEST_F(Sundials, KinsolFindsTheEquilibrium) {
  for (const char* model : {"artificial_knee", "natural_knee"}) {
    scene::Scene scene = scene::readScene(std::string(GENU_SOURCE_DIR) + "/models/" + model + "/static.yaml", {{}, true, std::pair{15, 15}});
    const model::StaticResult newton = model::runStatic(scene);
    scene.staticAnalysis->method = scene::StaticSpec::Method::kinsol;
    const model::StaticResult kinsol = model::runStatic(scene);
    ASSERT_EQ(kinsol.status, model::StaticResult::Status::converged) << kinsol.statusText;
    EXPECT_EQ(kinsol.method, "kinsol");
    for (size_t i = 0; i < newton.q.size(); ++i) EXPECT_NEAR(kinsol.q[i], newton.q[i], 1e-10) << model;
  }
}

// Every start of a search is treated as the first: where the method gives up, implicit Euler and Newton's method finish. The method is one that always does.
TEST_F(Sundials, StartsOfASearchFallBackToo) {
  const model::testing_support::TemporaryFile urdf("fallback.urdf", model::testing_support::kneeUrdf());
  scene::Scene scene = model::testing_support::sphereScene(urdf.path(), 12);
  scene.loads.push_back(model::testing_support::verticalLoad(-500.0));
  scene.staticAnalysis.emplace().method = scene::StaticSpec::Method::kinsol;
  scene.staticAnalysis->search.emplace().starts = 4;
  scene.staticAnalysis->search->translation_m = 10e-3;  // through the layer of 6 mm
  model::registerEquilibriumSolver("kinsol", [](model::EquilibriumProblem&, double*) {
    model::EquilibriumOutcome outcome;
    outcome.reason = "it does not want to";
    return outcome;
  });
  const model::StaticResult result = model::runStatic(scene);
  registerSundials();
  ASSERT_EQ(result.status, model::StaticResult::Status::converged) << result.statusText;
  EXPECT_EQ(result.method, "newton after implicit Euler (kinsol: it does not want to)");
  EXPECT_EQ(result.search->converged, 4);
  EXPECT_EQ(result.search->afterEuler, 4);
  EXPECT_EQ(result.search->backToFirst, 4);
  EXPECT_GT(result.search->movedBack, 0);
  EXPECT_LT(result.search->movedBack, 4);
}

}  // namespace
}  // namespace genu::integrators
