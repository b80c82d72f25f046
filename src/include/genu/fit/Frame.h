#pragma once

#include <optional>
#include <string>

#include "genu/fit/Mesh.h"

namespace genu::fit {

using contact::Pose;

/** Anatomical frames of the method [BF2004 §2.1]: +y superior, +z medial, x = y cross z, which is posterior for a right
 knee and anterior for a left knee. Every function returns X_PM, the pose of the mesh's frame M in that frame P:
 p_P = X_PM.apply(p_M). */

/** How the axes of the file are named. Both are y superior. */
enum class FileAxes {
  paper,    ///< z medial: nothing to do
  lateral,  ///< z lateral (right knee: x anterior): half a turn about y
};
Pose calcAxesPose(FileAxes axes);

/** Artificial knee: x and z of the origin at the centre of the bounding box, y at its bottom (insert), or at
 referenceY_m, a height in the mesh's frame (bone-box reference of a femoral component). */
Pose calcBoundingBoxFrame(const TriangleMesh& mesh, FileAxes axes, std::optional<double> referenceY_m);

/** Points in the mesh's frame [m]. */
struct Landmarks {
  std::optional<Vec3> medial, lateral;      ///< needed: z runs from lateral to medial
  std::optional<Vec3> anterior, posterior;  ///< either this pair ...
  std::optional<Vec3> superior, inferior;   ///< ... or this one gives the second direction
  std::optional<Vec3> center;               ///< origin; absent: midway between medial and lateral
};
enum class KneeSide { right, left };

/** Natural knee. z from the lateral to the medial point; the second direction is made normal to it; x = y cross z.
 @throws InputError naming the missing landmark, or points that coincide or lie on one line */
Pose calcLandmarkFrame(const Landmarks& landmarks, KneeSide side);

/** "rx, ry, rz, x, y, z" with units (rad, m), 17 digits: can be given back as `--transform`. */
std::string formatPose(const Pose& pose);

}  // namespace genu::fit
