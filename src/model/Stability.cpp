#include "genu/model/Stability.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "Conversions.h"
#include "StaticAnalysis.h"
#include "genu/model/CutOff.h"
#include "genu/model/KneeSystem.h"
#include "genu/scene/SceneFile.h"

namespace genu::model {

namespace {

using contact::EvaluationStatus;

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

/** What is compared, of a run that completed; or why it did not. */
struct RunData {
  StabilityOutcome outcome = StabilityOutcome::ok;
  std::string message;
  double cpu_s = 0;
  long evaluations = 0;
  std::vector<scene::Coordinates> q;
  std::vector<std::vector<double>> force_N;  ///< of all compartments
  EnergyBalance balance;
};

std::vector<double> listForces(const std::vector<contact::ContactResult>& contacts) {
  std::vector<double> forces;
  for (const contact::ContactResult& contact : contacts) {
    for (const contact::NetLoad& load : contact.compartments) forces.push_back(load.scalarForce_N);
  }
  return forces;
}

/** What the program warns of after a run that completed. */
std::string listRemarks(const KneeSystem& knee, const std::vector<const std::vector<contact::ContactResult>*>& all) {
  int extrapolated = 0, border = 0, missing = 0;
  for (const auto* contacts : all) {
    for (const contact::ContactResult& contact : *contacts) {
      extrapolated = std::max(extrapolated, contact.total.extrapolatedElements);
      border = std::max(border, contact.total.boundaryElements);
      missing = std::max(missing, contact.total.noThicknessElements);
    }
  }
  std::ostringstream text;
  if (extrapolated > 0) text << extrapolated << " elements beyond 95 % of their thickness; ";
  if (border > 0) text << border << " elements on the border of the moving surface; ";
  if (missing > 0) text << missing << " elements without thickness; ";
  for (const std::string& warning : knee.listTableWarnings()) text << warning << "; ";
  std::string result = text.str();
  if (!result.empty()) result.resize(result.size() - 2);
  return result;
}

/** Remarks on contact that is cut off, in front of others. */
void addCutOffs(const scene::Scene& scene, const std::vector<scene::Frame>& frames, std::string& message) {
  for (const CutOff& cutOff : findCutOffs(scene, frames)) message = describe(cutOff, scene) + (message.empty() ? "" : "; " + message);
}

/** `remarks`: what the program would warn of is looked for. */
RunData run(const scene::Scene& scene, double cpuLimit_s, bool remarks, const scene::Progress& progress) {
  RunData data;
  const double start = cpuTime_s();
  bool late = false;
  const scene::Progress limited = [&](double share) {
    late = late || cpuTime_s() - start > cpuLimit_s;
    return !late && (!progress || progress(share));
  };
  try {
    KneeSystem knee(scene);
    std::vector<const std::vector<contact::ContactResult>*> contacts;
    if (scene.gait) {
      const GaitResult result = runGait(knee, scene, limited);
      data.cpu_s = result.cpuTime_s;
      data.evaluations = result.statistics.contactEvaluations;
      if (result.complete) {
        for (const scene::Frame& frame : result.frames) {
          data.q.push_back(frame.q);
          data.force_N.push_back(listForces(frame.contacts));
          contacts.push_back(&frame.contacts);
        }
        data.message = listRemarks(knee, contacts);
        if (remarks) addCutOffs(scene, result.frames, data.message);
        if (remarks && !result.remark.empty()) data.message = result.remark + (data.message.empty() ? "" : "; " + data.message);
        data.balance = calcEnergyBalance(scene, result);
      } else {
        data.outcome = StabilityOutcome::failed;
        data.message = result.statusText;
      }
    } else {
      const StaticResult result = runStatic(knee, scene, limited);
      data.cpu_s = result.cpuTime_s;
      data.evaluations = result.contactEvaluations;
      if (result.status == StaticResult::Status::converged) {
        data.q.push_back(result.q);
        data.force_N.push_back(listForces(result.contacts));
        contacts.push_back(&result.contacts);
        data.message = listRemarks(knee, contacts);
        if (remarks) {
          scene::Frame frame;
          frame.q = result.q;
          frame.contacts = result.contacts;
          addCutOffs(scene, {frame}, data.message);
        }
        if (result.statusText != "converged") data.message = result.statusText + (data.message.empty() ? "" : "; " + data.message);
      } else {
        data.outcome = StabilityOutcome::failed;
        data.message = result.statusText;
      }
    }
  } catch (const InputError& error) {
    data.outcome = StabilityOutcome::refused;
    data.message = error.what();
  } catch (const ComputationError& error) {
    data.outcome = StabilityOutcome::failed;
    data.message = error.what();
  } catch (const std::invalid_argument& error) {
    data.outcome = StabilityOutcome::refused;
    data.message = error.what();
  } catch (const std::exception& error) {  // nothing that a user can understand: as bad as a wrong number
    data.outcome = StabilityOutcome::wrong;
    data.message = std::string("internal: ") + error.what();
  }
  if (late) {
    std::ostringstream text;
    text << "stopped after " << cpuLimit_s << " s of processor time";
    data.outcome = StabilityOutcome::slow;
    data.message = text.str();
  }
  if (data.cpu_s == 0) data.cpu_s = cpuTime_s() - start;
  return data;
}

scene::Scene makeDefaultReference(scene::Scene scene, int steps) {
  constexpr double kShortestStep_s = 1e-5;
  if (scene.gait) {
    scene.gait->integrator = "generalized-alpha";
    scene.gait->step_s = std::max(kShortestStep_s, scene.gait->duration_s / steps);
    scene.gait->maxOrder = 0;
    scene.gait->prescribed = scene::GaitSpec::Prescribed::automatic;
    return scene;
  }
  for (scene::ContactSpec& contact : scene.contacts) {
    for (contact::CompartmentDefinition& part : contact.definition.compartments) {
      part.nx *= 2;
      part.nz *= 2;
    }
  }
  return scene;
}

/** Largest difference of two poses over the free coordinates. Angles of a floating joint are compared as rotations: near gimbal lock rx and rz have no
 meaning of their own. */
double calcPoseDifference_m(const std::vector<scene::CoordinateInfo>& coordinates, const scene::Coordinates& a, const scene::Coordinates& b) {
  double largest = 0;
  for (size_t k = 0; k < coordinates.size(); ++k) {
    if (coordinates[k].shortName == "rx" && k + 6 <= coordinates.size()) {
      const contact::Mat3 R = contact::calcPose(scene::takeSix(a, k)).R.transpose() * contact::calcPose(scene::takeSix(b, k)).R;
      // From sine and cosine, so that small and large angles keep their digits.
      const contact::Vec3 axis(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
      largest = std::max(largest, kAngleLength_m * std::atan2(0.5 * axis.norm(), 0.5 * (R.trace() - 1)));
      k += 2;
      continue;
    }
    if (coordinates[k].isFree) largest = std::max(largest, (coordinates[k].isAngle ? kAngleLength_m : 1.0) * std::abs(a[k] - b[k]));
  }
  return largest;
}

void compare(const scene::Scene& scene, const RunData& reference, const RunData& data, StabilityCell& cell) {
  const auto coordinates = scene.coordinates();
  for (size_t i = 0; i < data.q.size(); ++i) cell.poseError_m = std::max(cell.poseError_m, calcPoseDifference_m(coordinates, data.q[i], reference.q[i]));
  constexpr double kNoForce_N = 1e-3;
  double difference = 0, sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < data.force_N.size(); ++i) {
    for (size_t k = 0; k < data.force_N[i].size(); ++k) {
      difference += std::abs(data.force_N[i][k] - reference.force_N[i][k]);
      sum += std::abs(reference.force_N[i][k]);
      ++count;
    }
  }
  if (count > 0) cell.forceError = difference / std::max(sum, kNoForce_N * static_cast<double>(count));
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

const char* toString(StabilityOutcome outcome) {
  switch (outcome) {
    case StabilityOutcome::ok: return "ok";
    case StabilityOutcome::warned: return "warned";
    case StabilityOutcome::wrong: return "wrong";
    case StabilityOutcome::failed: return "failed";
    case StabilityOutcome::refused: return "refused";
    case StabilityOutcome::slow: return "slow";
    case StabilityOutcome::unchecked: return "unchecked";
  }
  return "unknown";
}

double StabilityAxis::middle(double a, double b) const {
  switch (scale) {
    case Scale::linear: return 0.5 * (a + b);
    case Scale::toHalf:
      if (a < 0.5 && b < 0.5) return 0.5 - std::sqrt((0.5 - a) * (0.5 - b));
      return b == 0.5 && a < 0.5 ? 0.5 - 0.01 * (0.5 - a) : 0.5 * (a + b);
    default: return a == 0 ? 0.1 * b : std::sqrt(a * b);
  }
}

bool StabilityAxis::isNarrow(double a, double b, double ratio) const {
  switch (scale) {
    case Scale::linear: return std::abs(b - a) < 0.1 * (ratio - 1) * (values.back() - values.front());
    case Scale::toHalf: return a < 0.5 && b < 0.5 ? std::max(0.5 - a, 0.5 - b) < ratio * std::min(0.5 - a, 0.5 - b) : std::abs(b - a) < 1e-9;
    default: return std::max(a, b) < ratio * std::min(a, b);
  }
}

StabilityCell runStabilityCell(const StabilityAxis& axis, double value, const StabilityOptions& options, const scene::Progress& progress) {
  constexpr double kReferenceCost = 10;  // of a run's processor time
  StabilityCell cell;
  cell.value = value;
  scene::Scene scene;
  try {
    scene = axis.make(value);
  } catch (const InputError& error) {
    cell.outcome = StabilityOutcome::refused;
    cell.message = error.what();
    return cell;
  } catch (const std::invalid_argument& error) {
    cell.outcome = StabilityOutcome::refused;
    cell.message = error.what();
    return cell;
  }
  bool stopped = false;
  const scene::Progress watch = [&](double share) {
    stopped = stopped || (progress && !progress(share));
    return !stopped;
  };
  const RunData data = run(scene, options.cpuLimit_s, true, watch);
  cell.outcome = data.outcome;
  cell.message = data.message;
  cell.cpu_s = data.cpu_s;
  cell.evaluations = data.evaluations;
  if (stopped || data.outcome != StabilityOutcome::ok) return cell;
  cell.energyKnown = data.balance.known;
  cell.energyError = std::max(0.0, data.balance.imbalance() - data.balance.quadrature());

  RunData reference;
  try {
    const scene::Scene tight = axis.makeReference ? axis.makeReference(value) : makeDefaultReference(scene, axis.referenceSteps);
    reference = run(tight, kReferenceCost * options.cpuLimit_s, false, watch);
  } catch (const InputError& error) {
    reference.outcome = StabilityOutcome::refused;
    reference.message = error.what();
  }
  const StabilityLimits& limits = options.limits;
  std::ostringstream reason;
  reason.precision(3);
  const auto judge = [&](bool beyond, const char* what, double error, const char* unit, double limit) {
    if (!beyond) return;
    cell.outcome = cell.message.empty() ? StabilityOutcome::wrong : StabilityOutcome::warned;
    reason << (reason.tellp() > 0 ? ", " : "") << what << " " << error << unit << " (limit " << limit << unit << ")";
  };
  if (reference.outcome == StabilityOutcome::ok && reference.q.size() == data.q.size()) {
    compare(scene, reference, data, cell);
    judge(!(cell.poseError_m <= limits.pose_m), "pose error", 1e3 * cell.poseError_m, " mm", 1e3 * limits.pose_m);
    judge(!(cell.forceError <= limits.force), "force error", 100 * cell.forceError, " %", 100 * limits.force);
  } else {
    cell.outcome = StabilityOutcome::unchecked;
    reason << "the reference: " << reference.message;
  }
  if (cell.energyKnown) judge(!(cell.energyError <= limits.energy), "energy", 100 * cell.energyError, " %", 100 * limits.energy);
  cell.reason = reason.str();
  return cell;
}

StabilityRow runStabilityAxis(const StabilityAxis& axis, const StabilityOptions& options, const scene::Progress& progress) {
  StabilityRow row{axis.name, axis.scene, axis.unit, {}, {}};
  // Bisections are not known beforehand: counted as two, and the share only grows.
  const double expected = static_cast<double>(axis.values.size()) + 2.0 * options.maxBisections;
  double done = 0;
  bool stopped = false;
  const scene::Progress part = [&](double) {
    stopped = stopped || (progress && !progress(std::min(1.0, done / expected)));
    return !stopped;
  };
  for (const double value : axis.values) {
    if (!part(0)) return row;
    StabilityCell cell = runStabilityCell(axis, value, options, part);
    if (stopped) return row;
    row.cells.push_back(std::move(cell));
    done += 1;
  }
  const auto isGood = [](const StabilityCell& cell) { return cell.outcome == StabilityOutcome::ok; };
  const std::vector<StabilityCell> given = row.cells;
  for (size_t i = 1; i < given.size(); ++i) {
    if (isGood(given[i - 1]) == isGood(given[i])) continue;
    StabilityCell good = isGood(given[i]) ? given[i] : given[i - 1], bad = isGood(given[i]) ? given[i - 1] : given[i];
    for (int k = 0; k < options.maxBisections; ++k) {
      const double low = std::min(good.value, bad.value), high = std::max(good.value, bad.value);
      if (axis.isNarrow(low, high, options.ratio)) break;
      const double value = axis.middle(low, high);
      if (!(value > low && value < high)) break;
      StabilityCell cell = runStabilityCell(axis, value, options, part);
      if (stopped) return row;
      cell.bisected = true;
      (isGood(cell) ? good : bad) = cell;
      row.cells.push_back(std::move(cell));
      done += 1;
    }
    row.boundaries.push_back({good.value, bad.value, bad.outcome, bad.reason.empty() ? bad.message : bad.reason + (bad.message.empty() ? "" : "; " + bad.message)});
  }
  std::stable_sort(row.cells.begin(), row.cells.end(), [](const auto& a, const auto& b) { return a.value < b.value; });
  return row;
}

DriftResult runDrift(const DriftCase& drift, const scene::Progress& progress) {
  constexpr double kWarmUp = 0.05;  // of the run: memory grows until then
  DriftResult result;
  result.name = drift.name;
  bool stopped = false;
  const scene::Progress watch = [&](double share) {
    if (share >= kWarmUp && result.memoryStart_MB == 0) result.memoryStart_MB = calcResidentMemory_MB();
    stopped = stopped || (progress && !progress(share));
    return !stopped;
  };
  try {
    KneeSystem knee(drift.scene);
    const GaitResult run = runGait(knee, drift.scene, watch);
    result.memoryEnd_MB = calcResidentMemory_MB();
    result.cpu_s = run.cpuTime_s;
    result.steps = run.statistics.stepsTaken;
    if (!run.complete) result.problem = run.statusText;
    const EnergyBalance balance = calcEnergyBalance(drift.scene, run);
    if (!balance.known) {
      result.problem += std::string(result.problem.empty() ? "" : "; ") + "the energy of this scene is not known";
      return result;
    }
    result.scale_J = balance.scale_J;
    for (size_t i = 0; i < run.frames.size(); ++i) {
      result.time_s.push_back(run.frames[i].time_s);
      result.share.push_back(balance.scale_J > 0 ? (balance.energy_J[i] - balance.work_J[i]) / balance.scale_J : 0);
      result.largest = std::max(result.largest, std::abs(result.share.back()));
    }
    if (!result.share.empty()) result.atEnd = result.share.back();
  } catch (const ComputationError& error) {
    result.problem = error.what();
  } catch (const InputError& error) {
    result.problem = error.what();
  }
  return result;
}

Stability measureStability(const std::vector<StabilityAxis>& axes, const std::vector<DriftCase>& drifts, const StabilityOptions& options,
                           const scene::Progress& progress) {
  // A long run counts for some axes.
  constexpr double kDriftShare = 3;
  const double total = static_cast<double>(axes.size()) + kDriftShare * static_cast<double>(drifts.size());
  Stability result;
  double done = 0, weight = 1;
  bool stopped = false;
  const scene::Progress part = [&](double share) {
    stopped = stopped || (progress && !progress((done + weight * share) / total));
    return !stopped;
  };
  for (const StabilityAxis& axis : axes) {
    StabilityRow row = runStabilityAxis(axis, options, part);
    if (!row.cells.empty()) result.rows.push_back(std::move(row));
    if (stopped) return result;
    done += 1;
  }
  weight = kDriftShare;
  for (const DriftCase& drift : drifts) {
    DriftResult one = runDrift(drift, part);
    if (stopped) return result;
    result.drifts.push_back(std::move(one));
    done += kDriftShare;
  }
  result.complete = true;
  return result;
}

double calcResidentMemory_MB() {
  std::ifstream file("/proc/self/statm");
  long size = 0, resident = 0;
  if (!(file >> size >> resident)) return 0;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1024.0 * 1024.0);
}

}  // namespace genu::model
