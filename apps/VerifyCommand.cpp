#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "Commands.h"
#include "WorkFolder.h"
#include "genu/io/Files.h"
#include "genu/io/Units.h"
#include "genu/model/Stability.h"
#include "genu/model/Verification.h"

namespace genu::app {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

ordered_json toJson(const model::VerifySetting& s) {
  ordered_json json = {{"group", s.group}, {"text", s.describe()}};
  if (!s.integrator.empty()) json["integrator"] = s.integrator;
  if (s.accuracy > 0) json["accuracy"] = s.accuracy;
  if (s.step_s > 0) json["step_s"] = s.step_s;
  json["grid_factor_x"] = s.factorX;
  json["grid_factor_z"] = s.factorZ;
  json["rule"] = s.rule == contact::ContactRule::smooth ? "smooth" : "centre";
  json["strain"] = s.strain == contact::StrainMeasure::large ? "large" : "small";
  if (s.constraints) json["constraints"] = true;
  json["distance"] = s.distance == contact::DistanceMethod::ray ? "ray" : "minimum";
  return json;
}

/** Names of the free coordinates. */
std::vector<std::string> listFree(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (const auto& c : scene.coordinates()) {
    if (c.isFree) names.push_back(c.name);
  }
  return names;
}

ordered_json toJson(const model::VerifyRow& row, const std::vector<std::string>& free) {
  ordered_json json = toJson(row.setting);
  if (!row.problem.empty()) {
    json["problem"] = row.problem;
    return json;
  }
  json["cpu_s"] = row.cpu_s;
  json["pose_error_mm"] = 1e3 * row.poseError_m;
  for (size_t k = 0; k < free.size(); ++k) json["coordinate_errors_mm"][free[k]] = 1e3 * row.coordinateErrors_m[k];
  json["force_error_N"] = row.forceError_N;
  json["evaluations"] = row.evaluations;
  json["steps"] = row.steps;
  if (row.peakMemory_MB > 0) json["peak_memory_MB"] = row.peakMemory_MB;
  json["front"] = {{"pose", row.onFrontPose}, {"force", row.onFrontForce}};
  return json;
}

std::string makeCsv(const model::Verification& v, const std::vector<std::string>& free) {
  std::string text = "group,integrator,accuracy,step_s,grid_factor_x,grid_factor_z,rule,distance,strain,constraints,cpu_s,peak_memory_MB,pose_error_mm,force_error_N,evaluations,steps,front_pose,front_force";
  for (const std::string& name : free) text += "," + name + "_error_mm";
  text += ",problem\n";
  for (const auto& row : v.rows) {
    const auto& s = row.setting;
    std::string problem = row.problem;
    for (char& c : problem) c = c == '"' ? '\'' : c == '\n' ? ' ' : c;
    text += fmt::format("{},{},{:g},{:g},{:g},{:g},{},{},{},{},{:.6g},{:.4g},{:.6g},{:.6g},{},{},{},{}", s.group, s.integrator, s.accuracy, s.step_s, s.factorX, s.factorZ,
                        s.rule == contact::ContactRule::smooth ? "smooth" : "centre", s.distance == contact::DistanceMethod::ray ? "ray" : "minimum",
                        s.strain == contact::StrainMeasure::large ? "large" : "small", s.constraints ? 1 : 0, row.cpu_s, row.peakMemory_MB, 1e3 * row.poseError_m, row.forceError_N, row.evaluations, row.steps, row.onFrontPose ? 1 : 0, row.onFrontForce ? 1 : 0);
    for (size_t k = 0; k < free.size(); ++k) text += row.problem.empty() ? fmt::format(",{:.6g}", 1e3 * row.coordinateErrors_m[k]) : ",";
    text += ",\"" + problem + "\"\n";
  }
  return text;
}

/** A Markdown table. */
std::string makeTable(const model::Verification& v, const std::vector<std::string>& free) {
  std::string text = "| Setting | Time [ms] | Memory [MB] | Pose error [mm] | Force error [N] | Evaluations | |\n|---|---|---|---|---|---|---|\n";
  for (const auto& row : v.rows) {
    if (!row.problem.empty()) {
      std::string problem;
      for (const char c : row.problem) problem += c == '|' ? "\\|" : c == '\n' ? " " : std::string(1, c);
      text += fmt::format("| {} | - | - | - | - | - | {} |\n", row.setting.describe(), problem);
      continue;
    }
    const auto worst = static_cast<size_t>(std::max_element(row.coordinateErrors_m.begin(), row.coordinateErrors_m.end()) - row.coordinateErrors_m.begin());
    const char* front = row.onFrontPose && row.onFrontForce ? "front" : row.onFrontPose ? "front (pose)" : row.onFrontForce ? "front (force)" : "";
    text += fmt::format("| {} | {:.3g} | {:.3g} | {:.2g} ({}) | {:.2g} | {} | {} |\n", row.setting.describe(), 1e3 * row.cpu_s, row.peakMemory_MB, 1e3 * row.poseError_m,
                        worst < free.size() ? free[worst] : "-", row.forceError_N,
                        row.evaluations, front);
  }
  return text;
}

/** Two work-precision plots side by side: one curve per group, the front as a line. @return the script */
std::string makePlot(const model::Verification& v, std::string& data, const std::string& extension) {
  std::vector<std::string> names;
  const auto nameOf = [](const model::VerifyRow& row) {
    return row.setting.group == "integrator" ? row.setting.integrator
           : row.setting.group == "grid"     ? std::string(row.setting.rule == contact::ContactRule::smooth ? "grid, smooth rule" : "grid, centre rule")
                                             : row.setting.group;
  };
  data.clear();
  for (const auto& row : v.rows) {
    // Gnuplot does not count an empty block.
    if (row.problem.empty() && std::find(names.begin(), names.end(), nameOf(row)) == names.end()) names.push_back(nameOf(row));
  }
  const auto write = [&data](const model::VerifyRow& row) {
    // A logarithmic axis has no 0.
    data += fmt::format("{:.6g} {:.6g} {:.6g}\n", 1e3 * row.cpu_s, std::max(1e-9, 1e3 * row.poseError_m), std::max(1e-9, row.forceError_N));
  };
  for (const std::string& name : names) {
    data += "# " + name + "\n";
    for (const auto& row : v.rows) {
      if (row.problem.empty() && nameOf(row) == name) write(row);
    }
    data += "\n\n";
  }
  for (const bool pose : {true, false}) {
    data += pose ? "# front, pose\n" : "# front, force\n";
    std::vector<model::VerifyRow> front;
    for (const auto& row : v.rows) {
      if (pose ? row.onFrontPose : row.onFrontForce) front.push_back(row);
    }
    std::sort(front.begin(), front.end(), [](const auto& a, const auto& b) { return a.cpu_s < b.cpu_s; });
    for (const auto& row : front) write(row);
    data += "\n\n";
  }
  constexpr std::array<const char*, 8> kColors = {"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999"};
  std::string script = fmt::format(
      "# Draw again with: gnuplot work_precision_{0}.gp\nset terminal {1} font 'DejaVu Sans,14' background rgb 'white' noenhanced\nset output 'work_precision.{0}'\n"
      "set encoding utf8\nset border lw 1.2 lc rgb '#404040'\nset grid lw 1 lt 1 lc rgb '#dddddd'\nset logscale xy\nset format y '%g'\n"
      "set xlabel 'processor time (ms)'\nset multiplot layout 1,2\n",
      extension, extension == "png" ? "pngcairo size 1500,650" : "svg size 1500,650");
  for (const bool pose : {true, false}) {
    script += pose ? "set lmargin at screen 0.08\nset rmargin at screen 0.39\nset ylabel 'pose error (mm)'\nset key off\n"
                   : "set lmargin at screen 0.48\nset rmargin at screen 0.79\nset ylabel 'force error (N)'\nset key at screen 0.805, screen 0.9 left top Left reverse\n";
    std::string curves;
    for (size_t k = 0; k < names.size(); ++k) {
      curves += fmt::format("{}'work_precision.dat' index {} using 1:{} with points pt {} ps 1.6 lc rgb '{}' title '{}'", curves.empty() ? "" : ", \\\n     ", k,
                            pose ? 2 : 3, 4 + k % 10, kColors[k % kColors.size()], names[k]);
    }
    script += fmt::format("plot {}, \\\n     'work_precision.dat' index {} using 1:{} with lines lw 1.5 dt 2 lc rgb '#404040' title 'front'\n", curves,
                          names.size() + (pose ? 0 : 1), pose ? 2 : 3);
  }
  return script + "unset multiplot\n";
}

/** Measures one scene and writes its folder. `label`: how results name it. */
int verifyScene(const scene::Scene& scene, const std::string& label, const fs::path& folder, const model::VerifyOptions& settings,
                const VerifyCommandOptions& options, const CommonOptions& common) {
  report::OutputFolder::check(folder);
  warnAbout(scene);
  model::Verification v;
  {
    ProgressMeter meter("verify", common.console);
    v = model::verify(scene, settings, meter.callback());
  }
  if (v.rows.empty()) {
    spdlog::warn("{}: interrupted before the first result; nothing written", label);
    return kInterrupted;
  }
  const HoldExit hold;
  report::OutputFolder out(folder);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  ordered_json json = {{"format", "genu-results"}, {"format_version", 1}, {"analysis", "verify"}, {"scene", label}, {"complete", v.complete},
                       {"full", settings.full}, {"version", GENU_VERSION}, {"repeats", settings.repeats},
                       {"peak_memory_MB", static_cast<double>(usage.ru_maxrss) / 1024}};
  json["reference"] = toJson(v.reference);
  json["reference"]["cpu_s"] = v.referenceCpu_s;
  const std::vector<std::string> free = listFree(scene);
  for (const auto& row : v.rows) json["rows"].push_back(toJson(row, free));
  json["asked"] = {{"pose_error_mm", 1e3 * settings.poseError_m}, {"force_error_N", settings.forceError_N}};
  if (v.recommended >= 0) json["recommended"] = toJson(v.confirmed, free);
  const std::string table = makeTable(v, free);
  io::writeFileAtomically(out.file("verification.csv"), makeCsv(v, free));
  io::writeFileAtomically(out.file("verification.md"), table);
  std::string data;
  std::vector<std::string> scripts;
  for (const char* extension : {"png", "svg"}) {
    const std::string script = makePlot(v, data, extension);
    scripts.push_back(fmt::format("work_precision_{}.gp", extension));
    io::writeFileAtomically(out.file("plots/" + scripts.back()), script);
  }
  io::writeFileAtomically(out.file("plots/work_precision.dat"), data);
  drawAndCommit(out, scripts, options.noPlots, json);
  fmt::print("{}\nReference: {}, {:.3g} s. Errors: largest over the run; angles times 25 mm.\n", table, v.reference.describe(), v.referenceCpu_s);
  if (!v.complete) {
    fmt::print("INCOMPLETE: interrupted\n");
  } else if (v.recommended < 0) {
    fmt::print("No setting is within {:g} mm and {:g} N; try --full, a finer grid, or larger errors.\n", 1e3 * settings.poseError_m, settings.forceError_N);
  } else {
    fmt::print("Cheapest within {:g} mm and {:g} N: {}; run again: {:.3g} ms, {:.2g} mm, {:.2g} N\n", 1e3 * settings.poseError_m, settings.forceError_N,
               v.confirmed.setting.describe(), 1e3 * v.confirmed.cpu_s, 1e3 * v.confirmed.poseError_m, v.confirmed.forceError_N);
  }
  fmt::print("Results: {}\n", folder.string());
  return v.complete ? kOk : kInterrupted;
}

/** The scenes that the program brings along, a folder each. */
int verifyBuiltIn(const fs::path& folder, const model::VerifyOptions& settings, const VerifyCommandOptions& options, const CommonOptions& common) {
  if (!options.grid.empty()) throw InputError("--grid: the built-in scenes have their own; give a SCENE or leave it out");
  const WorkFolder work;
  for (const model::BuiltInScene& entry : model::listBuiltInScenes(work.path())) {
    if (!common.console.quiet) fmt::print("\n{}\n", entry.name);
    const int code = verifyScene(entry.scene, entry.name, folder / entry.name, settings, options, common);
    if (code != kOk) return code;
  }
  return kOk;
}

}  // namespace

int runVerifyCommand(const VerifyCommandOptions& options, const CommonOptions& common) {
  if (options.stability) return runStabilityCommand(options, common);
  installInterruptHandler(false);
  model::VerifyOptions settings;
  settings.full = options.full;
  settings.repeats = options.full ? 3 : 2;
  if (!options.poseError.empty()) settings.poseError_m = io::parseQuantity(options.poseError, io::Dimension::length, "--pose-error");
  if (!options.forceError.empty()) settings.forceError_N = io::parseQuantity(options.forceError, io::Dimension::force, "--force-error");
  if (!(settings.poseError_m > 0)) throw InputError("--pose-error: is \"" + options.poseError + "\"; allowed: > 0");
  if (!(settings.forceError_N > 0)) throw InputError("--force-error: is \"" + options.forceError + "\"; allowed: > 0");
  if (options.scene.empty()) return verifyBuiltIn(options.output.empty() ? fs::path("results/verify") : options.output, settings, options, common);
  const scene::Scene scene = scene::readScene(options.scene, makeReadOptions(common, options.grid, true));
  const fs::path folder = options.output.empty() ? fs::path("results") / (options.scene.stem().string() + "-verify") : options.output;
  return verifyScene(scene, options.scene.string(), folder, settings, options, common);
}

}  // namespace genu::app
