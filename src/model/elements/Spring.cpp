#include <algorithm>

#include "MakeForceElement.h"
#include "genu/model/PathForce.h"
#include "genu/musculoskeletal/SpringLaw.h"

namespace genu::model {

namespace {

using musculoskeletal::calcResponse;
using musculoskeletal::SpringLaw;
using musculoskeletal::SpringResponse;
using scene::SpringDefinition;

class SpringForce : public PathForce {
 public:
  SpringForce(KneeSystem& knee, Path path, const SpringLaw& given) : PathForce(knee, std::move(path)), law(given) {}

  SpringResponse calc(const SimTK::State& state) const {
    return calcResponse(law, getGeometry(state).length_m, law.damping_NSPerM > 0 ? calcRate_MPerS(state) : 0.0);
  }
  double calcTension_N(const SimTK::State& state) const override { return calc(state).tension_N; }
  SimTK::Real calcPotentialEnergy(const SimTK::State& state) const override {
    return calcResponse(law, getGeometry(state).length_m, 0).energy_J;
  }
  bool dependsOnlyOnPositions() const override { return law.damping_NSPerM == 0; }

  const SpringLaw law;
};

class Spring : public ForceElement {
 public:
  Spring(std::shared_ptr<const scene::ElementDefinition> definition, const SpringForce& force)
      : ForceElement(std::move(definition)), force_(force) {}

  std::vector<scene::ElementColumn> outputs() const override {
    return {{"", "", "force", "N"}, {"", "", "length", "m"}, {"", "", "energy", "J"}, {"", "", "inside_wrap", ""}};
  }
  void calcOutputs(const SimTK::State& state, double* values) const override {
    const Path::Geometry& geometry = force_.getGeometry(state);
    const SpringResponse response = force_.calc(state);
    values[0] = response.tension_N;
    values[1] = geometry.length_m;
    values[2] = response.energy_J;
    values[3] = geometry.numInside;
  }
  std::string findProblem(const SimTK::State& state) const override { return force_.findPathProblem(state); }
  std::vector<contact::Vec3> calcPath(const SimTK::State& state) const override { return force_.path().calcLine(force_.knee(), state); }

 private:
  const SpringForce& force_;
};

}  // namespace

std::unique_ptr<ForceElement> makeSpring(std::shared_ptr<const scene::ElementDefinition> given, KneeSystem& knee) {
  const auto& definition = dynamic_cast<const SpringDefinition&>(*given);
  Path path(definition.path, knee.scene(), knee.urdf(), whereIsPath(knee, definition));
  SpringLaw law;
  law.stiffness_NPerM = definition.stiffness_NPerM;
  law.restLength_m = definition.restLength_m;
  law.damping_NSPerM = definition.damping_NSPerM;
  law.tensionOnly = definition.tensionOnly;
  if (const auto& tension = definition.restFromTension) {
    law.restLength_m = calcLengthInPose_m(knee, path, tension->pose) - tension->tension_N / law.stiffness_NPerM;
    if (!(law.restLength_m >= 0)) {
      throw InputError(knee.scene().where(definition.key() + ".rest") + ": so much force needs a rest length of " +
                       io::formatQuantity(law.restLength_m, "mm") + "; allowed: >= 0");
    }
  }
  auto* force = new SpringForce(knee, std::move(path), law);
  SimTK::Force::Custom(knee.forces(), force);  // owns it
  return std::make_unique<Spring>(std::move(given), *force);
}

}  // namespace genu::model
