#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "Commands.h"
#include "genu/io/Files.h"
#include "genu/io/Suggest.h"
#include "genu/io/Units.h"
#include "genu/model/Experiments.h"

namespace genu::app {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr double kDegree = contact::kPi / 180;

/** A published figure to draw beside the curve: mean and standard deviation, or a range. */
struct Published {
  double flexion_deg, low, high;
};

struct Kind {
  const char* name;
  int axis;              ///< loaded coordinate, -1: flexion alone
  double load;           ///< N or N m, applied in both directions
  const char* loadUnit;
  const char* positive;  ///< what a positive load does to the tibia: the coordinates are the femur's in the tibia
  const char* negative;
  double scale;          ///< of the loaded coordinate, to unit
  const char* unit;
};
// A force on the femur towards +x (posterior) draws the tibia forward; +rx is varus; +ry turns the femur inwards, the tibia outwards.
constexpr std::array<Kind, 4> kKinds = {{{"passive-flexion", -1, 0, "", "", "", 1, ""},
                                         {"drawer", 3, 90, "N", "anterior", "posterior", 1e3, "mm"},
                                         {"varus-valgus", 0, 10, "N m", "varus", "valgus", 1 / kDegree, "deg"},
                                         {"rotation", 1, 4, "N m", "external", "internal", 1 / kDegree, "deg"}}};

// 12 knees at 90 N, mean and standard deviation (doi 10.1007/s00167-019-05839-y, table 1).
constexpr std::array<Published, 4> kAnteriorIntact = {{{0, 4.0 - 1.4, 4.0 + 1.4}, {30, 6.0 - 2.5, 6.0 + 2.5}, {60, 4.7 - 2.4, 4.7 + 2.4}, {90, 3.7 - 2.3, 3.7 + 2.3}}};
constexpr std::array<Published, 4> kAnteriorAclCut = {{{0, 10.0 - 2.9, 10.0 + 2.9}, {30, 12.9 - 2.5, 12.9 + 2.5}, {60, 9.4 - 2.7, 9.4 + 2.7}, {90, 7.7 - 2.5, 7.7 + 2.5}}};
// 40 subjects, 4 N m internal torque at 30, 60 and 90 degrees (doi 10.1186/s12891-015-0826-5).
constexpr std::array<Published, 3> kInternal = {{{30, 17.5, 20}, {60, 17.5, 20}, {90, 17.5, 20}}};

const Published* findPublished(const Kind& kind, const std::string& direction, const std::string& cut, double flexion_deg) {
  const auto search = [flexion_deg](const auto& table) -> const Published* {
    for (const Published& entry : table) {
      if (std::abs(entry.flexion_deg - flexion_deg) < 0.5) return &entry;
    }
    return nullptr;
  };
  if (kind.name == std::string("drawer") && direction == "anterior") {
    if (cut.empty()) return search(kAnteriorIntact);
    if (cut == "ACL") return search(kAnteriorAclCut);
  }
  if (kind.name == std::string("rotation") && direction == "internal" && cut.empty()) return search(kInternal);
  return nullptr;
}

struct Run {
  double flexion_deg;
  std::string direction;
  model::KneeExperimentResult result;
  std::optional<double> intactNeutral;  ///< the loaded coordinate before loading, nothing cut
};

std::string makeTable(const scene::Scene& scene, const std::vector<Run>& runs) {
  std::string text = "asked_flexion_deg,direction,flexion_deg,load";
  for (const auto& c : scene.coordinates()) text += "," + c.name + "_" + c.unit();
  for (const auto& contact : scene.contacts) text += "," + contact.name + ".force_N";
  text += "\n";
  for (const Run& run : runs) {
    for (size_t i = 0; i < run.result.trajectory.frames.size(); ++i) {
      const scene::Frame& frame = run.result.trajectory.frames[i];
      text += fmt::format("{:g},{},{:.6g},{:.6g}", run.flexion_deg, run.direction.empty() ? "-" : run.direction,
                          run.result.flexion_rad[i] / kDegree, run.result.load[i]);
      const auto coordinates = scene.coordinates();
      for (size_t k = 0; k < coordinates.size(); ++k) text += fmt::format(",{:.9g}", frame.q[k] * coordinates[k].unitsPerSi());
      for (const auto& contact : frame.contacts) text += fmt::format(",{:.9g}", contact.total.scalarForce_N);
      text += "\n";
    }
  }
  return text;
}

constexpr const char* kPlotHead =
    "# Draw again with: gnuplot {0}.gp\n"
    "set terminal pngcairo size 1100,{1} font 'DejaVu Sans,14' background rgb 'white' noenhanced\n"
    "set output '{0}.png'\nset encoding utf8\nset border lw 1.2 lc rgb '#404040'\nset grid lw 1 lt 1 lc rgb '#dddddd'\n";
constexpr std::array<const char*, 6> kColors = {"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"};

}  // namespace

std::vector<std::string> listExperiments() {
  std::vector<std::string> names;
  for (const Kind& kind : kKinds) names.emplace_back(kind.name);
  return names;
}

int runExperimentCommand(const ExperimentOptions& options, const CommonOptions& common) {
  installInterruptHandler(false);
  const auto names = listExperiments();
  const auto found = std::find(names.begin(), names.end(), options.name);
  if (found == names.end()) throw InputError(io::describeUnknown("experiment", options.name, names));
  const Kind& kind = kKinds[static_cast<size_t>(found - names.begin())];
  scene::Scene scene = scene::readScene(options.scene, makeReadOptions(common, options.grid, true));
  const scene::Scene intact = scene;
  if (!options.cut.empty()) scene = model::withoutElements(scene, options.cut);
  const fs::path folder = options.output.empty() ? fs::path("results") / (options.scene.stem().string() + "-" + options.name) : options.output;
  report::OutputFolder::check(folder);
  warnAbout(scene);

  const auto coordinates = scene.coordinates();
  size_t first = 0;
  while (first < coordinates.size() && coordinates[first].joint != options.joint) ++first;
  double load = kind.load;
  if (!options.load.empty()) {
    if (kind.axis < 0) throw InputError("--load: " + options.name + " has no load");
    const bool bare = options.load.find_first_not_of("0123456789.+-eE") == std::string::npos;
    load = bare ? io::parseNumber(options.load, "--load")
                : io::parseQuantity(options.load, kind.axis < 3 ? io::Dimension::moment : io::Dimension::force, "--load");
    if (!(load > 0)) throw InputError(fmt::format("--load {}: allowed: > 0 {}", options.load, kind.loadUnit));
  }
  std::vector<double> angles;
  for (const double angle : options.flexions_deg) {
    if (std::find(angles.begin(), angles.end(), angle) == angles.end()) angles.push_back(angle);
  }
  if (angles.empty()) angles = kind.axis < 0 ? std::vector<double>{120} : std::vector<double>{0, 30, 60, 90};
  std::vector<Run> runs;
  bool complete = true;
  {
    ProgressMeter meter(options.name, common.console);
    const scene::Progress all = meter.callback();
    const size_t count = angles.size() * (kind.axis < 0 ? 1 : 2);
    for (const double angle : angles) {
      // A cut moves the unloaded joint too; where a test rig holds it, motion counts from where it was intact.
      std::optional<double> intactNeutral;
      model::KneeExperiment experiment;
      experiment.joint = options.joint;
      experiment.flexion_rad = angle * kDegree;
      if (kind.axis >= 0 && !options.cut.empty()) {
        const auto bent = model::runKneeExperiment(intact, experiment, [](double) { return !wasInterrupted(); });
        if (bent.trajectory.complete) intactNeutral = bent.trajectory.frames.back().q[first + static_cast<size_t>(kind.axis)];
      }
      for (const double sign : {1.0, -1.0}) {
        if (kind.axis < 0 && sign < 0) continue;
        experiment.loadedAxis = kind.axis;
        experiment.load = sign * load;
        const auto progress = [&](double fraction) { return all((static_cast<double>(runs.size()) + fraction) / static_cast<double>(count)); };
        Run run{angle, kind.axis < 0 ? "" : sign > 0 ? kind.positive : kind.negative, model::runKneeExperiment(scene, experiment, progress), intactNeutral};
        if (!run.result.trajectory.complete) {
          complete = false;
          spdlog::warn("{} deg{}: {}", angle, run.direction.empty() ? "" : ", " + run.direction, run.result.trajectory.statusText);
        }
        runs.push_back(std::move(run));
        if (wasInterrupted()) break;
      }
      if (wasInterrupted()) break;
    }
  }

  const HoldExit hold;
  report::OutputFolder out(folder);
  io::writeFileAtomically(out.file(options.name + ".csv"), makeTable(scene, runs));
  ordered_json json = {{"format", "genu-results"}, {"format_version", 1}, {"analysis", "experiment"}, {"experiment", options.name},
                       {"scene", options.scene.string()}, {"complete", complete && !wasInterrupted()}, {"joint", options.joint}};
  if (!options.cut.empty()) json["cut"] = options.cut;
  std::string script, data;
  if (kind.axis >= 0) {
    json["load"] = {{"value", load}, {"unit", kind.loadUnit}};
    fmt::print("{}{}, {:g} {}; scene's own loads on\n{:>8}  {:<10} {:>12} {:>18}{}\n", options.name, options.cut.empty() ? "" : " without " + options.cut, load,
               kind.loadUnit, "flexion", "tibia", fmt::format("moved ({})", kind.unit), "published",
               options.cut.empty() ? "" : "   from where it was intact");
    script = fmt::format(kPlotHead, options.name, 700) + fmt::format("set xlabel 'flexion (deg)'\nset ylabel 'tibia moved ({})'\nset key outside right\n", kind.unit);
    for (const char* direction : {kind.positive, kind.negative}) {
      data += fmt::format("# flexion_deg {}_{} published_low published_high\n", direction, kind.unit);
      for (const Run& run : runs) {
        if (run.direction != direction) continue;
        const auto& frames = run.result.trajectory.frames;
        ordered_json row = {{"flexion_deg", run.flexion_deg}, {"direction", direction}};
        const Published* published = findPublished(kind, direction, options.cut, run.flexion_deg);
        if (published != nullptr) row["published"] = {published->low, published->high};
        if (run.result.trajectory.complete) {
          const size_t axis = first + static_cast<size_t>(kind.axis);
          const double moved = std::abs(frames.back().q[axis] - frames[run.result.firstLoaded].q[axis]) * kind.scale;
          row[std::string("moved_") + kind.unit] = moved;
          const std::string range = published != nullptr ? fmt::format("{:.1f} to {:.1f}", published->low, published->high) : "-";
          std::string fromIntact;
          if (run.intactNeutral) {
            const double sign = direction == kind.positive ? 1 : -1;
            const double value = sign * (frames.back().q[axis] - *run.intactNeutral) * kind.scale;
            row[std::string("moved_from_intact_") + kind.unit] = value;
            fromIntact = fmt::format("{:>27.2f}", value);
          }
          fmt::print("{:>8g}  {:<10} {:>12.2f} {:>18}{}\n", run.flexion_deg, direction, moved, range, fromIntact);
          data += published != nullptr ? fmt::format("{:g} {:.6g} {:g} {:g}\n", run.flexion_deg, moved, published->low, published->high)
                                       : fmt::format("{:g} {:.6g} nan nan\n", run.flexion_deg, moved);
        } else {
          row["problem"] = run.result.trajectory.statusText;
          const double reached = run.result.load.empty() ? 0 : std::abs(run.result.load.back());
          fmt::print("{:>8g}  {:<10} {:>12} no equilibrium beyond {:.3g} {}\n", run.flexion_deg, direction, "-", reached, kind.loadUnit);
        }
        json["laxity"].push_back(row);
      }
      data += "\n\n";
    }
    script += fmt::format("set xrange [-5:*]\nset offsets 0, graph 0.05, graph 0.05, 0\nset yrange [0:*]\nset datafile missing 'nan'\nplot ");
    const std::array<const char*, 2> directions = {kind.positive, kind.negative};
    for (size_t k = 0; k < directions.size(); ++k) {
      const bool known = std::any_of(runs.begin(), runs.end(), [&](const Run& run) {
        return run.direction == directions[k] && findPublished(kind, directions[k], options.cut, run.flexion_deg) != nullptr;
      });
      if (!known) continue;
      script += fmt::format("'{0}.dat' index {1} using 1:(($3+$4)/2):3:4 with yerrorbars lw 2 pt 0 lc rgb '#888888' title 'published, {2}', \\\n     ",
                            options.name, k, directions[k]);
    }
    for (size_t k = 0; k < directions.size(); ++k) {
      script += fmt::format("'{0}.dat' index {1} using 1:2 with linespoints lw 2.5 pt {2} lc rgb '{3}' title '{4}'{5}", options.name, k, k == 0 ? 7 : 5,
                            kColors[k], directions[k], k == 0 ? ", \\\n     " : "\n");
    }
  } else {
    const auto& run = runs.front();
    data = "# flexion_deg";
    for (const auto& c : coordinates) data += " " + c.name + "_" + c.unit();
    for (const auto& contact : scene.contacts) data += " " + contact.name + ".force_N";
    data += "\n";
    for (size_t i = 0; i < run.result.trajectory.frames.size(); ++i) {
      const scene::Frame& frame = run.result.trajectory.frames[i];
      data += fmt::format("{:g}", run.result.flexion_rad[i] / kDegree);
      for (size_t k = 0; k < coordinates.size(); ++k) data += fmt::format(" {:.9g}", frame.q[k] * coordinates[k].unitsPerSi());
      for (const auto& contact : frame.contacts) data += fmt::format(" {:.9g}", contact.total.scalarForce_N);
      data += "\n";
    }
    // Rotations, translations and contact forces above each other; the start of each translation is 0.
    script = fmt::format(kPlotHead, options.name, 1400) + "set key outside right\nset xlabel 'flexion (deg)'\nset multiplot layout 3,1\n";
    const std::array<const char*, 3> labels = {"rotation (deg)", "translation from extension (mm)", "contact force (N)"};
    for (int panel = 0; panel < 3; ++panel) {
      std::string curves;
      size_t count = 0;
      const auto add = [&](size_t column, const std::string& title, bool fromStart) {
        const size_t index = column - 2;
        const double start = fromStart && !run.result.trajectory.frames.empty() ? run.result.trajectory.frames[0].q[index] * coordinates[index].unitsPerSi() : 0;
        curves += fmt::format("{}'{}.dat' using 1:(${}-({:.9g})) with lines lw 2.5 lc rgb '{}' title '{}'", curves.empty() ? "" : ", \\\n     ", options.name,
                              column, start, kColors[count++ % kColors.size()], title);
      };
      for (size_t k = 0; panel < 2 && k < coordinates.size(); ++k) {
        const bool flexion = coordinates[k].joint == options.joint && coordinates[k].axis == 2 && coordinates[k].isAngle;
        if (!flexion && coordinates[k].isFree && coordinates[k].isAngle == (panel == 0)) add(k + 2, coordinates[k].name, panel == 1);
      }
      for (size_t k = 0; panel == 2 && k < scene.contacts.size(); ++k) add(coordinates.size() + 2 + k, scene.contacts[k].name, false);
      if (!curves.empty()) script += fmt::format("set ylabel '{}'\nplot {}\n", labels[static_cast<size_t>(panel)], curves);
    }
    script += "unset multiplot\n";
    json["flexion_deg"] = run.result.flexion_rad.empty() ? 0 : run.result.flexion_rad.back() / kDegree;
    if (!run.result.trajectory.complete) json["problem"] = run.result.trajectory.statusText;
    fmt::print("passive flexion: {} equilibria to {:.0f} deg\n", run.result.trajectory.frames.size(),
               run.result.flexion_rad.empty() ? 0 : run.result.flexion_rad.back() / kDegree);
  }
  io::writeFileAtomically(out.file("plots/" + options.name + ".dat"), data);
  io::writeFileAtomically(out.file("plots/" + options.name + ".gp"), script);
  drawAndCommit(out, {options.name + ".gp"}, options.noPlots, json);
  fmt::print("Results: {}\n", folder.string());
  if (wasInterrupted()) return kInterrupted;
  return complete ? kOk : kComputationFailed;
}

}  // namespace genu::app
