#pragma once

#include <array>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/report/OutputFolder.h"
#include "genu/report/RunReport.h"

namespace genu::report {

/** gnuplot scripts and their data, written into `plots/` of a results folder; each returns the script's name. The
 scripts run from their own folder, so a user can restyle and rerun them. Colours: Okabe & Ito (2008) and viridis. */

/** Predicted (free) coordinates over time, with the reference where it has the coordinate: one plot per joint, `motion` of an only one. */
std::vector<std::string> writeMotionPlots(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory,
                                          const RunInfo& info);

/** Forces of the elements, one plot per keyword: the strongest kMaxElementCurves, and how many more there are. Muscles also with their
 activation. */
std::vector<std::string> writeElementPlots(OutputFolder& out, const scene::Trajectory& trajectory);
inline constexpr int kMaxElementCurves = 10;

/** The same of a single frame, as bars: the strongest kMaxElementBars of those that carry. */
std::vector<std::string> writeElementBars(OutputFolder& out, const scene::Trajectory& trajectory);
inline constexpr size_t kMaxElementBars = 30;

/** Scalar force of each compartment of a single frame, as bars. */
std::string writeForceBars(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory);

/** Scalar force and torque of each compartment over time. */
std::string writeForcePlot(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory);

/** Peak and mean pressure and contact area of each compartment over time. */
std::string writePressurePlot(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory);

/** One instant of one contact pair. */
struct MapPanel {
  std::string title;
  std::vector<std::vector<contact::ElementField>> fields;
  std::vector<contact::NetLoad> loads;
};

/** Pressure maps, one panel per instant, one colour scale: seen from above, anterior up, or with plain axes where the fixed frame is not
 that of a tibia (`anatomical` false: a patella). */
std::string writeMapPlot(OutputFolder& out, const std::string& name, const contact::ContactPairDefinition& definition,
                         const std::vector<MapPanel>& panels, bool leftKnee, bool anatomical = true);

}  // namespace genu::report
