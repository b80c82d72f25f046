#pragma once

#include "ReducedDynamics.h"
#include "genu/model/Analysis.h"

namespace genu::model {

/** runStatic on a system whose topology is realized, at a time and with settings of the caller's choice. */
StaticResult settle(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Scene& scene,
                    const scene::StaticSpec& settings, const scene::Progress& progress);

/** Rates of the free coordinates at which the equilibrium found by settle() at `time_s` keeps up with the prescribed
 motion and the loads: K zdot = dr/dt at fixed z, by forward differences. Prescribed entries are 0. A body that started
 at rest in an equilibrium that moves on would ring at its contact modes. */
contact::JointCoordinates calcEquilibriumRates(const KneeSystem& knee, const SimTK::State& defaultState,
                                               const contact::JointCoordinates& q, double time_s);

/** CPU time of this process [s]. */
double cpuTime_s();

}  // namespace genu::model
