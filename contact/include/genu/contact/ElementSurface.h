#pragma once

#include <optional>
#include <variant>

#include "genu/contact/Types.h"

namespace genu::contact {

struct CompartmentDefinition;

// The surface on which a compartment's grid is laid out before it is projected onto the contact surface, in the frame of the
// body that carries the grid. A grid has two coordinates (a, b); its nodes are cell centres, projected along rays.

enum class PlaneFacing {
  up,    ///< projected along +y onto the highest crossing with n_y > 0: a tibia, a flat insert
  down,  ///< projected along -y onto the lowest crossing with n_y < 0: a femoral condyle
};
/** Plane: a = x, b = z [m], the rectangle x0_m .. z1_m of the compartment; element area dx dz / |n_y|. */
struct ElementPlane {
  PlaneFacing facing = PlaneFacing::up;
};

enum class RoundFacing {
  outward,  ///< convex (a head, a condyle): the farthest crossing with n.e_r > 0
  inward,   ///< concave (a hip or ankle socket): the nearest crossing with n.e_r < 0
};
/** Cylinder: rays leave the axis at right angles. a: angle about the axis [rad], right-handed, 0 along `zero`; b: distance along
 the axis from `point_m` [m]. Element area rho da db / |n.e_r|, rho the distance of the crossing from the axis. A range of
 exactly 2 pi with at least 3 cells closes on itself. */
struct ElementCylinder {
  Vec3 point_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();  ///< any length > 0
  /** Direction of angle 0; its part along the axis is removed. Absent: -y, or +x for an axis along y. */
  std::optional<Vec3> zero;
  RoundFacing facing = RoundFacing::outward;
  double angle0_rad = 0, angle1_rad = 0, axial0_m = 0, axial1_m = 0;
  /** Only crossings on the open side of this radius are used, as those above an element plane: inward rho < radius, outward
   rho > radius. Absent: all. */
  std::optional<double> radius_m;
};
/** Sphere: rays leave the centre along cos b (cos a d + sin a (k x d)) + sin b k, with k the unit axis and d the unit direction
 of `zero` at right angles to it. a: angle about the axis [rad], b: elevation towards the axis [rad], |b| < pi/2. With the
 default axis z and zero -y that is (sin a cos b, -cos a cos b, sin b): (0, 0) is the lowest point. The axis is a pole of the
 grid: keep it away from the contact. Element area rho^2 cos b da db / |n.e_r|. Closes on itself as the cylinder does. */
struct ElementSphere {
  Vec3 center_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();
  std::optional<Vec3> zero;
  RoundFacing facing = RoundFacing::outward;
  double angle0_rad = 0, angle1_rad = 0, elevation0_rad = 0, elevation1_rad = 0;
  std::optional<double> radius_m;
};

using ElementSurface = std::variant<ElementPlane, ElementCylinder, ElementSphere>;

const char* toString(const ElementSurface& surface);  ///< "plane", "cylinder" or "sphere"

/** The grid of one compartment: ranges of (a, b), and the ray of each place. */
class ElementRays {
 public:
  /** @throws std::invalid_argument naming the compartment, the value and what is allowed: empty or too long ranges, an axis
   without direction, a zero direction along the axis, a number of cells outside 1 .. 10000
   each way or above kMaxGridCells */
  explicit ElementRays(const CompartmentDefinition& compartment);

  bool isPlane() const { return kind_ == Kind::plane; }
  bool isSphere() const { return kind_ == Kind::sphere; }
  double a0() const { return a0_; }
  double b0() const { return b0_; }
  double da() const { return da_; }  ///< of one cell [m] or [rad]
  double db() const { return db_; }
  bool wraps() const { return wraps_; }  ///< the last cell in a is the first one's neighbor

  /** Where the ray of (a, b) starts: on the axis or at the centre, or at height 0 for a plane. */
  Vec3 calcOrigin(double a, double b) const;
  /** Unit vector; outward from the axis or centre, or +-y: the way a plane faces. */
  Vec3 calcDirection(double a, double b) const;
  /** Whether the solid's outward normal is to point along the ray (1) or against it (-1). */
  double facing() const { return facing_; }
  /** Surface area of a cell whose centre (a, b) is at `point` with unit normal `normal`. */
  double calcArea(double a, double b, const Vec3& point, const Vec3& normal) const;

 private:
  enum class Kind { plane, cylinder, sphere };
  Kind kind_ = Kind::plane;
  double a0_ = 0, b0_ = 0, da_ = 0, db_ = 0, facing_ = 1;
  bool wraps_ = false;
  Vec3 origin_ = Vec3::Zero();
  Vec3 zero_ = Vec3::Zero(), side_ = Vec3::Zero(), axis_ = Vec3::Zero();  // d, k x d, k
};

class ContactSurface;

/** The surface with its angle and axial or elevation ranges set to the smallest ones that contain the part of `surface` that
 faces the stated way (a plane is returned as it is: findRectangle).
 @throws std::invalid_argument when no part of it does */
ElementSurface findExtent(const ContactSurface& surface, ElementSurface elements);

}  // namespace genu::contact
