// A force element with a section of its own in scene files:
//
//   elastic_bands:
//     NAME: {path: [...], stiffness: 1 N/mm, rest: 100 mm, rise: 5, damping: 20 N s/m}

#include <memory>
#include <string>
#include <utility>

#include "ElasticBandLaw.h"
#include "genu/model/ForceElement.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/PathForce.h"

namespace {

using namespace genu;
using io::Dimension;

// 1. What the scene says: values in SI, no Simbody.

struct ElasticBandDefinition : scene::ElementDefinition {
  scene::PathDefinition path;
  bands::ElasticBandLaw law;

  std::string describe() const override {
    return scene::describePath(path) + "; " + io::formatQuantity(law.stiffness_NPerM, "N/mm") + ", rest length " +
           io::formatQuantity(law.restLength_m, "mm") + ", rise " + io::formatNumber(law.rise) +
           (law.damping_NSPerM > 0 ? ", damping " + io::formatQuantity(law.damping_NSPerM, "N s/m") : "");
  }
};

// 2. How it is read. The text in get() is an example for the message about a missing key.

std::shared_ptr<scene::ElementDefinition> readElasticBand(const scene::SceneNode& node, scene::ElementContext& context) {
  node.requireKeys({"path", "stiffness", "rest", "rise", "damping"});
  auto result = std::make_shared<ElasticBandDefinition>();
  result->path = context.readPath(node.get("path", "\"path: [{body: femur, at: ...}, {body: tibia, at: ...}]\""));
  result->law.stiffness_NPerM = node.get("stiffness", "\"stiffness: 1 N/mm\"").getPositive(Dimension::stiffness);
  result->law.restLength_m = node.get("rest", "\"rest: 100 mm\"").getPositive(Dimension::length);
  result->law.rise = node.get("rise", "\"rise: 5\"").getBetween(Dimension::dimensionless, 0.01, 100, "1");
  if (const auto damping = node.find("damping")) {
    result->law.damping_NSPerM = damping->getBetween(Dimension::damping, 0, 1000, "N s/m");
  }
  return result;
}

// 3. Its force in Simbody: PathForce knows length and direction, the law the tension.

class ElasticBandForce : public model::PathForce {
 public:
  ElasticBandForce(model::KneeSystem& knee, model::Path path, const bands::ElasticBandLaw& given)
      : PathForce(knee, std::move(path)), law(given) {}

  /** With damping Stage::Velocity, without Stage::Position. */
  bands::ElasticBandResponse calc(const SimTK::State& state) const {
    return bands::calcResponse(law, getGeometry(state).length_m, law.damping_NSPerM > 0 ? calcRate_MPerS(state) : 0.0);
  }
  double calcTension_N(const SimTK::State& state) const override { return calc(state).tension_N; }
  // Simbody asks for it at Stage::Position, where there is no rate yet.
  SimTK::Real calcPotentialEnergy(const SimTK::State& state) const override {
    return bands::calcResponse(law, getGeometry(state).length_m).energy_J;
  }
  bool dependsOnlyOnPositions() const override { return law.damping_NSPerM == 0; }

  const bands::ElasticBandLaw law;
};

// 4. The element: what it reports. A column called "force" is plotted.

class ElasticBand : public model::ForceElement {
 public:
  ElasticBand(std::shared_ptr<const scene::ElementDefinition> definition, const ElasticBandForce& force)
      : ForceElement(std::move(definition)), force_(force) {}

  std::vector<scene::ElementColumn> outputs() const override {
    return {{"", "", "force", "N"}, {"", "", "length", "m"}, {"", "", "energy", "J"}, {"", "", "inside_wrap", ""}};
  }
  void calcOutputs(const SimTK::State& state, double* values) const override {
    const bands::ElasticBandResponse response = force_.calc(state);
    values[0] = response.tension_N;
    values[1] = force_.getGeometry(state).length_m;
    values[2] = response.energy_J;
    values[3] = force_.getGeometry(state).numInside;
  }
  std::string findProblem(const SimTK::State& state) const override {
    const double stretch = force_.getGeometry(state).length_m / force_.law.restLength_m - 1;
    if (force_.law.rise * stretch > 100) {
      return "the band is stretched to exp(100) times its first stiffness; start nearer to its rest length";
    }
    return force_.findPathProblem(state);
  }
  std::vector<contact::Vec3> calcPath(const SimTK::State& state) const override {
    return force_.path().calcLine(force_.knee(), state);
  }

 private:
  const ElasticBandForce& force_;
};

std::unique_ptr<model::ForceElement> makeElasticBand(std::shared_ptr<const scene::ElementDefinition> given,
                                                     model::KneeSystem& knee) {
  const auto& definition = dynamic_cast<const ElasticBandDefinition&>(*given);
  model::Path path(definition.path, knee.scene(), knee.urdf(), model::whereIsPath(knee, definition));
  auto* force = new ElasticBandForce(knee, std::move(path), definition.law);
  SimTK::Force::Custom(knee.forces(), force);  // the system owns it
  return std::make_unique<ElasticBand>(std::move(given), *force);
}

// 5. The keyword, known before main() begins.

[[maybe_unused]] const bool registered = model::registerForceElement("elastic_bands", readElasticBand, makeElasticBand);

}  // namespace
