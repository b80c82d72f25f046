#include "genu/model/Experiments.h"

#include <algorithm>
#include <cmath>

#include "genu/io/Suggest.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {

KneeExperimentResult runKneeExperiment(const scene::Scene& given, const KneeExperiment& experiment, const scene::Progress& progress) {
  constexpr int kFlexion = 2;
  if (!given.model) throw InputError(given.file.string() + ": an experiment needs a model");
  const std::vector<scene::CoordinateInfo> coordinates = given.coordinates();
  std::vector<std::string> joints;
  size_t first = coordinates.size();
  for (size_t i = 0; i < coordinates.size(); ++i) {
    if (coordinates[i].shortName != "rx") continue;
    joints.push_back(coordinates[i].joint);
    if (coordinates[i].joint == experiment.joint) first = i;
  }
  if (first == coordinates.size()) {
    throw InputError(given.file.string() + ": " + io::describeUnknown("floating joint", experiment.joint, joints));
  }
  if (experiment.loadedAxis == kFlexion || experiment.loadedAxis > 5) throw InputError("experiment: flexion is held; the load acts on another coordinate");
  if (!(experiment.flexion_rad >= 0 && experiment.flexion_rad < contact::kPi) || !(experiment.flexionStep_rad > 0)) {
    throw InputError("experiment: flexion is " + std::to_string(experiment.flexion_rad * 180 / contact::kPi) + " deg; allowed: 0 to 180 deg");
  }
  if (!std::isfinite(experiment.load) || experiment.loadSteps < 1) throw InputError("experiment: load and number of steps must be finite and positive");

  KneeExperimentResult result;
  const bool loaded = experiment.loadedAxis >= 0;
  const int bends = static_cast<int>(std::ceil(experiment.flexion_rad / experiment.flexionStep_rad - 1e-9));
  for (int i = 0; i <= bends; ++i) result.flexion_rad.push_back(bends == 0 ? 0 : experiment.flexion_rad * i / bends), result.load.push_back(0);
  result.firstLoaded = static_cast<size_t>(bends);
  for (int i = 1; loaded && i <= experiment.loadSteps; ++i) {
    result.flexion_rad.push_back(experiment.flexion_rad);
    result.load.push_back(experiment.load * i / experiment.loadSteps);
  }

  // Only the values at the steps matter, and there the curves through the tables pass.
  scene::Scene scene = given;
  scene::TimeSeries flexion, load;
  flexion.source = "flexion of the experiment";
  load.source = "load of the experiment";
  const size_t n = result.flexion_rad.size();
  for (size_t i = 0; i < std::max<size_t>(n, 2); ++i) {
    for (scene::TimeSeries* series : {&flexion, &load}) series->time_s.push_back(static_cast<double>(i));
    flexion.value.push_back(-result.flexion_rad[std::min(i, n - 1)]);
    load.value.push_back(result.load[std::min(i, n - 1)]);
  }
  scene.model->coordinates[first + kFlexion] = scene::PrescribedCoordinate{flexion};
  if (loaded) {
    const size_t axis = first + static_cast<size_t>(experiment.loadedAxis);
    if (!coordinates[axis].isFree) throw InputError(given.file.string() + ": coordinate " + coordinates[axis].name + " is prescribed; the experiment loads it");
    scene.generalizedLoads.push_back({"experiment", static_cast<int>(axis), load});
  }
  scene.series = scene::SeriesSpec{static_cast<double>(n - 1), 1.0};
  if (n == 1) scene.series->duration_s = 1e-9;  // one equilibrium, twice
  KneeSystem knee(scene);
  for (const std::string& table : knee.listTables()) {
    if (table.rfind(flexion.source, 0) == 0 || table.rfind(load.source, 0) == 0) continue;
    throw InputError(given.file.string() + ": an experiment has no time, but the scene has a table over time: " + table + "; give a constant there");
  }
  result.trajectory = runSeries(knee, scene, progress);
  if (n == 1 && result.trajectory.frames.size() > 1) result.trajectory.frames.pop_back();
  const size_t done = result.trajectory.frames.size();
  result.flexion_rad.resize(done);
  result.load.resize(done);
  return result;
}

scene::Scene withoutElements(const scene::Scene& scene, const std::string& prefix) {
  scene::Scene result = scene;
  auto& elements = result.elements;
  const auto begins = [&prefix](const auto& element) { return element->name.rfind(prefix, 0) == 0; };
  const auto kept = std::remove_if(elements.begin(), elements.end(), begins);
  if (prefix.empty() || kept == elements.end()) {
    std::vector<std::string> names;
    for (const auto& element : scene.elements) names.push_back(element->name);
    throw InputError(scene.file.string() + ": no force element's name begins with \"" + prefix + "\"; known: " + io::joinNames(names));
  }
  elements.erase(kept, elements.end());
  return result;
}

}  // namespace genu::model
