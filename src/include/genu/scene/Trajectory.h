#pragma once

#include <map>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/contact/ErrorEstimate.h"
#include "genu/contact/Types.h"

namespace genu::scene {

/** What a run leaves behind: one frame per output time. SI, coordinates in the order of kCoordinateNames. */
struct Frame {
  double time_s = 0;
  contact::JointCoordinates q{}, qdot{}, qddot{};
  std::vector<contact::ContactResult> contacts;  ///< one per contact pair of the scene, in its order
  std::vector<contact::ContactErrorEstimate> errors;  ///< of `contacts`; empty: not estimated
  std::vector<double> constraintForce;           ///< generalized force that prescribes each coordinate (0 when free)
};

struct IntegratorStatistics {
  std::string name;
  long stepsTaken = 0, stepsAttempted = 0, errorTestFailures = 0, convergenceFailures = 0, realizations = 0,
       contactEvaluations = 0, contactCopies = 0, distanceQueries = 0;
};

struct Trajectory {
  std::vector<Frame> frames;
  bool complete = false;       ///< false after Ctrl-C or a failure: frames hold what was computed so far
  std::string statusText;      ///< "complete", "interrupted at t = ...", or the failure with advice
  bool failed = false;         ///< a failure, not an interruption
  IntegratorStatistics statistics;
  double wallTime_s = 0, cpuTime_s = 0;
};

}  // namespace genu::scene
