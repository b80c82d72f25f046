#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "SampleMeshes.h"
#include "genu/contact/ContactSurface.h"
#include "genu/fit/SurfaceFit.h"
#include "genu/scene/Scene.h"

namespace genu::fit {
namespace {

using contact::NurbsPatch;
using test::makeSheet;
using test::messageOf;

double dish(double x, double z) { return 60e-3 - std::sqrt(60e-3 * 60e-3 - x * x - 1.4 * z * z); }

/** Outward normals of an arc of a barrel about z: sagittal radius 30 mm, coronal 22 mm, from -40 to 90 degrees. */
TriangleMesh makeBarrel() {
  TriangleMesh mesh = makeSheet(1, 1, 60, 30, [](double, double) { return 0.0; });
  for (Vec3& p : mesh.vertices) {
    const double angle = (25 + 65 * p.x()) * contact::kPi / 180, z = 10e-3 * p.z();
    const double r = 30e-3 - 22e-3 + std::sqrt(22e-3 * 22e-3 - z * z);
    p = Vec3(5e-3 + r * std::sin(angle), -2e-3 - r * std::cos(angle), z);
  }
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);  // up becomes down, which is outward at the bottom
  return mesh;
}

SurfaceFitOptions tight(int points) {
  SurfaceFitOptions options;
  options.maxPointsU = options.maxPointsV = points;
  options.minPointsU = options.minPointsV = std::min(6, points);
  options.toleranceMean_m = options.toleranceMax_m = 1e-12;
  return options;
}

// A bicubic polynomial lies in the space of the patch. What is left is the fairing's pull: 1e-14 times the area times
// the fourth derivatives, far below the 1e-9 m asked here.
TEST(SurfaceFit, ReproducesABicubicSurface) {
  const TriangleMesh mesh = makeSheet(20e-3, 15e-3, 40, 30, [](double x, double z) {
    const double a = x / 20e-3, b = z / 15e-3;
    return 1e-3 * (a + 2 * a * a - a * a * a * b + 3 * a * b * b * b);
  });
  SurfaceFitOptions options = tight(5);
  options.fairing = 1e-14;
  const SurfaceFitResult fit = fitSurface(mesh, options);
  EXPECT_LT(calcStatistics(fit.deviation_m).max_m, 1e-9);
  EXPECT_EQ(fit.uncoveredShare, 0);
  const NurbsPatch patch(fit.patch);
  EXPECT_GT(patch.calcNormal(0.5, 0.5).y(), 0);  // up, as in the mesh
}

// Vertices lie on the dish; facets of edge 1 mm are off it by L^2/(4 R) = 4 um at their centers (diagonal 1.4 mm). The
// patch must be nearer to the true surface than the facets are.
TEST(SurfaceFit, IsCloserToTheTrueSurfaceThanTheFacets) {
  const TriangleMesh mesh = makeSheet(20e-3, 15e-3, 40, 30, dish);
  const SurfaceFitResult fit = fitSurface(mesh, tight(12));
  EXPECT_LT(calcStatistics(fit.deviation_m).max_m, 0.5e-6);
  const NurbsPatch patch(fit.patch);
  double worst = 0;
  for (double u = 0.005; u < 1; u += 0.01) {
    for (double v = 0.005; v < 1; v += 0.01) {
      const Vec3 p = patch.calcPoint(u, v);
      worst = std::max(worst, std::abs(p.y() - dish(p.x(), p.z())));
    }
  }
  EXPECT_LT(worst, 1e-6);
}

TEST(SurfaceFit, MoreKnotsNeverFitWorse) {
  const TriangleMesh mesh = makeSheet(20e-3, 15e-3, 60, 45, [](double x, double z) {
    return dish(x, z) + 0.2e-3 * std::sin(400 * x) * std::cos(300 * z);
  });
  SurfaceFitOptions options = tight(14);
  const SurfaceFitResult fit = fitSurface(mesh, options);
  ASSERT_GT(fit.meanHistory_m.size(), 8u);
  for (size_t i = 1; i < fit.meanHistory_m.size(); ++i) {
    // The knot chosen lowers the fourth powers; the mean may rise a little while the peaks fall.
    EXPECT_LT(fit.meanHistory_m[i], 1.1 * fit.meanHistory_m[i - 1]) << i;
  }
  EXPECT_LT(fit.meanHistory_m.back(), 0.02 * fit.meanHistory_m.front());
  EXPECT_EQ(fit.sizeHistory.back()[0], 14);
  EXPECT_FALSE(fit.toleranceMet);
  EXPECT_EQ(fit.patch.numU, 14);
}

TEST(SurfaceFit, StopsAtTheTolerance) {
  const TriangleMesh mesh = makeSheet(20e-3, 15e-3, 40, 30, dish);
  SurfaceFitOptions options;
  options.toleranceMean_m = 5e-6;
  options.toleranceMax_m = 50e-6;
  const SurfaceFitResult fit = fitSurface(mesh, options);
  EXPECT_TRUE(fit.toleranceMet);
  EXPECT_LE(fit.patch.numU * fit.patch.numV, 49);
}

TEST(SurfaceFit, WrapsAroundACondyle) {
  const TriangleMesh mesh = makeBarrel();
  SurfaceFitOptions options = tight(14);
  options.parametrization = fitCondyleAxis(mesh);
  // The coronal curve takes up to 2.4 mm off the radius, which biases the circle: the axis only has to be near.
  EXPECT_NEAR(options.parametrization.axis_m.x(), 5e-3, 0.5e-3);
  EXPECT_NEAR(options.parametrization.axis_m.y(), -2e-3, 0.5e-3);
  const SurfaceFitResult fit = fitSurface(mesh, options);
  EXPECT_LT(calcStatistics(fit.deviation_m).max_m, 2e-6);
  const NurbsPatch patch(fit.patch);
  for (const double u : {0.0, 0.3, 0.6, 1.0}) {
    const Vec3 p = patch.calcPoint(u, 0.5);
    const Vec3 radial(p.x() - 5e-3, p.y() + 2e-3, 0);
    EXPECT_GT(patch.calcNormal(u, 0.5).dot(radial.normalized()), 0.99) << u;
  }
}

TEST(SurfaceFit, FindsTheAxisOfACylinder) {
  TriangleMesh mesh = makeBarrel();
  for (Vec3& p : mesh.vertices) {
    const double angle = std::atan2(p.x() - 5e-3, -(p.y() + 2e-3));
    p = Vec3(5e-3 + 30e-3 * std::sin(angle), -2e-3 - 30e-3 * std::cos(angle), p.z());
  }
  const Parametrization axis = fitCondyleAxis(mesh);
  EXPECT_LT((axis.axis_m - Vec2(5e-3, -2e-3)).norm(), 1e-12);
  EXPECT_NEAR(axis.radius_m, 30e-3, 1e-12);
  EXPECT_NEAR(axis.calcAngle({35e-3, -2e-3, 0}), contact::kPi / 2, 1e-9);  // +x is a quarter turn from distal
}

TEST(SurfaceFit, NormalFollowsTheMesh) {
  TriangleMesh mesh = makeBarrel();
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  SurfaceFitOptions options = tight(10);
  options.parametrization = fitCondyleAxis(mesh);
  const NurbsPatch patch(fitSurface(mesh, options).patch);
  EXPECT_GT(patch.calcNormal(0.5, 0.5).dot(Vec3(5e-3, -2e-3, 0) - patch.calcPoint(0.5, 0.5)), 0);
}

// Independent noise of sd s on n vertices, fitted with m free heights, leaves an error of s sqrt(m/n) on average over
// the surface: 10 um sqrt(100/2501) = 2 um. The bound allows twice that.
TEST(SurfaceFit, AveragesNoise) {
  TriangleMesh mesh = makeSheet(20e-3, 15e-3, 60, 40, dish);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 10e-6);
  for (Vec3& p : mesh.vertices) p.y() += noise(random);
  const SurfaceFitResult fit = fitSurface(mesh, tight(10));
  const NurbsPatch patch(fit.patch);
  double squares = 0;
  int count = 0;
  for (double u = 0.01; u < 1; u += 0.02) {
    for (double v = 0.01; v < 1; v += 0.02, ++count) {
      const Vec3 p = patch.calcPoint(u, v);
      squares += std::pow(p.y() - dish(p.x(), p.z()), 2);
    }
  }
  EXPECT_LT(std::sqrt(squares / count), 4e-6);
  EXPECT_NEAR(calcStatistics(fit.deviation_m).rms_m, 10e-6, 1e-6);
}

// A dish rises towards its border. Where the mesh ends the patch must not go on rising into the other body.
TEST(SurfaceFit, FallsAwayBeyondTheMesh) {
  const TriangleMesh whole = makeSheet(20e-3, 20e-3, 50, 50, dish);
  std::vector<char> keep(whole.triangles.size(), 1);
  for (size_t t = 0; t < keep.size(); ++t) {
    for (const int i : whole.triangles[t]) {
      if (whole.vertices[static_cast<size_t>(i)].cwiseProduct(Vec3(1, 0, 1)).norm() > 20e-3) keep[t] = 0;
    }
  }
  const TriangleMesh round = extractTriangles(whole, keep);
  SurfaceFitOptions options = tight(12);
  const SurfaceFitResult fit = fitSurface(round, options);
  // Corners of a square around a disk: 1 - pi/4 = 21.5 % in projection.
  EXPECT_NEAR(fit.uncoveredShare, 0.215, 0.05);
  const NurbsPatch patch(fit.patch);
  for (const double u : {0.0, 1.0}) {
    for (const double v : {0.0, 1.0}) {
      const Vec3 p = patch.calcPoint(u, v);
      EXPECT_LT(p.y(), dish(p.x(), p.z())) << u << ' ' << v;
      EXPECT_GT(p.cwiseProduct(Vec3(1, 0, 1)).norm(), 24e-3);
    }
  }
  EXPECT_LT(calcStatistics(fit.deviation_m).mean_m, 3e-6);
}

TEST(SurfaceFit, RefusesWhatCannotBeFitted) {
  SurfaceFitOptions options;
  EXPECT_THAT(messageOf<InputError>([&] { fitSurface(makeSheet(1e-2, 1e-2, 4, 4, dish), options); }),
              testing::HasSubstr("25 vertices; needed: at least 72"));
  // A tube lies over itself when laid out along x and z.
  TriangleMesh tube = makeSheet(1, 1, 40, 10, dish);
  for (Vec3& p : tube.vertices) p = Vec3(20e-3 * std::sin(3 * p.x()), 20e-3 * std::cos(3 * p.x()), 10e-3 * p.z());
  EXPECT_THAT(messageOf<InputError>([&] { fitSurface(tube, options); }), testing::HasSubstr("folds over itself"));
  options.maxPointsU = 3;
  EXPECT_THAT(messageOf<InputError>([&] { fitSurface(tube, options); }), testing::HasSubstr("at least 4"));
}

TEST(SurfaceFit, HandsBackWhatItHasWhenAskedToStop) {
  const TriangleMesh mesh = makeSheet(20e-3, 15e-3, 40, 30, dish);
  const SurfaceFitResult fit = fitSurface(mesh, tight(14), [](double) { return false; });
  EXPECT_TRUE(fit.stopped);
  EXPECT_EQ(fit.patch.numU, 6);
  EXPECT_NO_THROW(NurbsPatch{fit.patch});
}

TEST(Statistics, OfKnownNumbers) {
  const DeviationStatistics s = calcStatistics({-1, 1, 3, -3});
  EXPECT_EQ(s.count, 4);
  EXPECT_DOUBLE_EQ(s.max_m, 3);
  EXPECT_DOUBLE_EQ(s.mean_m, 2);
  EXPECT_DOUBLE_EQ(s.sd_m, 1);
  EXPECT_DOUBLE_EQ(s.rms_m, std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(s.signedMean_m, 0);
  EXPECT_DOUBLE_EQ(s.signedSd_m, std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(s.signedMin_m, -3);
  EXPECT_EQ(calcStatistics({}).count, 0);
}

}  // namespace
}  // namespace genu::fit
