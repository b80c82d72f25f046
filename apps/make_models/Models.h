#pragma once

#include <filesystem>
#include <iosfwd>

namespace genu::make_models {

/** Each writes its NURBS files into `folder` and a line per patch to `report`.
 @throws genu::InputError, genu::ComputationError when a file cannot be written */
void makeArtificialKnee(const std::filesystem::path& folder, std::ostream& report);
void makeNaturalKnee(const std::filesystem::path& folder, std::ostream& report);
void makePatellofemoralJoint(const std::filesystem::path& folder, std::ostream& report);

/** Each writes scenes, tables and URDF files into `folder`. @throws genu::InputError when a file cannot be written */
void makeKneeWithLigaments(const std::filesystem::path& folder);
void makeMusculoskeletalKnee(const std::filesystem::path& folder);

}  // namespace genu::make_models
