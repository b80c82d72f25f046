#pragma once

#include <filesystem>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/report/Vtk.h"

namespace genu::report {

enum class Precision { single, full };

/** The elements of a contact pair as quadrilaterals on the fixed surface, in the fixed frame.

 Corners lie at the cell's x and z; their height is the mean of the tangent planes of the elements that share the
 corner, y = y_A - (n_x (x - x_A) + n_z (z - z_A)) / n_y, so neighbours are joined (error of the order of curvature
 times cell size squared / 4, below 5 um for 1 mm cells on a 60 mm radius).

 Cell data: pressure_Pa, penetration_m (corrected, 0 outside contact), distance_m (signed, uncorrected; a lower bound
 for elements that were skipped), thickness_m, area_m2, contact (0 or 1), compartment (index), ix, iz, level; with
 Precision::full also center_m, normal and force_direction. */
VtkMesh makeElementMesh(const contact::ContactPairDefinition& definition,
                        const std::vector<std::vector<contact::ElementField>>& fields, Precision precision);

/** The same values as a table, one line per element with a header line; SI, 17 significant digits. */
void writeElementCsv(const std::filesystem::path& file, const contact::ContactPairDefinition& definition,
                     const std::vector<std::vector<contact::ElementField>>& fields);

/** Triangulated view of surfaces moved by `X_AB`, at least `minSamples` facets along u and v of each patch, whole knot
 spans split evenly. Points carry the outward normal. For viewing only; the contact engine never sees it. */
VtkMesh tessellate(const std::vector<const contact::ContactSurface*>& surfaces, const contact::Pose& X_AB,
                   int minSamples);

}  // namespace genu::report
