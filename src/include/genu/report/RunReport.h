#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "genu/contact/Types.h"
#include "genu/scene/Progress.h"
#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::report {

/** Measured or otherwise known motion to draw over the predicted one: per coordinate an own time axis; SI. */
struct ReferenceMotion {
  std::string source;
  std::vector<double> time_s;
  std::map<int, std::vector<double>> coordinate;  ///< index of a coordinate of the scene -> rad or m
};

/** Reads the columns of a .csv, .sto or .mot table whose names start with a coordinate and end in a unit:
 `rx_deg`, `hip.angle_deg`, `z_mm`, `x_post_mm`, `tz_m` (the same as z), `rz` (then rad or m, or deg in a table marked inDegrees). Time: `time` or `time_s`
 [s], or `percent_cycle`, of which 100 is `duration_s`.
 @throws InputError when the file has no time or no coordinate */
ReferenceMotion readReferenceMotion(const std::filesystem::path& file, double duration_s,
                                    const std::vector<scene::CoordinateInfo>& coordinates = scene::listCoordinates({}));

/** What the writer must know beside scene and trajectory. */
struct RunInfo {
  std::string analysis;  ///< "static", "gait", "series" or "replay"
  std::filesystem::path folder;
  std::vector<std::string> commandLine;
  std::filesystem::path dataFolder;             ///< of `data:` paths; empty: none
  std::map<std::string, std::string> versions;  ///< added to those this library knows
  std::optional<ReferenceMotion> reference;
  std::vector<double> mapFractions = {0.1, 0.3, 0.5, 0.7, 0.9};  ///< of the cycle, for the drawn pressure maps
  bool leftKnee = false;  ///< x is anterior (right knee: posterior); only labels and orientation of drawings
  bool maps = true, plots = true;
  std::vector<std::string> warnings;  ///< of the run, beside what scene::listWarnings says
  nlohmann::ordered_json details;  ///< added to summary.json as it is
  /** Pose of a contact pair's moving body in its fixed body; empty: the joint's, calcPose(frame.q). */
  std::function<contact::Pose(const scene::Frame&, size_t pair)> calcPairPose;
  std::vector<scene::ElementPath> paths;  ///< of force elements at the frame shown, for paths.vtp
};

struct RunOutput {
  std::filesystem::path folder;
  std::string table;               ///< for the terminal
  std::vector<std::string> notes;  ///< things the user should know: plots not drawn, ...
};

/** Index of the frame at maximum load: the largest sum of magnitudes of the applied loads where one varies with time,
 otherwise the largest contact force. @pre frames is not empty */
size_t findMaximumLoad(const scene::Scene& scene, const scene::Trajectory& trajectory);

/** Writes the results folder of an analysis, whole or not at all; docs/program.md lists the files.
 An incomplete trajectory is written and marked. @throws InputError when it cannot be written; ComputationError when
 there is no frame */
RunOutput writeRun(const scene::Scene& scene, const scene::Trajectory& trajectory, const RunInfo& info,
                   const scene::Progress& progress = {});

/** What `genu replay` needs of a results folder. */
struct StoredRun {
  std::string analysis;
  std::filesystem::path sceneFile;   ///< the copy inside the folder
  std::filesystem::path dataFolder;  ///< of its `data:` paths
  std::vector<double> time_s;
  std::vector<std::string> coordinates;  ///< names of the columns of q
  std::vector<scene::Coordinates> q;     ///< as stored: angles in deg where `inDegrees`
  bool inDegrees = true;
  bool complete = true;
  bool leftKnee = false;

  /** q in SI and in the order of the scene's coordinates. @throws InputError when one is not there */
  std::vector<scene::Coordinates> calcCoordinates(const std::vector<scene::CoordinateInfo>& wanted) const;
};
/** @throws InputError when the folder holds no results or its files are not what summary.json says */
StoredRun readStoredRun(const std::filesystem::path& folder);

}  // namespace genu::report
