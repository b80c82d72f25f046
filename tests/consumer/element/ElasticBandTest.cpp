#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include "ElasticBandLaw.h"
#include "genu/model/KneeSystem.h"
#include "genu/scene/Errors.h"
#include "genu/scene/SceneFile.h"

namespace {

using bands::calcResponse;
using bands::ElasticBandLaw;

const ElasticBandLaw kLaw{1000, 0.1, 5};  // N/m, m

// c e = 1 at 120 mm: T = 20 (e - 1), energy = 2 ((e - 1)/5 - 0.2).
TEST(Law, HasItsClosedForm) {
  const auto r = calcResponse(kLaw, 0.12);
  EXPECT_NEAR(r.tension_N, 34.365636569180905, 1e-11);
  EXPECT_NEAR(r.dTdL_NPerM, 2718.281828459045, 1e-9);
  EXPECT_NEAR(r.energy_J, 0.287312731383618, 1e-13);
}

// Central differences over h = 1 um err by c^2 h^2/(6 L0^2) = 4e-10 of the slope and by c h^2/(6 L0^2 e) = 2e-9 of the tension at
// e = 0.05; rounding adds 1e-11.
TEST(Law, SlopeAndEnergyAreDerivatives) {
  constexpr double h = 1e-6;
  for (const double strain : {0.05, 0.2, 0.5}) {
    const double L = 0.1 * (1 + strain);
    const auto r = calcResponse(kLaw, L), more = calcResponse(kLaw, L + h), less = calcResponse(kLaw, L - h);
    EXPECT_NEAR((more.tension_N - less.tension_N) / (2 * h) / r.dTdL_NPerM, 1, 1e-9) << strain;
    EXPECT_NEAR((more.energy_J - less.energy_J) / (2 * h) / r.tension_N, 1, 4e-9) << strain;
  }
}

TEST(Law, SlackCarriesNothing) {
  for (const double length : {0.0, 0.05, 0.1}) {
    const auto r = calcResponse(kLaw, length);
    EXPECT_EQ(r.tension_N, 0);
    EXPECT_EQ(r.energy_J, 0);
  }
}

TEST(Law, DampingFollowsTheRateAndNeverPushes) {
  ElasticBandLaw damped = kLaw;
  damped.damping_NSPerM = 20;
  const double elastic_N = calcResponse(kLaw, 0.12).tension_N;
  EXPECT_NEAR(calcResponse(damped, 0.12, 0.5).tension_N, elastic_N + 10, 1e-12);
  EXPECT_NEAR(calcResponse(damped, 0.12, -0.5).tension_N, elastic_N - 10, 1e-12);
  EXPECT_EQ(calcResponse(damped, 0.12, -5).tension_N, 0);
  EXPECT_EQ(calcResponse(damped, 0.09, 5).tension_N, 0);
  EXPECT_EQ(calcResponse(damped, 0.12, 0.5).energy_J, calcResponse(kLaw, 0.12).energy_J);
}

// Where the series takes over, the two forms of the energy agree to what both promise.
TEST(Law, EnergyIsSmoothNearItsBeginning) {
  const double x = 1e-3;
  EXPECT_NEAR(bands::calcExpMinusLine(std::nextafter(x, 0)) / (std::expm1(x) - x), 1, 1e-12);
}

// The tension that Simbody applies is the slope of the energy that it reports, with the errors of the differences as above.
TEST(Element, ForceIsTheSlopeOfItsEnergy) {
  const genu::scene::Scene scene = genu::scene::readScene("hanging_weight.yaml");
  genu::model::KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  const auto energy = [&](double drop_m) {  // of band and weight
    state.updQ()[knee.stateIndex(0)] = drop_m;
    knee.system().realize(state, SimTK::Stage::Dynamics);
    return knee.system().calcPotentialEnergy(state);
  };
  constexpr double h = 1e-6, weight_N = 3.5 * 9.81;
  const double slope_N = (energy(0.12 + h) - energy(0.12 - h)) / (2 * h);
  energy(0.12);
  knee.system().realize(state, SimTK::Stage::Acceleration);
  const double force_N = knee.calcElementOutputs(state).at(0);
  EXPECT_NEAR(slope_N, force_N - weight_N, 1e-7);
  EXPECT_NEAR(3.5 * state.getUDot()[knee.stateIndex(0)], weight_N - force_N, 1e-11);
}

TEST(Element, CarriesTheWeightAtRest) {
  const genu::scene::Scene scene = genu::scene::readScene("hanging_weight.yaml");
  const auto result = genu::model::runStatic(scene);
  ASSERT_EQ(result.status, genu::model::StaticResult::Status::converged) << result.statusText;
  // Newton stops below 1e-6 N; a slope of 2700 N/m makes that 4e-10 m.
  EXPECT_NEAR(result.q.at(0), 0.1 * (1 + std::log1p(5 * 3.5 * 9.81 / 100) / 5), 4e-10);
  EXPECT_NEAR(result.elements.at(0), 3.5 * 9.81, 1e-6);
}

// The scene's accuracy lets each step err by 1e-5 m/s, which is 1.7e-5 J at the largest momentum, 1.7 kg m/s. The errors have both
// signs: 1.8e-5 J over the run. Six such steps are allowed.
TEST(Element, KeepsEnergyWhileTheWeightBounces) {
  const genu::scene::Scene scene = genu::scene::readScene("hanging_weight.yaml");
  const auto result = genu::model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  double largest_J = 0, drift_J = 0;
  for (const auto& frame : result.frames) {
    const double band_J = frame.elements.at(2), v = frame.qdot.at(0);
    largest_J = std::max(largest_J, band_J);
    drift_J = std::max(drift_J, std::abs(0.5 * 3.5 * v * v + band_J - 3.5 * 9.81 * (frame.q.at(0) - 0.1)));
  }
  std::printf("band stores up to %.3f J, drift %.1e J\n", largest_J, drift_J);
  EXPECT_GT(largest_J, 1);
  EXPECT_LT(drift_J, 1e-4);
}

/** hanging_weight.yaml with one line changed. */
std::string change(const std::string& from, const std::string& to) {
  std::ifstream file("hanging_weight.yaml");
  std::string text{std::istreambuf_iterator<char>(file), {}};
  return text.replace(text.find(from), from.size(), to);
}

// With damping the energy at a place is what it was, at any speed; and the weight comes to rest.
TEST(Element, DampingTakesEnergy) {
  const auto scene = genu::scene::parseScene(change("rise: 5", "rise: 5\n    damping: 20 N s/m"), "damped.yaml");
  genu::model::KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  state.updQ()[knee.stateIndex(0)] = 0.12;
  state.updU()[knee.stateIndex(0)] = 0.5;
  knee.system().realize(state, SimTK::Stage::Position);
  const double atPosition_J = knee.system().calcPotentialEnergy(state);
  knee.system().realize(state, SimTK::Stage::Acceleration);
  EXPECT_EQ(knee.system().calcPotentialEnergy(state), atPosition_J);
  EXPECT_NEAR(knee.calcElementOutputs(state).at(0), calcResponse(kLaw, 0.12).tension_N + 10, 1e-11);
  const auto result = genu::model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  EXPECT_LT(std::abs(result.frames.back().qdot.at(0)), 0.3);  // 1 m/s and more without
}

TEST(Reader, NamesFilePlaceAndWhatIsAllowed) {
  try {
    genu::scene::parseScene(change("rise: 5", "rise: 0"), "changed.yaml");
    ADD_FAILURE() << "a rise of 0 was accepted";
  } catch (const genu::InputError& error) {
    const std::string wanted = "changed.yaml:15: elastic_bands.band.rise: is \"0\"; allowed: 0.01 to 100";
    EXPECT_EQ(std::string(error.what()), wanted);
  }
}

// The element's own advice reaches whoever runs statics.
TEST(Element, SaysWhenItsForceHasNoMeaning) {
  std::string text = change("start: 100 mm", "start: 300 mm");
  text.replace(text.find("rise: 5"), 7, "rise: 60");
  const auto result = genu::model::runStatic(genu::scene::parseScene(text, "far.yaml"));
  EXPECT_EQ(result.status, genu::model::StaticResult::Status::notConverged);
  EXPECT_NE(result.statusText.find("elastic_bands.band: the band is stretched"), std::string::npos) << result.statusText;
}

}  // namespace
