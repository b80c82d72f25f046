#pragma once

#include "genu/contact/Types.h"

namespace genu::musculoskeletal {

using contact::Vec3;

/** The taut string from P to Q over an ellipsoid that the straight line enters; see WrapSurface.h. */
struct EllipsoidGeodesic {
  bool converged = false;
  double freeP_m = 0, arc_m = 0, freeQ_m = 0;
  Vec3 tangentP_m, tangentQ_m, directionP, directionQ;
  double theta = 0, duration = 0;  ///< place on the curve of tangency of P, and flow time of the arc
  int integrations = 0;
};

/** @pre the ends are outside or on the surface and the segment between them enters it */
EllipsoidGeodesic findGeodesic(const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m);

/** The same from many more starts, a hundred times slower: what findGeodesic does where its guesses lead nowhere, and its check. */
EllipsoidGeodesic searchGeodesic(const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m);

/** Point of a found geodesic, `part` 0 to 1 of its duration. */
Vec3 calcPointOnGeodesic_m(const EllipsoidGeodesic& geodesic, const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m, double part);

}  // namespace genu::musculoskeletal
