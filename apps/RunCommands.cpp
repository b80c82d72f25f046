#include <algorithm>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "Commands.h"
#include "genu/model/Analysis.h"
#include "genu/model/CutOff.h"
#include "genu/model/KneeSystem.h"
#include "genu/report/ContactReport.h"
#include "genu/report/RunReport.h"
#include "genu/io/Suggest.h"

namespace genu::app {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

fs::path chooseOutput(const RunOptions& options, const fs::path& fallback) {
  return options.output.empty() ? fallback : options.output;
}

report::RunInfo makeInfo(const std::string& analysis, const fs::path& folder, const scene::Scene& scene,
                         const RunOptions& options, const CommonOptions& common) {
  report::RunInfo info;
  info.analysis = analysis;
  info.folder = folder;
  info.commandLine = common.commandLine;
  info.dataFolder = common.dataFolder;
  info.versions["simbody"] = GENU_SIMBODY_VERSION;
  info.leftKnee = options.side == "left";
  info.maps = scene.output.maps && !options.noMaps;
  info.plots = scene.output.plots && !options.noPlots;
  if (!options.reference.empty()) info.reference = report::readReferenceMotion(options.reference, scene.cycle_s, scene.coordinates());
  const auto poses = std::make_shared<PairPoses>(scene);
  info.calcPairPose = [poses](const scene::Frame& frame, size_t pair) { return poses->calcPose(frame.q, pair); };
  return info;
}

/** What a run of an analysis begins with. */
struct Prepared {
  scene::Scene scene;
  report::RunInfo info;
  std::unique_ptr<const contact::TaskRunner> runner;
};

Prepared prepare(const std::string& analysis, const RunOptions& options, const CommonOptions& common) {
  installInterruptHandler(false);
  Prepared run;
  run.scene = scene::readScene(options.scene, makeReadOptions(common, options.grid, true));
  if (analysis == "series" && !run.scene.series) {
    throw InputError(run.scene.where("analysis.series") + ": is missing; write \"series: {duration: 1 s, output_interval: 0.05 s}\" below \"analysis:\"");
  }
  if (options.errorEstimate) {
    if (!run.scene.gait) run.scene.gait.emplace();
    run.scene.gait->errorEstimate = true;
  }
  const fs::path folder = chooseOutput(options, fs::path("results") / (options.scene.stem().string() + "-" + analysis));
  report::OutputFolder::check(folder);
  run.info = makeInfo(analysis, folder, run.scene, options, common);
  warnAbout(run.scene);
  run.runner = makeTaskRunner(options.threads);
  return run;
}

/** The analysis itself, with progress. */
template <class Result>
Result compute(const Prepared& run, const std::string& what, const CommonOptions& common,
               Result (*analyse)(model::KneeSystem&, const scene::Scene&, const scene::Progress&)) {
  ProgressMeter meter(what, common.console);
  model::KneeSystem knee(run.scene);
  for (const auto& warning : knee.listTableWarnings()) spdlog::warn("{}", warning);
  knee.contact().setTaskRunner(run.runner.get());
  return analyse(knee, run.scene, meter.callback());
}

/** What force elements did outside the range of their laws, counted over the frames. */
void warnAboutElements(const scene::Trajectory& trajectory) {
  std::map<std::string, std::pair<std::set<std::string>, size_t>> problems;
  for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
    const scene::ElementColumn& column = trajectory.elementColumns[i];
    for (const auto& frame : trajectory.frames) {
      const double value = frame.elements[i];
      std::string problem;
      if (column.quantity == "inside_wrap" && value > 0) problem = "an end of the path lies inside its wrapping surface, which is left out there";
      if (column.keyword == "muscles" && column.quantity == "state" && value == 1) problem = "the tendon is slack: no force";
      if (column.keyword == "muscles" && column.quantity == "state" && value >= 2) problem = "the fibre is outside the range of the curves (0.2 to 1.8)";
      if (problem.empty()) continue;
      auto& [names, count] = problems[problem];
      names.insert(column.element);
      ++count;
    }
  }
  for (const auto& [problem, found] : problems) {
    spdlog::warn("{} in {} of {} frames: {}", problem, found.second, trajectory.frames.size() * found.first.size(),
                 io::joinNames({found.first.begin(), found.first.end()}));
  }
}

/** Coordinates and element forces at the last frame, for scenes without contact. */
std::string formatElements(const scene::Scene& scene, const scene::Trajectory& trajectory) {
  const scene::Frame& frame = trajectory.frames.back();
  std::string text = fmt::format("At t = {:.4g} s:\n", frame.time_s);
  const auto coordinates = scene.coordinates();
  for (size_t i = 0; i < coordinates.size(); ++i) {
    text += fmt::format("  {:<24} {:>12.5g} {}\n", coordinates[i].name, frame.q[i] * coordinates[i].unitsPerSi(), coordinates[i].unit());
  }
  for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
    if (trajectory.elementColumns[i].quantity != "force") continue;
    text += fmt::format("  {:<24} {:>12.5g} N\n", trajectory.elementColumns[i].element, frame.elements[i]);
  }
  return text;
}

/** Writes the results and prints the table. */
int finish(const scene::Scene& scene, const scene::Trajectory& trajectory, const report::RunInfo& info,
           const RunOptions& options, const CommonOptions& common, const std::string& moreTable = {}) {
  if (trajectory.failed && !(options.keepFailed && !trajectory.frames.empty())) {
    throw ComputationError(fmt::format(
        "{}: {}{}", scene.file.string(), trajectory.statusText,
        trajectory.frames.empty() || (info.analysis != "gait" && info.analysis != "series") ? "" : " (--keep-failed writes what was computed)"));
  }
  if (trajectory.frames.empty()) {
    spdlog::warn("{}: interrupted before the first result; nothing written", scene.file.string());
    return kInterrupted;
  }
  report::RunOutput output;
  {
    const HoldExit hold;
    ProgressMeter meter("writing results", common.console);
    // Once a run was interrupted its results are still written, without being asked to stop again.
    const scene::Progress progress = trajectory.complete && !wasInterrupted() ? meter.callback() : scene::Progress{};
    output = report::writeRun(scene, trajectory, info, progress);
  }
  for (const auto& note : output.notes) spdlog::warn("{}", note);
  int border = 0, noThickness = 0;
  for (const auto& frame : trajectory.frames) {
    for (const auto& result : frame.contacts) {
      border = std::max(border, result.total.boundaryElements);
      noThickness = std::max(noThickness, result.total.noThicknessElements);
    }
  }
  if (border > 0) {
    spdlog::warn(
        "up to {} elements lie behind the open border of a moving surface and carry nothing (contact.sto: "
        "boundary_elements); extend the surface",
        border);
  }
  if (noThickness > 0) {
    spdlog::warn(
        "up to {} elements are left out because the moving body's back surface is missed there (contact.sto: "
        "no_thickness_elements); extend it or give `missing`",
        noThickness);
  }
  warnAboutElements(trajectory);
  // The frame with the largest strain: at its end a run may be within the range of the law again.
  const scene::Frame* extrapolated = nullptr;
  double largest = 0;
  for (const auto& frame : trajectory.frames) {
    if (report::worstStatus(frame.contacts) != contact::EvaluationStatus::extrapolated) continue;
    for (const auto& result : frame.contacts) {
      if (result.total.maxStrain <= largest) continue;
      largest = result.total.maxStrain;
      extrapolated = &frame;
    }
  }
  if (extrapolated != nullptr) {
    spdlog::warn("{}{}", trajectory.frames.size() > 1 ? fmt::format("at t = {:g} s: ", extrapolated->time_s) : "",
                 report::describeStatus(scene, extrapolated->contacts));
  }
  for (const model::CutOff& cutOff : model::findCutOffs(scene, trajectory.frames)) spdlog::warn("{}", model::describe(cutOff, scene));
  if (!trajectory.complete) fmt::print("INCOMPLETE: {}\n", trajectory.statusText);
  if (!common.console.quiet) {
    fmt::print("{}\n{}\n{}Computed in {:.3g} s ({:.3g} s of CPU time), {} contact evaluations.\nResults: {}\n",
               scene.name, scene.contacts.empty() ? formatElements(scene, trajectory) : output.table, moreTable, trajectory.wallTime_s, trajectory.cpuTime_s,
               trajectory.statistics.contactEvaluations, output.folder.string());
  }
  if (trajectory.failed) {
    spdlog::error("{}: {}", scene.file.string(), trajectory.statusText);
    return kComputationFailed;
  }
  return trajectory.complete && !wasInterrupted() ? kOk : kInterrupted;
}

ordered_json toJson(const scene::Scene& scene, const scene::Coordinates& q) {
  const auto coordinates = scene.coordinates();
  ordered_json json;
  for (size_t i = 0; i < coordinates.size(); ++i) json[coordinates[i].name + (coordinates[i].isAngle ? "_rad" : "_m")] = q[i];
  return json;
}

ordered_json toJson(const scene::Scene& scene, const model::StaticResult& result) {
  ordered_json json = {{"method", result.method},          {"status_text", result.statusText},
                       {"residual_N", result.residual_N},  {"max_acceleration_m_per_s2", result.maxAcceleration},
                       {"iterations", result.iterations},  {"contact_evaluations", result.contactEvaluations},
                       {"wall_time_s", result.wallTime_s}, {"constraint_force_N_or_Nm", result.constraintForce}};
  if (result.methodDifference_m) json["method_difference_m"] = *result.methodDifference_m;
  if (!result.stiffness_NPerM.empty()) json["principal_stiffness_N_per_m"] = result.stiffness_NPerM;
  if (result.search) {
    ordered_json& search = json["search"];
    search = {{"starts", result.search->starts},          {"converged", result.search->converged}, {"moved_back", result.search->movedBack}, {"after_implicit_euler", result.search->afterEuler},
              {"back_to_first", result.search->backToFirst}, {"failures", result.search->failures},   {"complete", result.search->complete}};
    if (!result.search->complete) search["stopped"] = result.search->stopped;
    search["others"] = ordered_json::array();
    for (const auto& other : result.search->others) {
      search["others"].push_back({{"pose", toJson(scene, other.q)},
                                  {"principal_stiffness_N_per_m", other.stiffness_NPerM},
                                  {"stable", !other.unstable},
                                  {"starts", other.starts}});
    }
  }
  return json;
}

/** Starts, and every equilibrium with the coordinates that are free. */
std::string formatSearch(const scene::Scene& scene, const model::StaticResult& result) {
  const model::StaticResult::Search& search = *result.search;
  std::string text = fmt::format("Search: {} starts ({} moved back to a valid pose), {} converged ({} after implicit Euler), {} did not\n", search.starts, search.movedBack,
                                 search.converged, search.afterEuler, search.starts - search.converged);
  for (const std::string& failure : search.failures) text += "  " + failure + "\n";
  if (!search.complete) text += "  not complete: " + search.stopped + "\n";
  const auto coordinates = scene.coordinates();
  int number = 0;
  const auto add = [&](const scene::Coordinates& q, const std::vector<double>& stiffness, bool unstable, const std::string& found) {
    text += fmt::format("  equilibrium {}: {}, least stiffness {:.4g} N/mm, {};", ++number, unstable ? "unstable" : "stable",
                        stiffness.empty() ? 0.0 : 1e-3 * stiffness.front(), found);
    for (size_t i = 0; i < coordinates.size(); ++i) {
      if (coordinates[i].isFree) text += fmt::format(" {} {:.5g} {}", coordinates[i].name, q[i] * coordinates[i].unitsPerSi(), coordinates[i].unit());
    }
    text += "\n";
  };
  add(result.q, result.stiffness_NPerM, result.unstable, fmt::format("the result, and {} starts", search.backToFirst));
  for (const auto& other : search.others) {
    add(other.q, other.stiffness_NPerM, other.unstable, other.starts > 0 ? fmt::format("{} starts", other.starts) : "between two stable ones");
  }
  return text;
}

ordered_json toJson(const scene::Scene& scene, const model::GaitErrorEstimate& estimate) {
  ordered_json json = {{"complete", estimate.complete}, {"status_text", estimate.statusText}, {"second_run", estimate.second}, {"second_run_cpu_time_s", estimate.cpuTime_s}};
  if (!estimate.complete) return json;
  const auto coordinates = scene.coordinates();
  const auto value = [](const char* key, const model::GaitErrorEstimate::Value& v) { return ordered_json{{key, v.error}, {"time_s", v.time_s}}; };
  json["factor"] = estimate.factor;
  json["pose_m"] = estimate.pose_m;
  if (!estimate.loads.empty()) json["force_share"] = estimate.force;
  for (size_t i = 0; i < coordinates.size(); ++i) {
    if (coordinates[i].isFree) json["coordinates"][coordinates[i].name] = value(coordinates[i].isAngle ? "rad" : "m", estimate.coordinates[i]);
  }
  const std::vector<std::string> names = report::listCompartmentNames(scene);
  for (size_t i = 0; i < estimate.loads.size(); ++i) {
    json["compartments"][names[i]] = {{"force", value("N", estimate.loads[i].force_N)}, {"peak_pressure", value("Pa", estimate.loads[i].peakPressure_Pa)}};
  }
  json["limits"] = {{"pose_m", model::kToleratedPoseError_m}, {"force_share", model::kToleratedForceError}};
  return json;
}

/** The estimate for the terminal. */
std::string formatErrors(const scene::Scene& scene, const model::GaitResult& result, const model::GaitErrorEstimate& estimate) {
  if (!estimate.complete) return fmt::format("No estimate of the integration's error: {}.\n", estimate.statusText);
  std::string text = fmt::format("Estimated errors of the integration, from a second run, {} ({:.3g} s of CPU time, {:.2g} times the first):\n", estimate.second, estimate.cpuTime_s,
                                 result.cpuTime_s > 0 ? estimate.cpuTime_s / result.cpuTime_s : 0.0);
  const auto coordinates = scene.coordinates();
  for (size_t i = 0; i < coordinates.size(); ++i) {
    if (!coordinates[i].isFree) continue;
    const auto& value = estimate.coordinates[i];
    text += fmt::format("  {:<24} {:>10.2g} {:<4} at t = {:.4g} s\n", coordinates[i].name, value.error * coordinates[i].unitsPerSi(), coordinates[i].unit(), value.time_s);
  }
  const std::vector<std::string> names = report::listCompartmentNames(scene);
  for (size_t i = 0; i < estimate.loads.size(); ++i) {
    const auto &force = estimate.loads[i].force_N, &peak = estimate.loads[i].peakPressure_Pa;
    text += fmt::format("  {:<24} {:>10.2g} N    at t = {:.4g} s\n", names[i] + ", force", force.error, force.time_s);
    text += fmt::format("  {:<24} {:>10.2g} MPa  at t = {:.4g} s\n", names[i] + ", peak pressure", 1e-6 * peak.error, peak.time_s);
  }
  if (!estimate.loads.empty()) text += fmt::format("  {:<24} {:>10.2g} %    of their mean, on average\n", "all forces", 100 * estimate.force);
  return text;
}

}  // namespace

scene::ReadOptions makeReadOptions(const CommonOptions& common, const std::string& grid, bool requireModel) {
  scene::ReadOptions options;
  options.dataDir = common.dataFolder;
  options.requireModel = requireModel;
  if (!grid.empty()) options.gridOverride = scene::parseGrid(grid, "--grid");
  return options;
}

int runStaticCommand(const RunOptions& options, const CommonOptions& common) {
  Prepared run = prepare("static", options, common);
  const auto result = compute<model::StaticResult>(run, "static analysis", common, model::runStatic);
  using Status = model::StaticResult::Status;
  scene::Trajectory trajectory;
  trajectory.complete = result.status == Status::converged;
  trajectory.failed = result.status == Status::notConverged;
  trajectory.statusText = result.statusText;
  trajectory.wallTime_s = result.wallTime_s;
  trajectory.cpuTime_s = result.cpuTime_s;
  trajectory.statistics.name = result.method;
  trajectory.statistics.stepsTaken = result.iterations;
  trajectory.statistics.contactEvaluations = result.contactEvaluations;
  trajectory.statistics.distanceQueries = result.distanceQueries;
  trajectory.elementColumns = result.elementColumns;
  run.info.paths = result.paths;
  if (!result.q.empty()) {
    scene::Frame frame;
    frame.time_s = result.time_s;
    frame.q = result.q;
    frame.contacts = result.contacts;
    frame.constraintForce = result.constraintForce;
    frame.elements = result.elements;
    trajectory.frames.push_back(std::move(frame));
  }
  run.info.details["static"] = toJson(run.scene, result);
  const int code = finish(run.scene, trajectory, run.info, options, common);
  if (result.search && !common.console.quiet) fmt::print("\n{}", formatSearch(run.scene, result));
  return code;
}

int runGaitCommand(const RunOptions& options, const CommonOptions& common) {
  Prepared run = prepare("gait", options, common);
  const auto result = compute<model::GaitResult>(run, "gait", common, model::runGait);
  for (const std::string& remark : result.remarks) spdlog::warn("{}", remark);
  run.info.warnings = result.remarks;
  if (result.settling) run.info.details["settling"] = toJson(run.scene, *result.settling);
  if (result.prediction) run.info.details["error_prediction"] = {{"pose_m", result.prediction->pose_m}, {"force_share", result.prediction->force}};
  std::string table;
  if (result.errorEstimate) {
    run.info.details["error_estimate"] = toJson(run.scene, *result.errorEstimate);
    table = formatErrors(run.scene, result, *result.errorEstimate) + "\n";
  }
  return finish(run.scene, result, run.info, options, common, table);
}

int runSeriesCommand(const RunOptions& options, const CommonOptions& common) {
  const Prepared run = prepare("series", options, common);
  const auto result = compute<scene::Trajectory>(run, "series", common, model::runSeries);
  return finish(run.scene, result, run.info, options, common);
}

int runReplayCommand(const RunOptions& options, const CommonOptions& common) {
  installInterruptHandler(false);
  const report::StoredRun run = report::readStoredRun(options.scene);
  CommonOptions stored = common;
  if (!run.dataFolder.empty()) stored.dataFolder = run.dataFolder;
  const scene::Scene scene = scene::readScene(run.sceneFile, makeReadOptions(stored, options.grid, false));
  if (scene.contacts.empty()) throw InputError(options.scene.string() + ": the run's scene has no contact; replay evaluates contact alone");
  fs::path fallback = fs::absolute(options.scene).lexically_normal();
  if (!fallback.has_filename()) fallback = fallback.parent_path();
  fallback += options.grid.empty() ? "-replay" : "-replay-" + options.grid;
  const fs::path folder = chooseOutput(options, fallback);
  if (fs::weakly_canonical(folder) == fs::weakly_canonical(options.scene)) {
    throw InputError(
        fmt::format("--output \"{}\": the results being replayed are there; choose another folder", folder.string()));
  }
  report::OutputFolder::check(folder);
  RunOptions runOptions = options;
  if (run.leftKnee) runOptions.side = "left";
  report::RunInfo info = makeInfo("replay", folder, scene, runOptions, stored);
  info.details["replayed"] = {{"folder", fs::absolute(options.scene).lexically_normal().string()},
                              {"analysis", run.analysis},
                              {"complete", run.complete}};
  warnAbout(scene);
  const auto runner = makeTaskRunner(options.threads);
  if (!run.complete) spdlog::warn("the run in {} is incomplete; so is its replay", options.scene.string());

  scene::Trajectory trajectory;
  {
    ProgressMeter meter("replay", common.console);
    trajectory = model::replay(run.time_s, run.calcCoordinates(scene.coordinates()), scene, meter.callback(), !options.noErrorEstimate, runner.get());
  }
  return finish(scene, trajectory, info, runOptions, stored);
}

}  // namespace genu::app
