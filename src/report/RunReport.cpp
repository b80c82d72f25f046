#include "genu/report/RunReport.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <numeric>

#include "Plots.h"
#include "genu/io/Files.h"
#include "genu/io/Suggest.h"
#include "genu/io/Table.h"
#include "genu/report/ContactReport.h"
#include "genu/report/ElementMesh.h"
#include "genu/report/Gnuplot.h"
#include "genu/report/OutputFolder.h"
#include "genu/report/Vtk.h"
#include "genu/scene/SceneFile.h"

namespace genu::report {
namespace fs = std::filesystem;
using contact::NetLoad;
using nlohmann::ordered_json;
using scene::Frame;
using scene::kCoordinateNames;
using scene::Scene;
using scene::Trajectory;

namespace {

constexpr double kDegree = contact::kPi / 180;

double interpolate(const std::vector<double>& t, const std::vector<double>& value, double at) {
  const auto next = std::upper_bound(t.begin(), t.end(), at);
  if (next == t.begin()) return value.front();
  if (next == t.end()) return value.back();
  const size_t i = static_cast<size_t>(next - t.begin());
  const double share = (at - t[i - 1]) / (t[i] - t[i - 1]);
  return value[i - 1] + share * (value[i] - value[i - 1]);
}

double calcValue(const scene::TimeFunction& function, double at) {
  if (const auto* constant = std::get_if<double>(&function)) return *constant;
  const auto& series = std::get<scene::TimeSeries>(function);
  return interpolate(series.time_s, series.value, at);
}

bool isTable(const scene::TimeFunction& function) { return std::holds_alternative<scene::TimeSeries>(function); }

/** A name that is safe as part of a file name. */
std::string makeFileName(std::string name) {
  for (char& c : name) {
    const bool safe =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    if (!safe) c = '_';
  }
  return name.empty() ? "pair" : name;
}

// ---------------------------------------------------------------------------------------------------------------
// Tables
// ---------------------------------------------------------------------------------------------------------------

void writeMotion(OutputFolder& out, const Scene& scene, const Trajectory& trajectory) {
  const std::vector<scene::CoordinateInfo> coordinates = scene.coordinates();
  const size_t n = coordinates.size();
  io::Table table;
  table.columns = {"time"};
  for (const auto& c : coordinates) table.columns.push_back(c.name);
  for (const auto& c : coordinates) table.columns.push_back(c.name + "_rate");
  table.data.resize(table.columns.size());
  for (const auto& frame : trajectory.frames) {
    table.data[0].push_back(frame.time_s);
    for (size_t i = 0; i < n; ++i) {
      const double scale = coordinates[i].isAngle ? 1 / kDegree : 1;
      table.data[1 + i].push_back(frame.q[i] * scale);
      table.data[1 + n + i].push_back(frame.qdot.empty() ? 0.0 : frame.qdot[i] * scale);
    }
  }
  const bool one = !scene.model || scene.model->joints.empty();
  io::writeSto(out.file("motion.sto"), scene.name + ", coordinates", table, true,
               std::string(one ? "Pose of the moving body in the fixed body: " : "JOINT.rx to JOINT.z: pose of the child link in the joint's frame, ") +
                   "R = Rx(rx) Ry(ry) Rz(rz), position x, y, z.\n"
                   "Angles in deg, lengths in m, times in s; NAME_rate is the time derivative.");
}

/** One polyline per element; cell data: index of the element among those with a path. */
VtkMesh makePathMesh(const std::vector<scene::ElementPath>& paths) {
  VtkMesh mesh;
  std::vector<std::int32_t> indices;
  for (const auto& path : paths) {
    for (const contact::Vec3& p : path.points_m) mesh.points.insert(mesh.points.end(), {p[0], p[1], p[2]});
    mesh.lineEnds.push_back(static_cast<std::int32_t>(mesh.numPoints()));
    indices.push_back(static_cast<std::int32_t>(indices.size()));
  }
  mesh.cellData.push_back({"element", 1, indices});
  return mesh;
}

void writeElements(OutputFolder& out, const Scene& scene, const Trajectory& trajectory) {
  io::Table table;
  table.columns = {"time"};
  for (const auto& column : trajectory.elementColumns) table.columns.push_back(column.label());
  table.data.resize(table.columns.size());
  for (const auto& frame : trajectory.frames) {
    table.data[0].push_back(frame.time_s);
    for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) table.data[1 + i].push_back(frame.elements[i]);
  }
  io::writeSto(out.file("elements.sto"), scene.name + ", force elements", table, false,
               "ELEMENT.quantity_unit, SI; force: tension along the path. inside_wrap: pieces of the path with an end inside their wrapping surface.\n"
               "state of muscles: 0 ok, 1 tendon slack, 2 fibre below, 3 above the range of the curves.");
}

void writeContact(OutputFolder& out, const Scene& scene, const Trajectory& trajectory) {
  static constexpr std::array<const char*, 19> kQuantities = {
      "force_x_N",      "force_y_N",         "force_z_N",
      "moment_x_Nm",    "moment_y_Nm",       "moment_z_Nm",
      "scalar_force_N", "peak_pressure_Pa",  "mean_pressure_Pa",
      "area_m2",        "active_elements",   "cop_x_m",
      "cop_y_m",        "cop_z_m",           "energy_J",
      "max_strain",     "boundary_elements", "no_thickness_elements",
      "status"};
  std::vector<std::string> names = listCompartmentNames(scene);
  names.emplace_back("total");
  io::Table table;
  table.columns = {"time"};
  for (const auto& name : names) {
    for (const char* quantity : kQuantities) {
      if (quantity != std::string("status")) table.columns.push_back(name + "." + quantity);
    }
  }
  table.columns.emplace_back("status");
  const bool withErrors = !trajectory.frames.front().errors.empty();
  if (withErrors) {
    for (const auto& name : names) {
      for (const char* quantity : {"force_error_N", "moment_error_Nm", "peak_pressure_error_Pa", "mean_pressure_error_Pa",
                                   "area_error_m2"}) {
        table.columns.push_back(name + "." + quantity);
      }
    }
  }
  table.data.resize(table.columns.size());
  for (const auto& frame : trajectory.frames) {
    size_t column = 0;
    const auto add = [&](double value) { table.data[column++].push_back(value); };
    add(frame.time_s);
    std::vector<NamedLoad> rows = listLoads(scene, frame.contacts);
    rows.push_back({"total", sumLoads(frame.contacts)});
    for (const auto& [name, load] : rows) {
      for (int axis = 0; axis < 3; ++axis) add(load.forceOnM_F[axis]);
      for (int axis = 0; axis < 3; ++axis) add(load.momentOnM_Fo_F[axis]);
      add(load.scalarForce_N);
      add(load.peakPressure_Pa);
      add(load.meanPressure_Pa);
      add(load.area_m2);
      add(load.activeElements);
      for (int axis = 0; axis < 3; ++axis) add(load.centerOfPressure_F[axis]);
      add(load.energy_J);
      add(load.maxStrain);
      add(load.boundaryElements);
      add(load.noThicknessElements);
    }
    add(static_cast<double>(worstStatus(frame.contacts)));
    if (!withErrors) continue;
    std::vector<contact::LoadError> errors = listErrors(frame.errors);
    errors.push_back(sumErrors(frame.contacts, frame.errors));
    for (const contact::LoadError& e : errors) {
      for (const double value : {e.force_N, e.moment_Nm, e.peakPressure_Pa, e.meanPressure_Pa, e.area_m2}) add(value);
    }
  }
  std::string remark =
      "Loads on the moving body in the fixed frame, moments about the fixed origin.\n"
      "cop: center of pressure. max_strain: largest penetration over thickness. Elements that carry nothing:\n"
      "boundary, behind the open border of the moving surface; no_thickness, its back surface is missed.\n"
      "status: 0 ok, 1 extrapolated, 2 full penetration, 3 not converged.";
  if (withErrors) remark += "\n*_error_*: estimated error that the grid makes; of force and moment as vectors.";
  io::writeSto(out.file("contact.sto"), scene.name + ", contact", table, false, remark);
}

// ---------------------------------------------------------------------------------------------------------------
// Pressure maps and surfaces
// ---------------------------------------------------------------------------------------------------------------

std::vector<const contact::ContactSurface*> listSurfaces(const contact::ContactPairDefinition& definition, bool fixed) {
  std::vector<const contact::ContactSurface*> surfaces;
  for (const auto& compartment : definition.compartments) {
    const auto* surface = (fixed ? compartment.fixedSurface : compartment.movingSurface).get();
    if (std::find(surfaces.begin(), surfaces.end(), surface) == surfaces.end()) surfaces.push_back(surface);
  }
  return surfaces;
}

/** Frames nearest to the asked fractions of the cycle, each once. */
std::vector<size_t> chooseFrames(const Trajectory& trajectory, const RunInfo& info, double duration_s) {
  if (trajectory.frames.size() == 1) return {0};
  std::vector<size_t> chosen;
  const double start = trajectory.frames.front().time_s;
  for (const double fraction : info.mapFractions) {
    const double at = start + fraction * duration_s;
    size_t best = 0;
    for (size_t i = 1; i < trajectory.frames.size(); ++i) {
      if (std::abs(trajectory.frames[i].time_s - at) < std::abs(trajectory.frames[best].time_s - at)) best = i;
    }
    if (chosen.empty() || chosen.back() != best) chosen.push_back(best);
  }
  return chosen;
}

struct MapOutput {
  std::vector<std::string> scripts, notes;
  bool complete = true;
};

MapOutput writeMaps(OutputFolder& out, const Scene& scene, const Trajectory& trajectory, const RunInfo& info,
                    double duration_s, const scene::Progress& progress) {
  MapOutput output;
  const auto pairs = scene::makeContactPairs(scene);
  const std::vector<size_t> chosen = chooseFrames(trajectory, info, duration_s);
  std::vector<std::pair<double, std::string>> maps, surfaces;
  std::vector<double> unresolved;  // largest share of the force, of each compartment of all pairs
  for (size_t p = 0; p < pairs.size() && output.complete; ++p) {
    const contact::ContactPair& pair = *pairs[p];
    const std::string pairName = makeFileName(scene.contacts[p].name);
    contact::ContactWorkspace workspace(pair);
    contact::ContactResult result;
    std::vector<MapPanel> panels;
    const size_t firstOfPair = unresolved.size();
    unresolved.resize(firstOfPair + pair.definition().compartments.size());
    const auto fixedSurfaces = listSurfaces(pair.definition(), true);
    const auto movingSurfaces = listSurfaces(pair.definition(), false);
    if (info.maps) {
      writeVtp(out.file("surfaces/" + pairName + "_fixed.vtp"), tessellate(fixedSurfaces, {}, 48));
    }
    for (size_t i = 0; i < trajectory.frames.size(); ++i) {
      const bool drawn = std::find(chosen.begin(), chosen.end(), i) != chosen.end();
      if (!info.maps && !drawn) continue;
      if (progress && !progress((p + static_cast<double>(i) / trajectory.frames.size()) / pairs.size())) {
        output.complete = false;
        break;
      }
      const Frame& frame = trajectory.frames[i];
      const contact::Pose X_FM = info.calcPairPose ? info.calcPairPose(frame, p) : contact::calcPose(scene::takeSix(frame.q));
      pair.evaluate(X_FM, workspace, {}, result);
      const auto fields = pair.calcFields(workspace);
      for (size_t k = 0; k < fields.size(); ++k) {
        unresolved[firstOfPair + k] = std::max(unresolved[firstOfPair + k], calcUnresolvedShare(fields[k]));
      }
      if (info.maps) {
        VtkMesh mesh = makeElementMesh(pair.definition(), fields, Precision::single, X_FM);
        mesh.fieldData.push_back({"TimeValue", 1, std::vector<double>{frame.time_s}});
        const std::string name = fmt::format("maps/{}_{:04}.vtp", pairName, i);
        writeVtp(out.file(name), mesh);
        maps.emplace_back(frame.time_s, name);
      }
      if (!drawn) continue;
      if (info.maps) {
        const std::string name = fmt::format("surfaces/{}_moving_{:04}.vtp", pairName, i);
        writeVtp(out.file(name), tessellate(movingSurfaces, X_FM, 48));
        surfaces.emplace_back(frame.time_s, "surfaces/" + pairName + "_fixed.vtp");
        surfaces.emplace_back(frame.time_s, name);
      }
      const double percent = 100 * (frame.time_s - trajectory.frames.front().time_s) / duration_s;
      panels.push_back({info.analysis == "static"
                            ? scene.name
                            : fmt::format("t = {:.3g} s  ({:.0f} % of cycle)", frame.time_s, percent),
                        fields, result.compartments});
    }
    if (info.plots && !panels.empty()) {
      output.scripts.push_back(writeMapPlot(out, pairs.size() > 1 ? "pressure_map_" + pairName : "pressure_map",
                                            pair.definition(), panels, info.leftKnee,
                                            // The first pair's fixed body is the tibia; another one's axes are its own.
                                            scene.contacts[p].fixedBody == scene.contacts[0].fixedBody));
    }
  }
  const std::vector<std::string> names = listCompartmentNames(scene);
  for (size_t k = 0; k < unresolved.size(); ++k) {
    std::string note = describeUnresolved(names[k], unresolved[k]);
    if (!note.empty()) output.notes.push_back("pressure maps: " + std::move(note));
  }
  if (!maps.empty()) writePvd(out.file("pressure.pvd"), maps);
  if (!surfaces.empty()) writePvd(out.file("surfaces.pvd"), surfaces);
  return output;
}

// ---------------------------------------------------------------------------------------------------------------
// Copy of the inputs
// ---------------------------------------------------------------------------------------------------------------

/** Copies the scene and the files it names so that the results can be evaluated again anywhere. Relative paths keep
 their places relative to each other, `data:` paths go into a data folder; absolute ones are left where they are. */
ordered_json copyScene(OutputFolder& out, const Scene& scene, const fs::path& dataFolder) {
  const fs::path file = fs::absolute(scene.file).lexically_normal();
  std::vector<fs::path> relative = {file};
  std::vector<std::string> kept;
  static constexpr std::array<const char*, 3> kDataPrefixes = {"data:", "${GENU_DATA_DIR}", "${GENU_DATA}"};
  for (const auto& item : scene.inputHashes) {
    const std::string& written = item.first;
    const auto prefix = std::find_if(kDataPrefixes.begin(), kDataPrefixes.end(),
                                     [&](const char* text) { return written.rfind(text, 0) == 0; });
    if (prefix != kDataPrefixes.end()) {
      const fs::path inside = fs::path(written.substr(std::string(*prefix).size())).relative_path().lexically_normal();
      if (!dataFolder.empty() && fs::is_regular_file(dataFolder / inside) && *inside.begin() != "..") {
        io::writeFileAtomically(out.file("scene/data" / inside), io::readFile(dataFolder / inside));
        continue;
      }
      kept.push_back(written);
    } else if (fs::path(written).is_absolute()) {
      if (fs::path(written).lexically_normal() != file) kept.push_back(written);
    } else {
      const fs::path path = (file.parent_path() / written).lexically_normal();
      if (fs::is_regular_file(path)) relative.push_back(path);
    }
  }
  // The deepest folder above all of them.
  fs::path root = file.parent_path();
  for (const auto& path : relative) {
    while (*path.lexically_relative(root).begin() == "..") root = root.parent_path();
  }
  for (const auto& path : relative) {
    io::writeFileAtomically(out.file("scene/files" / path.lexically_relative(root)), io::readFile(path));
  }
  ordered_json json;
  json["name"] = scene.name;
  json["file"] = file.generic_string();
  json["sha256"] = io::calcSha256(io::readFile(file));
  json["copy"] = ("scene/files" / file.lexically_relative(root)).generic_string();
  json["data_folder"] = fs::exists(out.staging() / "scene/data") ? "scene/data" : "";
  json["not_copied"] = kept;
  return json;
}

// ---------------------------------------------------------------------------------------------------------------
// Summary
// ---------------------------------------------------------------------------------------------------------------

ordered_json makePose(const Scene& scene, const scene::Coordinates& q) {
  ordered_json json;
  const auto coordinates = scene.coordinates();
  for (size_t i = 0; i < coordinates.size(); ++i) {
    json[coordinates[i].name + "_" + coordinates[i].unit()] = coordinates[i].isAngle ? q[i] / kDegree : q[i] * 1e3;
  }
  return json;
}

/** Keyword -> element -> quantity -> value. */
ordered_json makeElements(const Trajectory& trajectory, const Frame& frame) {
  ordered_json json;
  for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
    const scene::ElementColumn& column = trajectory.elementColumns[i];
    json[column.keyword][column.element][column.quantity + (column.unit.empty() ? "" : "_" + column.unit)] = frame.elements[i];
  }
  return json;
}

ordered_json makeInstant(const Scene& scene, const Trajectory& trajectory, const Frame& frame) {
  ordered_json json;
  json["time_s"] = frame.time_s;
  json["pose"] = makePose(scene, frame.q);
  if (!scene.contacts.empty()) json["contact"] = toJson(scene, frame.contacts, frame.errors);
  if (!trajectory.elementColumns.empty()) json["elements"] = makeElements(trajectory, frame);
  return json;
}

/** Largest value over the run and when, for each compartment and in total. */
ordered_json makePeaks(const Scene& scene, const Trajectory& trajectory) {
  struct Quantity {
    const char* name;
    double (*get)(const NetLoad&);
  };
  static constexpr std::array<Quantity, 6> kQuantities = {{
      {"scalar_force_N", [](const NetLoad& l) { return l.scalarForce_N; }},
      {"torque_Nm", [](const NetLoad& l) { return l.momentOnM_Fo_F.norm(); }},
      {"peak_pressure_Pa", [](const NetLoad& l) { return l.peakPressure_Pa; }},
      {"mean_pressure_Pa", [](const NetLoad& l) { return l.meanPressure_Pa; }},
      {"area_m2", [](const NetLoad& l) { return l.area_m2; }},
      {"max_strain", [](const NetLoad& l) { return l.maxStrain; }},
  }};
  std::vector<std::string> names = listCompartmentNames(scene);
  names.emplace_back("total");
  ordered_json json;
  for (size_t row = 0; row < names.size(); ++row) {
    for (const auto& quantity : kQuantities) {
      double best = -1, when = 0;
      for (const auto& frame : trajectory.frames) {
        const auto loads = listLoads(scene, frame.contacts);
        const double value = quantity.get(row < loads.size() ? loads[row].load : sumLoads(frame.contacts));
        if (value > best) best = value, when = frame.time_s;
      }
      json[names[row]][quantity.name] = {{"value", best}, {"time_s", when}};
    }
  }
  return json;
}

/** Largest force of every element over the run and when. */
ordered_json makeElementPeaks(const Trajectory& trajectory) {
  ordered_json json;
  for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
    const scene::ElementColumn& column = trajectory.elementColumns[i];
    if (column.quantity != "force") continue;
    double best = 0, when = trajectory.frames.front().time_s;
    for (const Frame& frame : trajectory.frames) {
      if (std::abs(frame.elements[i]) > std::abs(best)) best = frame.elements[i], when = frame.time_s;
    }
    json[column.keyword][column.element]["force_" + column.unit] = {{"value", best}, {"time_s", when}};
  }
  return json;
}

/** Largest estimated error over the run and when, for each compartment and in total. */
ordered_json makeLargestErrors(const Scene& scene, const Trajectory& trajectory) {
  struct Quantity {
    const char* name;
    double contact::LoadError::*value;
  };
  static constexpr std::array<Quantity, 5> kQuantities = {{{"force_N", &contact::LoadError::force_N},
                                                           {"moment_Nm", &contact::LoadError::moment_Nm},
                                                           {"peak_pressure_Pa", &contact::LoadError::peakPressure_Pa},
                                                           {"mean_pressure_Pa", &contact::LoadError::meanPressure_Pa},
                                                           {"area_m2", &contact::LoadError::area_m2}}};
  std::vector<std::string> names = listCompartmentNames(scene);
  names.emplace_back("total");
  ordered_json json;
  for (size_t row = 0; row < names.size(); ++row) {
    for (const auto& quantity : kQuantities) {
      double largest = -1, when = 0;
      for (const auto& frame : trajectory.frames) {
        const auto errors = listErrors(frame.errors);
        const auto error = row < errors.size() ? errors[row] : sumErrors(frame.contacts, frame.errors);
        if (error.*quantity.value > largest) largest = error.*quantity.value, when = frame.time_s;
      }
      json[names[row]][quantity.name] = {{"value", largest}, {"time_s", when}};
    }
  }
  return json;
}

/** Difference of a predicted coordinate from the reference: as it is and with the means aligned; also against the
 mirrored reference, because signs of measured angles are a frequent doubt. */
ordered_json compare(const Trajectory& trajectory, const ReferenceMotion& reference, int coordinate, bool isAngle) {
  const auto& values = reference.coordinate.at(coordinate);
  const double scale = isAngle ? 1 / kDegree : 1e3;
  std::vector<double> predicted, measured;
  for (const auto& frame : trajectory.frames) {
    if (frame.time_s < reference.time_s.front() || frame.time_s > reference.time_s.back()) continue;
    predicted.push_back(frame.q[static_cast<size_t>(coordinate)] * scale);
    measured.push_back(interpolate(reference.time_s, values, frame.time_s) * scale);
  }
  ordered_json json;
  if (predicted.empty()) return json;
  const auto mean = [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
  };
  const auto rms = [&](double sign, bool alignMeans) {
    const double shift = alignMeans ? mean(predicted) - sign * mean(measured) : 0;
    double sum = 0;
    for (size_t i = 0; i < predicted.size(); ++i) sum += std::pow(predicted[i] - sign * measured[i] - shift, 2);
    return std::sqrt(sum / static_cast<double>(predicted.size()));
  };
  json["unit"] = isAngle ? "deg" : "mm";
  json["rms"] = rms(1, false);
  json["rms_means_aligned"] = rms(1, true);
  json["rms_mirrored"] = rms(-1, false);
  json["rms_mirrored_means_aligned"] = rms(-1, true);
  const auto [lowP, highP] = std::minmax_element(predicted.begin(), predicted.end());
  const auto [lowM, highM] = std::minmax_element(measured.begin(), measured.end());
  json["predicted_range"] = {*lowP, *highP};
  json["reference_range"] = {*lowM, *highM};
  return json;
}

ordered_json makeMotionSummary(const Scene& scene, const Trajectory& trajectory, const RunInfo& info) {
  ordered_json json;
  const auto coordinates = scene.coordinates();
  for (size_t i = 0; i < coordinates.size(); ++i) {
    const scene::CoordinateInfo& coordinate = coordinates[i];
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto& frame : trajectory.frames) low = std::min(low, frame.q[i]), high = std::max(high, frame.q[i]);
    const double scale = coordinate.isAngle ? 1 / kDegree : 1e3;
    ordered_json& item = json[coordinate.name];
    item["kind"] = coordinate.isFree ? "free" : "prescribed";
    item["unit"] = coordinate.unit();
    item["min"] = low * scale;
    item["max"] = high * scale;
    item["start"] = trajectory.frames.front().q[i] * scale;
    item["end"] = trajectory.frames.back().q[i] * scale;
    const int index = static_cast<int>(i);
    if (info.reference && info.reference->coordinate.count(index) > 0 && coordinate.isFree) {
      item["reference"] = compare(trajectory, *info.reference, index, coordinate.isAngle);
    }
  }
  return json;
}

ordered_json makeStatistics(const scene::IntegratorStatistics& s) {
  return {{"integrator", s.name},
          {"prescribed_coordinates", s.prescribed},
          {"steps_taken", s.stepsTaken},
          {"steps_attempted", s.stepsAttempted},
          {"error_test_failures", s.errorTestFailures},
          {"convergence_failures", s.convergenceFailures},
          {"jacobians", s.jacobians},
          {"realizations", s.realizations},
          {"contact_evaluations", s.contactEvaluations},
          {"contact_copies", s.contactCopies},
          {"distance_queries", s.distanceQueries}};
}

std::string nowUtc() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace

size_t findMaximumLoad(const Scene& scene, const Trajectory& trajectory) {
  bool varies = false;
  for (const auto& load : scene.loads)
    varies = varies || std::any_of(load.force_N.begin(), load.force_N.end(), isTable);
  if (scene.contacts.empty() && !varies) return trajectory.frames.size() - 1;
  size_t best = 0;
  double largest = -1;
  for (size_t i = 0; i < trajectory.frames.size(); ++i) {
    const Frame& frame = trajectory.frames[i];
    double size = 0;
    if (varies) {
      for (const auto& load : scene.loads) {
        size += std::hypot(calcValue(load.force_N[0], frame.time_s), calcValue(load.force_N[1], frame.time_s),
                           calcValue(load.force_N[2], frame.time_s));
      }
    } else {
      size = sumLoads(frame.contacts).scalarForce_N;
    }
    if (size > largest) largest = size, best = i;
  }
  return best;
}

ReferenceMotion readReferenceMotion(const fs::path& file, double duration_s, const std::vector<scene::CoordinateInfo>& coordinates) {
  const io::Table table = io::readTable(file);
  ReferenceMotion reference;
  reference.source = file.filename().string();
  for (const char* name : {"time", "time_s", "percent_cycle"}) {
    const int column = table.findColumn(name);
    if (column < 0) continue;
    io::requireIncreasing(table, column);
    reference.time_s = table.data[static_cast<size_t>(column)];
    if (name == std::string("percent_cycle")) {
      for (double& t : reference.time_s) t *= duration_s / 100;
    }
    break;
  }
  if (reference.time_s.empty()) {
    throw InputError(file.string() + ": reference motion: no column \"time\", \"time_s\" or \"percent_cycle\"");
  }
  for (int column = 0; column < table.numColumns(); ++column) {
    const std::string& name = table.columns[static_cast<size_t>(column)];
    // OpenSim's tx is x.
    const bool shifted = name.size() > 1 && name[0] == 't' && name[1] >= 'x' && name[1] <= 'z';
    const std::string plain = shifted ? name.substr(1) : name;
    const size_t last = name.rfind('_');
    for (size_t i = 0; i < coordinates.size(); ++i) {
      const scene::CoordinateInfo& coordinate = coordinates[i];
      const bool named = plain == coordinate.name || plain.rfind(coordinate.name + "_", 0) == 0;
      if (!named || reference.coordinate.count(static_cast<int>(i)) > 0) continue;
      std::string unit = plain.size() == coordinate.name.size() ? "" : name.substr(last + 1);
      if (unit.empty()) unit = !coordinate.isAngle ? "m" : table.inDegrees ? "deg" : "rad";
      const bool fits = coordinate.isAngle ? unit == "deg" || unit == "rad" : unit == "mm" || unit == "m";
      if (!fits) continue;
      std::vector<double> values = table.data[static_cast<size_t>(column)];
      const double scale = unit == "deg" ? kDegree : unit == "mm" ? 1e-3 : 1;
      for (double& value : values) value *= scale;
      reference.coordinate[static_cast<int>(i)] = std::move(values);
    }
  }
  if (reference.coordinate.empty()) {
    std::vector<std::string> wanted;
    for (const auto& coordinate : coordinates) wanted.push_back(coordinate.name + "_" + coordinate.unit());
    throw InputError(file.string() + ": reference motion: no column is named after a coordinate of the scene and its unit; known: " +
                     io::joinNames(wanted));
  }
  return reference;
}

namespace {

double calcAskedDuration_s(const Scene& scene, const RunInfo& info) {
  if (info.analysis == "series") return scene.series ? scene.series->duration_s : 0.0;
  return scene.gait ? scene.gait->duration_s : 0.0;
}

}  // namespace

RunOutput writeRun(const Scene& scene, const Trajectory& trajectory, const RunInfo& info,
                   const scene::Progress& progress) {
  if (trajectory.frames.empty()) throw ComputationError("no result to write: " + trajectory.statusText);
  RunOutput output;
  output.folder = info.folder;
  const bool overTime = trajectory.frames.size() > 1;
  // A run that was cut short still refers to the cycle it was meant to cover.
  const double covered = trajectory.frames.back().time_s - trajectory.frames.front().time_s;
  const double duration_s =
      std::max({overTime && !trajectory.complete ? calcAskedDuration_s(scene, info) : 0.0, covered, 1e-12});

  OutputFolder out(info.folder);
  writeMotion(out, scene, trajectory);
  if (!scene.contacts.empty()) writeContact(out, scene, trajectory);
  if (!trajectory.elementColumns.empty()) writeElements(out, scene, trajectory);
  if (!info.paths.empty()) writeVtp(out.file("paths.vtp"), makePathMesh(info.paths));
  std::vector<std::string> scripts;
  bool mapsComplete = true;
  if (info.maps || info.plots) {
    MapOutput maps = writeMaps(out, scene, trajectory, info, duration_s, progress);
    scripts = maps.scripts;
    output.notes.insert(output.notes.end(), maps.notes.begin(), maps.notes.end());
    mapsComplete = maps.complete;
    if (!mapsComplete) output.notes.emplace_back("pressure maps are incomplete: interrupted");
  }
  DrawResult drawn;
  if (info.plots) {
    if (overTime) {
      for (const auto& script : writeMotionPlots(out, scene, trajectory, info)) scripts.push_back(script);
      if (!scene.contacts.empty()) {
        scripts.push_back(writeForcePlot(out, scene, trajectory));
        scripts.push_back(writePressurePlot(out, scene, trajectory));
      }
      for (const auto& script : writeElementPlots(out, trajectory)) scripts.push_back(script);
    } else {
      if (!scene.contacts.empty()) scripts.push_back(writeForceBars(out, scene, trajectory));
      for (const auto& script : writeElementBars(out, trajectory)) scripts.push_back(script);
    }
    drawn = runGnuplot(out.staging() / "plots", scripts);
    if (!drawn.problem.empty()) output.notes.push_back("plots: " + drawn.problem);
  }

  const size_t chosen = overTime ? findMaximumLoad(scene, trajectory) : 0;
  const Frame& frame = trajectory.frames[chosen];
  ordered_json json;
  json["format"] = "genu-results";
  json["format_version"] = 1;
  json["analysis"] = info.analysis;
  json["complete"] = trajectory.complete;
  json["status"] = trajectory.complete ? "complete" : trajectory.failed ? "failed" : "interrupted";
  json["status_text"] = trajectory.statusText;
  std::vector<std::string> warnings = scene::listWarnings(scene);
  warnings.insert(warnings.end(), info.warnings.begin(), info.warnings.end());
  if (!warnings.empty()) json["warnings"] = warnings;
  if (!scene.contacts.empty()) json["contact_status"] = contact::toString(worstStatus(frame.contacts));
  json["written"] = nowUtc();
  json["scene"] = copyScene(out, scene, info.dataFolder);
  json["inputs_sha256"] = scene.inputHashes;
  json["command_line"] = info.commandLine;
  json["versions"] = {{"genu", GENU_VERSION},
                      {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
                      {"compiler", GENU_COMPILER},
                      {"build_type", GENU_BUILD_TYPE}};
  for (const auto& [name, version] : info.versions) json["versions"][name] = version;
  json["side"] = info.leftKnee ? "left" : "right";
  ordered_json& grids = json["grid"];
  size_t row = 0;
  const std::vector<std::string> names = listCompartmentNames(scene);
  for (const auto& pair : scene.contacts) {
    for (const auto& c : pair.definition.compartments) {
      ordered_json& grid = grids[names[row++]];
      grid = {{"nx", c.nx}, {"nz", c.nz}};
      if (std::holds_alternative<contact::ElementPlane>(c.elementSurface)) {
        grid["rectangle_m"] = {c.x0_m, c.x1_m, c.z0_m, c.z1_m};
      } else if (const auto* cylinder = std::get_if<contact::ElementCylinder>(&c.elementSurface)) {
        grid["cylinder"] = {{"angle_rad", {cylinder->angle0_rad, cylinder->angle1_rad}},
                            {"axial_m", {cylinder->axial0_m, cylinder->axial1_m}}};
      } else {
        const auto& sphere = std::get<contact::ElementSphere>(c.elementSurface);
        grid["sphere"] = {{"angle_rad", {sphere.angle0_rad, sphere.angle1_rad}},
                          {"elevation_rad", {sphere.elevation0_rad, sphere.elevation1_rad}}};
      }
      if (pair.definition.gridOn == contact::GridOn::moving) grid["on"] = "moving";
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  json["wall_time_s"] = trajectory.wallTime_s;
  json["cpu_time_s"] = trajectory.cpuTime_s;
  json["peak_memory_MB"] = static_cast<double>(usage.ru_maxrss) / 1024;
  json["steps"] = makeStatistics(trajectory.statistics);
  json["frames"] = trajectory.frames.size();
  if (overTime) {
    json["at_maximum_load"] = makeInstant(scene, trajectory, frame);
    if (!scene.contacts.empty()) json["peaks"] = makePeaks(scene, trajectory);
    if (!trajectory.elementColumns.empty()) json["element_peaks"] = makeElementPeaks(trajectory);
    if (!frame.errors.empty()) json["largest_error_estimates"] = makeLargestErrors(scene, trajectory);
  } else {
    json["at_static_pose"] = makeInstant(scene, trajectory, frame);
  }
  json["motion"] = makeMotionSummary(scene, trajectory, info);
  if (!info.details.is_null()) json["details"] = info.details;
  json["maps_complete"] = mapsComplete;
  json["plots"] = {{"drawn", drawn.drawn}, {"problem", drawn.problem}};
  json["files"] = out.listFiles();
  io::writeFileAtomically(out.file("summary.json"), json.dump(2) + "\n");
  out.commit();

  output.table = overTime ? fmt::format("At maximum load, t = {:.4g} s:\n", frame.time_s) : "At the static pose:\n";
  output.table += formatTable(scene, frame.contacts, frame.errors);
  return output;
}

std::vector<scene::Coordinates> StoredRun::calcCoordinates(const std::vector<scene::CoordinateInfo>& wanted) const {
  std::vector<scene::Coordinates> result(q.size(), scene::Coordinates(wanted.size()));
  for (size_t i = 0; i < wanted.size(); ++i) {
    const auto found = std::find(coordinates.begin(), coordinates.end(), wanted[i].name);
    if (found == coordinates.end()) {
      throw InputError(sceneFile.string() + ": the stored motion has no coordinate \"" + wanted[i].name + "\"");
    }
    const double scale = wanted[i].isAngle && inDegrees ? kDegree : 1;
    for (size_t row = 0; row < q.size(); ++row) result[row][i] = q[row][static_cast<size_t>(found - coordinates.begin())] * scale;
  }
  return result;
}

StoredRun readStoredRun(const fs::path& folder) {
  const fs::path file = folder / "summary.json";
  if (!fs::is_directory(folder)) throw InputError("\"" + folder.string() + "\": no such results folder");
  if (!fs::is_regular_file(file)) {
    throw InputError("\"" + folder.string() +
                     "\": no summary.json: not a results folder of `genu gait` or `genu static`");
  }
  const auto json = nlohmann::json::parse(io::readFile(file), nullptr, false);
  const auto fail = [&](const std::string& reason) -> InputError { return InputError(file.string() + ": " + reason); };
  if (!json.is_object()) throw fail("not valid JSON");
  const auto get = [&](const char* key) { return json.value(key, nlohmann::json()); };
  if (get("format") != "genu-results") throw fail("key \"format\" is not \"genu-results\"");
  if (get("format_version") != 1) throw fail("key \"format_version\": this program reads version 1");
  StoredRun run;
  try {
    run.analysis = json.at("analysis").get<std::string>();
    run.complete = json.at("complete").get<bool>();
    run.leftKnee = json.at("side").get<std::string>() == "left";
    const auto& scene = json.at("scene");
    run.sceneFile = folder / scene.at("copy").get<std::string>();
    const auto data = scene.at("data_folder").get<std::string>();
    if (!data.empty()) run.dataFolder = folder / data;
  } catch (const nlohmann::json::exception& e) {
    throw fail(std::string("not as a run leaves it: ") + e.what());
  }
  const fs::path motion = folder / "motion.sto";
  const io::Table table = io::readTable(motion);
  const std::string where = motion.string();
  run.time_s = table.data[static_cast<size_t>(table.getColumn("time", where))];
  // Every coordinate has a column and one for its rate.
  run.q.resize(run.time_s.size());
  for (const std::string& name : table.columns) {
    if (table.findColumn(name + "_rate") < 0) continue;
    run.coordinates.push_back(name);
    const auto& values = table.data[static_cast<size_t>(table.getColumn(name, where))];
    for (size_t row = 0; row < values.size(); ++row) run.q[row].push_back(values[row]);
  }
  run.inDegrees = table.inDegrees;
  return run;
}

}  // namespace genu::report
