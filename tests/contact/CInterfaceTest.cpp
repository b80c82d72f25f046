#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"
#include "genu/contact/genu_contact.h"

extern "C" double pressSphereFromC(double depth, double* power, int* active);

namespace {

using testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class Object, void (*destroy)(Object*)>
struct Destroy {
  void operator()(Object* object) const { destroy(object); }
};
using Surface = std::unique_ptr<genu_surface, Destroy<genu_surface, genu_surface_destroy>>;
using Pair = std::unique_ptr<genu_pair, Destroy<genu_pair, genu_pair_destroy>>;
using Workspace = std::unique_ptr<genu_workspace, Destroy<genu_workspace, genu_workspace_destroy>>;

Surface makeSurface(const std::function<genu_status(genu_surface**)>& create) {
  genu_surface* surface = nullptr;
  EXPECT_EQ(create(&surface), GENU_OK) << genu_last_error();
  return Surface(surface);
}
Surface makeSphere(double R = 0.03) {
  return makeSurface([=](genu_surface** out) { return genu_surface_create_sphere(R, out); });
}
Surface makeLayer(double y0 = 0.006) {
  return makeSurface([=](genu_surface** out) { return genu_surface_create_plane(y0, 0, 0, GENU_SOLID_BELOW, 0.1, out); });
}
Workspace makeWorkspace(const Pair& pair) {
  genu_workspace* workspace = nullptr;
  EXPECT_EQ(genu_workspace_create(pair.get(), &workspace), GENU_OK) << genu_last_error();
  return Workspace(workspace);
}
genu_result makeResult() {
  genu_result result;
  genu_result_init(&result, sizeof result);
  return result;
}

/** Case R1, a sphere of 30 mm on a layer of 6 mm: two compartments that split it at x = 0. */
struct SphereOnLayer {
  Surface layer = makeLayer(), sphere = makeSphere();
  genu_compartment compartments[2] = {{"left", -0.005, 0, -0.005, 0.005, 20, 40, layer.get(), sphere.get()},
                                      {nullptr, 0, 0.005, -0.005, 0.005, 20, 40, layer.get(), sphere.get()}};
  genu_pair_options options;

  SphereOnLayer() {
    genu_pair_options_init(&options, sizeof options);
    options.compartments = compartments;
    options.num_compartments = 2;
    options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
    options.fixed_thickness.value = 0.006;
    options.material.youngs_modulus = 463e6;
    options.material.poisson_ratio = 0.46;
  }
  Pair makePair() const {
    genu_pair* pair = nullptr;
    EXPECT_EQ(genu_pair_create(&options, &pair), GENU_OK) << genu_last_error();
    return Pair(pair);
  }
  std::string whyNot() const {
    genu_pair* pair = nullptr;
    EXPECT_EQ(genu_pair_create(&options, &pair), GENU_BAD_ARGUMENT);
    EXPECT_EQ(pair, nullptr);
    return genu_last_error();
  }
  double force(const double q[6], genu_status expected = GENU_OK) const {
    const Pair pair = makePair();
    const Workspace workspace = makeWorkspace(pair);
    genu_result result = makeResult();
    EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), q, nullptr, nullptr, &result, nullptr, 0), expected);
    return result.total.force_on_moving[1];
  }
};
constexpr double kPressed[6] = {0, 0, 0, 0.001, 0.0358, 0.0005};  // 0.2 mm deep, off the split

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
  EXPECT_THAT(genu_last_error(), HasSubstr("sphere: R = -1"));
  EXPECT_EQ(surface, nullptr);
  EXPECT_EQ(genu_surface_create_sphere(0.03, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_surface_create_sphere(0.03, &surface), GENU_OK);
  EXPECT_STREQ(genu_last_error(), "");
  genu_surface_destroy(surface);
  EXPECT_EQ(genu_surface_create_plane(0, 0, 0, static_cast<genu_solid>(3), 1, &surface), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("unknown solid side"));
  EXPECT_STREQ(genu_status_text(GENU_FULL_PENETRATION), "full_penetration");
  EXPECT_STREQ(genu_status_text(GENU_INTERNAL_ERROR), "internal_error");
  // A longer text is cut, not overrun.
  EXPECT_EQ(genu_set_last_error(GENU_BAD_ARGUMENT, std::string(5000, 'x').c_str()), GENU_BAD_ARGUMENT);
  EXPECT_EQ(std::strlen(genu_last_error()), 1023u);
  EXPECT_EQ(genu_set_last_error(GENU_OK, nullptr), GENU_OK);
  EXPECT_STREQ(genu_last_error(), "");
}

TEST(CInterface, VersionIsThreeNumbers) {
  EXPECT_THAT(genu_version(), testing::MatchesRegex("[0-9]+[.][0-9]+[.][0-9]+"));
}

// Every simple surface on the same point: a sphere's bottom, dish and paraboloid of the same curvature, ellipsoid with equal
// axes, torus, cylinder. Each presses 0.2 mm; spheres agree exactly, the others have their own closed forms.
TEST(CInterface, EverySurfaceKindPresses) {
  SphereOnLayer scene;
  const double sphere = scene.force(kPressed);
  const auto forceOf = [&](const Surface& moving, double height) {
    for (genu_compartment& c : scene.compartments) c.moving = moving.get();
    double q[6];
    std::copy(kPressed, kPressed + 6, q);
    q[4] = 0.006 + height - 0.2e-3;
    return scene.force(q);
  };
  // The two forms of a sphere are the same surface: rounding of closest points only (1e-13 m of 2e-4 m, and the sum).
  const Surface round = makeSurface([](genu_surface** s) { return genu_surface_create_ellipsoid(0.03, 0.03, 0.03, s); });
  EXPECT_NEAR(forceOf(round, 0.03), sphere, 1e-8 * sphere);
  // R1 has depth 0.2 mm on R = 30 mm; a paraboloid of the same curvature differs by the quartic term of the circle,
  // r^4/(8 R^3) against r^2/(2 R): (a/R)^2/4 with a^2 = 2 R D, hence D/(2R) = 0.33 %; twice that is allowed.
  const Surface bowl = makeSurface(
      [](genu_surface** s) { return genu_surface_create_paraboloid(0, 0.03, 0.03, GENU_SOLID_ABOVE, 0.02, s); });
  EXPECT_NEAR(forceOf(bowl, 0), sphere, 2 * 0.2e-3 / 0.06 * sphere);
  const Surface dish =
      makeSurface([](genu_surface** s) { return genu_surface_create_dish(0, 0.03, 0.03, GENU_SOLID_ABOVE, 0.02, s); });
  EXPECT_NEAR(forceOf(dish, 0), sphere, 1e-8 * sphere);  // equal radii: the sphere itself
  // Small slopes: F is proportional to sqrt(Rx Rz) (reference case R4), up to terms of D/R = 1 %.
  const Surface torus = makeSurface([](genu_surface** s) { return genu_surface_create_torus(0.03, 0.02, s); });
  EXPECT_NEAR(forceOf(torus, 0.03), std::sqrt(0.02 / 0.03) * sphere, 0.01 * sphere);
  // R6 per length, D = 0.2 mm, R = 30 mm, the 10 mm of the grid: K L/h (R xc - a^2 asinh(xc/a)). 40 cells over 10 mm
  // resolve the strip of half width 3.46 mm; the smooth rule's error there is below (h_cell/xc)^2 = 5e-3.
  const Surface tube = makeSurface([](genu_surface** s) { return genu_surface_create_cylinder(0.03, 0.05, s); });
  const double K = (1 - 0.46) / (1.46 * 0.08) * 463e6, a = 0.0298, xc = std::sqrt(0.03 * 0.03 - a * a);
  double q[6] = {0, 0, 0, 0, 0.0358, 0};
  for (genu_compartment& c : scene.compartments) c.moving = tube.get();
  const double strip = K * 0.01 / 0.006 * (0.03 * xc - a * a * std::asinh(xc / a));
  EXPECT_NEAR(scene.force(q) / strip, 1, 5e-3);
}

TEST(CInterface, PlacedSurfaceEqualsMovedBody) {
  SphereOnLayer scene;
  const double expected = scene.force(kPressed);
  const double placement[6] = {0.3, -0.2, 0.1, 0.001, 0.0358, 0.0005}, zero[6] = {};
  const Surface placed = makeSurface(
      [&](genu_surface** s) { return genu_surface_create_placed(scene.sphere.get(), placement, s); });
  EXPECT_EQ(genu_surface_num_patches(placed.get()), genu_surface_num_patches(scene.sphere.get()));
  for (genu_compartment& c : scene.compartments) c.moving = placed.get();
  EXPECT_NEAR(scene.force(zero), expected, 1e-8 * expected);  // rounding of the points: 1e-17 of 2e-4 m
}

TEST(CInterface, NurbsPatches) {
  // A plane as two bilinear patches that meet at x = 0.001, off every cell's edge: the same force as one plane.
  const double knots[] = {0, 0, 1, 1};
  const double low[] = {-0.1, 0.006, -0.1, 0.001, 0.006, -0.1, -0.1, 0.006, 0.1, 0.001, 0.006, 0.1};
  const double high[] = {0.001, 0.006, -0.1, 0.1, 0.006, -0.1, 0.001, 0.006, 0.1, 0.1, 0.006, 0.1};
  const double weights[] = {1, 1, 1, 1};
  genu_nurbs_patch patches[2] = {{1, 1, 2, 2, 4, 4, 0, knots, knots, low, nullptr},
                                 {1, 1, 2, 2, 4, 4, 0, knots, knots, high, weights}};
  const Surface two = makeSurface([&](genu_surface** s) { return genu_surface_create_nurbs(patches, 2, s); });
  EXPECT_EQ(genu_surface_num_patches(two.get()), 2);
  SphereOnLayer scene;
  const double expected = scene.force(kPressed);
  for (genu_compartment& c : scene.compartments) c.fixed = two.get();
  EXPECT_NEAR(scene.force(kPressed), expected, 1e-9 * expected);

  genu_surface* none = nullptr;
  const auto whyNot = [&] {
    EXPECT_EQ(genu_surface_create_nurbs(patches, 2, &none), GENU_BAD_ARGUMENT);
    EXPECT_EQ(none, nullptr);
    return std::string(genu_last_error());
  };
  patches[1].num_knots_v = 5;
  EXPECT_THAT(whyNot(), HasSubstr("patches[1]: num_knots_v = 5 must be num_v + degree_v + 1 = 4"));
  patches[1].num_knots_v = 4;
  patches[1].points = nullptr;
  EXPECT_THAT(whyNot(), HasSubstr("patches[1]: knots_u, knots_v and points must not be NULL"));
  patches[1].points = high;
  patches[0].degree_u = 0;
  EXPECT_THAT(whyNot(), HasSubstr("degrees must be 1 to 5"));
  patches[0].degree_u = 1;
  patches[0].num_u = -2;
  EXPECT_THAT(whyNot(), HasSubstr("num_u and num_v"));
  patches[0].num_u = 2;
  const double falling[] = {0, 1, 0, 1};
  patches[0].knots_u = falling;
  EXPECT_THAT(whyNot(), HasSubstr("must not decrease"));
  patches[0].knots_u = knots;
  const double notFinite[] = {-0.1, kNaN, -0.1, 0, 0.006, -0.1, -0.1, 0.006, 0.1, 0, 0.006, 0.1};
  patches[0].points = notFinite;
  EXPECT_THAT(whyNot(), HasSubstr("patches[0]: "));
  EXPECT_EQ(genu_surface_create_nurbs(nullptr, 1, &none), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_surface_create_nurbs(patches, 0, &none), GENU_BAD_ARGUMENT);
}

TEST(CInterface, SurfaceNumbersMustBeFinite) {
  genu_surface* none = nullptr;
  for (const double bad : {kNaN, kInfinity}) {
    EXPECT_EQ(genu_surface_create_sphere(bad, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_plane(bad, 0, 0, GENU_SOLID_BELOW, 1, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_cylinder(0.03, bad, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_ellipsoid(0.03, bad, 0.03, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_torus(bad, 0.03, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_dish(bad, 0.03, 0.03, GENU_SOLID_BELOW, 1, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_EQ(genu_surface_create_paraboloid(bad, 0.03, 0.03, GENU_SOLID_BELOW, 1, &none), GENU_BAD_ARGUMENT) << bad;
    const Surface sphere = makeSphere();
    const double placement[6] = {0, 0, bad, 0, 0, 0};
    EXPECT_EQ(genu_surface_create_placed(sphere.get(), placement, &none), GENU_BAD_ARGUMENT) << bad;
    EXPECT_THAT(genu_last_error(), HasSubstr("placement[2]"));
  }
  EXPECT_EQ(none, nullptr);
}

TEST(CInterface, PairRefusesBadOptions) {
  genu_pair* none = nullptr;
  EXPECT_EQ(genu_pair_create(nullptr, &none), GENU_BAD_ARGUMENT);
  SphereOnLayer s;
  EXPECT_EQ(genu_pair_create(&s.options, nullptr), GENU_BAD_ARGUMENT);
  const genu_pair_options good = s.options;
  const auto whyNot = [&](const std::function<void(genu_pair_options&)>& spoil) {
    s.options = good;
    spoil(s.options);
    return s.whyNot();
  };
  EXPECT_THAT(whyNot([](auto& o) { o.num_compartments = 0; }), HasSubstr("at least one compartment"));
  EXPECT_THAT(whyNot([](auto& o) { o.compartments = nullptr; }), HasSubstr("at least one compartment"));
  EXPECT_THAT(whyNot([](auto& o) { o.struct_size = 0; }), HasSubstr("struct_size = 0"));
  EXPECT_THAT(whyNot([](auto& o) { o.struct_size = ~size_t{0}; }), HasSubstr("must be the size of the struct"));
  EXPECT_THAT(whyNot([](auto& o) { o.element_plane_y = kNaN; }), HasSubstr("element_plane_y"));
  EXPECT_THAT(whyNot([](auto& o) { o.copy_tolerance = kNaN; }), HasSubstr("copy_tolerance"));
  EXPECT_THAT(whyNot([](auto& o) { o.strain = static_cast<genu_strain>(2); }), HasSubstr("unknown strain"));
  EXPECT_THAT(whyNot([](auto& o) { o.correction = static_cast<genu_correction>(3); }), HasSubstr("unknown correction"));
  EXPECT_THAT(whyNot([](auto& o) { o.distance = static_cast<genu_distance>(2); }), HasSubstr("unknown distance"));
  EXPECT_THAT(whyNot([](auto& o) { o.rule = static_cast<genu_rule>(2); }), HasSubstr("unknown rule"));
  EXPECT_THAT(whyNot([](auto& o) { o.tracking = static_cast<genu_tracking>(4); }), HasSubstr("unknown tracking"));
  EXPECT_THAT(whyNot([](auto& o) { o.material.law = static_cast<genu_law>(3); }), HasSubstr("unknown law"));
  EXPECT_THAT(whyNot([](auto& o) { o.material.poisson_ratio = 0.5; }), HasSubstr("0.5"));
  EXPECT_THAT(whyNot([](auto& o) { o.material.youngs_modulus = kNaN; }), HasSubstr("E [Pa] = nan"));
  EXPECT_THAT(whyNot([](auto& o) { o.fixed_thickness.kind = static_cast<genu_thickness_kind>(7); }),
              HasSubstr("fixed_thickness: unknown kind"));
  EXPECT_THAT(whyNot([](auto& o) { o.fixed_thickness.kind = GENU_THICKNESS_BACK_NORMAL; }),
              HasSubstr("fixed_thickness: back surface is NULL"));
  EXPECT_THAT(whyNot([](auto& o) { o.moving_thickness.missing = -1; }), HasSubstr("moving_thickness: min, max and missing"));
  EXPECT_THAT(whyNot([](auto& o) { o.moving_thickness.map_samples_u = 1; }), HasSubstr("map_samples_u"));
  EXPECT_THAT(whyNot([](auto& o) { o.fixed_thickness.value = kNaN; }), HasSubstr("not a finite number"));
  s.options = good;
  s.compartments[1].moving = nullptr;
  EXPECT_THAT(s.whyNot(), HasSubstr("compartments[1]: fixed and moving surface"));
  s.compartments[1].moving = s.sphere.get();
  s.compartments[1].x0 = kNaN;
  EXPECT_THAT(s.whyNot(), HasSubstr("compartments[1]"));
  s.compartments[1].x0 = 0;
  s.compartments[1].nx = -4;
  EXPECT_THAT(s.whyNot(), HasSubstr("-4"));
}

TEST(CInterface, StructsMayGrow) {
  const SphereOnLayer s;
  // A program newer than the library: more bytes are welcome while they are 0.
  struct {
    genu_pair_options options;
    double later[4];
  } newer = {s.options, {}};
  newer.options.struct_size = sizeof newer;
  genu_pair* pair = nullptr;
  ASSERT_EQ(genu_pair_create(&newer.options, &pair), GENU_OK) << genu_last_error();
  const Pair owner(pair);
  newer.later[3] = 1;
  pair = nullptr;
  EXPECT_EQ(genu_pair_create(&newer.options, &pair), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("older library does not know"));
  // A program from before `distance`: what lies past its size is not read.
  genu_pair_options older = s.options;
  older.struct_size = offsetof(genu_pair_options, distance);
  older.distance = static_cast<genu_distance>(77);
  genu_pair* old = nullptr;
  ASSERT_EQ(genu_pair_create(&older, &old), GENU_OK) << genu_last_error();
  genu_pair_destroy(old);
  // A program older than the library: fields past its size are neither read nor written.
  const Workspace workspace = makeWorkspace(owner);
  genu_result result;
  std::memset(&result, 0x5a, sizeof result);
  result.struct_size = offsetof(genu_result, power);
  ASSERT_EQ(genu_evaluate(pair = owner.get(), workspace.get(), kPressed, nullptr, nullptr, &result, nullptr, 0), GENU_OK);
  EXPECT_EQ(result.struct_size, offsetof(genu_result, power));
  EXPECT_GT(result.total.force_on_moving[1], 1000);
  double untouched;
  std::memset(&untouched, 0x5a, sizeof untouched);
  EXPECT_EQ(std::memcmp(&result.power, &untouched, sizeof untouched), 0);
}

TEST(CInterface, APowerBeyondTheRangeOfDoubleIsNotConverged) {
  const SphereOnLayer s;
  const Pair pair = s.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_result result = makeResult();
  const double rates[6] = {0, 0, 0, 0, 1e308, 0};
  EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, rates, nullptr, &result, nullptr, 0), GENU_NOT_CONVERGED);
  EXPECT_GT(result.total.force_on_moving[1], 1000);
}

TEST(CInterface, EvaluateRefusesBadArguments) {
  const SphereOnLayer s;
  const Pair pair = s.makePair(), other = s.makePair();
  const Workspace workspace = makeWorkspace(pair), foreign = makeWorkspace(other);
  genu_result result = makeResult();
  result.total.area = -7;  // stays: nothing is written after an error
  genu_load loads[2];
  const auto evaluate = [&](const genu_pair* p, genu_workspace* w, const double* q, const double* rates, genu_result* r,
                            genu_load* l, int n) {
    EXPECT_EQ(genu_evaluate(p, w, q, rates, nullptr, r, l, n), GENU_BAD_ARGUMENT);
    EXPECT_EQ(result.total.area, -7);
    return std::string(genu_last_error());
  };
  const std::string null = "must not be NULL";
  EXPECT_THAT(evaluate(nullptr, workspace.get(), kPressed, nullptr, &result, nullptr, 0), HasSubstr(null));
  EXPECT_THAT(evaluate(pair.get(), nullptr, kPressed, nullptr, &result, nullptr, 0), HasSubstr(null));
  EXPECT_THAT(evaluate(pair.get(), workspace.get(), nullptr, nullptr, &result, nullptr, 0), HasSubstr(null));
  EXPECT_THAT(evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, nullptr, 0), HasSubstr(null));
  EXPECT_THAT(evaluate(pair.get(), foreign.get(), kPressed, nullptr, &result, nullptr, 0), HasSubstr("another pair"));
  EXPECT_THAT(evaluate(pair.get(), workspace.get(), kPressed, nullptr, &result, loads, 1),
              HasSubstr("num_compartments = 1 must be 2"));
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (int k = 0; k < 6; ++k) {
      double q[6], rates[6] = {};
      std::copy(kPressed, kPressed + 6, q);
      q[k] = bad;
      EXPECT_THAT(evaluate(pair.get(), workspace.get(), q, nullptr, &result, nullptr, 0),
                  HasSubstr("coordinates[" + std::to_string(k) + "] is not a finite number"));
      rates[k] = bad;
      EXPECT_THAT(evaluate(pair.get(), workspace.get(), kPressed, rates, &result, nullptr, 0),
                  HasSubstr("rates[" + std::to_string(k) + "] is not a finite number"));
    }
  }
  result.struct_size = 0;
  EXPECT_THAT(evaluate(pair.get(), workspace.get(), kPressed, nullptr, &result, nullptr, 0), HasSubstr("genu_result"));
  genu_result_init(&result, sizeof result);
  genu_evaluate_options options;
  std::memset(&options, 0, sizeof options);
  EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, &options, &result, nullptr, 0), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("genu_evaluate_options"));
  // An error leaves the workspace usable.
  EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, &result, loads, 2), GENU_OK);
  EXPECT_NEAR(loads[0].force_on_moving[1] + loads[1].force_on_moving[1], result.total.force_on_moving[1],
              1e-12 * result.total.force_on_moving[1]);
  genu_workspace* none = nullptr;
  EXPECT_EQ(genu_workspace_create(nullptr, &none), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_workspace_create(pair.get(), nullptr), GENU_BAD_ARGUMENT);
}

TEST(CInterface, NullIsAllowedWhereSaid) {
  genu_surface_destroy(nullptr);
  genu_pair_destroy(nullptr);
  genu_workspace_destroy(nullptr);
  genu_workspace_reset(nullptr);
  genu_pair_options_init(nullptr, sizeof(genu_pair_options));
  genu_result_init(nullptr, sizeof(genu_result));
  EXPECT_EQ(genu_surface_num_patches(nullptr), 0);
  EXPECT_EQ(genu_pair_num_compartments(nullptr), 0);
  EXPECT_EQ(genu_pair_num_elements(nullptr), 0);
  EXPECT_EQ(genu_pair_num_compartment_elements(nullptr, 0), 0);
  EXPECT_EQ(genu_pair_num_maps(nullptr), 0);
  EXPECT_EQ(genu_pair_compartment_name(nullptr, 0), nullptr);
}

TEST(CInterface, ObjectsMayBeDestroyedInAnyOrder) {
  auto s = std::make_unique<SphereOnLayer>();
  const double expected = s->force(kPressed);
  Pair pair = s->makePair();
  s.reset();
  Workspace workspace = makeWorkspace(pair);
  genu_result result = makeResult();
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, &result, nullptr, 0), GENU_OK);
  EXPECT_EQ(result.total.force_on_moving[1], expected);
  pair.reset();
  genu_workspace_reset(workspace.get());
}

TEST(CInterface, TrackingAndRulesGiveTheSameContact) {
  SphereOnLayer s;
  const double expected = s.force(kPressed);
  for (const genu_tracking tracking :
       {GENU_TRACKING_ALL, GENU_TRACKING_BREADTH_FIRST, GENU_TRACKING_BREADTH_FIRST_UNGUARDED}) {
    s.options.tracking = tracking;
    EXPECT_NEAR(s.force(kPressed), expected, 1e-9 * expected) << tracking;  // one region: the search finds it too
  }
  // Centre rule, 13.8 cells per contact radius: error below 13.8^-2.5 = 1.4e-3, and the smooth rule's is smaller.
  s.options.rule = GENU_RULE_CENTRE;
  EXPECT_NEAR(s.force(kPressed), expected, 2 * 1.4e-3 * expected);
  EXPECT_NE(s.force(kPressed), expected);
  // By ray: the same to the order of theta^2 of the rim, 0.007; the closed forms differ by 7e-6.
  const double byMinimum = s.force(kPressed);
  s.options.distance = GENU_DISTANCE_RAY;
  EXPECT_NEAR(s.force(kPressed), byMinimum, 1e-4 * byMinimum);
  EXPECT_NE(s.force(kPressed), byMinimum);
  s.options.distance = GENU_DISTANCE_MINIMUM;
  // Without the correction every element's distance is AB, not AB/cos(theta/2): less force.
  s.options.rule = GENU_RULE_SMOOTH;
  s.options.correction = GENU_CORRECTION_NONE;
  EXPECT_LT(s.force(kPressed), expected);
  EXPECT_GT(s.force(kPressed), 0.99 * expected);
}

TEST(CInterface, MaterialsAndStrainReachTheEngine) {
  SphereOnLayer s;  // reference cases R1 to R3; tolerance: the rule's at 14 cells per radius, 1.4e-3
  EXPECT_NEAR(s.force(kPressed) / 1338.989824, 1, 1.4e-3);
  s.options.strain = GENU_STRAIN_LARGE;
  EXPECT_NEAR(s.force(kPressed) / 1354.118397, 1, 1.4e-3);
  s.options.strain = GENU_STRAIN_SMALL;
  const genu_material linear = s.options.material;
  s.options.material.law = GENU_POWER_LAW;
  s.options.material.eps0 = 0.0597;
  s.options.material.p0 = 18.4e6;
  s.options.material.n = 3;
  EXPECT_NEAR(s.force(kPressed) / 531.924701, 1, 1.4e-3);
  s.options.material.law = GENU_POWER_LAW_CONSISTENT;  // softer law term s^3 instead of 3 s^3: more pressure
  EXPECT_GT(s.force(kPressed), 1.1 * 531.924701);
  // Series of two equal layers of 3 mm is one of 6 mm; of different moduli, K/h -> 1/(h1/K1 + h2/K2).
  s.options.material = linear;
  s.options.fixed_thickness.value = 0.003;
  s.options.moving_thickness.kind = GENU_THICKNESS_CONSTANT;
  s.options.moving_thickness.value = 0.003;
  EXPECT_NEAR(s.force(kPressed) / 1338.989824, 1, 1.4e-3);
  genu_material half = linear;
  half.youngs_modulus /= 2;
  s.options.moving_material = &half;
  EXPECT_NEAR(s.force(kPressed) / (1338.989824 / 1.5), 1, 1.4e-3);
}

TEST(CInterface, BackSurfacesClampsAndReports) {
  SphereOnLayer s;
  const double expected = s.force(kPressed);
  const Surface bottom = makeLayer(0), core = makeSphere(0.027);
  s.options.fixed_thickness = {};
  s.options.fixed_thickness.kind = GENU_THICKNESS_BACK_NORMAL;
  s.options.fixed_thickness.back = bottom.get();
  EXPECT_NEAR(s.force(kPressed), expected, 1e-9 * expected);
  s.options.fixed_thickness.kind = GENU_THICKNESS_BACK_CLOSEST;
  EXPECT_NEAR(s.force(kPressed), expected, 1e-9 * expected);
  s.options.fixed_thickness.max = 0.003;
  s.options.moving_thickness.kind = GENU_THICKNESS_BACK_NORMAL;
  s.options.moving_thickness.back = core.get();
  s.options.moving_thickness.map_samples_u = s.options.moving_thickness.map_samples_v = 17;
  // Concentric spheres: the map is 3 mm everywhere. 3 mm + 3 mm.
  EXPECT_NEAR(s.force(kPressed), expected, 1e-6 * expected);
  const Pair pair = s.makePair();
  EXPECT_EQ(genu_pair_num_compartments(pair.get()), 2);
  EXPECT_EQ(genu_pair_num_elements(pair.get()), 1600);
  EXPECT_EQ(genu_pair_num_compartment_elements(pair.get(), 1), 800);
  EXPECT_EQ(genu_pair_num_compartment_elements(pair.get(), 2), 0);
  EXPECT_STREQ(genu_pair_compartment_name(pair.get(), 0), "left");
  EXPECT_STREQ(genu_pair_compartment_name(pair.get(), 1), "compartment 1");
  EXPECT_EQ(genu_pair_compartment_name(pair.get(), -1), nullptr);
  genu_grid_report grid;
  ASSERT_EQ(genu_pair_grid_report(pair.get(), 1, &grid), GENU_OK);
  EXPECT_EQ(grid.cells, 800);
  EXPECT_EQ(grid.elements, 800);
  EXPECT_EQ(grid.clamped, 800);
  EXPECT_NEAR(grid.mean_thickness, 0.003, 1e-12);
  EXPECT_NEAR(grid.surface_area, 0.005 * 0.010, 1e-12);
  EXPECT_EQ(genu_pair_grid_report(pair.get(), 2, &grid), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("compartment = 2 must be 0 to 1"));
  EXPECT_EQ(genu_pair_grid_report(pair.get(), 0, nullptr), GENU_BAD_ARGUMENT);
  ASSERT_EQ(genu_pair_num_maps(pair.get()), 1);
  genu_map_report map;
  ASSERT_EQ(genu_pair_map_report(pair.get(), 0, &map), GENU_OK);
  EXPECT_EQ(map.samples, 17 * 17 * genu_surface_num_patches(s.sphere.get()));
  EXPECT_NEAR(map.min_thickness, 0.003, 1e-9);
  EXPECT_NEAR(map.max_thickness, 0.003, 1e-9);
  EXPECT_EQ(genu_pair_map_report(pair.get(), 1, &map), GENU_BAD_ARGUMENT);
}

TEST(CInterface, FieldsAddUpToTheLoad) {
  const SphereOnLayer s;
  const Pair pair = s.makePair(), other = s.makePair();
  const Workspace workspace = makeWorkspace(pair), foreign = makeWorkspace(other);
  size_t count = 0;
  ASSERT_EQ(genu_pair_fields(pair.get(), workspace.get(), 0, nullptr, 0, &count), GENU_OK);
  ASSERT_EQ(count, 800u);
  std::vector<genu_element> elements(count);
  EXPECT_EQ(genu_pair_fields(pair.get(), workspace.get(), 0, elements.data(), count, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("holds no evaluation"));
  genu_result result = makeResult();
  genu_load loads[2];
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, &result, loads, 2), GENU_OK);
  for (int k = 0; k < 2; ++k) {
    ASSERT_EQ(genu_pair_fields(pair.get(), workspace.get(), k, elements.data(), count, &count), GENU_OK);
    double force = 0, moment = 0;
    int active = 0;
    for (const genu_element& e : elements) {
      force += e.force * e.force_direction[1];
      moment += e.force * (e.point[0] * e.force_direction[1] - e.point[1] * e.force_direction[0]);
      active += e.active;
      EXPECT_NEAR(e.thickness, 0.006, 1e-15);
      EXPECT_EQ(e.normal[1], 1);
      EXPECT_NEAR(e.area, 0.00025 * 0.00025, 1e-20);
      EXPECT_LE(e.contact_share, 1);
    }
    EXPECT_EQ(active, loads[k].active_elements);
    // Each element's own force, direction and point; the smooth rule takes the moment inside cells too: cell size squared
    // over the contact size squared.
    EXPECT_NEAR(force, loads[k].force_on_moving[1], 1e-3 * force);
    EXPECT_NEAR(moment, loads[k].moment_on_moving_about_fixed_origin[2], 5e-3 * force * 0.005);
  }
  EXPECT_EQ(genu_pair_fields(pair.get(), workspace.get(), 0, elements.data(), count - 1, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("capacity = 799 must be at least 800"));
  EXPECT_EQ(genu_pair_fields(pair.get(), foreign.get(), 0, elements.data(), count, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_pair_fields(pair.get(), workspace.get(), 2, elements.data(), count, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_pair_fields(nullptr, workspace.get(), 0, elements.data(), count, nullptr), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_pair_fields(pair.get(), nullptr, 0, elements.data(), count, nullptr), GENU_BAD_ARGUMENT);
}

TEST(CInterface, StiffnessIsTheDerivativeOfTheLoad) {
  SphereOnLayer s;
  const Pair pair = s.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_evaluate_options options;
  genu_evaluate_options_init(&options, sizeof options);
  genu_result result = makeResult(), plus = makeResult(), minus = makeResult();
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, &result, nullptr, 0), GENU_OK);
  EXPECT_EQ(result.stiffness[6 * 1 + 4], 0);
  options.with_stiffness = options.with_energy = 1;
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, &options, &result, nullptr, 0), GENU_OK);
  EXPECT_GT(result.total.energy, 0);
  // Central difference over 2 e: error e^2 F'''/6 and jumps of F'' at cell borders (e F''), F'' = 2 F/D^2; e = 1e-8 m gives
  // e F''/F' = e/D = 5e-5; columns of the six coordinates against the largest of the column.
  options.with_stiffness = 0;
  for (int column = 0; column < 6; ++column) {
    const double e = column < 3 ? 1e-7 : 1e-8;
    double q[6];
    std::copy(kPressed, kPressed + 6, q);
    q[column] += e;
    ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), q, nullptr, &options, &plus, nullptr, 0), GENU_OK);
    q[column] -= 2 * e;
    ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), q, nullptr, &options, &minus, nullptr, 0), GENU_OK);
    for (int row = 0; row < 6; ++row) {
      const auto pick = [row](const genu_load& l) {
        return row < 3 ? l.force_on_moving[row] : l.moment_on_moving_about_fixed_origin[row - 3];
      };
      // A sphere's rotation changes nothing: columns 0 to 2 are 0 up to the rounding of F / e = 1e-13 * 1300 / 1e-7.
      const double scale = (row < 3 ? 1 : 0.036) * (column < 3 ? 1e-2 / 5e-5 : 1.4e7);
      EXPECT_NEAR((pick(plus.total) - pick(minus.total)) / (2 * e), result.stiffness[6 * row + column], 5e-5 * scale)
          << row << ", " << column;
    }
  }
  s.options.rule = GENU_RULE_CENTRE;
  const Pair centre = s.makePair();
  const Workspace own = makeWorkspace(centre);
  options.with_stiffness = 1;
  EXPECT_EQ(genu_evaluate(centre.get(), own.get(), kPressed, nullptr, &options, &result, nullptr, 0), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("smooth rule"));
}

TEST(CInterface, StatusSaysHowFarTheResultHolds) {
  const SphereOnLayer s;
  double q[6] = {0, 0, 0, 0, 0.036 - 0.0058, 0};  // 5.8 mm of 6 mm
  s.force(q, GENU_EXTRAPOLATED);
  q[4] = 0.036 - 0.0062;
  s.force(q, GENU_FULL_PENETRATION);
  q[4] = 0.05;
  EXPECT_EQ(s.force(q), 0);
}

TEST(CInterface, DampingReadsTheRates) {
  SphereOnLayer s;
  const double elastic = s.force(kPressed);
  s.options.damping = 10;  // [s/m]
  const Pair pair = s.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_evaluate_options options;
  genu_evaluate_options_init(&options, sizeof options);
  options.with_stiffness = 1;
  const auto evaluate = [&](const double* rates) {
    genu_result result = makeResult();
    EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, rates, &options, &result, nullptr, 0), GENU_OK) << genu_last_error();
    return result;
  };
  const double down[6] = {0, 0, 0, 0, -0.05, 0}, still[6] = {};
  // NULL is at rest, the elastic load, whatever was asked before: up to the rounding of warm closest points, 1e-17 m of 2e-4 m.
  EXPECT_EQ(evaluate(nullptr).total.force_on_moving[1], elastic);
  const genu_result damped = evaluate(down);
  EXPECT_EQ(damped.copied, 0);
  EXPECT_NEAR(evaluate(nullptr).total.force_on_moving[1] / elastic, 1, 1e-12);
  EXPECT_NEAR(evaluate(still).total.force_on_moving[1] / elastic, 1, 1e-12);
  EXPECT_NEAR(evaluate(down).total.force_on_moving[1] / damped.total.force_on_moving[1], 1, 1e-12);
  // 1 + c v cos(theta/2), theta/2 at most 0.058 at the rim (DampingTest).
  const double factor = damped.total.force_on_moving[1] / elastic;
  EXPECT_LT(factor, 1.5);
  EXPECT_GT(factor, 1.5 - 0.5 * 1.7e-3);
  EXPECT_NEAR(damped.power, -0.05 * damped.total.force_on_moving[1], 1e-12 * damped.power * -1);
  // Nothing is cut off at these rates, so that the load is linear in them: it is the elastic one plus matrix times rates, up to
  // rounding (moments of 0.5 N m about F's origin against 1e-12 of a force of 2000 N).
  const double rates[6] = {0.2, -0.1, 0.3, 0.01, -0.02, 0.015};
  const genu_result moving = evaluate(rates), rest = evaluate(nullptr);
  const auto pick = [](const genu_load& l, int row) {
    return row < 3 ? l.force_on_moving[row] : l.moment_on_moving_about_fixed_origin[row - 3];
  };
  double largest = 0;
  for (int row = 0; row < 6; ++row) {
    double expected = pick(rest.total, row);
    for (int column = 0; column < 6; ++column) {
      expected += moving.damping[6 * row + column] * rates[column];
      largest = std::max(largest, std::abs(moving.damping[6 * row + column]));
    }
    EXPECT_NEAR(pick(moving.total, row), expected, 1e-9) << row;
  }
  EXPECT_GT(largest, 1000);  // c F
  options.with_stiffness = 0;
  for (const double value : evaluate(down).damping) EXPECT_EQ(value, 0);

  // A program built before there was damping: not read, none.
  s.options.struct_size = offsetof(genu_pair_options, damping);
  EXPECT_EQ(s.force(kPressed), elastic);
  {
    const Pair older = s.makePair();
    const Workspace own = makeWorkspace(older);
    genu_result result;
    std::memset(&result, 0x5a, sizeof result);
    result.struct_size = offsetof(genu_result, damping);
    ASSERT_EQ(genu_evaluate(older.get(), own.get(), kPressed, down, nullptr, &result, nullptr, 0), GENU_OK);
    EXPECT_EQ(result.total.force_on_moving[1], elastic);
    double untouched;
    std::memset(&untouched, 0x5a, sizeof untouched);
    EXPECT_EQ(std::memcmp(&result.damping[0], &untouched, sizeof untouched), 0);
  }
  s.options.struct_size = sizeof s.options;
  s.options.damping = -1;
  EXPECT_THAT(s.whyNot(), HasSubstr("damping = -1 s/m"));
  s.options.damping = kNaN;
  EXPECT_THAT(s.whyNot(), HasSubstr("damping is not a finite number"));
  s.options.damping = 1;
  s.options.correction = GENU_CORRECTION_ENERGY;
  EXPECT_THAT(s.whyNot(), HasSubstr("correction energy with damping"));
}

TEST(CInterface, EnergyFormIsTheGradientOfTheEnergy) {
  SphereOnLayer s;
  s.options.correction = GENU_CORRECTION_ENERGY;
  const Pair pair = s.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_evaluate_options options;
  genu_evaluate_options_init(&options, sizeof options);
  options.with_energy = 1;
  const auto evaluate = [&](double y) {
    double q[6];
    std::copy(kPressed, kPressed + 6, q);
    q[4] = y;
    genu_result result = makeResult();
    EXPECT_EQ(genu_evaluate(pair.get(), workspace.get(), q, nullptr, &options, &result, nullptr, 0), GENU_OK);
    return result.total;
  };
  // Five-point difference over h = 1e-6 m of U ~ D^3, D = 0.2 mm: h^4 U^(5)/30 is below (h/D)^4 = 1e-9 of F; rounding 1e-16 U/(h F) =
  // 1e-16 D/(3 h) = 1e-14; kinks of the third derivative as cells switch add (h/D)^2 times a cell's share, 1/700: 4e-8.
  const double h = 1e-6, y = kPressed[4];
  const double slope = (evaluate(y - 2 * h).energy - 8 * evaluate(y - h).energy + 8 * evaluate(y + h).energy - evaluate(y + 2 * h).energy) / (12 * h);
  const double force = evaluate(y).force_on_moving[1];
  EXPECT_NEAR(-slope / force, 1, 1e-7);
  s.options.correction = GENU_CORRECTION_MIDSURFACE;
  EXPECT_GT(std::abs(s.force(kPressed) / force - 1), 1e-5);  // another load than the paper's
  s.options.correction = GENU_CORRECTION_ENERGY;
  s.options.rule = GENU_RULE_CENTRE;
  EXPECT_THAT(s.whyNot(), HasSubstr("centre rule"));
}

TEST(CInterface, ErrorEstimateOfTheLastEvaluation) {
  SphereOnLayer scene;
  for (genu_compartment& c : scene.compartments) c.nx = 6, c.nz = 12;
  const Pair pair = scene.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_error_estimate estimate;
  genu_error_estimate_init(&estimate, sizeof estimate);
  genu_load_error parts[2];
  const auto estimateError = [&](genu_companion companion, int count = 2) {
    return genu_estimate_error(pair.get(), workspace.get(), companion, &estimate, parts, count);
  };
  EXPECT_EQ(estimateError(GENU_COMPANION_FINE), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("no evaluation"));
  genu_result result = makeResult();
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, nullptr, &result, nullptr, 0), GENU_OK);
  EXPECT_EQ(estimateError(GENU_COMPANION_FINE, 1), GENU_BAD_ARGUMENT);
  EXPECT_EQ(estimateError(static_cast<genu_companion>(2)), GENU_BAD_ARGUMENT);
  EXPECT_EQ(genu_estimate_error(pair.get(), workspace.get(), GENU_COMPANION_FINE, nullptr, nullptr, 0), GENU_BAD_ARGUMENT);
  const double error = std::abs(result.total.force_on_moving[1] - 1338.989824), area = std::abs(result.total.area - 37.573448e-6);
  for (const genu_companion companion : {GENU_COMPANION_FINE, GENU_COMPANION_COARSE}) {
    ASSERT_EQ(estimateError(companion), GENU_OK) << genu_last_error();
    EXPECT_EQ(estimate.companion_elements, companion == GENU_COMPANION_FINE ? 576 : 36);
    EXPECT_GT(estimate.total.force, error);
    EXPECT_GT(estimate.total.area, area);
    EXPECT_LT(estimate.total.force, 0.02 * 1338.99);  // a few cells each way: some per cent at most
    EXPECT_GT(parts[0].force, 0);
    EXPECT_GT(parts[1].peak_pressure, 0);
  }
  // A caller with an older, shorter struct gets what fits.
  genu_error_estimate shorter;
  const size_t size = offsetof(genu_error_estimate, companion_elements);
  std::memset(&shorter, 0xff, sizeof shorter);
  genu_error_estimate_init(&shorter, size);
  ASSERT_EQ(genu_estimate_error(pair.get(), workspace.get(), GENU_COMPANION_COARSE, &shorter, nullptr, 0), GENU_OK);
  EXPECT_EQ(shorter.total.force, estimate.total.force);
  EXPECT_EQ(shorter.companion_elements, -1);
  const Pair other = scene.makePair();
  EXPECT_EQ(genu_estimate_error(other.get(), workspace.get(), GENU_COMPANION_FINE, &estimate, nullptr, 0), GENU_BAD_ARGUMENT);
}

// The same pair through both interfaces: the same numbers, bit by bit.
TEST(CInterface, EqualsTheCppInterface) {
  namespace gc = genu::contact;
  gc::ContactPairDefinition d;
  for (const double side : {0.0, 1.0}) {
    gc::CompartmentDefinition c;
    c.x0_m = side == 0 ? -0.005 : 0;
    c.x1_m = side == 0 ? 0 : 0.005;
    c.z0_m = -0.005;
    c.z1_m = 0.005;
    c.nx = 20;
    c.nz = 40;
    c.fixedSurface = std::make_shared<gc::ContactSurface>(gc::makePlane(0.006, 0, 0, gc::Solid::below, 0.1));
    c.movingSurface = std::make_shared<gc::ContactSurface>(gc::makeSphere(0.03));
    d.compartments.push_back(c);
  }
  d.fixedThickness.source = gc::ConstantThickness{0.006};
  d.material.E_Pa = 463e6;
  d.material.nu = 0.46;
  gc::JointCoordinates q;
  std::copy(kPressed, kPressed + 6, q.begin());
  const gc::ContactResult expected = gc::ContactPair(d).evaluate(q);
  const SphereOnLayer s;
  const Pair pair = s.makePair();
  const Workspace workspace = makeWorkspace(pair);
  genu_evaluate_options options;
  genu_evaluate_options_init(&options, sizeof options);
  options.with_energy = 1;
  genu_result result = makeResult();
  genu_load loads[2];
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, &options, &result, loads, 2), GENU_OK);
  const auto compare = [](const genu_load& a, const gc::NetLoad& b) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(a.force_on_moving[k], b.forceOnM_F[k]);
      EXPECT_EQ(a.force_on_fixed[k], -b.forceOnM_F[k]);
      EXPECT_EQ(a.moment_on_moving_about_fixed_origin[k], b.momentOnM_Fo_F[k]);
      EXPECT_EQ(a.moment_on_fixed_about_fixed_origin[k], -b.momentOnM_Fo_F[k]);
      EXPECT_EQ(a.center_of_pressure[k], b.centerOfPressure_F[k]);
      EXPECT_EQ(a.peak_point[k], b.peakPoint_F[k]);
    }
    EXPECT_EQ(a.scalar_force, b.scalarForce_N);
    EXPECT_EQ(a.peak_pressure, b.peakPressure_Pa);
    EXPECT_EQ(a.mean_pressure, b.meanPressure_Pa);
    EXPECT_EQ(a.area, b.area_m2);
    EXPECT_EQ(a.energy, b.energy_J);
    EXPECT_EQ(a.max_strain, b.maxStrain);
    EXPECT_EQ(a.active_elements, b.activeElements);
  };
  compare(result.total, expected.total);
  for (size_t k = 0; k < 2; ++k) compare(loads[k], expected.compartments[k]);
  EXPECT_EQ(result.copied, 0);
  ASSERT_EQ(genu_evaluate(pair.get(), workspace.get(), kPressed, nullptr, &options, &result, nullptr, 0), GENU_OK);
  EXPECT_EQ(result.copied, 1);
}

}  // namespace
