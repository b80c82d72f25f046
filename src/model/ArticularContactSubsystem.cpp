#include "genu/model/ArticularContactSubsystem.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "Conversions.h"

namespace genu::model {

namespace {

using SimTK::CacheEntryIndex;
using SimTK::Stage;
using SimTK::State;
using SimTK::Transform;

/** Warm-start memory in a State: every copy of the State starts its own, cold and with counters at zero. */
struct Workspaces {
  Workspaces() = default;
  Workspaces(const Workspaces&) {}
  Workspaces& operator=(const Workspaces&) {
    perPair.clear();
    linear.clear();
    counters = {};
    return *this;
  }
  ~Workspaces() = default;

  std::vector<contact::ContactWorkspace> perPair;
  std::vector<ArticularContactSubsystem::Linearization> linear;  ///< in place of evaluations, unless empty
  ArticularContactSubsystem::Counters counters;
};

using Results = std::vector<contact::ContactResult>;
using PairRates = std::vector<ArticularContactSubsystem::Rates>;

template <class T>
T& updValue(SimTK::AbstractValue& value) {
  return SimTK::Value<T>::updDowncast(value);
}
template <class T>
const T& getValue(const SimTK::AbstractValue& value) {
  return SimTK::Value<T>::downcast(value);
}

}  // namespace

class ArticularContactSubsystem::Guts : public SimTK::ForceSubsystem::Guts {
 public:
  Guts() : SimTK::ForceSubsystem::Guts("ArticularContactSubsystem", "1.0") {}

  struct Pair {
    std::string name;
    std::shared_ptr<const contact::ContactPair> pair;
    Attachment attachment;
  };
  std::vector<Pair> pairs;
  const contact::TaskRunner* runner = nullptr;

  bool isDamped(size_t pair) const { return pairs[pair].pair->definition().damping_sPerM > 0; }

  struct Frames {
    Transform X_GF, X_GM;
  };
  Frames calcFrames(const State& state, const Pair& pair) const {
    const SimTK::SimbodyMatterSubsystem& matter = getMultibodySystem().getMatterSubsystem();
    return {matter.getMobilizedBody(pair.attachment.fixed).getBodyTransform(state) * pair.attachment.X_FixedF,
            matter.getMobilizedBody(pair.attachment.moving).getBodyTransform(state) * pair.attachment.X_MovingM};
  }
  contact::Pose calcPose(const State& state, const Pair& pair) const {
    const Frames frames = calcFrames(state, pair);
    return toPose(~frames.X_GF * frames.X_GM);
  }

  Workspaces& updWorkspaces(const State& state) const {
    Workspaces& workspaces = updValue<Workspaces>(updCacheEntry(state, workspaceIndex_));
    if (workspaces.perPair.size() != pairs.size()) {
      workspaces.perPair.clear();
      for (const Pair& pair : pairs) workspaces.perPair.emplace_back(*pair.pair).setTaskRunner(runner);
    }
    return workspaces;
  }

  const Results& getResults(const State& state, bool withEnergy) const {
    if (!withEnergy && isCacheValueRealized(state, energyResultIndex_)) withEnergy = true;  // serves both
    const CacheEntryIndex index = withEnergy ? energyResultIndex_ : resultIndex_;
    if (!isCacheValueRealized(state, index)) {
      Workspaces& workspaces = updWorkspaces(state);
      Results& results = updValue<Results>(updCacheEntry(state, index));
      results.resize(pairs.size());
      contact::ContactPair::Options options;
      options.withEnergy = withEnergy;
      options.copyOnlySamePose = true;
      for (size_t i = 0; i < pairs.size(); ++i) {
        if (!workspaces.linear.empty()) {
          const contact::JointCoordinates q = contact::calcCoordinates(calcPose(state, pairs[i]));
          extrapolate(workspaces.linear[i], q, workspaces.linear[i].qdot, results[i]);
          continue;
        }
        pairs[i].pair->evaluate(calcPose(state, pairs[i]), workspaces.perPair[i], options, results[i]);
        count(workspaces.counters, results[i]);
      }
      markCacheValueRealized(state, index);
    }
    return getValue<Results>(getCacheEntry(state, index));
  }

  contact::SpatialVelocity calcVelocity(const State& state, const Pair& pair) const {
    const SimTK::SimbodyMatterSubsystem& matter = getMultibodySystem().getMatterSubsystem();
    const Attachment& at = pair.attachment;
    const SimTK::MobilizedBody& fixed = matter.getMobilizedBody(at.fixed);
    const SimTK::MobilizedBody& moving = matter.getMobilizedBody(at.moving);
    // Velocity of Mo relative to the point of the fixed body that coincides with it.
    const SimTK::Vec3 p_FixedMo = fixed.findStationAtAnotherBodyStation(state, moving, at.X_MovingM.p());
    const SimTK::Vec3 w_G = moving.getBodyAngularVelocity(state) - fixed.getBodyAngularVelocity(state);
    const SimTK::Vec3 v_G = moving.findStationVelocityInGround(state, at.X_MovingM.p()) -
                            fixed.findStationVelocityInGround(state, p_FixedMo);
    const SimTK::Rotation R_GF = fixed.getBodyRotation(state) * at.X_FixedF.R();
    return {toEigen(~R_GF * w_G), toEigen(~R_GF * v_G)};
  }

  /** Loads of the pairs that have damping; entries of the others are empty. */
  const Results& getDampedResults(const State& state) const {
    if (!isCacheValueRealized(state, dampedResultIndex_)) {
      Workspaces& workspaces = updWorkspaces(state);
      Results& results = updValue<Results>(updCacheEntry(state, dampedResultIndex_));
      results.resize(pairs.size());
      contact::ContactPair::Options options;
      options.copyOnlySamePose = true;
      for (size_t i = 0; i < pairs.size(); ++i) {
        if (!isDamped(i)) continue;
        contact::JointCoordinates q = contact::calcCoordinates(calcPose(state, pairs[i]));
        const contact::JointCoordinates qdot = calcCoordinateRates(q, calcVelocity(state, pairs[i]));
        if (!workspaces.linear.empty()) {
          extrapolate(workspaces.linear[i], q, qdot, results[i]);
          continue;
        }
        pairs[i].pair->evaluate(q, qdot, workspaces.perPair[i], options, results[i]);
        count(workspaces.counters, results[i]);
      }
      markCacheValueRealized(state, dampedResultIndex_);
    }
    return getValue<Results>(getCacheEntry(state, dampedResultIndex_));
  }
  /** The load that acts. */
  const contact::ContactResult& getActing(const State& state, size_t pair) const {
    return isDamped(pair) ? getDampedResults(state).at(pair) : getResults(state, false).at(pair);
  }

  static void extrapolate(const Linearization& about, const contact::JointCoordinates& q, const contact::JointCoordinates& qdot,
                          contact::ContactResult& result) {
    Eigen::Matrix<double, 6, 1> dq, dqdot;
    for (int k = 0; k < 6; ++k) {
      dq[k] = q[static_cast<size_t>(k)] - about.q[static_cast<size_t>(k)];
      dqdot[k] = qdot[static_cast<size_t>(k)] - about.qdot[static_cast<size_t>(k)];
    }
    const Eigen::Matrix<double, 6, 1> change = about.at.stiffness * dq + about.at.damping * dqdot;
    result = about.at;
    result.total.forceOnM_F += change.head<3>();
    result.total.momentOnM_Fo_F += change.tail<3>();
  }

  std::vector<Linearization> linearize(const State& state) const {
    Workspaces& workspaces = updWorkspaces(state);
    std::vector<Linearization> linearizations(pairs.size());
    contact::ContactPair::Options options;
    options.withStiffness = true;
    options.copyOnlySamePose = true;
    for (size_t i = 0; i < pairs.size(); ++i) {
      Linearization& about = linearizations[i];
      about.q = contact::calcCoordinates(calcPose(state, pairs[i]));
      about.qdot = calcCoordinateRates(about.q, calcVelocity(state, pairs[i]));
      if (isDamped(i)) {
        pairs[i].pair->evaluate(about.q, about.qdot, workspaces.perPair[i], options, about.at);
      } else {
        pairs[i].pair->evaluate(about.q, workspaces.perPair[i], options, about.at);
      }
      count(workspaces.counters, about.at);
    }
    keep(state, linearizations);
    return linearizations;
  }
  /** The loads of linearizations serve as those of the State too. */
  void keep(const State& state, const std::vector<Linearization>& linearizations) const {
    size_t damped = 0;
    for (size_t i = 0; i < pairs.size(); ++i) damped += isDamped(i) ? 1 : 0;
    if (damped > 0 && damped < pairs.size()) return;
    const CacheEntryIndex index = damped > 0 ? dampedResultIndex_ : resultIndex_;
    if (isCacheValueRealized(state, index)) return;
    Results& results = updValue<Results>(updCacheEntry(state, index));
    results.resize(pairs.size());
    for (size_t i = 0; i < pairs.size(); ++i) results[i] = linearizations[i].at;
    markCacheValueRealized(state, index);
  }

  const PairRates& getRates(const State& state) const {
    if (!isCacheValueRealized(state, ratesIndex_)) {
      PairRates& rates = updValue<PairRates>(updCacheEntry(state, ratesIndex_));
      rates.resize(pairs.size());
      for (size_t i = 0; i < pairs.size(); ++i) {
        rates[i].V_FM = calcVelocity(state, pairs[i]);
        const contact::Vec3 p_FMo = calcPose(state, pairs[i]).p;
        const auto calcPower = [&](const contact::ContactResult& result) {
          return contact::ContactPair::calcPower(result.total, rates[i].V_FM, p_FMo);
        };
        rates[i].power_W = calcPower(getActing(state, i));
        rates[i].dissipated_W = isDamped(i) ? calcPower(getResults(state, false)[i]) - rates[i].power_W : 0;
      }
      markCacheValueRealized(state, ratesIndex_);
    }
    return getValue<PairRates>(getCacheEntry(state, ratesIndex_));
  }

  const Counters& getCounters(const State& state) const { return updWorkspaces(state).counters; }

  SimTK::Real calcPotentialEnergy(const State& state) const override {
    double energy = 0;
    for (const contact::ContactResult& result : getResults(state, true)) energy += result.total.energy_J;
    return energy;
  }

 protected:
  Guts* cloneImpl() const override { return new Guts(*this); }

  int realizeSubsystemTopologyImpl(State& state) const override {
    Guts* self = const_cast<Guts*>(this);  // indices are this subsystem's topology cache
    self->workspaceIndex_ = allocateCacheEntry(state, Stage::Topology, Stage::Infinity, new SimTK::Value<Workspaces>());
    self->resultIndex_ = allocateLazyCacheEntry(state, Stage::Position, new SimTK::Value<Results>());
    self->energyResultIndex_ = allocateLazyCacheEntry(state, Stage::Position, new SimTK::Value<Results>());
    self->dampedResultIndex_ = allocateLazyCacheEntry(state, Stage::Velocity, new SimTK::Value<Results>());
    self->ratesIndex_ = allocateLazyCacheEntry(state, Stage::Velocity, new SimTK::Value<PairRates>());
    return 0;
  }

  int realizeSubsystemDynamicsImpl(const State& state) const override {
    const SimTK::MultibodySystem& system = getMultibodySystem();
    const SimTK::SimbodyMatterSubsystem& matter = system.getMatterSubsystem();
    SimTK::Vector_<SimTK::SpatialVec>& bodyForces = system.updRigidBodyForces(state, Stage::Dynamics);
    for (size_t i = 0; i < pairs.size(); ++i) {
      const contact::NetLoad& load = getActing(state, i).total;
      if (load.activeElements == 0) continue;
      const Attachment& at = pairs[i].attachment;
      const Transform X_GF = calcFrames(state, pairs[i]).X_GF;
      bodyForces[at.moving] +=
          toSpatialVecInG(load, X_GF, matter.getMobilizedBody(at.moving).getBodyOriginLocation(state));
      bodyForces[at.fixed] -=
          toSpatialVecInG(load, X_GF, matter.getMobilizedBody(at.fixed).getBodyOriginLocation(state));
    }
    return 0;
  }

 private:
  static void count(Counters& counters, const contact::ContactResult& result) {
    ++counters.evaluations;
    counters.copies += result.copied ? 1 : 0;
    counters.distanceQueries += result.distanceQueries;
  }

  CacheEntryIndex workspaceIndex_, resultIndex_, energyResultIndex_, dampedResultIndex_, ratesIndex_;
};

ArticularContactSubsystem::ArticularContactSubsystem(SimTK::MultibodySystem& system) {
  adoptSubsystemGuts(new Guts());
  system.addForceSubsystem(*this);
}

const ArticularContactSubsystem::Guts& ArticularContactSubsystem::guts() const {
  return dynamic_cast<const Guts&>(getSubsystemGuts());
}
ArticularContactSubsystem::Guts& ArticularContactSubsystem::updGuts() {
  return dynamic_cast<Guts&>(updSubsystemGuts());
}

int ArticularContactSubsystem::addContactPair(const std::string& name, std::shared_ptr<const contact::ContactPair> pair,
                                              const Attachment& attachment) {
  if (!pair) throw std::invalid_argument("ArticularContactSubsystem: contact pair '" + name + "' is null");
  if (attachment.fixed == attachment.moving) {
    throw std::invalid_argument("ArticularContactSubsystem: contact pair '" + name + "' joins a body to itself");
  }
  Guts& own = updGuts();
  own.invalidateSubsystemTopologyCache();
  own.pairs.push_back({name, std::move(pair), attachment});
  return static_cast<int>(own.pairs.size()) - 1;
}

bool ArticularContactSubsystem::canLinearize() const {
  const auto& pairs = guts().pairs;
  return std::all_of(pairs.begin(), pairs.end(),
                     [](const Guts::Pair& pair) { return pair.pair->definition().rule == contact::ContactRule::smooth; });
}
std::vector<ArticularContactSubsystem::Linearization> ArticularContactSubsystem::linearize(const SimTK::State& state) const {
  return guts().linearize(state);
}
void ArticularContactSubsystem::useLinearization(const SimTK::State& state, std::vector<Linearization> linearizations) const {
  guts().updWorkspaces(state).linear = std::move(linearizations);
}

void ArticularContactSubsystem::setTaskRunner(const contact::TaskRunner* runner) {
  Guts& own = updGuts();
  own.invalidateSubsystemTopologyCache();
  own.runner = runner;
}

int ArticularContactSubsystem::numContactPairs() const { return static_cast<int>(guts().pairs.size()); }
const std::string& ArticularContactSubsystem::name(int pair) const {
  return guts().pairs.at(static_cast<size_t>(pair)).name;
}
const contact::ContactPair& ArticularContactSubsystem::contactPair(int pair) const {
  return *guts().pairs.at(static_cast<size_t>(pair)).pair;
}
const ArticularContactSubsystem::Attachment& ArticularContactSubsystem::attachment(int pair) const {
  return guts().pairs.at(static_cast<size_t>(pair)).attachment;
}

contact::Pose ArticularContactSubsystem::calcPose(const State& state, int pair) const {
  return guts().calcPose(state, guts().pairs.at(static_cast<size_t>(pair)));
}
const contact::ContactResult& ArticularContactSubsystem::getResult(const State& state, int pair) const {
  return guts().getResults(state, false).at(static_cast<size_t>(pair));
}
const contact::ContactResult& ArticularContactSubsystem::getResultWithEnergy(const State& state, int pair) const {
  return guts().getResults(state, true).at(static_cast<size_t>(pair));
}
contact::EvaluationStatus ArticularContactSubsystem::getStatus(const State& state) const {
  // A damped load at hand has the status of the elastic one: no need to evaluate that too.
  const bool hasRates = state.getSystemStage() >= Stage::Velocity;
  const Guts& own = guts();
  contact::EvaluationStatus worst = contact::EvaluationStatus::ok;
  for (size_t i = 0; i < own.pairs.size(); ++i) {
    worst = std::max(worst, (hasRates ? own.getActing(state, i) : own.getResults(state, false)[i]).status);
  }
  return worst;
}
const contact::ContactResult& ArticularContactSubsystem::getDampedResult(const State& state, int pair) const {
  guts().pairs.at(static_cast<size_t>(pair));
  return guts().getActing(state, static_cast<size_t>(pair));
}
contact::ContactResult ArticularContactSubsystem::calcDampedResultWithEnergy(const State& state, int pair) const {
  const contact::ContactResult& elastic = getResultWithEnergy(state, pair);
  if (!guts().isDamped(static_cast<size_t>(pair))) return elastic;
  contact::ContactResult result = getDampedResult(state, pair);
  result.total.energy_J = elastic.total.energy_J;
  for (size_t k = 0; k < result.compartments.size(); ++k) result.compartments[k].energy_J = elastic.compartments[k].energy_J;
  return result;
}
const ArticularContactSubsystem::Rates& ArticularContactSubsystem::getRates(const State& state, int pair) const {
  return guts().getRates(state).at(static_cast<size_t>(pair));
}
std::vector<std::vector<contact::ElementField>> ArticularContactSubsystem::calcFields(const State& state,
                                                                                      int pair) const {
  const Guts::Pair& own = guts().pairs.at(static_cast<size_t>(pair));
  contact::ContactWorkspace workspace(*own.pair);
  contact::ContactResult result;
  own.pair->evaluate(guts().calcPose(state, own), workspace, {}, result);
  return own.pair->calcFields(workspace);
}
std::vector<std::vector<contact::ElementField>> ArticularContactSubsystem::calcTrackedFields(const SimTK::State& state, int pair) const {
  guts().getResults(state, false);
  const auto index = static_cast<size_t>(pair);
  return guts().pairs.at(index).pair->calcFields(guts().updWorkspaces(state).perPair.at(index));
}
const ArticularContactSubsystem::Counters& ArticularContactSubsystem::getCounters(const State& state) const {
  return guts().getCounters(state);
}

contact::JointCoordinates ArticularContactSubsystem::calcCoordinateRates(contact::JointCoordinates& q,
                                                                         const contact::SpatialVelocity& V) {
  constexpr double kLock = 1e-10;  // [rad]; the rates then lose six digits of sixteen
  if (std::abs(std::cos(q[1])) < kLock) q[1] = std::copysign(contact::kPi / 2 - kLock, q[1]);
  // w = x qdot0 + Rx y qdot1 + Rx Ry z qdot2
  const double s0 = std::sin(q[0]), c0 = std::cos(q[0]);
  contact::JointCoordinates qdot;
  qdot[2] = (c0 * V.w_FM.z() - s0 * V.w_FM.y()) / std::cos(q[1]);
  qdot[1] = c0 * V.w_FM.y() + s0 * V.w_FM.z();
  qdot[0] = V.w_FM.x() - std::sin(q[1]) * qdot[2];
  for (int k = 0; k < 3; ++k) qdot[static_cast<size_t>(3 + k)] = V.v_FMo[k];
  return qdot;
}

SimTK::SpatialVec ArticularContactSubsystem::toSpatialVecInG(const contact::NetLoad& load, const Transform& X_GF,
                                                             const SimTK::Vec3& p_GBo) {
  const SimTK::Vec3 force_G = X_GF.R() * toSimTK(load.forceOnM_F);
  const SimTK::Vec3 moment_Fo_G = X_GF.R() * toSimTK(load.momentOnM_Fo_F);
  return {moment_Fo_G + (X_GF.p() - p_GBo) % force_G, force_G};
}

}  // namespace genu::model
