#pragma once

#include "ReducedDynamics.h"
#include "genu/model/Analysis.h"

namespace genu::model {

/** runStatic on a system whose topology is realized, at a time and with settings of the caller's choice.
 `start`: coordinates to start from, instead of those of the scene. */
StaticResult settle(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Scene& scene,
                    const scene::StaticSpec& settings, const scene::Progress& progress, const scene::Coordinates* start = nullptr);

/** Output times of a run: every interval, and the end. */
std::vector<double> makeOutputTimes(double duration_s, double interval_s);

/** Rates of the free coordinates at which the equilibrium found by settle() at `time_s` keeps up with the prescribed
 motion and the loads: K zdot = dr/dt at fixed z, by forward differences. Prescribed entries are 0. A body that started
 at rest in an equilibrium that moves on would ring at its contact modes. */
scene::Coordinates calcEquilibriumRates(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Coordinates& q,
                                        double time_s);

/** CPU time of this process [s]. */
double cpuTime_s();

}  // namespace genu::model
