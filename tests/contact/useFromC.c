/* Compiled as C: proves that the interface is plain C. Returns the vertical force of a sphere on a layer, or -status. */
#include "genu/contact/genu_contact.h"

double pressSphereFromC(double depth, double* power, int* active);

double pressSphereFromC(double depth, double* power, int* active) {
  genu_surface *layer = 0, *sphere = 0;
  genu_pair* pair = 0;
  genu_workspace* workspace = 0;
  genu_result result;
  double q[6] = {0, 0, 0, 0, 0, 0};
  double rates[6] = {0, 0, 0, 0, -0.01, 0};
  genu_compartment compartment = {"all", -0.005, 0.005, -0.005, 0.005, 101, 101, 0, 0};
  genu_pair_options options;
  genu_status status = genu_surface_create_plane(0.006, 0, 0, GENU_SOLID_BELOW, 0.1, &layer);
  if (status == GENU_OK) status = genu_surface_create_sphere(0.03, &sphere);
  compartment.fixed = layer;
  compartment.moving = sphere;
  genu_pair_options_init(&options, sizeof options);
  options.compartments = &compartment;
  options.num_compartments = 1;
  options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
  options.fixed_thickness.value = 0.006;
  options.material.youngs_modulus = 463e6;
  options.material.poisson_ratio = 0.46;
  if (status == GENU_OK) status = genu_pair_create(&options, &pair);
  if (status == GENU_OK) status = genu_workspace_create(pair, &workspace);
  q[4] = 0.006 + 0.03 - depth;
  genu_result_init(&result, sizeof result);
  if (status == GENU_OK) status = genu_evaluate(pair, workspace, q, rates, 0, &result, 0, 0);
  *power = result.power;
  *active = status == GENU_OK ? result.total.active_elements : -1;
  genu_workspace_destroy(workspace);
  genu_pair_destroy(pair);
  genu_surface_destroy(sphere);
  genu_surface_destroy(layer);
  return status == GENU_OK ? result.total.force_on_moving[1] : -(double)status;
}
