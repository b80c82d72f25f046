#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "genu/model/Analysis.h"
#include "genu/model/EnergyBalance.h"
#include "genu/scene/Progress.h"
#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

/** How the run of one value ended. */
enum class StabilityOutcome {
  ok,         ///< completed, all errors within the limits
  warned,     ///< completed, an error is beyond its limit, and the program said something
  wrong,      ///< completed, an error is beyond its limit, without a word
  failed,     ///< stopped with a message (no convergence, full penetration, contact never made)
  refused,    ///< InputError: the value is not allowed
  slow,       ///< stopped after StabilityOptions::cpuLimit_s
  unchecked,  ///< completed, but the reference did not
};
const char* toString(StabilityOutcome outcome);

/** What counts as wrong. Pose: largest difference of a free coordinate from the reference over all frames, angles (of a floating
 joint: the angle between both orientations) times kAngleLength_m.
 Force: mean difference of the compartments' scalar forces over their mean, which counts as 1 mN at least. Energy: imbalance less its quadrature
 error, of the scale. */
struct StabilityLimits {
  double pose_m = kToleratedPoseError_m;
  double force = kToleratedForceError;
  double energy = kToleratedImbalance;
};

struct StabilityOptions {
  bool full = false;
  StabilityLimits limits;
  double cpuLimit_s = 3;      ///< of one run
  double ratio = 1.25;        ///< a boundary is bracketed when its sides differ by less (StabilityAxis::isNarrow)
  int maxBisections = 6;
};

struct StabilityCell {
  double value = 0;
  StabilityOutcome outcome = StabilityOutcome::ok;
  std::string message;  ///< of the program: why it failed or was refused, or what it warned of
  std::string reason;   ///< of `wrong` and `warned`: which error is beyond its limit; of `unchecked`: why
  double poseError_m = 0, forceError = 0;
  bool energyKnown = false;
  double energyError = 0;  ///< imbalance less its quadrature error, of the scale; 0 in statics
  double cpu_s = 0;
  long evaluations = 0;
  bool bisected = false;   ///< not one of the axis' own values
};

/** A quantity that is varied while everything else stays. */
struct StabilityAxis {
  enum class Scale { linear, logarithmic, toHalf };  ///< toHalf: logarithm of 0.5 - value, for Poisson's ratio
  std::string name;   ///< "modulus"
  std::string scene;  ///< "knee, gait"
  std::string unit;   ///< of the values
  Scale scale = Scale::logarithmic;
  std::vector<double> values;  ///< increasing
  /** A scene with `gait` is integrated, another finds its static equilibrium. @throws InputError the value is not allowed */
  std::function<scene::Scene(double value)> make;
  /** The scene that it is compared with. Empty: the same scene; integrated by generalized-alpha in `referenceSteps` steps, none below 10 us, whatever its own
   integrator - another method, which cannot step over anything; in statics on a grid twice as fine. */
  std::function<scene::Scene(double value)> makeReference = {};
  int referenceSteps = 5000;

  /** Whether a boundary between a < b is known well enough: b/a below `ratio` (toHalf: of 0.5 - value), linear: b - a below ratio - 1 of a tenth of the
   range of `values`. */
  bool isNarrow(double a, double b, double ratio) const;
  /** Geometric mean (of 0.5 - value), or arithmetic; between 0 and b: b/10. */
  double middle(double a, double b) const;
};

struct StabilityBoundary {
  double good = 0, bad = 0;  ///< the last value that is ok and the first that is not
  StabilityOutcome outcome = StabilityOutcome::failed;
  std::string message;
};

struct StabilityRow {
  std::string name, scene, unit;
  std::vector<StabilityCell> cells;  ///< by value
  std::vector<StabilityBoundary> boundaries;
};

/** A long run without loads that change: energy over time, and what the process holds. */
struct DriftCase {
  std::string name;
  scene::Scene scene;
};
struct DriftResult {
  std::string name, problem;
  std::vector<double> time_s, share;  ///< imbalance over the scale of energy
  double largest = 0, atEnd = 0;
  double scale_J = 0;
  double cpu_s = 0;
  long steps = 0;
  double memoryStart_MB = 0, memoryEnd_MB = 0;  ///< resident, after a twentieth of the run and at its end; 0: not known
};

struct Stability {
  std::vector<StabilityRow> rows;
  std::vector<DriftResult> drifts;
  bool complete = false;  ///< false: interrupted
};

/** Scenes that the program brings along, written to `folder` as those of listBuiltInAxes: the walking knee with a linear material, large strain and a power law, and the knee at rest. */
struct BuiltInScene {
  std::string name;
  scene::Scene scene;
};
std::vector<BuiltInScene> listBuiltInScenes(const std::filesystem::path& folder);

/** Axes over scenes that the program brings along: URDF files and tables are written to `folder`, which must outlive them. */
std::vector<StabilityAxis> listBuiltInAxes(const std::filesystem::path& folder, bool full);
/** Runs with the energy-consistent force and with the paper's: 20 s, full: ten minutes. */
std::vector<DriftCase> listDriftCases(const std::filesystem::path& folder, bool full);
/** The axes that apply to a user's scene: modulus, Poisson's ratio, thickness (where constant), exponent, load, mass, accuracy, step.
 @throws InputError the scene has no model or no contact */
std::vector<StabilityAxis> listSceneAxes(const scene::Scene& scene, const std::filesystem::path& folder, bool full);

/** One value of an axis. Never throws what a scene or a run throws: that is an outcome. */
StabilityCell runStabilityCell(const StabilityAxis& axis, double value, const StabilityOptions& options, const scene::Progress& progress = {});
/** All values of an axis, then bisection wherever two neighbours differ in being ok. */
StabilityRow runStabilityAxis(const StabilityAxis& axis, const StabilityOptions& options, const scene::Progress& progress = {});
DriftResult runDrift(const DriftCase& drift, const scene::Progress& progress = {});
Stability measureStability(const std::vector<StabilityAxis>& axes, const std::vector<DriftCase>& drifts, const StabilityOptions& options,
                           const scene::Progress& progress = {});

/** Resident memory of this process [MB]; 0 where it is not known. */
double calcResidentMemory_MB();

}  // namespace genu::model
