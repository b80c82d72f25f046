#include <cmath>
#include <limits>

#include "detail/ContactPairImpl.h"
#include "detail/ElementSurface.h"

namespace genu::contact {

using namespace detail;

void ContactPair::Impl::buildCompartment(const CompartmentDefinition& c) {
  // `definition` is that of the pair as evaluated: what it calls fixed carries the grid.
  const char* body = definition.gridOn == GridOn::fixed ? "fixed" : "moving";
  const char* other = definition.gridOn == GridOn::fixed ? "moving" : "fixed";
  if (!c.fixedSurface) fail("compartment ", c.name, ": the ", body, " surface is missing");
  if (!c.movingSurface) fail("compartment ", c.name, ": the ", other, " surface is missing");
  NodeProjector projector(c, definition.fixedThickness, definition.planeY_m);  // checks the grid's ranges and size
  const ElementRays& rays = projector.rays();
  Compartment out;
  GridReport report;
  out.name = report.name = c.name;
  out.nx = c.nx;
  out.nz = c.nz;
  out.moving = c.movingSurface.get();
  report.cells = c.nx * c.nz;
  out.element.assign(static_cast<size_t>(report.cells), -1);
  out.wraps = rays.wraps();
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
      const bool isRepeated = rays.wraps() && (ix < 0 || ix == c.nx);  // the other side of the seam
      if (isRepeated) continue;
      const double coordinateA = rays.a0() + (ix + 0.5) * rays.da(), coordinateB = rays.b0() + (iz + 0.5) * rays.db();
      const ProjectedNode node = projector.projectNode(coordinateA, coordinateB);
      if (node.status == NodeStatus::underPlane && inside) {
        fail("compartment ", c.name, ": the ", body, " surface lies at y = ", node.point.y(), " m (x = ", node.point.x(), " m, z = ",
             node.point.z(), " m), ", rays.calcDirection(0, 0).y() > 0 ? "not above" : "not below", " the plane y = ",
             std::get<HeightAbovePlane>(definition.fixedThickness.source).planeY_m, " m from which its thickness is measured: the "
             "thickness would be negative; ", rays.calcDirection(0, 0).y() > 0 ? "lower" : "raise", " the plane");
      }
      if (inside) {
        report.missedSurface += node.status == NodeStatus::missedSurface;
        report.belowPlane += node.status == NodeStatus::behindLimit;
        report.downwardOnly += node.status == NodeStatus::wrongSide;
        report.missedBack += node.missedBack;
        report.clamped += node.clamped;
      }
      if (node.status != NodeStatus::ok) continue;
      const Vec3& point = node.point;
      const double h = node.h, area = node.area;
      if (!inside) {
        outside.push_back({ix, iz, point, node.normal, area, h});
        continue;
      }
      const int cell = ix * c.nz + iz;
      out.element[static_cast<size_t>(cell)] = static_cast<int>(out.numNodes());
      out.cell.push_back(cell);
      out.p_FA.push_back(point);
      out.normal_F.push_back(node.normal);
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
    const Eigen::AlignedBox3d box = c.fixedSurface->boundingBox();
    const Vec3 lo = box.min(), hi = box.max();
    if (report.downwardOnly > 0 && report.belowPlane == 0) {
      fail("compartment ", c.name, ": all ", report.downwardOnly, rays.isPlane() ? " verticals" : " rays", " that meet the ", body,
           " surface meet it from its inner side: its normals are inverted; flip them",
           rays.isPlane() ? "" : ", or the element surface faces the wrong way (inward, outward)");
    }
    if (report.belowPlane > 0 && !rays.isPlane()) {
      fail("compartment ", c.name, ": the ", body, " surface lies behind the limiting radius of its element surface, a ",
           toString(c.elementSurface), "; change the radius");
    }
    if (report.belowPlane > 0 && rays.calcDirection(0, 0).y() < 0) {
      fail("compartment ", c.name, ": the ", body, " surface (y ", lo.y(), " .. ", hi.y(), " m) lies at or above the element plane y = ",
           *definition.planeY_m, " m; raise the plane");
    }
    if (report.belowPlane > 0) {
      fail("compartment ", c.name, ": the ", body, " surface (y ", lo.y(), " .. ", hi.y(), " m) lies at or below the element plane y = ",
           *definition.planeY_m, " m; lower the plane");
    }
    if (report.missedBack > 0) {
      fail("compartment ", c.name, ": the back surface is missed from all ", report.missedBack,
           " elements; check its frame and normals");
    }
    if (!rays.isPlane()) {
      fail("compartment ", c.name, ": none of the ", report.cells, " rays of its element surface, a ", toString(c.elementSurface),
           ", meets the ", body, " surface, x ", lo.x(), " .. ", hi.x(), " m, y ", lo.y(), " .. ", hi.y(), " m, z ", lo.z(), " .. ", hi.z(),
           " m; check its centre or axis and its ranges");
    }
    fail("compartment ", c.name, ": no overlap between the grid, x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
         " m, and the ", body, " surface, x ", lo.x(), " .. ", hi.x(), " m, z ", lo.z(), " .. ", hi.z(), " m");
  }
  // Nodes of the ring follow; then every element learns its neighbors.
  std::vector<int> node(static_cast<size_t>((c.nx + 2) * (c.nz + 2)), -1);
  const auto nodeAt = [&](int ix, int iz) -> int& {
    if (out.wraps) ix = (ix + c.nx) % c.nx;
    return node[static_cast<size_t>((ix + 1) * (c.nz + 2) + iz + 1)];
  };
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
  out.cellSize_m = rays.isPlane() ? std::sqrt(rays.da() * rays.db()) : std::sqrt(report.surfaceArea_m2 / out.elements);
  report.meanThickness_m = sumThickness / static_cast<double>(out.elements);
  compartments.push_back(std::move(out));
  gridReports.push_back(report);
}

}  // namespace genu::contact
