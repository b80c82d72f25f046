#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "genu/scene/Scene.h"

namespace genu::scene {

struct ReadOptions {
  /** Where `data:` paths and ${GENU_DATA} begin; empty: environment variable GENU_DATA_DIR. */
  std::filesystem::path dataDir;
  bool requireModel = false;                        ///< static and gait analyses need a model
  std::optional<std::pair<int, int>> gridOverride;  ///< nx, nz of every compartment, from the command line
};

/** Reads a scene file (YAML; every key: docs/scene.md), the tables and the surfaces it names, and checks everything
 that can be checked without the URDF.
 @throws InputError "file:line: key.path: what is wrong, the value, what is allowed" */
Scene readScene(const std::filesystem::path& file, const ReadOptions& options = {});

/** The same from text in memory; relative paths are relative to the folder of `file`. */
Scene parseScene(const std::string& yaml, const std::filesystem::path& file, const ReadOptions& options = {});

/** Builds the contact engine of every pair, in the scene's order.
 @throws InputError with the place in the scene when the engine refuses (no overlap, inverted normals, ...) */
std::vector<std::shared_ptr<const contact::ContactPair>> makeContactPairs(const Scene& scene);

/** Choices of a scene that are allowed and can make its results wrong, each with its place, the risk and what to choose instead. */
std::vector<std::string> listWarnings(const Scene& scene);

/** "rx, ry, rz, x, y, z", a unit on each: "0 deg, 0 deg, -30 deg, 0 mm, 35.8 mm, 0 mm". For the command line.
 @throws InputError */
contact::JointCoordinates parsePose(const std::string& text, const std::string& where = "pose");

/** "50x50" (also "50 x 50", "50,50"): nx, nz, each 1 to kMaxGridCells. @throws InputError */
std::pair<int, int> parseGrid(const std::string& text, const std::string& where = "grid");

inline constexpr int kMaxGridCells = 4000;  ///< per side

}  // namespace genu::scene
