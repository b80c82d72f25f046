/* The contact engine from a plain C program: a rigid sphere on a flat elastic layer, checked against its closed form
     F = (pi K D^2 / h) (R - 2 D / 3),   dF/dD = (2 pi K / h) (R D - D^2),   K = c(nu) E. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "genu/contact/genu_contact.h"

static int failures = 0;

static void expect(int ok, const char* what) {
  if (ok) return;
  printf("FAILED: %s\n", what);
  ++failures;
}

static void need(genu_status status) {
  if (status == GENU_OK) return;
  printf("FAILED: %s: %s\n", genu_status_text(status), genu_last_error());
  exit(1);
}

int main(void) {
  const double pi = 3.14159265358979323846;
  const double R = 0.030, h = 0.006, D = 0.2e-3, E = 463e6, nu = 0.46;
  const double K = (1 - nu) / ((1 + nu) * (1 - 2 * nu)) * E;
  const double exact = pi * K * D * D / h * (R - 2 * D / 3);
  const double exact_slope = 2 * pi * K / h * (R * D - D * D);
  const double coordinates[6] = {0.1, 0.2, -0.3, 0, h + R - D, 0}; /* the rotation of a sphere does not matter */
  const double rates[6] = {0, 0, 0, 0, -0.01, 0};

  genu_surface* layer = NULL;
  genu_surface* sphere = NULL;
  genu_pair* pair = NULL;
  genu_workspace* workspace = NULL;
  genu_compartment grid = {"all", -0.005, 0.005, -0.005, 0.005, 101, 101, NULL, NULL};
  genu_pair_options options;
  genu_evaluate_options wanted;
  genu_result result;
  genu_load compartment;
  genu_element* elements;
  size_t count = 0, k;
  double sum = 0;

  need(genu_surface_create_plane(h, 0, 0, GENU_SOLID_BELOW, 0.1, &layer));
  need(genu_surface_create_sphere(R, &sphere));
  grid.fixed = layer;
  grid.moving = sphere;
  genu_pair_options_init(&options, sizeof options);
  options.compartments = &grid;
  options.num_compartments = 1;
  options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
  options.fixed_thickness.value = h;
  options.material.law = GENU_LINEAR;
  options.material.youngs_modulus = E;
  options.material.poisson_ratio = nu;
  need(genu_pair_create(&options, &pair));
  genu_surface_destroy(layer); /* the pair keeps what it needs */
  genu_surface_destroy(sphere);
  need(genu_workspace_create(pair, &workspace));

  genu_evaluate_options_init(&wanted, sizeof wanted);
  wanted.with_energy = 1;
  wanted.with_stiffness = 1;
  genu_result_init(&result, sizeof result);
  need(genu_evaluate(pair, workspace, coordinates, rates, &wanted, &result, &compartment, 1));
  printf("genu %s: force %.6f N, exact %.6f N; stiffness %.6e N/m, exact %.6e N/m\n", genu_version(),
         result.total.force_on_moving[1], exact, -result.stiffness[6 * 1 + 4], exact_slope);

  /* 35 cells per contact radius: midpoint sums of a pressure with a kink err by 35^-2.5 = 1.4e-4 at most, its derivative,
     which jumps there, by 35^-1.5 = 4.8e-3. */
  expect(fabs(result.total.force_on_moving[1] / exact - 1) < 1.4e-4, "force");
  expect(result.total.force_on_fixed[1] == -result.total.force_on_moving[1], "action and reaction");
  expect(fabs(-result.stiffness[6 * 1 + 4] / exact_slope - 1) < 4.8e-3, "stiffness");
  expect(fabs(result.power + 0.01 * result.total.force_on_moving[1]) < 1e-9 * exact, "power is force times velocity");
  expect(result.total.energy > 0, "energy");
  expect(memcmp(&compartment, &result.total, sizeof compartment) == 0, "the only compartment carries all");

  need(genu_pair_fields(pair, workspace, 0, NULL, 0, &count));
  expect(count == 101 * 101, "number of elements");
  elements = malloc(count * sizeof *elements);
  if (!elements) return 1;
  need(genu_pair_fields(pair, workspace, 0, elements, count, &count));
  for (k = 0; k < count; ++k) sum += elements[k].force;
  expect(fabs(sum / result.total.scalar_force - 1) < 1e-9, "the elements add up"); /* rounding of 4000 terms */
  free(elements);

  expect(genu_surface_create_sphere(-R, &sphere) == GENU_BAD_ARGUMENT && strstr(genu_last_error(), "-0.03") != NULL,
         "an error names the value");

  genu_workspace_destroy(workspace);
  genu_pair_destroy(pair);
  return failures == 0 ? 0 : 1;
}
