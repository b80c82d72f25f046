#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "ModelFiles.h"
#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"

namespace genu::models_test {
namespace {

/** Equilibria from random starts: gaps to 10 mm, varus to 15 degrees, 2 mm to either side. */
struct Starts {
  const char* scene;
  int count;
};

class StaticStarts : public testing::TestWithParam<Starts> {};

// Every start ends in the same equilibrium, or is told that there is none. Newton stops at 1e-6 N: over the softest stiffness, some 1e4 N/m, 0.1 nm; a hundred times that
// for what starts do to the closest points' last digits.
TEST_P(StaticStarts, EndInTheSameEquilibrium) {
  scene::Scene scene = scene::readScene(modelFolder() / GetParam().scene, {{}, true, std::pair{20, 20}});
  scene.staticAnalysis.emplace().method = scene::StaticSpec::Method::newton;
  const model::StaticResult usual = model::runStatic(scene);
  ASSERT_EQ(usual.status, model::StaticResult::Status::converged) << usual.statusText;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<double> times_s;
  int fallbacks = 0;
  for (int i = 0; i < GetParam().count; ++i) {
    auto& coordinates = scene.model->coordinates;
    const double gap = 5e-3 * (1 + unit(random)), tilt = 15 * contact::kPi / 180 * unit(random), side = 2e-3 * unit(random);
    for (size_t k : {size_t{0}, size_t{4}, size_t{5}}) {
      auto* free = std::get_if<scene::FreeCoordinate>(&coordinates[k]);
      ASSERT_TRUE(free != nullptr);
      // A condyle 24 mm off the middle goes down by that times the tilt.
      free->start = usual.q[k] + (k == 0 ? tilt : k == 4 ? gap + 24e-3 * std::abs(std::sin(tilt)) : side);
    }
    const model::StaticResult result = model::runStatic(scene);
    ASSERT_EQ(result.status, model::StaticResult::Status::converged) << i << ": gap " << gap << ", tilt " << tilt << ", side " << side << ": " << result.statusText;
    for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(result.q[k], usual.q[k], 1e-8 * (k < 3 ? 40 : 1)) << i << ", coordinate " << k;
    times_s.push_back(result.cpuTime_s);
    fallbacks += result.method != "newton" ? 1 : 0;
  }
  std::sort(times_s.begin(), times_s.end());
  std::printf("%s: median %.1f ms, longest %.1f ms, implicit Euler needed by %d of %d\n", GetParam().scene, 1e3 * times_s[times_s.size() / 2], 1e3 * times_s.back(), fallbacks,
              GetParam().count);
}
INSTANTIATE_TEST_SUITE_P(Scenes, StaticStarts,
                         testing::Values(Starts{"artificial_knee/static.yaml", 100}, Starts{"natural_knee/static.yaml", 50},
                                         Starts{"natural_knee/static_large_strain.yaml", 50}));

}  // namespace
}  // namespace genu::models_test
