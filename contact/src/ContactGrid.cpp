#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <unordered_set>

#include "detail/ContactPairImpl.h"
#include "detail/ElementSurface.h"

namespace genu::contact {

using namespace detail;

namespace {

std::uint64_t keyOf(const GridCell& c) {  // ix and iz from -1 to 10000 * 2^kMaxGridLevel
  return (static_cast<std::uint64_t>(c.level) << 56) | (static_cast<std::uint64_t>(c.ix + 1) << 28) | static_cast<std::uint64_t>(c.iz + 1);
}

/** The refined cells, checked. */
std::unordered_set<std::uint64_t> collectRefined(const CompartmentDefinition& c) {
  std::unordered_set<std::uint64_t> refined;
  for (const GridCell& cell : c.refined) {
    if (cell.level < 0 || cell.level >= kMaxGridLevel || cell.ix < 0 || cell.iz < 0 || cell.ix >= c.nx << cell.level ||
        cell.iz >= c.nz << cell.level) {
      fail("compartment ", c.name, ": refined cell (level ", cell.level, ", ix ", cell.ix, ", iz ", cell.iz,
           ") is not in the grid; allowed: levels 0 to ", kMaxGridLevel - 1, ", ix and iz within ", c.nx, "x", c.nz,
           " cells times 2^level");
    }
    refined.insert(keyOf(cell));
  }
  for (const GridCell& cell : c.refined) {
    if (cell.level > 0 && refined.count(keyOf({cell.level - 1, cell.ix / 2, cell.iz / 2})) == 0) {
      fail("compartment ", c.name, ": refined cell (level ", cell.level, ", ix ", cell.ix, ", iz ", cell.iz,
           ") does not exist, because its parent (level ", cell.level - 1, ", ix ", cell.ix / 2, ", iz ", cell.iz / 2,
           ") is not refined; add the parent to the list");
    }
  }
  return refined;
}

template <class Visit>
void visitLeaves(const std::unordered_set<std::uint64_t>& refined, const GridCell& cell, const Visit& visit) {
  if (refined.empty() || refined.count(keyOf(cell)) == 0) {
    visit(cell);
    return;
  }
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 2; ++k) visitLeaves(refined, GridCell{cell.level + 1, 2 * cell.ix + i, 2 * cell.iz + k}, visit);
  }
}

}  // namespace

std::vector<GridCell> detail::findLeaves(const CompartmentDefinition& c) {
  const auto refined = collectRefined(c);
  std::vector<GridCell> leaves;
  leaves.reserve(static_cast<size_t>(c.nx * c.nz) + 3 * refined.size());
  for (int ix = 0; ix < c.nx; ++ix) {
    for (int iz = 0; iz < c.nz; ++iz) visitLeaves(refined, GridCell{0, ix, iz}, [&](const GridCell& cell) { leaves.push_back(cell); });
  }
  return leaves;
}

void ContactPair::Impl::buildCompartment(const CompartmentDefinition& c, const Compartment* known) {
  // `definition` is that of the pair as evaluated: what it calls fixed carries the grid.
  const char* body = definition.gridOn == GridOn::fixed ? "fixed" : "moving";
  const char* other = definition.gridOn == GridOn::fixed ? "moving" : "fixed";
  if (!c.fixedSurface) fail("compartment ", c.name, ": the ", body, " surface is missing");
  if (!c.movingSurface) fail("compartment ", c.name, ": the ", other, " surface is missing");
  NodeProjector projector(c, definition.fixedThickness, definition.planeY_m);  // checks the grid's ranges and size
  const ElementRays& rays = projector.rays();
  if (!c.refined.empty() && definition.tracking == Tracking::breadthFirstUnguarded) {
    fail("compartment ", c.name, ": has refined cells, and the unguarded breadth-first search cannot follow contact from one level "
         "of cells to another; choose another tracking");
  }
  Compartment out;
  GridReport report;
  out.name = report.name = c.name;
  out.nx = c.nx;
  out.nz = c.nz;
  out.fixed = c.fixedSurface.get();
  out.moving = c.movingSurface.get();
  if (definition.rule == ContactRule::smooth) out.predictor = std::make_unique<DistancePredictor>(*c.movingSurface);
  const std::vector<GridCell> leaves = findLeaves(c);
  report.cells = static_cast<int>(leaves.size());
  out.element.assign(static_cast<size_t>(c.nx * c.nz), -1);
  out.wraps = rays.wraps();
  double sumThickness = 0;
  report.minThickness_m = std::numeric_limits<double>::infinity();

  // Nodes by cell: level 0 in an array (with its ring), finer ones in a map.
  constexpr int kUnknown = -2;  // not looked for yet
  std::vector<int> coarse(static_cast<size_t>((c.nx + 2) * (c.nz + 2)), kUnknown);
  std::unordered_map<std::uint64_t, int> fine;
  const auto nodeAt = [&](GridCell cell) -> int& {
    const int around = c.nx << cell.level;
    if (out.wraps) cell.ix = (cell.ix + around) % around;
    if (cell.level == 0) return coarse[static_cast<size_t>((cell.ix + 1) * (c.nz + 2) + cell.iz + 1)];
    return fine.try_emplace(keyOf(cell), kUnknown).first->second;
  };
  std::unordered_map<std::uint64_t, int> knownAt;
  if (known) {
    for (size_t k = 0; k < known->numNodes(); ++k) knownAt.emplace(keyOf(known->cell[k]), static_cast<int>(k));
  }
  const auto addNode = [&](const GridCell& cell, bool isElement) {
    int& index = nodeAt(cell);
    const double side = std::ldexp(1.0, -cell.level);
    ProjectedNode node;
    ThicknessNote note = ThicknessNote::measured;
    const auto it = knownAt.find(keyOf(cell));
    if (it != knownAt.end()) {
      const auto k = static_cast<size_t>(it->second);
      node.status = NodeStatus::ok;
      node.point = known->p_FA[k];
      node.normal = known->normal_F[k];
      node.area = known->area_m2[k];
      node.h = known->hF_m[k];
      note = known->note[k];
    } else {
      node = projector.projectNode(rays.a0() + (cell.ix + 0.5) * rays.da() * side, rays.b0() + (cell.iz + 0.5) * rays.db() * side);
      node.area *= side * side;
      note = node.missedBack ? ThicknessNote::missed : node.clamped ? ThicknessNote::clamped : ThicknessNote::measured;
    }
    // What goes wrong for an element is counted; a node that only serves its neighbors is left out without a word.
    if (isElement) {
      if (node.status == NodeStatus::underPlane) {
        const bool up = rays.calcDirection(0, 0).y() > 0;
        fail("compartment ", c.name, ": the ", body, " surface lies at y = ", node.point.y(), " m (x = ", node.point.x(), " m, z = ",
             node.point.z(), " m), ", up ? "not above" : "not below", " the plane y = ",
             std::get<HeightAbovePlane>(definition.fixedThickness.source).planeY_m, " m from which its thickness is measured: the "
             "thickness would be negative; ", up ? "lower" : "raise", " the plane");
      }
      report.missedSurface += node.status == NodeStatus::missedSurface;
      report.belowPlane += node.status == NodeStatus::behindLimit;
      report.downwardOnly += node.status == NodeStatus::wrongSide;
      report.missedBack += node.status == NodeStatus::missedBack;
    }
    index = node.status == NodeStatus::ok ? static_cast<int>(out.numNodes()) : -1;
    if (index < 0) return;
    out.cell.push_back(cell);
    out.p_FA.push_back(node.point);
    out.normal_F.push_back(node.normal);
    out.area_m2.push_back(node.area);
    out.hF_m.push_back(node.h);
    out.note.push_back(note);
  };

  for (const GridCell& cell : leaves) {
    const size_t before = out.numNodes();
    addNode(cell, true);
    if (out.numNodes() == before) continue;
    if (cell.level == 0) out.element[static_cast<size_t>(cell.ix * c.nz + cell.iz)] = static_cast<int>(before);
    report.surfaceArea_m2 += out.area_m2.back();
    report.minThickness_m = std::min(report.minThickness_m, out.hF_m.back());
    report.maxThickness_m = std::max(report.maxThickness_m, out.hF_m.back());
    sumThickness += out.hF_m.back();
    report.missedBack += out.note.back() == ThicknessNote::missed;
    report.clamped += out.note.back() == ThicknessNote::clamped;
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
  // Then every element gets the nodes around it, at its own spacing; those that are no elements follow in order of level and place.
  std::vector<GridCell> missing;
  constexpr int kAround[9][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
  for (int e = 0; e < out.elements; ++e) {
    const GridCell& at = out.cell[static_cast<size_t>(e)];
    for (const auto& step : kAround) {
      const GridCell cell{at.level, at.ix + step[0], at.iz + step[1]};
      int& index = nodeAt(cell);
      if (index != kUnknown) continue;
      index = -1;  // asked for
      missing.push_back(cell);
    }
  }
  std::sort(missing.begin(), missing.end(), [](const GridCell& a, const GridCell& b) {
    return a.level != b.level ? a.level < b.level : a.ix != b.ix ? a.ix < b.ix : a.iz < b.iz;
  });
  for (const GridCell& cell : missing) addNode(cell, false);
  for (int e = 0; e < out.elements; ++e) {
    const GridCell at = out.cell[static_cast<size_t>(e)];
    std::array<int, 9> stencil{};
    for (size_t k = 0; k < 9; ++k) stencil[k] = nodeAt({at.level, at.ix + kAround[k][0], at.iz + kAround[k][1]});
    out.stencil.push_back(stencil);
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
