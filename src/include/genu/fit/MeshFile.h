#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "genu/fit/Mesh.h"

namespace genu::fit {

enum class LengthUnit { m, mm };
const char* toString(LengthUnit unit);

struct MeshFileInfo {
  LengthUnit unit = LengthUnit::m;
  bool unitGuessed = false;
  MergeCounts merge;
};
struct MeshFile {
  TriangleMesh mesh;  ///< [m], equal vertices merged
  MeshFileInfo info;
};

/** Reads a triangle mesh.
   .stl, .obj  through assimp (all objects of the file together; single precision)
   .vtp        VTK XML PolyData: ascii, inline binary (base64), appended (raw or base64), uncompressed or zlib;
               polygons of three corners, no strips
 Unit: as said, else guessed from the diagonal of the bounding box: 5 mm to 1 m whichever way gives that.
 @throws InputError naming the file: missing, unreadable, truncated, empty, a face that is no triangle, a coordinate
   that is not finite, an index out of range, or a size no joint has in the unit said (1 mm to 2 m) */
MeshFile readMeshFile(const std::filesystem::path& file, std::optional<LengthUnit> unit = {});

}  // namespace genu::fit
