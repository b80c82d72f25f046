#pragma once

#include <string>
#include <vector>

#include "genu/model/Analysis.h"
#include "genu/scene/Scene.h"

namespace genu::model {

/** Classic experiments on a knee, as series of static equilibria. The scene needs a floating joint that is the knee (R = Rx Ry Rz; rz is
 flexion, negative when flexed, x posterior, pose of the femur in the tibia as in docs/models.md); its loads stay on. */
struct KneeExperiment {
  std::string joint = "tibiofemoral";
  double flexion_rad = 0;      ///< how far it is bent first, >= 0
  double flexionStep_rad = 3 * contact::kPi / 180;
  /** Then loaded from 0 to `load` on this coordinate of the joint (index in kCoordinateNames), N or N m; -1: not loaded. */
  int loadedAxis = -1;
  double load = 0;
  int loadSteps = 18;
};

struct KneeExperimentResult {
  scene::Trajectory trajectory;          ///< first bent, then loaded
  std::vector<double> flexion_rad, load; ///< of every frame
  size_t firstLoaded = 0;                ///< the frame at full flexion without load
};

/** @throws InputError no such floating joint, a load on flexion, numbers out of range; as runSeries otherwise */
KneeExperimentResult runKneeExperiment(const scene::Scene& scene, const KneeExperiment& experiment, const scene::Progress& progress = {});

/** The scene without the force elements whose names begin with `prefix`: a cut ligament. @throws InputError when there is none */
scene::Scene withoutElements(const scene::Scene& scene, const std::string& prefix);

}  // namespace genu::model
