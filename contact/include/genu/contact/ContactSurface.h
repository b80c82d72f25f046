#pragma once

#include <memory>
#include <vector>

#include "genu/contact/NurbsPatch.h"
#include "genu/contact/QueryStatus.h"

namespace genu::contact {

namespace detail {
struct SurfaceAccess;
}

/** Place on a surface: patch index and parameters. */
struct SurfaceParameter {
  int patch = -1;
  double u = 0, v = 0;
};

struct ClosestPoint {
  SurfaceParameter at;
  Vec3 p_MB = Vec3::Zero();       ///< foot point B, in the surface's frame [m]
  Vec3 normal_M = Vec3::Zero();   ///< unit outward normal at B
  double distance_m = 0;          ///< > 0 outside, < 0 inside the solid
  double residual_m = 0;          ///< largest tangential component of B - Q along S_u, S_v
  QueryStatus status = QueryStatus::notConverged;
  int iterations = 0;
};

/** A closest point with proof: no point of the surface is nearer than lowerBound_m. */
struct CertifiedClosestPoint {
  ClosestPoint foot;
  double lowerBound_m = 0;   ///< of the unsigned distance
  bool certified = false;    ///< lowerBound_m >= |foot.distance_m| - gap_m was reached
};

/** A hit of a straight line. */
struct LineHit {
  double t_m = 0;  ///< distance along the unit direction, any sign
  SurfaceParameter at;
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  ///< unit outward
};

/** The crossing where a ray from a contact element enters the solid, see ContactSurface::findFirstHit. */
struct FirstHit : LineHit {
  double residual_m = 0;  ///< distance of S(u, v) from the line
  HitStatus status = HitStatus::notConverged;
  int iterations = 0;
};

/** The processor instructions the distance queries run with, chosen at the first query: "avx512", "avx2" or "baseline". */
const char* activeInstructionSet();

/** One or more patches of one body, in one frame, with the search structures for distance queries.

 Closest point: min over (u,v) of |S(u,v) - Q|, by Newton with second derivatives, safeguarded by step limits and
 descent, inside the domain box (closed directions wrap), from
   - a seed (warm start): the local minimum at the seed, accepted only where it is provably the global one, i.e. when
     |distance| < safeDistanceInside()/Outside(); otherwise the global search decides;
   - nothing (cold start): best-first search over a hierarchy of boxes around sub-patches. Where hundreds of them are as near, as
     about the centre of a sphere, it ends as notConverged, with an upper bound within a tenth.
 @post if status == converged: |(B-Q).S_u| <= tol |S_u| and the same for v (within a hair of a pole: 1e-10 of the patch's size; at a sharp tip and on a crease the distance is along the connecting line).
 tol is kDefaultTolerance_m, or 8e-16 of the patch's size or of the distance where that is more.
 Immutable and thread-safe. Queries allocate nothing. */
class ContactSurface {
 public:
  static constexpr double kDefaultTolerance_m = 1e-13;  // 1e-10 mm

  /** @throws std::invalid_argument when there is no patch */
  explicit ContactSurface(std::vector<NurbsPatch> patches);
  ~ContactSurface();
  ContactSurface(ContactSurface&&) noexcept;
  ContactSurface& operator=(ContactSurface&&) noexcept;

  int numPatches() const { return static_cast<int>(patches_.size()); }
  const NurbsPatch& patch(int i) const { return patches_[static_cast<size_t>(i)]; }

  ClosestPoint findClosestPoint(const Vec3& p_MQ, const SurfaceParameter* seed = nullptr) const;
  /** Newton from the seed only: the local minimum, no global check. */
  ClosestPoint findLocalClosestPoint(const Vec3& p_MQ, const SurfaceParameter& seed) const;

  /** Global minimum with a certificate, by branch and bound: pieces are split until every one is provably no nearer than
   |distance| - gap_m. The bounds are the convex hulls of Bezier control points, up to rounding (1e-15 of the size). Slow (up to
   milliseconds; it gives up uncertified on the medial axis, where many feet tie) and it allocates: for checks, not for loops.
   @param gap_m > 0 */
  CertifiedClosestPoint findClosestPointCertified(const Vec3& p_MQ, double gap_m = 1e-10) const;

  /** All crossings of the line origin + t direction (unit vector), t in [tMin, tMax], sorted by t; tangential grazes
   may be missed. Appends to `hits` after clearing it. */
  void findLineHits(const Vec3& origin, const Vec3& direction, double tMin_m, double tMax_m,
                    std::vector<LineHit>& hits) const;

  /** Signed ray firing [BF2004 Fig. 3]: the point C where the line A + t n (unit n) enters the solid, outward normal . n < 0.
   t > 0: A is outside and C ahead; t < 0: A is inside and C behind it. C is the crossing next to A, ahead or behind, that
   enters; where both do (a sheet without a far side) the nearer; where neither does the ray misses.
   Newton starts from the seed (a hit of a nearby ray) or near the closest point. Its crossing counts without further search
   where |t| < R cos(theta), R = safeDistanceOutside (t > 0) or Inside (t < 0), cos(theta) = -normal . n: the ball of radius R
   that touches the surface at C on A's side holds no other surface point, and the line within |t| of A runs inside it up
   to C. Otherwise every crossing within |t| of A is looked for, and if there is another, all of them decide. Crossings within
   1e-3 rad of the tangent plane do not count; a line within the surface, or nearly so, ends as notConverged. Across patch
   borders the search goes on along connected edges.
   @post if status == hit: |(S(u, v) - A) x n| <= tol */
  FirstHit findFirstHit(const Vec3& p_MA, const Vec3& direction_M, const SurfaceParameter* seed = nullptr) const;

  /** Radius within which the foot is unique, half of the sampled smallest medial-ball radius: inside the solid, and
   outside (infinite for a convex body). */
  double safeDistanceInside_m() const { return safeInside_m_; }
  double safeDistanceOutside_m() const { return safeOutside_m_; }

  Eigen::AlignedBox3d boundingBox() const { return box_; }

 private:
  friend struct detail::SurfaceAccess;
  struct Search;
  std::vector<NurbsPatch> patches_;
  std::unique_ptr<Search> search_;
  double safeInside_m_ = 0, safeOutside_m_ = 0;
  Eigen::AlignedBox3d box_;
};

}  // namespace genu::contact
