#include <algorithm>
#include <cmath>
#include <sstream>

#include "genu/io/Suggest.h"
#include "genu/model/Analysis.h"
#include "genu/model/EquilibriumSolver.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

namespace {

using Unknowns = OdeIntegratorKind::Unknowns;

std::string listKinds(Unknowns refused) {
  std::vector<std::string> names;
  for (const OdeIntegratorKind& kind : listOdeIntegrators()) {
    if (kind.unknowns != refused) names.push_back(kind.name);
  }
  return io::joinNames(names);
}

}  // namespace

GaitMethod chooseGaitMethod(const scene::Scene& scene) {
  using Prescribed = scene::GaitSpec::Prescribed;
  const scene::GaitSpec gait = scene.gait.value_or(scene::GaitSpec{});
  const auto place = [&scene](const char* key) { return scene.where(std::string("analysis.gait.") + key); };
  const auto checkPositive = [&](double value, const char* key, const char* unit) {
    if (value > 0 && std::isfinite(value)) return;
    std::ostringstream text;
    text << place(key) << ": is " << value << unit << "; allowed: > 0";
    throw InputError(text.str());
  };
  checkPositive(gait.duration_s, "duration", " s");
  checkPositive(gait.outputInterval_s, "output_interval", " s");
  checkPositive(gait.accuracy, "accuracy", "");

  const OdeIntegratorKind& kind = findOdeIntegrator(chooseIntegrator(gait.integrator), place("integrator"));
  checkOdeSettings(kind, {gait.maxOrder, gait.step_s}, place);
  if (gait.step_s > 0 && gait.duration_s / gait.step_s > static_cast<double>(gait.maxSteps)) {
    std::ostringstream text;
    text << place("step") << ": is " << gait.step_s << " s: " << gait.duration_s / gait.step_s << " steps in " << gait.duration_s << " s, more than max_steps; allowed: >= "
         << gait.duration_s / static_cast<double>(gait.maxSteps) << " s, or a larger max_steps (" << gait.maxSteps << ")";
    throw InputError(text.str());
  }
  if (kind.ratesOnly && (gait.tolerances.translation_m || gait.tolerances.angle_rad)) {
    throw InputError(place(gait.tolerances.translation_m ? "tolerances.translation" : "tolerances.angle") + ": would be ignored: " + kind.name +
                     " weighs errors by the rates' tolerances alone; allowed: speed, angular_speed");
  }
  if (kind.unknowns == Unknowns::constraints) {
    if (gait.prescribed == Prescribed::eliminated) {
      throw InputError(place("prescribed") + ": is eliminated, but " + kind.name + " works with constraints; allowed: auto, constraints; eliminated with " +
                       listKinds(Unknowns::constraints));
    }
    return {&kind, true};
  }
  if (gait.prescribed == Prescribed::constraints && kind.unknowns == Unknowns::eliminated) {
    throw InputError(place("prescribed") + ": is constraints, but " + kind.name + " cannot keep constraints; allowed: auto, eliminated; constraints with " +
                     listKinds(Unknowns::eliminated));
  }
  return {&kind, gait.prescribed == Prescribed::constraints};  // automatic: eliminated was faster in every scene measured (docs/integrators.md)
}

void checkStaticMethod(const scene::Scene& scene, const scene::StaticSpec& settings) {
  if (settings.method == scene::StaticSpec::Method::kinsol && findEquilibriumSolver("kinsol") == nullptr) {
    throw InputError(scene.where("analysis.static.method") +
                     ": kinsol is not part of this program (built without SUNDIALS); allowed: newton, implicit-euler, both");
  }
  const auto coordinates = scene.coordinates();
  if (settings.search && std::none_of(coordinates.begin(), coordinates.end(), [](const auto& c) { return c.isFree; })) {
    throw InputError(scene.where("analysis.static.search") + ": no coordinate is free, so there is one pose only; remove it or free a coordinate");
  }
}

void checkAnalyses(const KneeSystem& knee, const scene::Scene& scene) {
  const scene::StaticSpec statics = scene.staticAnalysis.value_or(scene::StaticSpec{});
  checkStaticMethod(scene, statics);
  if (scene.staticAnalysis) knee.checkTablesCover(statics.time_s, statics.time_s);
  if (scene.series) knee.checkTablesCover(0, scene.series->duration_s);
  if (scene.gait) {
    chooseGaitMethod(scene);
    knee.checkTablesCover(0, scene.gait->duration_s);
  }
}

}  // namespace genu::model
