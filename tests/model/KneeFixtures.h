#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "TemporaryFile.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/scene/Scene.h"

namespace genu::model::testing_support {

inline constexpr double kDegree = contact::kPi / 180;

/** Coordinates by name, in the order of contact::JointCoordinates. */
enum Coordinate { rx, ry, rz, x, y, z };

/** Two links, tibia and femur; `jointOrigin` places F in the tibia link. */
inline std::string kneeUrdf(double mass_kg = 3.0, const std::string& jointOrigin = "xyz='0 0 0' rpy='0 0 0'",
                            const std::string& inertialOrigin = "xyz='0 0.05 0' rpy='0 0 0'") {
  return "<?xml version='1.0'?>\n<robot name='knee'>\n  <link name='tibia'/>\n  <link name='femur'>\n    <inertial>\n"
         "      <origin " +
         inertialOrigin + "/>\n      <mass value='" + std::to_string(mass_kg) + "'/>\n" +
         "      <inertia ixx='0.02' ixy='0.001' ixz='0' iyy='0.01' iyz='0' izz='0.02'/>\n    </inertial>\n  </link>\n"
         "  <joint name='knee' type='floating'>\n    <parent link='tibia'/>\n    <child link='femur'/>\n    <origin " +
         jointOrigin + "/>\n  </joint>\n</robot>\n";
}

inline std::shared_ptr<const contact::ContactSurface> makeSurface(std::vector<contact::NurbsPatch> patches,
                                                                  const contact::Vec3& shift_m = {0, 0, 0},
                                                                  const contact::Mat3& R = contact::Mat3::Identity()) {
  for (contact::NurbsPatch& patch : patches) patch = patch.transformed({R, shift_m});
  return std::make_shared<const contact::ContactSurface>(std::move(patches));
}

/** UHMWPE of [BF2004 §3.2], linear. */
inline contact::Material polyethylene() {
  contact::Material material;
  material.E_Pa = 463e6;
  material.nu = 0.46;
  return material;
}

inline scene::LoadSpec verticalLoad(scene::TimeFunction fy_N, const contact::Vec3& point_m = {0, 0, 0}) {
  scene::LoadSpec load;
  load.name = "vertical";
  load.body = "femur";
  load.frame = "tibia";
  load.force_N = {0.0, std::move(fy_N), 0.0};
  load.pointBody = "femur";
  load.point_m = {point_m[0], point_m[1], point_m[2]};
  return load;
}

/** Case R1 of the sphere on a flat layer: R = 30 mm, h = 6 mm, flat layer surface at y = 6 mm. Only y is free. */
inline scene::Scene sphereScene(const std::filesystem::path& urdf, int cells = 60,
                                contact::Correction correction = contact::Correction::midsurface) {
  scene::Scene scene;
  scene.file = "sphere.yaml";
  scene::ModelSpec& model = scene.model.emplace();
  model.urdf = urdf;
  model.joint = "knee";
  for (scene::CoordinateSpec& spec : model.coordinates) spec = scene::PrescribedCoordinate{0.0};
  model.coordinates[y] = scene::FreeCoordinate{};
  scene::ContactSpec& contact = scene.contacts.emplace_back();
  contact.name = "sphere";
  contact::CompartmentDefinition& part = contact.definition.compartments.emplace_back();
  part.name = "layer";
  part.x0_m = part.z0_m = -5e-3;
  part.x1_m = part.z1_m = 5e-3;
  part.nx = part.nz = cells;
  part.fixedSurface = makeSurface(contact::makePlane(6e-3, 0, 0, contact::Solid::below, 0.02));
  part.movingSurface = makeSurface(contact::makeSphere(0.03));
  contact.definition.fixedThickness.source = contact::ConstantThickness{6e-3};
  contact.definition.material = polyethylene();
  contact.definition.correction = correction;
  return scene;
}

/** A prosthetic knee of analytic surfaces: two toroidal condyles (30 mm sagittal, 20 mm coronal) 44 mm apart in two
 dishes (60 mm, 35 mm), 8 mm polyethylene. Flexion, internal-external rotation and anterior-posterior translation
 prescribed, the others free, as in [BF2004 §3.2]. */
inline scene::Scene kneeScene(const std::filesystem::path& urdf, int cells = 30) {
  scene::Scene scene;
  scene.file = "knee.yaml";
  scene::ModelSpec& model = scene.model.emplace();
  model.urdf = urdf;
  model.joint = "knee";
  model.coordinates = {scene::FreeCoordinate{},
                       scene::PrescribedCoordinate{2 * kDegree},
                       scene::PrescribedCoordinate{-20 * kDegree},
                       scene::PrescribedCoordinate{1e-3},
                       scene::FreeCoordinate{},
                       scene::FreeCoordinate{}};
  scene::ContactSpec& contact = scene.contacts.emplace_back();
  contact.name = "tibiofemoral";
  for (const double side : {1.0, -1.0}) {
    const double center = side * 22e-3;
    contact::CompartmentDefinition& part = contact.definition.compartments.emplace_back();
    part.name = side > 0 ? "medial" : "lateral";
    part.x0_m = -12e-3;
    part.x1_m = 14e-3;
    part.z0_m = center - 9e-3;
    part.z1_m = center + 9e-3;
    part.nx = part.nz = cells;
    part.fixedSurface =
        makeSurface(contact::makeDish(8e-3, 60e-3, 35e-3, contact::Solid::below, 25e-3), {0, 0, center});
    part.movingSurface = makeSurface(contact::makeTorus(30e-3, 20e-3), {0, 0, center});
  }
  contact.definition.planeY_m = 0;
  contact.definition.fixedThickness.source = contact::HeightAbovePlane{0};
  contact.definition.material = polyethylene();
  scene.loads.push_back(verticalLoad(-1500.0, {0, 0, 9e-3}));
  return scene;
}

/** A gait-like second: two load peaks of 3 body weights, flexion to 65 degrees in swing. */
inline void addGait(scene::Scene& scene, int rows = 101) {
  scene::TimeSeries load, flexion, rotation, drawer;
  load.source = "load";
  flexion.source = "flexion";
  rotation.source = "rotation";
  drawer.source = "drawer";
  for (int i = 0; i < rows; ++i) {
    const double t = i / (rows - 1.0), phase = 2 * contact::kPi * t;
    for (scene::TimeSeries* series : {&load, &flexion, &rotation, &drawer}) series->time_s.push_back(t);
    const auto bump = [&](double center, double width) { return std::exp(-std::pow((t - center) / width, 2)); };
    load.value.push_back(-700 * (0.25 + 2.6 * bump(0.15, 0.09) + 2.7 * bump(0.48, 0.09)));
    flexion.value.push_back(-(5 + 12 * bump(0.15, 0.1) + 58 * bump(0.72, 0.12)) * kDegree);
    rotation.value.push_back(4 * std::sin(phase) * kDegree);
    drawer.value.push_back(2e-3 * std::sin(phase + 1));
  }
  scene.model->coordinates[rz] = scene::PrescribedCoordinate{flexion};
  scene.model->coordinates[ry] = scene::PrescribedCoordinate{rotation};
  scene.model->coordinates[x] = scene::PrescribedCoordinate{drawer};
  scene.loads = {verticalLoad(load, {0, 0, 9e-3})};
  scene.gait.emplace();
}

}  // namespace genu::model::testing_support
