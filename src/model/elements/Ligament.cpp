#include <stdexcept>

#include "MakeForceElement.h"
#include "genu/model/PathForce.h"
#include "genu/musculoskeletal/LigamentLaw.h"

namespace genu::model {

namespace {

using musculoskeletal::calcResponse;
using musculoskeletal::LigamentLaw;
using musculoskeletal::LigamentResponse;
using scene::LigamentDefinition;

class LigamentForce : public PathForce {
 public:
  LigamentForce(KneeSystem& knee, Path path, const LigamentLaw& given) : PathForce(knee, std::move(path)), law(given) {}

  LigamentResponse calc(const SimTK::State& state) const {
    const double length = getGeometry(state).length_m;
    return calcResponse(law, length, law.dampingTime_s > 0 && length > law.slackLength_m ? calcRate_MPerS(state) : 0.0);
  }
  double calcTension_N(const SimTK::State& state) const override { return calc(state).tension_N; }
  SimTK::Real calcPotentialEnergy(const SimTK::State& state) const override {
    return calcResponse(law, getGeometry(state).length_m).energy_J;
  }
  bool dependsOnlyOnPositions() const override { return law.dampingTime_s == 0; }

  const LigamentLaw law;
};

class Ligament : public ForceElement {
 public:
  Ligament(std::shared_ptr<const scene::ElementDefinition> definition, const LigamentForce& force)
      : ForceElement(std::move(definition)), force_(force) {}

  std::vector<scene::ElementColumn> outputs() const override {
    return {{"", "", "force", "N"}, {"", "", "length", "m"}, {"", "", "strain", ""}, {"", "", "energy", "J"}, {"", "", "inside_wrap", ""}};
  }
  void calcOutputs(const SimTK::State& state, double* values) const override {
    const Path::Geometry& geometry = force_.getGeometry(state);
    const LigamentResponse response = force_.calc(state);
    values[0] = response.tension_N;
    values[1] = geometry.length_m;
    values[2] = geometry.length_m / force_.law.slackLength_m - 1;
    values[3] = response.energy_J;
    values[4] = geometry.numInside;
  }
  std::string findProblem(const SimTK::State& state) const override { return force_.findPathProblem(state); }
  std::vector<contact::Vec3> calcPath(const SimTK::State& state) const override { return force_.path().calcLine(force_.knee(), state); }

 private:
  const LigamentForce& force_;
};

LigamentLaw makeLaw(const LigamentDefinition& definition, const Path& path, const KneeSystem& knee) {
  LigamentLaw law;
  law.toeStrain = definition.toeStrain;
  law.dampingTime_s = definition.dampingTime_s;
  const auto lengthIn = [&](const std::string& pose) { return calcLengthInPose_m(knee, path, pose); };
  if (const auto* length = std::get_if<LigamentDefinition::Length>(&definition.slack)) {
    law.slackLength_m = length->length_m;
  } else if (const auto* strain = std::get_if<LigamentDefinition::Strain>(&definition.slack)) {
    law.slackLength_m = musculoskeletal::calcSlackLengthFromStrain_m(lengthIn(strain->pose), strain->strain);
  } else {
    const auto& tension = std::get<LigamentDefinition::Tension>(definition.slack);
    const double length_m = lengthIn(tension.pose);
    law.slackLength_m =
        definition.perLength
            ? musculoskeletal::calcSlackLengthFromTensionPerLength_m(length_m, tension.tension_N, definition.stiffness, law.toeStrain)
            : musculoskeletal::calcSlackLengthFromTension_m(length_m, tension.tension_N, definition.stiffness, law.toeStrain);
  }
  law.stiffness_N = definition.stiffness * (definition.perLength ? law.slackLength_m : 1.0);
  law.validate();
  return law;
}

}  // namespace

std::unique_ptr<ForceElement> makeLigament(std::shared_ptr<const scene::ElementDefinition> given, KneeSystem& knee) {
  const auto& definition = dynamic_cast<const LigamentDefinition&>(*given);
  Path path(definition.path, knee.scene(), knee.urdf(), whereIsPath(knee, definition));
  LigamentLaw law;
  try {
    law = makeLaw(definition, path, knee);
  } catch (const std::invalid_argument& error) {
    throw InputError(knee.scene().where(definition.key() + ".slack") + ": " + error.what());
  }
  auto* force = new LigamentForce(knee, std::move(path), law);
  SimTK::Force::Custom(knee.forces(), force);  // owns it
  return std::make_unique<Ligament>(std::move(given), *force);
}

}  // namespace genu::model
