// The engine alone: a sphere on a layer, checked against F = (pi K D^2 / h)(R - 2D/3).
#include <cmath>
#include <cstdio>
#include <memory>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"

int main() {
  using namespace genu::contact;
  ContactPairDefinition definition;
  CompartmentDefinition compartment;
  compartment.name = "all";
  compartment.x0_m = compartment.z0_m = -0.005;
  compartment.x1_m = compartment.z1_m = 0.005;
  compartment.nx = compartment.nz = 101;
  compartment.fixedSurface = std::make_shared<ContactSurface>(makePlane(0.006, 0, 0, Solid::below, 0.1));
  compartment.movingSurface = std::make_shared<ContactSurface>(makeSphere(0.03));
  definition.compartments.push_back(compartment);
  definition.fixedThickness.source = ConstantThickness{0.006};
  definition.material.E_Pa = 463e6;
  definition.material.nu = 0.46;
  const double K = definition.material.confinementFactor() * definition.material.E_Pa;
  const double D = 0.2e-3;
  const ContactPair pair(definition);
  const double force = pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.006 + 0.03 - D, 0}).total.forceOnM_F.y();
  const double exact = kPi * K * D * D / 0.006 * (0.03 - 2 * D / 3);
  std::printf("force %.3f N, exact %.3f N\n", force, exact);
  return std::abs(force / exact - 1) < 2e-4 ? 0 : 1;
}
