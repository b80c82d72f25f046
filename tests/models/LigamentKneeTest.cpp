#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "ModelFiles.h"
#include "genu/model/Experiments.h"
#include "genu/model/ForceElement.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/TimeCurve.h"
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
                           "musculoskeletal_knee/leg_extension.yaml", "musculoskeletal_knee/step.yaml"}) {
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

size_t findCoordinate(const scene::Scene& scene, const std::string& name) {
  const auto coordinates = scene.coordinates();
  size_t i = 0;
  while (coordinates.at(i).name != name) ++i;
  return i;
}

TEST(MusculoskeletalKnee, LegExtension) {
  const scene::Scene scene = read("musculoskeletal_knee/leg_extension.yaml");
  const model::GaitResult result = model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  const size_t flexion = findCoordinate(scene, "tibiofemoral.rz");
  // It begins at rest, and the quadriceps extend: flexion (positive in this tree) falls.
  EXPECT_NEAR(result.frames.front().qdot[flexion], 0, 2 * kDegree);
  double least = result.frames.front().q[flexion];
  for (const auto& frame : result.frames) {
    EXPECT_LT(frame.q[flexion], result.frames.front().q[flexion] + kDegree);
    least = std::min(least, frame.q[flexion]);
  }
  EXPECT_LT(least, result.frames.front().q[flexion] - 20 * kDegree);
}

/** Force [N] that is left over on the patella after tendons, retinacula, contact, gravity, damping and mass times acceleration. `n`: a frame that
 has neighbours. */
double calcPatellaResidual_N(const model::KneeSystem& knee, SimTK::State& state, const model::GaitResult& run, size_t n) {
  const auto pose = [&](const scene::Frame& frame) {
    knee.prescribe(state, frame.time_s, false);
    for (int i = 0; i < knee.numCoordinates(); ++i) {
      state.updQ()[knee.stateIndex(i)] = frame.q[static_cast<size_t>(i)];
      state.updU()[knee.stateIndex(i)] = frame.qdot[static_cast<size_t>(i)];
    }
    knee.system().realize(state, SimTK::Stage::Velocity);
  };
  const SimTK::MobilizedBody& patella = knee.body(knee.urdf().findLink("patella"));
  const double dt = run.frames[n].time_s - run.frames[n - 1].time_s, mass = 0.0862;
  pose(run.frames[n - 1]);
  const SimTK::Vec3 before = patella.getBodyOriginLocation(state);
  pose(run.frames[n + 1]);
  const SimTK::Vec3 after = patella.getBodyOriginLocation(state);
  const scene::Frame& frame = run.frames[n];
  pose(frame);
  SimTK::Vec3 sum = mass * (SimTK::Vec3(0, -9.81, 0) - (after - 2 * patella.getBodyOriginLocation(state) + before) / (dt * dt));

  size_t column = 0;
  for (const auto& element : knee.elements()) {
    while (run.elementColumns[column].element != element->definition().name) ++column;
    const double tension = frame.elements[column];  // the first column of each
    const auto* ligament = dynamic_cast<const scene::LigamentDefinition*>(&element->definition());
    const auto& path = ligament ? ligament->path : dynamic_cast<const scene::MuscleDefinition&>(element->definition()).path;
    const std::vector<contact::Vec3> line = element->calcPath(state);
    for (size_t i = 0; i < path.points.size(); ++i) {
      if (path.points[i].body != "patella") continue;
      const contact::Vec3& p = path.points[i].point_m;
      const SimTK::Vec3 P = patella.findStationLocationInGround(state, SimTK::Vec3(p.x(), p.y(), p.z()));
      const auto vertex = std::min_element(line.begin(), line.end(), [&](const contact::Vec3& a, const contact::Vec3& b) {
        const contact::Vec3 at(P[0], P[1], P[2]);
        return (a - at).norm() < (b - at).norm();
      });
      const auto pull = [&](const contact::Vec3& towards) {
        const contact::Vec3 direction = (towards - *vertex).normalized();
        sum += tension * SimTK::Vec3(direction.x(), direction.y(), direction.z());
      };
      if (i > 0 && path.points[i - 1].body != "patella") pull(*(vertex - 1));
      if (i + 1 < path.points.size() && path.points[i + 1].body != "patella") pull(*(vertex + 1));
    }
  }
  const auto& at = knee.contact().attachment(1);
  const contact::Vec3& onFemur = frame.contacts[1].total.forceOnM_F;
  const SimTK::Rotation R_GF = knee.matter().getMobilizedBody(at.fixed).getBodyRotation(state) * at.X_FixedF.R();
  sum -= R_GF * SimTK::Vec3(onFemur.x(), onFemur.y(), onFemur.z());
  SimTK::Vec3 speed;
  for (int k = 0; k < 3; ++k) speed[k] = frame.qdot[findCoordinate(knee.scene(), std::string("patellofemoral.") + "xyz"[k])];
  sum -= 30 * (patella.getParentMobilizedBody().getBodyRotation(state) * speed);  // damping of the joint, N s/m
  return sum.norm();
}

// The stance phase under the whole body weight. Measured: the error stays below 1.6 degrees to 57 % of the cycle and grows to 6.6 at 60 %, where flexion
// has to rise by 400 degrees per second; without the muscles the ground reaction bends it beyond 100 degrees in 0.24 s. The largest
// force on the tibia is 4.5 times the body weight; in vivo it is 2.2 to 2.6 (docs/experiments.md says why this model's is larger). No contact
// can press less than the ground does: the largest ground reaction is 1.1 body weights.
TEST(MusculoskeletalKnee, StepUnderBodyWeight) {
  const scene::Scene scene = read("musculoskeletal_knee/step.yaml");
  const model::GaitResult result = model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  const size_t flexion = findCoordinate(scene, "tibiofemoral.rz");
  const scene::TimeFunction* target = nullptr;
  for (const auto& element : scene.elements) {
    if (element->name != "vaslat") continue;
    const auto& muscle = dynamic_cast<const scene::MuscleDefinition&>(*element);
    target = &std::get<scene::TrackingController>(muscle.excitation).target;
  }
  ASSERT_NE(target, nullptr);
  const model::TimeCurve curve(*target);
  constexpr double kWeight_N = 62 * 9.81;
  double largest_N = 0;
  // It does not begin with a jolt; the target's rate there is 5 degrees per second.
  EXPECT_LT(std::abs(result.frames.front().qdot[flexion]), 10 * kDegree);
  for (const auto& frame : result.frames) {
    SCOPED_TRACE(frame.time_s);
    const double error = frame.q[flexion] - curve.calcValue(frame.time_s);
    EXPECT_LT(std::abs(error), (frame.time_s < 0.67 ? 2 : 9) * kDegree);
    for (const double value : frame.q) EXPECT_TRUE(std::isfinite(value));
    for (const double value : frame.elements) EXPECT_TRUE(std::isfinite(value));
    for (size_t i = 0; i < result.elementColumns.size(); ++i) {
      if (result.elementColumns[i].quantity != "force") continue;
      EXPECT_GE(frame.elements[i], 0) << result.elementColumns[i].element;
    }
    ASSERT_EQ(frame.contacts.size(), 2u);
    for (const auto& contact : frame.contacts) {
      EXPECT_GT(contact.total.scalarForce_N, 0);
      EXPECT_EQ(contact.total.notConvergedQueries, 0);
    }
    largest_N = std::max(largest_N, frame.contacts[0].total.scalarForce_N);
  }
  // The patella weighs 86 g: what muscles and tendon leave over is pressed on the femur. Left: differences over 10 ms and the steps' error.
  model::KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  for (size_t n = 5; n + 1 < result.frames.size(); n += 10) EXPECT_LT(calcPatellaResidual_N(knee, state, result, n), 3) << n;
  EXPECT_GT(largest_N, 2.2 * kWeight_N);
  EXPECT_LT(largest_N, 5.5 * kWeight_N);
}

}  // namespace
}  // namespace genu::models_test
