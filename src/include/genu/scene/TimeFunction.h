#pragma once

#include <string>
#include <variant>
#include <vector>

namespace genu::scene {

/** How values between the rows of a table are found: twice differentiable cubic spline; straight lines; or the row before. Lines and steps
 have kinks and jumps at the rows, where integrators end their steps. */
enum class Interpolation { spline, linear, step };

/** A column of a table over time: values in SI at increasing times [s]. */
struct TimeSeries {
  std::vector<double> time_s;
  std::vector<double> value;
  std::string source;  ///< "file.csv, column rz_deg", for messages
  Interpolation interpolation = Interpolation::spline;
};

/** A value over time: constant or through a table. */
using TimeFunction = std::variant<double, TimeSeries>;

}  // namespace genu::scene
