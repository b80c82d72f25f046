#include "genu/model/Stability.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "Conversions.h"
#include "RunComparison.h"
#include "StaticAnalysis.h"
#include "genu/model/CutOff.h"
#include "genu/model/KneeSystem.h"
#include "genu/scene/SceneFile.h"

namespace genu::model {

namespace {

using contact::EvaluationStatus;

/** What is compared, of a run that completed; or why it did not. */
struct RunData {
  StabilityOutcome outcome = StabilityOutcome::ok;
  std::string message;
  double cpu_s = 0;
  long evaluations = 0;
  std::vector<scene::Frame> frames;
  EnergyBalance balance;
};

/** What the program warns of after a run that completed. */
std::string listRemarks(const KneeSystem& knee, const std::vector<scene::Frame>& frames) {
  int extrapolated = 0, border = 0, missing = 0;
  for (const scene::Frame& frame : frames) {
    for (const contact::ContactResult& contact : frame.contacts) {
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
    if (scene.gait) {
      GaitResult result = runGait(knee, scene, limited);
      data.cpu_s = result.cpuTime_s;
      data.evaluations = result.statistics.contactEvaluations;
      if (result.complete) {
        data.message = listRemarks(knee, result.frames);
        if (remarks) {
          addCutOffs(scene, result.frames, data.message);
          for (const std::string& remark : result.remarks) data.message = remark + (data.message.empty() ? "" : "; " + data.message);
        }
        data.balance = calcEnergyBalance(scene, result);
        data.frames = std::move(result.frames);
      } else {
        data.outcome = StabilityOutcome::failed;
        data.message = result.statusText;
      }
    } else {
      const StaticResult result = runStatic(knee, scene, limited);
      data.cpu_s = result.cpuTime_s;
      data.evaluations = result.contactEvaluations;
      if (result.status == StaticResult::Status::converged) {
        scene::Frame& frame = data.frames.emplace_back();
        frame.time_s = result.time_s;
        frame.q = result.q;
        frame.contacts = result.contacts;
        data.message = listRemarks(knee, data.frames);
        if (remarks) addCutOffs(scene, data.frames, data.message);
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

}  // namespace

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
  if (reference.outcome == StabilityOutcome::ok && reference.frames.size() == data.frames.size()) {
    const RunDifference difference = compareRuns(scene, reference.frames, data.frames);
    cell.poseError_m = difference.pose_m;
    cell.forceError = difference.force;
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
