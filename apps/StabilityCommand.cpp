#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "Commands.h"
#include "WorkFolder.h"
#include "genu/io/Files.h"
#include "genu/io/Units.h"
#include "genu/model/Stability.h"

namespace genu::app {
namespace fs = std::filesystem;
using model::StabilityCell;
using model::StabilityOutcome;
using model::StabilityRow;
using nlohmann::ordered_json;

namespace {

constexpr std::array<StabilityOutcome, 7> kOutcomes = {StabilityOutcome::ok,      StabilityOutcome::warned, StabilityOutcome::wrong,    StabilityOutcome::failed,
                                                       StabilityOutcome::refused, StabilityOutcome::slow,   StabilityOutcome::unchecked};
constexpr std::array<const char*, 7> kColors = {"#8fd19e", "#f7e26b", "#e8505b", "#8da7d6", "#d9d9d9", "#f4a259", "#ffffff"};
constexpr std::array<const char*, 7> kMeanings = {"ok", "wrong, with a warning", "WRONG, without a word", "failed with a message", "refused", "stopped for time", "reference failed"};

size_t indexOf(StabilityOutcome outcome) { return static_cast<size_t>(std::find(kOutcomes.begin(), kOutcomes.end(), outcome) - kOutcomes.begin()); }

std::string formatValue(double value) {
  // Digits that a bisection has; those of 0.4999 are in the distance from a half.
  if (value > 0.4989 && value < 0.5) return 0.5 - value < 1e-6 ? fmt::format("0.5 - {:.1e}", 0.5 - value) : fmt::format("{:.7g}", value);
  return fmt::format("{:.3g}", value);
}
std::string withUnit(double value, const std::string& unit) { return formatValue(value) + (unit.empty() ? "" : " " + unit); }

std::string escape(const std::string& text, char what, const std::string& by) {
  std::string result;
  for (const char c : text) result += c == what ? by : std::string(1, c);
  return result;
}

std::string explain(const StabilityCell& cell) {
  return cell.reason + (!cell.reason.empty() && !cell.message.empty() ? "; " : "") + cell.message;
}

bool isCompared(const StabilityCell& cell) {
  return cell.outcome == StabilityOutcome::ok || cell.outcome == StabilityOutcome::warned || (cell.outcome == StabilityOutcome::wrong && !cell.reason.empty());
}

/** "0.1 to 50 mm, 200 mm": the values that are ok. */
std::string listGood(const StabilityRow& row) {
  std::string text;
  for (size_t i = 0; i < row.cells.size(); ++i) {
    if (row.cells[i].outcome != StabilityOutcome::ok) continue;
    size_t last = i;
    while (last + 1 < row.cells.size() && row.cells[last + 1].outcome == StabilityOutcome::ok) ++last;
    text += (text.empty() ? "" : ", ") + formatValue(row.cells[i].value) + (last > i ? " to " + formatValue(row.cells[last].value) : "");
    i = last;
  }
  return text.empty() ? "none" : text + (row.unit.empty() ? "" : " " + row.unit);
}

std::string makeTables(const model::Stability& s) {
  std::string text = "| Axis | Scene | Without objection | Boundary: value beyond it | What happens there |\n|---|---|---|---|---|\n";
  for (const auto& row : s.rows) {
    const std::string head = fmt::format("| {} | {} | {} | ", row.name, row.scene, listGood(row));
    if (row.boundaries.empty()) text += head + "none found | |\n";
    for (const auto& b : row.boundaries) {
      text += fmt::format("{}{} | **{}**: {} |\n", &b == &row.boundaries.front() ? head : "| | | | ", withUnit(b.bad, row.unit), model::toString(b.outcome),
                          escape(b.message, '|', "\\|"));
    }
  }
  if (!s.drifts.empty()) {
    text += "\n| Long run | Time [s] | Scale [J] | Largest imbalance | At the end | Steps | Processor time [s] | Memory, early and at the end [MB] | |\n|---|---|---|---|---|---|---|---|---|\n";
    for (const auto& d : s.drifts) {
      text += fmt::format("| {} | {:g} | {:.3g} | {:.2g} | {:.2g} | {} | {:.3g} | {:.1f}, {:.1f} | {} |\n", d.name, d.time_s.empty() ? 0 : d.time_s.back(), d.scale_J, d.largest,
                          d.atEnd, d.steps, d.cpu_s, d.memoryStart_MB, d.memoryEnd_MB, escape(d.problem, '|', "\\|"));
    }
  }
  text += "\n| Axis | Value | Outcome | Pose error [mm] | Force error | Energy | Time [ms] | Evaluations | Message |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& row : s.rows) {
    for (const auto& cell : row.cells) {
      const bool compared = isCompared(cell);
      text += fmt::format("| {} | {}{} | {} | {} | {} | {} | {:.3g} | {} | {} |\n", &cell == &row.cells.front() ? row.name + ", " + row.scene : "", withUnit(cell.value, row.unit),
                          cell.bisected ? " (bisection)" : "", model::toString(cell.outcome), compared ? fmt::format("{:.2g}", 1e3 * cell.poseError_m) : "-",
                          compared ? fmt::format("{:.1e}", cell.forceError) : "-", cell.energyKnown ? fmt::format("{:.1e}", cell.energyError) : "-", 1e3 * cell.cpu_s,
                          cell.evaluations, escape(explain(cell), '|', "\\|"));
    }
  }
  return text;
}

std::string makeCsv(const model::Stability& s) {
  const auto quote = [](const std::string& text) { return "\"" + escape(text, '"', "'") + "\""; };
  std::string text = "axis,scene,unit,value,bisected,outcome,pose_error_mm,force_error,energy_error,cpu_s,evaluations,reason,message\n";
  for (const auto& row : s.rows) {
    for (const auto& cell : row.cells) {
      const bool compared = isCompared(cell);
      text += fmt::format("{},{},{},{:.12g},{},{},{},{},{},{:.6g},{},{},{}\n", quote(row.name), quote(row.scene), row.unit, cell.value, cell.bisected ? 1 : 0,
                          model::toString(cell.outcome), compared ? fmt::format("{:.6g}", 1e3 * cell.poseError_m) : "", compared ? fmt::format("{:.6g}", cell.forceError) : "",
                          cell.energyKnown ? fmt::format("{:.6g}", cell.energyError) : "", cell.cpu_s, cell.evaluations, quote(cell.reason), quote(cell.message));
    }
  }
  return text;
}

ordered_json toJson(const model::Stability& s) {
  ordered_json json;
  json["rows"] = ordered_json::array();
  for (const auto& row : s.rows) {
    ordered_json one = {{"axis", row.name}, {"scene", row.scene}, {"unit", row.unit}, {"cells", ordered_json::array()}, {"boundaries", ordered_json::array()}};
    for (const auto& cell : row.cells) {
      ordered_json c = {{"value", cell.value}, {"bisected", cell.bisected}, {"outcome", model::toString(cell.outcome)}, {"cpu_s", cell.cpu_s}, {"evaluations", cell.evaluations}};
      if (isCompared(cell)) {
        c["pose_error_mm"] = 1e3 * cell.poseError_m;
        c["force_error"] = cell.forceError;
      }
      if (cell.energyKnown) c["energy_error"] = cell.energyError;
      if (!cell.reason.empty()) c["reason"] = cell.reason;
      if (!cell.message.empty()) c["message"] = cell.message;
      one["cells"].push_back(c);
    }
    for (const auto& b : row.boundaries) one["boundaries"].push_back({{"ok", b.good}, {"not_ok", b.bad}, {"outcome", model::toString(b.outcome)}, {"message", b.message}});
    json["rows"].push_back(one);
  }
  for (const auto& d : s.drifts) {
    ordered_json one = {{"name", d.name},         {"scale_J", d.scale_J}, {"largest", d.largest}, {"at_end", d.atEnd}, {"cpu_s", d.cpu_s},
                        {"steps", d.steps},       {"memory_early_MB", d.memoryStart_MB},          {"memory_end_MB", d.memoryEnd_MB}};
    if (!d.problem.empty()) one["problem"] = d.problem;
    json["long_runs"].push_back(one);
  }
  return json;
}

/** Rows of cells, coloured by outcome, with their values; where a bisection found a boundary the value beyond it stands on the line between. */
std::string makeMap(const model::Stability& s, std::string& data, const std::string& extension) {
  size_t columns = 1;
  for (const auto& row : s.rows) {
    columns = std::max(columns, static_cast<size_t>(std::count_if(row.cells.begin(), row.cells.end(), [](const auto& cell) { return !cell.bisected; })));
  }
  data.clear();
  std::string tics, marks = "\n\n";
  for (size_t r = 0; r < s.rows.size(); ++r) {
    const auto& row = s.rows[r];
    const double y = -static_cast<double>(r);
    tics += fmt::format("{}\"{}\" {:g}", r == 0 ? "" : ", ", escape(fmt::format("{}{}: {}", row.name, row.unit.empty() ? "" : " [" + escape(row.unit, '%', "percent") + "]", row.scene), '"', "'"), y);
    size_t column = 0;
    for (const auto& cell : row.cells) {
      if (cell.bisected) continue;
      data += fmt::format("{} {} {} {} \"{}\"\n", column, y, indexOf(cell.outcome), std::string(kColors[indexOf(cell.outcome)]).replace(0, 1, "0x"), formatValue(cell.value));
      ++column;
    }
    // Boundaries between their neighbours among the given values.
    for (const auto& b : row.boundaries) {
      const double at = static_cast<double>(std::count_if(row.cells.begin(), row.cells.end(), [&](const auto& cell) { return !cell.bisected && cell.value <= std::min(b.good, b.bad); })) - 0.5;
      marks += fmt::format("{} {} \"{}\"\n", at, y - 0.36, formatValue(b.bad));
    }
  }
  if (data.empty()) data = "0 0 0 0xffffff \"\"\n";
  if (marks.size() == 2) marks += "nan nan \"\"\n";
  data += marks;
  const double height = 110 + 34.0 * static_cast<double>(s.rows.size()), width = 760 + 86.0 * static_cast<double>(columns);
  std::string script = fmt::format(
      "# Draw again with: gnuplot stability_map_{0}.gp\nset terminal {1} size {2:.0f},{3:.0f} font 'DejaVu Sans,12' background rgb 'white' noenhanced\nset output 'stability_map.{0}'\n"
      "set encoding utf8\nunset border\nset tics scale 0\nunset xtics\nset ytics ({4})\nset xrange [-0.5:{5}]\nset yrange [{6}:0.5]\nset lmargin at screen {7:.4f}\nset rmargin at screen 0.995\n"
      "set tmargin at screen {8:.4f}\nset bmargin at screen {9:.4f}\n",
      extension, extension == "png" ? "pngcairo" : "svg", width, height, tics, static_cast<double>(columns) - 0.5, 0.5 - static_cast<double>(std::max<size_t>(1, s.rows.size())), 720 / width,
      1 - 85 / height, 15 / height);
  for (size_t k = 0; k < kColors.size(); ++k) {
    const double x = (k < 4 ? 12 + 215.0 * static_cast<double>(k) : 12 + 215.0 * static_cast<double>(k - 4)) / width, y = k < 4 ? 30 : 55;
    script += fmt::format("set object rect from screen {0:.4f},{1:.4f} to screen {2:.4f},{3:.4f} fc rgb '{4}' fs solid border rgb '#606060'\nset label '{5}' at screen {6:.4f},{7:.4f} font ',11'\n",
                          x, 1 - (y + 9) / height, x + 18 / width, 1 - (y - 9) / height, kColors[k], kMeanings[k], x + 23 / width, 1 - y / height);
  }
  return script +
         "plot 'stability_map.dat' index 0 using 1:2:($1-0.46):($1+0.46):($2-0.3):($2+0.3):4 with boxxyerror fs solid border rgb '#606060' lc rgb variable notitle, \\\n"
         "     '' index 0 using 1:2:5 with labels font ',11' notitle, \\\n     '' index 1 using 1:2:3 with labels font ',9' textcolor rgb '#b00020' notitle\n";
}

std::string makeDriftPlot(const model::Stability& s, std::string& data, const std::string& extension) {
  data.clear();
  std::string curves;
  constexpr std::array<const char*, 6> kLines = {"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#000000"};
  size_t index = 0;
  for (const auto& d : s.drifts) {
    if (d.time_s.empty()) continue;
    data += "# " + d.name + "\n";
    for (size_t i = 0; i < d.time_s.size(); ++i) data += fmt::format("{:.6g} {:.6g}\n", d.time_s[i], 100 * d.share[i]);
    data += "\n\n";
    curves += fmt::format("{}'energy.dat' index {} using 1:2 with lines lw 1.5 lc rgb '{}' title '{}'", curves.empty() ? "" : ", \\\n     ", index, kLines[index % kLines.size()], d.name);
    ++index;
  }
  return fmt::format(
      "# Draw again with: gnuplot energy_{0}.gp\nset terminal {1} size 1100,600 font 'DejaVu Sans,14' background rgb 'white' noenhanced\nset output 'energy.{0}'\nset encoding utf8\n"
      "set border lw 1.2 lc rgb '#404040'\nset grid lw 1 lt 1 lc rgb '#dddddd'\nset xlabel 'time (s)'\nset ylabel 'energy less work, of the scale (%)'\nset key outside bottom center horizontal\n"
      "plot {2}\n",
      extension, extension == "png" ? "pngcairo" : "svg", curves);
}

void cleanMessages(const WorkFolder& work, model::Stability& s) {
  for (auto& row : s.rows) {
    for (auto& cell : row.cells) {
      cell.message = work.clean(cell.message);
      cell.reason = work.clean(cell.reason);
    }
    for (auto& b : row.boundaries) b.message = work.clean(b.message);
  }
  for (auto& d : s.drifts) d.problem = work.clean(d.problem);
}

}  // namespace

int runStabilityCommand(const VerifyCommandOptions& options, const CommonOptions& common) {
  installInterruptHandler(false);
  if (!options.forceError.empty()) throw InputError("--force-error: with --stability forces are compared as shares (docs/stability.md); leave it out");
  model::StabilityOptions settings;
  settings.full = options.full;
  if (options.full) {
    settings.cpuLimit_s = 15;
    settings.ratio = 1.06;
    settings.maxBisections = 10;
  }
  if (!options.poseError.empty()) settings.limits.pose_m = io::parseQuantity(options.poseError, io::Dimension::length, "--pose-error");
  if (!(settings.limits.pose_m > 0)) throw InputError("--pose-error: is \"" + options.poseError + "\"; allowed: > 0");
  const bool own = !options.scene.empty();
  if (!own && !options.grid.empty()) throw InputError("--grid: the built-in scenes of --stability have their own; give a SCENE or leave it out");
  const fs::path folder = !options.output.empty() ? options.output : fs::path("results") / (own ? options.scene.stem().string() + "-stability" : std::string("stability"));
  report::OutputFolder::check(folder);
  const WorkFolder work;
  std::vector<model::StabilityAxis> axes;
  std::vector<model::DriftCase> drifts;
  if (own) {
    const scene::Scene scene = scene::readScene(options.scene, makeReadOptions(common, options.grid, true));
    warnAbout(scene);
    // A user's scene is as long as it is.
    settings.cpuLimit_s = options.full ? 120 : 30;
    axes = model::listSceneAxes(scene, work.path(), options.full);
  } else {
    axes = model::listBuiltInAxes(work.path(), options.full);
    drifts = model::listDriftCases(work.path(), options.full);
  }
  model::Stability s;
  {
    ProgressMeter meter("verify --stability", common.console);
    s = model::measureStability(axes, drifts, settings, meter.callback());
  }
  if (s.rows.empty()) {
    spdlog::warn("interrupted before the first result; nothing written");
    return kInterrupted;
  }
  cleanMessages(work, s);
  const HoldExit hold;
  report::OutputFolder out(folder);
  ordered_json json = {{"format", "genu-results"}, {"format_version", 1}, {"analysis", "verify --stability"}, {"scene", own ? options.scene.string() : "built-in"},
                       {"complete", s.complete},   {"full", options.full}, {"version", GENU_VERSION},
                       {"limits", {{"pose_error_mm", 1e3 * settings.limits.pose_m}, {"force_error", settings.limits.force}, {"energy_error", settings.limits.energy}}}};
  std::array<int, 7> counts{};
  for (const auto& row : s.rows) {
    for (const auto& cell : row.cells) ++counts[indexOf(cell.outcome)];
  }
  for (size_t k = 0; k < counts.size(); ++k) json["counts"][model::toString(kOutcomes[k])] = counts[k];
  json.update(toJson(s));
  const std::string tables = makeTables(s);
  io::writeFileAtomically(out.file("stability.csv"), makeCsv(s));
  io::writeFileAtomically(out.file("stability.md"), tables);
  std::string map, energy;
  std::vector<std::string> scripts;
  for (const char* extension : {"png", "svg"}) {
    scripts.push_back(fmt::format("stability_map_{}.gp", extension));
    io::writeFileAtomically(out.file("plots/" + scripts.back()), makeMap(s, map, extension));
    const std::string script = makeDriftPlot(s, energy, extension);
    if (energy.empty()) continue;
    scripts.push_back(fmt::format("energy_{}.gp", extension));
    io::writeFileAtomically(out.file("plots/" + scripts.back()), script);
  }
  io::writeFileAtomically(out.file("plots/stability_map.dat"), map);
  if (!energy.empty()) io::writeFileAtomically(out.file("plots/energy.dat"), energy);
  drawAndCommit(out, scripts, options.noPlots, json);
  if (!common.console.quiet) fmt::print("{}\n", tables);
  fmt::print("Wrong: pose by more than {:g} mm, force by more than {:g} %, energy by more than {:g} %.\n", 1e3 * settings.limits.pose_m, 100 * settings.limits.force,
             100 * settings.limits.energy);
  for (size_t k = 0; k < counts.size(); ++k) fmt::print("{}{}: {}", k == 0 ? "" : ", ", kMeanings[k], counts[k]);
  fmt::print("\n{}Results: {}\n", s.complete ? "" : "INCOMPLETE: interrupted\n", folder.string());
  return s.complete ? kOk : kInterrupted;
}

}  // namespace genu::app
