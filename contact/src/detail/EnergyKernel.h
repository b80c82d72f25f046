#pragma once

// The arithmetic of the smooth rule's energy form (EnergyRule.h), compiled once per instruction set (see FootKernel.h for the rules
// that follow from it).

#include "CellKernel.h"
#include "FootKernel.h"

namespace genu::contact::detail {

/** Numbers per node of `gradient`, three lines: d(s), d(r), d(area h) by the motion (v, w) of M at Fo, 6 each; the seventh of each
 line is dE/ds, dE/dr, dE/d(area h). */
constexpr int kGradientStride = 24;
/** Numbers per node of `layer`: slope of the moving layer's thickness with respect to the query point in M (3), then its derivatives
 by the foot's parameters: h_u, h_v, h_uu, h_uv, h_vv. */
constexpr int kLayerStride = 8;

struct EnergyGrid {
  CellGrid cells;
  double* gradient;
  const double* layer;  // nullptr: the thickness is constant
};

/** Minus the energy's gradient: force and moment about Fo on M (8 numbers, 6 used), and its derivative by the motion, row by row. */
struct EnergySums {
  double load[8], byMotion[48];
};

struct EnergyKernels {
  /** First derivatives of nodes; their shares of the energy are set to zero. */
  void (*setFirst)(const EnergyGrid&, const int* nodes, int count);
  /** Adds the cells' energies to their nodes' shares; with stiffness, sets sums.byMotion to what the nodes' first derivatives give. Cell i
   counts where cells[i cellStride + 3] > 0. */
  void (*integrate)(const EnergyGrid&, const LawView&, const CellTask*, int count, const double* cells, int cellStride, bool withStiffness,
                    EnergySums& sums);
  /** Sets sums.load. */
  void (*sumFirst)(const EnergyGrid&, const int* nodes, int count, EnergySums& sums);
  /** Adds the nodes' second derivatives to sums.byMotion. */
  void (*sumSecond)(const EnergyGrid&, const PatchTables* patches, const int* nodes, int count, EnergySums& sums);
};

}  // namespace genu::contact::detail
