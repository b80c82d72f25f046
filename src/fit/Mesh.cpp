#include "genu/fit/Mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <unordered_map>
#include <unsupported/Eigen/BVH>

namespace genu::fit {

namespace {

size_t index(int i) { return static_cast<size_t>(i); }

struct PointHash {
  size_t operator()(const std::array<double, 3>& p) const {
    const std::hash<double> h;
    size_t seed = h(p[0]);
    for (size_t i = 1; i < 3; ++i) seed ^= h(p[i]) + 0x9e3779b97f4a7c15ull + (seed << 6) + (seed >> 2);
    return seed;
  }
};

/** Undirected edge -> the triangles that use it, and how often in each direction. */
struct EdgeUse {
  int forward = 0, backward = 0;
  std::vector<int> triangles;
};

std::uint64_t edgeKey(int a, int b) {
  const auto lo = static_cast<std::uint64_t>(std::min(a, b)), hi = static_cast<std::uint64_t>(std::max(a, b));
  return (hi << 32) | lo;
}

std::unordered_map<std::uint64_t, EdgeUse> collectEdges(const TriangleMesh& mesh) {
  std::unordered_map<std::uint64_t, EdgeUse> edges;
  edges.reserve(mesh.triangles.size() * 2);
  for (int t = 0; t < mesh.numTriangles(); ++t) {
    const auto& triangle = mesh.triangles[index(t)];
    for (size_t k = 0; k < 3; ++k) {
      const int a = triangle[k], b = triangle[(k + 1) % 3];
      EdgeUse& use = edges[edgeKey(a, b)];
      (a < b ? use.forward : use.backward)++;
      use.triangles.push_back(t);
    }
  }
  return edges;
}

int findRoot(std::vector<int>& parent, int i) {
  while (parent[index(i)] != i) {
    parent[index(i)] = parent[index(parent[index(i)])];
    i = parent[index(i)];
  }
  return i;
}

}  // namespace

Vec3 TriangleMesh::calcAreaVector(int triangle) const {
  const auto& t = triangles[index(triangle)];
  const Vec3& a = vertices[index(t[0])];
  return 0.5 * (vertices[index(t[1])] - a).cross(vertices[index(t[2])] - a);
}

double TriangleMesh::calcArea() const {
  double area = 0;
  for (int t = 0; t < numTriangles(); ++t) area += calcAreaVector(t).norm();
  return area;
}

Eigen::AlignedBox3d TriangleMesh::calcBoundingBox() const {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : vertices) box.extend(p);
  return box;
}

bool Box::contains(const Vec3& point) const {
  for (int i = 0; i < 3; ++i) {
    if (min[index(i)] && point[i] < *min[index(i)]) return false;
    if (max[index(i)] && point[i] > *max[index(i)]) return false;
  }
  return true;
}

bool Box::isOpen() const {
  for (size_t i = 0; i < 3; ++i) {
    if (min[i] || max[i]) return false;
  }
  return true;
}

MergeCounts mergeEqualVertices(TriangleMesh& mesh) {
  MergeCounts counts;
  counts.verticesBefore = mesh.numVertices();
  std::unordered_map<std::array<double, 3>, int, PointHash> seen;
  seen.reserve(mesh.vertices.size());
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;
  triangles.reserve(mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    std::array<int, 3> merged{};
    for (size_t k = 0; k < 3; ++k) {
      const Vec3& p = mesh.vertices[index(triangle[k])];
      const std::array<double, 3> key = {p.x() + 0.0, p.y() + 0.0, p.z() + 0.0};  // + 0.0 makes -0 equal 0
      const auto [it, added] = seen.try_emplace(key, static_cast<int>(vertices.size()));
      if (added) vertices.emplace_back(key[0], key[1], key[2]);
      merged[k] = it->second;
    }
    if (merged[0] == merged[1] || merged[1] == merged[2] || merged[2] == merged[0]) {
      ++counts.degenerateTriangles;
    } else {
      triangles.push_back(merged);
    }
  }
  mesh.vertices = std::move(vertices);
  mesh.triangles = std::move(triangles);
  counts.verticesAfter = mesh.numVertices();
  return counts;
}

MeshTopology analyzeMesh(const TriangleMesh& mesh) {
  MeshTopology topology;
  topology.borderVertex.assign(mesh.vertices.size(), 0);
  std::vector<int> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (const auto& [key, use] : collectEdges(mesh)) {
    const size_t a = key & 0xffffffffu, b = key >> 32;
    const int count = use.forward + use.backward;
    if (count == 1) {
      ++topology.borderEdges;
      topology.borderVertex[a] = topology.borderVertex[b] = 1;
    } else if (count > 2) {
      ++topology.nonManifoldEdges;
    } else if (use.forward != use.backward) {
      ++topology.inconsistentEdges;
    }
    for (const int t : use.triangles) parent[index(findRoot(parent, t))] = findRoot(parent, use.triangles.front());
  }
  std::map<int, double> areaOfRoot;
  for (int t = 0; t < mesh.numTriangles(); ++t) areaOfRoot[findRoot(parent, t)] += mesh.calcAreaVector(t).norm();
  std::vector<std::pair<double, int>> order;
  for (const auto& [root, area] : areaOfRoot) order.emplace_back(area, root);
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::map<int, int> rank;
  for (const auto& [area, root] : order) {
    rank[root] = topology.components++;
    topology.componentArea_m2.push_back(area);
  }
  for (int t = 0; t < mesh.numTriangles(); ++t) topology.component.push_back(rank[findRoot(parent, t)]);
  return topology;
}

TriangleMesh extractTriangles(const TriangleMesh& mesh, const std::vector<char>& keep) {
  TriangleMesh part;
  std::vector<int> newIndex(mesh.vertices.size(), -1);
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keep[t]) continue;
    std::array<int, 3> triangle{};
    for (size_t k = 0; k < 3; ++k) {
      int& i = newIndex[index(mesh.triangles[t][k])];
      if (i < 0) {
        i = part.numVertices();
        part.vertices.push_back(mesh.vertices[index(mesh.triangles[t][k])]);
      }
      triangle[k] = i;
    }
    part.triangles.push_back(triangle);
  }
  return part;
}

std::vector<double> calcVertexAreas(const TriangleMesh& mesh) {
  std::vector<double> areas(mesh.vertices.size(), 0);
  for (int t = 0; t < mesh.numTriangles(); ++t) {
    const double third = mesh.calcAreaVector(t).norm() / 3;
    for (const int i : mesh.triangles[index(t)]) areas[index(i)] += third;
  }
  return areas;
}

std::vector<Vec3> calcVertexNormals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (int t = 0; t < mesh.numTriangles(); ++t) {
    const Vec3 area = mesh.calcAreaVector(t);
    for (const int i : mesh.triangles[index(t)]) normals[index(i)] += area;
  }
  for (Vec3& n : normals) n.normalize();
  return normals;
}

double calcMedianEdge(const TriangleMesh& mesh) {
  std::vector<double> lengths;
  for (const auto& t : mesh.triangles) {
    for (size_t k = 0; k < 3; ++k) {
      lengths.push_back((mesh.vertices[index(t[k])] - mesh.vertices[index(t[(k + 1) % 3])]).norm());
    }
  }
  if (lengths.empty()) return 0;
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

namespace {

/** Closest point of a triangle by its Voronoi regions (Ericson, Real-Time Collision Detection, 2005, §5.1.5). */
Vec3 calcClosestBarycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    const double v = d1 / (d1 - d3);
    return {1 - v, v, 0};
  }
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    const double w = d2 / (d2 - d6);
    return {1 - w, 0, w};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const double scale = 1 / (va + vb + vc);
  return {1 - (vb + vc) * scale, vb * scale, vc * scale};
}

}  // namespace

struct MeshDistance::Tree {
  using Bvh = Eigen::KdBVH<double, 3, int>;
  const TriangleMesh& mesh;
  std::unordered_map<std::uint64_t, char> borderEdge;
  std::vector<char> borderVertex;
  Bvh bvh;

  explicit Tree(const TriangleMesh& m) : mesh(m), borderVertex(m.vertices.size(), 0) {
    for (const auto& [key, use] : collectEdges(mesh)) {
      if (use.forward + use.backward != 1) continue;
      borderEdge[key] = 1;
      borderVertex[key & 0xffffffffu] = borderVertex[key >> 32] = 1;
    }
    std::vector<int> triangles(mesh.triangles.size());
    std::iota(triangles.begin(), triangles.end(), 0);
    std::vector<Eigen::AlignedBox3d> boxes(mesh.triangles.size());
    for (size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (const int i : mesh.triangles[t]) boxes[t].extend(mesh.vertices[index(i)]);
    }
    bvh.init(triangles.begin(), triangles.end(), boxes.begin(), boxes.end());
  }

  struct Minimizer {
    using Scalar = double;
    const Tree& tree;
    const Vec3& point;
    double best = std::numeric_limits<double>::infinity();
    Result result;

    double minimumOnVolume(const Eigen::AlignedBox3d& box) const { return box.squaredExteriorDistance(point); }
    double minimumOnObject(int t) {
      const auto& triangle = tree.mesh.triangles[index(t)];
      const Vec3 &a = tree.mesh.vertices[index(triangle[0])], &b = tree.mesh.vertices[index(triangle[1])],
                 &c = tree.mesh.vertices[index(triangle[2])];
      const Vec3 bary = calcClosestBarycentric(point, a, b, c);
      const Vec3 foot = bary.x() * a + bary.y() * b + bary.z() * c;
      const double squared = (foot - point).squaredNorm();
      if (squared < best) {
        best = squared;
        result.point = foot;
        result.barycentric = bary;
        result.triangle = t;
        result.distance_m = std::sqrt(squared);
      }
      return squared;
    }
  };
};

MeshDistance::MeshDistance(const TriangleMesh& mesh) : tree_(std::make_unique<Tree>(mesh)) {}
MeshDistance::~MeshDistance() = default;
MeshDistance::MeshDistance(MeshDistance&&) noexcept = default;
MeshDistance& MeshDistance::operator=(MeshDistance&&) noexcept = default;

MeshDistance::Result MeshDistance::findClosest(const Vec3& point) const {
  Tree::Minimizer minimizer{*tree_, point, std::numeric_limits<double>::infinity(), {}};
  Eigen::BVMinimize(tree_->bvh, minimizer);
  Result result = minimizer.result;
  const auto& t = tree_->mesh.triangles[index(result.triangle)];
  const Vec3& bary = result.barycentric;
  const int zeros = (bary.array() == 0).cast<int>().sum();
  for (int k = 0; k < 3; ++k) {
    if (zeros == 2 && bary[k] == 1) {
      result.onBorder = tree_->borderVertex[index(t[index(k)])] != 0;
    } else if (zeros == 1 && bary[k] == 0) {
      result.onBorder = tree_->borderEdge.count(edgeKey(t[index((k + 1) % 3)], t[index((k + 2) % 3)])) > 0;
    }
  }
  return result;
}

}  // namespace genu::fit
