#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "genu/model/Analysis.h"
#include "genu/scene/Scene.h"

namespace genu::models_test {

/** Equilibria from random starts around the usual one: gaps to 10 mm, varus to 15 degrees, 2 mm to either side.
 `agreement_m`: how near to the usual equilibrium each must end. Prints times and what was needed. */
inline void settleFromRandomStarts(scene::Scene scene, const std::string& name, int count, double agreement_m) {
  scene.staticAnalysis.emplace().method = scene::StaticSpec::Method::newton;
  const model::StaticResult usual = model::runStatic(scene);
  ASSERT_EQ(usual.status, model::StaticResult::Status::converged) << usual.statusText;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<double> times_s;
  int fallbacks = 0;
  double farthest_m = 0;
  for (int i = 0; i < count; ++i) {
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
    EXPECT_LT(result.residual_N, 1e-6);
    for (size_t k = 0; k < 6; ++k) {
      const double difference_m = (k < 3 ? model::kAngleLength_m : 1) * std::abs(result.q[k] - usual.q[k]);
      farthest_m = std::max(farthest_m, difference_m);
      EXPECT_LT(difference_m, agreement_m) << i << ", coordinate " << k;
    }
    times_s.push_back(result.cpuTime_s);
    fallbacks += result.method != "newton" ? 1 : 0;
  }
  std::sort(times_s.begin(), times_s.end());
  std::printf("%s: median %.1f ms, longest %.1f ms, implicit Euler needed by %d of %d, farthest from the usual %.2g um\n", name.c_str(),
              1e3 * times_s[times_s.size() / 2], 1e3 * times_s.back(), fallbacks, count, 1e6 * farthest_m);
}

}  // namespace genu::models_test
