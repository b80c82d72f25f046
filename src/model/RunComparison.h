#pragma once

#include <vector>

#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

/** How far the frames of one run are from those of another run of the same scene, taken at the same times. */
struct RunDifference {
  struct Largest {
    double value = 0, time_s = 0;
  };
  struct Load {
    Largest force_N, peakPressure_Pa;
  };
  std::vector<Largest> coordinates;  ///< of each coordinate of the scene, rad or m
  /** Largest difference of a free coordinate, angles times kAngleLength_m; of a floating joint the angle between both orientations counts: near gimbal lock rx and
   rz have no meaning of their own. */
  double pose_m = 0;
  std::vector<Load> compartments;  ///< of all contact pairs, in the order of the scene
  /** Mean difference of the compartments' scalar forces over their mean in the reference, which counts as 1 mN at least. */
  double force = 0;
};

/** Frames that only one of both has are left out. */
RunDifference compareRuns(const scene::Scene& scene, const std::vector<scene::Frame>& reference, const std::vector<scene::Frame>& frames);

}  // namespace genu::model
