#pragma once

#include <memory>
#include <vector>

#include "genu/contact/ContactPair.h"

namespace genu::contact {

class AdaptiveContact;
struct ErrorEstimatorProbe;

/** Estimated absolute errors of a net load. Each is an estimate of the size of the error, never negative, not a bound:
 how often the true error is larger was measured and is stated in docs/theory.md, "Error estimate". */
struct LoadError {
  double force_N = 0;           ///< of the vector forceOnM_F: |F - F_true|
  double moment_Nm = 0;         ///< of the vector momentOnM_Fo_F
  double peakPressure_Pa = 0;
  double meanPressure_Pa = 0;
  double area_m2 = 0;
};

struct ContactErrorEstimate {
  std::vector<LoadError> compartments;  ///< in the order of the definition
  LoadError total;
  /** How the evaluation on the companion grid ended. Not ok: the estimate is as doubtful as that evaluation. */
  EvaluationStatus companionStatus = EvaluationStatus::ok;
  int companionElements = 0;  ///< elements of the companion grid
};

/** Second grid on the same rectangles that an evaluation is compared with. */
enum class Companion {
  fine,    ///< every cell split in four: three to four times the cost of the evaluation itself
  coarse,  ///< half as many cells each way (rounded up): about half the cost; plain grids only. Less sharp, but for the smooth rule's peak.
};

/** Estimates the discretisation error of an evaluation from a second one on another grid [Richardson 1911], quantity by quantity:
   fine:    E = a sqrt((Q_h - Q_h/2)^2 + b^2 sum_c (q_c - sum of its four children)^2)
   coarse:  E = sqrt(a^2 (Q_h - Q_2h)^2 + (b Q_h n^-r)^2),  n cells in contact
 The sum over cells c keeps the estimate from vanishing where the two grids agree by chance. Peak pressure has no sum: the centre
 rule adds what the pressure falls from the peak to the neighbors; the smooth rule, whose peak is asked of the surfaces, asks them at nine
 places a quarter of a cell apart around it, and what the pressure rises there is the error. The mean pressure inherits the errors of force and area when
 they do not cancel. a, b, r are measured on a training set of scenes (tests/contact/ErrorCases.h) and checked on another one.

 Covered: the error made by the grid, that is by the rule's polynomials or whole cells and by the elements' places. NOT covered:
 the geometry (fit of the surfaces, thickness map), the material, the elastic-foundation model itself, and contact that lies
 between the nodes of both grids. Where the evaluation reports a status that is not ok, the estimate has no meaning.

 The companion grid is built by the first estimate (allocates); nothing is paid before. After that, evaluate() allocates nothing.
 Not thread-safe: one estimator per thread, beside the workspace. The pair must outlive it. */
class ErrorEstimator {
 public:
  /** @throws std::invalid_argument for Companion::coarse and a pair with refined cells */
  explicit ErrorEstimator(const ContactPair& pair, Companion companion = Companion::fine);
  ~ErrorEstimator();
  ErrorEstimator(ErrorEstimator&&) noexcept;
  ErrorEstimator& operator=(ErrorEstimator&&) noexcept;

  /** Errors of the last evaluation that `workspace`, one of the pair's, holds; without one, all are zero. `estimate` is filled in
   place. */
  void evaluate(const ContactWorkspace& workspace, ContactErrorEstimate& estimate);

  /** The companion's own result at that pose: with Companion::fine, the better one. */
  const ContactResult& companionResult() const;

 private:
  friend class AdaptiveContact;
  friend struct ErrorEstimatorProbe;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace genu::contact
