#pragma once

#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/scene/Progress.h"
#include "genu/scene/Scene.h"

namespace genu::model {

/** Error against run time of a scene: the scene is run with many settings of integrator, grid, rule and distance, each compared with a
 reference run on a finer grid with a tighter accuracy. A setting of another law has a reference of that law.

   pose error    largest difference of a free coordinate over all output times, angles times kAngleLength_m [m]
   force error   largest difference of a compartment's scalar force [N]

 Scenes with analysis.gait are integrated, others find their static equilibrium. Processor time: the shortest of `repeats` runs, without
 reading the scene and building its grids. */
struct VerifySetting {
  std::string group;       ///< "integrator", "constraints", "grid", "grid x", "grid z", "distance", "law", "combined", "scene": what it varies
  std::string integrator;  ///< empty in static scenes
  double accuracy = 0;     ///< of integrators with error control, else 0
  double step_s = 0;       ///< of fixed-step integrators, else 0
  int maxOrder = 0;        ///< 0: the integrator's own
  double factorX = 1, factorZ = 1;  ///< cells of every compartment, over the scene's
  contact::ContactRule rule = contact::ContactRule::smooth;
  contact::DistanceMethod distance = contact::DistanceMethod::minimum;
  contact::StrainMeasure strain = contact::StrainMeasure::small;
  bool constraints = false;  ///< prescribed coordinates as unknowns with constraints; else as the integrator has them

  std::string describe() const;
};

struct VerifyRow {
  VerifySetting setting;
  std::string problem;  ///< why it gave no result; empty: it did
  double cpu_s = 0, poseError_m = 0, forceError_N = 0;
  std::vector<double> coordinateErrors_m;  ///< of each free coordinate in the order of the scene; their largest is poseError_m
  long evaluations = 0, steps = 0;
  double peakMemory_MB = 0;  ///< of the process while it ran, with the scene; 0: this system does not tell
  bool onFrontPose = false, onFrontForce = false;  ///< no other row is both faster and nearer
};

struct Verification {
  VerifySetting reference;
  double referenceCpu_s = 0;
  std::vector<VerifyRow> rows;
  bool complete = false;  ///< false: interrupted
  /** Index of the cheapest row within the asked errors, -1: none; and the row run once more. */
  int recommended = -1;
  VerifyRow confirmed;
};

struct VerifyOptions {
  bool full = false;
  int repeats = 2;
  double poseError_m = 1e-5, forceError_N = 5;  ///< that the recommendation is for
};

/** The settings that will be run. @throws InputError the scene has no model or no contact */
std::vector<VerifySetting> listVerifySettings(const scene::Scene& scene, const VerifyOptions& options);
/** @throws InputError, ComputationError when the reference cannot be computed; rows that fail say why */
Verification verify(const scene::Scene& scene, const VerifyOptions& options, const scene::Progress& progress = {});

}  // namespace genu::model
