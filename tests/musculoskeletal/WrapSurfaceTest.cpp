#include "genu/musculoskeletal/WrapSurface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "Refusal.h"

namespace genu::musculoskeletal {
namespace {

using contact::kPi;
using contact::Mat3;
using testing::HasSubstr;
using Status = WrappedSegment::Status;

constexpr double R = 0.03;

struct Random {
  std::mt19937 engine;
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit;
  explicit Random(unsigned seed) : engine(seed) {}

  Vec3 calcDirection() {
    const Vec3 v(normal(engine), normal(engine), normal(engine));
    return v.normalized();
  }
  double between(double low, double high) { return low + (high - low) * unit(engine); }
  /** Half axes up to `ratio` apart, half the time one or two of them equal to the extremes. */
  WrapSurface calcEllipsoid(double ratio) {
    Vec3 axes;
    for (int i = 0; i < 3; ++i) axes[i] = 0.01 * std::pow(ratio, unit(engine));
    if (between(0, 1) < 0.5) {
      const int i = int(between(0, 3));
      axes[i] = 0.01;
      axes[(i + 1) % 3] = 0.01 * ratio;
    }
    return WrapSurface::makeEllipsoid(axes[0], axes[1], axes[2]);
  }
  /** Outside; a third of them close to the surface. */
  Vec3 calcOutside(const WrapSurface& s) {
    const Vec3 axes = s.shape == WrapSurface::Shape::cylinder ? Vec3(s.halfAxes_m[0], s.halfAxes_m[0], s.halfAxes_m[0]) : s.halfAxes_m;
    Vec3 v = calcDirection();
    if (s.shape == WrapSurface::Shape::cylinder) v /= std::hypot(v[0], v[1]);
    return v.cwiseProduct(axes) * (1 + (between(0, 1) < 0.33 ? 0.01 : 2) * between(0.001, 1));
  }
};

double calcLength_m(const WrapSurface& s, const Vec3& P, const Vec3& Q) { return wrapSegment(s, P, Q).length_m; }

std::vector<WrapSurface> calcOneOfEach() {
  return {WrapSurface::makeCylinder(R), WrapSurface::makeCylinder(R, Vec3(1, 0.4, 3)), WrapSurface::makeSphere(R),
          WrapSurface::makeEllipsoid(0.03, 0.02, 0.05), WrapSurface::makeEllipsoid(0.02, 0.08, 0.02)};
}

void expectSame(const WrappedSegment& a, const WrappedSegment& b, double tolerance) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_NEAR(a.length_m, b.length_m, tolerance * b.length_m);
  EXPECT_NEAR(a.arcLength_m, b.arcLength_m, tolerance * b.length_m);
  EXPECT_LT((a.directionP - b.directionP).norm(), tolerance);
  EXPECT_LT((a.directionQ - b.directionQ).norm(), tolerance);
  EXPECT_LT((a.tangentP_m - b.tangentP_m).norm(), tolerance * b.length_m);
  EXPECT_LT((a.tangentQ_m - b.tangentQ_m).norm(), tolerance * b.length_m);
}

// ---------------------------------------------------------------- closed forms

TEST(WrapCylinder, TangentsAndHelix) {
  // Tangents parallel to y at x = R and x = -R: half a turn between.
  const Vec3 P(R, -0.05, 0.01), Q(-R, -0.05, 0.07);
  const WrappedSegment r = wrapSegment(WrapSurface::makeCylinder(R, Vec3(0, 1, 0)), P, Q);
  const double across = 0.1 + kPi * R, length = std::hypot(across, 0.06);
  EXPECT_EQ(r.status, Status::wrapped);
  EXPECT_NEAR(r.length_m, length, 1e-16);
  EXPECT_NEAR(r.arcLength_m, kPi * R * length / across, 1e-16);
  EXPECT_LT((r.directionP - Vec3(0, across, 0.06) / length).norm(), 1e-15);
  EXPECT_LT((r.directionQ - Vec3(0, -across, 0.06) / length).norm(), 1e-15);
  EXPECT_LT((r.tangentP_m - Vec3(R, 0, 0.01 + 0.06 * 0.05 / across)).norm(), 1e-16);
  EXPECT_LT((r.tangentQ_m - Vec3(-R, 0, 0.07 - 0.06 * 0.05 / across)).norm(), 1e-16);
  // The line misses the cylinder: straight where the side allows it.
  for (const WrapSurface& s : {WrapSurface::makeCylinder(R), WrapSurface::makeCylinder(R, Vec3(0, -1, 0))}) {
    const WrappedSegment line = wrapSegment(s, P, Q);
    EXPECT_EQ(line.status, Status::straight);
    EXPECT_NEAR(line.length_m, (Q - P).norm(), 1e-17);
    EXPECT_EQ(line.arcLength_m, 0);
  }
}

TEST(WrapCylinder, SideTakesThePathBeyondHalfATurn) {
  const WrapSurface s = WrapSurface::makeCylinder(R, Vec3(2, 0, -1));
  const double r = 0.05, free = 0.04, bend = std::acos(R / r);
  const auto at = [&](double degrees) { return Vec3(r * std::cos(degrees * kPi / 180), r * std::sin(degrees * kPi / 180), 0); };
  for (const double a : {100.0, 150.0, 179.0, 180.0}) {
    const WrappedSegment path = wrapSegment(s, at(a), at(-a + 1e-9));
    EXPECT_EQ(path.status, Status::wrapped);
    EXPECT_NEAR(path.length_m, 2 * free + R * (2 * a * kPi / 180 - 2 * bend), 1e-11) << a;
  }
  // An end on the half plane counts as at +180 deg; one past it goes the other way.
  EXPECT_EQ(wrapSegment(s, Vec3(-r, 0, 0), at(170)).status, Status::straight);
  EXPECT_EQ(wrapSegment(s, Vec3(-r, -0.0, 0), at(170)).status, Status::straight);
  EXPECT_EQ(wrapSegment(s, Vec3(-r, -1e-12, 0), at(170)).status, Status::wrapped);
}

TEST(WrapCylinder, LengthIsContinuousWhileEndsKeepOffTheHalfPlane) {
  // |dL/dQ| = 1: a step of Q changes L by at most that step, over the whole turn and with each of several places of P.
  const WrapSurface s = WrapSurface::makeCylinder(R, Vec3(0, 1, 0));
  for (const double azimuthP : {-179.0, -90.0, 10.0, 179.0}) {
    const auto at = [&](double degrees, double r) {
      const double a = (90 + degrees) * kPi / 180;
      return Vec3(r * std::cos(a), r * std::sin(a), 0.01 * std::sin(3 * a));
    };
    const Vec3 P = at(azimuthP, 0.06);
    Vec3 before = at(-179.99, 0.031);
    double lengthBefore = calcLength_m(s, P, before);
    for (double a = -179.99; a < 180; a += 0.05) {
      const Vec3 Q = at(a, 0.05 + 0.019 * std::cos(a));
      const double length = calcLength_m(s, P, Q);
      EXPECT_LE(std::abs(length - lengthBefore), (Q - before).norm() + 1e-16) << azimuthP << " " << a;
      before = Q;
      lengthBefore = length;
    }
  }
}

TEST(WrapSphere, TangentsAndGreatCircle) {
  const WrapSurface s = WrapSurface::makeSphere(R);
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    // In the plane of two unit vectors x and y: out along the tangent at angle 0 and at angle w.
    const Vec3 x = random.calcDirection(), y = x.cross(random.calcDirection()).normalized();
    const double w = random.between(0.01, 3.1), lP = random.between(0, 0.1), lQ = random.between(0, 0.1);
    const Vec3 away = std::cos(w) * x + std::sin(w) * y, along = std::cos(w) * y - std::sin(w) * x;
    const Vec3 P = R * x - lP * y, Q = R * away + lQ * along;
    if (w + std::atan(lP / R) + std::atan(lQ / R) > kPi) continue;  // the other way is shorter
    const WrappedSegment r = wrapSegment(s, P, Q);
    // A free length l follows from r^2 - R^2 with rounding 1e-16 r^2, by R/l off; small l come as far as 1e-8 r.
    EXPECT_EQ(r.status, Status::wrapped);
    EXPECT_NEAR(r.length_m, lP + R * w + lQ, 1e-14);
    EXPECT_LT((r.directionP - y).norm(), 1e-12);
    EXPECT_LT((r.directionQ - along).norm(), 1e-12);
    EXPECT_LT((r.tangentP_m - R * x).norm(), 1e-13);
    EXPECT_LT((r.tangentQ_m - R * away).norm(), 1e-13);
    EXPECT_NEAR(r.arcLength_m, R * w, 1e-13);
  }
}

TEST(Wrap, LinesThroughTheCentreGoEitherWayButAlwaysTheSame) {
  for (const WrapSurface& s : calcOneOfEach()) {
    const Vec3 axes = s.halfAxes_m.cwiseMin(0.1);
    for (int i = 0; i < (s.shape == WrapSurface::Shape::cylinder ? 2 : 3); ++i) {
      const Vec3 P = 2 * axes[i] * Vec3::Unit(i), Q = -3 * axes[i] * Vec3::Unit(i);
      const WrappedSegment r = wrapSegment(s, P, Q), again = wrapSegment(s, P, Q);
      EXPECT_EQ(r.status, Status::wrapped);
      EXPECT_EQ(r.length_m, again.length_m);
      EXPECT_TRUE(r.directionP == again.directionP && r.tangentQ_m == again.tangentQ_m);
      EXPECT_GT(r.length_m, 5 * axes[i]);
      // A neighbour's length: |dL| <= |dP|.
      EXPECT_NEAR(calcLength_m(s, P + Vec3(1e-9, -2e-9, 1e-9), Q), r.length_m, 3e-9);
    }
  }
  // 2 l + R (pi - 2 acos(R/r)).
  const double free = std::sqrt(0.05 * 0.05 - R * R);
  const double length = calcLength_m(WrapSurface::makeSphere(R), Vec3(0, 0, 0.05), Vec3(0, 0, -0.05));
  EXPECT_NEAR(length, 2 * free + R * (kPi - 2 * std::acos(0.6)), 1e-16);
}

TEST(WrapEllipsoid, OfEqualAxesIsTheSphere) {
  const WrapSurface sphere = WrapSurface::makeSphere(R), ellipsoid = WrapSurface::makeEllipsoid(R, R, R);
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 P = random.calcOutside(sphere), Q = random.calcOutside(sphere);
    // Near-opposite ends turn the plane by rounding over the distance from opposite: 1e-15/1e-3.
    if ((P.normalized() + Q.normalized()).norm() < 1e-3) continue;
    expectSame(wrapSegment(ellipsoid, P, Q), wrapSegment(sphere, P, Q), 1e-12);
  }
}

/** String around the ellipse of half axes a, b from P to Q, both in its plane, counterclockwise: Simpson's rule on the arc. */
double calcPlanarLength_m(double a, double b, const Vec3& P, const Vec3& Q) {
  const auto tangent = [&](const Vec3& E, double sign) {  // eccentric angle of tangency
    const double x = E[0] / a, y = E[1] / b;
    return std::atan2(y, x) + sign * std::acos(std::min(1.0, 1 / std::hypot(x, y)));
  };
  const double from = tangent(P, 1);
  double to = tangent(Q, -1);
  while (to < from) to += 2 * kPi;
  const auto point = [&](double t) { return Vec3(a * std::cos(t), b * std::sin(t), 0); };
  const int n = 4000;
  double sum = 0;
  for (int i = 0; i <= n; ++i) {
    const double t = from + (to - from) * i / n;
    sum += (i == 0 || i == n ? 1 : i % 2 ? 4 : 2) * std::hypot(a * std::sin(t), b * std::cos(t));
  }
  return (P - point(from)).norm() + sum * (to - from) / (3 * n) + (point(to) - Q).norm();
}

TEST(WrapEllipsoid, InAPlaneOfSymmetryFollowsTheEllipse) {
  // c is long: the way over the poles of z is longer, the shortest path stays in z = 0.
  for (const double ratio : {1.0, 2.0, 5.0, 10.0}) {
    const double a = 0.01 * ratio, b = 0.01, c = 0.012 * ratio;
    const WrapSurface s = WrapSurface::makeEllipsoid(a, b, c);
    for (double angle = 0.7; angle < 2.6; angle += 0.15) {
      const Vec3 P(1.5 * a * std::cos(0.3), 1.5 * b * std::sin(0.3), 0);
      const Vec3 Q(1.2 * a * std::cos(0.3 + angle), 1.2 * b * std::sin(0.3 + angle), 0);
      const WrappedSegment r = wrapSegment(s, P, Q);
      if (r.status != Status::wrapped) continue;
      // Simpson with 4000 parts: (1e-3)^4/180 of the fourth derivative, of the order ratio^4.
      const double exact = calcPlanarLength_m(a, b, P, Q);
      EXPECT_NEAR(r.length_m / exact, 1, 1e-11) << ratio << " " << angle;
      EXPECT_NEAR(r.directionP[2], 0, 1e-11);
      EXPECT_NEAR(r.tangentQ_m[2], 0, 1e-12);
    }
  }
}

// ---------------------------------------------------------------- two independent methods

/** A string by the geodesic equation x'' = -(x'.Ax'/|Ax|^2) Ax itself, classical Runge-Kutta in equal parts on the unit sphere, Newton with
 differences for where it starts on the curve of tangency of P and how long it is. */
struct Reference {
  Vec3 D, P, Q;

  struct Ray {
    Vec3 x, t;
    double arc = 0;
  };
  Ray calcDerivative(const Ray& r) const {
    const Vec3 A = D.cwiseProduct(D).cwiseInverse(), Ax = A.cwiseProduct(r.x);
    const double perPart = 1 / r.t.cwiseQuotient(D).norm();
    return {r.t * perPart, -Ax * (r.t.dot(A.cwiseProduct(r.t)) / Ax.squaredNorm() * perPart), perPart};
  }
  static Ray add(const Ray& a, const Ray& b, double h) { return {a.x + h * b.x, a.t + h * b.t, a.arc + h * b.arc}; }

  Ray calcStart(double theta) const {
    const Vec3 Ph = P.cwiseQuotient(D), u = Ph.normalized(), e1 = u.unitOrthogonal(), e2 = u.cross(e1);
    const double c = 1 / Ph.norm(), s = std::sqrt(1 - c * c);
    const Vec3 e = std::cos(theta) * e1 + std::sin(theta) * e2;
    return {D.cwiseProduct(c * u + s * e), D.cwiseProduct(c * e - s * u).normalized(), 0};
  }
  double calcTheta(const Vec3& x) const {
    const Vec3 u = P.cwiseQuotient(D).normalized(), e1 = u.unitOrthogonal(), e2 = u.cross(e1), xh = x.cwiseQuotient(D);
    return std::atan2(xh.dot(e2), xh.dot(e1));
  }
  Ray calcEnd(double theta, double angle) const {
    constexpr int kSteps = 1500;
    Ray r = calcStart(theta);
    const double h = angle / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const Ray k1 = calcDerivative(r), k2 = calcDerivative(add(r, k1, h / 2)), k3 = calcDerivative(add(r, k2, h / 2)),
                k4 = calcDerivative(add(r, k3, h));
      r = add(r, add(add(k1, k4, 1), add(k2, k3, 1), 2), h / 6);
    }
    return r;
  }
  /** @return length, from near the given string; < 0 where Newton fails */
  double calcLength(double theta, double angle) const {
    const auto miss = [&](double th, double an) {
      const Ray r = calcEnd(th, an);
      const Vec3 n = r.x.cwiseQuotient(D.cwiseProduct(D)).normalized(), toQ = Q - r.x;
      return Eigen::Vector2d(toQ.dot(n.cross(r.t)), toQ.dot(n));
    };
    for (int k = 0; k < 12; ++k) {
      const Eigen::Vector2d f = miss(theta, angle);
      Eigen::Matrix2d J;
      const double h = 1e-5;
      J.col(0) = (miss(theta + h, angle) - miss(theta - h, angle)) / (2 * h);
      J.col(1) = (miss(theta, angle + h) - miss(theta, angle - h)) / (2 * h);
      const Eigen::Vector2d step = -J.inverse() * f;
      theta += step[0];
      angle += step[1];
      if (step.norm() < 1e-11) {
        const Ray r = calcEnd(theta, angle);
        return (calcStart(theta).x - P).norm() + r.arc + (Q - r.x).norm();
      }
      if (!(step.norm() < 0.3)) break;
    }
    return -1;
  }
};

TEST(WrapEllipsoid, IsTheGeodesicOfAnotherMethod) {
  Random random(3);
  int compared = 0;
  double worst = 0;
  for (int i = 0; compared < 60 && i < 1000; ++i) {
    const WrapSurface s = random.calcEllipsoid(10);
    const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
    const WrappedSegment r = wrapSegment(s, P, Q);
    if (r.status == Status::straight) continue;
    ASSERT_EQ(r.status, Status::wrapped);
    Reference reference = {s.halfAxes_m / 0.01, P / 0.01, Q / 0.01};
    // The reference's equations are not made for ends on the surface.
    if (P.cwiseQuotient(s.halfAxes_m).norm() < 1.001 || Q.cwiseQuotient(s.halfAxes_m).norm() < 1.001) continue;
    // Length on the unit sphere from the drawn points; started 1e-3 beside the result.
    const std::vector<Vec3> points = sampleSegment(s, P, Q, 200);
    double angle = 0;
    for (std::size_t k = 2; k + 1 < points.size(); ++k) angle += (points[k] - points[k - 1]).cwiseQuotient(s.halfAxes_m).norm();
    const double length = 0.01 * reference.calcLength(reference.calcTheta(r.tangentP_m / 0.01) + 1e-3, angle + 1e-3);
    if (length < 0) continue;
    ++compared;
    worst = std::max(worst, std::abs(r.length_m / length - 1));
    // The reference: 1500 parts of at most 2 pi/1500, Runge-Kutta's error (4e-3)^4/120 x ratio^2. Measured there: ours 2e-11 at ratio 10.
    EXPECT_NEAR(r.length_m / length, 1, 1e-10);
  }
  EXPECT_EQ(compared, 60);
  std::printf("largest difference %.1e\n", worst);
}

TEST(WrapEllipsoid, IsNotLongerThanStringsInPlanes) {
  // Any string outside the ellipsoid is an upper bound: those in planes through P and Q, here measured along 400 chords, which are shorter
  // by at most (2 pi/400)^2/24 x ratio.
  Random random(4);
  for (int i = 0; i < 400; ++i) {
    const WrapSurface s = random.calcEllipsoid(10);
    const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s), D = s.halfAxes_m;
    const WrappedSegment r = wrapSegment(s, P, Q);
    if (r.status == Status::straight) continue;
    ASSERT_EQ(r.status, Status::wrapped);
    EXPECT_GT(r.length_m, (Q - P).norm() * (1 - 1e-15));
    const Vec3 Ph = P.cwiseQuotient(D), Qh = Q.cwiseQuotient(D), line = (Qh - Ph).normalized();
    const Vec3 e1 = line.unitOrthogonal(), e2 = line.cross(e1);
    for (int k = 0; k < 48; ++k) {
      const Vec3 e = std::cos(k * kPi / 24) * e1 + std::sin(k * kPi / 24) * e2, n = line.cross(e);
      const Vec3 centre = Ph.dot(n) * n;
      const double radius = std::sqrt(1 - centre.squaredNorm());
      const auto azimuth = [&](const Vec3& p, double sign) {  // of tangency, from e towards line
        const double x = (p - centre).dot(e), y = (p - centre).dot(line);
        return std::atan2(y, x) + sign * std::acos(std::min(1.0, radius / std::hypot(x, y)));
      };
      const double from = azimuth(Ph, 1);
      double to = azimuth(Qh, -1);
      while (to < from) to += 2 * kPi;
      Vec3 before = P;
      double length = 0;
      for (int j = 0; j <= 400; ++j) {
        const double a = from + (to - from) * j / 400;
        const Vec3 next = D.cwiseProduct(centre + radius * (std::cos(a) * e + std::sin(a) * line));
        length += (next - before).norm();
        before = next;
      }
      EXPECT_LT(r.length_m, (length + (Q - before).norm()) * (1 + 1e-4));
    }
  }
}

TEST(WrapEllipsoid, RandomOnesUpToTenToOneAllConverge) {
  Random random(5);
  int wrapped = 0;
  for (int i = 0; i < 15000; ++i) {
    const WrapSurface s = random.calcEllipsoid(10);
    const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
    const WrappedSegment r = wrapSegment(s, P, Q);
    EXPECT_TRUE(r.status == Status::wrapped || r.status == Status::straight)
        << s.halfAxes_m.transpose() << " from " << P.transpose() << " to " << Q.transpose();
    wrapped += r.status == Status::wrapped;
  }
  EXPECT_GT(wrapped, 5000);
}

TEST(WrapEllipsoid, ExtremeOnesAreValidOrSayThatTheyAreNot) {
  Random random(6);
  int failed = 0, wrapped = 0;
  for (int i = 0; i < 4000; ++i) {
    const WrapSurface s = random.calcEllipsoid(100);
    const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
    const WrappedSegment r = wrapSegment(s, P, Q);
    ASSERT_TRUE(std::isfinite(r.length_m) && r.directionP.allFinite() && r.directionQ.allFinite());
    EXPECT_NEAR(r.directionP.norm(), 1, 1e-14);
    EXPECT_NEAR(r.directionQ.norm(), 1, 1e-14);
    if (r.status == Status::wrapped) {
      ++wrapped;
      EXPECT_GE(r.length_m, (Q - P).norm() * (1 - 1e-9));
    } else {
      failed += r.status == Status::notConverged;
      EXPECT_DOUBLE_EQ(r.length_m, (Q - P).norm());
    }
  }
  EXPECT_LE(failed, wrapped / 200);
  std::printf("%d wrapped, %d not converged\n", wrapped, failed);
}

// ---------------------------------------------------------------- forces

TEST(Wrap, DirectionsAreTheGradientOfTheLength) {
  for (const WrapSurface& s : calcOneOfEach()) {
    Random random(7);
    int wrapped = 0;
    for (int i = 0; i < 400; ++i) {
      const Vec3 P = random.calcOutside(s) * 1.02, Q = random.calcOutside(s) * 1.02;
      const WrappedSegment r = wrapSegment(s, P, Q);
      wrapped += r.status == Status::wrapped;
      const double h = 1e-7;
      Vec3 byP, byQ;
      double jump = 0;  // of the slope: the string changes sides in between
      for (int k = 0; k < 3; ++k) {
        const Vec3 d = h * Vec3::Unit(k);
        const double Pp = calcLength_m(s, P + d, Q), Pm = calcLength_m(s, P - d, Q);
        const double Qp = calcLength_m(s, P, Q + d), Qm = calcLength_m(s, P, Q - d);
        byP[k] = (Pp - Pm) / (2 * h);
        byQ[k] = (Qp - Qm) / (2 * h);
        jump = std::max({jump, std::abs(Pp + Pm - 2 * r.length_m) / h, std::abs(Qp + Qm - 2 * r.length_m) / h});
      }
      if (jump > 1e-3) continue;
      // Rounding 1e-16 m over 1e-7 m; h^2 times the third derivative, of the order of 1/l^2 with l >= 2e-3 m from the surface, more where
      // a focus is near: there the second derivative is large too and takes part of the tolerance.
      const double tolerance = 1e-8 + 0.01 * jump;
      EXPECT_LT((byP + r.directionP).norm(), tolerance) << i;
      EXPECT_LT((byQ - r.directionQ).norm(), tolerance) << i;
    }
    EXPECT_GT(wrapped, 50);
  }
}

TEST(Wrap, ForcesAndMomentsAreThoseOfPressureWithoutFriction) {
  // On the surface's body: T (tQ - tP) and T (Q x tQ - P x tP). The normals of a sphere and a cylinder go through centre and axis, those of a
  // body of revolution through its axis: no moment about these.
  const WrapSurface cylinder = WrapSurface::makeCylinder(R, Vec3(1, 0, 0)), sphere = WrapSurface::makeSphere(R);
  const WrapSurface spindle = WrapSurface::makeEllipsoid(R, R, 0.2), disc = WrapSurface::makeEllipsoid(0.15, 0.15, 0.02);
  Random random(8);
  for (const WrapSurface& s : {cylinder, sphere, spindle, disc}) {
    for (int i = 0; i < 300; ++i) {
      const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
      const WrappedSegment r = wrapSegment(s, P, Q);
      if (r.status != Status::wrapped) continue;
      const Vec3 moment = Q.cross(r.directionQ) - P.cross(r.directionP);
      EXPECT_NEAR(moment[2], 0, 1e-11 * 0.2);
      if (s.shape == WrapSurface::Shape::sphere) {
        EXPECT_LT(moment.norm(), 1e-14);
      }
      // Along the free pieces the line of action stays: the same moment at the tangent points.
      EXPECT_LT((P - r.tangentP_m).cross(r.directionP).norm(), 1e-11 * 0.2);
      EXPECT_LT((Q - r.tangentQ_m).cross(r.directionQ).norm(), 1e-10 * 0.2);
    }
  }
}

// ---------------------------------------------------------------- invariance and continuity

TEST(Wrap, ExchangeOfTheEndsReversesThePath) {
  for (const WrapSurface& s : calcOneOfEach()) {
    Random random(9);
    for (int i = 0; i < 500; ++i) {
      const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
      const WrappedSegment r = wrapSegment(s, P, Q);
      WrappedSegment back = wrapSegment(s, Q, P);
      std::swap(back.directionP, back.directionQ);
      std::swap(back.tangentP_m, back.tangentQ_m);
      back.directionP *= -1;
      back.directionQ *= -1;
      expectSame(back, r, s.shape == WrapSurface::Shape::ellipsoid ? 1e-10 : 1e-13);
    }
  }
}

TEST(Wrap, DoesNotDependOnTheFrame) {
  Random random(10);
  for (int i = 0; i < 500; ++i) {
    const Mat3 turn = Eigen::AngleAxisd(random.between(0, 3), random.calcDirection()).toRotationMatrix();
    const Mat3 about = Eigen::AngleAxisd(random.between(0, 3), Vec3::UnitZ()).toRotationMatrix();
    const Vec3 shift(0, 0, random.between(-1, 1));
    const auto check = [](const WrapSurface& s, const Vec3& P, const Vec3& Q, const WrapSurface& moved, const Mat3& M, const Vec3& p,
                          double tolerance) {
      WrappedSegment r = wrapSegment(s, P, Q);
      for (Vec3* v : {&r.directionP, &r.directionQ}) *v = M * *v;
      if (r.status == Status::wrapped) {
        for (Vec3* v : {&r.tangentP_m, &r.tangentQ_m}) *v = M * *v + p;
      }
      expectSame(wrapSegment(moved, M * P + p, M * Q + p), r, tolerance);
    };
    const WrapSurface sphere = WrapSurface::makeSphere(R), cylinder = WrapSurface::makeCylinder(R);
    check(sphere, random.calcOutside(sphere), random.calcOutside(sphere), sphere, turn, Vec3::Zero(), 1e-11);
    check(cylinder, random.calcOutside(cylinder), random.calcOutside(cylinder), cylinder, about, shift, 1e-12);
    const Vec3 side = random.calcDirection();
    check(WrapSurface::makeCylinder(R, side), random.calcOutside(cylinder), random.calcOutside(cylinder),
          WrapSurface::makeCylinder(R, about * side), about, shift, 1e-12);
    // Ellipsoids: axes renamed, and a hundred times as large.
    const WrapSurface s = random.calcEllipsoid(3);
    const Vec3 a = s.halfAxes_m;
    Mat3 rename;
    rename << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
    check(s, P, Q, WrapSurface::makeEllipsoid(a[1], a[2], a[0]), rename, Vec3::Zero(), 1e-10);
    const WrapSurface large = WrapSurface::makeEllipsoid(100 * a[0], 100 * a[1], 100 * a[2]);
    EXPECT_NEAR(calcLength_m(large, 100 * P, 100 * Q), 100 * calcLength_m(s, P, Q), 1e-11);
  }
}

TEST(Wrap, LengthIsContinuousAlongSweeps) {
  // A step of Q changes L by at most that step, through lift-off, symmetric positions and changes of the shorter way.
  for (const WrapSurface& s : calcOneOfEach()) {
    if (s.side) continue;
    const double c = s.shape == WrapSurface::Shape::cylinder ? R : s.halfAxes_m[2];
    const Vec3 D(s.halfAxes_m[0], s.halfAxes_m[1], c), P = D.cwiseProduct(Vec3(1.3, 0.2, -0.4));
    const auto at = [&](double a) {
      return Vec3(D.cwiseProduct(Vec3(std::cos(a), std::sin(a), 0.5 * std::sin(2.3 * a))) * (1.4 + 0.3 * std::cos(5 * a)));
    };
    Vec3 before = at(0);
    double lengthBefore = calcLength_m(s, P, before);
    const int n = 4000;
    for (int i = 1; i <= n; ++i) {
      const Vec3 Q = at(2 * kPi * i / n);
      const WrappedSegment r = wrapSegment(s, P, Q);
      EXPECT_TRUE(r.status == Status::wrapped || r.status == Status::straight);
      EXPECT_LE(std::abs(r.length_m - lengthBefore), (Q - before).norm() + 1e-13) << i;
      before = Q;
      lengthBefore = r.length_m;
    }
  }
}

TEST(Wrap, LengthAndDirectionAreContinuousWhereItGrazes) {
  // A line e deep in a surface of radius of curvature r: the tangents turn by sqrt(2 e/r) at most, the length grows by less than
  // that times e.
  for (const WrapSurface& s : calcOneOfEach()) {
    const double a = s.halfAxes_m[0], b = s.halfAxes_m[1], radius = a * a / b;  // at (0, b), across z
    for (double e = 1e-3; e > 1e-18; e *= 0.1) {
      for (const double sign : {1.0, -1.0}) {
        const double y = b * (1 - sign * e);
        const Vec3 P(-2 * a, y, 0), Q(1.5 * a, y, s.shape == WrapSurface::Shape::cylinder ? a : 0);
        const WrappedSegment r = wrapSegment(s, P, Q);
        if (std::abs(e) > 1e-15) {
          EXPECT_EQ(r.status, sign > 0 ? Status::wrapped : Status::straight) << toString(r.status) << " " << e;
        }
        const double turn = sign > 0 ? 2 * std::sqrt(2 * e * b / radius) + 1e-12 : 1e-15;
        const Vec3 line = (Q - P).normalized();
        EXPECT_LT((r.directionP - line).norm(), turn);
        EXPECT_LT((r.directionQ - line).norm(), turn);
        EXPECT_NEAR(r.length_m, (Q - P).norm(), turn * e * b + 1e-15);
      }
    }
  }
}

TEST(Wrap, EndsOnTheSurfaceLeaveAlongTangents) {
  for (const WrapSurface& s : calcOneOfEach()) {
    Random random(11);
    const Vec3 D = s.halfAxes_m.cwiseMin(0.2);
    for (int i = 0; i < 200; ++i) {
      // A fifth of a turn to two fifths apart, so that the other way is not near.
      const double a = random.between(-1, 0), b = a + random.between(1.2, 2.4);
      const auto at = [&](double angle, double out) {
        return Vec3(D[0] * std::cos(angle) * out, D[1] * std::sin(angle) * out, 0.3 * D[2] * std::cos(3 * a));
      };
      const double z = s.shape == WrapSurface::Shape::cylinder ? 1 : std::sqrt(1 - 0.09 * std::cos(3 * a) * std::cos(3 * a));
      for (const double depth : {0.0, 1e-12, 5e-11}) {
        const Vec3 P = at(a, z * (1 - depth)), Q = at(b, 1.5);
        const WrappedSegment r = wrapSegment(s, P, Q);
        ASSERT_EQ(r.status, Status::wrapped);
        EXPECT_LT((r.tangentP_m - P).norm(), 1e-7);
        const Vec3 outward(P[0] / (D[0] * D[0]), P[1] / (D[1] * D[1]), s.shape == WrapSurface::Shape::cylinder ? 0 : P[2] / (D[2] * D[2]));
        // A point 1e-16 outside has a free length of 1e-8.
        EXPECT_NEAR(r.directionP.dot(outward.normalized()), 0, 1e-7);
        EXPECT_NEAR(r.length_m, calcLength_m(s, at(a, z + 1e-9), Q), 1e-9);
        // Both ends on the surface: all arc.
        const WrappedSegment both = wrapSegment(s, P, at(b, z * (1 - depth)));
        ASSERT_EQ(both.status, Status::wrapped);
        EXPECT_NEAR(both.arcLength_m, both.length_m, 1e-7);
      }
      // Where Q can be seen from the surface the line is straight.
      const Vec3 P = at(a, z * 1.0000001);
      EXPECT_EQ(wrapSegment(s, P, at(a + 0.01, 2)).status, Status::straight);
    }
  }
}

// ---------------------------------------------------------------- the rest

TEST(Wrap, SamplesLieOnThePath) {
  for (const WrapSurface& s : calcOneOfEach()) {
    Random random(12);
    for (int i = 0; i < 30; ++i) {
      const Vec3 P = random.calcOutside(s), Q = random.calcOutside(s);
      const WrappedSegment r = wrapSegment(s, P, Q);
      const std::vector<Vec3> points = sampleSegment(s, P, Q, 100);
      EXPECT_EQ(points.front(), P);
      EXPECT_EQ(points.back(), Q);
      EXPECT_EQ(points.size(), r.status == Status::wrapped ? 102u : 2u);
      double length = 0;
      for (std::size_t k = 1; k < points.size(); ++k) length += (points[k] - points[k - 1]).norm();
      // Chords: shorter than the arc by a part of (2 pi/100)^2/24, twice that where they are not equally long.
      EXPECT_NEAR(length / r.length_m, 1, 4e-4);
      EXPECT_LE(length, r.length_m * (1 + 1e-12));
      for (std::size_t k = 1; k + 1 < points.size(); ++k) {
        Vec3 scaled = points[k].cwiseQuotient(s.halfAxes_m);  // z over infinity: 0
        EXPECT_NEAR(scaled.norm(), 1, 1e-11);
      }
    }
  }
  EXPECT_THAT(message([] { sampleSegment(WrapSurface::makeSphere(1), Vec3(2, 0, 0), Vec3(0, 2, 0), 1); }), HasSubstr("points on the arc = 1"));
}

TEST(Wrap, SaysWhereAnEndIsInside) {
  for (const WrapSurface& s : calcOneOfEach()) {
    const Vec3 P(0.9 * s.halfAxes_m[0], 0, 0), Q(0, 3 * s.halfAxes_m[1], 0.01);
    for (const WrappedSegment& r : {wrapSegment(s, P, Q), wrapSegment(s, -P, P), wrapSegment(s, Vec3::Zero(), Q)}) {
      EXPECT_EQ(r.status, Status::inside);
      EXPECT_NEAR(r.directionQ.norm(), 1, 1e-15);
    }
    EXPECT_DOUBLE_EQ(wrapSegment(s, P, Q).length_m, (Q - P).norm());
    EXPECT_EQ(wrapSegment(s, s.halfAxes_m[0] * (1 - 1e-9) * Vec3::UnitX(), Q).status, Status::inside);
  }
}

TEST(Wrap, AnswersAnything) {
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  for (const WrapSurface& s : calcOneOfEach()) {
    const Vec3 P(0.2, 0.1, 0.1);
    const WrappedSegment same = wrapSegment(s, P, P);
    EXPECT_EQ(same.status, Status::straight);
    EXPECT_EQ(same.length_m, 0);
    EXPECT_EQ(same.directionP, Vec3(Vec3::Zero()));
    for (const double bad : {nan, infinity, -infinity}) {
      for (const WrappedSegment& r : {wrapSegment(s, Vec3(bad, 0, 0), P), wrapSegment(s, P, Vec3(0, 0.2, bad))}) {
        EXPECT_EQ(r.status, Status::notConverged);
        EXPECT_EQ(r.length_m, 0);
      }
    }
    for (const double far : {1e3, 1e6, 1e9, 1e100, 1e200, 1.7e308}) {
      for (const Vec3& Q : {Vec3(-far, 0, 0), Vec3(-far, -far / 2, 1e-3), Vec3(0, 0, far)}) {
        for (const WrappedSegment& r : {wrapSegment(s, P, Q), wrapSegment(s, Q, P), wrapSegment(s, -Q, Q)}) {
          EXPECT_TRUE(std::isfinite(r.length_m) && r.directionP.allFinite() && r.directionQ.allFinite() && r.tangentP_m.allFinite());
          if (far < 1e7) {
            EXPECT_NE(r.status, Status::notConverged) << far;
          }
        }
      }
    }
  }
}

TEST(WrapSurface, RefusesWhatHasNoMeaning) {
  const double nan = std::nan("");
  EXPECT_THAT(message([] { WrapSurface::makeSphere(0); }), HasSubstr("wrapping sphere: radius = 0 m is not allowed; allowed: > 0 m"));
  EXPECT_THAT(message([&] { WrapSurface::makeCylinder(nan); }), HasSubstr("wrapping cylinder: radius = nan m"));
  EXPECT_THAT(message([] { WrapSurface::makeEllipsoid(1, -2, 1); }), HasSubstr("half axis = -2 m"));
  EXPECT_THAT(message([] { WrapSurface::makeEllipsoid(1, 101, 1); }),
              HasSubstr("longest over shortest half axis = 101 is not allowed; allowed: 1 to 100"));
  EXPECT_THAT(message([] { WrapSurface::makeCylinder(1, Vec3(0, 0, 1)); }), HasSubstr("part of the side across the axis = 0"));
  EXPECT_THAT(message([] { WrapSurface::makeCylinder(1, Vec3(0, 0, 0)); }), HasSubstr("part of the side across the axis = 0"));
  EXPECT_THAT(message([&] { WrapSurface::makeCylinder(1, Vec3(1, nan, 0)); }), HasSubstr("component of the side = nan"));
  WrapSurface unset;
  EXPECT_THAT(message([&] { unset.validate(); }), HasSubstr("radius = 0 m"));
}

}  // namespace
}  // namespace genu::musculoskeletal
