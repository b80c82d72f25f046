#include "genu/model/EnergyBalance.h"

#include <algorithm>
#include <cmath>

#include "Conversions.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {

namespace {

/** What the work of an interval is summed up from, at its ends. */
struct WorkState {
  struct Load {
    SimTK::Vec3 force, moment, position, velocity, spin;  // ground
  };
  std::vector<Load> loads;
  std::vector<double> generalizedLoads;                   // N or N m
  std::vector<double> muscleForce_N, muscleLength_m;
  double dampedPower_W = 0;
};

/** A load whose point stays in its body does the work f . dp; of others only the velocity at the ends is known. */
bool staysInBody(const scene::LoadSpec& load) {
  return (load.pointBody.empty() || load.pointBody == load.body) &&
         std::all_of(load.point_m.begin(), load.point_m.end(), [](const auto& p) { return std::holds_alternative<double>(p); });
}

bool isPowerKnown(const scene::Scene& scene) {
  for (const auto& spec : scene.model->coordinates) {
    const auto* free = std::get_if<scene::FreeCoordinate>(&spec);
    if (free != nullptr && free->limits && free->limits->dissipation > 0) return false;
  }
  return std::all_of(scene.elements.begin(), scene.elements.end(), [](const auto& element) {
    if (const auto* ligament = dynamic_cast<const scene::LigamentDefinition*>(element.get())) return !(ligament->dampingTime_s > 0);
    if (const auto* spring = dynamic_cast<const scene::SpringDefinition*>(element.get())) return !(spring->damping_NSPerM > 0);
    return dynamic_cast<const scene::MuscleDefinition*>(element.get()) != nullptr;
  });
}

/** The scene's bodies, gravity, stops and passive elements: what stores energy, without contact, whose energy is in the frames. */
scene::Scene withoutActors(const scene::Scene& given) {
  scene::Scene scene = given;
  scene.contacts.clear();
  scene.loads.clear();
  scene.generalizedLoads.clear();
  scene.elements.clear();
  for (const auto& element : given.elements) {
    if (dynamic_cast<const scene::MuscleDefinition*>(element.get()) == nullptr) scene.elements.push_back(element);
  }
  return scene;
}

class WorkMeter {
 public:
  WorkMeter(const scene::Scene& scene, KneeSystem& knee, const scene::Trajectory& trajectory) : scene_(scene), knee_(knee) {
    for (const scene::LoadSpec& load : scene.loads) {
      Entry entry;
      const auto link = [&](const std::string& name) { return findFrame(knee.urdf(), name, "loads." + load.name); };
      const LinkFrame body = link(load.body), axes = link(load.frame), point = link(load.pointBody.empty() ? load.body : load.pointBody);
      entry.body = body.link;
      entry.axes = axes.link;
      entry.pointBody = point.link;
      entry.R_BodyAxes = toSimTK(axes.X_LinkFrame).R();
      entry.X_PointBodyFrame = toSimTK(point.X_LinkFrame);
      entry.stays = staysInBody(load);
      for (size_t k = 0; k < 3; ++k) {
        entry.force.emplace_back(load.force_N[k]);
        entry.moment.emplace_back(load.moment_Nm[k]);
        entry.point.emplace_back(load.point_m[k]);
      }
      entries_.push_back(std::move(entry));
    }
    for (const scene::GeneralizedLoadSpec& load : scene.generalizedLoads) generalized_.emplace_back(load.value);
    for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
      const scene::ElementColumn& column = trajectory.elementColumns[i];
      if (column.keyword != "muscles") continue;
      if (column.quantity == "force") muscleForce_.push_back(i);
      if (column.quantity == "length") muscleLength_.push_back(i);
    }
  }

  /** `state` is at the frame's pose and rates, realized to Velocity. */
  WorkState read(const SimTK::State& state, const scene::Frame& frame) const {
    WorkState at;
    const double t = frame.time_s;
    const auto value = [t](const std::vector<TimeCurve>& c) { return SimTK::Vec3(c[0].calcValue(t), c[1].calcValue(t), c[2].calcValue(t)); };
    for (const Entry& entry : entries_) {
      WorkState::Load load;
      const SimTK::MobilizedBody& body = knee_.body(entry.body);
      const SimTK::Rotation R_GA = knee_.body(entry.axes).getBodyRotation(state) * entry.R_BodyAxes;
      load.force = R_GA * value(entry.force);
      load.moment = R_GA * value(entry.moment);
      load.position = knee_.body(entry.pointBody).findStationLocationInGround(state, entry.X_PointBodyFrame * value(entry.point));
      load.velocity = body.findStationVelocityInGround(state, body.findStationAtGroundPoint(state, load.position));
      load.spin = body.getBodyAngularVelocity(state);
      at.loads.push_back(load);
    }
    for (const TimeCurve& curve : generalized_) at.generalizedLoads.push_back(curve.calcValue(t));
    for (const size_t i : muscleForce_) at.muscleForce_N.push_back(frame.elements[i]);
    for (const size_t i : muscleLength_) at.muscleLength_m.push_back(frame.elements[i]);
    for (int i = 0; i < knee_.numCoordinates(); ++i) {
      const auto* free = std::get_if<scene::FreeCoordinate>(&scene_.model->coordinates[static_cast<size_t>(i)]);
      if (free != nullptr) at.dampedPower_W += free->damping * frame.qdot[static_cast<size_t>(i)] * frame.qdot[static_cast<size_t>(i)];
    }
    return at;
  }

  double workBetween(const WorkState& a, const WorkState& b, const scene::Frame& from, const scene::Frame& to) const {
    const double h = to.time_s - from.time_s;
    double work = -0.5 * h * (a.dampedPower_W + b.dampedPower_W);
    for (size_t i = 0; i < entries_.size(); ++i) {
      const WorkState::Load &x = a.loads[i], &y = b.loads[i];
      const SimTK::Vec3 move = entries_[i].stays ? SimTK::Vec3(y.position - x.position) : SimTK::Vec3(0.5 * h * (x.velocity + y.velocity));
      work += 0.5 * (~(x.force + y.force) * move) + 0.5 * (~(x.moment + y.moment) * SimTK::Vec3(0.5 * h * (x.spin + y.spin)));
    }
    for (size_t i = 0; i < generalized_.size(); ++i) {
      const auto k = static_cast<size_t>(scene_.generalizedLoads[i].coordinate);
      work += 0.5 * (a.generalizedLoads[i] + b.generalizedLoads[i]) * (to.q[k] - from.q[k]);
    }
    for (size_t k = 0; k < from.q.size(); ++k) work += 0.5 * (from.constraintForce[k] + to.constraintForce[k]) * (to.q[k] - from.q[k]);
    for (size_t i = 0; i < a.muscleForce_N.size(); ++i) {
      work -= 0.5 * (a.muscleForce_N[i] + b.muscleForce_N[i]) * (b.muscleLength_m[i] - a.muscleLength_m[i]);
    }
    return work;
  }

 private:
  struct Entry {
    int body = 0, axes = 0, pointBody = 0;
    SimTK::Rotation R_BodyAxes;
    SimTK::Transform X_PointBodyFrame;
    std::vector<TimeCurve> force, moment, point;
    bool stays = true;
  };
  const scene::Scene& scene_;
  const KneeSystem& knee_;
  std::vector<Entry> entries_;
  std::vector<TimeCurve> generalized_;
  std::vector<size_t> muscleForce_, muscleLength_;
};

double contactEnergy_J(const scene::Frame& frame) {
  double energy = 0;
  for (const contact::ContactResult& contact : frame.contacts) energy += contact.total.energy_J;
  return energy;
}

}  // namespace

EnergyBalance calcEnergyBalance(const scene::Scene& scene, const scene::Trajectory& trajectory) {
  EnergyBalance balance;
  if (!scene.model || trajectory.frames.empty() || !isPowerKnown(scene)) return balance;
  for (const scene::ContactSpec& contact : scene.contacts) {
    // Its power is not among the outputs.
    if (contact.definition.damping_sPerM > 0) return balance;
  }
  balance.known = true;
  KneeSystem knee(withoutActors(scene));
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  const WorkMeter meter(scene, knee, trajectory);
  std::vector<WorkState> at;
  double first = 0, lowest = 0, highest = 0, kinetic = 0, contact = 0;
  for (const scene::Frame& frame : trajectory.frames) {
    state.setTime(frame.time_s);
    for (int i = 0; i < knee.numCoordinates(); ++i) {
      state.updQ()[knee.stateIndex(i)] = frame.q[static_cast<size_t>(i)];
      state.updU()[knee.stateIndex(i)] = frame.qdot[static_cast<size_t>(i)];
    }
    knee.system().realize(state, SimTK::Stage::Dynamics);
    at.push_back(meter.read(state, frame));
    const double moving = knee.system().calcKineticEnergy(state), elastic = contactEnergy_J(frame);
    const double potential = knee.system().calcPotentialEnergy(state) + elastic;
    if (balance.energy_J.empty()) {
      first = moving + potential;
      lowest = highest = potential;
    }
    lowest = std::min(lowest, potential);
    highest = std::max(highest, potential);
    kinetic = std::max(kinetic, moving);
    contact = std::max(contact, elastic);
    balance.energy_J.push_back(moving + potential - first);
  }
  balance.scale_J = kinetic + contact + (highest - lowest);
  const auto& frames = trajectory.frames;
  balance.work_J.assign(1, 0.0);
  double coarse = 0;
  for (size_t i = 1; i < frames.size(); ++i) {
    balance.work_J.push_back(balance.work_J.back() + meter.workBetween(at[i - 1], at[i], frames[i - 1], frames[i]));
    if (i % 2 == 0) {
      coarse += meter.workBetween(at[i - 2], at[i], frames[i - 2], frames[i]);
      balance.quadrature_J = std::max(balance.quadrature_J, std::abs(balance.work_J[i] - coarse) / 3);
    }
    balance.imbalance_J = std::max(balance.imbalance_J, std::abs(balance.energy_J[i] - balance.work_J[i]));
  }
  return balance;
}

}  // namespace genu::model
