#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "genu/contact/NurbsPatch.h"
#include "genu/scene/Errors.h"

namespace genu::io {

/** A patch of a NURBS file; points in m. */
struct NamedPatch {
  std::string name;
  contact::NurbsPatchData data;
};

/** Reads the JSON text format for NURBS surfaces (docs/file_formats.md). Every patch is validated.
 @throws InputError with file and JSON pointer ("/patches/0/knots_u/7"), or line and column of a syntax error */
std::vector<NamedPatch> readNurbsFile(const std::filesystem::path& path);

/** The same from text in memory; `path` is the name in messages. */
std::vector<NamedPatch> parseNurbs(const std::string& text, const std::filesystem::path& path);

/** Writes mm with shortest round-trip numbers, one row of control points per line; atomic (temporary file and rename).
 Reading it back gives the points to 1 ulp (mm to m is one rounded division).
 @throws ComputationError when it cannot be written; std::invalid_argument when a patch is not valid */
void writeNurbsFile(const std::filesystem::path& path, const std::vector<NamedPatch>& patches,
                    const std::string& comment = {});

}  // namespace genu::io
