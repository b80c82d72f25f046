#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "SampleMeshes.h"
#include "genu/fit/Frame.h"
#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {
namespace {

using test::messageOf;
using testing::HasSubstr;

TEST(Frame, HalfTurnAboutYMapsAnteriorToPosterior) {
  const Pose X = calcAxesPose(FileAxes::lateral);
  EXPECT_EQ(X.apply({1, 2, 3}), Vec3(-1, 2, -3));
  EXPECT_EQ(calcAxesPose(FileAxes::paper).apply({1, 2, 3}), Vec3(1, 2, 3));
}

TEST(Frame, BoundingBoxPutsTheOriginAtTheBottomCenter) {
  TriangleMesh mesh;
  mesh.vertices = {{1, 5, 10}, {3, 9, 14}, {2, 6, 11}};
  for (const FileAxes axes : {FileAxes::paper, FileAxes::lateral}) {
    const Pose X = calcBoundingBoxFrame(mesh, axes, {});
    EXPECT_LT((X.apply({2, 5, 12})).norm(), 1e-14);
    EXPECT_NEAR(X.apply({2, 9, 12}).y(), 4, 1e-14);
  }
  EXPECT_LT(calcBoundingBoxFrame(mesh, FileAxes::paper, 7.5).apply({2, 7.5, 12}).norm(), 1e-14);
}

// Landmarks made by moving known points of the paper's frame with a known pose must give that pose back.
TEST(Frame, LandmarksRecoverAKnownPose) {
  const Pose X_PM = contact::calcPose({0.3, -0.2, 1.1, 0.01, -0.02, 0.03});
  const auto inMesh = [&](double x, double y, double z) { return X_PM.applyInverse({x, y, z}); };
  Landmarks points;
  points.medial = inMesh(0.001, 0, 0.04);
  points.lateral = inMesh(0.001, 0, -0.038);
  points.center = inMesh(0, 0, 0);
  points.posterior = inMesh(0.03, 0, 0.005);  // not quite along x: made normal to z
  points.anterior = inMesh(-0.03, 0, -0.005);
  const auto expectPose = [](const Pose& a, const Pose& b) {
    EXPECT_LT((a.R - b.R).norm(), 1e-12);
    EXPECT_LT((a.p - b.p).norm(), 1e-14);
  };
  expectPose(calcLandmarkFrame(points, KneeSide::right), X_PM);
  std::swap(points.posterior, points.anterior);  // left knee: x is anterior
  expectPose(calcLandmarkFrame(points, KneeSide::left), X_PM);
  points.anterior = points.posterior = std::nullopt;
  points.superior = inMesh(0, 0.05, 0.01);
  points.inferior = inMesh(0, -0.05, 0);
  expectPose(calcLandmarkFrame(points, KneeSide::right), X_PM);
  points.center = std::nullopt;
  EXPECT_LT((calcLandmarkFrame(points, KneeSide::right).apply(inMesh(0.001, 0, 0.001))).norm(), 1e-14);
}

TEST(Frame, NamesMissingOrUselessLandmarks) {
  Landmarks points;
  const auto message = [&] { return messageOf<InputError>([&] { calcLandmarkFrame(points, KneeSide::right); }); };
  points.medial = Vec3(0, 0, 1);
  EXPECT_THAT(message(), HasSubstr("landmark lateral is missing"));
  points.lateral = Vec3(0, 0, -1);
  EXPECT_THAT(message(), HasSubstr("second direction is missing"));
  points.anterior = Vec3(0, 0, 5);
  points.posterior = Vec3(0, 0, 7);
  EXPECT_THAT(message(), HasSubstr("anterior and posterior"));
  points.superior = Vec3(0, 1, 0);
  points.inferior = Vec3(0, 0, 0);
  EXPECT_THAT(message(), HasSubstr("both given"));
}

TEST(Frame, PrintedPoseReadsBack) {
  for (const Pose& X : {contact::calcPose({0.1, -0.4, 2.2, 0.012, -0.5, 1e-5}), calcAxesPose(FileAxes::lateral)}) {
    const auto parts = io::splitList(formatPose(X));
    ASSERT_EQ(parts.size(), 6u);
    contact::JointCoordinates q{};
    for (size_t i = 0; i < 6; ++i) {
      q[i] = io::parseQuantity(parts[i], i < 3 ? io::Dimension::angle : io::Dimension::length, "pose");
    }
    const Pose back = contact::calcPose(q);
    EXPECT_LT((back.R - X.R).norm(), 1e-15);  // one rounding of each angle
    EXPECT_EQ(back.p, X.p);
  }
}

}  // namespace
}  // namespace genu::fit
