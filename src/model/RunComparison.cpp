#include "RunComparison.h"

#include <algorithm>
#include <cmath>

#include "genu/model/Analysis.h"

namespace genu::model {

namespace {

double calcPoseDifference_m(const std::vector<scene::CoordinateInfo>& coordinates, const scene::Coordinates& a, const scene::Coordinates& b) {
  double largest = 0;
  for (size_t k = 0; k < coordinates.size(); ++k) {
    if (coordinates[k].shortName == "rx" && k + 6 <= coordinates.size()) {
      const contact::Mat3 R = contact::calcPose(scene::takeSix(a, k)).R.transpose() * contact::calcPose(scene::takeSix(b, k)).R;
      // From sine and cosine, so that small and large angles keep their digits.
      const contact::Vec3 axis(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
      largest = std::max(largest, kAngleLength_m * std::atan2(0.5 * axis.norm(), 0.5 * (R.trace() - 1)));
      k += 2;
      continue;
    }
    if (coordinates[k].isFree) largest = std::max(largest, (coordinates[k].isAngle ? kAngleLength_m : 1.0) * std::abs(a[k] - b[k]));
  }
  return largest;
}

void keepLargest(RunDifference::Largest& largest, double value, double time_s) {
  if (value > largest.value) largest = {value, time_s};
}

}  // namespace

RunDifference compareRuns(const scene::Scene& scene, const std::vector<scene::Frame>& reference, const std::vector<scene::Frame>& frames) {
  constexpr double kNoForce_N = 1e-3;
  const auto coordinates = scene.coordinates();
  RunDifference result;
  result.coordinates.resize(coordinates.size());
  for (const scene::ContactSpec& contact : scene.contacts) result.compartments.resize(result.compartments.size() + contact.definition.compartments.size());
  double difference = 0, sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < std::min(reference.size(), frames.size()); ++i) {
    const scene::Frame &a = reference[i], &b = frames[i];
    for (size_t k = 0; k < coordinates.size(); ++k) keepLargest(result.coordinates[k], std::abs(a.q[k] - b.q[k]), a.time_s);
    result.pose_m = std::max(result.pose_m, calcPoseDifference_m(coordinates, a.q, b.q));
    size_t row = 0;
    for (size_t pair = 0; pair < a.contacts.size(); ++pair) {
      for (size_t part = 0; part < a.contacts[pair].compartments.size(); ++part, ++row) {
        const contact::NetLoad &x = a.contacts[pair].compartments[part], &y = b.contacts[pair].compartments[part];
        const double force = std::abs(x.scalarForce_N - y.scalarForce_N);
        keepLargest(result.compartments[row].force_N, force, a.time_s);
        keepLargest(result.compartments[row].peakPressure_Pa, std::abs(x.peakPressure_Pa - y.peakPressure_Pa), a.time_s);
        difference += force;
        sum += std::abs(x.scalarForce_N);
        ++count;
      }
    }
  }
  if (count > 0) result.force = difference / std::max(sum, kNoForce_N * static_cast<double>(count));
  return result;
}

}  // namespace genu::model
