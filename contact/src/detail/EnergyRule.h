#pragma once

#include "ContactPairImpl.h"

namespace genu::contact::detail {

struct EnergyGradient {
  Eigen::Matrix<double, 6, 1> load;  // force and moment about Fo on M, in F
  Matrix6 byMotion;                  // their derivative, 0 unless asked for
};

/** Minus the gradient of the smooth rule's discrete energy

   E = sum over quadrature points of w G(xi, eta) U(s r),   G: area h, s, r: polynomials through the nodes (CellRule.h)

 with s, r = c/h and h functions of the pose at every node (c = 1/cos(theta/2) turns with the normals), and the derivative of that
 gradient, which reads the moving surface's third derivatives (docs/theory.md, "Energy"). */
void calcEnergyGradient(const PairData& impl, const Compartment& c, CompartmentMemory& memory, const CellGrid& grid, const LawView& law,
                        bool withStiffness, EnergyGradient& out);

}  // namespace genu::contact::detail
