#pragma once

#include <string>
#include <vector>

#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

/** Contact that goes on beyond the rectangle of its grid: what lies outside carries nothing, without any other sign of it. */
struct CutOff {
  std::string contact, compartment;
  double time_s = 0;       ///< of the largest force of the compartment
  double force_N = 0;      ///< scalar force inside the rectangle at that time, at rest
  double outside_N = 0;    ///< the same of a margin around it, a tenth of its sides wide
};

/** Compartments on rectangles whose margin carries more than kToleratedCutOff of their force in the frame of their largest force. Sides with another
 rectangle of the same pair beside them, round element surfaces and refined grids are not looked at; neither are places without a surface, where the layer ends.
 Costs two grids and two evaluations per compartment. */
std::vector<CutOff> findCutOffs(const scene::Scene& scene, const std::vector<scene::Frame>& frames);
inline constexpr double kToleratedCutOff = 1e-3;

/** "contact.knee.compartments.medial.rectangle: at t = 0.3 s contact goes on ..., 120 N of 900 N; enlarge it" */
std::string describe(const CutOff& cutOff, const scene::Scene& scene);

}  // namespace genu::model
