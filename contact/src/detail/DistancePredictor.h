#pragma once

#include <cmath>
#include <vector>

#include "TrackedFoot.h"

namespace genu::contact::detail {

/** Signed distance of a point near the one a foot belongs to, without a query: |distance - true one| <= error_m. False where
 that cannot be told: no foot, near an open border, or the way leads out of the zone where the foot is unique. */
class DistancePredictor {
 public:
  explicit DistancePredictor(const ContactSurface& surface);
  bool predict(const TrackedFoot& foot, const double Q[3], double& distance_m, double& error_m) const {
    const double x = Q[0] - foot.Q[0], y = Q[1] - foot.Q[1], z = Q[2] - foot.Q[2];
    const double square = x * x + y * y + z * z;
    if (foot.patch < 0 || foot.status != QueryStatus::converged) return false;
    const double reach = std::abs(foot.distance_m);
    if (!(reach < safe_m_) || !(square < (safe_m_ - reach) * (safe_m_ - reach))) return false;
    const Borders& b = borders_[static_cast<size_t>(foot.patch)];
    const double* j = foot.duvdQ;
    const double du = 2 * (j[0] * x + j[1] * y + j[2] * z), dv = 2 * (j[3] * x + j[4] * y + j[5] * z);
    if (!(foot.u + du > b.u0 && foot.u + du < b.u1 && foot.v + dv > b.v0 && foot.v + dv < b.v1)) return false;
    distance_m = foot.distance_m + foot.normal[0] * x + foot.normal[1] * y + foot.normal[2] * z;
    error_m = 0.5 * largestCurvature_perM_ * square;
    return true;
  }

 private:
  struct Borders {
    double u0, u1, v0, v1;  // infinite where the surface goes on
  };
  std::vector<Borders> borders_;
  double safe_m_, largestCurvature_perM_;
};

}  // namespace genu::contact::detail
