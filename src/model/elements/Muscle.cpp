#include <algorithm>
#include <cmath>

#include "MakeForceElement.h"
#include "genu/model/PathForce.h"
#include "genu/musculoskeletal/Muscle.h"

namespace genu::model {

namespace {

using musculoskeletal::MuscleResponse;
using musculoskeletal::MuscleState;
using scene::MuscleDefinition;

/** Excitation over time, or from a tracking controller. */
class Excitation {
 public:
  Excitation(const MuscleDefinition& definition, KneeSystem& knee) : knee_(knee) {
    if (const auto* track = std::get_if<scene::TrackingController>(&definition.excitation)) {
      controller_ = *track;
      curve_ = knee.addCurve(track->target, definition.key() + ", target");
      rest_ = knee.addCurve(track->rest, definition.key() + ", rest");
    } else {
      curve_ = knee.addCurve(std::get<scene::TimeFunction>(definition.excitation), definition.key() + ", excitation");
    }
  }

  /** The spline through a table may overshoot: the value is cut to [0, 1]. `atRest`: without the controller's rates. */
  double calc(const SimTK::State& state, bool atRest) const {
    const double t = state.getTime();
    if (!controller_) return std::clamp(curve_->calcValue(t), 0.0, 1.0);
    const int i = knee_.stateIndex(controller_->coordinate);
    double e = std::clamp(rest_->calcValue(t), 0.0, 1.0) + controller_->gain * (curve_->calcValue(t) - state.getQ()[i]);
    if (!atRest) e += controller_->rateGain * (curve_->calcDerivative(t, 1) - state.getU()[i]);
    return std::clamp(e, 0.0, 1.0);
  }

 private:
  const KneeSystem& knee_;
  std::optional<scene::TrackingController> controller_;
  std::shared_ptr<const TimeCurve> curve_;  // the excitation, or the controller's target
  std::shared_ptr<const TimeCurve> rest_;   // of the controller
};

/** States: the activation, and with a compliant tendon the fibre length over the optimal one. */
class MuscleForce : public PathForce {
 public:
  MuscleForce(KneeSystem& knee, Path path, const MuscleDefinition& definition)
      : PathForce(knee, std::move(path)),
        muscle(definition.muscle),
        compliant(definition.compliantTendon),
        excitation(definition, knee),
        activation_(definition.activation) {}

  void realizeTopology(SimTK::State& state) const override {
    PathForce::realizeTopology(state);
    SimTK::Vector start(compliant ? 2 : 1, 0.0);
    if (compliant) start[1] = 1;
    firstState_ = knee().forces().allocateZ(state, start);
    responseIndex_ = knee().forces().allocateLazyCacheEntry(state, SimTK::Stage::Dynamics, new SimTK::Value<MuscleResponse>());
  }
  void realizeAcceleration(const SimTK::State& state) const override {
    SimTK::Vector& zdot = knee().forces().updZDot(state);
    zdot[firstState_] = activation_.calcRate_perS(getActivation(state), excitation.calc(state, false));
    if (compliant) zdot[firstState_ + 1] = getResponse(state).fibreVelocity_MPerS / muscle.optimalFibreLength_m;
  }

  double getActivation(const SimTK::State& state) const { return knee().forces().getZ(state)[firstState_]; }
  double getFibreLength_m(const SimTK::State& state) const {
    return knee().forces().getZ(state)[firstState_ + 1] * muscle.optimalFibreLength_m;
  }
  const MuscleResponse& getResponse(const SimTK::State& state) const {
    const SimTK::GeneralForceSubsystem& forces = knee().forces();
    // getCacheEntry() would ask for a State realized to Dynamics, which is what calls this.
    auto& response = SimTK::Value<MuscleResponse>::updDowncast(forces.updCacheEntry(state, responseIndex_));
    if (!forces.isCacheValueRealized(state, responseIndex_)) {
      response = calc(state, calcRateIfRigid(state));
      forces.markCacheValueRealized(state, responseIndex_);
    }
    return response;
  }
  double calcTension_N(const SimTK::State& state) const override { return getResponse(state).tension_N; }
  SimTK::Real calcPotentialEnergy(const SimTK::State& state) const override { return calc(state, 0).energy_J; }

  void settle(SimTK::State& state) const {
    const double a = excitation.calc(state, true);
    const double length = getGeometry(state).length_m;
    SimTK::Vector& z = knee().forces().updZ(state);
    z[firstState_] = a;
    if (compliant) z[firstState_ + 1] = findFibreEquilibrium(muscle, a, length).fibreLength_m / muscle.optimalFibreLength_m;
  }

  std::vector<ForceElement::OwnState> states(const SimTK::State& state) const {
    const int first = state.getZStart(knee().forces().getMySubsystemIndex()) + firstState_;
    // 1e-5 of activation and 1e-4 mm of fibre at the default accuracy.
    std::vector<ForceElement::OwnState> own = {{first, 0.1}};
    if (compliant) own.push_back({first + 1, 1e-3 / muscle.optimalFibreLength_m});
    return own;
  }

  const musculoskeletal::Muscle muscle;
  const bool compliant;
  const Excitation excitation;

 private:
  double calcRateIfRigid(const SimTK::State& state) const { return compliant ? 0.0 : calcRate_MPerS(state); }
  MuscleResponse calc(const SimTK::State& state, double rate_MPerS) const {
    const double length = getGeometry(state).length_m;
    return compliant ? calcCompliantTendon(muscle, getActivation(state), getFibreLength_m(state), length)
                     : calcRigidTendon(muscle, getActivation(state), length, rate_MPerS);
  }

  const musculoskeletal::ActivationDynamics activation_;
  mutable SimTK::ZIndex firstState_;
  mutable SimTK::CacheEntryIndex responseIndex_;
};

class Muscle : public ForceElement {
 public:
  Muscle(std::shared_ptr<const scene::ElementDefinition> definition, const MuscleForce& force)
      : ForceElement(std::move(definition)), force_(force) {}

  std::vector<scene::ElementColumn> outputs() const override {
    return {{"", "", "force", "N"},        {"", "", "length", "m"},     {"", "", "activation", ""},         {"", "", "excitation", ""},
            {"", "", "fibre_length", "m"}, {"", "", "pennation", "rad"}, {"", "", "fibre_velocity", "m_per_s"}, {"", "", "energy", "J"},
            {"", "", "state", ""},         {"", "", "inside_wrap", ""}};
  }
  void calcOutputs(const SimTK::State& state, double* values) const override {
    const Path::Geometry& geometry = force_.getGeometry(state);
    const MuscleResponse& response = force_.getResponse(state);
    values[0] = response.tension_N;
    values[1] = geometry.length_m;
    values[2] = force_.getActivation(state);
    values[3] = force_.excitation.calc(state, false);
    values[4] = response.fibreLength_m;
    values[5] = std::acos(std::clamp(response.cosPennation, 0.0, 1.0));
    values[6] = response.fibreVelocity_MPerS;
    values[7] = response.energy_J;
    values[8] = static_cast<double>(response.state);
    values[9] = geometry.numInside;
  }
  std::vector<OwnState> states(const SimTK::State& state) const override { return force_.states(state); }
  void settle(SimTK::State& state) const override { force_.settle(state); }
  std::string findProblem(const SimTK::State& state) const override { return force_.findPathProblem(state); }
  std::vector<contact::Vec3> calcPath(const SimTK::State& state) const override { return force_.path().calcLine(force_.knee(), state); }

 private:
  const MuscleForce& force_;
};

}  // namespace

std::unique_ptr<ForceElement> makeMuscle(std::shared_ptr<const scene::ElementDefinition> given, KneeSystem& knee) {
  const auto& definition = dynamic_cast<const MuscleDefinition&>(*given);
  Path path(definition.path, knee.scene(), knee.urdf(), whereIsPath(knee, definition));
  auto* force = new MuscleForce(knee, std::move(path), definition);
  SimTK::Force::Custom(knee.forces(), force);  // owns it
  return std::make_unique<Muscle>(std::move(given), *force);
}

}  // namespace genu::model
