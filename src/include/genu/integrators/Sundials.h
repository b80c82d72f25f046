#pragma once

namespace genu::integrators {

/** Adds SUNDIALS' integrators to model::makeOdeIntegrator. Library Genu::integrators; programs without it do not link SUNDIALS.

   cvode-bdf    CVODE [Hindmarsh et al. 2005, ACM Trans Math Softw 31:363]: BDF, variable order 1 to max_order (2) and step, Newton
                iteration
   cvode-adams  the same with Adams-Moulton formulas (order to 12) and fixed-point iteration: motion without stiffness
   arkode-dirk  ARKODE: diagonally implicit Runge-Kutta of order max_order (2 to 5, default 3), stiffly accurate and L-stable
   implicit-euler  ARKODE's backward Euler, first order, with the step `step` (1 ms) or shorter where Newton fails

 All take the Jacobian of the problem where it has one. Absolute tolerances are the problem's; there are no relative ones. */
void registerSundials();

}  // namespace genu::integrators
