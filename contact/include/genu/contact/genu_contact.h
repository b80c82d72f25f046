#ifndef GENU_CONTACT_H
#define GENU_CONTACT_H

/* Plain C interface of the contact engine, for any multibody code [BF2004 §2.4]: model and options in; six coordinates
   and their derivatives in; a force and a torque on each body and the measured quantities out. SI units throughout.
   Frames and coordinates: genu/contact/Types.h. Every function that can fail returns a genu_status; the reason is in
   genu_last_error() of the same thread. No exception leaves a function. */

#ifdef __cplusplus
extern "C" {
#endif

typedef enum genu_status {
  GENU_OK = 0,
  GENU_EXTRAPOLATED = 1,     /* some element is beyond d/h = 0.95: results are given, with care */
  GENU_FULL_PENETRATION = 2, /* d >= h somewhere: the result has no meaning */
  GENU_NOT_CONVERGED = 3,    /* a closest-point query failed */
  GENU_BAD_ARGUMENT = 10,
  GENU_OUT_OF_MEMORY = 11
} genu_status;

typedef struct genu_surface genu_surface; /* immutable, may be shared by several pairs and threads */
typedef struct genu_pair genu_pair;       /* immutable after creation */
typedef struct genu_workspace genu_workspace; /* one per thread */

typedef enum genu_solid { GENU_SOLID_BELOW = 0, GENU_SOLID_ABOVE = 1, GENU_SOLID_INSIDE = 2 } genu_solid;

/* Surfaces. `points` are num_u * num_v triples, v running fastest; `weights` may be NULL. */
genu_status genu_surface_create_nurbs(int degree_u, int degree_v, int num_u, int num_v, const double* knots_u,
                                      const double* knots_v, const double* points, const double* weights,
                                      int flip_normal, genu_surface** out);
genu_status genu_surface_create_plane(double y0, double slope_x, double slope_z, genu_solid solid, double half_extent,
                                      genu_surface** out);
genu_status genu_surface_create_sphere(double radius, genu_surface** out);
genu_status genu_surface_create_dish(double y0, double radius_sagittal, double radius_frontal, genu_solid solid,
                                     double half_extent, genu_surface** out);
void genu_surface_destroy(genu_surface* surface);

typedef enum genu_thickness_kind {
  GENU_THICKNESS_NONE = 0,
  GENU_THICKNESS_CONSTANT = 1,     /* value: h [m] */
  GENU_THICKNESS_ABOVE_PLANE = 2,  /* value: y of the plane [m] */
  GENU_THICKNESS_BACK_CLOSEST = 3, /* back: back surface */
  GENU_THICKNESS_BACK_NORMAL = 4
} genu_thickness_kind;

typedef struct genu_thickness {
  genu_thickness_kind kind;
  double value;
  const genu_surface* back;
  double min, max; /* clamps [m]; 0: none */
} genu_thickness;

typedef enum genu_law { GENU_LINEAR = 0, GENU_POWER_LAW = 1, GENU_POWER_LAW_CONSISTENT = 2 } genu_law;

typedef struct genu_material {
  genu_law law;
  double youngs_modulus, poisson_ratio; /* linear law */
  double eps0, p0, n;                   /* power laws */
} genu_material;

typedef struct genu_compartment {
  const char* name;
  double x0, x1, z0, z1;
  int nx, nz;
  const genu_surface* fixed;
  const genu_surface* moving;
} genu_compartment;

typedef struct genu_pair_options {
  const genu_compartment* compartments;
  int num_compartments;
  int use_element_plane; /* 0: the highest crossing wherever it is */
  double element_plane_y;
  genu_thickness fixed_thickness, moving_thickness;
  genu_material material;
  int large_strain;
  int no_correction;     /* 1: distance and force along the minimum distance */
  int tracking;          /* 0 exact culling (default), 1 all elements, 2 breadth-first */
  double copy_tolerance; /* 0: only the same pose; negative: never */
} genu_pair_options;

genu_status genu_pair_create(const genu_pair_options* options, genu_pair** out);
void genu_pair_destroy(genu_pair* pair);
int genu_pair_num_elements(const genu_pair* pair);

genu_status genu_workspace_create(const genu_pair* pair, genu_workspace** out);
void genu_workspace_destroy(genu_workspace* workspace);

typedef struct genu_load {
  double force_on_moving[3], moment_on_moving_about_fixed_origin[3]; /* in F */
  double force_on_fixed[3], moment_on_fixed_about_fixed_origin[3];
  double scalar_force, peak_pressure, mean_pressure, area, energy;
  double center_of_pressure[3];
  int active_elements;
  int extrapolated_elements; /* beyond d/h = 0.95 */
  int boundary_elements;     /* behind the open border of the moving surface: carry nothing */
  int no_thickness_elements; /* left out: the moving body's back surface is missed there */
} genu_load;

/* coordinates: rx, ry, rz [rad], x, y, z [m]; rates: their time derivatives, or NULL. total: required.
   compartments: num_compartments entries, or NULL. power: power of the contact force [W], or NULL (needs rates). */
genu_status genu_evaluate(const genu_pair* pair, genu_workspace* workspace, const double coordinates[6],
                          const double rates[6], int with_energy, genu_load* total, genu_load* compartments, double* power);

/* Why the last call of this thread failed; never NULL. */
const char* genu_last_error(void);
const char* genu_status_text(genu_status status);

#ifdef __cplusplus
}
#endif

#endif
