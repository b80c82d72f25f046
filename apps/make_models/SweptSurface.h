#pragma once

#include <vector>

#include "genu/contact/Types.h"

namespace genu::make_models {

using contact::Vec2;
using contact::Vec3;

/** Lengths in mm in this program (files are in mm), angles in rad. Frame of the method: x posterior (right knee), y
 superior, z medial. */

inline constexpr double kDegree = contact::kPi / 180;

/** A plane curve in x-y, given by its radius of curvature as a function of the angle phi of its outward normal:

   n(phi) = (sin phi, -cos phi),   P'(phi) = R(phi) (cos phi, sin phi)

 phi = 0 points down (distal condyle), +90 deg posterior, negative anterior. R is constant on arcs that meet
 tangentially at given angles. With blend > 0, R changes smoothly within +-blend of each meeting angle (smootherstep: R
 is C2, the curve C4); with blend = 0 it jumps and the curve is C1. */
class SagittalCurve {
 public:
  struct Arc {
    double radius_mm;
    double end_rad;  ///< where the next arc begins; the last one's is the end of the curve
  };
  SagittalCurve(double start_rad, std::vector<Arc> arcs, double blend_rad);

  double start() const { return start_; }
  double end() const { return arcs_.back().end_rad; }
  const std::vector<Arc>& arcs() const { return arcs_; }
  double calcRadius(double phi) const;
  /** Moves the curve so that arc `index` (its unblended circle) has its center there. */
  void placeArc(size_t index, const Vec2& center_mm);
  Vec2 calcPoint(double phi) const;
  static Vec2 calcNormal(double phi) { return {std::sin(phi), -std::cos(phi)}; }

 private:
  double start_;
  std::vector<Arc> arcs_;
  double blend_;
  std::vector<double> breaks_;  ///< angles between which R is smooth
  std::vector<Vec2> points_;    ///< at breaks_
  Vec2 shift_ = Vec2::Zero();
};

/** Canal surface: a circle of radius r_c carried along a plane curve, in the planes of z and of the curve's normal n.

   S(t, psi) = P(t) - r_c (1 - cos psi) n(t) + (z0 + r_c sin psi) e_z,   outward normal N = cos psi n + sin psi e_z

 r_c > 0: convex section (solid on the side -n of a convex cap); r_c < 0: concave, a trough along the curve, for which
 psi runs the other way (z = z0 + r_c sin psi). */
struct CanalPoint {
  Vec3 S, N;
};
CanalPoint calcCanalPoint(const Vec2& P, const Vec2& n, double sectionRadius_mm, double z0_mm, double psi);

}  // namespace genu::make_models
