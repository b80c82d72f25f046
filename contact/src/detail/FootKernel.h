#pragma once

// The fast local solver for closest points, compiled once per instruction set. Plain data only: a translation unit built
// for AVX2 must not emit an inline function that the linker could choose for the whole program.

#include "TrackedFoot.h"

namespace genu::contact::detail {

/** Raw view of one NurbsPatch, with what the fast solver needs to know about it. */
struct PatchTables {
  struct Direction {
    const double* breaks;            // numSpans + 1 distinct knots
    const double* spans;             // center, 1 / half width, half width of each span
    const unsigned short* buckets;   // span at the lower end of each of numBuckets equal pieces of the domain
    double lo, hi;                   // the domain
    double bucketScale;              // numBuckets / (hi - lo)
    int numSpans, numBuckets, degree;
    bool closed;
  };
  Direction u, v;
  const double* coefficients;  // [numSpansU][numSpansV][degreeU + 1][degreeV + 1][4]
  double normalSign;
  double tolerance_m;          // on the tangential residual
  // Largest second and third derivatives in units of the tangents, e.g. |S_uv| / (|S_u| |S_v|) [1/m], [1/m^2]. They bound the
  // residual that one more Newton step would leave. Infinite where a pole makes tangents vanish.
  double bend_perM, twist_perM2;
  int firstSpan;               // number of the patch's first span among those of the surface
  bool rational;
};

enum class FootOutcome : int {
  found,
  leftPatch,  // u, v hold the place outside the domain where Newton wanted to go
  failed,     // slow or unsafe here: take the safeguarded solver
};

struct FootSearch {
  double u, v;  // in: start; out: see FootOutcome
  double residual_m;
  int iterations;
  double p_MB[3];  // found: the foot
};

/** Plain Newton on |S - Q|^2 / 2 from (u, v). Gives up rather than guess: no positive definite Hessian, steps that do not
 shrink, poles, the border. Once the next residual is provably below half the tolerance, the last step is a Taylor expansion
 in place of an evaluation. On `found`, foot has all but Q, patch and status; the derivatives only if wanted. */
using SolveFoot = FootOutcome (*)(const PatchTables& patch, const double* Q, FootSearch& search, FootDerivatives derivatives,
                                  TrackedFoot& foot);

/** The same for many tracked feet, those of one knot span side by side in the lanes of vectors: from each one's memory, moved by
 its first-order predictor. Sets feet[ids[i]] for the query points Q[3 i .. 3 i + 2] where it succeeds and the distance lies in
 (-safeInside, safeOutside); lists the others (their i, ascending) in `left` and returns their number. count <= kFeetAtOnce. */
using SolveFeet = int (*)(const PatchTables* patches, double safeInside_m, double safeOutside_m, const double* Q, const int* ids,
                          int count, FootDerivatives derivatives, TrackedFoot* feet, int* left);
constexpr int kFeetAtOnce = 64;

}  // namespace genu::contact::detail
