#pragma once

// The fast local solver for ray hits, compiled once per instruction set like FootKernel.h. Plain data only.

#include "FootKernel.h"

namespace genu::contact::detail {

/** What the kernel finds of a hit; see TrackedHit. */
struct RayHit {
  double u, v, t_m, residual_m;
  double duvdA[6], p_MC[3], normal[3], nu[3], nv[3];
  double cosTheta;  ///< -normal . n > 0
  int iterations;
};

/** Newton on the part of S(u, v) - A across the unit direction n, from (hit.u, hit.v). Gives up rather than guess: leaving
 crossings, rays within 6 degrees of the tangent plane, steps that do not shrink, poles. Once the next residual is provably
 below half the tolerance, the last step is a Taylor expansion in place of an evaluation. On leftPatch, (hit.u, hit.v) is
 where Newton wanted to go. The derivatives only if wanted. */
using SolveRay = FootOutcome (*)(const PatchTables& patch, const double* A, const double* n, bool derivatives, RayHit& hit);

namespace baseline {
FootOutcome solveRay(const PatchTables&, const double*, const double*, bool, RayHit&);
}
namespace avx2 {
FootOutcome solveRay(const PatchTables&, const double*, const double*, bool, RayHit&);
}
namespace avx512 {
FootOutcome solveRay(const PatchTables&, const double*, const double*, bool, RayHit&);
}

/** The one for the instruction set in use. */
SolveRay activeSolveRay();

}  // namespace genu::contact::detail
