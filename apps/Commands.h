#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Console.h"
#include "genu/contact/TaskRunner.h"
#include "genu/contact/Types.h"
#include "genu/report/OutputFolder.h"
#include "genu/scene/Scene.h"
#include "genu/scene/SceneFile.h"
#include "genu/scene/Trajectory.h"

namespace genu::app {

/** Options that several commands share. */
struct CommonOptions {
  ConsoleOptions console;
  std::filesystem::path dataFolder;  ///< --data, or the environment's GENU_DATA_DIR
  std::vector<std::string> commandLine;
};

struct RunOptions {
  std::filesystem::path scene;   ///< or the results folder of a replay
  std::filesystem::path output;  ///< empty: chosen from the scene's name
  std::string grid;              ///< "NXxNZ" or empty
  std::filesystem::path reference;
  std::string side = "right";
  bool noMaps = false, noPlots = false, keepFailed = false;
  bool noErrorEstimate = false;  ///< replay
  bool errorEstimate = false;    ///< gait: as with `error_estimate: true` in the scene
  int threads = 1;               ///< 0: all of the machine
};

struct ContactOptions {
  std::filesystem::path scene;
  std::string pose, grid;
  std::filesystem::path field;
  bool json = false;
  bool error = false;             ///< estimate the error of the grid
  std::optional<double> adaptive;  ///< refine until the estimates are within this share of the values
  int threads = 1;
};

struct ExperimentOptions {
  std::string name;
  std::filesystem::path scene, output;
  std::string grid, joint = "tibiofemoral";
  std::string cut;                   ///< elements whose names begin with it are left out
  std::vector<double> flexions_deg;  ///< empty: the experiment's own
  std::string load;                  ///< N or N m, or with a unit; empty: the experiment's own
  bool noPlots = false;
};

struct VerifyCommandOptions {
  std::filesystem::path scene, output;
  std::string grid;
  std::string poseError, forceError;  ///< with units; empty: the defaults
  bool full = false, noPlots = false;
  bool stability = false;
};

// Each returns an exit code or throws InputError or ComputationError.
int runStaticCommand(const RunOptions& options, const CommonOptions& common);
int runGaitCommand(const RunOptions& options, const CommonOptions& common);
int runSeriesCommand(const RunOptions& options, const CommonOptions& common);
int runReplayCommand(const RunOptions& options, const CommonOptions& common);
int runExperimentCommand(const ExperimentOptions& options, const CommonOptions& common);
std::vector<std::string> listExperiments();
int runVerifyCommand(const VerifyCommandOptions& options, const CommonOptions& common);
/** `genu verify --stability`; without a scene the built-in ones. */
int runStabilityCommand(const VerifyCommandOptions& options, const CommonOptions& common);
int runContactCommand(const ContactOptions& options, const CommonOptions& common);
int runCheckCommand(const std::filesystem::path& scene, const CommonOptions& common);
int runExplainCommand(const std::filesystem::path& scene, const CommonOptions& common);

/** The --threads of a command: nullptr for 1. @throws InputError not a number of threads, or this build has none */
std::unique_ptr<const contact::TaskRunner> makeTaskRunner(int threads);
/** Whether this build has threads for evaluations. */
bool hasThreads();
/** Ends a results folder: draws the scripts in its plots/ where plots are wanted, adds `files` to the summary, writes it and commits. */
void drawAndCommit(report::OutputFolder& out, const std::vector<std::string>& scripts, bool noPlots, nlohmann::ordered_json& summary);
/** One line each on stderr: what scene::listWarnings says. */
void warnAbout(const scene::Scene& scene);

/** Pose of each contact pair's moving body in its fixed body, as a function of the scene's coordinates; reads the URDF
 of a scene with a model. */
class PairPoses {
 public:
  explicit PairPoses(const scene::Scene& scene);
  ~PairPoses();
  contact::Pose calcPose(const scene::Coordinates& q, size_t pair) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

scene::ReadOptions makeReadOptions(const CommonOptions& common, const std::string& grid, bool requireModel);

}  // namespace genu::app
