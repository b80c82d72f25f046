#pragma once

#include <filesystem>
#include <iosfwd>

namespace genu::make_models {

/** Each writes its NURBS files into `folder` and a line per patch to `report`.
 @throws genu::InputError, genu::ComputationError when a file cannot be written */
void makeArtificialKnee(const std::filesystem::path& folder, std::ostream& report);
void makeNaturalKnee(const std::filesystem::path& folder, std::ostream& report);

}  // namespace genu::make_models
