#pragma once

#include "genu/contact/QueryStatus.h"

namespace genu::contact {
class ContactSurface;
}

namespace genu::contact::detail {

/** Closest point of one moving query point, kept between evaluations (frame M). Three lines of eight numbers, which the
 kernels read and write whole. */
struct alignas(64) TrackedFoot {
  double u, v;                 ///< foot parameters
  double duvdQ[6];             ///< rows du/dQ, dv/dQ: first-order predictor, and for the stiffness
  double Q[3];                 ///< query point it belongs to [m]
  double distance_m;           ///< signed, > 0 outside
  double normal[3];            ///< unit outward normal at the foot
  int patch;                   ///< -1: never queried
  QueryStatus status;
  double nu[3], nv[3];         ///< dn/du, dn/dv: dn/dQ = nu (x) du/dQ + nv (x) dv/dQ is the Hessian of the signed distance

  /** One coordinate of the foot, to within the tolerance of the query; converged ones only. */
  double calcFoot_m(int axis) const { return Q[axis] - distance_m * normal[axis]; }
};

/** What a query is to set beside the foot: nothing, duvdQ, or nu and nv too. */
enum class FootDerivatives : int { none, first, second };

/** Updates feet[ids[i]] for the query points Q[3 i .. 3 i + 2]. Warm start from the foot's own last place moved by the
 first-order predictor; a foot that was never queried starts from that of the id before it. The result is the global
 minimum under the rule of ContactSurface::findClosestPoint and depends on the start within its tolerance only.
 `derivatives`: at least the first, which predict the next start. Allocates nothing. */
void trackFeet(const ContactSurface& surface, const double* Q, const int* ids, int count, TrackedFoot* feet,
               FootDerivatives derivatives = FootDerivatives::second);

}  // namespace genu::contact::detail
