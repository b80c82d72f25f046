#pragma once

#include "RayKernel.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact::detail {

/** First hit C of one moving ray A + t n, kept between evaluations (frame M). Derivatives for a moving ray:
   d(u, v) = duvdA (dA + t dn),   dt = -normal . (dA + t dn) / (normal . n),   dnormal = nu du + nv dv,
 because S(u, v) = A + t n: a turn of the direction by dn acts at C like a shift of A by t dn. */
struct TrackedHit : RayHit {
  double A[3], n[3];  ///< ray it belongs to: origin [m], unit direction
  int patch;          ///< -1: no hit to start from
  HitStatus status;
};

/** Updates hits[ids[i]] for the rays with origin A[3 i ..] and unit direction n[3 i ..]. Warm start from the hit's own last
 place moved by the first-order predictor; one without a place starts from the hit of the id before it. The result is that
 of ContactSurface::findFirstHit and depends on the start within its tolerance only. Allocates nothing. */
void trackHits(const ContactSurface& surface, const double* A, const double* n, const int* ids, int count, TrackedHit* hits);

}  // namespace genu::contact::detail
