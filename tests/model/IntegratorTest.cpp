#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>

#include "../../src/model/KneeOde.h"
#include "ElementFixtures.h"

namespace genu::model {
namespace {

using testing_support::kneeScene;
using testing_support::kneeUrdf;
using testing_support::TemporaryFile;

/** A knee off its equilibrium and moving. */
struct Problem {
  explicit Problem(const scene::Scene& scene, KneeOde::Prescribed prescribed = KneeOde::Prescribed::eliminated) : knee(scene) {
    SimTK::State state = knee.system().realizeTopology();
    knee.system().realizeModel(state);
    ode = std::make_unique<KneeOde>(knee, state, OdeTolerances::of(1e-4), prescribed);
    const StaticResult rest = runStatic(scene);
    EXPECT_EQ(rest.status, StaticResult::Status::converged) << rest.statusText;
    y = ode->start(rest.q, scene::Coordinates(rest.q.size(), 0.0));
    const int n = ode->numCoordinates();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> off(-1, 1);
    for (int k = 0; k < n; ++k) {
      y[static_cast<size_t>(k)] += 1e-5 * off(random);
      y[static_cast<size_t>(n + k)] += 1e-2 * off(random);
    }
  }
  KneeSystem knee;
  std::unique_ptr<KneeOde> ode;
  std::vector<double> y;
};

scene::Scene dampedKnee(const std::filesystem::path& urdf) {
  scene::Scene scene = kneeScene(urdf, 15);
  scene.contacts[0].definition.damping_sPerM = 0.05;
  return scene;
}

scene::Scene kneeWithLigaments() { return scene::readScene(std::string(GENU_SOURCE_DIR) + "/models/knee_with_ligaments/natural.yaml", {{}, true, {}}); }

/** Largest difference of the Jacobian from central differences of the rates, over the largest entry of the column. Steps s of 20 nm and 10 um/s at
 the surfaces err by s^2/6 of the third derivative, which at a rim is of the order of k/d^2 with d = 0.1 mm: 1e-8 of k. Feet are found to 1e-13 m: 5e-6
 of a step. */
double compareJacobian(Problem& problem) {
  const int n = problem.ode->size(), m = problem.ode->numCoordinates();
  Eigen::MatrixXd J(n, n), D(n, n);
  EXPECT_EQ(problem.ode->calcJacobian(0, problem.y.data(), J.data()), OdeProblem::Evaluation::ok);
  std::vector<double> y = problem.y;
  Eigen::VectorXd more(n), less(n);
  const auto& tolerance = problem.ode->absoluteTolerances();
  double worst = 0;
  for (int j = 0; j < n; ++j) {
    const auto k = static_cast<size_t>(j);
    const double step = j < m ? 2e-8 * tolerance[k] / 1e-7 : j < 2 * m ? 1e-5 * tolerance[k] / 1e-3 : 1e-6;
    y[k] = problem.y[k] + step;
    EXPECT_EQ(problem.ode->evaluate(0, y.data(), more.data()), OdeProblem::Evaluation::ok);
    y[k] = problem.y[k] - step;
    EXPECT_EQ(problem.ode->evaluate(0, y.data(), less.data()), OdeProblem::Evaluation::ok);
    y[k] = problem.y[k];
    D.col(j) = (more - less) / (2 * step);
    worst = std::max(worst, (J.col(j) - D.col(j)).cwiseAbs().maxCoeff() / D.col(j).cwiseAbs().maxCoeff());
  }
  return worst;
}

TEST(Jacobian, OfAKneeIsThatOfDifferences) {
  const TemporaryFile urdf("jacobian.urdf", kneeUrdf());
  Problem knee(kneeScene(urdf.path(), 15));
  EXPECT_LT(compareJacobian(knee), 2e-5);
  Problem damped(dampedKnee(urdf.path()));
  EXPECT_LT(compareJacobian(damped), 2e-5);
  Problem constrained(dampedKnee(urdf.path()), KneeOde::Prescribed::constraints);
  EXPECT_LT(compareJacobian(constrained), 2e-5);
}

TEST(Jacobian, OfTwoJointsWithLigaments) {
  Problem knee(kneeWithLigaments());
  EXPECT_EQ(knee.ode->size(), 22);
  EXPECT_LT(compareJacobian(knee), 2e-5);
}

TEST(Jacobian, CentreRuleHasNone) {
  const TemporaryFile urdf("centre.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 15);
  scene.contacts[0].definition.rule = contact::ContactRule::centre;
  EXPECT_FALSE(Problem(scene).ode->hasJacobian());
}

// The same equations, solved in another order: rounding of the largest acceleration.
TEST(Elimination, GivesTheAccelerationsOfTheConstraints) {
  const TemporaryFile urdf("eliminated.urdf", kneeUrdf());
  scene::Scene scene = dampedKnee(urdf.path());
  testing_support::addGait(scene);
  Problem eliminated(scene), constrained(scene, KneeOde::Prescribed::constraints);
  std::vector<double> a(6), b(12);
  for (const double t : {0.0, 0.13, 0.52, 0.97}) {
    ASSERT_EQ(eliminated.ode->evaluate(t, eliminated.y.data(), a.data()), OdeProblem::Evaluation::ok);
    // The free ones rx, y, z among all six; the projection sets the others to their curves.
    std::vector<double> y(12);
    const std::array<size_t, 3> place = {0, 4, 5};
    for (size_t k = 0; k < 3; ++k) y[place[k]] = eliminated.y[k], y[6 + place[k]] = eliminated.y[3 + k];
    ASSERT_EQ(constrained.ode->project(t, y.data(), nullptr), OdeProblem::Evaluation::ok);
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(y[place[k]], eliminated.y[k], 1e-12);
    ASSERT_EQ(constrained.ode->evaluate(t, y.data(), b.data()), OdeProblem::Evaluation::ok);
    double largest = 0;
    for (const double value : b) largest = std::max(largest, std::abs(value));
    for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(a[3 + k], b[6 + place[k]], 1e-10 * largest) << t;
  }
}

/** A damped oscillator of 5 Hz beside one of 5 kHz without damping, and a state of first order. */
class Oscillators : public OdeProblem {
 public:
  explicit Oscillators(double tolerance) : tolerances_{tolerance, tolerance, 100 * tolerance, 1e5 * tolerance, tolerance} {}
  int size() const override { return 5; }
  int numCoordinates() const override { return 2; }
  const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
  Evaluation evaluate(double, const double* y, double* rate) noexcept override {
    rate[0] = y[2];
    rate[1] = y[3];
    rate[2] = -kSlow * kSlow * y[0] - 2 * kDamping * kSlow * y[2];
    rate[3] = -kFast * kFast * y[1];
    rate[4] = -3 * y[4];
    return Evaluation::ok;
  }
  static double slow(double t) {
    const double w = kSlow * std::sqrt(1 - kDamping * kDamping);
    return std::exp(-kDamping * kSlow * t) * (std::cos(w * t) + kDamping * kSlow / w * std::sin(w * t));
  }
  static constexpr double kSlow = 31.4, kFast = 31400, kDamping = 0.1;

 private:
  std::vector<double> tolerances_;
};

// Second order in all states: halving the step quarters the errors, up to the next order, a few per cent here. The fast vibration, which the step
// cannot follow, is gone: what is left of it is rho^steps = 0.5^100, and what Newton leaves.
TEST(GeneralizedAlpha, IsOfSecondOrderAndDampsWhatItCannotFollow) {
  // Linear: Newton's first iteration is exact whatever the tolerance, and at 1e-2 no step is halved.
  const auto run = [](double step) {
    Oscillators problem(1e-2);
    const auto integrator = makeOdeIntegrator("generalized-alpha", problem, {0, step}, "test");
    EXPECT_TRUE(integrator->initialize(0, {1, 1e-3, 0, 0, 1}, 0.2)) << integrator->errorText();
    while (integrator->time() < 0.2) {
      if (!integrator->step()) {
        ADD_FAILURE() << integrator->errorText();
        break;
      }
    }
    std::vector<double> y;
    EXPECT_TRUE(integrator->interpolate(0.2, y));
    return std::vector<double>{y[0] - Oscillators::slow(0.2), y[1], y[4] - std::exp(-0.6)};
  };
  const auto coarse = run(2e-3), fine = run(1e-3);
  EXPECT_LT(std::abs(coarse[1]), 1e-9);
  EXPECT_GT(std::abs(coarse[0]), 1e-6);
  EXPECT_NEAR(coarse[0] / fine[0], 4, 0.2);
  EXPECT_NEAR(coarse[2] / fine[2], 4, 0.2);
}

// A step a fifth of the period long would be wrong by a third of the amplitude: it is taken in parts, and the error of the run stays of the order of 200 tolerances
// times the number of steps of a radian.
TEST(GeneralizedAlpha, HalvesStepsThatAreAbsurd) {
  Oscillators problem(1e-6);
  const auto integrator = makeOdeIntegrator("generalized-alpha", problem, {0, 0.04}, "test");
  ASSERT_TRUE(integrator->initialize(0, {1, 0, 0, 0, 1}, 0.2)) << integrator->errorText();
  while (integrator->time() < 0.2) ASSERT_TRUE(integrator->step()) << integrator->errorText();
  std::vector<double> y;
  ASSERT_TRUE(integrator->interpolate(0.2, y));
  EXPECT_NEAR(y[0], Oscillators::slow(0.2), 5e-3);
  EXPECT_GT(integrator->statistics().errorTestFailures, 0);
}

// Settings that a method would ignore are refused.
TEST(OdeIntegrators, RefuseSettingsTheyDoNotTake) {
  Oscillators problem(1e-3);
  const auto errorOf = [&](const char* name, const OdeSettings& settings) -> std::string {
    try {
      makeOdeIntegrator(name, problem, settings, "s.yaml:3: analysis.gait.integrator");
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  };
  EXPECT_EQ(errorOf("cpodes", {6, 0}), "s.yaml:3: analysis.gait.integrator: cpodes with max_order 6; allowed: 1 to 5");
  EXPECT_THAT(errorOf("cpodes", {0, 1e-3}), ::testing::HasSubstr("chooses its steps by `accuracy`"));
  EXPECT_THAT(errorOf("generalized-alpha", {2, 1e-3}), ::testing::HasSubstr("allowed: none"));
  EXPECT_EQ(errorOf("cpodes", {5, 0}), "no InputError");
  EXPECT_EQ(errorOf("generalized-alpha", {0, 1e-3}), "no InputError");
}

TEST(GeneralizedAlpha, SaysWhatItNeeds) {
  class FirstOrder : public OdeProblem {
   public:
    int size() const override { return 1; }
    Evaluation evaluate(double, const double*, double* rate) noexcept override {
      rate[0] = 1;
      return Evaluation::ok;
    }
    const std::vector<double>& absoluteTolerances() const override { return tolerances_; }
    std::vector<double> tolerances_ = {1e-6};
  } problem;
  const auto integrator = makeOdeIntegrator("generalized-alpha", problem, {}, "test");
  EXPECT_FALSE(integrator->initialize(0, {0}, 1));
  EXPECT_THAT(integrator->errorText(), ::testing::HasSubstr("needs coordinates"));
}

}  // namespace
}  // namespace genu::model
