// Ray firing: first hits of lines through contact elements, against closed forms and the search for all crossings.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "contact/Scenes.h"
#include "contact/SplitPatch.h"
#include "contact/TestSurfaces.h"
#include "detail/Kernels.h"
#include "detail/TrackedHit.h"

namespace genu::contact {
namespace {

using detail::TrackedHit;

ContactSurface makeSurface(const NurbsPatchData& data) {
  std::vector<NurbsPatch> patches;
  patches.emplace_back(data);
  return ContactSurface(std::move(patches));
}

std::vector<TrackedHit> makeHits(size_t count) {
  std::vector<TrackedHit> hits(count);
  for (TrackedHit& hit : hits) hit.patch = -1;
  return hits;
}

/** Rays through points within `range` of the surface, against the outward normal and turned by up to about `tilt`. */
struct Rays {
  std::vector<double> A, n;
  std::vector<int> ids;
  void add(const Vec3& a, const Vec3& direction) {
    A.insert(A.end(), a.data(), a.data() + 3);
    n.insert(n.end(), direction.data(), direction.data() + 3);
    ids.push_back(static_cast<int>(ids.size()));
  }
  Vec3 origin(size_t i) const { return Vec3(A[3 * i], A[3 * i + 1], A[3 * i + 2]); }
  Vec3 direction(size_t i) const { return Vec3(n[3 * i], n[3 * i + 1], n[3 * i + 2]); }
};

Rays makeRays(const NurbsPatch& patch, int count, double range, double tilt, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(0.05, 0.95), v(0.05, 0.95), t(-range, range);
  std::normal_distribution<double> unit(0, 1);
  Rays rays;
  for (int i = 0; i < count; ++i) {
    const double uu = patch.uMin() + u(random) * (patch.uMax() - patch.uMin());
    const double vv = patch.vMin() + v(random) * (patch.vMax() - patch.vMin());
    const Vec3 n = (-patch.calcNormal(uu, vv) + tilt * Vec3(unit(random), unit(random), unit(random))).normalized();
    rays.add(patch.calcPoint(uu, vv) - t(random) * n, n);
  }
  return rays;
}

/** The rule of findFirstHit applied to all crossings; NaN: missed. */
double chooseFirst(const std::vector<LineHit>& all, const Vec3& n) {
  const LineHit *ahead = nullptr, *behind = nullptr;
  for (const LineHit& h : all) {  // sorted
    if (h.t_m < 0) behind = &h;
    if (h.t_m >= 0 && ahead == nullptr) ahead = &h;
  }
  if (ahead != nullptr && !(ahead->normal.dot(n) < 0)) ahead = nullptr;
  if (behind != nullptr && !(behind->normal.dot(n) < 0)) behind = nullptr;
  if (ahead == nullptr && behind == nullptr) return std::nan("");
  if (behind == nullptr || (ahead != nullptr && ahead->t_m <= -behind->t_m)) return ahead->t_m;
  return behind->t_m;
}

double smallestCosine(const std::vector<LineHit>& all, const Vec3& n) {
  double smallest = 1;
  for (const LineHit& h : all) smallest = std::min(smallest, std::abs(h.normal.dot(n)));
  return smallest;
}

// A rigid sphere has every answer in closed form: with b = n.(O - A) and w^2 = R^2 - |O - A|^2 + b^2 the line enters at
// t = b - w, from the outside only if that is ahead.
TEST(FirstHit, SphereInClosedForm) {
  const double R = 0.03;
  const ContactSurface sphere(makeSphere(R));
  std::mt19937 random(1);
  std::normal_distribution<double> unit(0, 1);
  std::uniform_real_distribution<double> radius(0, 0.06);
  int hits = 0, misses = 0, inside = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3 A = radius(random) * Vec3(unit(random), unit(random), unit(random)).normalized();
    const Vec3 n = Vec3(unit(random), unit(random), unit(random)).normalized();
    const double b = -n.dot(A), square = R * R - A.squaredNorm() + b * b;
    const bool isInside = A.norm() < R;
    // A ray within 1e-2 of the tangent is another test's; the origin within 1e-9 m of the surface is either side's.
    if (std::abs(square) < 1e-4 * R * R || std::abs(A.norm() - R) < 1e-9) continue;
    const FirstHit hit = sphere.findFirstHit(A, n);
    const double t = square > 0 ? b - std::sqrt(square) : 0;
    if (square < 0 || (!isInside && t < 0)) {
      EXPECT_EQ(hit.status, HitStatus::missed) << A.transpose() << " | " << n.transpose();
      ++misses;
      continue;
    }
    ASSERT_EQ(hit.status, HitStatus::hit) << A.transpose() << " | " << n.transpose();
    // The residual across the ray is 1e-13 m (1e-11 where Newton ends at the resolution of (u, v)); along it that makes
    // at most residual^2 / (R cos^3) plus roundings of 60 mm.
    ASSERT_NEAR(hit.t_m, t, 1e-13);
    ASSERT_LT(((hit.point - A).cross(n)).norm(), 1.01e-11);
    ASSERT_LT((hit.normal - hit.point / R).norm(), 1e-7);  // at the poles of the sphere the normal is a limit
    ASSERT_LT(hit.normal.dot(n), 0);
    inside += isInside;
    ++hits;
  }
  EXPECT_GT(hits, 5000);
  EXPECT_GT(misses, 5000);
  EXPECT_GT(inside, 2000);
}

class Ray : public testing::TestWithParam<bool> {};

TEST_P(Ray, IsTheChoiceAmongAllCrossings) {
  std::vector<LineHit> all;
  int agreed = 0, missed = 0, behind = 0, several = 0;
  // With waves of 8 mm the surface is far from convex and a ray may cross it four times and more.
  for (const double wave : {0.0003, 0.008})
    for (const double range : {0.002, 0.02, 0.06}) {
      const ContactSurface surface = makeSurface(test::makeCondyle(GetParam(), wave, 25, 25));
      const Rays rays = makeRays(surface.patch(0), 1500, range, wave > 0.001 ? 1.0 : 0.4, 11);
      for (size_t i = 0; i < rays.ids.size(); ++i) {
        const Vec3 A = rays.origin(i), n = rays.direction(i);
        surface.findLineHits(A, n, -1, 1, all);
        // findLineHits may miss one of a pair of crossings near tangency.
        if (smallestCosine(all, n) < 0.2) continue;
        const double expected = chooseFirst(all, n);
        const FirstHit hit = surface.findFirstHit(A, n);
        if (std::isnan(expected)) {
          EXPECT_EQ(hit.status, HitStatus::missed) << range << " " << i;
          ++missed;
          continue;
        }
        ASSERT_EQ(hit.status, HitStatus::hit) << range << " " << i;
        // Residuals of 1e-13 m each, along the ray times tan(theta) <= 5.
        ASSERT_NEAR(hit.t_m, expected, 1e-12) << range << " " << i;
        ASSERT_LE((hit.point - A).cross(n).norm(), 1.01e-11);
        behind += hit.t_m < 0;
        several += all.size() > 2;
        ++agreed;
      }
    }
  EXPECT_GT(agreed, 6000);
  EXPECT_GT(several, 100);
  EXPECT_GT(behind, 1000);
  EXPECT_GT(missed, 0);
}

TEST_P(Ray, EveryInstructionSetGivesTheSameHit) {
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam()));
  const Rays rays = makeRays(surface.patch(0), 3000, 0.002, 0.2, 12);
  ASSERT_TRUE(detail::forceInstructionSet("baseline"));
  std::vector<FirstHit> expected;
  for (size_t i = 0; i < rays.ids.size(); ++i) expected.push_back(surface.findFirstHit(rays.origin(i), rays.direction(i)));
  for (const char* name : {"avx2", "avx512"}) {
    if (!detail::forceInstructionSet(name)) continue;
    for (size_t i = 0; i < rays.ids.size(); ++i) {
      const FirstHit hit = surface.findFirstHit(rays.origin(i), rays.direction(i));
      ASSERT_EQ(hit.status, expected[i].status);
      if (hit.status != HitStatus::hit) continue;
      // Both are within 1e-13 m of the line; along the surface that grows by 1/cos(theta) < 10.
      ASSERT_NEAR(hit.t_m, expected[i].t_m, 1e-13) << name;
      ASSERT_LT((hit.point - expected[i].point).norm(), 2e-12) << name;
    }
  }
  EXPECT_TRUE(detail::forceInstructionSet(nullptr));
}

TEST_P(Ray, WarmEqualsColdWhileTheRaysWander) {
  // Waves of 8 mm and rays of up to 6 mm: the seed's crossing often is not the first, and both ways of the rule are taken.
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam(), 0.008, 25, 25));
  Rays rays = makeRays(surface.patch(0), 200, 0.006, 0.6, 13);
  std::reverse(rays.ids.begin(), rays.ids.end());
  std::vector<TrackedHit> hits = makeHits(rays.ids.size());
  std::mt19937 random(14);
  std::normal_distribution<double> unit(0, 1);
  std::uniform_real_distribution<double> exponent(-8, -2.5);
  int compared = 0, missed = 0;
  for (int step = 0; step < 60; ++step) {
    detail::trackHits(surface, rays.A.data(), rays.n.data(), rays.ids.data(), static_cast<int>(rays.ids.size()), hits.data());
    for (size_t i = 0; i < rays.ids.size(); ++i) {
      const TrackedHit& hit = hits[static_cast<size_t>(rays.ids[i])];
      const Vec3 A = rays.origin(i), n = rays.direction(i);
      const FirstHit cold = surface.findFirstHit(A, n);
      ASSERT_EQ(hit.status, cold.status) << step << " " << i;
      if (cold.status != HitStatus::hit) {
        ++missed;
        continue;
      }
      const Vec3 C(hit.p_MC[0], hit.p_MC[1], hit.p_MC[2]), normal(hit.normal[0], hit.normal[1], hit.normal[2]);
      const double cosine = -normal.dot(n);
      ASSERT_NEAR(hit.t_m, cold.t_m, 1e-13 + 2e-15 / (cosine * cosine * cosine)) << step << " " << i;
      ASSERT_LT((C - cold.point).norm(), 1e-11);
      const auto d = surface.patch(hit.patch).evaluate(hit.u, hit.v);
      ASSERT_LT((d.S - C).norm(), 1e-14);  // the Taylor step agrees with an evaluation
      ++compared;
    }
    const double length = std::pow(10, exponent(random));  // from 10 nm to 3 mm, and the turn that goes with 30 mm
    for (size_t i = 0; i < rays.ids.size(); ++i) {
      Vec3 n = rays.direction(i) + length / 0.03 * Vec3(unit(random), unit(random), unit(random));
      n.normalize();
      for (size_t k = 0; k < 3; ++k) {
        rays.A[3 * i + k] += 0.3 * length * unit(random);
        rays.n[3 * i + k] = n[static_cast<Eigen::Index>(k)];
      }
    }
  }
  EXPECT_GT(compared, 6000);
  EXPECT_GT(missed, 0);
}

TEST_P(Ray, DerivativesAreThoseOfTheHit) {
  const ContactSurface surface = makeSurface(test::makeCondyle(GetParam()));
  const Rays rays = makeRays(surface.patch(0), 200, 0.001, 0.2, 15);
  std::vector<TrackedHit> hits = makeHits(rays.ids.size());
  detail::trackHits(surface, rays.A.data(), rays.n.data(), rays.ids.data(), static_cast<int>(rays.ids.size()), hits.data());
  const double h = 1e-6;
  int checked = 0;
  for (size_t i = 0; i < rays.ids.size(); ++i) {
    const TrackedHit& hit = hits[i];
    if (hit.status != HitStatus::hit) continue;
    const Vec3 A = rays.origin(i), n = rays.direction(i), normal(hit.normal[0], hit.normal[1], hit.normal[2]);
    const SurfaceParameter seed{hit.patch, hit.u, hit.v};
    for (int k = 0; k < 6; ++k) {
      const Vec3 dA = k < 3 ? Vec3(Vec3::Unit(k)) : Vec3(Vec3::Zero());
      // A direction stays of unit length to first order only when it turns across itself.
      const Vec3 dn = k < 3 ? Vec3(Vec3::Zero()) : Vec3(Vec3::Unit(k - 3) - n * n[k - 3]);
      const auto high = surface.findFirstHit(A + h * dA, (n + h * dn).normalized(), &seed);
      const auto low = surface.findFirstHit(A - h * dA, (n - h * dn).normalized(), &seed);
      ASSERT_EQ(high.status, HitStatus::hit);
      ASSERT_EQ(low.status, HitStatus::hit);
      const Vec3 moved = dA + hit.t_m * dn;
      const Vec3 gu(hit.duvdA[0], hit.duvdA[1], hit.duvdA[2]), gv(hit.duvdA[3], hit.duvdA[4], hit.duvdA[5]);
      // Rounding: 1e-13 m over 2e-6 m is 1e-7 of dt, 3e-6 of du ~ 30/m. Second order: h^2 times third derivatives, ~1e-8.
      ASSERT_NEAR((high.t_m - low.t_m) / (2 * h), -normal.dot(moved) / normal.dot(n), 1e-6);
      ASSERT_NEAR((high.at.u - low.at.u) / (2 * h), gu.dot(moved), 1e-4);
      ASSERT_NEAR((high.at.v - low.at.v) / (2 * h), gv.dot(moved), 1e-4);
      const Vec3 turned =
          Vec3(hit.nu[0], hit.nu[1], hit.nu[2]) * gu.dot(moved) + Vec3(hit.nv[0], hit.nv[1], hit.nv[2]) * gv.dot(moved);
      ASSERT_LT(((high.normal - low.normal) / (2 * h) - turned).norm(), 2e-3);  // of about 50/m
      ++checked;
    }
  }
  EXPECT_GT(checked, 1000);
}

INSTANTIATE_TEST_SUITE_P(PolynomialAndRational, Ray, testing::Bool());

TEST(RayBorders, ASplitCondyleHasTheHitsOfTheWholeOne) {
  const NurbsPatchData whole = test::makeCondyle(false);
  const ContactSurface surface = makeSurface(whole);
  for (const int pieces : {2, 4}) {
    const ContactSurface split(test::splitBothWays(whole, pieces));
    std::vector<TrackedHit> hits = makeHits(1);
    const int id = 0;
    int crossings = 0, last = -1;
    for (int i = 0; i <= 4000; ++i) {
      const double a = 2 * kPi * i / 4000, u = 0.5 + 0.4 * std::sin(3 * a), v = 0.8 * std::cos(2 * a),
                   t = 0.0008 * std::sin(5 * a);
      const Vec3 C = surface.patch(0).calcPoint(u, v);
      const Vec3 n = (-surface.patch(0).calcNormal(u, v) + 0.2 * Vec3(std::sin(a), std::cos(a), std::sin(7 * a))).normalized();
      const Vec3 A = C - t * n;
      detail::trackHits(split, A.data(), n.data(), &id, 1, hits.data());
      ASSERT_EQ(hits[0].status, HitStatus::hit) << pieces << " " << i;
      // The ray was made to hit C, and nothing of the surface is nearer to A along it.
      ASSERT_NEAR(hits[0].t_m, t, 1e-13) << pieces << " " << i;
      ASSERT_LT((C - Vec3(hits[0].p_MC[0], hits[0].p_MC[1], hits[0].p_MC[2])).norm(), 1e-12);
      const FirstHit cold = split.findFirstHit(A, n);
      ASSERT_EQ(cold.status, HitStatus::hit);
      ASSERT_NEAR(cold.t_m, t, 1e-13);
      crossings += last >= 0 && hits[0].patch != last;
      last = hits[0].patch;
    }
    EXPECT_GE(crossings, 8);
  }
}

TEST(FirstHit, NearTangencyItIsTheEnteringCrossingOrNone) {
  // Lines that pass a sphere at R (1 - x) from its centre: for x > 0 they enter with cos(theta) = sqrt(2 x - x^2).
  const double R = 0.03;
  const ContactSurface sphere(makeSphere(R));
  std::mt19937 random(3);
  std::normal_distribution<double> unit(0, 1);
  for (const double x : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, -1e-5, -1e-4, -1e-3, -1e-2}) {
    for (int i = 0; i < 200; ++i) {
      const Vec3 n = Vec3(unit(random), unit(random), unit(random)).normalized();
      const Vec3 across = n.cross(Vec3(unit(random), unit(random), unit(random))).normalized();
      const Vec3 A = R * (1 - x) * across - 0.04 * n;
      const FirstHit hit = sphere.findFirstHit(A, n);
      if (x < 0) {
        ASSERT_EQ(hit.status, HitStatus::missed) << x;
        continue;
      }
      ASSERT_EQ(hit.status, HitStatus::hit) << x << " " << i;
      const double cosine = std::sqrt(2 * x - x * x);
      // A residual across the ray moves the crossing along it by residual * tan(theta).
      ASSERT_NEAR(hit.t_m, 0.04 - R * cosine, 1e-13 + 1.1e-11 / cosine) << x;
    }
  }
}

TEST(FirstHit, BadInputIsAStatus) {
  const ContactSurface sphere(makeSphere(0.03));
  const double nan = std::nan("");
  EXPECT_EQ(sphere.findFirstHit(Vec3(nan, 0, 0), Vec3::UnitY()).status, HitStatus::notConverged);
  EXPECT_EQ(sphere.findFirstHit(Vec3(0, 0.04, 0), Vec3(0, nan, 0)).status, HitStatus::notConverged);
  EXPECT_EQ(sphere.findFirstHit(Vec3(0, 0.04, 0), Vec3::Zero()).status, HitStatus::notConverged);
}

TEST(FirstHit, LinesWithinASurfaceEndWithoutAnAnswer) {
  // They meet every piece at every depth of splitting: without a limit one query takes minutes.
  const auto expectDoubt = [](const ContactSurface& surface, const Vec3& A, const Vec3& n) {
    const FirstHit hit = surface.findFirstHit(A, n);
    EXPECT_EQ(hit.status, HitStatus::notConverged);
    EXPECT_LE(hit.iterations, 250000);
  };
  expectDoubt(ContactSurface(makePlane(0, 0, 0, Solid::above, 0.05)), Vec3(0.013, 0, 0.007), Vec3(0.6, 0, 0.8));
  expectDoubt(ContactSurface(makeCylinder(0.03, 0.1)), Vec3(0.018, 0.024, 0.2), Vec3::UnitZ());
  NurbsPatchData d;  // a patch without area
  d.degreeU = d.degreeV = 1;
  d.numU = d.numV = 2;
  d.knotsU = d.knotsV = {0, 0, 1, 1};
  d.points = {Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(0.01, 0, 0), Vec3(0.01, 0, 0)};
  std::vector<NurbsPatch> patches;
  patches.emplace_back(d);
  const ContactSurface collapsed(std::move(patches));
  expectDoubt(collapsed, Vec3(0.002, 0.1, 0), Vec3::UnitY());
  expectDoubt(collapsed, Vec3(0.1, 0, 0), Vec3::UnitX());
}

}  // namespace
}  // namespace genu::contact
