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
  for (const char* name : {"knee_with_ligaments/natural.yaml", "knee_with_ligaments/natural_menisci.yaml", "knee_with_ligaments/artificial.yaml", "musculoskeletal_knee/isometric.yaml",
                           "musculoskeletal_knee/leg_extension.yaml"}) {
    SCOPED_TRACE(name);
    const scene::Scene scene = read(name);
    EXPECT_TRUE(scene.unused.empty());
    EXPECT_GT(scene.elements.size(), 10u);
  }
}

// Known without the model: the tendon carries what the quadriceps pull less what contact and retinacula take along it, so up to 45 degrees,
// where these are slack, its tension is between half and all of 10 N, and a little where they pull with it; the tibia turns inwards as it
// bends (screw-home); the posterior capsule lets go; both contacts last to 120 degrees. Passive motion of the knee that the ligaments were
// measured on, dynamic MRI (opensim-jam-org/jam-resources): its femoral origin is 34.4 to 35.5 mm above the tibial one near extension, 33.8 to 34.6
// at 27 to 33 degrees; 0.5 mm for what the generator's arcs leave out.
TEST(KneeWithLigaments, NaturalKneeBends) {
  const scene::Scene scene = read("knee_with_ligaments/natural.yaml");
  const scene::Trajectory run = model::runSeries(scene);
  ASSERT_TRUE(run.complete) << run.statusText;
  ASSERT_EQ(run.frames.size(), 41u);  // every 3 degrees
  for (size_t i = 0; i < run.frames.size(); ++i) {
    const scene::Frame& frame = run.frames[i];
    SCOPED_TRACE(3.0 * static_cast<double>(i));
    for (const auto& contact : frame.contacts) {
      EXPECT_GT(contact.total.activeElements, 0);
      EXPECT_EQ(contact.total.notConvergedQueries, 0);
    }
    const double tendon = sumForces(run.elementColumns, frame.elements, "PT");
    if (i <= 15) {
      EXPECT_TRUE(tendon > 5 && tendon < 11) << tendon;
    }
  }
  EXPECT_LT(run.frames[10].q[1], run.frames[0].q[1] - 3 * kDegree);
  EXPECT_NEAR(run.frames[0].q[4], 34.95e-3, 1.05e-3);
  EXPECT_NEAR(run.frames[10].q[4], 34.2e-3, 0.9e-3);
  EXPECT_GT(sumForces(run.elementColumns, run.frames[0].elements, "pCAP"), 10);
  EXPECT_EQ(sumForces(run.elementColumns, run.frames[10].elements, "pCAP"), 0);
}

TEST(KneeWithLigaments, ArtificialKneeBends) {
  const scene::Trajectory run = model::runSeries(read("knee_with_ligaments/artificial.yaml"));
  EXPECT_TRUE(run.complete) << run.statusText;
}

double drawer_m(const scene::Scene& scene, double flexion_deg) {
  KneeExperiment experiment;
  experiment.flexion_rad = flexion_deg * kDegree;
  experiment.loadedAxis = 3;
  experiment.load = 90;
  const auto result = runKneeExperiment(scene, experiment);
  EXPECT_TRUE(result.trajectory.complete) << result.trajectory.statusText;
  EXPECT_EQ(result.load.back(), 90);
  EXPECT_NEAR(result.flexion_rad.back(), flexion_deg * kDegree, 1e-15);
  const auto& frames = result.trajectory.frames;
  EXPECT_NEAR(frames.back().q[2], -flexion_deg * kDegree, 1e-12);
  return frames.back().q[3] - frames[result.firstLoaded].q[3];
}

// The clinical sign: at 30 degrees the cruciate that is cut is the one that held. Published, 12 knees, 90 N (doi
// 10.1007/s00167-019-05839-y): 6.0 (SD 2.5) intact, 12.9 (SD 2.5) cut; within 1.2 standard deviations here, as measured (3.2 and 12.3 mm):
// neither ligaments nor surfaces were adjusted to it.
TEST(KneeWithLigaments, CuttingTheAclLoosensTheDrawer) {
  const scene::Scene intact = read("knee_with_ligaments/natural.yaml");
  const double before = drawer_m(intact, 30), after = drawer_m(model::withoutElements(intact, "ACL"), 30);
  EXPECT_NEAR(before, 6.0e-3, 1.2 * 2.5e-3);
  EXPECT_NEAR(after, 12.9e-3, 1.2 * 2.5e-3);
  EXPECT_GT(after, 2 * before);
}

// At 90 degrees a knee of wrong height finds no equilibrium at all.
TEST(KneeWithLigaments, DrawerAtNinetyDegrees) { EXPECT_GT(drawer_m(read("knee_with_ligaments/natural.yaml"), 90), 0.3e-3); }

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
