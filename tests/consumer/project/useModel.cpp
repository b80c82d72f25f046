// A user's own Simbody force beside the contact: a sphere on a layer, half of the load carried by a spring.
#include <Simbody.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>

#include "genu/contact/AnalyticSurface.h"
#include "genu/model/KneeSystem.h"

int main() {
  using namespace genu;
  {
    std::ofstream urdf("ball.urdf");
    urdf << "<robot name='ball'><link name='base'/>"
            "<link name='ball'><inertial><mass value='1'/>"
            "<inertia ixx='1e-3' iyy='1e-3' izz='1e-3' ixy='0' ixz='0' iyz='0'/></inertial></link>"
            "<joint name='six' type='floating'><parent link='base'/><child link='ball'/></joint></robot>";
  }
  scene::Scene scene;
  scene.name = "ball on a layer";
  scene.model.emplace();
  scene.model->urdf = "ball.urdf";
  scene.model->joint = "six";
  for (size_t k = 0; k < 6; ++k) {
    if (k != 4) scene.model->coordinates[k] = scene::PrescribedCoordinate{0.0};
  }
  scene.model->coordinates[4] = scene::FreeCoordinate{};

  scene::ContactSpec spec;
  spec.name = "contact";
  contact::CompartmentDefinition compartment;
  compartment.name = "all";
  compartment.x0_m = compartment.z0_m = -0.005;
  compartment.x1_m = compartment.z1_m = 0.005;
  compartment.nx = compartment.nz = 61;
  compartment.fixedSurface = std::make_shared<contact::ContactSurface>(contact::makePlane(0.006, 0, 0, contact::Solid::below, 0.1));
  compartment.movingSurface = std::make_shared<contact::ContactSurface>(contact::makeSphere(0.03));
  spec.definition.compartments.push_back(compartment);
  spec.definition.fixedThickness.source = contact::ConstantThickness{0.006};
  spec.definition.material.E_Pa = 463e6;
  spec.definition.material.nu = 0.46;
  scene.contacts.push_back(spec);
  scene::LoadSpec load;
  load.name = "weight";
  load.body = load.pointBody = "ball";
  load.frame = "base";
  load.force_N = {0.0, -2000.0, 0.0};
  scene.loads.push_back(load);

  model::KneeSystem knee(scene);
  // Carries 1000 N, whatever the small motion: a constant force of the user's own.
  SimTK::Force::ConstantForce(knee.forces(), knee.body("ball"), SimTK::Vec3(0), SimTK::Vec3(0, 1000, 0));
  const model::StaticResult result = model::runStatic(knee, scene);
  const double force = result.contacts.at(0).total.forceOnM_F.y();
  std::printf("%s; contact force %.6f N\n", result.statusText.c_str(), force);
  return std::abs(force - 1000) < 1e-3 ? 0 : 1;
}
