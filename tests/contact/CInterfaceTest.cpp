#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "genu/contact/genu_contact.h"

extern "C" double pressSphereFromC(double depth, double* power, int* active);

namespace {

TEST(CInterface, SphereOnLayerFromC) {
  double power = 0;
  int active = 0;
  const double F = pressSphereFromC(0.2e-3, &power, &active);
  // 101 x 101 cells over 10 mm: 35 cells per contact radius, error below 35^-2.5 = 1.4e-4 (see ReferenceCasesTest).
  EXPECT_NEAR(F / 1338.989824, 1, 1.4e-4);
  EXPECT_NEAR(power, -0.01 * F, 1e-9 * F);
  EXPECT_GT(active, 3000);
}

TEST(CInterface, ErrorsAreStatusAndText) {
  genu_surface* surface = nullptr;
  EXPECT_EQ(genu_surface_create_sphere(-1, &surface), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), testing::HasSubstr("sphere: R = -1"));
  EXPECT_EQ(surface, nullptr);
  EXPECT_EQ(genu_surface_create_sphere(0.03, nullptr), GENU_BAD_ARGUMENT);
  genu_pair* pair = nullptr;
  EXPECT_EQ(genu_pair_create(nullptr, &pair), GENU_BAD_ARGUMENT);
  genu_pair_options options = {};
  EXPECT_EQ(genu_pair_create(&options, &pair), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), testing::HasSubstr("at least one compartment"));
  EXPECT_EQ(genu_surface_create_sphere(0.03, &surface), GENU_OK);
  EXPECT_STREQ(genu_last_error(), "");
  genu_surface_destroy(surface);
  EXPECT_EQ(genu_surface_create_plane(0, 0, 0, static_cast<genu_solid>(7), 1, &surface), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), testing::HasSubstr("unknown solid side"));
  EXPECT_STREQ(genu_status_text(GENU_FULL_PENETRATION), "full_penetration");
}

TEST(CInterface, NurbsSurfaceMatchesThePlane) {
  // A bilinear patch through the same corners as a plane: v along x.
  const double knots[] = {0, 0, 1, 1};
  const double points[] = {-1, 0, -1, 1, 0, -1, -1, 0, 1, 1, 0, 1};
  genu_surface* surface = nullptr;
  EXPECT_EQ(genu_surface_create_nurbs(1, 1, 2, 2, knots, knots, points, nullptr, 0, &surface), GENU_OK) << genu_last_error();
  genu_surface_destroy(surface);
  const double bad[] = {0, 1, 0, 1};
  EXPECT_EQ(genu_surface_create_nurbs(1, 1, 2, 2, bad, knots, points, nullptr, 0, &surface), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), testing::HasSubstr("must not decrease"));
}

}  // namespace
