#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace genu::report {

/** Result of drawing; plots are a convenience, so no failure here stops a run. */
struct DrawResult {
  std::vector<std::string> drawn;  ///< scripts that ran
  std::string problem;             ///< empty, or why something was not drawn
};

/** Runs gnuplot on each script inside `folder` (no shell; processes side by side, in their own group so that Ctrl-C
 does not reach them). The program is found in PATH. */
DrawResult runGnuplot(const std::filesystem::path& folder, const std::vector<std::string>& scripts);

}  // namespace genu::report
