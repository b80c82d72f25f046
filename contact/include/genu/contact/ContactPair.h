#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "genu/contact/ContactSurface.h"
#include "genu/contact/ElementSurface.h"
#include "genu/contact/PressureLaw.h"
#include "genu/contact/TaskRunner.h"
#include "genu/contact/Types.h"

namespace genu::contact {

// ---------------------------------------------------------------------------------------------------------------
// Definition: what a user gives.
// ---------------------------------------------------------------------------------------------------------------

/** Thickness of the elastic layer on one body, measured once before time starts [BF2004 §2.2]. */
struct RigidBody {};                                ///< no layer
struct ConstantThickness { double h_m = 0; };       ///< > 0
/** |y - planeY| of the contact surface, y along the body's own y axis (the insert's bottom: 0). */
struct HeightAbovePlane { double planeY_m = 0; };
enum class BackDirection {
  closest,  ///< distance to the nearest point of the back surface
  normal,   ///< distance along the inward contact-surface normal; where the line misses, the element has no thickness
};
struct BackSurface {
  std::shared_ptr<const ContactSurface> surface;  ///< in the body's frame
  BackDirection direction = BackDirection::normal;
};
/** Distance to a round back: a sphere about `center_m`, or a cylinder about `axis` through it. The back lies behind the contact
 surface, seen against its outward normal; where it does not, the element has no thickness. */
struct RadialThickness {
  double radius_m = 0;  ///< > 0
  Vec3 center_m = Vec3::Zero();
  std::optional<Vec3> axis;  ///< of a cylinder; absent: sphere
};
struct Thickness {
  std::variant<RigidBody, ConstantThickness, HeightAbovePlane, BackSurface, RadialThickness> source = RigidBody{};
  std::optional<double> min_m, max_m;  ///< clamps, applied last; a missed line stays missed unless missing_m is set
  std::optional<double> missing_m;     ///< thickness used where the back surface is missed
  int mapSamplesU = 65, mapSamplesV = 65;  ///< (u, v) map of a moving body, per patch; 2 to 4096
};

/** A cell of a grid that is refined locally: level 0 are the nx by nz cells of the rectangle, each level halves the sides.
 Cell (level, ix, iz) covers x0 + [ix, ix + 1] (x1 - x0) / (nx 2^level), the same in z; likewise in the coordinates of round element
 surfaces. */
struct GridCell {
  int level = 0, ix = 0, iz = 0;
  bool operator==(const GridCell& o) const { return level == o.level && ix == o.ix && iz == o.iz; }
};
constexpr int kMaxGridLevel = 12;
constexpr int kMaxGridCells = 16000000;  ///< nx * nz of one compartment, about 1 kB each

/** One grid of nx by nz elements on an element surface of the body that carries the grid (ContactPairDefinition::gridOn), in
 that body's frame, projected onto its contact surface. */
struct CompartmentDefinition {
  std::string name;
  double x0_m = 0, x1_m = 0, z0_m = 0, z1_m = 0;  ///< of a plane; round element surfaces carry their own ranges
  int nx = 30, nz = 30;                           ///< elements along x and z, or along the angle and the other coordinate
  /** Cells that are split in four, in any order; one of level L > 0 needs its parent (L - 1, ix / 2, iz / 2) in the list, and
   L < kMaxGridLevel. Empty: the plain grid. Every element is integrated over a stencil of its own level, so that levels may
   differ by any number between neighbors; Tracking::breadthFirstUnguarded cannot cross from one level to another and is
   refused. */
  std::vector<GridCell> refined;
  std::shared_ptr<const ContactSurface> fixedSurface;   ///< in F
  std::shared_ptr<const ContactSurface> movingSurface;  ///< in M
  ElementSurface elementSurface = ElementPlane{};
};

/** Which body's contact surface is divided into elements; distances are measured from there to the other body's surface. The
 answer depends on the choice in the order of theta^2 (docs/theory.md, "Which body carries the grid"). */
enum class GridOn { fixed, moving };

/** Distance of an element from the moving surface [BF2004 §2.2, Fig. 3]. The paper prefers the minimum distance. */
enum class DistanceMethod {
  minimum,  ///< AB to the closest point B; u = -normal at B
  ray,      ///< AC along the element's normal n to the first hit C; u = -normal at C
};
/** How an element's share of the load is found (docs/theory.md, "Smooth rim"). */
enum class ContactRule {
  smooth,  ///< the pressure is integrated over the part of each cell where the surfaces overlap: net load C1 in the pose
  centre,  ///< whole cells, in contact or not by their centre [BF2004 §2.3]: the load jumps as cells switch
};
enum class Correction {
  midsurface,  ///< d = AB / cos(theta/2) or AC cos(theta) / cos(theta/2), force along the bisector [BF2004 Fig. 3]
  none,        ///< d = AB, force along AB: conservative; ray: d = AC, force along n
  energy,      ///< d as midsurface; the load is minus the exact gradient of the elements' energies: conservative. Smooth rule only
};
enum class Tracking {
  all,                   ///< every element, every time
  lipschitz,             ///< skip elements whose last signed distance exceeds their motion since: exact
  breadthFirst,          ///< search from the previous active set, then the Lipschitz check on what it did not reach: exact
  breadthFirstUnguarded  ///< the paper's search alone: can miss a new, separate contact region
};

struct ContactPairDefinition {
  std::vector<CompartmentDefinition> compartments;
  GridOn gridOn = GridOn::fixed;
  /** Height of plane element surfaces in the frame of the body that carries the grid [m]; crossings at or below it (facing down:
   at or above it) are not used. Absent: the highest (lowest) crossing wherever it is. */
  std::optional<double> planeY_m;
  Thickness fixedThickness, movingThickness;
  Material material;
  std::optional<Material> movingMaterial;  ///< when it differs: layers in series
  StrainMeasure strain = StrainMeasure::small;
  DistanceMethod distance = DistanceMethod::minimum;
  Correction correction = Correction::midsurface;
  ContactRule rule = ContactRule::smooth;
  Tracking tracking = Tracking::lipschitz;
  /** Damping of the Hunt-Crossley type [s/m]: p max(0, 1 + damping * approach), approach = -m . (velocity of M's point at A relative to
   F), never tensile. It takes the power p damping approach^2 (p |approach| where it is cut off), never gives any. 0: none. */
  double damping_sPerM = 0;
  /** A stored result is copied when no coordinate changed by more than this (rad and m); 0: only the same pose.
   Negative: never copy. */
  double copyTolerance = 0;
};

// ---------------------------------------------------------------------------------------------------------------
// Results.
// ---------------------------------------------------------------------------------------------------------------

/** Worst event of an evaluation; a run decides what it tolerates. */
enum class EvaluationStatus : std::uint8_t {
  ok,
  extrapolated,     ///< some element is beyond d/h = 0.95
  fullPenetration,  ///< some element has d >= h, or its closest surface faces away: the result has no meaning
  notConverged,     ///< some closest-point query failed, or the grid does not resolve the surfaces: the result has no meaning
};
const char* toString(EvaluationStatus status);

/** Net load of a set of elements. Forces are in F. The load on the fixed body is the opposite. */
struct NetLoad {
  Vec3 forceOnM_F = Vec3::Zero();       ///< [N]
  Vec3 momentOnM_Fo_F = Vec3::Zero();   ///< about Fo [N m]
  double scalarForce_N = 0;             ///< sum of p dA
  double peakPressure_Pa = 0;           ///< largest point value met (smooth rule: at the centres and one place between them)
  Vec3 peakPoint_F = Vec3::Zero();      ///< where [m]
  double meanPressure_Pa = 0;           ///< sum(p dA) / sum(dA) over active elements
  double area_m2 = 0;
  Vec3 centerOfPressure_F = Vec3::Zero();  ///< sum(p dA A) / sum(p dA); zero without contact
  double energy_J = 0;                  ///< elastic energy; only with withEnergy
  double maxStrain = 0;                 ///< largest d/h
  int activeElements = 0;               ///< cells with any part in contact
  int extrapolatedElements = 0;
  int fullPenetrationElements = 0;
  int notConvergedQueries = 0;   ///< closest points and rays
  /** Compartments whose pressures sum up to less than nothing (smooth rule): the grid is too coarse for walls or folds in contact. */
  int unresolvedCompartments = 0;
  int noThicknessElements = 0;  ///< would touch, but the moving body's layer is unknown there: left out
  /** Behind the moving surface but with the foot on its border, or the ray through its open side: not in contact. */
  int boundaryElements = 0;

  Vec3 forceOnF_F() const { return -forceOnM_F; }
  Vec3 momentOnF_Fo_F() const { return -momentOnM_Fo_F; }
};

struct ContactResult {
  EvaluationStatus status = EvaluationStatus::ok;
  std::vector<NetLoad> compartments;  ///< in the order of the definition
  NetLoad total;
  /** d(forceOnM_F, momentOnM_Fo_F)/dq of the total, only with withStiffness: the exact derivative of the smooth rule. Rows:
   force [N], moment [N m]; columns: the six coordinates [rad, m]. Not symmetric in general (moment about a fixed point,
   bisecting force direction). */
  Matrix6 stiffness = Matrix6::Zero();
  /** d(forceOnM_F, momentOnM_Fo_F)/d(qdot), only with withStiffness and damping. */
  Matrix6 damping = Matrix6::Zero();
  int distanceQueries = 0;  ///< work done by this evaluation: points whose distance was asked, one more a compartment at the peak (smooth rule)
  bool copied = false;      ///< taken from the stored result
};

/** One element, for output. */
struct ElementField {
  int ix = 0, iz = 0;  ///< of the element's level
  int level = 0;       ///< see GridCell
  Vec3 p_FA = Vec3::Zero(), normal_F = Vec3::Zero();
  double area_m2 = 0;     ///< of the whole element
  double contactShare = 0;  ///< of that area, 0 .. 1
  double force_N = 0;     ///< int p dA over the element
  double distance_m = 0;  ///< signed, uncorrected: AB, or AC where a ray was fired; lower bound when the element was skipped
  double d_m = 0;         ///< penetration after correction, 0 when inactive
  double h_m = 0;         ///< summed thickness
  double p_Pa = 0;        ///< at the element's centre; 0 where only a corner touches
  Vec3 forceDirection_F = Vec3::Zero();
  bool active = false;
  /** Smooth rule: the polynomial of this element and of one beside it disagree on their common side by more than a tenth of the largest
   strain. Something lies between the grid points, the edge of a surface or a fold, and force and area of the element are wrong. */
  bool unresolved = false;
  bool footOnBorder = false;  ///< the last foot was on the moving surface's border: no contact whatever the distance
};

/** What the grid construction found, per compartment. */
struct GridReport {
  std::string name;
  int cells = 0;               ///< nx * nz, plus three for every refined cell
  int elements = 0;            ///< cells that became elements
  int missedSurface = 0;       ///< the cell's ray (a plane's vertical) misses the surface that carries the grid
  int belowPlane = 0;          ///< it meets it only at or behind the element plane or the limiting radius
  int downwardOnly = 0;        ///< it meets only sheets that face the other way: inverted normals?
  int missedBack = 0;          ///< no back surface along the normal
  int clamped = 0;             ///< thickness clamped
  double minThickness_m = 0, maxThickness_m = 0, meanThickness_m = 0;  ///< layer of the body that carries the grid
  double surfaceArea_m2 = 0;
};
struct ThicknessMapReport {
  int samples = 0, missed = 0, clamped = 0;
  double min_m = 0, max_m = 0, mean_m = 0;
};

// ---------------------------------------------------------------------------------------------------------------
// Engine.
// ---------------------------------------------------------------------------------------------------------------

class ContactPair;

/** Mutable memory of one user of a ContactPair (one per thread or Simbody State owner): warm-start feet, last
 distances, stored result. It changes what is computed, never the answer (beyond the query tolerance). */
class ContactWorkspace {
 public:
  explicit ContactWorkspace(const ContactPair& pair);
  ~ContactWorkspace();
  ContactWorkspace(ContactWorkspace&&) noexcept;
  ContactWorkspace& operator=(ContactWorkspace&&) noexcept;
  /** Forgets everything: the next evaluation is cold. */
  void reset();
  /** Threads for evaluations with this workspace, smooth rule; nullptr: none but the caller's. It must outlive the workspace's
   use. Small evaluations stay serial whatever it is; results are bitwise the same. */
  void setTaskRunner(const TaskRunner* runner);

 private:
  friend class ContactPair;
  friend class ErrorEstimator;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/** The contact of one moving surface set with one fixed surface set: immutable after construction, thread-safe with
 one workspace per thread. evaluate() allocates nothing. Equations: docs/theory.md.
   raw distance AB: closest point B on M's surface from the element centre A on F's surface
   theta: angle between F's outward normal n at A and u, the direction of AB turned into M (u = -outward normal of M)
   d = AB / cos(theta/2), m = (n + u)/|n + u|, force on M: p(d, h) dA m at A, dA = dx dz / n_y
   by ray: C where the line through A along n enters M (DistanceMethod::ray), d = AC cos(theta) / cos(theta/2)
 The net load is the integral of p m over the overlap by the definition's rule: smooth (default) or centre.
 Infinitely thin, frictionless, valid while the moving surface faces the element (cos theta > 0). */
class ContactPair {
 public:
  /** Builds grids and thickness maps.
   @throws std::invalid_argument naming the compartment or quantity, its value and what is allowed: empty rectangle, no
   element at all, inverted normals (only downward crossings), no thickness, negative height above the plane, bad
   material, options that exclude each other */
  explicit ContactPair(ContactPairDefinition definition);
  ~ContactPair();
  ContactPair(ContactPair&&) noexcept;
  ContactPair& operator=(ContactPair&&) noexcept;
  /** The same pair on another refinement of its grids (CompartmentDefinition::refined of each compartment): nodes that both have
   and the thickness maps are taken over, not found anew.
   @throws std::invalid_argument as the constructor */
  ContactPair withRefinedCells(std::vector<std::vector<GridCell>> refined) const;

  const ContactPairDefinition& definition() const;
  int numCompartments() const;
  int numElements() const;
  const std::vector<GridReport>& gridReports() const;
  const std::vector<ThicknessMapReport>& thicknessMapReports() const;  ///< one per moving surface that has a map

  struct Options {
    bool withEnergy = false;
    bool withStiffness = false;  ///< smooth rule only
    /** Copies identical poses only, whatever copyTolerance: where differences between close poses matter. */
    bool copyOnlySamePose = false;
  };
  /** Net loads at pose q. `result` is filled in place (its vectors keep their memory).
   A coordinate or rate that is not finite gives no load and the status notConverged; so does a load beyond the range of
   numbers, which is returned as it is. What other extremes do: docs/robustness.md.
   @throws std::invalid_argument when stiffness is asked of the centre rule (it has none: its load jumps) */
  void evaluate(const JointCoordinates& q, ContactWorkspace& workspace, const Options& options,
                ContactResult& result) const;
  /** With the coordinates' rates [rad/s, m/s], for damping. Without them everything is at rest. */
  void evaluate(const JointCoordinates& q, const JointCoordinates& qdot, ContactWorkspace& workspace, const Options& options,
                ContactResult& result) const;
  void evaluate(const Pose& X_FM, ContactWorkspace& workspace, const Options& options, ContactResult& result) const;
  /** Convenience: cold, allocates. */
  ContactResult evaluate(const JointCoordinates& q, const Options& options) const;
  ContactResult evaluate(const JointCoordinates& q) const;  ///< with energy

  /** Per-element values of the last evaluation held by `workspace`, one vector per compartment (elements only). */
  std::vector<std::vector<ElementField>> calcFields(const ContactWorkspace& workspace) const;

  /** Power of the contact force on M relative to F [W]: P = f . v(Fo) + m_Fo . w; p_FMo is the position of Mo in F. */
  static double calcPower(const NetLoad& load, const SpatialVelocity& V_FM, const Vec3& p_FMo);

 private:
  friend class ContactWorkspace;
  friend class ErrorEstimator;
  struct Impl;
  ContactPair(ContactPairDefinition definition, const Impl* known);
  std::unique_ptr<Impl> impl_;
};

/** Smallest rectangle [x0, x1, z0, z1] that contains the part of a surface that faces up (or down); for round element surfaces see
 findExtent. */
std::array<double, 4> findRectangle(const ContactSurface& surface, PlaneFacing facing = PlaneFacing::up);

}  // namespace genu::contact
