#include <gtest/gtest.h>

#include <cmath>

#include "ModelFiles.h"
#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"

namespace genu::models_test {
namespace {

struct Loads {
  contact::NetLoad medial, lateral;
};

/** Loads by name, whether the sides are compartments of one pair or pairs of their own. */
Loads findSides(const scene::Scene& scene, const std::vector<contact::ContactResult>& results) {
  Loads loads;
  for (size_t pair = 0; pair < results.size(); ++pair) {
    const auto& compartments = scene.contacts[pair].definition.compartments;
    for (size_t i = 0; i < compartments.size(); ++i) {
      const bool medial = (scene.contacts[pair].name + compartments[i].name).find("medial") != std::string::npos;
      (medial ? loads.medial : loads.lateral) = results[pair].compartments[i];
    }
  }
  return loads;
}

double calcMedialShare(const Loads& loads) {
  return loads.medial.scalarForce_N / (loads.medial.scalarForce_N + loads.lateral.scalarForce_N);
}

void expectSoundContact(const Loads& loads, double maxStrain) {
  for (const contact::NetLoad* load : {&loads.medial, &loads.lateral}) {
    EXPECT_GT(load->activeElements, 0);
    EXPECT_EQ(load->boundaryElements, 0);
    EXPECT_EQ(load->notConvergedQueries, 0);
    EXPECT_EQ(load->noThicknessElements, 0);
    EXPECT_LT(load->maxStrain, maxStrain);
  }
}

TEST(ShippedScenes, AllAreReadWithoutErrors) {
  for (const char* name :
       {"artificial_knee/gait.yaml", "artificial_knee/gait_damped.yaml", "artificial_knee/gait_power_law.yaml", "artificial_knee/static.yaml",
        "natural_knee/static.yaml", "natural_knee/static_large_strain.yaml", "natural_knee/gait.yaml", "natural_knee/gait_damped.yaml"}) {
    SCOPED_TRACE(name);
    const scene::Scene scene = scene::readScene(modelFolder() / name, {{}, true, {}});
    EXPECT_TRUE(scene.unused.empty());
    EXPECT_EQ(scene.contacts.size(), 1u);
  }
}

/** Statics gives 70 % for contact centers 48 mm apart and a load 9.6 mm off the middle; the centers move with the pose,
 by some tenths of a millimeter each. */
TEST(ShippedScenes, ArtificialKneeCarriesSeventyPercentMedially) {
  const scene::Scene scene = scene::readScene(modelFolder() / "artificial_knee/static.yaml", {{}, true, {}});
  const model::StaticResult result = model::runStatic(scene);
  ASSERT_EQ(result.status, model::StaticResult::Status::converged) << result.statusText;
  const Loads loads = findSides(scene, result.contacts);
  expectSoundContact(loads, 0.03);
  EXPECT_NEAR(calcMedialShare(loads), 0.70, 0.02);
  EXPECT_NEAR((loads.medial.forceOnM_F + loads.lateral.forceOnM_F).y(), 2100, 1e-3);
  // Newton and implicit Euler stop at different criteria: 1e-6 N, and 1e-3 m/s^2 of 0.3 kg over 1e7 N/m.
  EXPECT_LT(result.methodDifference_m.value(), 1e-7);
}

TEST(ShippedScenes, NaturalKneeHasTheSharesOfThePaper) {
  for (const char* name : {"natural_knee/static.yaml", "natural_knee/static_large_strain.yaml"}) {
    SCOPED_TRACE(name);
    const scene::Scene scene = scene::readScene(modelFolder() / name, {{}, true, {}});
    const model::StaticResult result = model::runStatic(scene);
    ASSERT_EQ(result.status, model::StaticResult::Status::converged) << result.statusText;
    const Loads loads = findSides(scene, result.contacts);
    expectSoundContact(loads, 0.5);
    // 565.6 / (565.6 + 513.7); 1 mm of offset is 2.3 %, the offset is given to 1 mm.
    EXPECT_NEAR(calcMedialShare(loads), 0.524, 0.0115);
    EXPECT_NEAR((loads.medial.forceOnM_F + loads.lateral.forceOnM_F).y(), 1000, 1e-3);
  }
}

/** Inside the dishes during the whole cycle: no element behind the border of the femoral patch, none at the edge of the
 grid, both sides loaded. The natural knee's medial contact reaches the anterior rim of its plateau near extension: its condyle
 is centered 5.7 mm anterior, the plateau ends at 19.85. The force there is below 1 % of the compartment's. */
class ShippedGait : public testing::TestWithParam<const char*> {};
TEST_P(ShippedGait, StaysInsideItsSurfaces) {
  const scene::Scene scene = scene::readScene(modelFolder() / GetParam(), {{}, true, {}});
  const model::GaitResult result = model::runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  ASSERT_EQ(result.frames.size(), 101u);
  const bool artificial = std::string(GetParam()).find("artificial") != std::string::npos;
  const auto pairs = scene::makeContactPairs(scene);
  contact::ContactWorkspace workspace(*pairs.at(0));
  contact::ContactResult evaluated;
  for (const scene::Frame& frame : result.frames) {
    SCOPED_TRACE(frame.time_s);
    expectSoundContact(findSides(scene, frame.contacts), artificial ? 0.03 : 0.5);
    pairs[0]->evaluate(scene::takeSix(frame.q), workspace, {}, evaluated);
    const auto fields = pairs[0]->calcFields(workspace);
    for (size_t c = 0; c < fields.size(); ++c) {
      const auto& compartment = scene.contacts[0].definition.compartments[c];
      double sum_N = 0, atEdge_N = 0;
      for (const contact::ElementField& element : fields[c]) {
        if (!element.active) continue;
        sum_N += element.force_N;
        const bool anterior = element.ix == 0;
        if (anterior) atEdge_N += element.force_N;
        EXPECT_TRUE((!artificial || !anterior) && element.ix < compartment.nx - 1 && element.iz > 0 &&
                    element.iz < compartment.nz - 1)
            << compartment.name << " element " << element.ix << ", " << element.iz;
      }
      EXPECT_LE(atEdge_N, 0.01 * sum_N) << compartment.name;
    }
  }
  if (!artificial) return;
  // Maximum load, 3.0 x 700 N at 16 % of the cycle.
  const Loads peak = findSides(scene, result.frames[16].contacts);
  EXPECT_NEAR(calcMedialShare(peak), 0.70, 0.02);
  // Inertia of 0.3 kg: some newtons.
  EXPECT_NEAR((peak.medial.forceOnM_F + peak.lateral.forceOnM_F).y(), 2100, 10);
}
INSTANTIATE_TEST_SUITE_P(Scenes, ShippedGait,
                         testing::Values("artificial_knee/gait.yaml", "artificial_knee/gait_power_law.yaml",
                                         "natural_knee/gait.yaml"),
                         [](const auto& scene) {
                           std::string name = scene.param;
                           for (char& c : name) {
                             if (c == '/' || c == '.') c = '_';
                           }
                           return name;
                         });

}  // namespace
}  // namespace genu::models_test
