#pragma once

#include "genu/model/KneeSystem.h"

namespace genu::model {

/** Start of a motion that follows an equilibrium z_e(t) of the free coordinates. A body that starts in the equilibrium and at its rate rings: inertia
 takes it elsewhere. It does not where its accelerations A are those of the path,

   A(t, z_e + c, z_e') = z_e'',   q = z_e + c,   u = z_e' + c'

 of second order in the ratio of the motion's rate to the modes' frequencies; z_e', z_e'' and c' by differences over some milliseconds. */
struct QuietStart {
  scene::Coordinates q, qdot;  ///< all coordinates; prescribed ones as given, their rates 0
};

/** `q`: the equilibrium at t = 0. Where the equilibrium cannot be followed, or the motion is not slow against its modes (c larger than 0.1 mm, or its
 own acceleration c'' beyond 0.3 of z_e''): q itself, and the rates of the equilibrium there. */
QuietStart findQuietStart(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Coordinates& q);

}  // namespace genu::model
