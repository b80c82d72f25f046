#include "genu/integrators/Sundials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "genu/model/Analysis.h"
#include "genu/model/OdeIntegrator.h"
#include "genu/scene/SceneFile.h"

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
// micrometre at the default accuracy, ten of its step tolerances of 1e-4 mm. CPODES gives the same bits before and after SUNDIALS ran: Simbody's library exports
// old functions of the same names, which neither may call in place of the other's.
TEST_F(Sundials, IntegratorsAgreeOnAGait) {
  const model::GaitResult reference = model::runGait(gait("cpodes", 1e-6));
  ASSERT_TRUE(reference.complete) << reference.statusText;
  for (const char* name : {"cpodes", "cvode-bdf", "arkode-dirk"}) {
    const model::GaitResult result = model::runGait(gait(name, 1e-4));
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

}  // namespace
}  // namespace genu::integrators
