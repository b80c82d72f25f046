#include <cmath>
#include <limits>

#include "detail/ContactPairImpl.h"

namespace genu::contact {

using namespace detail;

void ContactPair::Impl::buildCompartment(const CompartmentDefinition& c) {
  if (!c.fixedSurface) fail("compartment ", c.name, ": the fixed surface is missing");
  if (!c.movingSurface) fail("compartment ", c.name, ": the moving surface is missing");
  if (!(c.x1_m > c.x0_m) || !(c.z1_m > c.z0_m)) {
    fail("compartment ", c.name, ": rectangle x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
         " m is empty; needed: x0 < x1 and z0 < z1");
  }
  if (c.nx < 1 || c.nz < 1 || c.nx > 10000 || c.nz > 10000) {
    fail("compartment ", c.name, ": grid ", c.nx, "x", c.nz, " is not allowed; allowed: 1 to 10000 each way");
  }
  Compartment out;
  GridReport report;
  out.name = report.name = c.name;
  out.nx = c.nx;
  out.nz = c.nz;
  out.moving = c.movingSurface.get();
  if (definition.rule == ContactRule::smooth) out.predictor = std::make_unique<DistancePredictor>(*c.movingSurface);
  report.cells = c.nx * c.nz;
  out.element.assign(static_cast<size_t>(report.cells), -1);
  const double dx = (c.x1_m - c.x0_m) / c.nx, dz = (c.z1_m - c.z0_m) / c.nz;
  out.cellSize_m = std::sqrt(dx * dz);
  const Eigen::AlignedBox3d box = c.fixedSurface->boundingBox();
  const double margin = 1e-6 * box.diagonal().norm();
  const double bottom = box.min().y() - margin, top = box.max().y() + margin;
  std::vector<LineHit> hits;
  std::vector<LineHit> backHits;
  double sumThickness = 0;
  report.minThickness_m = std::numeric_limits<double>::infinity();
  struct Outside {  // nodes of the ring around the rectangle
    int ix, iz;
    Vec3 point, normal;
    double area, h;
  };
  std::vector<Outside> outside;
  for (int ix = -1; ix <= c.nx; ++ix) {
    for (int iz = -1; iz <= c.nz; ++iz) {
      const bool inside = ix >= 0 && ix < c.nx && iz >= 0 && iz < c.nz;
      const double x = c.x0_m + (ix + 0.5) * dx, z = c.z0_m + (iz + 0.5) * dz;
      c.fixedSurface->findLineHits(Vec3(x, bottom, z), Vec3::UnitY(), 0, top - bottom, hits);
      const LineHit* highest = nullptr;
      bool anyUp = false;
      for (const LineHit& hit : hits) {
        if (!(hit.normal.y() > 0)) continue;
        anyUp = true;
        if (definition.planeY_m && !(hit.point.y() > *definition.planeY_m)) continue;
        highest = &hit;  // hits are sorted upwards
      }
      if (highest == nullptr) {
        if (inside) ++(hits.empty() ? report.missedSurface : anyUp ? report.belowPlane : report.downwardOnly);
        continue;
      }
      Vec3 point = highest->point;
      if (const auto* plane = std::get_if<HeightAbovePlane>(&definition.fixedThickness.source)) {
        if (!(point.y() > plane->planeY_m)) {
          if (!inside) continue;
          fail("compartment ", c.name, ": the fixed surface lies at y = ", point.y(), " m (x = ", x, " m, z = ", z,
               " m), not above the plane y = ", plane->planeY_m, " m from which its thickness is measured: the thickness "
               "would be negative; lower the plane");
        }
      }
      double h = measureThickness(definition.fixedThickness, point, highest->normal, backHits);
      if (std::isnan(h)) {
        if (inside) ++report.missedBack;
        if (!definition.fixedThickness.missing_m) continue;
        h = *definition.fixedThickness.missing_m;
      } else if (!std::holds_alternative<RigidBody>(definition.fixedThickness.source) &&
                 clampThickness(definition.fixedThickness, h)) {
        if (inside) ++report.clamped;
      }
      const double area = dx * dz / highest->normal.y();
      if (!inside) {
        outside.push_back({ix, iz, point, highest->normal, area, h});
        continue;
      }
      const int cell = ix * c.nz + iz;
      out.element[static_cast<size_t>(cell)] = static_cast<int>(out.numNodes());
      out.cell.push_back(cell);
      out.p_FA.push_back(point);
      out.normal_F.push_back(highest->normal);
      out.area_m2.push_back(area);
      out.hF_m.push_back(h);
      report.surfaceArea_m2 += out.area_m2.back();
      report.minThickness_m = std::min(report.minThickness_m, h);
      report.maxThickness_m = std::max(report.maxThickness_m, h);
      sumThickness += h;
    }
  }
  report.elements = out.elements = static_cast<int>(out.numNodes());
  if (out.elements == 0) {
    const Vec3 lo = box.min(), hi = box.max();
    if (report.downwardOnly > 0 && report.belowPlane == 0) {
      fail("compartment ", c.name, ": all ", report.downwardOnly, " verticals that meet the fixed surface meet it from "
           "its inner side: its normals are inverted; flip them");
    }
    if (report.belowPlane > 0) {
      fail("compartment ", c.name, ": the fixed surface (y ", lo.y(), " .. ", hi.y(), " m) lies at or below the element plane y = ",
           *definition.planeY_m, " m; lower the plane");
    }
    if (report.missedBack > 0) {
      fail("compartment ", c.name, ": the back surface is missed from all ", report.missedBack,
           " elements; check its frame and normals");
    }
    fail("compartment ", c.name, ": no overlap between the grid, x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
         " m, and the fixed surface, x ", lo.x(), " .. ", hi.x(), " m, z ", lo.z(), " .. ", hi.z(), " m");
  }
  // Nodes of the ring follow; then every element learns its neighbors.
  std::vector<int> node(static_cast<size_t>((c.nx + 2) * (c.nz + 2)), -1);
  const auto nodeAt = [&](int ix, int iz) -> int& { return node[static_cast<size_t>((ix + 1) * (c.nz + 2) + iz + 1)]; };
  for (int e = 0; e < out.elements; ++e) nodeAt(out.cell[static_cast<size_t>(e)] / c.nz, out.cell[static_cast<size_t>(e)] % c.nz) = e;
  for (const Outside& o : outside) {
    nodeAt(o.ix, o.iz) = static_cast<int>(out.numNodes());
    out.p_FA.push_back(o.point);
    out.normal_F.push_back(o.normal);
    out.area_m2.push_back(o.area);
    out.hF_m.push_back(o.h);
  }
  for (int e = 0; e < out.elements; ++e) {
    const int ix = out.cell[static_cast<size_t>(e)] / c.nz, iz = out.cell[static_cast<size_t>(e)] % c.nz;
    out.stencil.push_back({e, nodeAt(ix + 1, iz), nodeAt(ix - 1, iz), nodeAt(ix, iz + 1), nodeAt(ix, iz - 1), nodeAt(ix + 1, iz + 1),
                           nodeAt(ix - 1, iz + 1), nodeAt(ix + 1, iz - 1), nodeAt(ix - 1, iz - 1)});
  }
  Eigen::AlignedBox3d nodes;
  for (const Vec3& p : out.p_FA) nodes.extend(p);
  for (size_t k = 0; k < 8; ++k) {
    out.corner_F[k] = nodes.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k));
  }
  report.meanThickness_m = sumThickness / static_cast<double>(out.elements);
  compartments.push_back(std::move(out));
  gridReports.push_back(report);
}

}  // namespace genu::contact
