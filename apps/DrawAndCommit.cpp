#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "Commands.h"
#include "genu/io/Files.h"
#include "genu/report/Gnuplot.h"

namespace genu::app {

void drawAndCommit(report::OutputFolder& out, const std::vector<std::string>& scripts, bool noPlots, nlohmann::ordered_json& summary) {
  if (!noPlots) {
    const report::DrawResult drawn = report::runGnuplot(out.staging() / "plots", scripts);
    if (!drawn.problem.empty()) spdlog::warn("plots: {}", drawn.problem);
  }
  summary["files"] = out.listFiles();
  io::writeFileAtomically(out.file("summary.json"), summary.dump(2) + "\n");
  out.commit();
}

}  // namespace genu::app
