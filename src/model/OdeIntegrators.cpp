#include "OdeIntegrators.h"

#include <algorithm>

#include "genu/io/Suggest.h"
#include "genu/model/Analysis.h"

namespace genu::model {

namespace {

std::vector<OdeIntegratorKind>& kinds() {
  static std::vector<OdeIntegratorKind> all = {
      {"cpodes", "BDF of order 1 to max_order (2) with Newton iteration, Simbody's CPODES", 1, 5, OdeIntegratorKind::Step::adaptive, makeCPodesDriver},
      {"generalized-alpha", "fixed-step structural method of second order, with the contact stiffness", 0, 0, OdeIntegratorKind::Step::fixed,
       makeGeneralizedAlpha}};
  return all;
}

}  // namespace

void registerOdeIntegrator(OdeIntegratorKind kind) {
  for (OdeIntegratorKind& known : kinds()) {
    if (known.name == kind.name) {
      known = std::move(kind);
      return;
    }
  }
  kinds().push_back(std::move(kind));
}

std::vector<OdeIntegratorKind> listOdeIntegrators() { return kinds(); }

std::vector<std::string> integratorNames() {
  std::vector<std::string> names;
  for (const OdeIntegratorKind& kind : kinds()) names.push_back(kind.name);
  return names;
}

std::unique_ptr<OdeIntegrator> makeOdeIntegrator(const std::string& name, OdeProblem& problem, const OdeSettings& settings,
                                                 const std::string& where) {
  for (const OdeIntegratorKind& kind : kinds()) {
    if (kind.name != name) continue;
    if (settings.maxOrder != 0 && (settings.maxOrder < kind.lowestOrder || settings.maxOrder > kind.highestOrder)) {
      const std::string allowed = kind.highestOrder == 0 ? "none: it has one order only" : std::to_string(kind.lowestOrder) + " to " + std::to_string(kind.highestOrder);
      throw InputError(where + ": " + name + " with max_order " + std::to_string(settings.maxOrder) + "; allowed: " + allowed);
    }
    if (settings.step_s != 0 && kind.step == OdeIntegratorKind::Step::adaptive) {
      throw InputError(where + ": " + name + " chooses its steps by `accuracy`; `step` is for integrators with a fixed step");
    }
    return kind.make(problem, settings);
  }
  throw InputError(where + ": " + io::describeUnknown("integrator", name, integratorNames()));
}

}  // namespace genu::model
