#pragma once

#include <filesystem>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/report/Vtk.h"

namespace genu::report {

enum class Precision { single, full };

/** The elements of a contact pair as quadrilaterals on the surface that carries the grid, in the fixed frame.

 Corners lie on the rays of the grid's corners, o + t r (a plane: the vertical at x and z; a cylinder or sphere: the radius);
 t is the mean over the tangent planes of the elements that share the corner, t = n.(A - o) / n.r, so neighbours are joined
 (error of the order of curvature times cell size squared / 4, below 5 um for 1 mm cells on a 60 mm radius). Face normals are
 the surface's outward ones. `X_FM` is the pose the fields belong to; it matters only where the moving body carries the grid.

 Cell data: pressure_Pa, penetration_m (corrected, 0 outside contact), distance_m (signed, uncorrected; a lower bound
 for elements that were skipped), thickness_m, area_m2, contact (0 or 1), compartment (index), ix, iz, level; with
 Precision::full also center_m, normal and force_direction. */
VtkMesh makeElementMesh(const contact::ContactPairDefinition& definition,
                        const std::vector<std::vector<contact::ElementField>>& fields, Precision precision,
                        const contact::Pose& X_FM = {});

/** The same values as a table, one line per element with a header line; SI, 17 significant digits. */
void writeElementCsv(const std::filesystem::path& file, const contact::ContactPairDefinition& definition,
                     const std::vector<std::vector<contact::ElementField>>& fields);

/** Triangulated view of surfaces moved by `X_AB`, at least `minSamples` facets along u and v of each patch, whole knot
 spans split evenly. Points carry the outward normal. For viewing only; the contact engine never sees it. */
VtkMesh tessellate(const std::vector<const contact::ContactSurface*>& surfaces, const contact::Pose& X_AB,
                   int minSamples);

}  // namespace genu::report
