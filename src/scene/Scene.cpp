#include "genu/scene/Scene.h"

#include "genu/contact/Types.h"

namespace genu::scene {

double CoordinateInfo::unitsPerSi() const { return isAngle ? 180 / contact::kPi : 1e3; }

std::vector<CoordinateInfo> listCoordinates(const ModelSpec& model) {
  const bool only = model.joints.empty();
  const std::vector<JointSpec> joints = only ? std::vector<JointSpec>{{model.joint, JointSpec::Kind::floating}} : model.joints;
  std::vector<CoordinateInfo> result;
  for (const JointSpec& joint : joints) {
    for (int axis = 0; axis < joint.numCoordinates(); ++axis) {
      CoordinateInfo info;
      const bool floating = joint.kind == JointSpec::Kind::floating;
      info.joint = joint.name;
      info.axis = axis;
      info.isAngle = floating ? axis < 3 : joint.kind == JointSpec::Kind::rotation;
      info.shortName = floating ? kCoordinateNames[static_cast<size_t>(axis)] : info.isAngle ? "angle" : "translation";
      info.name = only ? info.shortName : joint.name + "." + info.shortName;
      const size_t index = result.size();
      info.isFree = index < model.coordinates.size() && std::holds_alternative<FreeCoordinate>(model.coordinates[index]);
      result.push_back(std::move(info));
    }
  }
  return result;
}

bool LoadSpec::hasMoment() const {
  for (const TimeFunction& component : moment_Nm) {
    const auto* constant = std::get_if<double>(&component);
    if (constant == nullptr || *constant != 0) return true;
  }
  return false;
}

std::string Scene::where(const std::string& keyPath) const {
  // "loads.axial.point.at": if that key is absent, the line of loads.axial.point, and so on upward.
  for (std::string parent = keyPath;; parent.erase(parent.find_last_of('.'))) {
    const auto found = keyLines.find(parent);
    if (found != keyLines.end()) return file.string() + ":" + std::to_string(found->second) + ": " + keyPath;
    if (parent.find('.') == std::string::npos) return file.string() + ": " + keyPath;
  }
}

}  // namespace genu::scene
