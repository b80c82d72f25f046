#include "OdeIntegrators.h"

#include <algorithm>

#include "genu/io/Suggest.h"
#include "genu/model/Analysis.h"

namespace genu::model {

namespace {

std::vector<OdeIntegratorKind>& kinds() {
  static std::vector<OdeIntegratorKind> all = {
      {"cpodes", "BDF of order 1 and 2 with Newton iteration, Simbody's CPODES", makeCPodesDriver},
      {"generalized-alpha", "fixed-step structural method of second order, with the contact stiffness", makeGeneralizedAlpha}};
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
    if (kind.name == name) return kind.make(problem, settings);
  }
  throw InputError(where + ": " + io::describeUnknown("integrator", name, integratorNames()));
}

}  // namespace genu::model
