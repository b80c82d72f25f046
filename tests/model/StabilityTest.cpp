#include "genu/model/Stability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ElementFixtures.h"
#include "genu/io/Files.h"
#include "genu/model/Analysis.h"
#include "genu/model/CutOff.h"

namespace genu::model {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing_support::kneeScene;
using testing_support::kneeUrdf;
using testing_support::liftModel;
using testing_support::liftUrdf;
using testing_support::sphereScene;
using testing_support::TemporaryFile;
using Scale = StabilityAxis::Scale;
namespace coordinate = testing_support;

/** A ball pressed d/h deep into its layer, every coordinate prescribed. */
StabilityAxis pressAxis(const std::filesystem::path& urdf, std::vector<double> values) {
  StabilityAxis axis;
  axis.name = "depth";
  axis.scale = Scale::linear;
  axis.values = std::move(values);
  axis.make = [urdf](double strain) {
    scene::Scene scene = sphereScene(urdf, 21);
    contact::CompartmentDefinition& part = scene.contacts[0].definition.compartments[0];
    part.x0_m = part.z0_m = -25e-3;  // holds the contact, whatever the depth
    part.x1_m = part.z1_m = 25e-3;
    part.fixedSurface = testing_support::makeSurface(contact::makePlane(6e-3, 0, 0, contact::Solid::below, 0.1));
    scene.model->coordinates[coordinate::y] = scene::PrescribedCoordinate{36e-3 - strain * 6e-3};
    return scene;
  };
  return axis;
}

// -- energy -------------------------------------------------------------------------------------------------------

// A force that grows with time pushes 2 kg upwards: F = 10 N + 100 N/s t against a weight of 20 N, over 0.2 s from rest. With a = F/m - g,
// v = 25 t^2 - 5 t and y = 25 t^3/3 - 5 t^2/2, the work is integral F v dt = [12.5 ... ] below. Means of both ends of an interval of h err by
// h^2/12 of F'v' differences: (h^2/12) * 100 * y(T) at most = 1e-4/12*100*0.13; here h = 10 ms.
TEST(EnergyBalance, WorkOfAGrowingForceIsTheEnergyItGives) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const TemporaryFile table("push.csv", "time_s,value\n0,10\n0.1,20\n0.2,30\n");
  const std::string rest = "loads:\n  push: {body: body, frame: ground, force: [0 N, {table: " + table.path().string() +
                           ", column: value, unit: N, time: {column: time_s, unit: s}}, 0 N]}\n"
                           "analysis: {gait: {duration: 0.2 s, output_interval: 10 ms, accuracy: 1e-7, settle_first: false}}\n";
  const scene::Scene scene = scene::parseScene(liftModel(file.path()) + rest, "scene.yaml");
  const GaitResult run = runGait(scene);
  ASSERT_TRUE(run.complete) << run.statusText;
  const EnergyBalance balance = calcEnergyBalance(scene, run);
  ASSERT_TRUE(balance.known);
  // Integral of (10 + 100 t)(25 t^2 - 5 t) over 0 .. T.
  const double T = 0.2, work = 10 * (25 * T * T * T / 3 - 5 * T * T / 2) + 100 * (25 * std::pow(T, 4) / 4 - 5 * std::pow(T, 3) / 3);
  const double v = 25 * T * T - 5 * T, y = 25 * T * T * T / 3 - 5 * T * T / 2;
  EXPECT_NEAR(balance.energy_J.back(), 0.5 * 2 * v * v + 2 * 10 * y, 1e-5);  // 1e-7 * 10 m/s a step, 0.2 s
  EXPECT_NEAR(balance.work_J.back(), work, 1e-4 / 12 * 100 * 0.14);
  EXPECT_NE(balance.work_J.back(), 0);
  // What the sums miss is seen by leaving out every second frame.
  EXPECT_NEAR(balance.imbalance_J, balance.quadrature_J, 0.3 * balance.imbalance_J + 1e-5);
}

// Led up and down by a curve: what holds the coordinate to it does the work, exactly half of m v^2 where it is fastest.
TEST(EnergyBalance, PrescribedMotionDoesTheWorkOfItsConstraint) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  std::string rows = "time_s,value\n";
  for (int i = 0; i <= 100; ++i) rows += std::to_string(i * 1e-3) + "," + std::to_string(20 * std::pow(std::sin(contact::kPi * i / 200.0), 2)) + "\n";
  const TemporaryFile table("lead.csv", rows);
  const std::string rest = "analysis: {gait: {duration: 0.1 s, output_interval: 1 ms}}\n";
  const scene::Scene scene = scene::parseScene(
      liftModel(file.path(), "{prescribed: {table: " + table.path().string() + ", column: value, unit: mm, time: {column: time_s, unit: s}}}") + rest, "scene.yaml");
  const GaitResult run = runGait(scene);
  ASSERT_TRUE(run.complete) << run.statusText;
  const EnergyBalance balance = calcEnergyBalance(scene, run);
  ASSERT_TRUE(balance.known);
  EXPECT_NEAR(balance.energy_J.back(), 2 * 10 * 0.02, 1e-6);  // at rest 20 mm higher; the table has six digits
  // Midpoints of 100 intervals over half a wave: (pi/100)^2/12 of the largest kinetic energy, 0.1 J.
  EXPECT_NEAR(balance.work_J.back(), balance.energy_J.back(), 1e-4);
  EXPECT_GT(*std::max_element(balance.work_J.begin(), balance.work_J.end()), 0.39);
}

// A ball bounces from 0.1 mm. Every step may err by the accuracy times 10 m/s; N of them in a row change the energy by 2 N accuracy 10 m/s / v of its
// own at most, v = 44 mm/s at the surface.
TEST(EnergyBalance, BounceKeepsItsEnergyToTheIntegratorsTolerance) {
  const TemporaryFile urdf("bounce.urdf", kneeUrdf());
  for (const auto correction : {contact::Correction::energy, contact::Correction::none}) {
    scene::Scene scene = sphereScene(urdf.path(), 20, correction);
    scene.model->gravity_mPerS2 = {0, -9.81, 0};
    scene.model->coordinates[coordinate::y] = scene::FreeCoordinate{36.1e-3};
    scene::GaitSpec& gait = scene.gait.emplace();
    gait.settleFirst = false;
    gait.duration_s = 0.03;
    gait.outputInterval_s = 1e-4;
    gait.accuracy = 1e-8;
    const GaitResult run = runGait(scene);
    ASSERT_TRUE(run.complete) << run.statusText;
    double largestForce_N = 0;
    for (const scene::Frame& frame : run.frames) largestForce_N = std::max(largestForce_N, frame.contacts[0].total.scalarForce_N);
    ASSERT_GT(largestForce_N, 100) << "it must have bounced";
    const EnergyBalance balance = calcEnergyBalance(scene, run);
    ASSERT_TRUE(balance.known);
    const double speed = std::sqrt(2 * 9.81 * 1e-4);
    EXPECT_LT(balance.imbalance(), 2 * static_cast<double>(run.statistics.stepsTaken) * gait.accuracy * 10 / speed);
    EXPECT_LT(balance.imbalance(), 5e-3);
    EXPECT_EQ(balance.quadrature(), 0) << "no load, nothing to sum up";
  }
}

TEST(EnergyBalance, IsUnknownWhereSomethingDampsUnseen) {
  const TemporaryFile urdf("damped.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 10);
  scene.loads.push_back(testing_support::verticalLoad(-100.0));
  scene.gait.emplace().duration_s = 0.01;
  scene.contacts[0].definition.damping_sPerM = 1;
  EXPECT_FALSE(calcEnergyBalance(scene, runGait(scene)).known);
  scene.contacts[0].definition.damping_sPerM = 0;
  EXPECT_TRUE(calcEnergyBalance(scene, runGait(scene)).known);
}

// -- outcomes and boundaries --------------------------------------------------------------------------------------

// The deepest point of the ball is d below the layer's surface: full penetration begins at d/h = 1.
TEST(Stability, BisectionFindsWhereTheLayerIsUsedUp) {
  const TemporaryFile urdf("press.urdf", kneeUrdf());
  StabilityOptions options;
  options.ratio = 1.02;
  options.maxBisections = 20;
  const StabilityRow row = runStabilityAxis(pressAxis(urdf.path(), {0.2, 0.6, 1.4}), options);
  ASSERT_EQ(row.boundaries.size(), 1u);
  const StabilityBoundary& boundary = row.boundaries[0];
  EXPECT_EQ(boundary.outcome, StabilityOutcome::failed);
  EXPECT_THAT(boundary.message, HasSubstr("full penetration"));
  EXPECT_LE(boundary.good, 1 + 1e-12);
  EXPECT_GE(boundary.bad, 1 - 1e-12);
  EXPECT_LT(boundary.bad - boundary.good, 0.1 * 0.02 * 1.2);
  EXPECT_TRUE(std::is_sorted(row.cells.begin(), row.cells.end(), [](const auto& a, const auto& b) { return a.value < b.value; }));
  EXPECT_EQ(std::count_if(row.cells.begin(), row.cells.end(), [](const auto& cell) { return !cell.bisected; }), 3);
}

// An error that the limits do not allow is `wrong`, or `warned` where the program said something: here that 95 % of the layer are used up. The reference
// is told to be another scene, 10 % stiffer: the force differs by 10 % of 1.1.
TEST(Stability, TellsSilentErrorsFromThoseWithAWarning) {
  const TemporaryFile urdf("press.urdf", kneeUrdf());
  StabilityAxis axis = pressAxis(urdf.path(), {0.5, 0.97});
  axis.makeReference = [make = axis.make](double value) {
    scene::Scene scene = make(value);
    scene.contacts[0].definition.material.E_Pa *= 1.1;
    return scene;
  };
  const StabilityRow row = runStabilityAxis(axis, {});
  ASSERT_EQ(row.cells.size(), 2u);
  EXPECT_EQ(row.cells[0].outcome, StabilityOutcome::wrong);
  EXPECT_NEAR(row.cells[0].forceError, 0.1 / 1.1, 1e-9);
  EXPECT_EQ(row.cells[0].reason, "force error 9.09 % (limit 5 %)");
  EXPECT_EQ(row.cells[1].outcome, StabilityOutcome::warned);
  EXPECT_THAT(row.cells[1].message, HasSubstr("beyond"));
  axis.makeReference = {};
  EXPECT_EQ(runStabilityCell(axis, 0.5, {}).outcome, StabilityOutcome::ok);
  axis.makeReference = [](double) -> scene::Scene { throw InputError("no such scene"); };
  const StabilityCell unchecked = runStabilityCell(axis, 0.5, {});
  EXPECT_EQ(unchecked.outcome, StabilityOutcome::unchecked);
  EXPECT_THAT(unchecked.reason, HasSubstr("no such scene"));
}

// The loosest accuracy that scenes allow leaves more than 0.1 um on a walking knee; 1e-3 of it does not.
TEST(Stability, SeesALooseTolerance) {
  const TemporaryFile urdf("loose.urdf", kneeUrdf());
  StabilityAxis axis;
  axis.values = {1e-6, 1e-3};
  axis.make = [&urdf](double accuracy) {
    scene::Scene scene = kneeScene(urdf.path(), 10);
    testing_support::addGait(scene);
    scene.gait->duration_s = 0.1;
    scene.gait->accuracy = accuracy;
    return scene;
  };
  StabilityOptions options;
  options.limits.pose_m = 1e-7;
  options.maxBisections = 0;
  const StabilityRow row = runStabilityAxis(axis, options);
  ASSERT_EQ(row.cells.size(), 2u);
  EXPECT_EQ(row.cells[0].outcome, StabilityOutcome::ok) << row.cells[0].reason;
  EXPECT_EQ(row.cells[1].outcome, StabilityOutcome::wrong);
  EXPECT_THAT(row.cells[1].reason, HasSubstr("pose error"));
  ASSERT_EQ(row.boundaries.size(), 1u);
  EXPECT_EQ(row.boundaries[0].good, 1e-6);
  EXPECT_EQ(row.boundaries[0].bad, 1e-3);
}

// A ball of 30 mm pressed 0.2 mm in touches a circle of sqrt(2 R d) = 3.5 mm: rectangles of 5 mm hold it, those of 2 mm cut it off. Where the layer ends at
// 2 mm there is nothing to miss, and a second rectangle beside the first takes what it leaves.
TEST(CutOffs, AreFoundWhereTheSurfaceGoesOn) {
  const TemporaryFile urdf("cut.urdf", kneeUrdf());
  const auto find = [&](double half_m, double layerHalf_m, bool neighbour) {
    scene::Scene scene = sphereScene(urdf.path(), 20);
    scene.model->coordinates[coordinate::y] = scene::PrescribedCoordinate{35.8e-3};
    auto& parts = scene.contacts[0].definition.compartments;
    parts[0].x0_m = parts[0].z0_m = -half_m;
    parts[0].x1_m = parts[0].z1_m = half_m;
    parts[0].fixedSurface = testing_support::makeSurface(contact::makePlane(6e-3, 0, 0, contact::Solid::below, layerHalf_m));
    if (neighbour) {
      parts.push_back(parts[0]);
      parts[1].name = "beside";
      parts[1].x0_m = half_m;
      parts[1].x1_m = 5e-3;
      parts[0].z0_m = parts[1].z0_m = -5e-3;
      parts[0].z1_m = parts[1].z1_m = 5e-3;
      parts[0].x0_m = -5e-3;
    }
    const scene::Trajectory run = replay({0}, {{0, 0, 0, 0, 35.8e-3, 0}}, scene, {}, false);
    return findCutOffs(scene, run.frames);
  };
  EXPECT_TRUE(find(5e-3, 20e-3, false).empty());
  EXPECT_TRUE(find(2e-3, 2e-3, false).empty());
  EXPECT_TRUE(find(2e-3, 20e-3, true).empty());
  const std::vector<CutOff> cut = find(2e-3, 20e-3, false);
  ASSERT_EQ(cut.size(), 1u);
  EXPECT_EQ(cut[0].compartment, "layer");
  EXPECT_GT(cut[0].outside_N, 0.1 * cut[0].force_N);  // 20 % more side: 44 % more area, at lower pressure
  EXPECT_LT(cut[0].outside_N, 0.44 * cut[0].force_N);
}

TEST(Stability, RefusalsAndTimeLimitsAreOutcomes) {
  const TemporaryFile urdf("refuse.urdf", kneeUrdf());
  StabilityAxis axis;
  axis.scale = Scale::toHalf;
  axis.values = {0.4, 0.5};
  axis.make = [&urdf](double nu) {
    scene::Scene scene = sphereScene(urdf.path(), 10);
    scene.contacts[0].definition.material.nu = nu;
    scene.loads.push_back(testing_support::verticalLoad(-100.0));
    return scene;
  };
  StabilityOptions options;
  options.maxBisections = 3;
  const StabilityRow row = runStabilityAxis(axis, options);
  EXPECT_EQ(row.cells.front().outcome, StabilityOutcome::ok);
  EXPECT_EQ(row.cells.back().outcome, StabilityOutcome::refused);
  ASSERT_EQ(row.boundaries.size(), 1u);
  EXPECT_THAT(row.boundaries[0].message, HasSubstr("0.5"));
  options.cpuLimit_s = 0;
  const StabilityCell slow = runStabilityCell(axis, 0.4, options);
  EXPECT_EQ(slow.outcome, StabilityOutcome::slow);
}

TEST(Stability, MiddlesLieBetween) {
  StabilityAxis axis;
  axis.values = {1, 100};
  EXPECT_DOUBLE_EQ(axis.middle(1, 100), 10);
  EXPECT_DOUBLE_EQ(axis.middle(0, 100), 10);
  EXPECT_TRUE(axis.isNarrow(10, 12, 1.25));
  EXPECT_FALSE(axis.isNarrow(10, 13, 1.25));
  axis.scale = Scale::toHalf;
  EXPECT_DOUBLE_EQ(axis.middle(0.4, 0.499), 0.49);
  EXPECT_NEAR(axis.middle(0.4, 0.5), 0.499, 1e-12);
  EXPECT_FALSE(axis.isNarrow(0.4, 0.5, 1.25));
  axis.scale = Scale::linear;
  axis.values = {-50, 50};
  EXPECT_EQ(axis.middle(-50, 50), 0);
}

// -- scenes -------------------------------------------------------------------------------------------------------

std::vector<std::string> namesOf(const std::vector<StabilityAxis>& axes) {
  std::vector<std::string> names;
  for (const StabilityAxis& axis : axes) names.push_back(axis.name);
  return names;
}

TEST(Stability, VariesWhatAUsersSceneHas) {
  const TemporaryFile urdf("own.urdf", kneeUrdf(3));
  const auto folder = std::filesystem::temp_directory_path();
  scene::Scene scene = kneeScene(urdf.path(), 10);
  EXPECT_THAT(namesOf(listSceneAxes(scene, folder, false)), ElementsAre("modulus", "Poisson's ratio", "load"));
  testing_support::addGait(scene);
  const std::vector<StabilityAxis> axes = listSceneAxes(scene, folder, false);
  EXPECT_THAT(namesOf(axes), ElementsAre("modulus", "Poisson's ratio", "load", "mass", "accuracy", "step"));
  EXPECT_EQ(axes[0].make(10).contacts[0].definition.material.E_Pa, 10 * scene.contacts[0].definition.material.E_Pa);
  EXPECT_EQ(std::get<scene::TimeSeries>(axes[2].make(2).loads[0].force_N[1]).value[7], 2 * std::get<scene::TimeSeries>(scene.loads[0].force_N[1]).value[7]);
  const scene::Scene heavy = axes[3].make(10);
  const std::string text = io::readFile(heavy.model->urdf);
  EXPECT_THAT(text, HasSubstr("<mass value='30'/>"));
  EXPECT_THAT(text, HasSubstr("ixx='0.2' ixy='0.01' ixz='0' iyy='0.1'"));
  std::filesystem::remove(heavy.model->urdf);
  scene.contacts.clear();
  EXPECT_THROW(listSceneAxes(scene, folder, false), InputError);
}

/** A folder that exists as long as the object. */
struct TemporaryFolder {
  std::filesystem::path path = std::filesystem::temp_directory_path() / ("genu-stability-test-" + std::to_string(::getpid()));
  TemporaryFolder() { std::filesystem::create_directories(path); }
  ~TemporaryFolder() { std::filesystem::remove_all(path); }
};

// The ends of every built-in axis make a scene, or are refused with the place and what is allowed.
TEST(Stability, BuiltInScenesAreScenes) {
  const TemporaryFolder folder;
  int refused = 0;
  for (const StabilityAxis& axis : listBuiltInAxes(folder.path, true)) {
    ASSERT_TRUE(std::is_sorted(axis.values.begin(), axis.values.end())) << axis.name;
    for (const double value : {axis.values.front(), axis.values.back()}) {
      try {
        const scene::Scene scene = axis.make(value);
        EXPECT_TRUE(scene.model.has_value());
        EXPECT_EQ(scene.contacts.size(), 1u);
      } catch (const InputError& error) {
        ++refused;
        EXPECT_THAT(error.what(), HasSubstr("allowed")) << axis.name << " " << value;
        EXPECT_THAT(error.what(), HasSubstr("scene.yaml:")) << axis.name << " " << value;
      }
    }
  }
  EXPECT_GT(refused, 0);
  for (const DriftCase& drift : listDriftCases(folder.path, true)) EXPECT_EQ(drift.scene.gait->duration_s, 600);
}

// A ball that rocks in a dish for a fifth of a second: the energy-consistent force keeps its energy to what the integrator loses, the paper's form does not: force and
// energy there belong to distances that differ in the order of theta^2.
TEST(Stability, DriftOfTheEnergyFormIsTheIntegratorsAndThePapersIsNot) {
  const TemporaryFolder folder;
  std::vector<DriftCase> cases = listDriftCases(folder.path, false);
  ASSERT_EQ(cases.size(), 2u);
  std::vector<DriftResult> results;
  for (DriftCase& drift : cases) {
    drift.scene.gait->integrator = "cpodes";
    drift.scene.gait->maxOrder = 5;
    drift.scene.gait->accuracy = 1e-8;
    drift.scene.gait->duration_s = 0.2;
    drift.scene.gait->outputInterval_s = 1e-3;
    results.push_back(runDrift(drift));
    EXPECT_EQ(results.back().problem, "");
    EXPECT_EQ(results.back().time_s.size(), 201u);
    EXPECT_GT(results.back().memoryEnd_MB, 0);
  }
  EXPECT_LT(results[0].largest, 1e-4);
  EXPECT_GT(results[1].largest, 1e-3);
}

TEST(Stability, StopsWhenAsked) {
  const TemporaryFile urdf("stop.urdf", kneeUrdf());
  const std::vector<StabilityAxis> axes = {pressAxis(urdf.path(), {0.2, 0.4}), pressAxis(urdf.path(), {0.3, 0.6})};
  EXPECT_TRUE(measureStability(axes, {}, {}).complete);
  const Stability stopped = measureStability(axes, {}, {}, [](double share) { return share < 0.3; });
  EXPECT_FALSE(stopped.complete);
  EXPECT_LT(stopped.rows.size(), 2u);
}

}  // namespace
}  // namespace genu::model
