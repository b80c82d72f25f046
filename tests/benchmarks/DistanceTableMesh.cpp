// Simbody's triangle mesh in the distance table. Compiled with -UNDEBUG: Simbody's headers change class layout with it.

#include <cmath>

#include "DistanceTable.h"
#include "SimTKmath.h"

namespace distance_table {

Row measureMesh(const std::vector<double>& vertices, const std::vector<int>& faces, const std::vector<Query>& queries,
                bool quick) {
  SimTK::Array_<SimTK::Vec3> points;
  for (size_t i = 0; i + 2 < vertices.size(); i += 3)
    points.push_back(SimTK::Vec3(vertices[i], vertices[i + 1], vertices[i + 2]));
  SimTK::Array_<int> indices(faces.begin(), faces.end());
  const SimTK::ContactGeometry::TriangleMesh mesh(points, indices, false);
  Row row;
  row.method = "Simbody TriangleMesh, " + std::to_string(mesh.getNumFaces()) + " faces";
  const auto find = [&](const Query& q) {
    bool inside = false;
    int face = 0;
    SimTK::Vec2 uv;
    const SimTK::Vec3 Q(q.Q[0], q.Q[1], q.Q[2]);
    return (mesh.findNearestPoint(Q, inside, face, uv) - Q).norm();
  };
  double sum = 0;
  measure(quick ? 2 : 20, static_cast<int>(queries.size()), row, [&] {
    for (const Query& q : queries) sum += find(q);
  });
  row.failed = std::isfinite(sum) ? 0 : static_cast<int>(queries.size());
  for (const Query& q : queries) {
    if (q.checked) row.error_m = std::max(row.error_m, std::abs(find(q) - q.distance));
  }
  return row;
}

}  // namespace distance_table
