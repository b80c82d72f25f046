#include "genu/fit/MeshFile.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <sstream>

#include "VtpReader.h"
#include "genu/io/Files.h"
#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace {

std::string quote(const std::filesystem::path& file) { return "\"" + file.string() + "\""; }

std::string lowerExtension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

/** A binary STL says how many triangles follow; assimp reads a shortened one without a word in some cases. */
void checkBinaryStl(const std::string& content, const std::filesystem::path& file) {
  if (content.size() < 84) {
    if (content.compare(0, 5, "solid") == 0) return;
    throw InputError("mesh " + quote(file) + ": " + std::to_string(content.size()) +
                     " bytes are too few for an STL file (header and count: 84 bytes)");
  }
  std::uint32_t count = 0;
  for (size_t i = 0; i < 4; ++i)
    count |= static_cast<std::uint32_t>(static_cast<unsigned char>(content[80 + i])) << 8 * i;
  const std::uint64_t wanted = 84 + 50 * static_cast<std::uint64_t>(count);
  if (content.size() == wanted) return;
  const bool ascii = content.compare(0, 5, "solid") == 0 && content.find("facet") != std::string::npos;
  if (ascii) {
    if (content.find("endsolid") == std::string::npos) {
      throw InputError("mesh " + quote(file) + ": truncated: no \"endsolid\" at the end of the ASCII STL");
    }
    return;
  }
  if (content.size() < wanted) {
    throw InputError("mesh " + quote(file) + ": truncated: its header announces " + std::to_string(count) +
                     " triangles (" + std::to_string(wanted) + " bytes), the file has " +
                     std::to_string(content.size()) + " bytes");
  }
}

TriangleMesh readWithAssimp(const std::filesystem::path& file, const std::string& extension) {
  const std::string content = io::readFile(file);
  if (extension == ".stl") checkBinaryStl(content, file);
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFileFromMemory(content.data(), content.size(), 0, extension.c_str() + 1);
  if (scene == nullptr) throw InputError("mesh " + quote(file) + ": " + importer.GetErrorString());
  TriangleMesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    const int offset = mesh.numVertices();
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const aiVector3D& p = part.mVertices[i];
      mesh.vertices.emplace_back(p.x, p.y, p.z);
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices < 3) continue;  // lines and points of an OBJ carry no surface
      if (face.mNumIndices != 3) {
        throw InputError("mesh " + quote(file) + ": face " + std::to_string(f + 1) + " has " +
                         std::to_string(face.mNumIndices) + " corners; only triangles are read (triangulate it first)");
      }
      std::array<int, 3> triangle{};
      for (unsigned k = 0; k < 3; ++k) {
        if (face.mIndices[k] >= part.mNumVertices) {
          throw InputError("mesh " + quote(file) + ": face " + std::to_string(f + 1) + " uses vertex " +
                           std::to_string(face.mIndices[k]) + " of " + std::to_string(part.mNumVertices));
        }
        triangle[k] = offset + static_cast<int>(face.mIndices[k]);
      }
      mesh.triangles.push_back(triangle);
    }
  }
  return mesh;
}

LengthUnit decideUnit(const std::filesystem::path& file, double diagonal, std::optional<LengthUnit> said) {
  // A knee surface with all its trimmings is centimetres to decimetres across. The two windows do not overlap.
  const bool fitsM = diagonal >= 5e-3 && diagonal <= 1, fitsMm = diagonal >= 5 && diagonal <= 1000;
  const std::string size = io::formatQuantity(diagonal, "m", 4);
  const std::string sizeMm = io::formatQuantity(diagonal * 1e-3, "mm", 4);
  if (!said) {
    if (fitsM) return LengthUnit::m;
    if (fitsMm) return LengthUnit::mm;
    throw InputError("mesh " + quote(file) + ": its size, " + io::formatNumber(diagonal) +
                     ", is that of a joint surface neither in m nor in mm; say which with --unit m or --unit mm");
  }
  if (*said == LengthUnit::m && (diagonal > 2 || diagonal < 1e-3)) {
    throw InputError("mesh " + quote(file) + ": in the unit said, m, it is " + size + " across; allowed: 1 mm to 2 m" +
                     (fitsMm ? ". It looks like mm: use --unit mm" : ""));
  }
  if (*said == LengthUnit::mm && (diagonal > 2000 || diagonal < 1)) {
    throw InputError("mesh " + quote(file) + ": in the unit said, mm, it is " + sizeMm +
                     " across; allowed: 1 mm to 2 m" + (fitsM ? ". It looks like m: use --unit m" : ""));
  }
  return *said;
}

}  // namespace

const char* toString(LengthUnit unit) { return unit == LengthUnit::m ? "m" : "mm"; }

MeshFile readMeshFile(const std::filesystem::path& file, std::optional<LengthUnit> unit) {
  const std::string extension = lowerExtension(file);
  MeshFile result;
  if (extension == ".stl" || extension == ".obj") {
    result.mesh = readWithAssimp(file, extension);
  } else if (extension == ".vtp") {
    result.mesh = readVtp(io::readFile(file), file);
  } else {
    throw InputError("mesh " + quote(file) + ": extension \"" + extension +
                     "\" is not read; allowed: .stl, .obj, .vtp");
  }
  if (result.mesh.triangles.empty()) throw InputError("mesh " + quote(file) + ": empty: it holds no triangle");
  for (size_t i = 0; i < result.mesh.vertices.size(); ++i) {
    if (!result.mesh.vertices[i].allFinite()) {
      throw InputError("mesh " + quote(file) + ": vertex " + std::to_string(i + 1) +
                       " has a coordinate that is not finite");
    }
  }
  result.info.merge = mergeEqualVertices(result.mesh);
  if (result.mesh.triangles.empty()) throw InputError("mesh " + quote(file) + ": all of its triangles are degenerate");
  const double diagonal = result.mesh.calcBoundingBox().diagonal().norm();
  result.info.unit = decideUnit(file, diagonal, unit);
  result.info.unitGuessed = !unit;
  if (result.info.unit == LengthUnit::mm) {
    for (Vec3& p : result.mesh.vertices) p /= 1000;
  }
  return result;
}

}  // namespace genu::fit
