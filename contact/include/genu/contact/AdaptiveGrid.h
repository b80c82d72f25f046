#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "genu/contact/ErrorEstimate.h"

namespace genu::contact {

/** Largest estimated error of each quantity of the total load, as a share of the quantity's own value; absent: not asked for.
 The moment's share is of max(|M|, |F| 1 mm), so that a moment that vanishes by symmetry can be met. With the centre rule twice the estimate must be within: its estimates scatter, and
 stopping at the first grid that passes prefers those that are too small. */
struct AdaptiveTolerances {
  std::optional<double> force, moment, peakPressure, meanPressure, area;
};

struct AdaptiveOptions {
  AdaptiveTolerances tolerance;
  int maxElements = 50000;  ///< of all compartments, companion grid not counted
  int maxLevel = 8;         ///< finest level of cells, at most kMaxGridLevel - 1
  /** Share of the sum of squared cell differences that the cells split in one step hold [Doerfler 1996, bulk criterion]. */
  double marking = 0.8;
  int maxIterations = 30;
  ContactPair::Options evaluation;  ///< of every evaluation
};

enum class AdaptiveStatus {
  converged,       ///< every estimate is within its tolerance
  elementLimit,    ///< more elements would be needed than allowed
  levelLimit,      ///< the cells that matter have the finest level already
  iterationLimit,
  doubtful,        ///< the evaluation itself is not usable (result.status): refining does not help
};
const char* toString(AdaptiveStatus status);

struct AdaptiveResult {
  ContactResult result;
  ContactErrorEstimate estimate;         ///< of `result`
  AdaptiveStatus status = AdaptiveStatus::converged;
  std::string advice;                    ///< what is over its tolerance, by how much, and what to change; empty when converged
  int iterations = 0;                    ///< evaluations done for this pose
  int elements = 0;
  std::vector<int> elementsPerLevel;
};

/** Evaluates a contact pair on a grid that it refines where ErrorEstimator's cell differences are largest, until the estimates
 meet the tolerances: evaluate, estimate, split the cells that hold most of the difference of what is over its tolerance (force,
 moment, area: their own cells, the rim's for the area; mean: both; peak: the cells around it), repeat. The last grid serves the
 next pose; it starts again from the definition's grid when most of its split cells are out of contact, or when it meets the
 element limit. The answer at a pose therefore depends on the poses before it, within the tolerance; start() forgets them.
 Contact that both the base grid and its companion miss is not found: choose a base grid with a few cells across the smallest
 contact. The estimate covers the discretisation only (ErrorEstimate.h). Allocates while it refines. Not thread-safe. */
class AdaptiveContact {
 public:
  /** @throws std::invalid_argument as ContactPair, and: no tolerance given, a tolerance outside 1e-12 .. 1, a limit out of range */
  AdaptiveContact(ContactPairDefinition definition, const AdaptiveOptions& options);
  ~AdaptiveContact();
  AdaptiveContact(AdaptiveContact&&) noexcept;

  const AdaptiveResult& evaluate(const JointCoordinates& q);
  const AdaptiveResult& evaluate(const Pose& X_FM);
  /** Back to the definition's grid. */
  void start();

  /** The pair on its present grid and the workspace of its last evaluation, for ContactPair::calcFields. */
  const ContactPair& pair() const;
  const ContactWorkspace& workspace() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace genu::contact
