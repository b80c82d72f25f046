#include <chrono>
#include <cmath>

#include "StaticAnalysis.h"
#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"
#include "genu/model/UrdfModel.h"

namespace genu::model {

scene::Trajectory replay(const std::vector<double>& time_s, const std::vector<scene::Coordinates>& q,
                         const scene::Scene& scene, const scene::Progress& progress, bool estimateErrors,
                         const contact::TaskRunner* runner) {
  const auto wallStart = std::chrono::steady_clock::now();
  const double cpuStart = cpuTime_s();
  if (time_s.size() != q.size()) {
    throw InputError("replay: " + std::to_string(time_s.size()) + " times but " + std::to_string(q.size()) + " poses");
  }
  const size_t numCoordinates = scene.coordinates().size();
  for (size_t i = 0; i < q.size(); ++i) {
    bool finite = std::isfinite(time_s[i]);
    for (double value : q[i]) finite = finite && std::isfinite(value);
    if (q[i].size() != numCoordinates) {
      throw InputError("replay: frame " + std::to_string(i + 1) + " has " + std::to_string(q[i].size()) + " coordinates; the scene has " +
                       std::to_string(numCoordinates));
    }
    if (!finite) throw InputError("replay: frame " + std::to_string(i + 1) + " has a value that is not finite");
  }

  std::vector<ContactFrames> frames;
  if (scene.model) {
    const UrdfModel urdf = readUrdf(*scene.model);
    for (const scene::ContactSpec& contact : scene.contacts) frames.push_back(findContactFrames(urdf, contact));
  } else {
    for (const scene::ContactSpec& contact : scene.contacts) {
      if (contact.fixedBody.empty() && contact.movingBody.empty()) continue;
      throw InputError(scene.file.string() + ": contact '" + contact.name +
                       "' names a link, but the scene has no model section");
    }
  }

  const auto pairs = scene::makeContactPairs(scene);
  std::vector<contact::ContactWorkspace> workspaces;
  std::vector<contact::ErrorEstimator> estimators;
  for (const auto& pair : pairs) {
    workspaces.emplace_back(*pair).setTaskRunner(runner);
    if (estimateErrors) estimators.emplace_back(*pair);
  }

  scene::Trajectory result;
  result.statistics.name = "replay";
  result.frames.reserve(q.size());
  for (size_t i = 0; i < q.size(); ++i) {
    if (progress && !progress(static_cast<double>(i) / static_cast<double>(q.size()))) {
      result.statusText = "interrupted at frame " + std::to_string(i + 1) + " of " + std::to_string(q.size());
      break;
    }
    scene::Frame& frame = result.frames.emplace_back();
    frame.time_s = time_s[i];
    frame.q = q[i];
    frame.constraintForce.assign(numCoordinates, 0.0);
    frame.contacts.resize(pairs.size());
    frame.errors.resize(estimators.size());
    for (size_t k = 0; k < pairs.size(); ++k) {
      const contact::Pose X = frames.empty() ? contact::calcPose(scene::takeSix(q[i])) : frames[k].calcPose(q[i]);
      pairs[k]->evaluate(X, workspaces[k], {true}, frame.contacts[k]);
      if (estimateErrors) estimators[k].evaluate(workspaces[k], frame.errors[k]);
      ++result.statistics.contactEvaluations;
      result.statistics.contactCopies += frame.contacts[k].copied ? 1 : 0;
      result.statistics.distanceQueries += frame.contacts[k].distanceQueries;
    }
  }
  result.complete = result.frames.size() == q.size();
  if (result.complete) result.statusText = "complete";
  result.wallTime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wallStart).count();
  result.cpuTime_s = cpuTime_s() - cpuStart;
  return result;
}

}  // namespace genu::model
