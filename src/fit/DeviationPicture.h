#pragma once

#include <string>

#include "genu/fit/Fit.h"

namespace genu::fit {

/** Draws the deviation of every vertex over (x, z), or (angle, z), with gnuplot. Returns why there is no picture, or
 nothing. @throws ComputationError when a file cannot be written */
std::string drawDeviation(const FitReport& report, const TriangleMesh& region, const Box& contactBox,
                          const std::filesystem::path& pngFile);

}  // namespace genu::fit
