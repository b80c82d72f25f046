#include "genu/model/Verification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "KneeFixtures.h"

namespace genu::model {
namespace {

using ::testing::HasSubstr;
using testing_support::kneeScene;
using testing_support::kneeUrdf;
using testing_support::TemporaryFile;

const VerifyRow* find(const Verification& v, const std::string& group, double factor, contact::ContactRule rule) {
  const auto found = std::find_if(v.rows.begin(), v.rows.end(), [&](const VerifyRow& row) {
    return row.setting.group == group && row.setting.factorX == factor && row.setting.rule == rule;
  });
  return found == v.rows.end() ? nullptr : &*found;
}

// A static knee: the centre rule errs more than the smooth one on the same grid, and a finer grid less. The recommendation is the cheapest of those within
// the asked errors, and what it gives when it is run again is what it gave (errors do not depend on the machine's load).
TEST(Verify, RanksGridsOfAStaticScene) {
  const TemporaryFile urdf("verify.urdf", kneeUrdf());
  const scene::Scene scene = kneeScene(urdf.path(), 12);
  VerifyOptions options;
  options.repeats = 1;
  options.poseError_m = 2e-6;
  const Verification v = verify(scene, options);
  ASSERT_TRUE(v.complete);
  EXPECT_EQ(v.reference.factorX, 3);
  using Rule = contact::ContactRule;
  const VerifyRow *smooth = find(v, "grid", 1, Rule::smooth), *fine = find(v, "grid", 1.5, Rule::smooth), *centre = find(v, "grid", 1, Rule::centre);
  ASSERT_TRUE(smooth != nullptr && fine != nullptr && centre != nullptr);
  EXPECT_LT(smooth->forceError_N, centre->forceError_N);
  EXPECT_LT(smooth->poseError_m, centre->poseError_m);
  for (const VerifyRow& row : v.rows) {
    EXPECT_EQ(row.problem, "") << row.setting.describe();
    ASSERT_EQ(row.coordinateErrors_m.size(), 3u);
    EXPECT_EQ(row.poseError_m, *std::max_element(row.coordinateErrors_m.begin(), row.coordinateErrors_m.end()));
    if (!row.onFrontPose) continue;
    for (const VerifyRow& other : v.rows) EXPECT_FALSE(other.cpu_s < row.cpu_s && other.poseError_m < row.poseError_m);
  }
  ASSERT_GE(v.recommended, 0);
  const VerifyRow& chosen = v.rows[static_cast<size_t>(v.recommended)];
  EXPECT_LE(chosen.poseError_m, options.poseError_m);
  EXPECT_EQ(v.confirmed.poseError_m, chosen.poseError_m);
  EXPECT_EQ(v.confirmed.forceError_N, chosen.forceError_N);
}

TEST(Verify, IntegratesASceneWithGaitAndSaysWhatFails) {
  const TemporaryFile urdf("verify_gait.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 10);
  testing_support::addGait(scene);
  scene.gait->duration_s = 0.05;
  VerifyOptions options;
  options.repeats = 1;
  options.poseError_m = 1e-15;  // nothing is within
  const Verification v = verify(scene, options);
  ASSERT_TRUE(v.complete);
  EXPECT_EQ(v.recommended, -1);
  EXPECT_DOUBLE_EQ(v.reference.accuracy, 1e-6);
  const auto integrators = std::count_if(v.rows.begin(), v.rows.end(), [](const VerifyRow& row) { return row.setting.group == "integrator"; });
  EXPECT_EQ(integrators, 6);  // CPODES and generalized-alpha, three settings each
  for (const VerifyRow& row : v.rows) {
    EXPECT_EQ(row.setting.integrator == "generalized-alpha", row.setting.step_s > 0);
    EXPECT_TRUE(!row.problem.empty() || row.steps > 0) << row.setting.describe();
  }
  scene::Scene without = scene;
  without.contacts.clear();
  EXPECT_THROW(listVerifySettings(without, options), InputError);
}

// Tolerances of the scene's own follow the accuracies that are tried and that of the reference; kept as they are, every row would take the same steps. What the scene says of order
// and constraints belongs to its own integrator.
TEST(Verify, VariesAccuracyWhereTolerancesAreGiven) {
  const TemporaryFile urdf("verify_tolerances.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path(), 8);
  testing_support::addGait(scene, 11);
  scene.gait->duration_s = 0.05;
  scene.gait->integrator = "cpodes";
  scene.gait->maxOrder = 3;
  scene.gait->prescribed = scene::GaitSpec::Prescribed::constraints;
  scene.gait->tolerances = {1e-7, 4e-6, 1e-3, 0.04};
  VerifyOptions options;
  options.repeats = 1;
  const std::vector<VerifySetting> settings = listVerifySettings(scene, options);
  EXPECT_EQ(settings[0].maxOrder, 3);
  EXPECT_TRUE(settings[0].constraints);
  EXPECT_THAT(settings[0].describe(), HasSubstr("order 3"));
  const Verification v = verify(scene, options);
  std::vector<long> steps;
  for (const VerifyRow& row : v.rows) {
    EXPECT_EQ(row.problem, "") << row.setting.describe();
    if (row.setting.group != "integrator") continue;
    EXPECT_EQ(row.setting.maxOrder, 0);
    EXPECT_FALSE(row.setting.constraints);
    if (row.setting.integrator == "cpodes") steps.push_back(row.steps);  // 3e-4, 1e-4, 1e-5
  }
  ASSERT_EQ(steps.size(), 3u);
  EXPECT_GT(steps[2], 1.3 * static_cast<double>(steps[0]));
  scene.gait->maxOrder = 7;
  EXPECT_THROW(verify(scene, options), InputError);
}

TEST(Verify, StopsWhenAsked) {
  const TemporaryFile urdf("verify_stop.urdf", kneeUrdf());
  const scene::Scene scene = kneeScene(urdf.path(), 10);
  const Verification v = verify(scene, {}, [](double share) { return share < 0.6; });
  EXPECT_FALSE(v.complete);
  EXPECT_LT(v.rows.size(), listVerifySettings(scene, {}).size());
}

}  // namespace
}  // namespace genu::model
