#pragma once

#include <filesystem>
#include <string>

#include "genu/scene/Errors.h"

namespace genu::io {

/** Whole content. @throws InputError `where` (if given), the path and the reason: not found, a folder, not readable */
std::string readFile(const std::filesystem::path& path, const std::string& where = {});

/** Writes beside the target and renames: a reader sees the old or the new file, never half of one. Creates missing
 folders. @throws ComputationError with the path and the reason */
void writeFileAtomically(const std::filesystem::path& path, const std::string& content);

/** SHA-256 in lower-case hexadecimal, as `sha256sum` prints it. */
std::string calcSha256(const std::string& content);

}  // namespace genu::io
