// Threads of the installed package: the same load on one and on two.

#include <cstdio>
#include <memory>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"
#include "genu/contact/Threads.h"

int main() {
  using namespace genu::contact;
  ContactPairDefinition d;
  CompartmentDefinition& c = d.compartments.emplace_back();
  c.name = "all";
  c.x0_m = c.z0_m = -0.005;
  c.x1_m = c.z1_m = 0.005;
  c.nx = c.nz = 100;
  c.fixedSurface = std::make_shared<ContactSurface>(makePlane(0.006, 0, 0, Solid::below, 0.1));
  c.movingSurface = std::make_shared<ContactSurface>(makeSphere(0.03));
  d.fixedThickness.source = ConstantThickness{0.006};
  d.material.E_Pa = 463e6;
  d.material.nu = 0.46;
  const ContactPair pair(d);
  const Threads threads(2);
  double force_N[2];
  for (int k = 0; k < 2; ++k) {
    ContactWorkspace workspace(pair);
    workspace.setTaskRunner(k == 0 ? nullptr : &threads);
    ContactResult result;
    pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.0358, 0}, workspace, {}, result);
    force_N[k] = result.total.forceOnM_F.y();
  }
  std::printf("%.17g N, %.17g N\n", force_N[0], force_N[1]);
  return force_N[0] > 1000 && force_N[0] == force_N[1] ? 0 : 1;
}
