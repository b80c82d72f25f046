#pragma once

#include <string>

#include "KneeAnatomy.h"

namespace genu::make_models {

/** Leg below the hip in the sagittal plane, x anterior, y superior [m]; the knee is the femur's origin. */
struct PlanarLeg {
  struct Segment {
    Vec2 center;  ///< from the joint above
    double mass_kg, inertia_kgm2;
  };
  double thigh_m;  ///< hip to knee
  Vec2 ankle;      ///< from the knee
  Segment shank, foot;
};

/** step.csv: motion, load and feed-forward of the stance phase of a step, one row per per cent of the gait cycle from `kBeforeStance`
 before heel contact on. */
std::string makeStepTable(const PlanarLeg& leg);

inline constexpr int kBeforeStance = 4;           ///< per cent
inline constexpr int kStanceEnd = 60;             ///< per cent
inline constexpr double kStepCycle_s = 1.1;
inline constexpr double kBodyWeight_N = 62 * 9.81;
/** Of the ground reaction in the foot [mm]: below the ankle; medial of it, for a leg that leans and stands upright here: assumed. */
inline constexpr double kSole_mm = -45, kMedial_mm = 10;

}  // namespace genu::make_models
