#pragma once

#include <string>
#include <variant>
#include <vector>

namespace genu::scene {

/** A column of a table over time: values in SI at increasing times [s]. */
struct TimeSeries {
  std::vector<double> time_s;
  std::vector<double> value;
  std::string source;  ///< "file.csv, column rz_deg", for messages
};

/** A value over time: constant or through a table. */
using TimeFunction = std::variant<double, TimeSeries>;

}  // namespace genu::scene
