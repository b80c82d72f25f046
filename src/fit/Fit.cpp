#include "genu/fit/Fit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "DeviationPicture.h"
#include "genu/contact/ContactSurface.h"
#include "genu/io/Files.h"
#include "genu/io/NurbsFile.h"
#include "genu/io/Units.h"
#include "genu/report/Vtk.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr double kDegree = contact::kPi / 180;

std::string formatBox(const Eigen::AlignedBox3d& box) {
  char text[160];
  std::snprintf(text, sizeof text, "x %.2f .. %.2f, y %.2f .. %.2f, z %.2f .. %.2f mm", box.min().x() * 1e3,
                box.max().x() * 1e3, box.min().y() * 1e3, box.max().y() * 1e3, box.min().z() * 1e3,
                box.max().z() * 1e3);
  return text;
}

void checkName(const std::string& name) {
  if (name.empty() || name.find_first_of("/\\\"'\n") != std::string::npos) {
    throw InputError("fit: name \"" + name + "\"; allowed: not empty, no / \\ or quotes (it names the files)");
  }
}

Pose choosePose(const FitOptions& options, const TriangleMesh& mesh) {
  if (options.transform) {
    if (options.frame != FrameChoice::file || options.axes != FileAxes::paper) {
      throw InputError("fit: --transform is given together with --frame or --axes; allowed: one of them");
    }
    return *options.transform;
  }
  switch (options.frame) {
    case FrameChoice::boundingBox:
      return calcBoundingBoxFrame(mesh, options.axes, options.referenceY_m);
    case FrameChoice::landmarks:
      if (options.axes != FileAxes::paper) {
        throw InputError("fit: --axes is given together with --frame landmarks, which finds the axes from the points");
      }
      return calcLandmarkFrame(options.landmarks, options.side);
    case FrameChoice::file:
      break;
  }
  return calcAxesPose(options.axes);
}

TriangleMesh keepIf(const TriangleMesh& mesh, const std::vector<char>& keep, const std::string& nothingLeft) {
  TriangleMesh part = extractTriangles(mesh, keep);
  if (part.triangles.empty()) throw InputError(nothingLeft);
  return part;
}

TriangleMesh selectRegion(const FitOptions& options, const TriangleMesh& mesh, FitReport& report) {
  const std::string file = "mesh \"" + options.mesh.string() + "\"";
  const MeshTopology& topology = report.topology;
  std::vector<char> keep(mesh.triangles.size(), 1);
  if (options.component) {
    if (*options.component < 0 || *options.component >= topology.components) {
      throw InputError(file + ": component " + std::to_string(*options.component) + "; allowed: 0 to " +
                       std::to_string(topology.components - 1) + ", by falling area");
    }
    for (size_t t = 0; t < keep.size(); ++t) keep[t] = topology.component[t] == *options.component;
  }
  for (size_t t = 0; t < keep.size(); ++t) {
    for (const int i : mesh.triangles[t]) {
      if (!options.box.contains(mesh.vertices[static_cast<size_t>(i)])) keep[t] = 0;
    }
  }
  TriangleMesh region =
      keepIf(mesh, keep,
             file + ": the box selects no triangle; after the transform the mesh spans " + formatBox(report.meshBox));

  report.parametrization = options.fit.parametrization;
  if (options.fit.parametrization.shape == PatchShape::condyle) {
    report.parametrization = fitCondyleAxis(region);
    if (options.axis_m) {
      report.parametrization.axis_m = *options.axis_m;
      double sum = 0;
      for (const Vec3& p : region.vertices) sum += (p.head<2>() - *options.axis_m).norm();
      report.parametrization.radius_m = sum / region.numVertices();
    }
  } else if (options.angles_rad || options.axis_m) {
    throw InputError("fit: --angles and --axis belong to --shape condyle");
  }
  const Parametrization& layout = report.parametrization;
  keep.assign(region.triangles.size(), 1);
  if (options.angles_rad) {
    double least = 10, most = -10;
    for (size_t t = 0; t < keep.size(); ++t) {
      for (const int i : region.triangles[t]) {
        const double angle = layout.calcAngle(region.vertices[static_cast<size_t>(i)]);
        least = std::min(least, angle);
        most = std::max(most, angle);
        if (angle < (*options.angles_rad)[0] || angle > (*options.angles_rad)[1]) keep[t] = 0;
      }
    }
    region = keepIf(region, keep,
                    file + ": the angles select no triangle; the box holds " + io::formatQuantity(least, "deg", 4) +
                        " to " + io::formatQuantity(most, "deg", 4));
  }

  // One sheet only: what is seen edge on or from behind cannot be laid out.
  std::vector<double> cosine(region.triangles.size());
  double side = 0;
  for (size_t t = 0; t < cosine.size(); ++t) {
    const auto& corners = region.triangles[t];
    Vec3 middle = Vec3::Zero();
    for (const int i : corners) middle += region.vertices[static_cast<size_t>(i)] / 3;
    const Vec3 area = region.calcAreaVector(static_cast<int>(t));
    cosine[t] = layout.calcDirection(middle).dot(area.normalized());
    side += cosine[t] * area.norm();
  }
  keep.assign(region.triangles.size(), 1);
  for (size_t t = 0; t < keep.size(); ++t) {
    keep[t] = (side >= 0 ? cosine[t] : -cosine[t]) >= options.minNormal;
    report.droppedBySide += keep[t] ? 0 : 1;
  }
  region = keepIf(region, keep,
                  file + ": no triangle of the selection faces the fit direction; allowed: a lower --min-normal");

  const MeshTopology pieces = analyzeMesh(region);
  if (pieces.components > 1) {
    const double second = pieces.componentArea_m2[1] / pieces.componentArea_m2[0];
    if (second > 0.2) {
      throw InputError(file + ": the selection consists of " + std::to_string(pieces.components) +
                       " separate pieces, the second as large as " + io::formatNumber(std::round(100 * second)) +
                       " % of the first; choose one with --component or --box");
    }
    keep.assign(region.triangles.size(), 1);
    for (size_t t = 0; t < keep.size(); ++t) {
      keep[t] = pieces.component[t] == 0;
      report.droppedIslands += keep[t] ? 0 : 1;
    }
    region = extractTriangles(region, keep);
  }
  return region;
}

/** The patch between the vertices: its points against the facets, where there are facets. */
DeviationStatistics measureBetween(const contact::NurbsPatch& patch, const TriangleMesh& region) {
  const MeshDistance distance(region);
  std::vector<double> deviation;
  constexpr int n = 150;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double u = (i + 0.5) / n, v = (j + 0.5) / n;
      const Vec3 S = patch.calcPoint(u, v);
      const auto foot = distance.findClosest(S);
      if (foot.onBorder) continue;
      deviation.push_back(std::copysign(foot.distance_m, (foot.point - S).dot(patch.calcNormal(u, v))));
    }
  }
  return calcStatistics(deviation);
}

/** Sagitta of the facets: how much farther facet centers lie from the patch than their corners do. */
double measureChordError(const contact::ContactSurface& surface, const TriangleMesh& region,
                         const SurfaceFitResult& result) {
  std::vector<double> sagitta;
  const contact::NurbsPatch& patch = surface.patch(0);
  for (const auto& t : region.triangles) {
    Vec3 center = Vec3::Zero();
    Vec2 uv = Vec2::Zero();
    double corners = 0;
    bool edge = false;
    for (const int i : t) {
      const auto k = static_cast<size_t>(i);
      center += region.vertices[k] / 3;
      uv += result.uv[k] / 3;
      corners += result.deviation_m[k] / 3;
      edge = edge || result.beyondEdge[k];
    }
    if (edge) continue;
    const Vec3 offset = center - patch.calcPoint(uv.x(), uv.y());
    sagitta.push_back(offset.dot(patch.calcNormal(uv.x(), uv.y())) - corners);
  }
  return calcStatistics(sagitta).percentile95_m;
}

Json toJson(const DeviationStatistics& s) {
  const auto um = [](double m) { return std::round(m * 1e9) / 1e3; };
  return {{"count", s.count},
          {"max_um", um(s.max_m)},
          {"mean_um", um(s.mean_m)},
          {"sd_um", um(s.sd_m)},
          {"rms_um", um(s.rms_m)},
          {"percentile_95_um", um(s.percentile95_m)},
          {"signed_mean_um", um(s.signedMean_m)},
          {"signed_sd_um", um(s.signedSd_m)},
          {"signed_min_um", um(s.signedMin_m)},
          {"signed_max_um", um(s.signedMax_m)}};
}

Json toJson(const Eigen::AlignedBox3d& box) {
  const auto mm = [](const Vec3& p) { return Json{p.x() * 1e3, p.y() * 1e3, p.z() * 1e3}; };
  return {{"min", mm(box.min())}, {"max", mm(box.max())}};
}

Json toJson(const FitReport& r, const FitOptions& options) {
  Json json = {{"format", "genu-fit-report"}, {"version", 1}, {"name", r.name}};
  json["mesh"] = {{"file", options.mesh.filename().string()},
                  {"sha256", io::calcSha256(io::readFile(options.mesh))},
                  {"unit", toString(r.file.unit)},
                  {"unit_guessed", r.file.unitGuessed},
                  {"triangles", r.meshTriangles},
                  {"vertices_in_file", r.file.merge.verticesBefore},
                  {"vertices_merged", r.file.merge.verticesAfter},
                  {"degenerate_triangles", r.file.merge.degenerateTriangles},
                  {"components", r.topology.components},
                  {"border_edges", r.topology.borderEdges},
                  {"non_manifold_edges", r.topology.nonManifoldEdges},
                  {"bounding_box_mm", toJson(r.meshBox)}};
  Json matrix = Json::array();
  for (int i = 0; i < 3; ++i) matrix.push_back({r.X_PM.R(i, 0), r.X_PM.R(i, 1), r.X_PM.R(i, 2), r.X_PM.p[i]});
  matrix.push_back({0, 0, 0, 1});
  json["transform"] = {{"pose", formatPose(r.X_PM)}, {"matrix_m", matrix}};
  json["region"] = {{"triangles", r.regionTriangles},
                    {"vertices", r.regionVertices},
                    {"dropped_facing_away", r.droppedBySide},
                    {"dropped_islands", r.droppedIslands},
                    {"bounding_box_mm", toJson(r.regionBox)}};
  const bool condyle = r.parametrization.shape == PatchShape::condyle;
  json["shape"] = condyle ? "condyle" : "plateau";
  if (condyle) {
    json["axis_mm"] = {r.parametrization.axis_m.x() * 1e3, r.parametrization.axis_m.y() * 1e3};
    json["radius_mm"] = r.parametrization.radius_m * 1e3;
  }
  json["control_points"] = {r.controlPoints[0], r.controlPoints[1]};
  json["tolerance"] = {{"mean_um", options.fit.toleranceMean_m * 1e6},
                       {"max_um", options.fit.toleranceMax_m * 1e6},
                       {"met", r.result.toleranceMet}};
  json["deviation"] = {{"region", toJson(r.all)}, {"between_vertices", toJson(r.between)}};
  if (r.contact) json["deviation"]["contact_box"] = toJson(*r.contact);
  json["chord_error_um"] = r.chordError_m * 1e6;
  json["uncovered_share"] = r.uncoveredShare;
  json["vertices_beyond_edge"] = r.beyondEdge;
  Json history = Json::array();
  for (size_t i = 0; i < r.result.sizeHistory.size(); ++i) {
    history.push_back({{"control_points", r.result.sizeHistory[i]},
                       {"mean_um", r.result.meanHistory_m[i] * 1e6},
                       {"max_um", r.result.maxHistory_m[i] * 1e6}});
  }
  json["history"] = history;
  json["notes"] = r.notes;
  return json;
}

void collectNotes(const FitOptions& options, FitReport& r) {
  const auto add = [&](const std::string& note) { r.notes.push_back(note); };
  if (r.file.unitGuessed) add(std::string("unit guessed from the size: ") + toString(r.file.unit));
  if (r.file.merge.degenerateTriangles > 0) {
    add(std::to_string(r.file.merge.degenerateTriangles) + " degenerate triangles left out");
  }
  if (r.topology.nonManifoldEdges > 0) {
    add(std::to_string(r.topology.nonManifoldEdges) + " edges of the mesh belong to more than two triangles");
  }
  if (r.droppedBySide > 0) add(std::to_string(r.droppedBySide) + " triangles seen edge on or from behind left out");
  if (r.droppedIslands > 0) add(std::to_string(r.droppedIslands) + " triangles of small separate pieces left out");
  if (r.uncoveredShare > 0.02) {
    add(io::formatNumber(std::round(1000 * r.uncoveredShare) / 10) +
        " % of the patch has no mesh below it and is extrapolated");
  }
  if (!r.result.toleranceMet) {
    add("tolerance not met: mean " + io::formatQuantity(r.all.mean_m, "mm", 3) + " (asked " +
        io::formatQuantity(options.fit.toleranceMean_m, "mm", 3) + "), max " +
        io::formatQuantity(r.all.max_m, "mm", 3) + " (asked " +
        io::formatQuantity(options.fit.toleranceMax_m, "mm", 3) + ") with " + std::to_string(r.controlPoints[0]) + "x" +
        std::to_string(r.controlPoints[1]) + " control points, cap " + std::to_string(options.fit.maxPointsU) + "x" +
        std::to_string(options.fit.maxPointsV) + " (a span narrower than four mesh edges is not divided)");
  }
  if (r.result.stopped) add("stopped before the tolerance or the cap was reached");
}

void writeMeshVtp(const fs::path& file, const TriangleMesh& region, const std::vector<double>& deviation_m) {
  report::VtkMesh mesh;
  mesh.cornersPerCell = 3;
  for (const Vec3& p : region.vertices) mesh.points.insert(mesh.points.end(), {p.x(), p.y(), p.z()});
  for (const auto& t : region.triangles) mesh.connectivity.insert(mesh.connectivity.end(), t.begin(), t.end());
  mesh.pointData.push_back({"deviation_m", 1, deviation_m});
  report::writeVtp(file, mesh);
}

}  // namespace

FitReport runFit(const FitOptions& given, const scene::Progress& progress) {
  FitOptions options = given;
  if (options.name.empty()) options.name = options.mesh.stem().string();
  checkName(options.name);
  if (!(options.minNormal >= 0 && options.minNormal < 1)) {
    throw InputError("fit: --min-normal " + io::formatNumber(options.minNormal) + "; allowed: 0 to below 1 (a cosine)");
  }
  if (!(options.fit.toleranceMean_m > 0) || !(options.fit.toleranceMax_m > 0)) {
    throw InputError("fit: tolerances must be greater than 0 mm");
  }

  FitReport report;
  report.name = options.name;
  MeshFile file = readMeshFile(options.mesh, options.unit);
  TriangleMesh& mesh = file.mesh;
  report.file = file.info;
  if (options.flipMesh) {
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  }
  report.topology = analyzeMesh(mesh);
  if (report.topology.inconsistentEdges > 0) {
    throw InputError("mesh \"" + options.mesh.string() + "\": neighbouring triangles have opposite normals at " +
                     std::to_string(report.topology.inconsistentEdges) + " edges; orient the mesh consistently first");
  }
  report.X_PM = choosePose(options, mesh);
  for (Vec3& p : mesh.vertices) p = report.X_PM.apply(p);
  report.meshBox = mesh.calcBoundingBox();
  report.meshTriangles = mesh.numTriangles();
  const TriangleMesh region = selectRegion(options, mesh, report);
  report.regionBox = region.calcBoundingBox();
  report.regionTriangles = region.numTriangles();
  report.regionVertices = region.numVertices();
  report.topology.component.clear();
  report.topology.borderVertex.clear();

  options.fit.parametrization = report.parametrization;
  report.result = fitSurface(region, options.fit, progress);
  const SurfaceFitResult& result = report.result;
  report.controlPoints = {result.patch.numU, result.patch.numV};
  report.uncoveredShare = result.uncoveredShare;
  report.beyondEdge = static_cast<int>(std::count(result.beyondEdge.begin(), result.beyondEdge.end(), 1));
  report.all = calcStatistics(result.deviation_m);
  if (!options.contactBox.isOpen()) {
    std::vector<double> inside;
    for (size_t i = 0; i < region.vertices.size(); ++i) {
      if (options.contactBox.contains(region.vertices[i])) inside.push_back(result.deviation_m[i]);
    }
    if (inside.empty()) {
      throw InputError("fit: the contact box holds no vertex of the region, which spans " +
                       formatBox(report.regionBox));
    }
    report.contact = calcStatistics(inside);
  }
  const contact::ContactSurface surface({contact::NurbsPatch(result.patch)});
  report.between = measureBetween(surface.patch(0), region);
  report.chordError_m = measureChordError(surface, region, result);
  collectNotes(options, report);

  const fs::path base = options.outputDir / options.name;
  const auto with = [&](const char* ending) { return fs::path(base.string() + ending); };
  report.patchFile = with(".json");
  io::writeNurbsFile(report.patchFile, {{options.name, result.patch}},
                     "fitted to " + options.mesh.filename().string() + "; transform " + formatPose(report.X_PM) +
                         "; deviation max " + io::formatQuantity(report.all.max_m, "mm", 3) + ", mean " +
                         io::formatQuantity(report.all.mean_m, "mm", 3));
  if (options.writeVtp) {
    report.vtpFile = with(".vtp");
    writeMeshVtp(report.vtpFile, region, result.deviation_m);
  }
  if (options.picture) {
    const std::string problem = drawDeviation(report, region, options.contactBox, with(".png"));
    if (problem.empty()) {
      report.pictureFile = with(".png");
    } else {
      report.notes.push_back("no picture of the deviation: " + problem);
    }
  }
  report.reportFile = with("_fit.json");
  io::writeFileAtomically(report.reportFile, toJson(report, options).dump(2) + "\n");
  return report;
}

std::string formatReport(const FitReport& r) {
  std::string text;
  char line[256];
  const auto add = [&](const char* format, auto... values) {
    std::snprintf(line, sizeof line, format, values...);
    text += line;
  };
  text += "Fit " + r.name + "\n";
  add("  mesh            %d triangles, %d vertices (%d in the file), unit %s%s, %d piece%s\n", r.meshTriangles,
      r.file.merge.verticesAfter, r.file.merge.verticesBefore, toString(r.file.unit),
      r.file.unitGuessed ? " (guessed)" : "", r.topology.components, r.topology.components == 1 ? "" : "s");
  text += "  bounding box    " + formatBox(r.meshBox) + "\n";
  text += "  transform       " + formatPose(r.X_PM) + "\n";
  for (int i = 0; i < 3; ++i) {
    add("    %16.12f %16.12f %16.12f %14.9f m\n", r.X_PM.R(i, 0), r.X_PM.R(i, 1), r.X_PM.R(i, 2), r.X_PM.p[i]);
  }
  add("    %16.12f %16.12f %16.12f %14.9f\n", 0.0, 0.0, 0.0, 1.0);
  add("  region          %d triangles, %d vertices\n", r.regionTriangles, r.regionVertices);
  text += "                  " + formatBox(r.regionBox) + "\n";
  if (r.parametrization.shape == PatchShape::condyle) {
    add("  condyle axis    x %.3f mm, y %.3f mm, mean radius %.3f mm\n", r.parametrization.axis_m.x() * 1e3,
        r.parametrization.axis_m.y() * 1e3, r.parametrization.radius_m * 1e3);
  }
  add("  control points  %d x %d, %.1f %% of the patch without mesh below it\n", r.controlPoints[0], r.controlPoints[1],
      100 * r.uncoveredShare);
  add("  facets          %.2f um off a smooth surface (95 %%)\n", r.chordError_m * 1e6);
  add("\n  deviation [um]     count      max     mean       sd      rms     95 %%   signed mean     sd\n");
  const auto row = [&](const char* name, const DeviationStatistics& s) {
    add("  %-16s %7d %8.2f %8.3f %8.3f %8.3f %8.2f %13.4f %6.2f\n", name, s.count, s.max_m * 1e6, s.mean_m * 1e6,
        s.sd_m * 1e6, s.rms_m * 1e6, s.percentile95_m * 1e6, s.signedMean_m * 1e6, s.signedSd_m * 1e6);
  };
  row("region", r.all);
  if (r.contact) row("contact box", *r.contact);
  row("between vertices", r.between);
  text += "\n";
  for (const std::string& note : r.notes) text += "  note: " + note + "\n";
  for (const fs::path* file : {&r.patchFile, &r.reportFile, &r.pictureFile, &r.vtpFile}) {
    if (!file->empty()) text += "  wrote " + file->string() + "\n";
  }
  return text;
}

}  // namespace genu::fit
