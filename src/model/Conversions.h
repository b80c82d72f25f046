#pragma once

#include <Simbody.h>

#include "genu/contact/Types.h"

namespace genu::model {

inline SimTK::Vec3 toSimTK(const contact::Vec3& v) { return {v[0], v[1], v[2]}; }
inline contact::Vec3 toEigen(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

inline SimTK::Transform toSimTK(const contact::Pose& X) {
  const SimTK::Mat33 R(X.R(0, 0), X.R(0, 1), X.R(0, 2), X.R(1, 0), X.R(1, 1), X.R(1, 2), X.R(2, 0), X.R(2, 1),
                       X.R(2, 2));
  return {SimTK::Rotation(R, true), toSimTK(X.p)};
}

inline contact::Pose toPose(const SimTK::Transform& X) {
  contact::Pose pose;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.R(i, j) = X.R()[i][j];
  }
  pose.p = toEigen(X.p());
  return pose;
}

}  // namespace genu::model
