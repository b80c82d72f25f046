#include "ModelFiles.h"
#include "RandomStarts.h"
#include "genu/scene/SceneFile.h"

namespace genu::models_test {
namespace {

struct Starts {
  const char* scene;
  const char* law;  ///< a scene whose material is taken, or "small" or "large" strain; empty: its own
  int count;
};

class StaticStarts : public testing::TestWithParam<Starts> {};

// Every start ends in the same equilibrium. Newton stops at 1e-6 N: over the softest stiffness, some 1e4 N/m, 0.1 nm; a hundred times that
// for what starts do to the closest points' last digits.
TEST_P(StaticStarts, EndInTheSameEquilibrium) {
  const scene::ReadOptions options{{}, true, std::pair{20, 20}};
  scene::Scene scene = scene::readScene(modelFolder() / GetParam().scene, options);
  const std::string law = GetParam().law;
  for (scene::ContactSpec& contact : scene.contacts) {
    if (law == "large" || law == "small") {
      contact.definition.strain = law == "large" ? contact::StrainMeasure::large : contact::StrainMeasure::small;
    } else if (!law.empty()) {
      contact.definition.material = scene::readScene(modelFolder() / law, options).contacts[0].definition.material;
    }
  }
  settleFromRandomStarts(scene, GetParam().scene + (law.empty() ? "" : ", " + law), GetParam().count, 1e-8);
}
INSTANTIATE_TEST_SUITE_P(Scenes, StaticStarts,
                         testing::Values(Starts{"artificial_knee/static.yaml", "", 100}, Starts{"artificial_knee/static.yaml", "large", 30},
                                         Starts{"artificial_knee/static.yaml", "artificial_knee/gait_power_law.yaml", 50},
                                         Starts{"natural_knee/static.yaml", "", 50}, Starts{"natural_knee/static_large_strain.yaml", "", 50}));

}  // namespace
}  // namespace genu::models_test
