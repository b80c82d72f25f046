#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "TrackedFoot.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact::detail {

/** What an element's last test tells about a pose nearby, without a query. */
struct alignas(64) ElementLook {
  double bound_m;                // largest value of s in the cell then
  double p_MA[3], normal_M[3];   // its centre, and the normal at the centre's foot
  double spread;                 // how far the normals, a polynomial through those of its nodes, differ from that within the cell
  double normal_F[3];            // the same normal, turned by the pose then
  double turn;                   // CompartmentMemory::turn then
  double radius_m;               // least radius of curvature, less the centre's absolute distance
  double reach_m;                // the prediction holds while no node moves as far as this
};

/** How far a moving surface lets the signed distance of points change. */
class DistancePredictor {
 public:
  explicit DistancePredictor(const ContactSurface& surface);
  /** Treats what lies outside [u0, u1] x [v0, v1] of a patch as beyond an open border. */
  void restrict(int patch, const std::array<double, 4>& uv);
  /** How far the query point of a foot may move before the foot can reach an open border, half of what its first derivatives
   tell; 0 where there is no foot. */
  double calcBorderMargin_m(const TrackedFoot& foot) const {
    if (foot.patch < 0) return 0;
    const Borders& b = borders_[static_cast<size_t>(foot.patch)];
    if (!b.open) return 1e300;
    const double* j = foot.duvdQ;
    const double perU = 2 * std::sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]);
    const double perV = 2 * std::sqrt(j[3] * j[3] + j[4] * j[4] + j[5] * j[5]);
    return std::min(std::min(foot.u - b.u0, b.u1 - foot.u) / perU, std::min(foot.v - b.v0, b.v1 - foot.v) / perV);
  }
  /** Least radius of curvature of the surface: three quarters of its smallest medial ball's, which is known from samples. */
  double leastRadius_m() const { return 1.5 * safe_m_; }
  /** Feet are unique within this distance. */
  double safe_m() const { return safe_m_; }

 private:
  struct Borders {
    double u0, u1, v0, v1;  // infinite where the surface goes on
    bool open;
  };
  std::vector<Borders> borders_;
  double safe_m_;
};

}  // namespace genu::contact::detail
