#pragma once

#include <algorithm>
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
  double reach_m;             // the prediction holds for points nearer than this to the centre
};

/** How far a moving surface lets the signed distance of points change. */
class DistancePredictor {
 public:
  explicit DistancePredictor(const ContactSurface& surface);
  /** Treats what lies outside [u0, u1] x [v0, v1] of a patch as beyond an open border. */
  void restrict(int patch, const std::array<double, 4>& uv);
  /** How far around a foot's query point predictions hold: less than the way out of the zone where feet are unique, or half that to
   an open border; <= 0 where there is no foot. */
  double calcReach_m(const TrackedFoot& foot) const {
    if (foot.patch < 0) return 0;
    double reach_m = safe_m_ - std::abs(foot.distance_m);
    const Borders& b = borders_[static_cast<size_t>(foot.patch)];
    if (b.open) {
      const double* j = foot.duvdQ;
      const double perU = 2 * std::sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]);
      const double perV = 2 * std::sqrt(j[3] * j[3] + j[4] * j[4] + j[5] * j[5]);
      reach_m = std::min({reach_m, std::min(foot.u - b.u0, b.u1 - foot.u) / perU, std::min(foot.v - b.v0, b.v1 - foot.v) / perV});
    }
    return reach_m;
  }
  /** Bound of the change of s at points around one whose foot is known, beyond -normal . shift, when that one shifts by shift_m,
   the others by at most lever_m more or less, and their normals differ from its own by at most `spread`. */
  double calcError(double spread, double shift_m, double lever_m) const {
    const double way_m = shift_m + lever_m;
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
