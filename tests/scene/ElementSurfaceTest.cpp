// Element surfaces and the body that carries the grid, in scene files.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "genu/scene/SceneFile.h"

namespace genu::scene {
namespace {

using testing::HasSubstr;
using contact::ElementCylinder;
using contact::ElementPlane;
using contact::ElementSphere;
using contact::Vec3;

constexpr double kDegree = contact::kPi / 180;

std::string makeScene(const std::string& compartment, const std::string& pairKeys = "", const std::string& thickness = "2 mm",
                      const std::string& surfaces = "") {
  return "genu: 1\nsurfaces:\n  socket: {sphere: {R: 25 mm}, flip_normals: true}\n  head: {sphere: {R: 24 mm}}\n" + surfaces +
         "materials:\n  m: {E: 463 MPa, nu: 0.46}\ncontact:\n  hip:\n    fixed: {surface: socket, thickness: " + thickness +
         "}\n    moving: {surface: head}\n    material: m\n" + pairKeys + "    compartments:\n      all: {" + compartment + "}\n";
}

contact::ContactPairDefinition read(const std::string& yaml) { return parseScene(yaml, "s.yaml").contacts[0].definition; }

std::string messageFor(const std::string& yaml) {
  try {
    makeContactPairs(parseScene(yaml, "s.yaml"));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SceneElementSurface, SphereIsRead) {
  const auto d = read(makeScene(
      "grid: 20x30, sphere: {center: \"1 mm, 2 mm, 3 mm\", axis: x, zero: -y, facing: inward, angle: \"-40 deg, 30 deg\", "
      "elevation: \"-20 deg, 10 deg\", limit_radius: 30 mm}"));
  const auto& s = std::get<ElementSphere>(d.compartments[0].elementSurface);
  EXPECT_EQ(s.center_m, Vec3(0.001, 0.002, 0.003));
  EXPECT_EQ(s.axis, Vec3::UnitX());
  EXPECT_EQ(s.zero.value(), -Vec3::UnitY());
  EXPECT_EQ(s.facing, contact::RoundFacing::inward);
  EXPECT_NEAR(s.angle0_rad, -40 * kDegree, 1e-15);
  EXPECT_NEAR(s.elevation1_rad, 10 * kDegree, 1e-15);
  EXPECT_EQ(s.radius_m.value(), 0.03);
  EXPECT_EQ(d.gridOn, contact::GridOn::fixed);
}

TEST(SceneElementSurface, CylinderRadialThicknessAndGridOnMovingAreRead) {
  const auto d = read(makeScene("cylinder: {point: \"0 mm, 1 mm, 0 mm\", axis: \"0, 0.6, 0.8\", facing: outward, angle: \"-40 deg, 30 deg\", "
                                "axial: \"-4 mm, 5 mm\"}",
                                "    grid_on: moving\n", "{radial: {radius: 27 mm, center: \"0 mm, 0 mm, 1 mm\", axis: z}, max: 5 mm}"));
  const auto& c = std::get<ElementCylinder>(d.compartments[0].elementSurface);
  EXPECT_EQ(c.axis, Vec3(0, 0.6, 0.8));
  EXPECT_EQ(c.facing, contact::RoundFacing::outward);
  EXPECT_FALSE(c.zero.has_value());
  EXPECT_EQ(c.axial1_m, 0.005);
  EXPECT_EQ(d.gridOn, contact::GridOn::moving);
  const auto& radial = std::get<contact::RadialThickness>(d.fixedThickness.source);
  EXPECT_EQ(radial.radius_m, 0.027);
  EXPECT_EQ(radial.center_m.z(), 0.001);
  EXPECT_EQ(radial.axis.value(), Vec3::UnitZ());
}

TEST(SceneElementSurface, PlanesFaceUpOnTheFixedBodyAndDownOnTheMovingOne) {
  const std::string rectangle = "rectangle: \"-5 mm, 5 mm, -5 mm, 5 mm\"";
  const auto facing = [](const std::string& yaml) { return std::get<ElementPlane>(read(yaml).compartments[0].elementSurface).facing; };
  EXPECT_EQ(facing(makeScene(rectangle)), contact::PlaneFacing::up);
  EXPECT_EQ(facing(makeScene(rectangle, "    grid_on: moving\n")), contact::PlaneFacing::down);
  EXPECT_EQ(facing(makeScene(rectangle + ", facing: down")), contact::PlaneFacing::down);
  EXPECT_EQ(facing(makeScene(rectangle + ", facing: up", "    grid_on: moving\n")), contact::PlaneFacing::up);
}

TEST(SceneElementSurface, RangesAreFoundFromTheSurface) {
  // A dish of radius 60 mm about its centre of curvature, 10 mm each way: asin(1/6) up to the corners' larger angle.
  const std::string dish = "  dish: {dish: {Rs: 60 mm, Rf: 60 mm}, extent: 10 mm}\n";
  const auto found = std::get<ElementSphere>(
      read(makeScene("fixed: dish, sphere: {center: \"0 mm, 60 mm, 0 mm\", facing: inward}", "", "2 mm", dish)).compartments[0].elementSurface);
  EXPECT_NEAR(found.elevation1_rad, std::asin(1.0 / 6), 1e-9);
  EXPECT_NEAR(found.angle1_rad, std::asin(1.0 / 6), 0.005);
  const auto half = std::get<ElementSphere>(
      read(makeScene("fixed: dish, sphere: {center: \"0 mm, 60 mm, 0 mm\", facing: inward, angle: \"0 deg, 3 deg\", elevation: auto}", "", "2 mm", dish))
          .compartments[0].elementSurface);
  EXPECT_EQ(half.angle0_rad, 0);
  EXPECT_NEAR(half.angle1_rad, 3 * kDegree, 1e-15);
  EXPECT_EQ(half.elevation1_rad, found.elevation1_rad);
  EXPECT_THAT(messageFor(makeScene("fixed: dish, sphere: {center: \"0 mm, 60 mm, 0 mm\", facing: inward}", "", "2 mm",
                                   "  dish: {dish: {Rs: 60 mm, Rf: 60 mm}}\n")),
              HasSubstr("\"auto\" needs a surface with an end"));
  // A rectangle on the moving body: the part of the head that faces down.
  const auto d = read(makeScene("rectangle: auto", "    grid_on: moving\n"));
  EXPECT_NEAR(d.compartments[0].x1_m, 0.024, 1e-4);
}

TEST(SceneElementSurface, HeadInSocketCarriesTheSameOnEitherSide) {
  // Both choices hold the same closed form to the order of depth times curvature (docs/theory.md): 1.1 % here.
  const std::string ranges = "angle: \"-40 deg, 40 deg\", elevation: \"-40 deg, 40 deg\"}";
  const auto pull = [](const std::string& yaml) {
    return makeContactPairs(parseScene(yaml, "s.yaml"))[0]->evaluate(contact::JointCoordinates{0, 0, 0, 0, -0.0012, 0}).total.forceOnM_F.y();
  };
  const double onSocket = pull(makeScene("grid: 40x40, sphere: {facing: inward, " + ranges));
  const double onHead = pull(makeScene("grid: 40x40, sphere: {facing: outward, " + ranges, "    grid_on: moving\n"));
  EXPECT_GT(onSocket, 1000);
  EXPECT_NEAR(onHead / onSocket, 1 + 2.0 / 3 * 0.0002 * (1 / 0.024 + 1 / 0.025), 1e-3);
}

TEST(SceneElementSurface, WhatIsWrongIsNamed) {
  const std::string good = "sphere: {facing: inward, angle: \"-40 deg, 40 deg\", elevation: \"-40 deg, 40 deg\"}";
  ASSERT_EQ(messageFor(makeScene(good)), "");
  const auto refuse = [](const std::string& compartment, const std::string& expected, const std::string& pairKeys = "",
                         const std::string& thickness = "2 mm") {
    EXPECT_THAT(messageFor(makeScene(compartment, pairKeys, thickness)), HasSubstr(expected)) << compartment;
  };
  refuse(good + ", rectangle: auto", "elements lie on one surface: \"sphere\" was given already");
  refuse(good + ", facing: up", "has its own");
  refuse("grid: 3x3", "rectangle");
  refuse("spere: {facing: inward}", "did you mean \"sphere\"?");
  refuse("sphere: {facing: inwards}", "inward");
  refuse("sphere: {angle: \"0 deg, 1 deg\"}", "facing");
  refuse("sphere: {facing: inward, axial: \"0 mm, 1 mm\"}", "unknown key \"axial\"");
  refuse("sphere: {facing: inward, angle: \"40 deg, -40 deg\", elevation: \"-1 deg, 1 deg\"}", "not below");
  refuse("sphere: {facing: inward, angle: \"-200 deg, 200 deg\", elevation: \"-1 deg, 1 deg\"}", "full turn");
  refuse("sphere: {facing: inward, angle: \"-20 deg, 20 deg\", elevation: \"-1 deg, 95 deg\"}", "pole");
  refuse("sphere: {facing: inward, axis: w, angle: \"-20 deg, 20 deg\", elevation: \"-1 deg, 1 deg\"}", "\"w\" is no direction");
  refuse("sphere: {facing: inward, axis: z, zero: z, angle: \"-20 deg, 20 deg\", elevation: \"-1 deg, 1 deg\"}", "angle 0");
  refuse("sphere: {facing: outward, angle: \"-20 deg, 20 deg\", elevation: \"-1 deg, 1 deg\"}", "faces the wrong way");
  refuse("sphere: {facing: inward, angle: \"-20 mm, 20 mm\", elevation: \"-1 deg, 1 deg\"}", "angle");
  refuse(good, "grid_on", "    grid_on: both\n");
  refuse(good, "plane element surface", "", "{height_above: 0 mm}");
  refuse(good, "radius", "", "{radial: {center: \"0 mm, 0 mm, 0 mm\"}}");
  refuse(good, "back surface is missed", "", "{radial: {radius: 20 mm}}");
}

}  // namespace
}  // namespace genu::scene
