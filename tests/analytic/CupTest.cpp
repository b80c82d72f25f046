// Round element surfaces against a quadrature of the method's own definition: a ball in a spherical cup, a shaft in a
// cylindrical one, a ball on a ball (docs/theory.md, "Closed forms").
//
// The reference. The contact is symmetric about e, the direction from the centre of the fixed surface (radius R2) to that of
// the moving one (radius R1, at distance delta). A point A of the fixed surface at angle psi from e, with outward normal n:
//   r = A - c,  AB = R1 - |r|,  u = -r/|r| (inward normal of the ball at B),  cos(theta) = n.u,  d = AB/cos(theta/2),
//   m = (n + u)/|n + u|,  f = int p(d) m.e dA,  dA = 2 pi R2^2 sin(psi) dpsi (ball) or L R2 dpsi (shaft).
// Everything here is written out again, independently of the engine: vectors in the plane of e and A, laws by hand.
//
// Tolerances. The smooth rule errs like the fourth power of the cell (OrderOfConvergence). With N cells per contact radius
// the flat-layer cases need N = 10 for 1e-6; here N = 16, and the gap is as smooth in the angles. 1e-5 leaves room for the cells
// of unequal shape far from the grid's equator.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "contact/Scenes.h"

namespace genu::contact {
namespace {

using namespace test;

constexpr double kTolerance = 1e-5;

std::vector<NurbsPatch> flip(const std::vector<NurbsPatch>& patches) {
  std::vector<NurbsPatch> out;
  for (const NurbsPatch& p : patches) out.push_back(p.flipped());
  return out;
}

/** Root of an increasing function. */
double bisect(const std::function<double(double)>& f, double low, double high) {
  for (int i = 0; i < 200; ++i) {
    const double x = 0.5 * (low + high);
    (f(x) < 0 ? low : high) = x;
  }
  return 0.5 * (low + high);
}

/** p(d) of a layer h, written out from PressureLaw.h. */
using Law = std::function<double(double d, double h)>;
Law makeLaw(const Material& m, StrainMeasure strain) {
  const double c = (1 - m.nu) / ((1 + m.nu) * (1 - 2 * m.nu));
  return [=](double d, double h) {
    const double x = strain == StrainMeasure::small ? d / h : -std::log(1 - d / h);
    if (m.law == MaterialLaw::linear) return c * m.E_Pa * x;
    const double factor = m.law == MaterialLaw::powerLaw ? m.n : 1;
    return m.p0_Pa * bisect([&](double s) { return m.eps0 / 2 * (s + factor * std::pow(s, m.n)) - c * x; }, 0, 100);
  };
}

struct Reference {
  double force, scalar, peak, area;
};

/** normalSign -1: the fixed surface is a socket; 1: a ball. length > 0: cylinders. */
Reference integrate(double R2, double normalSign, double R1, double delta, double h, const Law& law, double length = 0) {
  const auto gap = [&](double psi) { return std::hypot(R2 * std::cos(psi) - delta, R2 * std::sin(psi)) - R1; };
  const double rim = bisect(gap, 0, 0.5 * kPi);
  Reference out{0, 0, 0, 0};
  static const double x[] = {0, 0.5384693101056831, -0.5384693101056831, 0.9061798459386640, -0.9061798459386640};
  static const double w[] = {0.5688888888888889, 0.4786286704993665, 0.4786286704993665, 0.2369268850561891, 0.2369268850561891};
  constexpr int kPieces = 500;
  const auto at = [&](double psi, double& alongE) {
    const Vec2 A(R2 * std::cos(psi), R2 * std::sin(psi)), n = normalSign * A / R2;  // first component along e
    const Vec2 r = A - Vec2(delta, 0), u = -r / r.norm();
    const double cosHalf = std::sqrt(0.5 * (1 + n.dot(u)));
    alongE = (n + u).normalized().x();
    return law(std::max(0.0, R1 - r.norm()) / cosHalf, h);
  };
  for (int i = 0; i < kPieces; ++i) {
    for (int k = 0; k < 5; ++k) {
      const double half = 0.5 * rim / kPieces, psi = half * (2 * i + 1 + x[k]);
      const double dA = w[k] * half * (length > 0 ? 2 * R2 * length : 2 * kPi * R2 * R2 * std::sin(psi));
      double alongE = 0;
      const double p = at(psi, alongE);
      out.force += normalSign * p * alongE * dA;  // on M, positive when it pushes off
      out.scalar += p * dA;
      out.area += dA;
    }
  }
  double ignored = 0;
  out.peak = at(0, ignored);
  return out;
}

void expectClose(const NetLoad& l, const Reference& e, const Vec3& direction, double tolerance = kTolerance) {
  EXPECT_LT((l.forceOnM_F - e.force * direction).norm() / std::abs(e.force), tolerance) << l.forceOnM_F.transpose();
  EXPECT_NEAR(l.scalarForce_N / e.scalar, 1, tolerance);
  EXPECT_NEAR(l.area_m2 / e.area, 1, tolerance);
  EXPECT_NEAR(l.peakPressure_Pa / e.peak, 1, tolerance);
}

// A hip: cup of 25 mm, head of 24 mm, 2 mm of layer, pressed 0.2 mm.
constexpr double R2 = 0.025, R1 = 0.024, h = 0.002, D = 0.2e-3, kDelta = R2 - R1 + D;
constexpr double kReach = 40 * kPi / 180;  // of the grid; the contact reaches 33 degrees
constexpr int kCells = 40;

CompartmentDefinition makeCup(const Vec3& deepest, const Vec3& axis, int n = kCells) {
  CompartmentDefinition c;
  c.name = "cup";
  c.nx = c.nz = n;
  ElementSphere s;
  s.zero = deepest;
  s.axis = axis;
  s.facing = RoundFacing::inward;
  s.angle0_rad = s.elevation0_rad = -kReach;
  s.angle1_rad = s.elevation1_rad = kReach;
  c.elementSurface = s;
  c.fixedSurface = share(flip(makeSphere(R2)));
  c.movingSurface = share(makeSphere(R1));
  return c;
}

ContactPairDefinition makeHip(const Vec3& deepest, const Vec3& axis, const Material& material = uhmwpe(),
                              StrainMeasure strain = StrainMeasure::small, int n = kCells) {
  ContactPairDefinition d;
  d.compartments.push_back(makeCup(deepest, axis, n));
  d.fixedThickness = constantThickness(h);
  d.material = material;
  d.strain = strain;
  return d;
}

JointCoordinates at(const Vec3& p, const Mat3& R = Mat3::Identity()) { return calcCoordinates(Pose{R, p}); }

struct LawCase {
  const char* name;
  Material material;
  StrainMeasure strain;
};

class BallInCup : public testing::TestWithParam<LawCase> {};

TEST_P(BallInCup, IsTheQuadrature) {
  const LawCase& c = GetParam();
  const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(c.material, c.strain));
  const ContactPair pair(makeHip(-Vec3::UnitY(), Vec3::UnitZ(), c.material, c.strain));
  const auto r = pair.evaluate(at({0, -kDelta, 0}));
  ASSERT_EQ(r.status, EvaluationStatus::ok);
  expectClose(r.total, e, Vec3::UnitY());
  EXPECT_LT(r.total.momentOnM_Fo_F.norm(), 1e-9 * e.force);  // about the cup's centre, by symmetry: 1 nm of lever is rounding
  EXPECT_LT((r.total.peakPoint_F - Vec3(0, -R2, 0)).norm(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Laws, BallInCup,
                         testing::Values(LawCase{"linear", uhmwpe(), StrainMeasure::small}, LawCase{"log", uhmwpe(), StrainMeasure::large},
                                         LawCase{"power", uhmwpePowerLaw(), StrainMeasure::small},
                                         LawCase{"power_consistent_large", uhmwpePowerLaw(MaterialLaw::powerLawConsistent),
                                                 StrainMeasure::large}),
                         [](const auto& test_info) { return test_info.param.name; });

TEST(Cup, LooksInAnyDirection) {
  // A real hip's cup faces down and sideways. The grid's axis, its zero and the head's own rotation must not matter.
  const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(uhmwpe(), StrainMeasure::small));
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  const Vec3 center(0.02, -0.03, 0.05);
  for (const Vec3& direction : {Vec3(0, 1, 0), Vec3(0.3, 0.8, -0.5), Vec3(-1, 0.1, 0.1)}) {
    const Vec3 to = direction.normalized();
    for (const double spin : {0.0, 0.4, 0.25 * kPi}) {  // of the grid about the direction of contact
      const Vec3 axis = Eigen::AngleAxisd(spin, to) * to.unitOrthogonal();
      auto d = makeHip(to, axis);
      CompartmentDefinition& c = d.compartments[0];
      std::get<ElementSphere>(c.elementSurface).center_m = center;
      c.fixedSurface = shareIn(flip(makeSphere(R2)), Pose{turn, center});
      const ContactPair pair(d);
      for (const Mat3& R : {Mat3(Mat3::Identity()), turn}) {
        const auto r = pair.evaluate(at(center + kDelta * to, R));
        expectClose(r.total, e, -to);
        // The resultant passes through both centres.
        EXPECT_LT((r.total.momentOnM_Fo_F - center.cross(r.total.forceOnM_F)).norm(), kTolerance * e.force * R2);
      }
    }
  }
}

TEST(Cup, AwayFromTheMiddleOfTheGrid) {
  // 15 degrees off in both coordinates, where cos b bends the cells.
  const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(uhmwpe(), StrainMeasure::small));
  auto d = makeHip(-Vec3::UnitY(), Vec3::UnitZ(), uhmwpe(), StrainMeasure::small, 60);
  auto& s = std::get<ElementSphere>(d.compartments[0].elementSurface);
  s.angle0_rad = s.elevation0_rad = -60 * kPi / 180;
  s.angle1_rad = s.elevation1_rad = 60 * kPi / 180;
  const ContactPair pair(d);
  for (const double a : {-0.26, 0.26}) {
    for (const double b : {-0.26, 0.0, 0.26}) {
      const Vec3 to(std::sin(a) * std::cos(b), -std::cos(a) * std::cos(b), std::sin(b));
      expectClose(pair.evaluate(at(kDelta * to)).total, e, -to, 2 * kTolerance);
    }
  }
}

TEST(Cup, OrderOfConvergence) {
  // Fourth power of the cell, averaged over shifts of the head because the phase of the rim on the grid scatters (as in
  // ReferenceCasesTest: with 16 samples each, sqrt(2/16)/ln 2 = 0.5 of scatter in the order).
  const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(uhmwpe(), StrainMeasure::small));
  const auto rms = [&](int n) {
    const ContactPair pair(makeHip(-Vec3::UnitY(), Vec3::UnitZ(), uhmwpe(), StrainMeasure::small, n));
    double sum = 0;
    for (int i = 0; i < 16; ++i) {
      const double a = 0.006 * i, b = 0.0043 * ((7 * i) % 16);
      const Vec3 to(std::sin(a) * std::cos(b), -std::cos(a) * std::cos(b), std::sin(b));
      sum += std::pow(-pair.evaluate(at(kDelta * to)).total.forceOnM_F.dot(to) / e.force - 1, 2);
    }
    return std::sqrt(sum / 16);
  };
  const double coarse = rms(14), fine = rms(28);
  RecordProperty("coarse", std::to_string(coarse));
  RecordProperty("order", std::to_string(std::log2(coarse / fine)));
  EXPECT_GT(std::log2(coarse / fine), 3.4) << coarse << " " << fine;
}

TEST(Cup, StiffnessIsTheDerivative) {
  const ContactPair pair(makeHip(Vec3(0.2, -1, 0.1), Vec3::UnitZ()));
  const JointCoordinates q{0.1, -0.2, 0.3, 0.0002, -kDelta, 0.0001};
  ContactPair::Options options;
  options.withStiffness = true;
  const Matrix6 K = pair.evaluate(q, options).stiffness;
  for (size_t j = 0; j < 6; ++j) {
    const double step = j < 3 ? 2e-5 : 5e-7;  // as SmoothRuleTest: five points, step^4 and rounding both below 1e-9
    const auto load = [&](double times) {
      JointCoordinates moved = q;
      moved[j] += times * step;
      const NetLoad l = pair.evaluate(moved, {}).total;
      Eigen::Matrix<double, 6, 1> w;
      w << l.forceOnM_F, l.momentOnM_Fo_F;
      return w;
    };
    const Eigen::Matrix<double, 6, 1> expected = (load(-2) - 8 * load(-1) + 8 * load(1) - load(2)) / (12 * step);
    const Eigen::Matrix<double, 6, 1> column = K.col(static_cast<Eigen::Index>(j));
    const double scale = K.topRightCorner(3, 3).norm() * (j < 3 ? R2 : 1);
    // Force columns in N/m or N/rad, moments in N m: each against the largest entry of its kind.
    EXPECT_LT((column.head(3) - expected.head(3)).norm(), 1e-7 * scale) << j;
    EXPECT_LT((column.tail(3) - expected.tail(3)).norm(), 1e-7 * scale * R2) << j;
  }
}

TEST(Cup, RadialThicknessOfAnEccentricBack) {
  // Back of the layer: sphere of 27 mm about a point 0.3 mm off; h(A) = 27 mm - |A - point|. Against a brute-force sum of the
  // definition over a fine polar grid: midpoint in psi and in azimuth.
  const Vec3 off(0.0003, 0, 0);
  const double back = 0.027;
  auto d = makeHip(-Vec3::UnitY(), Vec3::UnitZ());
  d.fixedThickness.source = RadialThickness{back, off, {}};
  const ContactPair pair(d);
  const auto r = pair.evaluate(at({0, -kDelta, 0}));
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  Vec3 force = Vec3::Zero();
  constexpr int kPsi = 4000, kTurn = 64;  // midpoint of a smooth function with a kink at the rim: (1/4000)^2 and exponential
  for (int i = 0; i < kPsi; ++i) {
    const double psi = kReach * (i + 0.5) / kPsi;
    for (int k = 0; k < kTurn; ++k) {
      const double turn = 2 * kPi * k / kTurn;
      const Vec3 a(std::sin(psi) * std::cos(turn), -std::cos(psi), std::sin(psi) * std::sin(turn));
      const Vec3 A = R2 * a, v = A - Vec3(0, -kDelta, 0), u = -v.normalized();
      if (v.norm() > R1) continue;
      const double cosHalf = std::sqrt(0.5 * (1 - a.dot(u)));
      const double p = K * (R1 - v.norm()) / cosHalf / (back - (A - off).norm());
      force += p * (u - a).normalized() * R2 * R2 * std::sin(psi) * (kReach / kPsi) * (2 * kPi / kTurn);
    }
  }
  EXPECT_LT((r.total.forceOnM_F - force).norm() / force.norm(), kTolerance) << r.total.forceOnM_F.transpose() << " | " << force.transpose();
  EXPECT_GT(std::abs(force.x() / force.y()), 100 * kTolerance);  // the eccentricity is felt
  EXPECT_NEAR(pair.gridReports()[0].minThickness_m, 0.002 - 0.0003 * std::sin(kReach) , 2e-5);
}

TEST(Cup, BallOnBall) {
  // Convex element surface: a head of 25 mm that carries the grid, a ball of 40 mm on top of it.
  const double big = 0.040, small = 0.025, press = 0.15e-3;
  CompartmentDefinition c;
  c.name = "head";
  c.nx = c.nz = kCells;
  ElementSphere s;
  s.zero = Vec3::UnitY();
  s.facing = RoundFacing::outward;
  s.angle0_rad = s.elevation0_rad = -0.15;
  s.angle1_rad = s.elevation1_rad = 0.15;
  c.elementSurface = s;
  c.fixedSurface = share(makeSphere(small));
  c.movingSurface = share(makeSphere(big));
  ContactPairDefinition d;
  d.compartments.push_back(c);
  d.fixedThickness.source = RadialThickness{small - h, Vec3::Zero(), {}};
  d.material = uhmwpe();
  d.strain = StrainMeasure::large;
  const double delta = big + small - press;
  const Reference e = integrate(small, 1, big, delta, h, makeLaw(uhmwpe(), StrainMeasure::large));
  expectClose(ContactPair(d).evaluate(at({0, delta, 0})).total, e, Vec3::UnitY());
}

// ---- cylinders ----------------------------------------------------------------------------------------------------------

constexpr double kLength = 0.020;

CompartmentDefinition makeTrough(const Mat3& R, int n = kCells) {
  CompartmentDefinition c;
  c.name = "trough";
  c.nx = n;
  c.nz = 8;
  ElementCylinder s;
  s.axis = R * Vec3::UnitZ();
  s.zero = R * -Vec3::UnitY();
  s.facing = RoundFacing::inward;
  s.angle0_rad = -kReach;
  s.angle1_rad = kReach;
  s.axial0_m = -0.5 * kLength;
  s.axial1_m = 0.5 * kLength;
  c.elementSurface = s;
  c.fixedSurface = shareIn(flip(makeCylinder(R2, 0.03)), Pose{R, Vec3::Zero()});
  c.movingSurface = share(makeCylinder(R1, 0.06));
  return c;
}

TEST(Trough, ShaftInTroughIsTheQuadrature) {
  const Mat3 toX = Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitY()).toRotationMatrix();
  const Mat3 toY = Eigen::AngleAxisd(-0.5 * kPi, Vec3::UnitX()).toRotationMatrix();
  const Mat3 skew = Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  for (const Mat3& R : {Mat3(Mat3::Identity()), toX, toY, skew}) {
    for (const LawCase& law : {LawCase{"linear", uhmwpe(), StrainMeasure::small}, LawCase{"power", uhmwpePowerLaw(), StrainMeasure::large}}) {
      const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(law.material, law.strain), kLength);
      ContactPairDefinition d;
      // The rim is straight along the grid, so that its cells do not average out: (1/N)^4 with the full constant needs N = 64.
      d.compartments.push_back(makeTrough(R, 160));
      d.fixedThickness.source = RadialThickness{R2 + h, Vec3::Zero(), R * Vec3::UnitZ()};
      d.material = law.material;
      d.strain = law.strain;
      const ContactPair pair(d);
      const auto r = pair.evaluate(at(R * Vec3(0, -kDelta, 0), R));
      expectClose(r.total, e, R * Vec3::UnitY());
      EXPECT_LT(r.total.momentOnM_Fo_F.norm(), 1e-9 * e.force);
    }
  }
}

TEST(Trough, ATiltedShaftTurnsTheMomentWithIt) {
  // No closed form, but the scene turned as a whole must give the load turned with it, for a pose without symmetry.
  const Mat3 R = Eigen::AngleAxisd(0.9, Vec3(-1, 1, 3).normalized()).toRotationMatrix();
  const Pose tilted{Eigen::AngleAxisd(0.004, Vec3(1, 0.5, 0).normalized()).toRotationMatrix(), Vec3(0.0003, -kDelta, 0.001)};
  ContactPairDefinition d, turned;
  d.compartments.push_back(makeTrough(Mat3::Identity()));
  turned.compartments.push_back(makeTrough(R));
  d.fixedThickness = turned.fixedThickness = constantThickness(h);
  d.material = turned.material = uhmwpe();
  const NetLoad a = ContactPair(d).evaluate(calcCoordinates(tilted)).total;
  const NetLoad b = ContactPair(turned).evaluate(calcCoordinates(Pose{R, Vec3::Zero()} * tilted)).total;
  ASSERT_GT(a.forceOnM_F.norm(), 100);
  ASSERT_GT(a.momentOnM_Fo_F.norm(), 0.1);
  EXPECT_LT((b.forceOnM_F - R * a.forceOnM_F).norm(), 1e-9 * a.forceOnM_F.norm());
  EXPECT_LT((b.momentOnM_Fo_F - R * a.momentOnM_Fo_F).norm(), 1e-9 * a.forceOnM_F.norm() * R2);
}

TEST(Trough, FullTurnHasNoSeam) {
  // A bearing that is closed all around; the shaft is pressed in at every place of the seam.
  auto c = makeTrough(Mat3::Identity(), 720);
  auto& s = std::get<ElementCylinder>(c.elementSurface);
  for (const Tracking tracking : {Tracking::all, Tracking::lipschitz, Tracking::breadthFirst, Tracking::breadthFirstUnguarded}) {
    for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
      Vec3 first = Vec3::Zero();
      for (const double start : {-kPi, 0.0, 0.3}) {  // the seam is opposite the contact, in its middle, at 17 degrees
        s.angle0_rad = start;
        s.angle1_rad = start + 2 * kPi;
        ContactPairDefinition d;
        d.compartments.push_back(c);
        d.fixedThickness = constantThickness(h);
        d.material = uhmwpe();
        d.tracking = tracking;
        d.rule = rule;
        const ContactPair pair(d);
        EXPECT_EQ(pair.numElements(), 720 * 8);
        ContactWorkspace workspace(pair);
        ContactResult r;
        // The second pose is found from the first, rolled 3.4 degrees on.
        pair.evaluate(at({0.00006, -kDelta, 0}), workspace, {}, r);
        pair.evaluate(at({0, -kDelta, 0}), workspace, {}, r);
        if (rule == ContactRule::smooth) {
          const Reference e = integrate(R2, -1, R1, kDelta, h, makeLaw(uhmwpe(), StrainMeasure::small), kLength);
          expectClose(r.total, e, Vec3::UnitY());
        } else if (start == -kPi) {
          first = r.total.forceOnM_F;
        } else if (start == 0) {  // the same cells, numbered otherwise
          EXPECT_LT((r.total.forceOnM_F - first).norm(), 1e-9 * first.norm());
        }
      }
    }
  }
}

// ---- planes that face down, ranges, errors ----------------------------------------------------------------------------------

TEST(ElementSurface, APlaneThatFacesDownIsTheMirrorImage) {
  const double R = 0.030;
  auto up = makeScene(share(makePlane(h, 0.1, 0.05, Solid::below, 0.1)), share(makeSphere(R)), aboveZero(), uhmwpe(), 0.008, 30);
  auto down = makeScene(share(makePlane(-h, -0.1, -0.05, Solid::above, 0.1)), share(makeSphere(R)), aboveZero(), uhmwpe(), 0.008, 30);
  up.planeY_m = down.planeY_m = 0;
  down.compartments[0].elementSurface = ElementPlane{PlaneFacing::down};
  const Vec3 p(-0.0025, h + R - 0.0003, -0.0012);
  const NetLoad a = ContactPair(up).evaluate(at(p)).total, b = ContactPair(down).evaluate(at({p.x(), -p.y(), p.z()})).total;
  ASSERT_GT(a.scalarForce_N, 100);
  const auto mirrored = [](const Vec3& v) { return Vec3(v.x(), -v.y(), v.z()); };
  EXPECT_LT((b.forceOnM_F - mirrored(a.forceOnM_F)).norm(), 1e-9 * a.scalarForce_N);
  EXPECT_LT((b.momentOnM_Fo_F + mirrored(a.momentOnM_Fo_F)).norm(), 1e-9 * a.scalarForce_N);  // an axial vector turns over
  EXPECT_NEAR(b.area_m2, a.area_m2, 1e-9 * a.area_m2);
  // Element planes cut from the other side, with the words for it.
  down.planeY_m = -0.02;
  try {
    ContactPair{down};
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("at or above the element plane"), std::string::npos) << error.what();
  }
}

TEST(ElementSurface, RangeOfAPatch) {
  ElementCylinder c;
  c.facing = RoundFacing::outward;
  const auto whole = std::get<ElementCylinder>(findExtent(ContactSurface(makeCylinder(R1, 0.06)), c));
  EXPECT_NEAR(whole.angle1_rad - whole.angle0_rad, 2 * kPi, 1e-12);
  EXPECT_NEAR(whole.axial0_m, -0.03, 1e-12);
  EXPECT_NEAR(whole.axial1_m, 0.03, 1e-12);
  // A dish of radius 60 about (0, 0.06, 0) over +-10 mm: asin(1/6), and the elevation of its edges.
  ElementSphere s;
  s.center_m = Vec3(0, 0.06, 0);
  s.facing = RoundFacing::inward;
  const auto dish = std::get<ElementSphere>(findExtent(ContactSurface(makeDish(0, 0.06, 0.06, Solid::below, 0.01)), s));
  // Samples end on the edges; the corner's angle is a little larger than the edge's middle: atan(x/(R - y)) <= asin(1/6)/cos(..)
  EXPECT_NEAR(dish.angle1_rad, std::asin(1.0 / 6), 0.005);
  EXPECT_NEAR(dish.angle0_rad, -dish.angle1_rad, 1e-12);
  EXPECT_NEAR(dish.elevation1_rad, std::asin(1.0 / 6), 1e-9);
  s.facing = RoundFacing::outward;
  EXPECT_THROW(findExtent(ContactSurface(makeDish(0, 0.06, 0.06, Solid::below, 0.01)), s), std::invalid_argument);
}

TEST(ElementSurface, LimitingRadiusPicksTheSheet) {
  // A shell: socket of 25 mm inside one of 30 mm, both facing the centre. Without a limit the nearest is used; with one that
  // lies inside both there is nothing.
  std::vector<NurbsPatch> patches = flip(makeSphere(0.030));
  for (const NurbsPatch& p : flip(makeSphere(R2))) patches.push_back(p);
  auto d = makeHip(-Vec3::UnitY(), Vec3::UnitZ());
  d.compartments[0].fixedSurface = share(std::move(patches));
  auto& s = std::get<ElementSphere>(d.compartments[0].elementSurface);
  const auto radius = [&] {
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(at({0, 0, 0}), workspace, {}, r);
    return pair.calcFields(workspace)[0][7].p_FA.norm();
  };
  EXPECT_NEAR(radius(), R2, 1e-12);
  s.radius_m = 0.027;
  EXPECT_NEAR(radius(), R2, 1e-12);
  s.radius_m = 0.024;
  EXPECT_THROW(radius(), std::invalid_argument);
  s.radius_m.reset();
  s.facing = RoundFacing::outward;
  EXPECT_THROW(radius(), std::invalid_argument);  // nothing faces outward
  d.compartments[0].fixedSurface = share(makeSphere(R2));
  EXPECT_NEAR(radius(), R2, 1e-12);
  s.radius_m = R2 + 1e-3;  // outward: only beyond the radius
  EXPECT_THROW(radius(), std::invalid_argument);
}

TEST(ElementSurface, WhatIsWrongIsNamed) {
  const auto message = [](const ContactPairDefinition& d) -> std::string {
    try {
      ContactPair{d};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const auto good = makeHip(-Vec3::UnitY(), Vec3::UnitZ());
  ASSERT_EQ(message(good), "");
  const auto with = [&](const std::function<void(ElementSphere&)>& change) {
    auto d = good;
    change(std::get<ElementSphere>(d.compartments[0].elementSurface));
    return message(d);
  };
  EXPECT_NE(with([](auto& s) { s.angle1_rad = s.angle0_rad; }).find("angle"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.angle1_rad = 7; }).find("full turn"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.elevation1_rad = 1.6; }).find("pole"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.elevation1_rad = -1; }).find("elevation"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.axis.setZero(); }).find("axis"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.zero = s.axis; }).find("angle 0"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.radius_m = -1; }).find("radius = -1 m"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.facing = RoundFacing::outward; }).find("faces the wrong way"), std::string::npos);
  EXPECT_NE(with([](auto& s) { s.center_m.x() = 1; }).find("none of the 1600 rays"), std::string::npos);
  auto d = good;
  d.fixedThickness = aboveZero();
  EXPECT_NE(message(d).find("needs a plane element surface"), std::string::npos);
  d.fixedThickness.source = RadialThickness{0.024, Vec3::Zero(), {}};  // in front of the cup
  EXPECT_NE(message(d).find("back surface is missed"), std::string::npos);
  d.fixedThickness.source = RadialThickness{-1, Vec3::Zero(), {}};
  EXPECT_NE(message(d).find("radius of its back = -1 m"), std::string::npos);
}

}  // namespace
}  // namespace genu::contact
