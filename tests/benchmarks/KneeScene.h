#pragma once

// The scene of engine_benchmark and engine_table: two condyles (bicubic, 15 x 20 control points) on two dishes or flat layers.

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact::test {

inline std::shared_ptr<const ContactSurface> makeCondyleSurface(bool rational) {
  std::vector<NurbsPatch> patches;
  patches.emplace_back(makeCondyle(rational, 0));
  return share(std::move(patches));
}

inline ContactPairDefinition makeKnee(int n, bool dished, Material material, StrainMeasure strain, bool rational = false) {
  ContactPairDefinition d;
  const auto condyle = makeCondyleSurface(rational);
  const auto base = dished ? makeDish(0.008, 0.060, 0.035, Solid::below, 0.016) : makePlane(0.008, 0, 0, Solid::below, 0.016);
  for (const double side : {1.0, -1.0}) {
    const Pose X{Mat3::Identity(), Vec3(0, 0, 0.024 * side)};
    CompartmentDefinition c;
    c.name = side > 0 ? "medial" : "lateral";
    c.x0_m = -0.012;
    c.x1_m = 0.012;
    c.z0_m = 0.024 * side - 0.010;
    c.z1_m = 0.024 * side + 0.010;
    c.nx = c.nz = n;
    c.fixedSurface = shareIn(base, X);
    std::vector<NurbsPatch> moved;
    moved.push_back(condyle->patch(0).transformed(X));
    c.movingSurface = share(std::move(moved));
    d.compartments.push_back(c);
  }
  d.fixedThickness = aboveZero();
  d.material = material;
  d.strain = strain;
  d.copyTolerance = -1;
  return d;
}

/** Height at which about `target` elements of the 30 x 30 grid are active. */
inline double findHeight(const ContactPair& pair, int target) {
  double high = 0.06, low = 0.03;
  while (high - low > 1e-7) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0, 0, 0.2, 0, y, 0}, {false}).total.activeElements > target ? low : high) = y;
  }
  return high;
}

/** Poses that wander by about 0.01 mm an evaluation, as an integrator's do, at most `reach` times 1 mm away. */
inline JointCoordinates wander(int i, const JointCoordinates& middle, double reach = 1) {
  const double t = 0.01 * i / reach;
  const double away[6] = {0.0005 * std::sin(1.3 * t), 0.001 * std::sin(0.7 * t), 0.01 * std::sin(t),
                          0.001 * std::sin(0.9 * t),  5e-6 * std::sin(2.1 * t),  0.0005 * std::sin(1.7 * t)};
  JointCoordinates q = middle;
  for (size_t k = 0; k < 6; ++k) q[k] += reach * away[k];
  return q;
}
inline JointCoordinates wander(int i, double height) { return wander(i, JointCoordinates{0, 0, 0.2, 0, height, 0}); }

/** Makes it like a natural knee: cartilage on both bodies, its thickness measured to bone behind it (a map on the moving body). */
inline void makeNatural(ContactPairDefinition& d, const std::vector<double>& condylesAt_z = {0.024, -0.024}) {
  std::vector<NurbsPatch> bone;
  for (const double z : condylesAt_z) {
    NurbsPatchData back = makeCondyle(false, 0);
    for (Vec3& p : back.points) p = 0.92 * p + Vec3(0, 0, z);  // 1.9 to 2.9 mm behind the surface
    bone.emplace_back(back);
  }
  d.fixedThickness.source = BackSurface{share(makePlane(0.005, 0, 0, Solid::below, 0.060)), BackDirection::normal};
  d.movingThickness.source = BackSurface{share(std::move(bone)), BackDirection::normal};
  d.material = cartilage();
  d.strain = StrainMeasure::large;
}

}  // namespace genu::contact::test
