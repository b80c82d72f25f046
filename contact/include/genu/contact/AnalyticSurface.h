#pragma once

#include <limits>
#include <vector>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact {

/** Which side of a surface is material; it sets the direction of the outward normal. A fixed surface is solid below.
 A moving height field (plane, dish, paraboloid) is solid above, a moving closed surface is solid inside. For closed
 surfaces `below` and `inside` are the same. */
enum class Solid { below, above, inside };

/** Exact NURBS forms of simple surfaces, so that closed-form cases run through the same code as a femur. All are
 centred at the body's origin. Lengths in m. Height fields are built over |x|, |z| <= halfExtent_m (the caller knows
 how far the scene reaches); a dish ends where its circles end if that is nearer.
 Each returns one or more patches that together are the surface; patches may overlap (a sphere is two
 stereographic charts, so that it has no pole and no seam).
 @throws std::invalid_argument naming the parameter, its value and what is allowed */

/** y = y0 + sx x + sz z. */
std::vector<NurbsPatch> makePlane(double y0_m, double slopeX, double slopeZ, Solid solid, double halfExtent_m);

/** y = y0 + Rs - sqrt((Rs - Rf + sqrt(Rf^2 - z^2))^2 - x^2): the bottom of a torus about z (Rs outer radius in x-y, Rf
 radius in planes through z); Rs = Rf is spherical, Rf infinite a trough along z, Rs infinite a trough along x. */
std::vector<NurbsPatch> makeDish(double y0_m, double Rs_m, double Rf_m, Solid solid, double halfExtent_m);

/** y = y0 + x^2/(2 Rx) + z^2/(2 Rz); signs allowed (saddles), infinite radii allowed. */
std::vector<NurbsPatch> makeParaboloid(double y0_m, double Rx_m, double Rz_m, Solid solid, double halfExtent_m);

std::vector<NurbsPatch> makeSphere(double R_m);

/** Open tube about z, |z| <= length/2. */
std::vector<NurbsPatch> makeCylinder(double R_m, double length_m);

/** x^2/a^2 + y^2/b^2 + z^2/c^2 = 1. */
std::vector<NurbsPatch> makeEllipsoid(double a_m, double b_m, double c_m);

/** Torus about z: Rs outer radius in the x-y plane, Rf radius of the section in planes through z, 0 < Rf < Rs. */
std::vector<NurbsPatch> makeTorus(double Rs_m, double Rf_m);

}  // namespace genu::contact
