#include "genu/scene/Scene.h"

namespace genu::scene {

std::string Scene::where(const std::string& keyPath) const {
  // "loads.axial.point.at": if that key is absent, the line of loads.axial.point, and so on upward.
  for (std::string parent = keyPath;; parent.erase(parent.find_last_of('.'))) {
    const auto found = keyLines.find(parent);
    if (found != keyLines.end()) return file.string() + ":" + std::to_string(found->second) + ": " + keyPath;
    if (parent.find('.') == std::string::npos) return file.string() + ": " + keyPath;
  }
}

}  // namespace genu::scene
