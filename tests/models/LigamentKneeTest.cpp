#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "ModelFiles.h"
#include "genu/model/Experiments.h"
#include "genu/scene/SceneFile.h"

namespace genu::models_test {
namespace {

using ::testing::HasSubstr;
using model::KneeExperiment;
using model::runKneeExperiment;

constexpr double kDegree = contact::kPi / 180;

scene::Scene read(const char* name) { return scene::readScene(modelFolder() / name, {{}, true, {}}); }

/** Sum of the forces of all elements whose names begin with `prefix`. */
double sumForces(const std::vector<scene::ElementColumn>& columns, const std::vector<double>& values, const std::string& prefix) {
  double sum = 0;
  for (size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].quantity == "force" && columns[i].element.rfind(prefix, 0) == 0) sum += values[i];
  }
  return sum;
}

TEST(KneeWithLigaments, AllScenesAreReadAndUseWhatTheyDefine) {
  for (const char* name : {"knee_with_ligaments/natural.yaml", "knee_with_ligaments/artificial.yaml", "musculoskeletal_knee/isometric.yaml",
                           "musculoskeletal_knee/leg_extension.yaml"}) {
    SCOPED_TRACE(name);
    const scene::Scene scene = read(name);
    EXPECT_TRUE(scene.unused.empty());
    EXPECT_GT(scene.elements.size(), 10u);
  }
}

// Known without the model: the tendon carries what the quadriceps pull less what the patella's contact takes along them, so its tension is
// between half and all of 100 N; the tibia turns inwards as it bends (screw-home); the posterior capsule lets go; forces stay finite.
TEST(KneeWithLigaments, NaturalKneeBends) {
  const scene::Scene scene = read("knee_with_ligaments/natural.yaml");
  const scene::Trajectory run = model::runSeries(scene);
  ASSERT_TRUE(run.complete) << run.statusText;
  ASSERT_EQ(run.frames.size(), 21u);
  for (const scene::Frame& frame : run.frames) {
    SCOPED_TRACE(frame.time_s);
    for (const auto& contact : frame.contacts) {
      EXPECT_GT(contact.total.activeElements, 0);
      EXPECT_EQ(contact.total.notConvergedQueries, 0);
    }
    const double tendon = sumForces(run.elementColumns, frame.elements, "PT");
    EXPECT_TRUE(tendon > 50 && tendon < 110) << tendon;
  }
  EXPECT_LT(run.frames[10].q[1], run.frames[0].q[1] - 3 * kDegree);
  EXPECT_GT(sumForces(run.elementColumns, run.frames[0].elements, "pCAP"), 10);
  EXPECT_EQ(sumForces(run.elementColumns, run.frames[10].elements, "pCAP"), 0);
}

TEST(KneeWithLigaments, ArtificialKneeBends) {
  const scene::Trajectory run = model::runSeries(read("knee_with_ligaments/artificial.yaml"));
  EXPECT_TRUE(run.complete) << run.statusText;
}

double drawer_m(const scene::Scene& scene) {
  KneeExperiment experiment;
  experiment.flexion_rad = 30 * kDegree;
  experiment.loadedAxis = 3;
  experiment.load = 90;
  const auto result = runKneeExperiment(scene, experiment);
  EXPECT_TRUE(result.trajectory.complete) << result.trajectory.statusText;
  EXPECT_EQ(result.load.back(), 90);
  EXPECT_NEAR(result.flexion_rad.back(), 30 * kDegree, 1e-15);
  const auto& frames = result.trajectory.frames;
  EXPECT_NEAR(frames.back().q[2], -30 * kDegree, 1e-12);
  return frames.back().q[3] - frames[result.firstLoaded].q[3];
}

// The clinical sign: at 30 degrees the cruciate that is cut is the one that held.
TEST(KneeWithLigaments, CuttingTheAclLoosensTheDrawer) {
  const scene::Scene intact = read("knee_with_ligaments/natural.yaml");
  const double before = drawer_m(intact), after = drawer_m(model::withoutElements(intact, "ACL"));
  EXPECT_GT(before, 0.5e-3);
  EXPECT_GT(after, 2 * before);
}

TEST(KneeWithLigaments, ExperimentsRefuseWhatTheyCannotDo) {
  const scene::Scene scene = read("knee_with_ligaments/natural.yaml");
  const auto errorOf = [&](const KneeExperiment& experiment) -> std::string {
    try {
      runKneeExperiment(scene, experiment);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  };
  KneeExperiment experiment;
  experiment.joint = "tibiofemural";
  EXPECT_THAT(errorOf(experiment), HasSubstr("did you mean \"tibiofemoral\""));
  experiment = {};
  experiment.loadedAxis = 2;
  EXPECT_THAT(errorOf(experiment), HasSubstr("flexion is held"));
  experiment = {};
  experiment.flexion_rad = -0.1;
  EXPECT_THAT(errorOf(experiment), HasSubstr("allowed: 0 to 180"));
  EXPECT_THROW(model::withoutElements(scene, "XYZ"), InputError);
}

TEST(MusculoskeletalKnee, IsometricContraction) {
  const scene::Scene scene = read("musculoskeletal_knee/isometric.yaml");
  const model::StaticResult result = model::runStatic(scene);
  ASSERT_EQ(result.status, model::StaticResult::Status::converged) << result.statusText;
  for (const auto& contact : result.contacts) EXPECT_GT(contact.total.scalarForce_N, 50);
  for (size_t i = 0; i < result.elementColumns.size(); ++i) {
    if (result.elementColumns[i].keyword == "muscles" && result.elementColumns[i].quantity == "state") {
      EXPECT_EQ(result.elements[i], 0) << result.elementColumns[i].element;
    }
  }
}

TEST(MusculoskeletalKnee, LegExtension) {
  const scene::Scene scene = read("musculoskeletal_knee/leg_extension.yaml");
  const model::GaitResult result = model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  const auto coordinates = scene.coordinates();
  size_t flexion = 0;
  while (coordinates[flexion].name != "tibiofemoral.rz") ++flexion;
  // The quadriceps extend: flexion (positive in this tree) falls.
  EXPECT_LT(result.frames.back().q[flexion], result.frames.front().q[flexion] - 5 * kDegree);
}

}  // namespace
}  // namespace genu::models_test
