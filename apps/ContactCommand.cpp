#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "Commands.h"
#include "genu/contact/AdaptiveGrid.h"
#include "genu/contact/ContactPair.h"
#include "genu/io/Suggest.h"
#include "genu/model/UrdfModel.h"
#include "genu/report/ContactReport.h"
#include "genu/report/ElementMesh.h"
#include "genu/report/Vtk.h"

namespace genu::app {
namespace fs = std::filesystem;
using contact::EvaluationStatus;

struct PairPoses::Impl {
  std::vector<model::ContactFrames> frames;  // empty: every pair is the joint's
};

PairPoses::PairPoses(const scene::Scene& scene) : impl_(std::make_unique<Impl>()) {
  bool named = scene.model && !scene.model->joints.empty();
  for (const auto& pair : scene.contacts) named = named || !pair.fixedBody.empty() || !pair.movingBody.empty();
  if (!scene.model || !named) return;
  const model::UrdfModel urdf = model::readUrdf(*scene.model);
  for (const auto& pair : scene.contacts) impl_->frames.push_back(model::findContactFrames(urdf, pair));
}

PairPoses::~PairPoses() = default;

contact::Pose PairPoses::calcPose(const scene::Coordinates& q, size_t pair) const {
  return impl_->frames.empty() ? contact::calcPose(scene::takeSix(q)) : impl_->frames[pair].calcPose(q);
}

namespace {

enum class FieldFormat { vtp, csv };

FieldFormat chooseFormat(const fs::path& file) {
  const std::string extension = file.extension().string();
  if (extension == ".vtp") return FieldFormat::vtp;
  if (extension == ".csv") return FieldFormat::csv;
  throw InputError(
      fmt::format("--field \"{}\": unknown extension \"{}\"; allowed: .vtp, .csv", file.string(), extension));
}

void checkFieldFolder(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder)) {
    throw InputError(fmt::format("--field \"{}\": there is no folder \"{}\"", file.string(), folder.string()));
  }
}

/** To four decimals, and never "-0.0000". */
contact::Vec3 roundForPrint(const contact::Vec3& v) {
  return v.unaryExpr([](double value) { return std::round(value * 1e4) / 1e4 + 0.0; });
}

/** The name of a pose the scene defines, or six coordinates of a scene that has no more. */
scene::Coordinates choosePose(const scene::Scene& scene, const std::string& text) {
  const auto named = scene.poses.find(text);
  if (named != scene.poses.end()) return named->second;
  if (scene.model && !scene.model->joints.empty()) {
    std::vector<std::string> names;
    for (const auto& pose : scene.poses) names.push_back(pose.first);
    throw InputError("--pose: a model with several joints needs a pose of the scene by name: " + io::describeUnknown("pose", text, names));
  }
  const contact::JointCoordinates six = scene::parsePose(text, "--pose");
  return {six.begin(), six.end()};
}

}  // namespace

int runContactCommand(const ContactOptions& options, const CommonOptions& common) {
  installInterruptHandler(true);
  std::optional<FieldFormat> format;
  if (!options.field.empty()) {
    format = chooseFormat(options.field);
    checkFieldFolder(options.field);
  }
  const scene::Scene scene = scene::readScene(options.scene, makeReadOptions(common, options.grid, false));
  warnAbout(scene);
  if (scene.contacts.empty()) throw InputError(scene.file.string() + ": contact: the scene has no contact to evaluate");
  const scene::Coordinates q = choosePose(scene, options.pose);
  const auto runner = makeTaskRunner(options.threads);
  ProgressMeter meter("contact", common.console);
  const auto pairs = scene::makeContactPairs(scene);
  const PairPoses poses(scene);

  std::vector<contact::ContactResult> results(pairs.size());
  std::vector<contact::ContactErrorEstimate> errors;
  std::vector<contact::ContactWorkspace> workspaces;
  std::vector<contact::AdaptiveContact> adaptive;
  std::vector<std::string> gridNotes;
  for (size_t p = 0; p < pairs.size(); ++p) {
    if (options.adaptive) {
      contact::AdaptiveOptions wanted;
      const double tolerance = *options.adaptive;
      if (!(tolerance >= 1e-12 && tolerance <= 1)) {
        throw InputError(fmt::format("--adaptive {}: allowed: 1e-12 to 1, a share of each quantity", tolerance));
      }
      wanted.tolerance = {tolerance, tolerance, tolerance, tolerance, tolerance};
      wanted.evaluation.withEnergy = true;
      adaptive.emplace_back(pairs[p]->definition(), wanted);
      const contact::AdaptiveResult& r = adaptive.back().evaluate(poses.calcPose(q, p));
      results[p] = r.result;
      errors.push_back(r.estimate);
      std::string levels;
      for (const int count : r.elementsPerLevel) levels += " " + std::to_string(count);
      gridNotes.push_back(scene.contacts[p].name + ": adaptive grid, " + contact::toString(r.status) + " after " +
                          std::to_string(r.iterations) + " evaluations: " + std::to_string(r.elements) +
                          " elements, by level" + levels);
      if (!r.advice.empty()) spdlog::warn("{}: {}", scene.contacts[p].name, r.advice);
      continue;
    }
    workspaces.emplace_back(*pairs[p]).setTaskRunner(runner.get());
    pairs[p]->evaluate(poses.calcPose(q, p), workspaces[p], {true}, results[p]);
    if (options.error) contact::ErrorEstimator(*pairs[p]).evaluate(workspaces[p], errors.emplace_back());
  }
  const auto pairOf = [&](size_t p) -> const contact::ContactPair& { return options.adaptive ? adaptive[p].pair() : *pairs[p]; };
  const EvaluationStatus status = report::worstStatus(results);
  const bool hasNumbers = report::hasNumbers(status);
  if (format && hasNumbers) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      fs::path file = options.field;
      if (pairs.size() > 1) {
        file.replace_filename(file.stem().string() + "_" + scene.contacts[p].name + file.extension().string());
      }
      const contact::ContactPair& pair = pairOf(p);
      const auto fields = pair.calcFields(options.adaptive ? adaptive[p].workspace() : workspaces[p]);
      const HoldExit hold;
      if (*format == FieldFormat::csv) {
        report::writeElementCsv(file, pair.definition(), fields);
      } else {
        report::writeVtp(file, report::makeElementMesh(pair.definition(), fields, report::Precision::full, poses.calcPose(q, p)));
      }
      spdlog::info("wrote {}", file.string());
      for (size_t k = 0; k < fields.size(); ++k) {
        const std::string note = report::describeUnresolved(pair.definition().compartments[k].name, report::calcUnresolvedShare(fields[k]));
        if (!note.empty()) spdlog::warn("{}: {}", file.string(), note);
      }
    }
  }
  meter.finish();

  const std::string text = report::describeStatus(scene, results);
  if (options.json) {
    nlohmann::ordered_json json = report::toJson(scene, results, errors);
    const std::vector<std::string> warnings = scene::listWarnings(scene);
    if (!warnings.empty()) json["warnings"] = warnings;
    nlohmann::ordered_json grid;
    const auto names = report::listCompartmentNames(scene);
    size_t row = 0;
    for (size_t p = 0; p < pairs.size(); ++p) {
      for (const auto& g : pairOf(p).gridReports()) {
        grid[names[row++]] = {{"cells", g.cells},
                              {"elements", g.elements},
                              {"missed_surface", g.missedSurface},
                              {"below_plane", g.belowPlane},
                              {"missed_back", g.missedBack}};
      }
    }
    if (hasNumbers) json["grid"] = grid;
    fmt::print("{}\n", json.dump(2));
  } else if (hasNumbers) {
    fmt::print("{} at pose {}\nstatus: {}, {}\n\n{}", scene.name, options.pose, contact::toString(status), text,
               report::formatTable(scene, results, errors));
    for (const auto& note : gridNotes) fmt::print("{}\n", note);
    for (const auto& [name, load] : report::listLoads(scene, results)) {
      const contact::Vec3 f = roundForPrint(load.forceOnM_F), cop = roundForPrint(load.centerOfPressure_F * 1e3);
      fmt::print("{}: force on the moving body ({:.4f}, {:.4f}, {:.4f}) N", name, f.x(), f.y(), f.z());
      if (load.activeElements > 0)
        fmt::print(", center of pressure ({:.4f}, {:.4f}, {:.4f}) mm", cop.x(), cop.y(), cop.z());
      fmt::print(", energy {:.4g} J\n", load.energy_J);
    }
  }
  if (!hasNumbers) {
    spdlog::error("{}: {}", scene.file.string(), text);
    return kComputationFailed;
  }
  if (status == EvaluationStatus::extrapolated) spdlog::warn("{}: {}", scene.file.string(), text);
  return kOk;
}

}  // namespace genu::app
