#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/scene/Progress.h"
#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

class KneeSystem;

/** Length that makes a rotation comparable with a translation: moments are divided by it, angles multiplied. The
 distance between condyle centers is about twice this. */
inline constexpr double kAngleLength_m = 0.025;

/** Equilibrium of the free coordinates at rest, prescribed coordinates and loads taken at one time.

   r_i(q) = generalized force of contact, loads, gravity and every other force on free coordinate i at zero velocity = 0

 A residual is compared as max |r_i| with moments divided by kAngleLength_m. */
struct StaticResult {
  enum class Status { converged, notConverged, interrupted };
  Status status = Status::notConverged;
  std::string statusText;  ///< how it ended, and what to try if it did not converge
  std::string method;      ///< "newton", "kinsol", "newton after implicit Euler", "implicit Euler"
  double time_s = 0;       ///< the time tables were read at
  scene::Coordinates q;
  double residual_N = 0;                         ///< largest remaining residual
  double maxAcceleration = 0;                    ///< largest acceleration of the released body at rest [m/s^2, rad/s^2]
  int iterations = 0;                            ///< Newton iterations, or steps of implicit Euler
  std::vector<contact::ContactResult> contacts;  ///< with energy, one per contact pair
  std::vector<double> constraintForce;           ///< generalized force that holds each prescribed coordinate
  std::vector<scene::ElementColumn> elementColumns;
  std::vector<double> elements;                  ///< outputs of the force elements
  std::vector<scene::ElementPath> paths;         ///< of the force elements
  long contactEvaluations = 0, distanceQueries = 0;
  double wallTime_s = 0, cpuTime_s = 0;
  /** Method `both`: largest difference of the two poses, angles times kAngleLength_m [m]. */
  std::optional<double> methodDifference_m;
  /** Eigenvalues of the stiffness of the free coordinates (angles times kAngleLength_m), lowest first; negative: unstable. Empty: none. */
  std::vector<double> stiffness_NPerM;
  bool unstable = false;  ///< the least disturbance makes the body leave it
  struct Equilibrium {
    scene::Coordinates q;
    std::vector<double> stiffness_NPerM;
    bool unstable = false;
    int starts = 0;  ///< that ended here; 0: found between two stable ones
  };
  /** StaticSpec::search: what else was found. Every start is treated as the first: implicit Euler and Newton again where it does not converge. */
  struct Search {
    int starts = 0, converged = 0;
    int movedBack = 0;    ///< starts that were no valid pose and begin nearer to the first equilibrium
    int afterEuler = 0;   ///< of those that converged
    int backToFirst = 0;  ///< that ended at the equilibrium around which they lay
    std::vector<std::string> failures;  ///< "start 7: " and why it did not converge
    bool complete = true;
    std::string stopped;  ///< why it is not complete
    std::vector<Equilibrium> others;
  };
  std::optional<Search> search;
};

/** Static analysis [BF2004 §3.1], from the scene's `static` section (its defaults where there is none).

 Start: free coordinates at their `start`, otherwise 0; y without a start of a floating joint, across which a contact pair lies (fixed side
 towards the root), is found by lowering the child from above until it touches (each move is the smallest element distance, so it
 cannot overshoot). In a model with one joint and no force elements the same is done when a given start penetrates fully, and in `newton`
 when it is separated and y is free. States of muscles are at their equilibrium, activations equal to excitations.
 - newton: pseudo-transient continuation, (I/delta + K) dz = r with the exact contact stiffness in K (centre rule: finite
   differences) and delta grown as the residual falls, which ends as Newton's method; where it fails, implicit Euler takes over and Newton
   finishes (`method` says so).
 - implicitEuler: the paper's way. The equations of motion with a large viscous force on the free coordinates are
   integrated by implicit Euler with growing steps until the acceleration of the body, released at rest, is below
   maxAcceleration. Slower, and it settles from almost any start.
 - both: newton, then implicitEuler from the same start; their difference is reported.

 @throws InputError wrong scene (missing model, table that does not cover the time, load on a prescribed coordinate)
 @throws ComputationError contact is never made (in a scene without force elements), or full penetration */
StaticResult runStatic(const scene::Scene& scene, const scene::Progress& progress = {});

/** What the integration of a gait errs by, estimated from a second run: a tenth of all tolerances, or beside a fixed step the standard integrator with an accuracy of 1e-6.

   error = |first run - second run| / (1 - sqrt(0.1))

 What tolerances keep is the error of a step, which grows as h^(p+1), while that of the run grows as h^p, so as tolerance^(p/(p+1)): the root at the lowest order, 1, that any integrator
 works at, and up to 1.46 times too much of one of higher order. Half of a fixed step would not show what methods of that kind take from a vibration, whatever the step. Where the error is too large for an order
 to show, the phase of a vibration lost, the difference is of its size.
 Errors of grid, surfaces and law are in both runs and no part of it. */
struct GaitErrorEstimate {
  struct Value {
    double error = 0, time_s = 0;  ///< the largest over the frames, and when
  };
  struct Load {
    Value force_N, peakPressure_Pa;
  };
  bool complete = false;
  std::string statusText;          ///< "complete", or why there is none: the second run failed or was interrupted
  std::string second;              ///< what the second run had: "accuracy: 1e-05", "cvode-bdf, accuracy: 1e-06"
  double factor = 1;               ///< of the differences
  std::vector<Value> coordinates;  ///< of each coordinate of the scene, rad or m
  std::vector<Load> loads;         ///< of each compartment, pair by pair: scalar force, peak pressure
  double pose_m = 0;               ///< largest of a free coordinate, angles times kAngleLength_m, those of a floating joint as one rotation
  double force = 0;                ///< mean error of the compartments' scalar forces over their mean
  double cpuTime_s = 0;            ///< of the second run
};
/** Beyond them a gait's estimate is warned of; those of `genu verify --stability`. */
inline constexpr double kToleratedPoseError_m = 1e-4, kToleratedForceError = 0.05;

/** The same, followed while the run goes on, at a few per cent of its cost: coarser, and only where the integrator estimates the errors of its steps (src/model/ErrorGrowth.h). */
struct GaitErrorPrediction {
  double pose_m = 0, force = 0;  ///< as of GaitErrorEstimate
};

/** A trajectory, and the static analysis it started from. */
struct GaitResult : scene::Trajectory {
  std::optional<StaticResult> settling;            ///< absent when the scene starts without settling
  std::vector<std::string> remarks;                ///< why the results may be wrong: what the accuracy is too loose for
  std::optional<GaitErrorPrediction> prediction;   ///< of scenes with contact
  std::optional<GaitErrorEstimate> errorEstimate;  ///< of a complete run with GaitSpec::errorEstimate
};

/** Dynamic analysis [BF2004 §3.2]: prescribed coordinates follow their curves, the free ones are integrated from the static equilibrium at t = 0 and the rates at which it moves on (settleFirst), or from
 their start values at rest.

 Prescribed coordinates are eliminated while integrating; where force elements have states, and for outputs, Simbody's constraints are solved.
 Error control: the local error of each step is kept below `accuracy` in a weighted RMS norm in which 1 is
   1 mm for translations, 1 mm / kAngleLength_m for angles, 10 m/s and 10 m/s / kAngleLength_m for their rates, 0.1 for
   activations, 1 mm for muscle fibres,
 absolute only: a relative tolerance would act on the height of the moving body's origin, some 33 mm, instead of
 the penetration. The default 1e-4 is thus 1e-4 mm. The order of the BDF formulas is capped at 2: higher ones are not
 stable on the undamped contact modes.

 Failure after the start (full penetration, no convergence) is not an exception: the trajectory has `failed`,
 `statusText` and the frames computed so far.
 @throws InputError as runStatic; unknown integrator (lists those available)
 @throws ComputationError contact is never made during the run, or the settling fails */
GaitResult runGait(const scene::Scene& scene, const scene::Progress& progress = {});

/** Static equilibria at the times of the scene's `series` section, each started from the one before: a slow motion without inertia. Tables
 are read at each time. Where one is not found the trajectory has `failed`, `statusText` and the frames so far.
 @throws as runStatic for the first equilibrium */
scene::Trajectory runSeries(const scene::Scene& scene, const scene::Progress& progress = {});

/** Recorded motion evaluated by the contact engine alone, for pressures and areas on the grid of `scene` (which may
 differ from the one of the run). Frames have q, contacts with energy, no rates; with `estimateErrors` also the estimated
 errors that the grid makes, at four times the cost. `runner`: threads for the evaluations. Works without a model section if the
 contact pairs name no links.
 @throws InputError when time and q differ in length, a frame has another number of coordinates than the scene, or a value is not finite */
scene::Trajectory replay(const std::vector<double>& time_s, const std::vector<scene::Coordinates>& q,
                         const scene::Scene& scene, const scene::Progress& progress = {}, bool estimateErrors = true,
                         const contact::TaskRunner* runner = nullptr);

/** Names allowed for GaitSpec::integrator. */
std::vector<std::string> integratorNames();

// What analyses refuse of a scene whose model is built. Runs call these, and so does `genu check`.

struct OdeIntegratorKind;
/** How analysis.gait is integrated: the integrator's kind, and whether prescribed coordinates are unknowns with constraints. */
struct GaitMethod {
  const OdeIntegratorKind* kind;
  bool constraints;
};
/** @throws InputError at analysis.gait.integrator, max_order, step, prescribed or tolerances: what this program does not have, what does not go
 together, and what would be ignored */
GaitMethod chooseGaitMethod(const scene::Scene& scene);
/** @throws InputError at analysis.static: a method that this program does not have, or a search without a free coordinate */
void checkStaticMethod(const scene::Scene& scene, const scene::StaticSpec& settings);
/** All of it for every analysis of the scene, and that tables cover their times. @throws InputError */
void checkAnalyses(const KneeSystem& knee, const scene::Scene& scene);

}  // namespace genu::model
