#ifndef GENU_CONTACT_H
#define GENU_CONTACT_H

/* Plain C interface of the contact engine, for any multibody code [BF2004 §2.4]: model and options in; six coordinates
   and their derivatives in; a force and a torque on each body, stiffness, measured quantities and fields out. SI units
   throughout (m, N, Pa, rad, s, J). Guide: docs/c_interface.md.

   Frames: F fixed body, M moving body. Coordinates (rx, ry, rz, x, y, z): R_FM = Rx(rx) Ry(ry) Rz(rz), and the position of
   M's origin from F's origin in F. All vectors of a result are expressed in F; moments are about F's origin.

   Errors: every function that can fail returns a genu_status; the reason is in genu_last_error() of the same thread. Below
   GENU_BAD_ARGUMENT results are written, from there on no output is touched. No exception leaves a function.
   State: none but the objects the caller holds (and the text of the last error, per thread).
   Threads: surfaces and pairs are immutable and may be shared; a workspace belongs to one thread at a time.
   Lifetime: a pair keeps what it needs of its surfaces, a workspace what it needs of its pair: destroy in any order.
   Growth: structs that begin with struct_size may get more fields at their end without a new shared-library version. Set it
   with the _init function; 0 in every field is the default. The other structs change only with the library's SOVERSION. */

#include <stddef.h>

#if defined(__GNUC__)
#define GENU_API __attribute__((visibility("default")))
#else
#define GENU_API
#endif

/* A number that names nothing is an error that is reported, so an enumeration must be able to hold it. */
#ifdef __cplusplus
#define GENU_ENUM(name) enum name : int
#else
#define GENU_ENUM(name) enum name
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* "0.1.0", of the library in use. */
GENU_API const char* genu_version(void);

/* ---- Errors ---- */

typedef GENU_ENUM(genu_status) {
  GENU_OK = 0,
  GENU_EXTRAPOLATED = 1,     /* some element is beyond d/h = 0.95: results are given, with care */
  GENU_FULL_PENETRATION = 2, /* d >= h somewhere, or a surface that faces away: the result has no meaning */
  GENU_NOT_CONVERGED = 3,    /* a closest-point query failed, or the grid is too coarse for walls or folds: the result has no meaning */
  GENU_BAD_ARGUMENT = 10,
  GENU_OUT_OF_MEMORY = 11,
  GENU_INTERNAL_ERROR = 12 /* please report it */
} genu_status;

/* Why the last call of this thread that returns a status failed, at most 1023 bytes; "" when it did not. Never NULL; valid
   until the thread's next such call. */
GENU_API const char* genu_last_error(void);
/* "ok", "bad_argument", ... */
GENU_API const char* genu_status_text(genu_status status);
/* For libraries built on this one: sets the thread's error text (NULL: none) and returns `status`. */
GENU_API genu_status genu_set_last_error(genu_status status, const char* text);

/* ---- Surfaces ---- */

typedef struct genu_surface genu_surface;     /* immutable, may be shared by several pairs and threads */
typedef struct genu_pair genu_pair;           /* immutable */
typedef struct genu_workspace genu_workspace; /* one per thread */

/* Which side is material; the outward normal points away from it. Fixed surface: below. Moving height field: above. */
typedef GENU_ENUM(genu_solid) { GENU_SOLID_BELOW = 0, GENU_SOLID_ABOVE = 1, GENU_SOLID_INSIDE = 2 } genu_solid;

/* One untrimmed NURBS patch. Degrees 1 to 5; num_knots_u = num_u + degree_u + 1, likewise v; `points` are num_u * num_v
   triples [m], v running fastest; `weights` in the same order, > 0, NULL: all 1. The outward normal is S_u x S_v, turned
   around where flip_normal is not 0. */
typedef struct genu_nurbs_patch {
  int degree_u, degree_v;
  int num_u, num_v;
  int num_knots_u, num_knots_v;
  int flip_normal;
  const double* knots_u;
  const double* knots_v;
  const double* points;
  const double* weights;
} genu_nurbs_patch;

/* The patches together are the surface; they may overlap. Everything is copied. */
GENU_API genu_status genu_surface_create_nurbs(const genu_nurbs_patch* patches, int num_patches, genu_surface** out);

/* Simple surfaces, exact, centred at the body's origin. Height fields span |x|, |z| <= half_extent. */
/* y = y0 + slope_x x + slope_z z */
GENU_API genu_status genu_surface_create_plane(double y0, double slope_x, double slope_z, genu_solid solid,
                                               double half_extent, genu_surface** out);
/* Bottom of a torus about z, lowest point at y0; radii > 0, INFINITY: a trough */
GENU_API genu_status genu_surface_create_dish(double y0, double radius_sagittal, double radius_frontal, genu_solid solid,
                                              double half_extent, genu_surface** out);
/* y = y0 + x^2/(2 radius_x) + z^2/(2 radius_z); either sign, INFINITY allowed */
GENU_API genu_status genu_surface_create_paraboloid(double y0, double radius_x, double radius_z, genu_solid solid,
                                                    double half_extent, genu_surface** out);
GENU_API genu_status genu_surface_create_sphere(double radius, genu_surface** out);
/* Open tube about z, |z| <= length/2 */
GENU_API genu_status genu_surface_create_cylinder(double radius, double length, genu_surface** out);
/* Semi-axes along x, y, z */
GENU_API genu_status genu_surface_create_ellipsoid(double a, double b, double c, genu_surface** out);
/* About z: outer radius in the x-y plane, radius of the section, 0 < radius_frontal < radius_sagittal */
GENU_API genu_status genu_surface_create_torus(double radius_sagittal, double radius_frontal, genu_surface** out);
/* A copy of `surface` placed elsewhere in its body: `placement` is a pose in the form of the six coordinates. */
GENU_API genu_status genu_surface_create_placed(const genu_surface* surface, const double placement[6], genu_surface** out);
/* A copy of `surface` with its normals turned around: a closed shape becomes a cavity, the socket of a hip. */
GENU_API genu_status genu_surface_create_flipped(const genu_surface* surface, genu_surface** out);
/* NULL is allowed, here and in the other _destroy functions. */
GENU_API void genu_surface_destroy(genu_surface* surface);
/* 0 for NULL */
GENU_API int genu_surface_num_patches(const genu_surface* surface);

/* ---- Contact pairs ---- */

typedef GENU_ENUM(genu_thickness_kind) {
  GENU_THICKNESS_NONE = 0,         /* rigid */
  GENU_THICKNESS_CONSTANT = 1,     /* value: h [m] */
  GENU_THICKNESS_ABOVE_PLANE = 2,  /* value: y of the plane [m] */
  GENU_THICKNESS_BACK_CLOSEST = 3, /* back: back surface, distance to its nearest point */
  GENU_THICKNESS_BACK_NORMAL = 4,  /* back: back surface, distance along the inward normal */
  GENU_THICKNESS_RADIAL = 5        /* value: radius of a round back [m], distance to it; where it is: genu_round_back */
} genu_thickness_kind;

/* Elastic layer of one body. */
typedef struct genu_thickness {
  genu_thickness_kind kind;
  double value;
  const genu_surface* back; /* in the body's frame */
  double min, max;          /* clamps [m]; 0: none */
  double missing;           /* thickness where the normal misses the back surface [m]; 0: no element there */
  int map_samples_u, map_samples_v; /* moving body: samples of the thickness map of each patch; 0: 65 */
} genu_thickness;

/* Laws: docs/theory.md. */
typedef GENU_ENUM(genu_law) { GENU_LINEAR = 0, GENU_POWER_LAW = 1, GENU_POWER_LAW_CONSISTENT = 2 } genu_law;

typedef struct genu_material {
  genu_law law;
  double youngs_modulus; /* [Pa], linear law, > 0 */
  double poisson_ratio;  /* 0 <= nu < 0.5 */
  double eps0, p0, n;    /* power laws: eps0 > 0, p0 > 0 [Pa], n >= 1 */
} genu_material;

/* A grid of nx * nz elements over [x0, x1] x [z0, z1] of F [m], projected along +y onto `fixed`. Other places for the grid:
   element_surfaces and grid_on of genu_pair_options. */
typedef struct genu_compartment {
  const char* name; /* NULL: "compartment K" */
  double x0, x1, z0, z1;
  int nx, nz;
  const genu_surface* fixed;  /* in F */
  const genu_surface* moving; /* in M */
} genu_compartment;

typedef GENU_ENUM(genu_strain) { GENU_STRAIN_SMALL = 0, GENU_STRAIN_LARGE = 1 } genu_strain;
typedef GENU_ENUM(genu_correction) {
  GENU_CORRECTION_MIDSURFACE = 0, /* d = AB / cos(theta/2), force along the bisector */
  GENU_CORRECTION_NONE = 1,       /* distance and force along the minimum distance: conservative; ray: along the ray */
  GENU_CORRECTION_ENERGY = 2      /* distance as midsurface, load minus the gradient of the energy: conservative; smooth rule only */
} genu_correction;
typedef GENU_ENUM(genu_distance) {
  GENU_DISTANCE_MINIMUM = 0, /* AB, to the closest point of the moving surface */
  GENU_DISTANCE_RAY = 1      /* AC, along the normal to the first hit, d = AC cos(theta) / cos(theta/2); centre rule only */
} genu_distance;
typedef GENU_ENUM(genu_rule) {
  GENU_RULE_SMOOTH = 0, /* pressure is integrated over the part of each cell in contact: the load is C1 in the pose */
  GENU_RULE_CENTRE = 1  /* whole cells, by their centre: the load jumps as cells switch; no stiffness */
} genu_rule;
typedef GENU_ENUM(genu_tracking) {
  GENU_TRACKING_LIPSCHITZ = 0,              /* exact culling */
  GENU_TRACKING_ALL = 1,                    /* every element, every time */
  GENU_TRACKING_BREADTH_FIRST = 2,          /* search from the last contact, then what it did not reach: exact */
  GENU_TRACKING_BREADTH_FIRST_UNGUARDED = 3 /* the search alone: can miss a new, separate contact region */
} genu_tracking;

/* Which body's surface is divided into elements; distances are measured from there to the other one. */
typedef GENU_ENUM(genu_grid_on) { GENU_GRID_ON_FIXED = 0, GENU_GRID_ON_MOVING = 1 } genu_grid_on;

/* The surface a grid is laid out on before it is projected, in the frame of the body that carries it. */
typedef GENU_ENUM(genu_element_surface_kind) {
  GENU_ELEMENTS_PLANE_UP = 0,         /* along +y onto the highest upward crossing; ranges: the compartment's x0 .. z1 */
  GENU_ELEMENTS_PLANE_DOWN = 1,       /* along -y onto the lowest downward crossing: a femoral condyle */
  GENU_ELEMENTS_CYLINDER_OUTWARD = 2, /* radially from an axis onto the farthest crossing that faces outward */
  GENU_ELEMENTS_CYLINDER_INWARD = 3,  /* ... onto the nearest crossing that faces the axis: a socket */
  GENU_ELEMENTS_SPHERE_OUTWARD = 4,   /* radially from a centre */
  GENU_ELEMENTS_SPHERE_INWARD = 5
} genu_element_surface_kind;

/* A direction of three zeros is the default. Rays of a cylinder: at right angles to the axis, `angle` from `zero`, right-handed
   about the axis. Of a sphere: cos(e) (cos(angle) zero + sin(angle) axis x zero) + sin(e) axis, e the elevation. nx counts along
   the angle, nz along the other coordinate. An angle range of 2 pi closes on itself. Planes use `kind` alone. */
typedef struct genu_element_surface {
  genu_element_surface_kind kind;
  double center[3];      /* of the sphere, or a point on the axis [m] */
  double axis[3];        /* default z */
  double zero[3];        /* direction of angle 0; default -y (+x for an axis along y) */
  double angle[2];       /* from, to [rad] */
  double axial[2];       /* cylinder: from, to along the axis [m] */
  double elevation[2];   /* sphere: from, to [rad], within -pi/2 .. pi/2 */
  double limit_radius;   /* only crossings on the open side of this radius are used [m]; 0: all */
} genu_element_surface;

/* Where the round back of GENU_THICKNESS_RADIAL is, in the layer's body. */
typedef struct genu_round_back {
  double center[3]; /* of a sphere, or a point on a cylinder's axis [m] */
  double axis[3];   /* of a cylinder; three zeros: a sphere */
} genu_round_back;

typedef struct genu_pair_options {
  size_t struct_size; /* sizeof(genu_pair_options) of the caller */
  const genu_compartment* compartments;
  int num_compartments;
  int use_element_plane;  /* not 0: crossings at or below element_plane_y are not used */
  double element_plane_y; /* [m] */
  genu_thickness fixed_thickness, moving_thickness; /* at least one layer */
  genu_material material;
  const genu_material* moving_material; /* where the moving layer differs: layers in series; NULL: the same */
  genu_strain strain;
  genu_correction correction;
  genu_rule rule;
  genu_tracking tracking;
  double copy_tolerance; /* a stored result is returned when no coordinate moved by more [rad, m]; negative: never */
  genu_distance distance;
  genu_grid_on grid_on;
  const genu_element_surface* element_surfaces; /* one per compartment; NULL: planes that face up */
  const genu_round_back* fixed_round_back;      /* radial thickness; NULL: a sphere about the body's origin */
  const genu_round_back* moving_round_back;
  /* Hunt-Crossley damping [s/m], >= 0: p max(0, 1 + damping * approach) with the approach of the bodies at the element, from the rates
     of genu_evaluate; it only takes power. Not with GENU_CORRECTION_ENERGY. */
  double damping;
} genu_pair_options;

/* Sets all fields to their defaults; `size` is sizeof(genu_pair_options) where you compile. Does nothing for NULL. */
GENU_API void genu_pair_options_init(genu_pair_options* options, size_t size);

/* Builds grids and thickness maps. Surfaces and options are copied or shared: they may be destroyed afterwards. */
GENU_API genu_status genu_pair_create(const genu_pair_options* options, genu_pair** out);
GENU_API void genu_pair_destroy(genu_pair* pair);

/* 0 for NULL */
GENU_API int genu_pair_num_compartments(const genu_pair* pair);
GENU_API int genu_pair_num_elements(const genu_pair* pair);
/* Number of elements of one compartment; 0 when there is no such compartment. */
GENU_API int genu_pair_num_compartment_elements(const genu_pair* pair, int compartment);
/* NULL when there is no such compartment; lives as long as the pair. */
GENU_API const char* genu_pair_compartment_name(const genu_pair* pair, int compartment);

/* What became of a compartment's cells, and its fixed layer. */
typedef struct genu_grid_report {
  int cells, elements;
  int missed_surface; /* the cell's ray (a plane's vertical) misses the surface that carries the grid */
  int below_plane;    /* it meets it only at or behind the element plane or the limiting radius */
  int downward_only;  /* it meets only sheets that face the other way: inverted normals? */
  int missed_back;    /* no back surface along the normal */
  int clamped;        /* thickness clamped */
  double min_thickness, max_thickness, mean_thickness; /* [m] */
  double surface_area;                                 /* [m^2] */
} genu_grid_report;
GENU_API genu_status genu_pair_grid_report(const genu_pair* pair, int compartment, genu_grid_report* out);

/* Thickness map of a moving surface, one per moving surface that has a back surface. */
typedef struct genu_map_report {
  int samples, missed, clamped;
  double min_thickness, max_thickness, mean_thickness; /* [m] */
} genu_map_report;
GENU_API int genu_pair_num_maps(const genu_pair* pair);
GENU_API genu_status genu_pair_map_report(const genu_pair* pair, int map, genu_map_report* out);

/* ---- Evaluation ---- */

/* Memory of one user: warm starts, stored result. It changes the time of an evaluation, never the answer. */
GENU_API genu_status genu_workspace_create(const genu_pair* pair, genu_workspace** out);
/* Forgets everything: the next evaluation is cold. */
GENU_API void genu_workspace_reset(genu_workspace* workspace);
GENU_API void genu_workspace_destroy(genu_workspace* workspace);

/* Somebody's threads. `run` calls task(context, i) once for every i in [0, count), in any order and on any threads, and returns when
   all are done. Library genu_contact_threads has one. */
typedef struct genu_task_runner {
  void (*run)(void* user, int count, void (*task)(void* context, int index), void* context);
  void* user;
  int num_threads; /* that may work at a time, >= 1 */
} genu_task_runner;

/* Evaluations with this workspace use these threads (smooth rule) where there is enough to do; results are bitwise the same for
   any number of threads. The struct is copied; what it points to must outlive its use. NULL: the calling thread alone. */
GENU_API genu_status genu_workspace_set_task_runner(genu_workspace* workspace, const genu_task_runner* runner);

typedef struct genu_load {
  double force_on_moving[3], moment_on_moving_about_fixed_origin[3]; /* in F [N], [N m] */
  double force_on_fixed[3], moment_on_fixed_about_fixed_origin[3];   /* the opposite */
  double scalar_force;  /* sum of p dA [N] */
  double peak_pressure; /* [Pa] */
  double peak_point[3]; /* where [m] */
  double mean_pressure; /* sum of p dA over sum of dA in contact [Pa] */
  double area;          /* [m^2] */
  double energy;        /* elastic [J]; 0 unless asked for */
  double max_strain;    /* largest d/h */
  double center_of_pressure[3];
  int active_elements;
  int extrapolated_elements;     /* beyond d/h = 0.95 */
  int full_penetration_elements; /* d >= h, or facing away */
  int not_converged_queries;     /* 0 with GENU_NOT_CONVERGED: a compartment's sum is below zero, or beyond the range of numbers */
  int boundary_elements;     /* behind the open border of the moving surface: carry nothing */
  int no_thickness_elements; /* left out: the moving body's back surface is missed there */
} genu_load;

typedef struct genu_evaluate_options {
  size_t struct_size; /* sizeof(genu_evaluate_options) of the caller */
  int with_energy;
  int with_stiffness;      /* smooth rule only */
  int copy_only_same_pose; /* whatever copy_tolerance: for differences between close poses */
} genu_evaluate_options;

typedef struct genu_result {
  size_t struct_size; /* sizeof(genu_result) of the caller */
  genu_load total;
  double power; /* of the contact force on M relative to F [W]; 0 without rates */
  /* With with_stiffness, else 0: d(force, moment on M)/d(coordinates), row by row: stiffness[6 * row + column]; rows
     force [N] then moment about F's origin [N m], columns rx, ry, rz [rad], x, y, z [m]. Not symmetric in general. */
  double stiffness[36];
  int distance_queries; /* work done: points whose distance was asked */
  int copied;           /* 1: taken from the stored result */
  /* With with_stiffness and damping of the pair, else 0: d(force, moment on M)/d(rates), laid out as stiffness [N s/rad, N m s/rad,
     N s/m, N s]. The stiffness is then the derivative at constant rates. */
  double damping[36];
} genu_result;

/* As genu_pair_options_init. */
GENU_API void genu_evaluate_options_init(genu_evaluate_options* options, size_t size);
GENU_API void genu_result_init(genu_result* result, size_t size);

/* Net load at a pose. coordinates: rx, ry, rz [rad], x, y, z [m]; rates: their time derivatives, or NULL: at rest. options: NULL for
   none. compartments: NULL, or room for num_compartments loads, which must be the pair's number. Allocates nothing once the
   workspace has seen the pair's largest contact. Numbers that are not finite are GENU_BAD_ARGUMENT. */
GENU_API genu_status genu_evaluate(const genu_pair* pair, genu_workspace* workspace, const double coordinates[6],
                                   const double rates[6], const genu_evaluate_options* options, genu_result* result,
                                   genu_load* compartments, int num_compartments);

/* One element at the pose of the workspace's last evaluation. */
typedef struct genu_element {
  int ix, iz;                  /* cell of the grid */
  double point[3], normal[3];  /* centre A on the fixed surface, its outward normal; in F */
  double area;                 /* of the whole element [m^2] */
  double contact_share;        /* part of the area in contact, 0 to 1 */
  double force;                /* integral of p dA over the element [N] */
  double distance;             /* signed, uncorrected [m]; a lower bound where the element was skipped */
  double penetration;          /* corrected [m], 0 when inactive */
  double thickness;            /* both layers [m] */
  double pressure;             /* at the centre [Pa] */
  double force_direction[3];   /* of the force on M, in F */
  int active;
  int foot_on_border; /* the closest point is on the moving surface's open border: no contact there */
} genu_element;

/* Elements of one compartment. `count` gets their number (NULL: not wanted); `elements` may be NULL to ask for it only,
   otherwise `capacity` must be enough. Allocates. */
GENU_API genu_status genu_pair_fields(const genu_pair* pair, const genu_workspace* workspace, int compartment,
                                      genu_element* elements, size_t capacity, size_t* count);

/* ---- Error estimate ---- */

/* Second grid that an evaluation is compared with. */
typedef GENU_ENUM(genu_companion) {
  GENU_COMPANION_FINE = 0,  /* every cell split in four: three to four times the cost of the evaluation */
  GENU_COMPANION_COARSE = 1 /* half as many cells each way: about half the cost; less sharp */
} genu_companion;

/* Estimated absolute errors that the grid makes, not a bound; how often the true error is larger: docs/theory.md. The errors of
   the model, of the material and of the surfaces are not covered. */
typedef struct genu_load_error {
  double force;         /* of the vector [N] */
  double moment;        /* of the vector about F's origin [N m] */
  double peak_pressure; /* [Pa] */
  double mean_pressure; /* [Pa] */
  double area;          /* [m^2] */
} genu_load_error;

typedef struct genu_error_estimate {
  size_t struct_size; /* sizeof(genu_error_estimate) of the caller */
  genu_load_error total;
  int companion_elements;
} genu_error_estimate;

/* As genu_pair_options_init. */
GENU_API void genu_error_estimate_init(genu_error_estimate* estimate, size_t size);

/* Errors of the workspace's last evaluation, which must exist. compartments: NULL, or room for num_compartments errors, which
   must be the pair's number. The first call for a companion builds its grid and allocates. The status is the evaluation's on
   the companion grid; where that or the evaluation's own is GENU_FULL_PENETRATION or GENU_NOT_CONVERGED the estimate has no
   meaning. */
GENU_API genu_status genu_estimate_error(const genu_pair* pair, genu_workspace* workspace, genu_companion companion,
                                         genu_error_estimate* estimate, genu_load_error* compartments, int num_compartments);

#ifdef __cplusplus
}
#endif

#endif
