#pragma once

#include "genu/model/Analysis.h"

namespace genu::model {

/** The run that an error is estimated from. */
struct SecondRun {
  scene::GaitSpec gait;
  std::string description;  ///< GaitErrorEstimate::second
  double factor = 1;        ///< GaitErrorEstimate::factor
  double cost = 1;          ///< expected steps over those of the first run
};
/** `fixedStep_s`: of the first run; 0: it chose its steps by its tolerances. */
SecondRun planSecondRun(const scene::GaitSpec& gait, double fixedStep_s);

/** @pre both runs are complete */
GaitErrorEstimate estimateError(const scene::Scene& scene, const SecondRun& plan, const GaitResult& first, const GaitResult& second);

/** What of an error is beyond kToleratedPoseError_m or kToleratedForceError, and what to ask for; empty: nothing. */
std::string describeError(const GaitErrorEstimate& estimate, const scene::GaitSpec& gait, double fixedStep_s);
std::string describeError(const GaitErrorPrediction& prediction, const scene::GaitSpec& gait);

/** Energy that is lost or won beyond kToleratedImbalance; empty: not beyond, or not known. What the sums over the frames may miss is taken off. */
std::string describeImbalance(const scene::Scene& scene, const GaitResult& result);

}  // namespace genu::model
