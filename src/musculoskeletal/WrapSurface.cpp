#include "genu/musculoskeletal/WrapSurface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "EllipsoidGeodesic.h"
#include "Range.h"

namespace genu::musculoskeletal {

namespace {

using contact::kPi;
using Shape = WrapSurface::Shape;
using Status = WrappedSegment::Status;

constexpr double kOnSurface = 1e-10;  // how deep inside, over the size, an end still counts as on the surface

WrappedSegment calcStraight(const Vec3& P, const Vec3& Q, Status status) {
  WrappedSegment r;
  r.status = status;
  const Vec3 way = Q - P;
  const double length = way.stableNorm();
  if (!std::isfinite(length)) {
    r.status = Status::notConverged;
    return r;
  }
  r.length_m = length;
  if (length > 0) r.directionP = r.directionQ = way / length;
  return r;
}

/** The string in a plane around a circle about the origin, going by `between` > 0 from P to Q. */
struct AroundCircle {
  double radius, rP, rQ, freeP, freeQ, wrap;

  AroundCircle(double R, double distanceP, double distanceQ, double between)
      : radius(R), rP(std::max(distanceP, R)), rQ(std::max(distanceQ, R)) {
    freeP = std::sqrt((rP - R) * (rP + R));
    freeQ = std::sqrt((rQ - R) * (rQ + R));
    wrap = between - std::atan2(freeP, R) - std::atan2(freeQ, R);
  }

  /** @param uP, uQ unit vectors to the ends  @param fP, fQ those turned by 90 deg, forward */
  WrappedSegment calcPath(const Vec3& uP, const Vec3& fP, const Vec3& uQ, const Vec3& fQ) const {
    WrappedSegment r;
    r.status = Status::wrapped;
    r.directionP = (radius * fP - freeP * uP) / rP;
    r.directionQ = (radius * fQ + freeQ * uQ) / rQ;
    r.tangentP_m = radius / rP * (radius * uP + freeP * fP);
    r.tangentQ_m = radius / rQ * (radius * uQ - freeQ * fQ);
    r.arcLength_m = radius * wrap;
    r.length_m = freeP + r.arcLength_m + freeQ;
    return r;
  }
};

/** Azimuth in (-pi, pi] from the x axis. */
double calcAzimuth(double x, double y) { return y == 0 ? (x < 0 ? kPi : 0) : std::atan2(y, x); }

WrappedSegment wrapCylinder(const WrapSurface& surface, const Vec3& P, const Vec3& Q) {
  const double R = surface.halfAxes_m[0], rP = std::hypot(P[0], P[1]), rQ = std::hypot(Q[0], Q[1]);
  if (std::min(rP, rQ) < R * (1 - kOnSurface)) return calcStraight(P, Q, Status::inside);
  double turn = 0;  // from P to Q about z
  if (surface.side) {
    const double x = (*surface.side)[0], y = (*surface.side)[1];
    const auto azimuth = [&](const Vec3& p) { return calcAzimuth(x * p[0] + y * p[1], x * p[1] - y * p[0]); };
    turn = azimuth(Q) - azimuth(P);
  } else {
    turn = calcAzimuth(P[0] * Q[0] + P[1] * Q[1], P[0] * Q[1] - P[1] * Q[0]);
  }
  const AroundCircle circle(R, rP, rQ, std::abs(turn));
  if (!(circle.wrap > 0)) return calcStraight(P, Q, Status::straight);
  const double forward = turn > 0 ? 1 : -1;
  const Vec3 uP(P[0] / rP, P[1] / rP, 0), uQ(Q[0] / rQ, Q[1] / rQ, 0);
  WrappedSegment r = circle.calcPath(uP, forward * Vec3(-uP[1], uP[0], 0), uQ, forward * Vec3(-uQ[1], uQ[0], 0));
  // Unrolled, the helix and its tangents are one straight line.
  const double across = r.length_m, rise = Q[2] - P[2], length = std::hypot(across, rise);
  for (Vec3* direction : {&r.directionP, &r.directionQ}) *direction = (*direction * across + Vec3(0, 0, rise)) / length;
  r.tangentP_m[2] = P[2] + rise * (circle.freeP / across);
  r.tangentQ_m[2] = Q[2] - rise * (circle.freeQ / across);
  r.arcLength_m *= length / across;
  r.length_m = length;
  return r;
}

WrappedSegment wrapSphere(const WrapSurface& surface, const Vec3& P, const Vec3& Q) {
  const double R = surface.halfAxes_m[0], rP = P.norm(), rQ = Q.norm();
  if (std::min(rP, rQ) < R * (1 - kOnSurface)) return calcStraight(P, Q, Status::inside);
  const Vec3 uP = P / rP, uQ = Q / rQ;
  Vec3 n = uP.cross(uQ);
  const double sine = n.norm();
  const AroundCircle circle(R, rP, rQ, std::atan2(sine, uP.dot(uQ)));
  if (!(circle.wrap > 0)) return calcStraight(P, Q, Status::straight);
  if (sine < 1e-12) n = uP.unitOrthogonal();  // opposite each other
  n = (n - uP.dot(n) * uP).normalized();
  return circle.calcPath(uP, n.cross(uP), uQ, n.cross(uQ));
}

/** -1: P or Q is inside; 0: the segment does not enter; 1: it does. In the space where the ellipsoid is the unit sphere. */
int classifyInEllipsoid(const Vec3& halfAxes, const Vec3& P, const Vec3& Q) {
  const Vec3 Ph = P.cwiseQuotient(halfAxes), Qh = Q.cwiseQuotient(halfAxes), way = Qh - Ph;
  if (std::min(Ph.norm(), Qh.norm()) < 1 - kOnSurface) return -1;
  const double beyondP = -Ph.dot(way), beyondQ = Qh.dot(way);
  if (!(beyondP > 0 && beyondQ > 0)) return 0;
  return Ph.cross(way).squaredNorm() < way.squaredNorm() ? 1 : 0;
}

WrappedSegment wrapEllipsoid(const WrapSurface& surface, const Vec3& P, const Vec3& Q) {
  const int place = classifyInEllipsoid(surface.halfAxes_m, P, Q);
  if (place <= 0) return calcStraight(P, Q, place < 0 ? Status::inside : Status::straight);
  const EllipsoidGeodesic g = findGeodesic(surface.halfAxes_m, P, Q);
  if (!g.converged) return calcStraight(P, Q, Status::notConverged);
  WrappedSegment r;
  r.status = Status::wrapped;
  r.length_m = g.freeP_m + g.arc_m + g.freeQ_m;
  r.directionP = g.directionP;
  r.directionQ = g.directionQ;
  r.tangentP_m = g.tangentP_m;
  r.tangentQ_m = g.tangentQ_m;
  r.arcLength_m = g.arc_m;
  return r;
}

}  // namespace

const char* toString(Status status) {
  switch (status) {
    case Status::straight: return "straight";
    case Status::wrapped: return "wrapped";
    case Status::inside: return "inside";
    case Status::notConverged: return "not_converged";
  }
  return "";
}

WrapSurface WrapSurface::makeCylinder(double radius_m, std::optional<Vec3> side) {
  const WrapSurface surface = {Shape::cylinder, Vec3(radius_m, radius_m, std::numeric_limits<double>::infinity()), side};
  surface.validate();
  return surface;
}

WrapSurface WrapSurface::makeSphere(double radius_m) {
  const WrapSurface surface = {Shape::sphere, Vec3::Constant(radius_m), std::nullopt};
  surface.validate();
  return surface;
}

WrapSurface WrapSurface::makeEllipsoid(double a_m, double b_m, double c_m) {
  const WrapSurface surface = {Shape::ellipsoid, Vec3(a_m, b_m, c_m), std::nullopt};
  surface.validate();
  return surface;
}

void WrapSurface::validate() const {
  if (shape == Shape::ellipsoid) {
    for (int i = 0; i < 3; ++i) require(halfAxes_m[i] > 0, "wrapping ellipsoid: half axis", halfAxes_m[i], "m", "> 0 m");
    require(halfAxes_m.maxCoeff() <= kLargestAxisRatio * halfAxes_m.minCoeff(), "wrapping ellipsoid: longest over shortest half axis",
            halfAxes_m.maxCoeff() / halfAxes_m.minCoeff(), "", "1 to 100");
    return;
  }
  require(halfAxes_m[0] > 0, shape == Shape::sphere ? "wrapping sphere: radius" : "wrapping cylinder: radius", halfAxes_m[0], "m", "> 0 m");
  if (!side) return;
  for (int i = 0; i < 3; ++i) require(true, "wrapping cylinder: component of the side", (*side)[i], "", "a number");
  const double across = std::hypot((*side)[0], (*side)[1]);
  require(across > 1e-6 * side->norm(), "wrapping cylinder: part of the side across the axis", across, "",
          "more than 1e-6 of the whole, which must not be 0");
}

WrappedSegment wrapSegment(const WrapSurface& surface, const Vec3& P, const Vec3& Q) {
  WrappedSegment r;
  if (!P.allFinite() || !Q.allFinite()) {
    r.status = Status::notConverged;
    return r;
  }
  switch (surface.shape) {
    case Shape::cylinder: r = wrapCylinder(surface, P, Q); break;
    case Shape::sphere: r = wrapSphere(surface, P, Q); break;
    case Shape::ellipsoid: r = wrapEllipsoid(surface, P, Q); break;
  }
  const bool finite = std::isfinite(r.length_m) && r.directionP.allFinite() && r.directionQ.allFinite();
  return finite ? r : calcStraight(P, Q, Status::notConverged);
}

std::vector<Vec3> sampleSegment(const WrapSurface& surface, const Vec3& P, const Vec3& Q, int arcPoints) {
  require(arcPoints >= 2, "points on the arc", arcPoints, "", ">= 2");
  const WrappedSegment path = wrapSegment(surface, P, Q);
  std::vector<Vec3> points = {P};
  if (path.status == Status::wrapped) {
    EllipsoidGeodesic geodesic;
    if (surface.shape == Shape::ellipsoid) geodesic = findGeodesic(surface.halfAxes_m, P, Q);
    // Round cross-sections: turn the tangent point of P towards the path's direction there.
    const double R = surface.halfAxes_m[0];
    Vec3 out = path.tangentP_m, along = path.directionP;
    double rise = 0;
    if (surface.shape == Shape::cylinder) {
      out[2] = along[2] = 0;
      rise = path.tangentQ_m[2] - path.tangentP_m[2];
    }
    along.normalize();
    const double angle = std::sqrt(std::max(0.0, (path.arcLength_m - rise) * (path.arcLength_m + rise))) / R;
    for (int i = 0; i < arcPoints; ++i) {
      const double part = double(i) / (arcPoints - 1);
      if (i == 0 || i == arcPoints - 1) {
        points.push_back(i == 0 ? path.tangentP_m : path.tangentQ_m);
      } else if (surface.shape == Shape::ellipsoid) {
        points.push_back(calcPointOnGeodesic_m(geodesic, surface.halfAxes_m, P, Q, part));
      } else {
        const double z = surface.shape == Shape::cylinder ? path.tangentP_m[2] + part * rise : 0;
        points.push_back(std::cos(part * angle) * out + R * std::sin(part * angle) * along + Vec3(0, 0, z));
      }
    }
  }
  points.push_back(Q);
  return points;
}

}  // namespace genu::musculoskeletal
