#pragma once

// A grid on the moving body: the pair is evaluated with the bodies exchanged, at the inverse pose, and mapped back.

#include "genu/contact/ContactPair.h"

namespace genu::contact::detail {

/** The definition with fixed and moving body exchanged: surfaces, layers and materials. Element surfaces and the height of
 planes stay: they are given in the frame of the body that carries the grid. */
ContactPairDefinition exchangeBodies(const ContactPairDefinition& definition);

/** `load` is the one on F, in M, about Mo (what the exchanged pair calls M, F, Fo); turned into that on M, in F, about Fo. */
void mapLoadFromM(const Pose& X_FM, NetLoad& load);

/** Motion (v, w) of M in F at Fo into that of F in M at Mo, in M. */
void mapMotionToM(const Pose& X_FM, Vec3& v, Vec3& w);

/** d(load)/d(motion) and d(load)/d(rate of motion) of the exchanged pair (motion of F in M at Mo) into those of the pair (motion of M
 in F at Fo).
 @param v_F, w_F the motion itself; forceOnM_F, momentOnM_Fo_F the mapped total */
void mapStiffnessFromM(const Pose& X_FM, const Vec3& v_F, const Vec3& w_F, const Vec3& forceOnM_F, const Vec3& momentOnM_Fo_F,
                       Matrix6& byMotion, Matrix6& byRate);

void mapFieldFromM(const Pose& X_FM, ElementField& field);

}  // namespace genu::contact::detail
