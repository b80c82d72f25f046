#pragma once

#include <string>

#include "KneeFixtures.h"
#include "genu/model/KneeSystem.h"
#include "genu/scene/SceneFile.h"

namespace genu::model::testing_support {

/** pelvis (ground) -hip, about z- femur -knee, floating- tibia -ankle, along x- foot. */
inline std::string legUrdf() {
  const auto link = [](const std::string& name, const std::string& center, double mass) {
    return "<link name='" + name + "'><inertial><origin xyz='" + center + "'/><mass value='" + std::to_string(mass) +
           "'/><inertia ixx='0.05' ixy='0.002' ixz='0' iyy='0.02' iyz='0.001' izz='0.05'/></inertial></link>\n";
  };
  return "<robot name='leg'>\n<link name='pelvis'/>\n" + link("femur", "0.01 -0.2 0.02", 4) + link("tibia", "0 -0.15 0.01", 3) +
         link("foot", "0.05 -0.03 0", 1) +
         "<joint name='hip' type='continuous'><parent link='pelvis'/><child link='femur'/><origin xyz='0.02 0.1 0' rpy='0.1 0 0'/>"
         "<axis xyz='0 0.6 0.8'/></joint>\n"
         "<joint name='knee' type='floating'><parent link='femur'/><child link='tibia'/><origin xyz='0 -0.4 0' rpy='0 0.2 0'/></joint>\n"
         "<joint name='ankle' type='prismatic'><parent link='tibia'/><child link='foot'/><origin xyz='0 -0.4 0' rpy='0 0 0.3'/>"
         "<axis xyz='1 0 0'/><limit effort='1' velocity='1'/></joint>\n</robot>\n";
}

/** A model section; `hip`, `knee` (of all six) and `ankle` as in a scene. */
inline std::string legModel(const std::filesystem::path& urdf, const std::string& hip = "free", const std::string& knee = "free",
                            const std::string& ankle = "free") {
  std::string text = "genu: 1\nmodel:\n  urdf: " + urdf.string() + "\n  joints:\n    hip: {angle: " + hip + "}\n    knee: {";
  for (const char* name : scene::kCoordinateNames) text += std::string(name) + ": " + knee + ", ";
  return text + "}\n    ankle: {translation: " + ankle + "}\n";
}

/** A body that slides along y above the ground, 2 kg, origin at its center. */
inline std::string liftUrdf() {
  return "<robot name='lift'><link name='ground'/><link name='body'><inertial><mass value='2'/><inertia ixx='0.01' ixy='0' ixz='0' "
         "iyy='0.01' iyz='0' izz='0.01'/></inertial></link>\n<joint name='lift' type='prismatic'><parent link='ground'/>"
         "<child link='body'/><axis xyz='0 1 0'/><limit effort='1' velocity='1'/></joint></robot>\n";
}
inline std::string liftModel(const std::filesystem::path& urdf, const std::string& translation = "free") {
  return "genu: 1\nmodel:\n  urdf: " + urdf.string() +
         "\n  gravity: 0 m/s^2, -10 m/s^2, 0 m/s^2\n  joints: {lift: {translation: " + translation + "}}\n";
}

/** Value of "element.quantity_unit". */
inline double valueOf(const std::vector<scene::ElementColumn>& columns, const std::vector<double>& values, const std::string& label) {
  for (size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].label() == label) return values[i];
  }
  ADD_FAILURE() << "no column " << label;
  return std::nan("");
}

}  // namespace genu::model::testing_support
