// Round element surfaces and grids on the moving body through the C interface: the same numbers as the C++ interface.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "contact/Scenes.h"
#include "genu/contact/genu_contact.h"

namespace {

namespace gc = genu::contact;
using testing::HasSubstr;

/** A head of 24 mm in a socket of 25 mm, 2 mm of layer with a back of 27 mm about a point 0.1 mm off. */
struct Hip {
  genu_surface *ball = nullptr, *socket = nullptr, *head = nullptr;
  genu_compartment compartment = {};
  genu_element_surface elements = {};
  genu_round_back back = {{0.0001, 0, 0}, {0, 0, 0}};
  genu_pair_options options;

  Hip() {
    EXPECT_EQ(genu_surface_create_sphere(0.025, &ball), GENU_OK);
    EXPECT_EQ(genu_surface_create_flipped(ball, &socket), GENU_OK);
    EXPECT_EQ(genu_surface_create_sphere(0.024, &head), GENU_OK);
    compartment.nx = compartment.nz = 40;
    compartment.fixed = socket;
    compartment.moving = head;
    elements.kind = GENU_ELEMENTS_SPHERE_INWARD;
    elements.angle[0] = elements.elevation[0] = -0.7;
    elements.angle[1] = elements.elevation[1] = 0.7;
    genu_pair_options_init(&options, sizeof options);
    options.compartments = &compartment;
    options.num_compartments = 1;
    options.element_surfaces = &elements;
    options.fixed_thickness.kind = GENU_THICKNESS_RADIAL;
    options.fixed_thickness.value = 0.027;
    options.fixed_round_back = &back;
    options.material.youngs_modulus = 463e6;
    options.material.poisson_ratio = 0.46;
  }
  ~Hip() {
    for (genu_surface* surface : {ball, socket, head}) genu_surface_destroy(surface);
  }
  genu_load evaluate() const {
    genu_pair* pair = nullptr;
    genu_workspace* workspace = nullptr;
    EXPECT_EQ(genu_pair_create(&options, &pair), GENU_OK) << genu_last_error();
    EXPECT_EQ(genu_workspace_create(pair, &workspace), GENU_OK);
    genu_result result;
    genu_result_init(&result, sizeof result);
    const double q[6] = {0, 0, 0, 0.0002, -0.0012, 0.0001};
    EXPECT_EQ(genu_evaluate(pair, workspace, q, nullptr, nullptr, &result, nullptr, 0), GENU_OK) << genu_last_error();
    genu_workspace_destroy(workspace);
    genu_pair_destroy(pair);
    return result.total;
  }
  std::string refusal() const {
    genu_pair* pair = nullptr;
    EXPECT_EQ(genu_pair_create(&options, &pair), GENU_BAD_ARGUMENT);
    EXPECT_EQ(pair, nullptr);
    return genu_last_error();
  }
};

gc::ContactPairDefinition makeHip() {
  gc::ContactPairDefinition d;
  gc::CompartmentDefinition c;
  c.nx = c.nz = 40;
  gc::ElementSphere s;
  s.facing = gc::RoundFacing::inward;
  s.angle0_rad = s.elevation0_rad = -0.7;
  s.angle1_rad = s.elevation1_rad = 0.7;
  c.elementSurface = s;
  std::vector<gc::NurbsPatch> socket;
  for (const gc::NurbsPatch& p : gc::makeSphere(0.025)) socket.push_back(p.flipped());
  c.fixedSurface = gc::test::share(std::move(socket));
  c.movingSurface = gc::test::share(gc::makeSphere(0.024));
  d.compartments.push_back(c);
  d.fixedThickness.source = gc::RadialThickness{0.027, gc::Vec3(0.0001, 0, 0), {}};
  d.material = gc::test::uhmwpe();
  return d;
}

void expectEqual(const genu_load& a, const gc::ContactPairDefinition& d) {
  const gc::NetLoad b = gc::ContactPair(d).evaluate(gc::JointCoordinates{0, 0, 0, 0.0002, -0.0012, 0.0001}, {}).total;
  ASSERT_GT(b.scalarForce_N, 100);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(a.force_on_moving[k], b.forceOnM_F[k]);
    EXPECT_EQ(a.moment_on_moving_about_fixed_origin[k], b.momentOnM_Fo_F[k]);
  }
  EXPECT_EQ(a.area, b.area_m2);
  EXPECT_EQ(a.peak_pressure, b.peakPressure_Pa);
}

TEST(CElementSurface, EqualsTheCppInterface) {
  Hip hip;
  auto d = makeHip();
  expectEqual(hip.evaluate(), d);
  // The grid on the head instead.
  hip.options.grid_on = GENU_GRID_ON_MOVING;
  hip.elements.kind = GENU_ELEMENTS_SPHERE_OUTWARD;
  d.gridOn = gc::GridOn::moving;
  std::get<gc::ElementSphere>(d.compartments[0].elementSurface).facing = gc::RoundFacing::outward;
  expectEqual(hip.evaluate(), d);
  // A cylinder with its own axis and zero, about the socket.
  hip.options.grid_on = GENU_GRID_ON_FIXED;
  hip.elements.kind = GENU_ELEMENTS_CYLINDER_INWARD;
  hip.elements.axis[0] = 1;
  hip.elements.zero[1] = -2;
  hip.elements.axial[0] = -0.012;
  hip.elements.axial[1] = 0.012;
  d.gridOn = gc::GridOn::fixed;
  gc::ElementCylinder c;
  c.axis = gc::Vec3::UnitX();
  c.facing = gc::RoundFacing::inward;
  c.angle0_rad = -0.7;
  c.angle1_rad = 0.7;
  c.axial0_m = -0.012;
  c.axial1_m = 0.012;
  d.compartments[0].elementSurface = c;
  expectEqual(hip.evaluate(), d);
}

TEST(CElementSurface, WithoutElementSurfacesItIsAPlane) {
  Hip hip;
  hip.options.element_surfaces = nullptr;
  hip.compartment.x0 = hip.compartment.z0 = -0.01;
  hip.compartment.x1 = hip.compartment.z1 = 0.01;
  auto d = makeHip();
  d.compartments[0].elementSurface = gc::ElementPlane{};
  d.compartments[0].x0_m = d.compartments[0].z0_m = -0.01;
  d.compartments[0].x1_m = d.compartments[0].z1_m = 0.01;
  expectEqual(hip.evaluate(), d);
}

TEST(CElementSurface, CallersOfOlderHeadersGetPlanes) {
  Hip hip;  // the struct ends where it ended before
  hip.options.struct_size = offsetof(genu_pair_options, grid_on);
  hip.options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
  hip.options.fixed_thickness.value = 0.002;
  EXPECT_THAT(hip.refusal(), HasSubstr("rectangle"));  // the element surface is not read
}

TEST(CElementSurface, WhatIsWrongIsNamed) {
  {
    Hip hip;
    hip.elements.kind = static_cast<genu_element_surface_kind>(77);
    EXPECT_THAT(hip.refusal(), HasSubstr("element_surfaces[0]: unknown kind"));
  }
  {
    Hip hip;
    hip.options.grid_on = static_cast<genu_grid_on>(7);
    EXPECT_THAT(hip.refusal(), HasSubstr("grid_on"));
  }
  {
    Hip hip;
    hip.elements.angle[1] = std::numeric_limits<double>::infinity();
    EXPECT_THAT(hip.refusal(), HasSubstr("angle[1]"));
  }
  {
    Hip hip;
    hip.elements.elevation[1] = 1.7;
    EXPECT_THAT(hip.refusal(), HasSubstr("pole"));
  }
  {
    Hip hip;
    hip.back.center[2] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(hip.refusal(), HasSubstr("round back"));
  }
  genu_surface* out = nullptr;
  EXPECT_EQ(genu_surface_create_flipped(nullptr, &out), GENU_BAD_ARGUMENT);
}

}  // namespace
