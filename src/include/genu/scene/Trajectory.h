#pragma once

#include <map>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/contact/ErrorEstimate.h"
#include "genu/contact/Types.h"

namespace genu::scene {

/** Values of the model's coordinates, rad or m, in the order of listCoordinates. */
using Coordinates = std::vector<double>;

/** The six of a floating joint that begin at `first`. @pre there are so many */
inline contact::JointCoordinates takeSix(const Coordinates& q, size_t first = 0) {
  return {q.at(first), q.at(first + 1), q.at(first + 2), q.at(first + 3), q.at(first + 4), q.at(first + 5)};
}

/** What a run leaves behind: one frame per output time. SI. */
struct Frame {
  double time_s = 0;
  Coordinates q, qdot, qddot;  ///< rates are empty where they are not known
  std::vector<contact::ContactResult> contacts;  ///< one per contact pair of the scene, in its order
  std::vector<contact::ContactErrorEstimate> errors;  ///< of `contacts`; empty: not estimated
  std::vector<double> constraintForce;           ///< generalized force that prescribes each coordinate (0 when free)
  std::vector<double> elements;                  ///< outputs of the force elements, in the order of Trajectory::elementColumns
};

struct IntegratorStatistics {
  std::string name;
  std::string prescribed;  ///< "eliminated" or "constraints"; empty: nothing was integrated
  long stepsTaken = 0, stepsAttempted = 0, errorTestFailures = 0, convergenceFailures = 0, jacobians = 0, realizations = 0,
       contactEvaluations = 0, contactCopies = 0, distanceQueries = 0;
};

/** A quantity that a force element reports. */
struct ElementColumn {
  std::string keyword;   ///< "ligaments"
  std::string element;   ///< "ACL_am"
  std::string quantity;  ///< "force"
  std::string unit;      ///< SI: "N"; "" without one

  /** "ACL_am.force_N" */
  std::string label() const { return element + "." + quantity + (unit.empty() ? "" : "_" + unit); }
};

/** Where the paths of elements run, for pictures: points in the root link's frame [m]. */
struct ElementPath {
  std::string keyword, element;
  std::vector<contact::Vec3> points_m;
};

struct Trajectory {
  std::vector<Frame> frames;
  std::vector<ElementColumn> elementColumns;
  bool complete = false;       ///< false after Ctrl-C or a failure: frames hold what was computed so far
  std::string statusText;      ///< "complete", "interrupted at t = ...", or the failure with advice
  bool failed = false;         ///< a failure, not an interruption
  IntegratorStatistics statistics;
  double wallTime_s = 0, cpuTime_s = 0;
};

}  // namespace genu::scene
