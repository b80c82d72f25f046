#include "genu/model/Verification.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "genu/model/Analysis.h"
#include "genu/model/OdeIntegrator.h"

namespace genu::model {

namespace {

/** What is compared. */
struct Outcome {
  std::string problem;
  double cpu_s = 0, peakMemory_MB = 0;
  long evaluations = 0, steps = 0;
  std::vector<scene::Coordinates> q;
  std::vector<std::vector<double>> force_N;  ///< of all compartments
};

/** Linux forgets the peak so far when asked; elsewhere, and where it may not be asked, the peak stays unknown. */
class MemoryPeak {
 public:
  MemoryPeak() {
#ifdef __GLIBC__
    malloc_trim(0);  // what earlier runs freed is no part of this one
#endif
    std::ofstream file("/proc/self/clear_refs");
    file << 5;
    file.flush();
    reset_ = file.good();
  }
  double read_MB() const {
    if (!reset_) return 0;
    std::ifstream file("/proc/self/status");
    for (std::string line; std::getline(file, line);) {
      if (line.compare(0, 6, "VmHWM:") == 0) return std::stod(line.substr(6)) / 1024;
    }
    return 0;
  }

 private:
  bool reset_ = false;
};

std::vector<double> listForces(const std::vector<contact::ContactResult>& contacts) {
  std::vector<double> forces;
  for (const contact::ContactResult& contact : contacts) {
    for (const contact::NetLoad& load : contact.compartments) forces.push_back(load.scalarForce_N);
  }
  return forces;
}

scene::Scene apply(const scene::Scene& given, const VerifySetting& setting) {
  scene::Scene scene = given;
  for (scene::ContactSpec& contact : scene.contacts) {
    contact.definition.rule = setting.rule;
    contact.definition.distance = setting.distance;
    contact.definition.strain = setting.strain;
    for (contact::CompartmentDefinition& part : contact.definition.compartments) {
      part.nx = std::max(2, static_cast<int>(std::lround(part.nx * setting.factorX)));
      part.nz = std::max(2, static_cast<int>(std::lround(part.nz * setting.factorZ)));
    }
  }
  if (scene.staticAnalysis) scene.staticAnalysis->search.reset();
  if (scene.gait) {
    scene.gait->integrator = setting.integrator;
    if (setting.accuracy > 0) {
      // Tolerances of the scene's own follow.
      const double factor = setting.accuracy / given.gait->accuracy;
      scene::GaitSpec::Tolerances& own = scene.gait->tolerances;
      for (std::optional<double>* tolerance : {&own.translation_m, &own.angle_rad, &own.speed_mPerS, &own.angularSpeed_radPerS}) {
        if (*tolerance) **tolerance *= factor;
      }
      if (findOdeIntegrator(setting.integrator, "verify").ratesOnly) own.translation_m.reset(), own.angle_rad.reset();
      scene.gait->accuracy = setting.accuracy;
    }
    scene.gait->step_s = setting.step_s;
    scene.gait->maxOrder = setting.maxOrder;
    scene.gait->errorEstimate = false;
    scene.gait->prescribed = setting.constraints ? scene::GaitSpec::Prescribed::constraints : scene::GaitSpec::Prescribed::automatic;
  }
  return scene;
}

Outcome run(const scene::Scene& given, const VerifySetting& setting, const scene::Progress& progress) {
  Outcome outcome;
  const MemoryPeak memory;
  try {
    const scene::Scene scene = apply(given, setting);
    if (scene.gait) {
      const GaitResult result = runGait(scene, progress);
      if (!result.complete) outcome.problem = result.statusText;
      outcome.cpu_s = result.cpuTime_s;
      outcome.evaluations = result.statistics.contactEvaluations;
      outcome.steps = result.statistics.stepsTaken;
      for (const scene::Frame& frame : result.frames) {
        outcome.q.push_back(frame.q);
        outcome.force_N.push_back(listForces(frame.contacts));
      }
    } else {
      const StaticResult result = runStatic(scene, progress);
      if (result.status != StaticResult::Status::converged) outcome.problem = result.statusText;
      outcome.cpu_s = result.cpuTime_s;
      outcome.evaluations = result.contactEvaluations;
      outcome.steps = result.iterations;
      outcome.q.push_back(result.q);
      outcome.force_N.push_back(listForces(result.contacts));
    }
  } catch (const ComputationError& error) {
    outcome.problem = error.what();
  } catch (const InputError& error) {  // what the scene has does not go with this setting
    outcome.problem = error.what();
  } catch (const std::invalid_argument& error) {  // a grid too coarse to have an element
    outcome.problem = error.what();
  }
  outcome.peakMemory_MB = memory.read_MB();
  return outcome;
}

void compare(const scene::Scene& scene, const Outcome& reference, const Outcome& outcome, VerifyRow& row) {
  row.problem = outcome.problem;
  row.cpu_s = outcome.cpu_s;
  row.evaluations = outcome.evaluations;
  row.steps = outcome.steps;
  row.peakMemory_MB = outcome.peakMemory_MB;
  if (!row.problem.empty()) return;
  const auto coordinates = scene.coordinates();
  for (size_t k = 0; k < coordinates.size(); ++k) {
    if (!coordinates[k].isFree) continue;
    const double scale = coordinates[k].isAngle ? kAngleLength_m : 1.0;
    double largest = 0;
    for (size_t i = 0; i < reference.q.size(); ++i) largest = std::max(largest, scale * std::abs(outcome.q[i][k] - reference.q[i][k]));
    row.coordinateErrors_m.push_back(largest);
    row.poseError_m = std::max(row.poseError_m, largest);
  }
  for (size_t i = 0; i < reference.q.size(); ++i) {
    for (size_t k = 0; k < reference.force_N[i].size(); ++k) {
      row.forceError_N = std::max(row.forceError_N, std::abs(outcome.force_N[i][k] - reference.force_N[i][k]));
    }
  }
}

void markFronts(std::vector<VerifyRow>& rows) {
  const auto mark = [&](double VerifyRow::*error, bool VerifyRow::*flag) {
    for (VerifyRow& row : rows) {
      row.*flag = row.problem.empty() && row.setting.group != "law" && std::none_of(rows.begin(), rows.end(), [&](const VerifyRow& other) {
                    return other.problem.empty() && other.cpu_s <= row.cpu_s && other.*error <= row.*error &&
                           (other.cpu_s < row.cpu_s || other.*error < row.*error);
                  });
    }
  };
  mark(&VerifyRow::poseError_m, &VerifyRow::onFrontPose);
  mark(&VerifyRow::forceError_N, &VerifyRow::onFrontForce);
}

/** The scene's own settings. */
VerifySetting takeFrom(const scene::Scene& scene) {
  VerifySetting setting;
  setting.group = "scene";
  setting.rule = scene.contacts.front().definition.rule;
  setting.distance = scene.contacts.front().definition.distance;
  setting.strain = scene.contacts.front().definition.strain;
  if (scene.gait) {
    setting.integrator = chooseIntegrator(scene.gait->integrator);
    setting.accuracy = scene.gait->accuracy;
    setting.step_s = scene.gait->step_s;
    setting.maxOrder = scene.gait->maxOrder;
    setting.constraints = scene.gait->prescribed == scene::GaitSpec::Prescribed::constraints;
  }
  return setting;
}

}  // namespace

std::string VerifySetting::describe() const {
  std::ostringstream text;
  if (!integrator.empty()) {
    text << integrator;
    if (step_s > 0) {
      text << " " << 1e3 * step_s << " ms";
    } else if (accuracy > 0) {
      text << " " << accuracy;
    }
    if (maxOrder > 0) text << ", order " << maxOrder;
    text << ", ";
  }
  if (factorX == factorZ) {
    text << "grid x " << factorX;
  } else {
    text << "grid x " << factorX << " along x, " << factorZ << " along z";
  }
  if (rule == contact::ContactRule::centre) text << ", centre rule";
  if (distance == contact::DistanceMethod::ray) text << ", ray";
  if (constraints) text << ", constraints";
  if (group == "law") text << (strain == contact::StrainMeasure::large ? ", large strain" : ", small strain");
  return text.str();
}

std::vector<VerifySetting> listVerifySettings(const scene::Scene& scene, const VerifyOptions& options) {
  if (!scene.model) throw InputError(scene.file.string() + ": verify needs a model: without one nothing is run");
  if (scene.contacts.empty()) throw InputError(scene.file.string() + ": verify needs contact: there is no grid to vary");
  const VerifySetting own = takeFrom(scene);
  std::vector<VerifySetting> settings = {own};
  const auto add = [&](const char* group, auto&& change) {
    VerifySetting setting = own;
    setting.group = group;
    change(setting);
    settings.push_back(setting);
  };
  const auto useIntegrator = [](VerifySetting& s, const std::string& name, double accuracy, double step_s) {
    s.integrator = name;
    s.accuracy = accuracy;
    s.step_s = step_s;
    s.maxOrder = 0;
    s.constraints = false;
  };
  if (scene.gait) {
    for (const OdeIntegratorKind& kind : listOdeIntegrators()) {
      const bool explicitOne = kind.equations == OdeIntegratorKind::Equations::none;
      const bool slow = explicitOne || kind.name == "implicit-euler" || kind.name == "arkode-dirk" || kind.name == "ida";
      if (slow && !options.full) continue;
      const bool fixedStep = kind.step == OdeIntegratorKind::Step::fixed;
      // In a cycle of one second; the motion of another one is as much slower.
      const double span = scene.gait->duration_s;
      const std::vector<double> values = fixedStep ? (options.full ? std::vector<double>{0.5e-3, 1e-3, 2e-3, 4e-3, 5e-3, 10e-3}
                                                                                 : std::vector<double>{1e-3, 2e-3, 5e-3})
                                         : explicitOne ? std::vector<double>{1e-4, 1e-5}
                                                                 : (options.full ? std::vector<double>{1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6}
                                                                                 : std::vector<double>{3e-4, 1e-4, 1e-5});
      for (const double value : values) {
        add("integrator", [&](VerifySetting& s) { useIntegrator(s, kind.name, fixedStep ? 0 : value, fixedStep ? value * span : 0); });
      }
      if (options.full && kind.unknowns == OdeIntegratorKind::Unknowns::both) {
        add("constraints", [&](VerifySetting& s) {
          useIntegrator(s, kind.name, scene.gait->accuracy, 0);
          s.constraints = true;
        });
      }
    }
  }
  const std::vector<double> factors = options.full ? std::vector<double>{0.33, 0.5, 0.67, 1, 1.5, 2} : std::vector<double>{0.5, 1, 1.5};
  for (const auto rule : {contact::ContactRule::smooth, contact::ContactRule::centre}) {
    for (const double factor : factors) {
      add("grid", [&](VerifySetting& s) { s.rule = rule, s.factorX = s.factorZ = factor; });
    }
  }
  if (scene.gait) {
    // A structural method on coarse grids: what is cheap of both.
    for (const double factor : options.full ? std::vector<double>{0.33, 0.5, 0.67} : std::vector<double>{0.5}) {
      for (const double step : {2e-3, 5e-3}) {
        add("combined", [&](VerifySetting& s) {
          useIntegrator(s, "generalized-alpha", 0, step * scene.gait->duration_s);
          s.factorX = s.factorZ = factor;
        });
      }
    }
  }
  if (options.full) {
    for (const double factor : {0.33, 0.5, 0.67, 1.5, 2.0}) {
      add("grid x", [&](VerifySetting& s) { s.factorX = factor; });
      add("grid z", [&](VerifySetting& s) { s.factorZ = factor; });
    }
  }
  add("law", [&](VerifySetting& s) {
    s.strain = s.strain == contact::StrainMeasure::large ? contact::StrainMeasure::small : contact::StrainMeasure::large;
  });
  add("distance", [&](VerifySetting& s) {
    s.distance = s.distance == contact::DistanceMethod::ray ? contact::DistanceMethod::minimum : contact::DistanceMethod::ray;
  });
  return settings;
}

Verification verify(const scene::Scene& scene, const VerifyOptions& options, const scene::Progress& progress) {
  const std::vector<VerifySetting> settings = listVerifySettings(scene, options);
  if (scene.gait) chooseGaitMethod(scene);
  checkStaticMethod(scene, scene.staticAnalysis.value_or(scene::StaticSpec{}));
  Verification result;
  result.reference = takeFrom(scene);
  result.reference.group = "reference";
  result.reference.rule = contact::ContactRule::smooth;
  const double finest = options.full ? 2 : 1.5;
  result.reference.factorX = result.reference.factorZ = 2 * finest;
  if (scene.gait) {
    result.reference.integrator = "cpodes";
    result.reference.step_s = 0;
    result.reference.maxOrder = 0;
    result.reference.constraints = false;
    result.reference.accuracy = std::max(1e-12, scene.gait->accuracy * 1e-2);
  }
  // Settings differ in cost; the reference counts for a few of them.
  constexpr double kReferenceShare = 4;
  const double total = 2 * kReferenceShare + static_cast<double>(settings.size());
  bool stopped = false;
  double done = 0;
  const scene::Progress part = [&](double share) {
    stopped = stopped || (progress && !progress((done + share) / total));
    return !stopped;
  };
  const scene::Progress referencePart = [&](double share) { return part(kReferenceShare * share); };
  const Outcome reference = run(scene, result.reference, referencePart);
  if (stopped) return result;
  if (!reference.problem.empty()) throw ComputationError(scene.file.string() + ": verify: the reference failed: " + reference.problem);
  result.referenceCpu_s = reference.cpu_s;
  done = kReferenceShare;
  VerifySetting ofOtherLaw = result.reference;
  ofOtherLaw.strain = ofOtherLaw.strain == contact::StrainMeasure::large ? contact::StrainMeasure::small : contact::StrainMeasure::large;
  const Outcome otherReference = run(scene, ofOtherLaw, referencePart);
  if (stopped) return result;
  done = 2 * kReferenceShare;
  for (const VerifySetting& setting : settings) {
    VerifyRow row;
    row.setting = setting;
    Outcome outcome = run(scene, setting, part);
    // Noise of the machine matters less to a run of a second.
    for (int repeat = 1; repeat < options.repeats && outcome.problem.empty() && outcome.cpu_s < 1 && !stopped; ++repeat) {
      outcome.cpu_s = std::min(outcome.cpu_s, run(scene, setting, part).cpu_s);
    }
    if (stopped) return result;
    const bool otherLaw = setting.strain != result.reference.strain;
    if (otherLaw && !otherReference.problem.empty() && outcome.problem.empty()) outcome.problem = "its reference failed: " + otherReference.problem;
    compare(scene, otherLaw ? otherReference : reference, outcome, row);
    result.rows.push_back(row);
    markFronts(result.rows);
    done += 1;
  }
  for (size_t i = 0; i < result.rows.size(); ++i) {
    const VerifyRow& row = result.rows[i];
    if (!row.problem.empty() || row.setting.group == "law" || row.poseError_m > options.poseError_m || row.forceError_N > options.forceError_N) continue;
    if (result.recommended < 0 || row.cpu_s < result.rows[static_cast<size_t>(result.recommended)].cpu_s) result.recommended = static_cast<int>(i);
  }
  if (result.recommended >= 0) {
    result.confirmed.setting = result.rows[static_cast<size_t>(result.recommended)].setting;
    compare(scene, reference, run(scene, result.confirmed.setting, part), result.confirmed);
    if (stopped) return result;
  }
  result.complete = true;
  return result;
}

}  // namespace genu::model
