// Bad input and extremes: what docs/robustness.md says, row by row.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <string>

#include "contact/Scenes.h"
#include "genu/contact/genu_contact.h"

namespace genu::contact {
namespace {

using namespace test;
using testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

struct Method {
  const char* name;
  ContactRule rule;
  DistanceMethod distance;
};
void PrintTo(const Method& m, std::ostream* out) { *out << m.name; }
constexpr Method kMethods[] = {{"smooth", ContactRule::smooth, DistanceMethod::minimum},
                               {"centre", ContactRule::centre, DistanceMethod::minimum},
                               {"ray", ContactRule::centre, DistanceMethod::ray}};

ContactPairDefinition with(const Method& method, ContactPairDefinition d) {
  d.rule = method.rule;
  d.distance = method.distance;
  return d;
}

JointCoordinates atHeight(double y_m) { return {0, 0, 0, 0, y_m, 0}; }

/** Two parallel planes of 0.1 m: over 10 x 10 mm, 4 x 4 elements, the penetration is d everywhere and the load p(d) A. */
constexpr double kFlatArea_m2 = 1e-4;
ContactPairDefinition makeFlat(const Method& method, double h_m, Material material) {
  return with(method, makeScene(share(makePlane(h_m, 0, 0, Solid::below, 0.05)), share(makePlane(0, 0, 0, Solid::above, 0.05)),
                                constantThickness(h_m), material, 0.005, 4));
}
ContactResult pressFlat(const ContactPairDefinition& d, double h_m, double d_m) {
  return ContactPair(d).evaluate(atHeight(h_m - d_m));
}

struct Law {
  const char* name;
  Material material;
  StrainMeasure strain;
  bool series;
};
void PrintTo(const Law& law, std::ostream* out) { *out << law.name; }
std::vector<Law> makeLaws() {
  return {{"linear", cartilage(), StrainMeasure::small, false},
          {"log", cartilage(), StrainMeasure::large, false},
          {"powerLaw", uhmwpePowerLaw(), StrainMeasure::small, false},
          {"powerLawLarge", uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::large, false},
          {"series", cartilage(), StrainMeasure::large, true}};
}
ContactPairDefinition withLaw(const Law& law, double h_m, ContactPairDefinition d) {
  d.material = law.material;
  d.strain = law.strain;
  if (law.series) {  // halves of different materials
    d.fixedThickness = d.movingThickness = constantThickness(0.5 * h_m);
    d.movingMaterial = uhmwpePowerLaw();
  }
  return d;
}

/** Strain d/h that pressure p causes, from the law's equation (docs/theory.md, "Pressure"), below the continuation. */
double calcStrainOf(const Material& m, StrainMeasure strain, double p_Pa) {
  const double c = m.confinementFactor(), s = p_Pa / m.p0_Pa;
  const double x = m.law == MaterialLaw::linear     ? p_Pa / (c * m.E_Pa)
                   : m.law == MaterialLaw::powerLaw ? 0.5 * m.eps0 * (s + m.n * std::pow(s, m.n)) / c
                                                    : 0.5 * m.eps0 * (s + std::pow(s, m.n)) / c;
  return strain == StrainMeasure::small ? x : 1 - std::exp(-x);
}
double calcStrainOf(const Law& law, double p_Pa) {
  const double fixed = calcStrainOf(law.material, law.strain, p_Pa);
  return law.series ? 0.5 * (fixed + calcStrainOf(uhmwpePowerLaw(), law.strain, p_Pa)) : fixed;
}

void expectFinite(const ContactResult& r) {
  EXPECT_TRUE(r.total.forceOnM_F.allFinite() && r.total.momentOnM_Fo_F.allFinite());
  EXPECT_TRUE(std::isfinite(r.total.scalarForce_N) && std::isfinite(r.total.peakPressure_Pa) && std::isfinite(r.total.energy_J));
  EXPECT_TRUE(r.stiffness.allFinite());
}

class Extremes : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Methods, Extremes, testing::ValuesIn(kMethods), [](const auto& at) { return std::string(at.param.name); });

class ExtremeLaws : public testing::TestWithParam<std::tuple<Method, Law>> {};
INSTANTIATE_TEST_SUITE_P(Methods, ExtremeLaws, testing::Combine(testing::ValuesIn(kMethods), testing::ValuesIn(makeLaws())),
                         [](const auto& at) {
                           return std::string(std::get<0>(at.param).name) + "_" + std::get<1>(at.param).name;
                         });

// ---- Laws at their ends -----------------------------------------------------------------------------------------

// Parallel planes: the strain of the pressure F/A is d/h. Tables of nonlinear laws are good to 1e-9.
TEST_P(ExtremeLaws, UniformPressureSolvesTheLaw) {
  const auto& [method, law] = GetParam();
  for (const double h : {1e-6, 50e-6, 6e-3}) {  // far below 0.1 mm, and a usual one
    for (const double strain : {1e-9, 1e-3, 0.3, 0.9}) {
      const ContactResult r = pressFlat(withLaw(law, h, makeFlat(method, h, {})), h, strain * h);
      // Of the two layers in series the softer one is beyond 0.95 first: its continuation is not this formula.
      if (law.series && strain > 0.4) continue;
      EXPECT_EQ(r.status, EvaluationStatus::ok) << toString(r.status) << " h " << h << " d/h " << strain;
      // h - (h - d) loses digits, and so does the distance: some units of rounding of h and of the coordinates.
      const double rounding = 8 * std::numeric_limits<double>::epsilon() * (h + 0.05) / (strain * h);
      EXPECT_NEAR(calcStrainOf(law, r.total.scalarForce_N / kFlatArea_m2) / strain, 1, 5e-9 + rounding) << "h " << h << " d/h " << strain;
    }
  }
}

// Through 0.95 h and h: the status says so, nothing becomes infinite, and value and slope continue.
TEST_P(ExtremeLaws, FullPenetrationIsReachedWithoutABreak) {
  const auto& [method, law] = GetParam();
  const double h = 4e-3;
  const ContactPairDefinition d = withLaw(law, h, makeFlat(method, h, {}));
  const auto at = [&](double strain) { return pressFlat(d, h, strain * h); };
  EXPECT_EQ(at(0.95 + 1e-6).status, EvaluationStatus::extrapolated);
  EXPECT_EQ(at(1 - 1e-6).status, EvaluationStatus::extrapolated);
  EXPECT_EQ(at(0.95 + 1e-6).total.extrapolatedElements, 16);
  if (!law.series) {
    EXPECT_EQ(at(0.95 - 1e-6).status, EvaluationStatus::ok);
  }
  for (const double strain : {1 + 1e-9, 1.5, 10.0}) {
    const ContactResult r = at(strain);
    EXPECT_EQ(r.status, EvaluationStatus::fullPenetration) << strain;
    EXPECT_EQ(r.total.fullPenetrationElements, 16);
    expectFinite(r);
  }
  // The measure's curvature over slope is at most 1/(1 - 0.95) = 20: over steps of 1e-5 slopes differ by 4e-4 (two steps); the
  // tables add 1e-9 of the value over 1e-5. A kink of the continuation would be of the order of 1.
  const double step = 1e-5;
  for (const double strain : {0.95, 1.0}) {
    const double low = at(strain - step).total.scalarForce_N, middle = at(strain).total.scalarForce_N, high = at(strain + step).total.scalarForce_N;
    EXPECT_GT(middle, low);
    EXPECT_NEAR((high - middle) / (middle - low), 1, 1e-3) << strain;
  }
}

TEST_P(Extremes, LogarithmContinuesAlongItsTangent) {
  const double h = 4e-3;
  ContactPairDefinition d = makeFlat(GetParam(), h, cartilage());
  d.strain = StrainMeasure::large;
  const double K = cartilage().confinementFactor() * cartilage().E_Pa;
  for (const double strain : {0.97, 1.0, 1.5}) {
    // Tangent of -ln(1 - e) at 0.95: slope 20. Table: 1e-9.
    EXPECT_NEAR(pressFlat(d, h, strain * h).total.scalarForce_N / (K * kFlatArea_m2 * (-std::log(0.05) + 20 * (strain - 0.95))), 1, 2e-9);
  }
}

// A linear load is proportional to c(nu); c(0.4999) = 1667 c(0).
TEST_P(Extremes, NearlyIncompressible) {
  const double h = 4e-3;
  Material m = cartilage();
  m.nu = 0;
  const double reference = pressFlat(makeFlat(GetParam(), h, m), h, 0.1 * h).total.scalarForce_N;
  for (const double nu : {0.49, 0.499, 0.4999, 0.4999999}) {
    m.nu = nu;
    // c of double precision itself errs by epsilon / (1 - 2 nu).
    const double tolerance = 1e-12 + 4e-16 / (1 - 2 * nu);
    EXPECT_NEAR(pressFlat(makeFlat(GetParam(), h, m), h, 0.1 * h).total.scalarForce_N / reference * (1 + nu) * (1 - 2 * nu) / (1 - nu), 1, tolerance);
  }
  m.nu = 0.5;
  EXPECT_THROW(ContactPair(makeFlat(GetParam(), h, m)), std::invalid_argument);
}

// ---- Lengths ----------------------------------------------------------------------------------------------------

/** Force of a sphere of radius R pressed D into a flat layer: int K/h AB over the contact (p m_y = K AB/h), or by ray
 int K/h AC cos(theta), w = sqrt(R^2 - rho^2) from R - D to R. */
double calcSphereForce(const Method& method, double K, double R, double D, double h) {
  const double H = R - D;
  if (method.distance == DistanceMethod::minimum) return kPi * K * D * D * (R - 2 * D / 3) / h;
  return 2 * kPi * K / (h * R) * (R * R * R * (R / 4 - H / 3) + H * H * H * H / 12);
}
ContactPairDefinition makeSphereScene(const Method& method, double R, double D, double h, int cellsPerRadius, double extent) {
  // Contact radius sqrt(2 R D), seen on the layer; 20 % of room around it.
  const double half = 1.2 * std::sqrt(2 * R * D);
  return with(method, makeScene(share(makePlane(h, 0, 0, Solid::below, extent)), share(makeSphere(R)), constantThickness(h), cartilage(), half,
                                static_cast<int>(2.4 * cellsPerRadius)));
}

// Same shape at another size: forces as the square, moments and energies as the cube. Feet are found to 1e-13 m, which moves
// a distance by its square over 2 R, 1e-9 of the penetration at the smallest size, and turns the direction by 3e-6.
TEST_P(Extremes, ForcesScaleWithTheSquareOfLength) {
  const double R = 0.03, D = 0.2e-3, h = 4e-3;
  const auto press = [&](double scale) {
    return ContactPair(makeSphereScene(GetParam(), scale * R, scale * D, scale * h, 10, scale * 0.05))
        .evaluate({0.1, 0.2, 0.3, 0, scale * (h + R - D), 0});
  };
  const ContactResult reference = press(1);
  ASSERT_EQ(reference.status, EvaluationStatus::ok);
  for (const double scale : {1e-6, 1e-3, 1e3}) {
    const ContactResult r = press(scale);
    EXPECT_EQ(r.status, EvaluationStatus::ok) << scale << " " << toString(r.status);
    EXPECT_NEAR(r.total.forceOnM_F.y() / (scale * scale * reference.total.forceOnM_F.y()), 1, 1e-5) << scale;
    EXPECT_NEAR(r.total.energy_J / (scale * scale * scale * reference.total.energy_J), 1, 1e-5) << scale;
    EXPECT_NEAR(r.total.peakPressure_Pa / reference.total.peakPressure_Pa, 1, 1e-5) << scale;
    EXPECT_EQ(r.total.activeElements, reference.total.activeElements) << scale;
  }
}

// Layers of 100 um to 1 um: a tenth of them pressed in, closed form; the rim makes N^-2.5 (docs/theory.md).
TEST_P(Extremes, ThinLayers) {
  const double R = 0.03, K = cartilage().confinementFactor() * cartilage().E_Pa;
  for (const double h : {100e-6, 10e-6, 1e-6}) {
    const double D = 0.1 * h;
    const ContactResult r = ContactPair(makeSphereScene(GetParam(), R, D, h, 20, 0.05)).evaluate(atHeight(h + R - D));
    EXPECT_EQ(r.status, EvaluationStatus::ok);
    EXPECT_NEAR(r.total.forceOnM_F.y() / calcSphereForce(GetParam(), K, R, D, h), 1, std::pow(20, -2.5)) << h;
  }
}

/** A layer between y = 0 and the fixed plane y = slope x, x from 0 to L: no thickness at x = 0. The moving surface is the same
 plane, moved down along its normal by d: penetration d everywhere. */
struct Wedge {
  double slope = 0.5, L = 0.02, d_m = 0.2e-3;
  int n = 40;
  ContactPair make(const Method& method, std::optional<double> min_m) const {
    Thickness t = aboveZero();
    t.min_m = min_m;
    ContactPairDefinition d = with(method, makeScene(share(makePlane(0, slope, 0, Solid::below, 0.1)), share(makePlane(0, slope, 0, Solid::above, 0.1)),
                                                     t, cartilage(), 0.5 * L, n, 0.5 * L));
    d.compartments[0].z0_m = 0;
    d.compartments[0].z1_m = 0.01;
    return ContactPair(d);
  }
  double cosine() const { return 1 / std::sqrt(1 + slope * slope); }
  JointCoordinates pose() const { return {0, 0, 0, slope * cosine() * d_m, -cosine() * d_m, 0}; }
  double h(double x) const { return slope * x; }
};

TEST_P(Extremes, LayerThatThinsToNothing) {
  const Wedge wedge;
  const ContactResult r = wedge.make(GetParam(), {}).evaluate(wedge.pose());
  EXPECT_EQ(r.status, EvaluationStatus::fullPenetration);
  int through = 0;  // elements whose layer is thinner than the penetration
  for (int i = 0; i < wedge.n; ++i) through += wedge.h((i + 0.5) * wedge.L / wedge.n) <= wedge.d_m ? wedge.n : 0;
  EXPECT_GT(through, 0);
  EXPECT_EQ(r.total.fullPenetrationElements, through);
  expectFinite(r);
}

// With `min` it is sound. p = K d/max(h, min); int dx / max(slope x, min) = (1 + ln(slope L/min))/slope. Cells of width w make
// errors of second order: w^2/24 of the integrand's second derivative, whose integral is (x_c is where the clamp ends) the slope
// 1/x_c^2 there, and the kink itself slope w^2/8: relative to 1 + ln at most (w/x_c)^2/6.
TEST_P(Extremes, ClampedLayerThatThinsToNothing) {
  const Wedge wedge;
  const double min = 1e-3, K = cartilage().confinementFactor() * cartilage().E_Pa;
  const ContactResult r = wedge.make(GetParam(), min).evaluate(wedge.pose());
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  const double integral = (1 + std::log(wedge.slope * wedge.L / min)) / wedge.slope, x_c = min / wedge.slope, w = wedge.L / wedge.n;
  const double exact = K * wedge.d_m * integral * 0.01 / wedge.cosine();
  EXPECT_NEAR(r.total.scalarForce_N / exact, 1, std::pow(w / x_c, 2) / 6);
}

TEST_P(Extremes, NoThicknessIsRefused) {
  EXPECT_THROW(ContactPair(makeFlat(GetParam(), 0, cartilage())), std::invalid_argument);
  ContactPairDefinition d = makeFlat(GetParam(), 1e-3, cartilage());
  Thickness t;
  t.source = HeightAbovePlane{1e-3};  // the surface itself
  d.fixedThickness = t;
  EXPECT_THROW(ContactPair{d}, std::invalid_argument);
}

// ---- Surfaces ---------------------------------------------------------------------------------------------------

// The moving half-space turned by phi about x: penetration AB = z sin(phi), d = AB/cos(phi/2), so that
// int p dA = K a^3/h 2 sin(phi/2) over x in [-a, a], z in [0, a]. Linear in z: exact for both rules. The ray's AC is AB/cos(phi),
// up to 2.9 m long.
TEST_P(Extremes, GrazingSurfaces) {
  const double a = 5e-3, h = 0.02, K = cartilage().confinementFactor() * cartilage().E_Pa;
  const ContactPair pair(with(GetParam(), makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), share(makePlane(0, 0, 0, Solid::above, 10)),
                                                    constantThickness(h), cartilage(), a, 10)));
  for (const double degrees : {60.0, 89.0, 89.9}) {
    const double phi = degrees * kPi / 180;
    const ContactResult r = pair.evaluate({phi, 0, 0, 0, h, 0});
    EXPECT_EQ(r.status, EvaluationStatus::ok) << degrees << " " << toString(r.status);
    // Feet on a plane of 20 m are rounded to 1e-14 m, against penetrations of mm; the ray divides by cos(89.9 deg) = 1/573.
    EXPECT_NEAR(r.total.scalarForce_N / (K * a * a * a / h * 2 * std::sin(phi / 2)), 1, 1e-8) << degrees;
    // Along the bisector.
    EXPECT_NEAR(r.total.forceOnM_F.z() / r.total.forceOnM_F.y(), std::tan(phi / 2), 1e-8);
  }
  // Beyond a right angle the surface faces away. A ray there never enters the solid: nothing.
  const ContactResult away = pair.evaluate({90.1 * kPi / 180, 0, 0, 0, h, 0});
  expectFinite(away);
  if (GetParam().distance == DistanceMethod::minimum) {
    EXPECT_EQ(away.status, EvaluationStatus::fullPenetration);
  } else {
    EXPECT_EQ(away.total.scalarForce_N, 0);
  }
}

// Outside the moving surface's border there is no material: less than the force of a larger surface, and it is counted.
TEST_P(Extremes, OpenBorderInsideTheContact) {
  const double h = 4e-3, d = 0.2e-3;
  ContactPairDefinition definition = makeFlat(GetParam(), h, cartilage());
  definition.compartments[0].nx = definition.compartments[0].nz = 20;
  const double whole = pressFlat(definition, h, d).total.scalarForce_N;
  definition.compartments[0].movingSurface = share(makePlane(0, 0, 0, Solid::above, 2.6e-3));
  const ContactResult r = pressFlat(definition, h, d);
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  EXPECT_GT(r.total.boundaryElements, 0);
  EXPECT_GT(r.total.scalarForce_N, 0);
  EXPECT_LT(r.total.scalarForce_N, whole);
  EXPECT_LE(r.total.peakPressure_Pa, 1.001 * cartilage().confinementFactor() * cartilage().E_Pa * d / h);
}

/** A sphere as a surface of revolution about y: poles, collapsed edges, a seam, knots repeated to the degree. */
NurbsPatchData makePolarSphere(double R) {
  NurbsPatchData d;
  d.degreeU = d.degreeV = 2;
  d.numU = 9;
  d.numV = 5;
  d.knotsU = {0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4};
  d.knotsV = {0, 0, 0, 1, 1, 2, 2, 2};
  constexpr double cx[] = {1, 1, 0, -1, -1, -1, 0, 1, 1}, cz[] = {0, 1, 1, 1, 0, -1, -1, -1, 0};
  constexpr double r[] = {0, 1, 1, 1, 0}, y[] = {-1, -1, 0, 1, 1};
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 5; ++j) {
      d.points.push_back(R * Vec3(r[j] * cx[i], y[j], r[j] * cz[i]));
      d.weights.push_back((i % 2 ? std::sqrt(0.5) : 1) * (j % 2 ? std::sqrt(0.5) : 1));
    }
  }
  d.flipNormal = NurbsPatch(d).calcNormal(0.5, 1).x() < 0;
  return d;
}

// The pole in the middle of the contact: as the sphere of two charts that has none. Feet within a hair of a pole are found to
// 1e-10 of the size (ContactSurface): 1e-8 of a penetration of 0.2 mm.
TEST_P(Extremes, PoleInsideTheContact) {
  const double R = 0.03, D = 0.2e-3, h = 4e-3;
  ContactPairDefinition d = makeSphereScene(GetParam(), R, D, h, 10, 0.05);
  for (const int n : {24, 25}) {  // odd: an element straight below the pole
    d.compartments[0].nx = d.compartments[0].nz = n;
    for (const double tilt : {0.0, 1e-9, 1e-3}) {
      d.compartments[0].movingSurface = share(makeSphere(R));
      const ContactResult smooth = ContactPair(d).evaluate({tilt, 0, 0, 0, h + R - D, 0});
      std::vector<NurbsPatch> polar;
      polar.emplace_back(makePolarSphere(R));
      d.compartments[0].movingSurface = share(std::move(polar));
      const ContactResult pole = ContactPair(d).evaluate({tilt, 0, 0, 0, h + R - D, 0});
      EXPECT_EQ(pole.status, EvaluationStatus::ok) << n << " " << tilt;
      EXPECT_NEAR(pole.total.forceOnM_F.y() / smooth.total.forceOnM_F.y(), 1, 1e-7) << n << " " << tilt;
      EXPECT_LT((pole.total.forceOnM_F - smooth.total.forceOnM_F).norm(), 1e-7 * smooth.total.scalarForce_N) << n << " " << tilt;
    }
  }
}

/** y = slope |x|, solid above, of degree 1: a crease at x = 0. */
NurbsPatchData makeRoof(double slope, double half) {
  NurbsPatchData d;
  d.degreeU = d.degreeV = 1;
  d.numU = 3;
  d.numV = 2;
  d.knotsU = {0, 0, 0.5, 1, 1};
  d.knotsV = {0, 0, 1, 1};
  for (const double x : {-half, 0.0, half}) {
    for (const double z : {-half, half}) d.points.push_back(Vec3(x, slope * std::abs(x), z));
  }
  d.flipNormal = NurbsPatch(d).calcNormal(0.25, 0.5).y() > 0;
  return d;
}

// A repeated knot (multiplicity = degree). AB = D cos(a) - |x| sin(a), p m_y = K AB/h: F_y = K/h 2 b cos(a) D^2/slope over
// |z| <= b. N = 8 cells from the crease to the rim, the crease between two cells or in the middle of one. Centre rule: the cell at the
// rim errs by at most 1/(4 N^2) on each side, by ray AC is steeper, the same in N; smooth rule: the parabola across the crease,
// 1/(12 N^2) (both cells together k w/12, k the slope times w). Bound: 1/N^2.
TEST_P(Extremes, CreaseInsideTheContact) {
  const double slope = 0.1, b = 5e-3, h = 4e-3, K = cartilage().confinementFactor() * cartilage().E_Pa;
  const int N = 8;
  for (const int n : {20, 21}) {
    const double D = slope * N * (2 * b / n), cosine = 1 / std::sqrt(1 + slope * slope);
    std::vector<NurbsPatch> roof;
    roof.emplace_back(makeRoof(slope, 0.05));
    const ContactPair pair(with(GetParam(), makeScene(share(makePlane(h, 0, 0, Solid::below, 0.05)), share(std::move(roof)),
                                                      constantThickness(h), cartilage(), b, n)));
    const ContactResult r = pair.evaluate(atHeight(h - D));
    EXPECT_EQ(r.status, EvaluationStatus::ok) << toString(r.status);
    // By ray AC = D - slope |x| and p m_y = K AC cos(a)/h: the same.
    EXPECT_NEAR(r.total.forceOnM_F.y() / (K / h * 2 * b * cosine * D * D / slope), 1, 1.0 / (N * N));
    // Symmetric, but a point straight behind the crease has two nearest points and takes one.
    EXPECT_NEAR(r.total.forceOnM_F.x() / r.total.forceOnM_F.y(), 0, n % 2 == 0 ? 1e-9 : slope / N);
    // Above the layer the nearest points of the middle elements are on the crease.
    for (const double gap : {1e-6, 1e-3, 1e-2}) {
      const ContactResult above = pair.evaluate(atHeight(h + gap));
      EXPECT_EQ(above.status, EvaluationStatus::ok) << n << " " << gap << " " << toString(above.status);
      EXPECT_EQ(above.total.scalarForce_N, 0);
    }
  }
}

/** A plane whose parameter lines crowd at x = 0, where S_u vanishes although the surface is smooth. */
NurbsPatchData makeCrowdedPlane(double half) {
  NurbsPatchData d;
  d.degreeU = 2;
  d.degreeV = 1;
  d.numU = 5;
  d.numV = 2;
  d.knotsU = {0, 0, 0, 0.5, 0.5, 1, 1, 1};
  d.knotsV = {0, 0, 1, 1};
  for (const double x : {-half, 0.0, 0.0, 0.0, half}) {
    for (const double z : {-half, half}) d.points.push_back(Vec3(x, 0, z));
  }
  d.flipNormal = NurbsPatch(d).calcNormal(0.25, 0.5).y() > 0;
  return d;
}

// Coinciding rows of control points: a foot's search that starts on the other side of the line must not end on it.
TEST_P(Extremes, CoincidingControlPoints) {
  const double h = 4e-3, strain = 0.05;
  ContactPairDefinition d = makeFlat(GetParam(), h, cartilage());
  const double expected = pressFlat(d, h, strain * h).total.forceOnM_F.y();
  std::vector<NurbsPatch> crowded;
  crowded.emplace_back(makeCrowdedPlane(0.05));
  d.compartments[0].movingSurface = share(std::move(crowded));
  for (const int n : {4, 5}) {  // odd: elements above the line
    d.compartments[0].nx = n;
    const ContactResult r = pressFlat(d, h, strain * h);
    expectFinite(r);
    EXPECT_EQ(r.status, EvaluationStatus::ok) << n;
    EXPECT_NEAR(r.total.forceOnM_F.y() / expected, 1, 1e-9) << n;
  }
}

// ---- Poses ------------------------------------------------------------------------------------------------------

TEST_P(Extremes, CoordinatesThatAreNotFinite) {
  const double h = 4e-3;
  const ContactPair pair(makeFlat(GetParam(), h, cartilage()));
  ContactWorkspace workspace(pair);
  ContactResult r;
  const ContactPair::Options options;
  const JointCoordinates touching = atHeight(h - 1e-4);
  pair.evaluate(touching, workspace, options, r);
  const ContactResult before = r;
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (size_t k = 0; k < 12; ++k) {
      JointCoordinates q = touching, rates{};
      (k < 6 ? q[k] : rates[k - 6]) = bad;
      pair.evaluate(q, rates, workspace, options, r);
      EXPECT_EQ(r.status, EvaluationStatus::notConverged);
      EXPECT_EQ(r.total.forceOnM_F.norm(), 0);
      EXPECT_EQ(r.total.notConvergedQueries, 1);
      // And nothing of it is remembered.
      pair.evaluate(touching, workspace, options, r);
      EXPECT_EQ(r.total.scalarForce_N, before.total.scalarForce_N);
    }
  }
}

// 1000 km away: no contact, or, with the moving half-space's solid over the layer, full penetration.
TEST_P(Extremes, PosesFarAway) {
  const double h = 4e-3;
  const ContactPair pair(makeFlat(GetParam(), h, cartilage()));
  for (size_t k = 0; k < 6; ++k) {
    for (const double far_m : {1e6, -1e6}) {
      JointCoordinates q = atHeight(h + 0.01);
      q[k] = far_m;  // of angles: many turns
      const ContactResult r = pair.evaluate(q);
      expectFinite(r);
      if (k < 3) continue;
      if (k == 4 && far_m < 0) {
        EXPECT_EQ(r.status, EvaluationStatus::fullPenetration);
      } else {
        EXPECT_EQ(r.status, EvaluationStatus::ok) << k << " " << far_m << " " << toString(r.status);
        EXPECT_EQ(r.total.scalarForce_N, 0);
      }
    }
  }
}

// The same over a round surface, where a foot cannot be found to 1e-13 m: also coming from nearby.
TEST_P(Extremes, PosesFarFromARoundSurface) {
  const double R = 0.03, D = 0.2e-3, h = 4e-3;
  const ContactPair pair(makeSphereScene(GetParam(), R, D, h, 10, 0.05));
  for (const double far_m : {1e2, 1e3, 1e6}) {
    ContactWorkspace workspace(pair);
    ContactResult r;
    for (const double y : {h + R + 0.01, far_m, -far_m}) {
      pair.evaluate({0, 0, 0, 0, y, 0}, JointCoordinates{}, workspace, ContactPair::Options{}, r);
      EXPECT_EQ(r.status, EvaluationStatus::ok) << y << " " << toString(r.status);
      EXPECT_EQ(r.total.scalarForce_N, 0);
    }
  }
}

// Where no foot can be resolved the answer is a status, and comes at once.
TEST_P(Extremes, PosesBeyondResolution) {
  const ContactPair pair(makeFlat(GetParam(), 4e-3, cartilage()));
  for (const double far_m : {1e12, 1e100, 1e200, 1e308}) {
    const ContactResult r = pair.evaluate(atHeight(far_m));
    EXPECT_EQ(r.status, EvaluationStatus::notConverged) << far_m;
    EXPECT_EQ(r.total.scalarForce_N, 0);
  }
}

// Angles of many turns: as those without. sin and cos of 2 pi k + a lose the digits that a loses, 1e6 epsilon.
TEST_P(Extremes, ManyTurns) {
  const double R = 0.03, D = 0.2e-3, h = 4e-3, turns = 2 * kPi * 1e5;
  ContactPairDefinition d = makeSphereScene(GetParam(), R, D, h, 10, 0.05);
  d.compartments[0].movingSurface = share(makeEllipsoid(0.028, 0.03, 0.032));
  const ContactPair pair(d);
  const ContactResult a = pair.evaluate({0.01, 0.02, -0.01, 0, h + R - D, 0}), b = pair.evaluate({0.01 + turns, 0.02 - turns, -0.01, 0, h + R - D, 0});
  EXPECT_NEAR(b.total.scalarForce_N / a.total.scalarForce_N, 1, 1e-6);
}

// At ry = 90 deg the first and the last axis coincide: R(rx, 90, rz) = R(rx + rz, 90, 0), and their stiffnesses agree.
TEST_P(Extremes, GimbalLock) {
  const double R = 0.03, D = 0.2e-3, h = 4e-3;
  ContactPairDefinition d = makeSphereScene(GetParam(), R, D, h, 10, 0.05);
  d.compartments[0].movingSurface = share(makeEllipsoid(0.028, 0.03, 0.032));
  const ContactPair pair(d);
  ContactPair::Options options;
  options.withStiffness = GetParam().rule == ContactRule::smooth;
  const ContactResult a = pair.evaluate({0.02, 0.5 * kPi, 0.01, 0, h + R - D, 0}, options), b = pair.evaluate({0.03, 0.5 * kPi, 0, 0, h + R - D, 0}, options);
  EXPECT_EQ(a.status, EvaluationStatus::ok);
  ASSERT_GT(a.total.scalarForce_N, 0);
  // Feet to 1e-13 m, angles to 1e-16: 1e-9 of a penetration of 0.2 mm; a cell of the centre rule does not switch.
  EXPECT_LT((a.total.forceOnM_F - b.total.forceOnM_F).norm(), 1e-8 * a.total.scalarForce_N);
  expectFinite(a);
  if (!options.withStiffness) return;
  EXPECT_LT((a.stiffness.col(0) - a.stiffness.col(2)).norm(), 1e-8 * a.stiffness.norm());
  EXPECT_GT(a.stiffness.col(0).norm(), 0);
}

TEST_P(Extremes, NoContact) {
  const double h = 4e-3;
  const ContactPair pair(makeFlat(GetParam(), h, cartilage()));
  ContactPair::Options options;
  options.withEnergy = true;
  options.withStiffness = GetParam().rule == ContactRule::smooth;
  for (const double gap : {1e-9, 1e-3, 1.0}) {
    const ContactResult r = pair.evaluate(atHeight(h + gap), options);
    EXPECT_EQ(r.status, EvaluationStatus::ok);
    EXPECT_EQ(r.total.forceOnM_F, Vec3(0, 0, 0));
    EXPECT_EQ(r.total.momentOnM_Fo_F, Vec3(0, 0, 0));
    EXPECT_EQ(r.total.centerOfPressure_F, Vec3(0, 0, 0));
    EXPECT_EQ(r.total.meanPressure_Pa, 0);
    EXPECT_EQ(r.total.energy_J, 0);
    EXPECT_EQ(r.total.area_m2, 0);
    EXPECT_EQ(r.total.activeElements, 0);
    EXPECT_EQ(r.stiffness.norm(), 0);
  }
}

// ---- Grids and numbers ------------------------------------------------------------------------------------------

// One element: p A of the plane; no room for differences inside, the ring around it gives them.
TEST_P(ExtremeLaws, OneElement) {
  const auto& [method, law] = GetParam();
  const double h = 4e-3, strain = 0.2;
  ContactPairDefinition d = withLaw(law, h, makeFlat(method, h, {}));
  const double expected = pressFlat(d, h, strain * h).total.scalarForce_N;
  d.compartments[0].nx = d.compartments[0].nz = 1;
  const ContactResult r = pressFlat(d, h, strain * h);
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  EXPECT_EQ(r.total.activeElements, 1);
  EXPECT_NEAR(r.total.scalarForce_N / expected, 1, 1e-12);
  EXPECT_NEAR(r.total.area_m2 / kFlatArea_m2, 1, 1e-12);
}

// Products beyond the range of double: a status, not a quiet infinity.
TEST_P(Extremes, OverflowIsAStatus) {
  const double h = 4e-3;
  Material m = cartilage();
  m.E_Pa = 1e308;
  m.nu = 0.4999;
  EXPECT_EQ(pressFlat(makeFlat(GetParam(), h, m), h, 0.5 * h).status, EvaluationStatus::notConverged);
  // The smallest ones simply vanish.
  m.E_Pa = 1e-300;
  const ContactResult r = pressFlat(makeFlat(GetParam(), h, m), h, 0.5 * h);
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  expectFinite(r);
}

/** Crumpled sheets that carry a coarse grid: from one grid point to the next the area per cell grows many times over, and polynomials
 through both go below zero. */
TEST(WallsBetweenGridPoints, NoSumBelowZeroWithoutAStatus) {
  int unresolved = 0, touching = 0;
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 1140u, 1272u, 1372u, 1494u}) {
    std::mt19937 random(seed);
    const auto next = [&] { return random() / 2147483648.0 - 1; };
    NurbsPatchData crumpled;
    crumpled.degreeU = crumpled.degreeV = 1;
    crumpled.numU = crumpled.numV = 3;
    crumpled.knotsU = crumpled.knotsV = {0, 0, 0.5, 1, 1};
    for (int k = 0; k < 9; ++k) {
      const double x = next(), y = next(), z = next();
      crumpled.points.push_back(0.01 * Vec3(x, y, z));
    }
    std::vector<NurbsPatch> sheet;
    sheet.emplace_back(std::move(crumpled));
    ContactPairDefinition d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.05)), share(std::move(sheet)), constantThickness(0.003),
                                        cartilage(), 0.01, 5);
    d.gridOn = GridOn::moving;
    d.compartments[0].elementSurface = ElementPlane{PlaneFacing::down};
    JointCoordinates q{};
    for (double& x : q) x = next();
    q[3] = q[5] = 0;
    q[4] = 0.006 + 0.005 * q[4];
    for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
      d.rule = rule;
      std::optional<ContactPair> pair;
      try {
        pair.emplace(d);
      } catch (const std::invalid_argument&) {
        continue;  // no cell meets the sheet
      }
      const NetLoad load = pair->evaluate(q).total;
      touching += load.activeElements > 0;
      if (load.unresolvedCompartments > 0) {
        ++unresolved;
        EXPECT_EQ(pair->evaluate(q).status, EvaluationStatus::notConverged);
        EXPECT_EQ(rule, ContactRule::smooth);
        continue;
      }
      EXPECT_GE(load.scalarForce_N, 0) << seed;
      EXPECT_GE(load.energy_J, 0) << seed;
      EXPECT_GE(load.area_m2, 0) << seed;
    }
  }
  EXPECT_EQ(unresolved, 4);  // the last four sheets
  EXPECT_GT(touching, 2 * unresolved);
}

TEST(ExtremeInput, DefinitionsThatAreNotFiniteAreRefused) {
  const auto whyNot = [](const std::function<void(ContactPairDefinition&)>& spoil) -> std::string {
    ContactPairDefinition d = makeFlat(kMethods[0], 4e-3, cartilage());
    spoil(d);
    try {
      ContactPair pair(d);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "accepted";
  };
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_THAT(whyNot([bad](auto& d) { d.compartments[0].x0_m = bad; }), HasSubstr("rectangle"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.compartments[0].z1_m = bad; }), HasSubstr("finite"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.planeY_m = bad; }), HasSubstr("element plane"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.fixedThickness = constantThickness(bad); }), HasSubstr("thickness of the fixed body"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.fixedThickness.source = HeightAbovePlane{bad}; }), HasSubstr("its plane y"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.fixedThickness.min_m = bad; }), HasSubstr("min"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.fixedThickness.missing_m = bad; }), HasSubstr("missing"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.material.E_Pa = bad; }), HasSubstr("E [Pa]"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.material.nu = bad; }), HasSubstr("nu"));
    EXPECT_THAT(whyNot([bad](auto& d) { d.damping_sPerM = bad; }), HasSubstr("damping"));
    ElementCylinder cylinder;
    cylinder.angle1_rad = cylinder.axial1_m = 1;
    cylinder.point_m.x() = bad;
    EXPECT_THAT(whyNot([&](auto& d) { d.compartments[0].elementSurface = cylinder; }), HasSubstr("point on the axis"));
    ElementSphere sphere;
    sphere.angle1_rad = sphere.elevation1_rad = 1;
    sphere.center_m.z() = bad;
    EXPECT_THAT(whyNot([&](auto& d) { d.compartments[0].elementSurface = sphere; }), HasSubstr("centre"));
    EXPECT_THROW(makePlane(bad, 0, 0, Solid::below, 1), std::invalid_argument);
    EXPECT_THROW(makeSphere(bad), std::invalid_argument);
    NurbsPatchData patch = makeRoof(0.1, 1);
    patch.points[1].z() = bad;
    EXPECT_THROW(NurbsPatch{patch}, std::invalid_argument);
    patch = makeRoof(0.1, 1);
    patch.knotsU[2] = bad;
    EXPECT_THROW(NurbsPatch{patch}, std::invalid_argument);
    patch = makeRoof(0.1, 1);
    patch.weights.assign(patch.points.size(), 1);
    patch.weights[0] = bad;
    EXPECT_THROW(NurbsPatch{patch}, std::invalid_argument);
  }
}

// The work that a definition can ask for has a limit.
TEST(ExtremeInput, HugeGridsAreRefused) {
  const auto whyNot = [](int nx, int nz) -> std::string {
    ContactPairDefinition d = makeFlat(kMethods[0], 4e-3, cartilage());
    d.compartments[0].nx = nx;
    d.compartments[0].nz = nz;
    try {
      ContactPair pair(d);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_THAT(whyNot(0, 1), HasSubstr("1 to 10000"));
  EXPECT_THAT(whyNot(10001, 1), HasSubstr("1 to 10000"));
  EXPECT_THAT(whyNot(std::numeric_limits<int>::max(), std::numeric_limits<int>::max()), HasSubstr("1 to 10000"));
  EXPECT_THAT(whyNot(4000, 4001), HasSubstr("16000000"));
  ContactPairDefinition d = makeFlat(kMethods[0], 4e-3, cartilage());
  BackSurface back;
  back.surface = share(makePlane(0.001, 0, 0, Solid::above, 0.05));
  d.movingThickness.source = back;
  d.movingThickness.mapSamplesU = 4097;
  EXPECT_THROW(ContactPair{d}, std::invalid_argument);
}

TEST(ExtremeInput, CInterfaceRefusesNumbersThatAreNotFinite) {
  genu_surface* surface = nullptr;
  EXPECT_EQ(genu_surface_create_sphere(kNaN, &surface), GENU_BAD_ARGUMENT);
  EXPECT_EQ(surface, nullptr);
  ASSERT_EQ(genu_surface_create_plane(0.004, 0, 0, GENU_SOLID_BELOW, 0.05, &surface), GENU_OK);
  genu_surface* ball = nullptr;
  ASSERT_EQ(genu_surface_create_sphere(0.03, &ball), GENU_OK);
  genu_compartment c = {};
  c.x0 = c.z0 = -0.005;
  c.x1 = c.z1 = 0.005;
  c.nx = c.nz = 5;
  c.fixed = surface;
  c.moving = ball;
  genu_pair_options options;
  genu_pair_options_init(&options, sizeof options);
  options.compartments = &c;
  options.num_compartments = 1;
  options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
  options.fixed_thickness.value = 0.004;
  options.material.youngs_modulus = 4e6;
  options.material.poisson_ratio = 0.45;
  genu_pair* pair = nullptr;
  ASSERT_EQ(genu_pair_create(&options, &pair), GENU_OK) << genu_last_error();
  genu_workspace* workspace = nullptr;
  ASSERT_EQ(genu_workspace_create(pair, &workspace), GENU_OK);
  genu_result result;
  genu_result_init(&result, sizeof result);
  result.total.scalar_force = -7;  // no output is touched
  for (int k = 0; k < 12; ++k) {
    double numbers[12] = {0, 0, 0, 0, 0.0335, 0, 0, 0, 0, 0, 0, 0};
    numbers[k] = k % 2 ? kNaN : kInfinity;
    EXPECT_EQ(genu_evaluate(pair, workspace, numbers, numbers + 6, nullptr, &result, nullptr, 0), GENU_BAD_ARGUMENT);
    EXPECT_EQ(result.total.scalar_force, -7);
    EXPECT_THAT(genu_last_error(), HasSubstr("finite"));
  }
  genu_workspace_destroy(workspace);
  genu_pair_destroy(pair);
  genu_surface_destroy(ball);
  genu_surface_destroy(surface);
}

}  // namespace
}  // namespace genu::contact
