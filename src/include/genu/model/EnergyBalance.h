#pragma once

#include <vector>

#include "genu/scene/Scene.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

/** Energy of a run against the work done on it, frame by frame.

   E = kinetic + elastic energy of contact, ligaments, springs and stops + potential of gravity                     [J]
   W = sum over the intervals between frames of  f . dp + m . w dt  of loads,  f_c dq  of prescribed coordinates,
       -T dL of muscles,  -c v^2 dt of damped coordinates,  -P dt of contact damping                                 [J]
   imbalance = E - E(0) - W

 f, m, f_c, T, P: means of both ends; dp: move of the load's point on the body. Exact for constant loads and resting prescribed coordinates;
 otherwise an error of second order in the interval, estimated by leaving out every second frame: a third of the difference.
 scale = largest kinetic energy + largest elastic energy of contact + range of the whole potential. */
struct EnergyBalance {
  bool known = false;  ///< false: an element with damping, a stop with dissipation, or an element that this function does not know
  std::vector<double> energy_J, work_J;  ///< of each frame, energy less that of the first
  double scale_J = 0;
  double imbalance_J = 0;   ///< the largest
  double quadrature_J = 0;  ///< estimated part of it that the sums over the intervals make
  double imbalance() const { return scale_J > 0 ? imbalance_J / scale_J : 0; }
  double quadrature() const { return scale_J > 0 ? quadrature_J / scale_J : 0; }
};
/** @throws InputError as KneeSystem */
EnergyBalance calcEnergyBalance(const scene::Scene& scene, const scene::Trajectory& trajectory);

/** Share of the scale beyond which a gait's imbalance is warned of. */
inline constexpr double kToleratedImbalance = 0.05;

}  // namespace genu::model
