#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace genu::report {

/** Polygon meshes in VTK's XML PolyData format (.vtp, version 1.0, little endian, appended base64 data: valid XML) and
 ParaView's collection of files over time (.pvd). SI: points in m; array names end in their unit. */

struct VtkArray {
  std::string name;
  int components = 1;
  std::variant<std::vector<double>, std::vector<float>, std::vector<std::int32_t>, std::vector<std::uint8_t>> values;
};

struct VtkMesh {
  std::vector<double> points;              ///< x, y, z of each point [m]
  int cornersPerCell = 4;                  ///< 3 or 4
  std::vector<std::int32_t> connectivity;  ///< cornersPerCell point indices per cell
  /** Not empty: cells are polylines through points in their order, the first ends before lineEnds[0], the next before lineEnds[1], ... */
  std::vector<std::int32_t> lineEnds;
  std::vector<VtkArray> pointData, cellData, fieldData;

  size_t numPoints() const { return points.size() / 3; }
  size_t numCells() const { return lineEnds.empty() ? connectivity.size() / static_cast<size_t>(cornersPerCell) : lineEnds.size(); }
};

/** Written to a temporary name and renamed. @throws InputError when the file cannot be written;
 std::invalid_argument when an array's length does not fit the mesh */
void writeVtp(const std::filesystem::path& file, const VtkMesh& mesh);

/** `frames`: time [s] and file name relative to the .pvd; files of one time are its parts. */
void writePvd(const std::filesystem::path& file, const std::vector<std::pair<double, std::string>>& frames);

}  // namespace genu::report
