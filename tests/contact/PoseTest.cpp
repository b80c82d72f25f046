#include <gtest/gtest.h>

#include <random>

#include "genu/contact/Types.h"

namespace genu::contact {
namespace {

TEST(Pose, IsBodyThree123) {
  const JointCoordinates q = {0.3, -0.4, 0.9, 1, 2, 3};
  const Mat3 expected = (Eigen::AngleAxisd(0.3, Vec3::UnitX()) * Eigen::AngleAxisd(-0.4, Vec3::UnitY()) *
                         Eigen::AngleAxisd(0.9, Vec3::UnitZ()))
                            .toRotationMatrix();
  const Pose X = calcPose(q);
  EXPECT_LT((X.R - expected).norm(), 1e-15 * 10);
  EXPECT_EQ(X.p, Vec3(1, 2, 3));
}

TEST(Pose, CoordinatesRoundTrip) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(-3.1, 3.1), tilt(-1.5, 1.5);
  for (int i = 0; i < 1000; ++i) {
    const JointCoordinates q = {angle(random), tilt(random), angle(random), 0.1, 0.2, 0.3};
    const JointCoordinates back = calcCoordinates(calcPose(q));
    // Rounding of 1e-16 in R grows by 1/cos(ry) <= 15.
    for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(back[k], q[k], 1e-13);
  }
}

TEST(Pose, GimbalLockStillGivesTheRotation) {
  const Pose X = calcPose({0.4, 0.5 * kPi, 0.3, 0, 0, 0});
  EXPECT_LT((calcPose(calcCoordinates(X)).R - X.R).norm(), 1e-14);
}

TEST(Pose, VelocityIsTheDerivativeOfThePose) {
  const JointCoordinates q = {0.3, -0.4, 0.9, 1, 2, 3}, rate = {0.5, -0.2, 0.7, 0.1, 0.2, 0.3};
  const double dt = 1e-6;
  JointCoordinates before = q, after = q;
  for (size_t k = 0; k < 6; ++k) {
    before[k] -= dt * rate[k];
    after[k] += dt * rate[k];
  }
  const Mat3 Rdot = (calcPose(after).R - calcPose(before).R) / (2 * dt);
  const Mat3 W = Rdot * calcPose(q).R.transpose();  // skew matrix of w_FM
  const SpatialVelocity V = calcSpatialVelocity(q, rate);
  // Central difference: dt^2 |R'''| / 6 ~ 1e-12 plus rounding 1e-16 / dt ~ 1e-10.
  EXPECT_LT((Vec3(W(2, 1), W(0, 2), W(1, 0)) - V.w_FM).norm(), 1e-9);
  EXPECT_EQ(V.v_FMo, Vec3(0.1, 0.2, 0.3));
}

}  // namespace
}  // namespace genu::contact
