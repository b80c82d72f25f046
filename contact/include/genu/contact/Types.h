#pragma once

/** Units and frames used everywhere in `contact/`.

 Units: SI (m, N, Pa, rad, J). A name ends in its unit where it could be mistaken (`_m`, `_Pa`).
 Frames: F fixed body (tibia, tibial insert), M moving body (femur, femoral component).
   +y superior, +z medial, x = y cross z.
   `p_FA`    position of A from Fo, expressed in F [m]
   `f_M_F`   force on M, expressed in F [N]
   `X_FM`    pose of M in F: p_FA = R_FM p_MA + p_FMo
 Signed distance is > 0 outside the moving solid; penetration d = -signed distance is > 0 in contact. */

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

namespace genu::contact {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

inline constexpr double kPi = 3.14159265358979323846;

/** Pose of one frame in another: `apply(p_B) = R_AB p_B + p_AB`. */
struct Pose {
  Mat3 R = Mat3::Identity();
  Vec3 p = Vec3::Zero();

  Vec3 apply(const Vec3& point) const { return R * point + p; }
  /** Maps a point the other way: R^T (point - p). */
  Vec3 applyInverse(const Vec3& point) const { return R.transpose() * (point - p); }
  Pose operator*(const Pose& other) const { return {R * other.R, R * other.p + p}; }
  Pose inverse() const { return {R.transpose(), -(R.transpose() * p)}; }
};

/** The six coordinates of the joint [BF2004 §2.4], in this order:
 (rx, ry, rz) [rad], body-three 1-2-3 sequence, then (x, y, z) [m], position of Mo from Fo in F.
 For a right knee: rx > 0 varus, ry > 0 femur internally rotated, rz < 0 flexion; x posterior. */
using JointCoordinates = std::array<double, 6>;

/** R_FM = Rx(q0) Ry(q1) Rz(q2), p_FMo = (q3, q4, q5). */
Pose calcPose(const JointCoordinates& q);

/** Angular velocity of M in F and velocity of Mo in F, both expressed in F, from coordinates and rates. */
struct SpatialVelocity {
  Vec3 w_FM = Vec3::Zero();   ///< [rad/s]
  Vec3 v_FMo = Vec3::Zero();  ///< [m/s]
};
SpatialVelocity calcSpatialVelocity(const JointCoordinates& q, const JointCoordinates& qdot);

/** Inverse of calcPose; ry in [-pi/2, pi/2]. At gimbal lock (|ry| = pi/2) rz is set to 0. */
JointCoordinates calcCoordinates(const Pose& X_FM);

}  // namespace genu::contact
