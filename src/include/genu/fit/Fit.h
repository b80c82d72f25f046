#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "genu/fit/Frame.h"
#include "genu/fit/MeshFile.h"
#include "genu/fit/SurfaceFit.h"
#include "genu/scene/Progress.h"

namespace genu::fit {

enum class FrameChoice { file, boundingBox, landmarks };

/** Everything `genu fit` needs; SI. Boxes are in the frame after the transform. docs/fitting.md. */
struct FitOptions {
  std::filesystem::path mesh;
  std::optional<LengthUnit> unit;  ///< absent: guessed
  std::filesystem::path outputDir = ".";
  std::string name;  ///< of the patch and the files; empty: the mesh's file name

  std::optional<Pose> transform;  ///< instead of a frame
  FrameChoice frame = FrameChoice::file;
  FileAxes axes = FileAxes::paper;
  KneeSide side = KneeSide::right;
  std::optional<double> referenceY_m;  ///< bounding-box frame: height of the origin; absent: the bottom
  Landmarks landmarks;

  Box box;                                          ///< triangles with all corners inside
  std::optional<int> component;                     ///< 0: largest; absent: all that the box leaves
  std::optional<std::array<double, 2>> angles_rad;  ///< condyle: range kept
  std::optional<Vec2> axis_m;                       ///< condyle; absent: fitted
  double minNormal = 0.15;  ///< triangles kept: |cosine| between normal and up, or radial, direction
  bool flipMesh = false;    ///< the file's normals point inwards

  SurfaceFitOptions fit;  ///< its parametrization: shape only
  Box contactBox;         ///< second set of statistics; open: none
  bool writeVtp = false;
  bool picture = true;
};

struct FitReport {
  std::string name;
  MeshFileInfo file;
  MeshTopology topology;                   ///< of the whole mesh; per-triangle data left out
  Eigen::AlignedBox3d meshBox, regionBox;  ///< in the output frame
  int meshTriangles = 0, regionTriangles = 0, regionVertices = 0;
  int droppedBySide = 0;   ///< triangles seen edge on or from behind
  int droppedIslands = 0;  ///< triangles of smaller pieces of the selection
  Pose X_PM;               ///< mesh frame in the output frame
  Parametrization parametrization;
  std::array<int, 2> controlPoints = {0, 0};
  DeviationStatistics all;
  std::optional<DeviationStatistics> contact;
  DeviationStatistics between;  ///< patch sampled between the vertices, against the facets
  double chordError_m = 0;      ///< what facets of this size are off a smooth surface anyway (95 %)
  double uncoveredShare = 0;
  int beyondEdge = 0;
  SurfaceFitResult result;
  std::vector<std::string> notes;  ///< for people: what was guessed, left out, or not reached
  std::filesystem::path patchFile, reportFile, pictureFile, vtpFile;  ///< empty when not written
};

/** Reads the mesh, moves it, selects, fits, measures, writes NAME.json (patch), NAME_fit.json (report), NAME.png and
 NAME.vtp.
 @throws InputError for wrong options or meshes; ComputationError when a file cannot be written */
FitReport runFit(const FitOptions& options, const scene::Progress& progress = {});

/** The report as text: unit, frame, region, control points and the deviation table. */
std::string formatReport(const FitReport& report);

}  // namespace genu::fit
