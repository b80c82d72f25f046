#include "genu/contact/Types.h"

#include <cmath>

namespace genu::contact {

Pose calcPose(const JointCoordinates& q) {
  const double cx = std::cos(q[0]), sx = std::sin(q[0]);
  const double cy = std::cos(q[1]), sy = std::sin(q[1]);
  const double cz = std::cos(q[2]), sz = std::sin(q[2]);
  Pose X;
  X.R << cy * cz, -cy * sz, sy,                                  //
      cx * sz + sx * sy * cz, cx * cz - sx * sy * sz, -sx * cy,  //
      sx * sz - cx * sy * cz, sx * cz + cx * sy * sz, cx * cy;
  X.p = Vec3(q[3], q[4], q[5]);
  return X;
}

SpatialVelocity calcSpatialVelocity(const JointCoordinates& q, const JointCoordinates& qdot) {
  const double cx = std::cos(q[0]), sx = std::sin(q[0]);
  const double cy = std::cos(q[1]), sy = std::sin(q[1]);
  // The three axes in F: x of F, then y after the first turn, then z after the second.
  SpatialVelocity V;
  V.w_FM = qdot[0] * Vec3::UnitX() + qdot[1] * Vec3(0, cx, sx) + qdot[2] * Vec3(sy, -sx * cy, cx * cy);
  V.v_FMo = Vec3(qdot[3], qdot[4], qdot[5]);
  return V;
}

JointCoordinates calcCoordinates(const Pose& X) {
  JointCoordinates q{};
  const double sy = std::min(1.0, std::max(-1.0, X.R(0, 2)));
  const double cy = std::hypot(X.R(0, 0), X.R(0, 1));
  q[1] = std::atan2(sy, cy);
  if (cy > 1e-12) {
    q[0] = std::atan2(-X.R(1, 2), X.R(2, 2));
    q[2] = std::atan2(-X.R(0, 1), X.R(0, 0));
  } else {  // gimbal lock: only rx +- rz is defined
    q[0] = std::atan2(X.R(2, 1), X.R(1, 1));
    q[2] = 0;
  }
  q[3] = X.p.x();
  q[4] = X.p.y();
  q[5] = X.p.z();
  return q;
}

}  // namespace genu::contact
