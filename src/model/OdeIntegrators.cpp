#include "OdeIntegrators.h"

#include <algorithm>
#include <array>

#include "genu/io/Suggest.h"
#include "genu/io/Units.h"
#include "genu/model/Analysis.h"

namespace genu::model {

namespace {

using Step = OdeIntegratorKind::Step;
using Unknowns = OdeIntegratorKind::Unknowns;
using Equations = OdeIntegratorKind::Equations;

std::vector<OdeIntegratorKind>& kinds() {
  static std::vector<OdeIntegratorKind> all = {
      {"cpodes", "Simbody CPODES", "BDF of order 1 to max_order (2) with Newton iteration", 1, 5, Step::adaptive, Unknowns::both, makeCPodesDriver,
       Equations::differenced},
      {"generalized-alpha", "Genu", "fixed-step structural method of second order, with the contact stiffness", 0, 0, Step::fixed, Unknowns::eliminated,
       makeGeneralizedAlpha},
      {"runge-kutta-merson", "Simbody", "explicit, order 4 with error control", 0, 0, Step::adaptive, Unknowns::constraints, makeRungeKuttaMerson,
       Equations::none, true},
      {"semi-explicit-euler", "Simbody", "semi-explicit, order 1, step doubling with error control (SemiExplicitEuler2)", 0, 0, Step::adaptive,
       Unknowns::constraints, makeSemiExplicitEuler, Equations::none, true}};
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

void interpolateCubic(double t, double t0, const std::vector<double>& y0, const std::vector<double>& rate0, double t1,
                      const std::vector<double>& y1, const std::vector<double>& rate1, std::vector<double>& y) {
  const double length = t1 - t0, s = length > 0 ? (t - t0) / length : 1.0, s2 = s * s, s3 = s2 * s;
  y.resize(y1.size());
  for (size_t i = 0; i < y.size(); ++i) {
    y[i] = (2 * s3 - 3 * s2 + 1) * y0[i] + (s3 - 2 * s2 + s) * length * rate0[i] + (3 * s2 - 2 * s3) * y1[i] + (s3 - s2) * length * rate1[i];
  }
}

const OdeIntegratorKind& findOdeIntegrator(const std::string& name, const std::string& where) {
  for (const OdeIntegratorKind& kind : kinds()) {
    if (kind.name == name) return kind;
  }
  // Not theirs to register in a program without SUNDIALS, but documented: docs/integrators.md.
  constexpr std::array<const char*, 5> kOfSundials = {"cvode-bdf", "cvode-adams", "ida", "arkode-dirk", "implicit-euler"};
  if (std::find(kOfSundials.begin(), kOfSundials.end(), name) != kOfSundials.end()) {
    throw InputError(where + ": " + name + " is not part of this program (built without SUNDIALS); allowed: " + io::joinNames(integratorNames()));
  }
  throw InputError(where + ": " + io::describeUnknown("integrator", name, integratorNames()));
}

std::string chooseIntegrator(const std::string& given) {
  if (!given.empty()) return given;
  const auto names = integratorNames();
  return std::find(names.begin(), names.end(), "cvode-bdf") != names.end() ? "cvode-bdf" : "cpodes";
}

void checkOdeSettings(const OdeIntegratorKind& kind, const OdeSettings& settings, const PlaceOfSetting& placeOf) {
  if (settings.maxOrder != 0 && (settings.maxOrder < kind.lowestOrder || settings.maxOrder > kind.highestOrder)) {
    const std::string allowed = kind.highestOrder == 0 ? "none: it has one order only" : std::to_string(kind.lowestOrder) + " to " + std::to_string(kind.highestOrder);
    throw InputError(placeOf("max_order") + ": " + kind.name + " with max_order " + std::to_string(settings.maxOrder) + "; allowed: " + allowed);
  }
  if (settings.step_s != 0 && kind.step == Step::adaptive) {
    std::vector<std::string> stepping;
    for (const OdeIntegratorKind& other : kinds()) {
      if (other.step != Step::adaptive) stepping.push_back(other.name);
    }
    throw InputError(placeOf("step") + ": is " + io::formatQuantity(settings.step_s, "s") + ", but " + kind.name +
                     " chooses its steps by `accuracy`; allowed: none, or an integrator with a fixed step (" + io::joinNames(stepping) + ")");
  }
}

std::unique_ptr<OdeIntegrator> makeOdeIntegrator(const std::string& name, OdeProblem& problem, const OdeSettings& settings,
                                                 const std::string& where) {
  const OdeIntegratorKind& kind = findOdeIntegrator(name, where);
  checkOdeSettings(kind, settings, [&where](const char*) { return where; });
  if (problem.numConstraints() > 0 && kind.unknowns == Unknowns::eliminated) {
    throw InputError(where + ": " + name + " cannot keep constraints; it needs prescribed coordinates eliminated (prescribed: eliminated)");
  }
  return kind.make(problem, settings);
}

}  // namespace genu::model
