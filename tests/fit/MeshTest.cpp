#include <gtest/gtest.h>

#include <random>

#include "SampleMeshes.h"
#include "genu/fit/Mesh.h"

namespace genu::fit {
namespace {

TEST(Mesh, MergesEqualVerticesAndDropsDegenerateTriangles) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 1}, {-0.0, 0, 1}, {9, 9, 9}};
  mesh.triangles = {{0, 2, 1}, {3, 5, 4}, {1, 3, 0}};
  const MergeCounts counts = mergeEqualVertices(mesh);
  EXPECT_EQ(counts.verticesBefore, 7);
  EXPECT_EQ(counts.verticesAfter, 4);  // -0 equals 0; the unused one is gone
  EXPECT_EQ(counts.degenerateTriangles, 1);
  ASSERT_EQ(mesh.numTriangles(), 2);
  EXPECT_DOUBLE_EQ(mesh.calcArea(), 1);
}

TEST(Mesh, FindsBorderAndComponents) {
  TriangleMesh mesh = test::makeSheet(2, 1, 4, 2, [](double, double) { return 0.0; });
  const TriangleMesh small = test::makeSheet(0.5, 0.5, 1, 1, [](double, double) { return 5.0; });
  const int offset = mesh.numVertices();
  for (const Vec3& p : small.vertices) mesh.vertices.push_back(p);
  for (const auto& t : small.triangles) mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  const MeshTopology topology = analyzeMesh(mesh);
  EXPECT_EQ(topology.components, 2);
  EXPECT_DOUBLE_EQ(topology.componentArea_m2[0], 8);
  EXPECT_DOUBLE_EQ(topology.componentArea_m2[1], 1);
  EXPECT_EQ(topology.borderEdges, 12 + 4);
  EXPECT_EQ(topology.nonManifoldEdges, 0);
  EXPECT_EQ(topology.inconsistentEdges, 0);
  EXPECT_EQ(topology.component.back(), 1);
}

TEST(Mesh, CountsNeighboursWithOppositeNormals) {
  TriangleMesh mesh = test::makeSheet(1, 1, 1, 1, [](double, double) { return 0.0; });
  EXPECT_GT(mesh.calcAreaVector(0).y(), 0);
  std::swap(mesh.triangles[1][0], mesh.triangles[1][1]);
  EXPECT_EQ(analyzeMesh(mesh).inconsistentEdges, 1);
}

// The tree must give the brute-force minimum; both compute the same triangle distance, so equality is to rounding.
TEST(MeshDistance, EqualsBruteForce) {
  const TriangleMesh mesh = test::makeSheet(
      20e-3, 15e-3, 12, 9, [](double x, double z) { return 3e-3 * std::sin(200 * x) * std::cos(150 * z); });
  const MeshDistance tree(mesh);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> at(-25e-3, 25e-3);
  int border = 0;
  for (int k = 0; k < 300; ++k) {
    const Vec3 p(at(random), 0.4 * at(random), at(random));
    const auto found = tree.findClosest(p);
    double least = 1;
    for (int t = 0; t < mesh.numTriangles(); ++t) {
      std::vector<char> one(mesh.triangles.size(), 0);
      one[static_cast<size_t>(t)] = 1;
      const TriangleMesh single = extractTriangles(mesh, one);
      least = std::min(least, MeshDistance(single).findClosest(p).distance_m);
    }
    EXPECT_NEAR(found.distance_m, least, 1e-15);
    EXPECT_NEAR((found.point - p).norm(), found.distance_m, 1e-15);
    border += found.onBorder ? 1 : 0;
  }
  EXPECT_GT(border, 30);   // points beside the sheet
  EXPECT_LT(border, 270);  // points above and below it
}

TEST(MeshDistance, SaysWhenTheFootIsOnTheBorder) {
  const TriangleMesh mesh = test::makeSheet(1, 1, 2, 2, [](double, double) { return 0.0; });
  const MeshDistance tree(mesh);
  EXPECT_FALSE(tree.findClosest({0, 1, 0}).onBorder);       // inner vertex
  EXPECT_FALSE(tree.findClosest({0, 1, 0.5}).onBorder);     // inner edge
  EXPECT_FALSE(tree.findClosest({0.3, -1, 0.2}).onBorder);  // face
  EXPECT_TRUE(tree.findClosest({1.5, 0, 0.2}).onBorder);    // border edge
  EXPECT_TRUE(tree.findClosest({1.5, 0, 1.5}).onBorder);    // corner
}

TEST(Box, MissingBoundsAreOpen) {
  Box box;
  EXPECT_TRUE(box.isOpen());
  box.max[2] = 1;
  EXPECT_FALSE(box.isOpen());
  EXPECT_TRUE(box.contains({1e9, -1e9, 1}));
  EXPECT_FALSE(box.contains({0, 0, 1.001}));
}

}  // namespace
}  // namespace genu::fit
