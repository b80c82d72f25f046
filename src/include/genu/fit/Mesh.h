#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "genu/contact/Types.h"

namespace genu::fit {

using contact::Vec2;
using contact::Vec3;

/** Triangles over shared vertices, lengths in m. The outward normal of (a, b, c) is (b - a) x (c - a). */
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;

  int numVertices() const { return static_cast<int>(vertices.size()); }
  int numTriangles() const { return static_cast<int>(triangles.size()); }
  Vec3 calcAreaVector(int triangle) const;  ///< outward, its length is the area [m^2]
  double calcArea() const;
  Eigen::AlignedBox3d calcBoundingBox() const;
};

/** Axis-aligned region; a missing bound is open. [m] */
struct Box {
  std::array<std::optional<double>, 3> min, max;
  bool contains(const Vec3& point) const;
  bool isOpen() const;
};

struct MergeCounts {
  int verticesBefore = 0, verticesAfter = 0;
  int degenerateTriangles = 0;  ///< dropped: two corners in one place
};
/** Vertices at exactly the same place become one (STL stores each once per triangle); unused ones go. */
MergeCounts mergeEqualVertices(TriangleMesh& mesh);

/** What the edges say. Each undirected edge should be used by two triangles in opposite directions. */
struct MeshTopology {
  int borderEdges = 0;         ///< used once
  int nonManifoldEdges = 0;    ///< used more than twice
  int inconsistentEdges = 0;   ///< used twice in the same direction: neighbours with opposite normals
  int components = 0;          ///< pieces connected through edges
  std::vector<int> component;  ///< per triangle; 0 is the largest by area
  std::vector<double> componentArea_m2;
  std::vector<char> borderVertex;  ///< per vertex
};
MeshTopology analyzeMesh(const TriangleMesh& mesh);

/** The triangles whose flag is set, with only the vertices they use. */
TriangleMesh extractTriangles(const TriangleMesh& mesh, const std::vector<char>& keep);

std::vector<double> calcVertexAreas(const TriangleMesh& mesh);  ///< a third of each adjacent triangle [m^2]
std::vector<Vec3> calcVertexNormals(const TriangleMesh& mesh);  ///< unit, area weighted
double calcMedianEdge(const TriangleMesh& mesh);                ///< [m]

/** Closest point of a triangle mesh. */
class MeshDistance {
 public:
  struct Result {
    Vec3 point = Vec3::Zero();
    Vec3 barycentric = Vec3::Zero();
    int triangle = -1;
    double distance_m = 0;  ///< >= 0
    bool onBorder = false;  ///< the closest point lies on the open border of the mesh
  };
  /** @pre the mesh outlives this and has a triangle */
  explicit MeshDistance(const TriangleMesh& mesh);
  ~MeshDistance();
  MeshDistance(MeshDistance&&) noexcept;
  MeshDistance& operator=(MeshDistance&&) noexcept;
  Result findClosest(const Vec3& point) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace genu::fit
