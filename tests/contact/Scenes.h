#pragma once

// Small contact scenes that several tests share.

#include <memory>
#include <utility>
#include <vector>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"

namespace genu::contact::test {

inline std::shared_ptr<const ContactSurface> share(std::vector<NurbsPatch> patches) {
  return std::make_shared<const ContactSurface>(std::move(patches));
}

inline std::shared_ptr<const ContactSurface> shareIn(const std::vector<NurbsPatch>& patches, const Pose& X) {
  std::vector<NurbsPatch> moved;
  for (const NurbsPatch& p : patches) moved.push_back(p.transformed(X));
  return share(std::move(moved));
}

inline Material uhmwpe() {
  Material m;
  m.E_Pa = 463e6;
  m.nu = 0.46;
  return m;
}

inline Material uhmwpePowerLaw(MaterialLaw law = MaterialLaw::powerLaw) {
  Material m;
  m.law = law;
  m.nu = 0.46;
  m.eps0 = 0.0597;
  m.p0_Pa = 18.4e6;
  m.n = 3;
  return m;
}

inline Material cartilage() {
  Material m;
  m.E_Pa = 4e6;
  m.nu = 0.45;
  return m;
}

/** One compartment "all" over [-half, half]^2 (shifted by cx, cz), n x n, rigid moving body. */
inline ContactPairDefinition makeScene(std::shared_ptr<const ContactSurface> fixed, std::shared_ptr<const ContactSurface> moving,
                                       Thickness thickness, Material material, double half, int n, double cx = 0,
                                       double cz = 0) {
  ContactPairDefinition d;
  CompartmentDefinition c;
  c.name = "all";
  c.x0_m = cx - half;
  c.x1_m = cx + half;
  c.z0_m = cz - half;
  c.z1_m = cz + half;
  c.nx = c.nz = n;
  c.fixedSurface = std::move(fixed);
  c.movingSurface = std::move(moving);
  d.compartments.push_back(std::move(c));
  d.fixedThickness = std::move(thickness);
  d.material = material;
  return d;
}

inline Thickness constantThickness(double h) {
  Thickness t;
  t.source = ConstantThickness{h};
  return t;
}

inline Thickness aboveZero() {
  Thickness t;
  t.source = HeightAbovePlane{0};
  return t;
}

}  // namespace genu::contact::test
