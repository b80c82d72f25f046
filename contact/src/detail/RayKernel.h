#pragma once

// The fast local solver for ray hits, compiled once per instruction set like FootKernel.h. Plain data only.

#include "FootKernel.h"

namespace genu::contact::detail {

/** A hit C of a ray A + t n. */
struct RayHit {
  double u, v;          ///< parameters of C
  double duvdA[6];      ///< rows du/dA, dv/dA at fixed direction [1/m]
  double t_m;           ///< AC along n, signed as in ContactSurface::findFirstHit
  double p_MC[3];       ///< C
  double normal[3];     ///< unit outward normal at C; normal . n < 0
  double nu[3], nv[3];  ///< dnormal/du, dnormal/dv
  double cosTheta;      ///< -normal . n
  double residual_m;    ///< distance of S(u, v) from the ray
  int iterations;
};

/** Newton on the part of S(u, v) - A across the unit direction n, from (hit.u, hit.v). Gives up rather than guess: leaving
 crossings, rays within 6 degrees of the tangent plane, steps that do not shrink, poles. Once the next residual is provably
 below half the tolerance, the last step is a Taylor expansion in place of an evaluation. On leftPatch, (hit.u, hit.v) is
 where Newton wanted to go. The derivatives only if wanted. */
using SolveRay = FootOutcome (*)(const PatchTables& patch, const double* A, const double* n, bool derivatives, RayHit& hit);

}  // namespace genu::contact::detail
