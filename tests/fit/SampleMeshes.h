#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>

#include "genu/fit/Mesh.h"

namespace genu::fit::test {

/** Triangulated rectangle [-a, a] x [-b, b] of (x, z) with n x m cells and y = height(x, z), normals up. */
inline TriangleMesh makeSheet(double a, double b, int n, int m, const std::function<double(double, double)>& height) {
  TriangleMesh mesh;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= m; ++j) {
      const double x = -a + 2 * a * i / n, z = -b + 2 * b * j / m;
      mesh.vertices.emplace_back(x, height(x, z), z);
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      const int p = i * (m + 1) + j, q = p + m + 1;
      mesh.triangles.push_back({p, p + 1, q});
      mesh.triangles.push_back({p + 1, q + 1, q});
    }
  }
  return mesh;
}

/** A folder that goes away with the test. */
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "genu_fit_XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline void writeText(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

inline std::string toObj(const TriangleMesh& mesh, double scale) {
  std::ostringstream out;
  out.precision(9);
  for (const Vec3& p : mesh.vertices)
    out << "v " << p.x() * scale << ' ' << p.y() * scale << ' ' << p.z() * scale << '\n';
  for (const auto& t : mesh.triangles) out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  return out.str();
}

/** Message of the exception of type E that `action` throws, or "" when it throws none. */
template <class E>
std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return {};
}

}  // namespace genu::fit::test
