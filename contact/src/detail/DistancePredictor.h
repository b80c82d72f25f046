#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "TrackedFoot.h"

namespace genu::contact::detail {

/** What an element's last test tells about a pose nearby, without a query. */
struct ElementLook {
  double bound_m;             // largest value of s in the cell then
  double p_MA[3], normal[3];  // its centre, and the normal at the centre's foot
  double turn;                // CompartmentMemory::turn then
  double spread;              // how far the normals at its nodes' feet differ from that
};

/** How far a moving surface lets the signed distance of points change. */
class DistancePredictor {
 public:
  explicit DistancePredictor(const ContactSurface& surface);
  /** Treats what lies outside [u0, u1] x [v0, v1] of a patch as beyond an open border. */
  void restrict(int patch, const std::array<double, 4>& uv);
  /** Bound of the change of s at points within reach_m of one whose foot is known, beyond -normal . shift, when that one shifts by
   shift_m, the others by at most lever_m more or less, and their normals differ from its own by at most `spread`; infinite where
   that cannot be told: on the way out of the zone where feet are unique, or near an open border. */
  double calcError(const TrackedFoot& foot, double reach_m, double spread, double shift_m, double lever_m) const {
    constexpr double kInfinity = 1e300;
    const double way_m = shift_m + lever_m, span_m = reach_m + way_m;
    if (foot.patch < 0 || !(std::abs(foot.distance_m) + span_m < safe_m_)) return kInfinity;
    const Borders& b = borders_[static_cast<size_t>(foot.patch)];
    if (b.open) {
      const double* j = foot.duvdQ;
      const double du = 2 * span_m * std::sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]);
      const double dv = 2 * span_m * std::sqrt(j[3] * j[3] + j[4] * j[4] + j[5] * j[5]);
      if (!(foot.u - du > b.u0 && foot.u + du < b.u1 && foot.v - dv > b.v0 && foot.v + dv < b.v1)) return kInfinity;
    }
    return lever_m + spread * shift_m + 0.5 * largestCurvature_perM_ * way_m * way_m;
  }

 private:
  struct Borders {
    double u0, u1, v0, v1;  // infinite where the surface goes on
    bool open;
  };
  std::vector<Borders> borders_;
  double safe_m_, largestCurvature_perM_;
};

}  // namespace genu::contact::detail
