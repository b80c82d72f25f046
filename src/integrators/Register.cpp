#include "Sundials.h"
#include "genu/integrators/Sundials.h"

namespace genu::integrators {

void registerSundials() {
  struct Entry {
    SundialsKind kind;
    const char *name, *library, *description;
    int lowestOrder, highestOrder;
    model::OdeIntegratorKind::Step step;
    model::OdeIntegratorKind::Unknowns unknowns;
  };
  using Step = model::OdeIntegratorKind::Step;
  using Unknowns = model::OdeIntegratorKind::Unknowns;
  using Equations = model::OdeIntegratorKind::Equations;
  static constexpr Entry kEntries[] = {
      {SundialsKind::cvodeBdf, "cvode-bdf", "SUNDIALS CVODE", "BDF of order 1 to max_order (2)", 1, 5, Step::adaptive, Unknowns::both},
      {SundialsKind::cvodeAdams, "cvode-adams", "SUNDIALS CVODE", "Adams-Moulton with fixed-point iteration, for motion without stiffness", 1, 12, Step::adaptive,
       Unknowns::eliminated},
      {SundialsKind::ida, "ida", "SUNDIALS IDA", "BDF of order 1 to max_order (2) on the constrained system with multipliers", 1, 5, Step::adaptive,
       Unknowns::constraints},
      {SundialsKind::arkodeDirk, "arkode-dirk", "SUNDIALS ARKODE", "implicit Runge-Kutta of order max_order (2 to 5, default 3)", 2, 5, Step::either,
       Unknowns::eliminated},
      {SundialsKind::implicitEuler, "implicit-euler", "SUNDIALS ARKODE", "backward Euler with a fixed step", 0, 0, Step::fixed, Unknowns::eliminated}};
  for (const Entry& entry : kEntries) {
    const SundialsKind kind = entry.kind;
    model::registerOdeIntegrator({entry.name, entry.library, entry.description, entry.lowestOrder, entry.highestOrder, entry.step, entry.unknowns,
                                  [kind](model::OdeProblem& problem, const model::OdeSettings& settings) {
                                    return std::unique_ptr<model::OdeIntegrator>(genuMakeSundials(kind, problem, settings));
                                  },
                                  kind == SundialsKind::cvodeAdams ? Equations::none : Equations::exact});
  }
  model::registerEquilibriumSolver("kinsol", [](model::EquilibriumProblem& problem, double* z) {
    model::EquilibriumOutcome outcome;
    genuSolveWithKinsol(problem, z, outcome);
    return outcome;
  });
}

}  // namespace genu::integrators
