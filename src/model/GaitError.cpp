#include "GaitError.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "RunComparison.h"
#include "genu/model/EnergyBalance.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

namespace {

constexpr double kTighter = 0.1;          // tolerances of the second run over those of the first
constexpr double kSecondAccuracy = 1e-6;  // beside a fixed step

std::string describe(const char* errs, double pose_m, double force, const scene::GaitSpec& gait, double fixedStep_s) {
  const double beyond = std::max(pose_m / kToleratedPoseError_m, force / kToleratedForceError);
  if (!(beyond > 1)) return {};
  std::ostringstream text;
  text.precision(2);
  text << "the integration " << errs << " by";
  if (pose_m > kToleratedPoseError_m) text << " " << 1e3 * pose_m << " mm in the pose (limit " << 1e3 * kToleratedPoseError_m << " mm)";
  if (pose_m > kToleratedPoseError_m && force > kToleratedForceError) text << " and";
  if (force > kToleratedForceError) text << " " << 100 * force << " % of the mean contact force (limit " << 100 * kToleratedForceError << " %)";
  if (fixedStep_s > 0) {
    text << "; try step: " << 1e3 * fixedStep_s / std::ceil(beyond) << " ms";
  } else {
    // Errors fall with the root of the tolerance at least.
    text << "; try accuracy: " << std::max(1e-12, gait.accuracy / (beyond * beyond));
  }
  return text.str();
}

}  // namespace

SecondRun planSecondRun(const scene::GaitSpec& gait, double fixedStep_s) {
  SecondRun plan;
  plan.gait = gait;
  std::ostringstream text;
  text.precision(4);
  plan.factor = 1 / (1 - std::sqrt(kTighter));
  if (fixedStep_s > 0) {
    plan.gait.integrator = chooseIntegrator("");
    plan.gait.accuracy = kSecondAccuracy;
    plan.gait.tolerances = {};
    plan.gait.step_s = 0;
    plan.gait.maxOrder = 0;
    plan.cost = 4;
    text << plan.gait.integrator << ", accuracy: " << plan.gait.accuracy;
  } else {
    plan.gait.accuracy *= kTighter;
    auto& t = plan.gait.tolerances;
    for (auto* value : {&t.translation_m, &t.angle_rad, &t.speed_mPerS, &t.angularSpeed_radPerS}) {
      if (*value) **value *= kTighter;
    }
    plan.cost = std::pow(kTighter, -1.0 / 3);  // steps of second order, which the standard integrator takes
    text << "accuracy: " << plan.gait.accuracy;
    if (t.translation_m || t.angle_rad || t.speed_mPerS || t.angularSpeed_radPerS) text << " and a tenth of each tolerance";
  }
  plan.description = text.str();
  return plan;
}

GaitErrorEstimate estimateError(const scene::Scene& scene, const SecondRun& plan, const GaitResult& first, const GaitResult& second) {
  GaitErrorEstimate estimate;
  estimate.second = plan.description;
  estimate.factor = plan.factor;
  estimate.cpuTime_s = second.cpuTime_s;
  estimate.complete = true;
  estimate.statusText = "complete";
  const RunDifference difference = compareRuns(scene, second.frames, first.frames);
  const auto scaled = [&plan](const RunDifference::Largest& largest) { return GaitErrorEstimate::Value{plan.factor * largest.value, largest.time_s}; };
  for (const auto& largest : difference.coordinates) estimate.coordinates.push_back(scaled(largest));
  for (const auto& load : difference.compartments) estimate.loads.push_back({scaled(load.force_N), scaled(load.peakPressure_Pa)});
  estimate.pose_m = plan.factor * difference.pose_m;
  estimate.force = plan.factor * difference.force;
  return estimate;
}

std::string describeError(const GaitErrorEstimate& estimate, const scene::GaitSpec& gait, double fixedStep_s) {
  if (!estimate.complete) return "no estimate of the integration's error: " + estimate.statusText;
  return describe("is estimated to err", estimate.pose_m, estimate.force, gait, fixedStep_s);
}

std::string describeError(const GaitErrorPrediction& prediction, const scene::GaitSpec& gait) {
  const std::string text = describe("errs, as the errors of its steps add up,", prediction.pose_m, prediction.force, gait, 0);
  return text.empty() ? text : text + ", or error_estimate: true to know better";
}

std::string describeImbalance(const scene::Scene& scene, const GaitResult& result) {
  const EnergyBalance balance = calcEnergyBalance(scene, result);
  if (!balance.known || !(balance.imbalance() - balance.quadrature() > kToleratedImbalance)) return {};
  std::ostringstream text;
  text.precision(2);
  text << "energy is not kept: the run loses or wins " << 100 * (balance.imbalance() - balance.quadrature()) << " % (limit " << 100 * kToleratedImbalance
       << " %) of " << balance.scale_J << " J, its largest kinetic and elastic energy and the range of its potential; try a tighter accuracy or a shorter step, or `correction: energy`";
  return text.str();
}

}  // namespace genu::model
