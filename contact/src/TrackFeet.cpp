#include <algorithm>
#include <cmath>

#include "detail/Kernels.h"
#include "detail/PatchKernel.h"
#include "detail/SurfaceSearch.h"
#include "detail/TrackedFoot.h"

namespace genu::contact::detail {

namespace {

void copy(const Vec3& from, double to[3]) { std::copy(from.data(), from.data() + 3, to); }

/** Derivatives of the foot and its normal with respect to the query point. */
void setDerivatives(const NurbsPatch& patch, const SurfaceDerivatives& d, TrackedFoot& foot) {
  const Vec3 r = d.S - Vec3(foot.Q[0], foot.Q[1], foot.Q[2]);
  const double a = d.Su.squaredNorm() + r.dot(d.Suu), b = d.Su.dot(d.Sv) + r.dot(d.Suv), c = d.Sv.squaredNorm() + r.dot(d.Svv);
  const double det = a * c - b * b;
  const Vec3 normal = d.Su.cross(d.Sv);
  const double length = normal.norm();
  // At a pole or a center of curvature the foot has no derivative: no prediction, and no curvature for the stiffness.
  if (!(det > 1e-12 * std::abs(a * c)) || !(length > 1e-9 * std::max(d.Su.squaredNorm(), d.Sv.squaredNorm()))) {
    std::fill(std::begin(foot.duvdQ), std::end(foot.duvdQ), 0.0);
    std::fill(std::begin(foot.nu), std::end(foot.nu), 0.0);
    std::fill(std::begin(foot.nv), std::end(foot.nv), 0.0);
    return;
  }
  copy((c * d.Su - b * d.Sv) / det, foot.duvdQ);
  copy((a * d.Sv - b * d.Su) / det, foot.duvdQ + 3);
  const Vec3 n = normal / length;
  const Vec3 bu = d.Suu.cross(d.Sv) + d.Su.cross(d.Suv), bv = d.Suv.cross(d.Sv) + d.Su.cross(d.Svv);
  const double scale = patch.normalSign() / length;
  copy(scale * (bu - n * n.dot(bu)), foot.nu);
  copy(scale * (bv - n * n.dot(bv)), foot.nv);
}

/** One foot: across patches, from far away, on a border or at a pole. */
void trackFoot(const ContactSurface& surface, const SurfaceAccess::Search& search, const double* q, const TrackedFoot* before,
               TrackedFoot& foot, FootDerivatives derivatives) {
  const TrackedFoot* memory = foot.patch >= 0 ? &foot : before;
  SurfaceParameter seed;
  if (memory != nullptr) {
    const double x = q[0] - memory->Q[0], y = q[1] - memory->Q[1], z = q[2] - memory->Q[2];
    const double* j = memory->duvdQ;
    seed = {memory->patch, memory->u + j[0] * x + j[1] * y + j[2] * z, memory->v + j[3] * x + j[4] * y + j[5] * z};
    SurfaceParameter at = seed;
    FootSearch fast{};
    if (search.solveFast(q, at, derivatives, foot, fast) && search.isSafe(foot.distance_m)) {
      foot.patch = at.patch;
      foot.status = QueryStatus::converged;
      std::copy(q, q + 3, foot.Q);
      return;
    }
  }
  const Vec3 p_MQ(q[0], q[1], q[2]);
  const ClosestPoint found = surface.findClosestPoint(p_MQ, seed.patch >= 0 ? &seed : nullptr);
  foot.patch = found.at.patch;
  foot.u = found.at.u;
  foot.v = found.at.v;
  foot.distance_m = found.distance_m;
  foot.status = found.status;
  copy(p_MQ, foot.Q);
  copy(found.normal_M, foot.normal);
  if (foot.patch >= 0) {
    SurfaceDerivatives d;
    const NurbsPatch& patch = surface.patch(foot.patch);
    evaluatePatch(patch, foot.u, foot.v, d);
    setDerivatives(patch, d, foot);
  }
}

}  // namespace

void trackFeet(const ContactSurface& surface, const double* Q, const int* ids, int count, TrackedFoot* feet, FootDerivatives derivatives) {
  const auto& search = SurfaceAccess::search(surface);
  const SolveFeet solveFeet = activeKernels().solveFeet;
  for (int from = 0; from < count; from += kFeetAtOnce) {
    int left[kFeetAtOnce];
    const int numLeft = solveFeet(search.tables.data(), search.safeInside, search.safeOutside, Q + 3 * from, ids + from,
                                  std::min(kFeetAtOnce, count - from), derivatives, feet, left);
    for (int k = 0; k < numLeft; ++k) {
      const int i = from + left[k];
      // A foot without memory borrows that of the one before it.
      const TrackedFoot* before = i > 0 && feet[ids[i - 1]].patch >= 0 ? &feet[ids[i - 1]] : nullptr;
      trackFoot(surface, search, Q + 3 * i, before, feet[ids[i]], derivatives);
    }
  }
}

}  // namespace genu::contact::detail
