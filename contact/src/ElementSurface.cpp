#include "detail/ElementSurface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "detail/LayerThickness.h"

namespace genu::contact {

using detail::fail;

const char* toString(const ElementSurface& surface) {
  return std::holds_alternative<ElementPlane>(surface)      ? "plane"
         : std::holds_alternative<ElementCylinder>(surface) ? "cylinder"
                                                            : "sphere";
}

namespace {

constexpr double kFullTurn = 2 * kPi, kTurnSlack = 1e-9;  // [rad]

/** Unit axis k and unit direction d of angle 0, at right angles. */
template <class Round>
std::pair<Vec3, Vec3> calcDirections(const std::string& name, const Round& round) {
  if (!(round.axis.norm() > 0) || !round.axis.allFinite()) {
    fail("compartment ", name, ": axis (", round.axis.x(), ", ", round.axis.y(), ", ", round.axis.z(),
         ") of the element surface has no direction; needed: a finite vector that is not zero");
  }
  const Vec3 k = round.axis.normalized();
  Vec3 d = round.zero.value_or(Vec3(0, -1, 0));
  if (!round.zero && std::abs(k.y()) > 1 - 1e-12) d = Vec3::UnitX();
  const double length = d.norm();
  d -= d.dot(k) * k;
  if (!(d.norm() > 1e-6 * length)) {
    fail("compartment ", name, ": the direction of angle 0 of the element surface lies along its axis; needed: one that is not parallel");
  }
  return {k, d.normalized()};
}

void requireRange(const std::string& name, const char* what, const char* unit, double from, double to) {
  if (to > from && std::isfinite(from) && std::isfinite(to)) return;
  fail("compartment ", name, ": ", what, " ", from, " .. ", to, " ", unit, " of the element surface is empty; needed: from < to");
}

void requirePlace(const std::string& name, const char* what, const Vec3& p) {
  if (p.allFinite()) return;
  fail("compartment ", name, ": ", what, " (", p.x(), ", ", p.y(), ", ", p.z(), ") m of the element surface is not allowed; allowed: "
       "finite numbers");
}

template <class Round>
void requireRound(const std::string& name, const Round& round) {
  requireRange(name, "angle", "rad", round.angle0_rad, round.angle1_rad);
  if (round.angle1_rad - round.angle0_rad > kFullTurn + kTurnSlack) {
    fail("compartment ", name, ": angle ", round.angle0_rad, " .. ", round.angle1_rad,
         " rad of the element surface is more than a full turn; allowed: at most 2 pi rad");
  }
  if (round.radius_m && !(*round.radius_m > 0)) {
    fail("compartment ", name, ": radius = ", *round.radius_m, " m of the element surface is not allowed; allowed: > 0 m");
  }
}

}  // namespace

ElementRays::ElementRays(const CompartmentDefinition& c) {
  if (c.nx < 1 || c.nz < 1 || c.nx > 10000 || c.nz > 10000) {
    fail("compartment ", c.name, ": grid ", c.nx, "x", c.nz, " is not allowed; allowed: 1 to 10000 each way");
  }
  if (c.nx > kMaxGridCells / c.nz) {
    fail("compartment ", c.name, ": grid ", c.nx, "x", c.nz, " has more cells than a compartment can have; allowed: at most ", kMaxGridCells);
  }
  double a1 = 0, b1 = 0;
  if (const auto* plane = std::get_if<ElementPlane>(&c.elementSurface)) {
    if (!std::isfinite(c.x0_m) || !std::isfinite(c.x1_m) || !std::isfinite(c.z0_m) || !std::isfinite(c.z1_m)) {
      fail("compartment ", c.name, ": rectangle x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
           " m is not allowed; allowed: finite numbers");
    }
    if (!(c.x1_m > c.x0_m) || !(c.z1_m > c.z0_m)) {
      fail("compartment ", c.name, ": rectangle x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
           " m is empty; needed: x0 < x1 and z0 < z1");
    }
    a0_ = c.x0_m;
    a1 = c.x1_m;
    b0_ = c.z0_m;
    b1 = c.z1_m;
    axis_ = Vec3(0, plane->facing == PlaneFacing::up ? 1 : -1, 0);
  } else if (const auto* cylinder = std::get_if<ElementCylinder>(&c.elementSurface)) {
    kind_ = Kind::cylinder;
    requireRound(c.name, *cylinder);
    requirePlace(c.name, "point on the axis", cylinder->point_m);
    requireRange(c.name, "axial range", "m", cylinder->axial0_m, cylinder->axial1_m);
    std::tie(axis_, zero_) = calcDirections(c.name, *cylinder);
    origin_ = cylinder->point_m;
    facing_ = cylinder->facing == RoundFacing::outward ? 1 : -1;
    a0_ = cylinder->angle0_rad;
    a1 = cylinder->angle1_rad;
    b0_ = cylinder->axial0_m;
    b1 = cylinder->axial1_m;
  } else {
    const auto& sphere = std::get<ElementSphere>(c.elementSurface);
    kind_ = Kind::sphere;
    requireRound(c.name, sphere);
    requirePlace(c.name, "centre", sphere.center_m);
    requireRange(c.name, "elevation", "rad", sphere.elevation0_rad, sphere.elevation1_rad);
    if (!(sphere.elevation0_rad > -0.5 * kPi) || !(sphere.elevation1_rad < 0.5 * kPi)) {
      fail("compartment ", c.name, ": elevation ", sphere.elevation0_rad, " .. ", sphere.elevation1_rad,
           " rad of the element surface reaches a pole of its grid; allowed: within -pi/2 .. pi/2 rad (turn the axis away)");
    }
    std::tie(axis_, zero_) = calcDirections(c.name, sphere);
    origin_ = sphere.center_m;
    facing_ = sphere.facing == RoundFacing::outward ? 1 : -1;
    a0_ = sphere.angle0_rad;
    a1 = sphere.angle1_rad;
    b0_ = sphere.elevation0_rad;
    b1 = sphere.elevation1_rad;
  }
  side_ = axis_.cross(zero_);
  da_ = (a1 - a0_) / c.nx;
  db_ = (b1 - b0_) / c.nz;
  wraps_ = kind_ != Kind::plane && c.nx >= 3 && std::abs(a1 - a0_ - kFullTurn) <= kTurnSlack;
}

Vec3 ElementRays::calcOrigin(double a, double b) const {
  if (kind_ == Kind::plane) return Vec3(a, 0, b);
  return kind_ == Kind::cylinder ? Vec3(origin_ + b * axis_) : origin_;
}

Vec3 ElementRays::calcDirection(double a, double b) const {
  if (kind_ == Kind::plane) return axis_;
  const Vec3 around = std::cos(a) * zero_ + std::sin(a) * side_;
  return kind_ == Kind::cylinder ? around : Vec3(std::cos(b) * around + std::sin(b) * axis_);
}

double ElementRays::calcArea(double a, double b, const Vec3& point, const Vec3& normal) const {
  if (kind_ == Kind::plane) return da_ * db_ / std::abs(normal.y());
  const Vec3 direction = calcDirection(a, b);
  const double rho = (point - calcOrigin(a, b)).dot(direction), across = std::abs(normal.dot(direction));
  return (kind_ == Kind::cylinder ? rho : rho * rho * std::cos(b)) * da_ * db_ / across;
}

ElementSurface findExtent(const ContactSurface& surface, ElementSurface elements) {
  if (std::holds_alternative<ElementPlane>(elements)) return elements;
  std::vector<double> angles;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  const auto sample = [&](auto& round, auto calcOther) {
    const auto [k, d] = calcDirections("", round);
    const Vec3 side = k.cross(d);
    const double facing = round.facing == RoundFacing::outward ? 1 : -1;
    constexpr int kSamples = 200;
    for (int patch = 0; patch < surface.numPatches(); ++patch) {
      const NurbsPatch& p = surface.patch(patch);
      for (int i = 0; i <= kSamples; ++i) {
        for (int j = 0; j <= kSamples; ++j) {
          const double u = p.uMin() + (p.uMax() - p.uMin()) * i / kSamples, v = p.vMin() + (p.vMax() - p.vMin()) * j / kSamples;
          const auto [radial, other] = calcOther(p.calcPoint(u, v), k);
          if (!(facing * p.calcNormal(u, v).dot(radial) > 0)) continue;
          low = std::min(low, other);
          high = std::max(high, other);
          angles.push_back(std::atan2(radial.dot(side), radial.dot(d)));
        }
      }
    }
    if (angles.empty()) {
      fail("element surface: no part of the contact surface faces ", facing > 0 ? "away from" : "towards", " its ",
           toString(elements) == std::string("cylinder") ? "axis" : "centre", "; its normals are inverted, or it faces the other way");
    }
    // The smallest arc that holds all angles: the turn without the largest gap. Samples all around leave only small gaps.
    std::sort(angles.begin(), angles.end());
    double gap = angles.front() + kFullTurn - angles.back(), start = angles.front(), end = angles.back();
    for (size_t i = 0; i + 1 < angles.size(); ++i) {
      if (!(angles[i + 1] - angles[i] > gap)) continue;
      gap = angles[i + 1] - angles[i];
      start = angles[i + 1];
      end = angles[i] + kFullTurn;
    }
    const bool whole = gap < 0.1;  // [rad]; 200 samples of a quarter turn are 0.008 apart
    if (end > kPi && !whole) {     // angles near zero rather than near a full turn
      const double middle = 0.5 * (start + end);
      const double turns = std::round(middle / kFullTurn);
      start -= turns * kFullTurn;
      end -= turns * kFullTurn;
    }
    round.angle0_rad = whole ? -kPi : start;
    round.angle1_rad = whole ? kPi : end;
  };
  if (auto* cylinder = std::get_if<ElementCylinder>(&elements)) {
    sample(*cylinder, [&](const Vec3& p, const Vec3& k) {
      const Vec3 r = p - cylinder->point_m;
      return std::pair<Vec3, double>(r - r.dot(k) * k, r.dot(k));
    });
    cylinder->axial0_m = low;
    cylinder->axial1_m = high;
  } else {
    auto& sphere = std::get<ElementSphere>(elements);
    sample(sphere, [&](const Vec3& p, const Vec3& k) {
      const Vec3 r = p - sphere.center_m;
      return std::pair<Vec3, double>(r, std::asin(std::min(1.0, std::max(-1.0, r.dot(k) / r.norm()))));
    });
    constexpr double kNearPole = 0.5 * kPi - 1e-3;  // [rad]
    sphere.elevation0_rad = std::max(low, -kNearPole);
    sphere.elevation1_rad = std::min(high, kNearPole);
  }
  return elements;
}

namespace detail {

NodeProjector::NodeProjector(const CompartmentDefinition& c, const Thickness& thickness, const std::optional<double>& planeY_m)
    : surface_(*c.fixedSurface), thickness_(thickness), rays_(c) {
  const Eigen::AlignedBox3d box = surface_.boundingBox();
  const double margin = 1e-6 * box.diagonal().norm();
  if (rays_.isPlane()) {
    const double sign = rays_.calcDirection(0, 0).y();
    from_ = (sign > 0 ? box.min().y() : -box.max().y()) - margin;
    to_ = (sign > 0 ? box.max().y() : -box.min().y()) + margin;
    if (planeY_m) limit_ = sign * *planeY_m;
    return;
  }
  if (std::holds_alternative<HeightAbovePlane>(thickness.source)) {
    fail("compartment ", c.name, ": a thickness measured as the height above a plane needs a plane element surface; on a ",
         toString(c.elementSurface), " use a constant, a back surface or a radial thickness");
  }
  if (const auto* cylinder = std::get_if<ElementCylinder>(&c.elementSurface)) limit_ = cylinder->radius_m;
  if (const auto* sphere = std::get_if<ElementSphere>(&c.elementSurface)) limit_ = sphere->radius_m;
  from_ = margin;  // a crossing at the axis itself has no direction
  to_ = 0;
  for (const double b : {rays_.b0(), rays_.b0() + c.nz * rays_.db()}) {
    for (int k = 0; k < 8; ++k) {
      const Vec3 corner = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
      to_ = std::max(to_, (corner - rays_.calcOrigin(0, b)).norm() + margin);
    }
  }
}

ProjectedNode NodeProjector::projectNode(double a, double b) {
  ProjectedNode out;
  if (rays_.isSphere() && !(std::abs(b) < 0.5 * kPi)) return out;  // beyond a pole of the grid
  const Vec3 direction = rays_.calcDirection(a, b);
  surface_.findLineHits(rays_.calcOrigin(a, b) + from_ * direction, direction, 0, to_ - from_, hits_);
  const LineHit* chosen = nullptr;
  bool anyRight = false;
  for (const LineHit& hit : hits_) {  // sorted along the ray
    if (!(rays_.facing() * hit.normal.dot(direction) > 0)) continue;
    anyRight = true;
    if (limit_) {
      const double advance = rays_.isPlane() ? hit.point.dot(direction) : from_ + hit.t_m;
      if (!(rays_.facing() * (advance - *limit_) > 0)) continue;
    }
    chosen = &hit;
    if (rays_.facing() < 0) break;
  }
  if (chosen == nullptr) {
    out.status = hits_.empty() ? NodeStatus::missedSurface : anyRight ? NodeStatus::behindLimit : NodeStatus::wrongSide;
    return out;
  }
  out.point = chosen->point;
  out.normal = chosen->normal;
  if (const auto* plane = std::get_if<HeightAbovePlane>(&thickness_.source)) {
    if (!((out.point.y() - plane->planeY_m) * direction.y() > 0)) {
      out.status = NodeStatus::underPlane;
      return out;
    }
  }
  out.h = measureThickness(thickness_, out.point, out.normal, backHits_);
  if (std::isnan(out.h)) {
    out.missedBack = true;
    if (!thickness_.missing_m) {
      out.status = NodeStatus::missedBack;
      return out;
    }
    out.h = *thickness_.missing_m;
  } else if (!std::holds_alternative<RigidBody>(thickness_.source)) {
    out.clamped = clampThickness(thickness_, out.h);
  }
  out.area = rays_.calcArea(a, b, out.point, out.normal);
  out.status = NodeStatus::ok;
  return out;
}

}  // namespace detail

}  // namespace genu::contact
