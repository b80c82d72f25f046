#pragma once

#include <filesystem>
#include <string>

#include "genu/fit/Mesh.h"

namespace genu::fit {

/** The triangles of a VTK XML PolyData file given as text; unit as in the file. See readMeshFile. */
TriangleMesh readVtp(const std::string& content, const std::filesystem::path& file);

}  // namespace genu::fit
