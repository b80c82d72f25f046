#pragma once

#include "genu/model/EquilibriumSolver.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::integrators {

enum class SundialsKind { cvodeBdf, cvodeAdams, ida, arkodeDirk, implicitEuler };

/** The only symbols of the shared library genu_sundials, which holds SUNDIALS inside. Simbody's library exports an old version of the same
 functions (its CPODES), N_VNew_Serial and others of the same names: linked into one program, each would call the other's. */
extern "C" model::OdeIntegrator* genuMakeSundials(SundialsKind kind, model::OdeProblem& problem, const model::OdeSettings& settings);
extern "C" void genuSolveWithKinsol(model::EquilibriumProblem& problem, double* z, model::EquilibriumOutcome& outcome);

}  // namespace genu::integrators
