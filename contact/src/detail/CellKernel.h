#pragma once

// The smooth rule's arithmetic, compiled once per instruction set (see FootKernel.h for the rules that follow from it).

#include "LawTable.h"
#include "TrackedFoot.h"
#include "TrackedHit.h"

namespace genu::contact::detail {

/** Gauss points on [0, 1], crowded at 0: x = sinh(t u) / sinh(t). A law whose strain runs from 0 to e_max and that has
 singularities at +-i a is then sampled evenly in asinh(e/a): t = asinh(e_max/a). */
struct GradedRule {
  static constexpr int kPoints = 6, kLevels = 16;  // t = (level + 1) / 2
  static constexpr int kPadded = 8;                // the last have no weight
  double largestRatio;                             // sinh(t)
  double x[kPadded], w[kPadded];
};
/** kLevels rules, made once. */
const GradedRule* gradedRules();

/** How a law bends: distances of its nearest singularities in strain, from 0 (a power law turns there, at +-i atZero) and from
 1 (large strain). Gauss points follow from the ratio of that distance to the half width of the strain in a cell: n points err by
 about (2 ratio)^(-2n). */
struct LawShape {
  double atZero, atOne;  // huge where there is none
  const GradedRule* graded;
};

struct LawView {
  enum Kind : int { linear, table, other };
  Kind kind;
  double K_Pa;      // linear
  LawTable pieces;  // table
  LawShape shape;
  /** p, dp/dstrain, int p dstrain and dp/dshare: laws without a table, and strains beyond it. `share`: of the fixed layer in both
   layers' thickness, read with layers in series. */
  void (*respond)(const void* self, double strain, double share, double answer[4]);
  const void* self;
};

/** What the smooth rule knows of a node at the current pose, in two lines. */
struct alignas(64) NodeField {
  double m[3];      // force direction on M, in F
  double length;    // |n + u| where the correction is on, 0 where it is off
  double u[3];      // direction of the distance, turned into M, in F
  double cosTheta;  // n . u
  double c;         // d = c s
  double h_m, hM_m;
  double factor;    // max(0, 1 + damping * rate of approach)
};

/** Numbers per node of `place`: centre A in F (3), area, outward normal n in F (3), thickness of the fixed layer. */
constexpr int kPlaceStride = 8;
/** Numbers per node of `load`: force (3) and moment about Fo (3) per unit weight, scalar force, unused. */
constexpr int kLoadStride = 8;
/** Numbers per node of `weight`: of pressure, area, energy, unused: int p g = sum_k weight_k g_k. */
constexpr int kWeightStride = 4;
/** Numbers per node of `adjoint`: d(load)/ds (6, 2 unused), then d(load)/dr (6, 2 unused). */
constexpr int kAdjointStride = 16;

/** Points (xi, eta) and weights at which a law is read in a cell, whole vectors of them (some without weight). */
struct LawPoints {
  static constexpr int kMost = 16 * 96;  // at most 96 lines with two rules of 8 points each
  int count;
  double w[kMost], xi[kMost], eta[kMost];
};

/** s, r, P, dP/dstrain and the energy density at the points of a cell. */
struct LawReading {
  double s[LawPoints::kMost], r[LawPoints::kMost], p[LawPoints::kMost], dp[LawPoints::kMost], energy[LawPoints::kMost];
};

/** One compartment at one pose. Strain at a node: s r, s the penetration before the midsurface correction (-AB, or -AC along the
 node's normal by ray), > 0 in contact. */
struct CellGrid {
  const int* stencil;       // 9 per element, -1: none
  const double* place;
  const TrackedFoot* feet;
  const TrackedHit* hits;   // ray firing; nullptr: minimum distance
  NodeField* field;
  const char* usable;       // per node
  double *s, *r, *load;     // per node
  double *share, *byShare;  // layers in series only: hF/h of each node, d(load)/d(share) (8 numbers, 6 used)
  double *weight, *adjoint; // per node, valid where `touched` has its bit
  unsigned long* touched;   // one bit per node
  double R[9];              // R_FM, row by row
  bool corrected;
  bool linear;              // small strain and linear material: K r is part of load, so that P = s
  double K_Pa;              // read when linear
  double damping_sPerM;     // 0: none
  double v[3], w[3];        // motion of M at Fo in F, read with damping only
};

struct CellTask {
  int element;
  int mask;     // usable neighbors
  double S[6];  // s, see CellRule.h
};

/** Result of a cell: for each of the five nodes of its cross {weight, area weight, energy weight, unused}; then, with
 stiffness, the load's derivatives with respect to the 6 coefficients of s, the 5 of r and the 5 of the share (layers in series),
 8 numbers each of which 6 are used.
 The first "unused" is the share of the cell in contact. */
constexpr int kCellWeights = 20, kBySOffset = 20, kByROffset = 68, kByShareOffset = 108, kCellStride = 148;

struct NetSums {
  double force[3], moment[3], scalar, area, weighted[3], energy;
};
/** Where the largest strain may be: at a node, or between the nodes, in `cell` at (xi, eta). */
struct PeakPlace {
  double nodeStrain;  // the largest of the cells' own nodes
  int node;           // -1: no cell
  int cell, mask;     // -1: nowhere more than at `node`
  double xi, eta;
  double largest;     // that any cell's polynomial says, right or not
};
/** d(load)/d(motion v, w of M at Fo), row by row (8 numbers each, 6 used); the same for its rate with damping. */
struct StiffnessSums {
  double byMotion[48], byRate[48];
};

/** Slopes of the moving layer's thickness with respect to the query point, in F; nullptr where it is constant. */
using ThicknessSlope = bool (*)(const void* self, int node, double slope[3]);

struct CellKernels {
  /** Numbers of the elements whose mark is not above `way`, ascending; returns how many. `list` has room for all. */
  int (*listDue)(const double* mark, int count, double way, int* list);
  /** Sets s, r, field and load of the nodes from their feet; field[k].hM_m and usable[k] are the caller's. */
  void (*setNodes)(const CellGrid&, const int* nodes, int count);
  /** Coefficients of s for the candidates; appends those that may be in contact to `tasks` and returns their number. bound[i] is
   the largest value of s in candidate i; mask[i] its usable neighbors, -1 where its own node is not. */
  int (*testCells)(const CellGrid&, const int* candidates, int count, double* bound, int* mask, CellTask* tasks);
  void (*integrate)(const CellGrid&, const LawView&, const CellTask*, int count, bool withEnergy, bool withStiffness, double* out);
  /** Cells' results to their nodes, in their order. */
  void (*scatter)(const CellGrid&, const CellTask*, int count, bool withStiffness, const double* out);
  /** Sums over touched nodes, ascending. */
  void (*sum)(const CellGrid&, int numWords, bool withEnergy, NetSums&);
  void (*sumStiffness)(const CellGrid&, int numWords, ThicknessSlope, const void* self, StiffnessSums&);
  void (*findPeak)(const CellGrid&, const CellTask*, int count, PeakPlace&);
  // One cell, with the coefficients S of s and R of r (CellRule.h):
  /** int_{s>0} xi^a eta^b, 15 moments. */
  void (*calcRimArea)(const double* S, double* moments);
  /** `full`: s >= 0 in the whole cell. */
  void (*listLawPoints)(const double* S, const double* R, bool full, const LawShape&, LawPoints&);
};

}  // namespace genu::contact::detail
