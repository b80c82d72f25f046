#include "detail/LayerThickness.h"

#include <cmath>
#include <limits>

namespace genu::contact::detail {

namespace {
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
}  // namespace

double measureThickness(const Thickness& thickness, const Vec3& point, const Vec3& normal, std::vector<LineHit>& hits) {
  struct Visitor {
    const Vec3& point;
    const Vec3& normal;
    std::vector<LineHit>& hits;
    double operator()(const RigidBody&) const { return 0; }
    double operator()(const ConstantThickness& t) const { return t.h_m; }
    double operator()(const HeightAbovePlane& t) const { return std::abs(point.y() - t.planeY_m); }
    double operator()(const RadialThickness& t) const {
      Vec3 r = point - t.center_m;
      if (t.axis) r -= r.dot(*t.axis) / t.axis->squaredNorm() * *t.axis;
      const double h = r.dot(normal) < 0 ? t.radius_m - r.norm() : r.norm() - t.radius_m;  // a socket, a head
      return h > 0 ? h : kNaN;
    }
    double operator()(const BackSurface& t) const {
      if (t.direction == BackDirection::closest) {
        const ClosestPoint foot = t.surface->findClosestPoint(point);
        return foot.status == QueryStatus::converged && foot.distance_m > 0 ? foot.distance_m : kNaN;
      }
      t.surface->findLineHits(point, -normal, 0, t.surface->boundingBox().diagonal().norm(), hits);
      for (const LineHit& hit : hits) {
        // The back faces the same way as the layer's surface; a sheet that faces the other way is its far side.
        if (hit.t_m > 0 && hit.normal.dot(normal) > 0) return hit.t_m;
      }
      return kNaN;
    }
  };
  return std::visit(Visitor{point, normal, hits}, thickness.source);
}

bool clampThickness(const Thickness& thickness, double& h) {
  const double before = h;
  if (thickness.min_m) h = std::max(h, *thickness.min_m);
  if (thickness.max_m) h = std::min(h, *thickness.max_m);
  return h != before;
}

void validateThickness(const char* body, const Thickness& t) {
  if (const auto* c = std::get_if<ConstantThickness>(&t.source)) {
    if (!(c->h_m > 0) || !std::isfinite(c->h_m)) {
      fail("thickness of the ", body, " body = ", c->h_m, " m is not allowed; allowed: > 0 m (or none for a rigid body)");
    }
  }
  if (const auto* b = std::get_if<BackSurface>(&t.source)) {
    if (!b->surface) fail("thickness of the ", body, " body: the back surface is missing");
  }
  if (const auto* r = std::get_if<RadialThickness>(&t.source)) {
    if (!(r->radius_m > 0) || !std::isfinite(r->radius_m) || !r->center_m.allFinite()) {
      fail("thickness of the ", body, " body: radius of its back = ", r->radius_m, " m is not allowed; allowed: > 0 m, about a finite centre");
    }
    if (r->axis && (!(r->axis->norm() > 0) || !r->axis->allFinite())) {
      fail("thickness of the ", body, " body: the axis of its back has no direction; needed: a finite vector that is not zero");
    }
  }
  if (const auto* plane = std::get_if<HeightAbovePlane>(&t.source)) {
    if (!std::isfinite(plane->planeY_m)) {
      fail("thickness of the ", body, " body: its plane y = ", plane->planeY_m, " m is not allowed; allowed: a finite number");
    }
  }
  if (t.min_m && !(*t.min_m > 0 && std::isfinite(*t.min_m))) fail("thickness of the ", body, " body: min = ", *t.min_m, " m; allowed: > 0 m");
  if (t.max_m && !(*t.max_m > 0)) fail("thickness of the ", body, " body: max = ", *t.max_m, " m; allowed: > 0 m");
  if (t.min_m && t.max_m && *t.min_m > *t.max_m) {
    fail("thickness of the ", body, " body: min = ", *t.min_m, " m is larger than max = ", *t.max_m, " m");
  }
  if (t.missing_m && !(*t.missing_m > 0 && std::isfinite(*t.missing_m))) {
    fail("thickness of the ", body, " body: missing = ", *t.missing_m, " m; allowed: > 0 m");
  }
}

ThicknessMap::ThicknessMap(const char* body, const ContactSurface& surface, const Thickness& thickness, ThicknessMapReport& report) {
  std::vector<LineHit> hits;
  double sum = 0;
  report.min_m = std::numeric_limits<double>::infinity();
  for (int k = 0; k < surface.numPatches(); ++k) {
    const NurbsPatch& p = surface.patch(k);
    Map map;
    map.nu = thickness.mapSamplesU;
    map.nv = thickness.mapSamplesV;
    map.u0 = p.uMin();
    map.v0 = p.vMin();
    map.scaleU = (map.nu - 1) / (p.uMax() - p.uMin());
    map.scaleV = (map.nv - 1) / (p.vMax() - p.vMin());
    for (int i = 0; i < map.nu; ++i) {
      for (int j = 0; j < map.nv; ++j) {
        const double u = i + 1 == map.nu ? p.uMax() : map.u0 + i / map.scaleU;
        const double v = j + 1 == map.nv ? p.vMax() : map.v0 + j / map.scaleV;
        double h = measureThickness(thickness, p.calcPoint(u, v), p.calcNormal(u, v), hits);
        ++report.samples;
        if (std::isnan(h)) {
          ++report.missed;
          if (thickness.missing_m) h = *thickness.missing_m;
        } else if (clampThickness(thickness, h)) {
          ++report.clamped;
        }
        if (!std::isnan(h)) {
          report.min_m = std::min(report.min_m, h);
          report.max_m = std::max(report.max_m, h);
          sum += h;
        }
        map.h.push_back(h);
      }
    }
    maps_.push_back(std::move(map));
  }
  hasHoles_ = report.missed > 0 && !thickness.missing_m;
  const int valid = thickness.missing_m ? report.samples : report.samples - report.missed;
  report.mean_m = valid > 0 ? sum / valid : 0;
  if (valid == 0) {
    fail("thickness of the ", body, " body: the back surface is missed by all ", report.samples,
         " samples; check its frame, its normals and the direction (normal or closest)");
  }
}

std::array<double, 4> ThicknessMap::findFullRectangle(int patch) const {
  const Map& m = maps_[static_cast<size_t>(patch)];
  int i0 = 0, i1 = m.nu - 1, j0 = 0, j1 = m.nv - 1;
  for (int i = 0; i < m.nu; ++i) {
    for (int j = 0; j < m.nv; ++j) {
      if (i < i0 || i > i1 || j < j0 || j > j1) continue;
      if (!std::isnan(m.h[static_cast<size_t>(i) * static_cast<size_t>(m.nv) + static_cast<size_t>(j)])) continue;
      const double cut[4] = {(i - i0) / static_cast<double>(m.nu), (i1 - i) / static_cast<double>(m.nu),
                             (j - j0) / static_cast<double>(m.nv), (j1 - j) / static_cast<double>(m.nv)};
      switch (std::min_element(cut, cut + 4) - cut) {
        case 0: i0 = i + 1; break;
        case 1: i1 = i - 1; break;
        case 2: j0 = j + 1; break;
        default: j1 = j - 1; break;
      }
    }
  }
  if (i0 > i1 || j0 > j1) return {1, 0, 1, 0};
  return {m.u0 + i0 / m.scaleU, m.u0 + i1 / m.scaleU, m.v0 + j0 / m.scaleV, m.v0 + j1 / m.scaleV};
}

}  // namespace genu::contact::detail
