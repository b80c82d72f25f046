#pragma once

#include "CellKernel.h"
#include "ContactPairImpl.h"

namespace genu::contact::detail {

/** Numbers per node of CompartmentMemory::gradient: d(s), d(r), d(area h) by the motion (v, w) of M at Fo, 6 each; then
 dE/ds, dE/dr, dE/d(area h). */
constexpr int kGradientStride = 21;

struct EnergyGradient {
  Eigen::Matrix<double, 6, 1> load = Eigen::Matrix<double, 6, 1>::Zero();  // force and moment about Fo on M, in F
  Matrix6 byMotion = Matrix6::Zero();                                     // their derivative, when asked for
};

/** Minus the gradient of the smooth rule's discrete energy

   E = sum over quadrature points of w G(xi, eta) U(s r),   G: area h, s, r: polynomials through the nodes (CellRule.h)

 with s, r = c/h and h functions of the pose at every node (c = 1/cos(theta/2) turns with the normals), and the derivative of that
 gradient. It needs the third derivatives of the distance, taken as central differences of its Hessian at the nodes: 2 queries a
 node more with a rigid or constant moving layer, 6 otherwise, for the derivative only. */
void calcEnergyGradient(const PairData& impl, const Compartment& c, CompartmentMemory& memory, const CellGrid& grid, const LawView& law,
                        const Pose& X_FM, bool withStiffness, EnergyGradient& out);

}  // namespace genu::contact::detail
