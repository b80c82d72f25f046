// Ray firing: where the line through a contact element enters the moving solid.

#include <algorithm>
#include <cmath>
#include <limits>

#include "detail/BezierHull.h"
#include "detail/Kernels.h"
#include "detail/PatchKernel.h"
#include "detail/SurfaceSearch.h"
#include "detail/TrackedHit.h"

namespace genu::contact {

bool ContactSurface::Search::solveFastRay(const double* A, const double* n, SurfaceParameter& at, bool derivatives,
                                          detail::RayHit& hit, int& iterations, bool& safe) const {
  const detail::SolveRay solve = detail::activeKernels().solveRay;
  hit.u = at.u;
  hit.v = at.v;
  constexpr int kHops = 4;
  for (int hop = 0; hop <= kHops; ++hop) {
    const detail::FootOutcome outcome = solve(tables[static_cast<size_t>(at.patch)], A, n, derivatives, hit);
    iterations += hit.iterations;
    if (outcome == detail::FootOutcome::found) {
      at.u = hit.u;
      at.v = hit.v;
      // |t| < R cos(theta), see findFirstHit.
      safe = std::abs(hit.t_m) < (hit.t_m < 0 ? safeInside : safeOutside) * hit.cosTheta;
      return true;
    }
    if (outcome == detail::FootOutcome::failed || !crossEdge(at, hit.u, hit.v)) return false;
  }
  return false;
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kGrazing = 1e-3;  // |normal . n| of a crossing that counts

/** A crossing of either sense. */
struct Crossing {
  double t = 0, side = 0;  // side: normal . n, < 0 entering
  SurfaceParameter at;
  SurfaceDerivatives d;
  Vec3 normal = Vec3::Zero();
  double residual = 0;
};

enum class LeafEnd { found, left, failed };

/** The line, and the nearest crossings on both sides of its origin found so far. */
class LineSearch {
 public:
  LineSearch(const ContactSurface& surface, const Vec3& A, const Vec3& n)
      : surface_(surface),
        search_(detail::SurfaceAccess::search(surface)),
        A_(A),
        n_(n),
        e1_(n.unitOrthogonal()),
        e2_(n.cross(e1_)),
        size_(surface.boundingBox().diagonal().norm()),
        tol_(std::max(ContactSurface::kDefaultTolerance_m, 8e-16 * size_)) {
    for (int k = 0; k < 3; ++k) inverse_[k] = 1 / n[k];
  }

  /** Looks at all pieces of the surface on low <= t <= high, those nearest to the origin first. */
  void run(double low, double high) {
    low_ = low;
    high_ = high;
    hasAhead_ = hasBehind_ = doubtful_ = false;
    splits_ = 0;
    struct Entry {
      int node;
      double t0, t1;
    };
    Entry stack[128];
    int top = 0;
    const auto& nodes = search_.nodes;
    const auto push = [&](int node) {
      Entry e{node, low_, high_};
      if (clip(nodes[static_cast<size_t>(node)].box, e.t0, e.t1)) stack[top++] = e;
    };
    push(0);
    while (top > 0) {
      const Entry entry = stack[--top];
      if (entry.t0 > high_ || entry.t1 < low_) continue;  // a nearer crossing was found meanwhile
      const auto& node = nodes[static_cast<size_t>(entry.node)];
      if (node.leaf >= 0) {
        searchLeaf(search_.leaves[static_cast<size_t>(node.leaf)]);
        continue;
      }
      const int before = top;
      push(node.left);
      push(node.right);
      const auto nearness = [](const Entry& e) { return e.t0 > 0 ? e.t0 : e.t1 < 0 ? -e.t1 : 0; };
      if (top == before + 2 && nearness(stack[before]) < nearness(stack[before + 1])) std::swap(stack[before], stack[before + 1]);
    }
  }

  /** The crossing next to the origin that enters; of two the nearer; nullptr: none. */
  const Crossing* choose() const {
    const bool a = hasAhead_ && ahead_.side < 0, b = hasBehind_ && behind_.side < 0;
    if (a && b) return ahead_.t <= -behind_.t ? &ahead_ : &behind_;
    return a ? &ahead_ : b ? &behind_ : nullptr;
  }
  /** Is there a crossing other than the one at t? */
  bool foundOtherThan(double t) const {
    const double same = 1e-9 * size_;
    return (hasAhead_ && std::abs(ahead_.t - t) > same) || (hasBehind_ && std::abs(behind_.t - t) > same);
  }
  bool isDoubtful() const { return doubtful_; }
  int iterations() const { return iterations_; }

 private:
  bool clip(const Eigen::AlignedBox3d& box, double& t0, double& t1) const {
    const double slack = 1e-12 * size_;
    for (int k = 0; k < 3; ++k) {
      const double lo = box.min()[k] - slack - A_[k], hi = box.max()[k] + slack - A_[k];
      if (std::abs(n_[k]) < 1e-300) {
        if (lo > 0 || hi < 0) return false;
        continue;
      }
      const double a = lo * inverse_[k], b = hi * inverse_[k];
      t0 = std::max(t0, std::min(a, b));
      t1 = std::min(t1, std::max(a, b));
      if (t0 > t1) return false;
    }
    return true;
  }

  struct Piece {
    int patch;
    double u0, u1, v0, v1, spread;  // as of a leaf
  };

  void searchLeaf(const detail::SurfaceAccess::Search::Leaf& leaf) {
    const Piece piece{leaf.patch, leaf.u0, leaf.u1, leaf.v0, leaf.v1, leaf.spread};
    if (!searchPiece(piece)) split(piece, 1);
  }

  /** Where the line cannot be tangent to a piece it crosses it once, and one start finds that. False: look closer. */
  bool searchPiece(const Piece& piece) {
    double side = 0;
    const LeafEnd end = shoot(piece, side);
    return end != LeafEnd::failed && std::abs(side) > piece.spread;
  }

  /** Near tangency: quarters of the piece, as far as their hulls meet the line. Their normals spread half as far. */
  void split(const Piece& piece, int depth) {
    constexpr int kMaxDepth = 12;
    // A line within a plane or along a collapsed patch meets all 4^12 pieces of a leaf. One that touches a curved surface needs
    // up to about 300 splits, those with a crossing at the end about 100.
    constexpr int kMaxSplits = 2000;
    if (splits_ == kMaxSplits) {
      doubtful_ = true;
      return;
    }
    ++splits_;
    const NurbsPatch& patch = surface_.patch(piece.patch);
    const double um = 0.5 * (piece.u0 + piece.u1), vm = 0.5 * (piece.v0 + piece.v1);
    const int i = patch.findSpanU(um), j = patch.findSpanV(vm);
    for (int k = 0; k < 4; ++k) {
      const Piece part{piece.patch,           k % 2 ? um : piece.u0, k % 2 ? piece.u1 : um,
                       k / 2 ? vm : piece.v0, k / 2 ? piece.v1 : vm, 0.5 * piece.spread};
      const auto s = [&](double x) { return (x - patch.spanU(i).center) * patch.spanU(i).invHalfWidth; };
      const auto t = [&](double x) { return (x - patch.spanV(j).center) * patch.spanV(j).invHalfWidth; };
      // The line passes the piece by where the hull's extent along e1, e2 or the surface normal, which errs by the square
      // of the piece's size only, is on one side of it.
      const Vec3 m = patch.calcNormal(0.5 * (part.u0 + part.u1), 0.5 * (part.v0 + part.v1)), g = m - m.dot(n_) * n_;
      Eigen::AlignedBox3d across;
      detail::visitHull(patch.spanCoefficients(i, j), patch.data().degreeU, patch.data().degreeV, s(part.u0), s(part.u1),
                        t(part.v0), t(part.v1),
                        [&](const Vec3& P) { across.extend(Vec3((P - A_).dot(e1_), (P - A_).dot(e2_), (P - A_).dot(g))); });
      if (across.exteriorDistance(Vec3::Zero()) > tol_) continue;
      if (searchPiece(part)) continue;
      if (depth < kMaxDepth) {
        split(part, depth + 1);
      } else {
        doubtful_ = true;
      }
    }
  }

  /** Newton within about a piece's size around it. side: normal . n at the start. */
  LeafEnd shoot(const Piece& leaf, double& side) {
    const NurbsPatch& patch = surface_.patch(leaf.patch);
    const detail::PatchInfo& info = search_.info[static_cast<size_t>(leaf.patch)];
    const double halfU = 0.5 * (leaf.u1 - leaf.u0), halfV = 0.5 * (leaf.v1 - leaf.v0);
    double u = 0.5 * (leaf.u0 + leaf.u1), v = 0.5 * (leaf.v0 + leaf.v1);
    const double u0 = u, v0 = v;
    Crossing c;
    for (int i = 0; i < 20; ++i) {
      detail::evaluatePatch(patch, u, v, c.d);
      ++iterations_;
      const Vec3 r = c.d.S - A_, N = c.d.Su.cross(c.d.Sv), across = n_.cross(r);
      const double length = N.norm(), D = N.dot(n_);
      const double sine = length > 0 ? patch.normalSign() * D / length : 0;
      if (i == 0) side = sine;
      c.residual = across.norm();
      if (c.residual <= tol_) return keep(c, leaf.patch, u, v, patch);
      if (!(std::abs(sine) > 1e-9)) return LeafEnd::failed;
      double du = -c.d.Sv.dot(across) / D, dv = c.d.Su.dot(across) / D;
      // Far from tangency the piece is nearly flat as seen along the line: a first step well outside it means that the
      // crossing, if any, belongs to another piece.
      if (i == 0 && std::abs(sine) > 2 * leaf.spread && (std::abs(du) > 3 * halfU || std::abs(dv) > 3 * halfV))
        return LeafEnd::left;
      du = std::min(std::max(du, -4 * halfU), 4 * halfU);
      dv = std::min(std::max(dv, -4 * halfV), 4 * halfV);
      const double un = info.u.fit(u + du), vn = info.v.fit(v + dv);
      if (un == u && vn == v) {  // at the border, or below the resolution of the parameters
        return c.residual <= 100 * tol_ ? keep(c, leaf.patch, u, v, patch) : LeafEnd::left;
      }
      u = un;
      v = vn;
      if (!info.u.closed && std::abs(u - u0) > 12 * halfU) return LeafEnd::left;
      if (!info.v.closed && std::abs(v - v0) > 12 * halfV) return LeafEnd::left;
    }
    return LeafEnd::failed;
  }

  LeafEnd keep(Crossing& c, int patchIndex, double u, double v, const NurbsPatch& patch) {
    const Vec3 N = c.d.Su.cross(c.d.Sv);
    const double length = N.norm();
    c.normal = length > 0 ? Vec3(N * (patch.normalSign() / length)) : patch.calcNormal(u, v);
    c.side = c.normal.dot(n_);
    c.at = {patchIndex, u, v};
    if (std::abs(c.side) <= kGrazing) return LeafEnd::found;
    c.t = c.normal.dot(c.d.S - A_) / c.side;
    if (c.t >= 0) {
      if (c.t <= high_ && (!hasAhead_ || c.t < ahead_.t)) {
        ahead_ = c;
        hasAhead_ = true;
        high_ = c.t;
      }
    } else if (c.t >= low_ && (!hasBehind_ || c.t > behind_.t)) {
      behind_ = c;
      hasBehind_ = true;
      low_ = c.t;
    }
    return LeafEnd::found;
  }

  const ContactSurface& surface_;
  const detail::SurfaceAccess::Search& search_;
  const Vec3 A_, n_, e1_, e2_;  // e1, e2: across the line
  Vec3 inverse_;
  double size_, tol_;
  double low_ = 0, high_ = 0;
  Crossing ahead_, behind_;
  bool hasAhead_ = false, hasBehind_ = false, doubtful_ = false;
  int iterations_ = 0, splits_ = 0;
};

void toFirstHit(const detail::RayHit& from, const SurfaceParameter& at, FirstHit& to) {
  to.t_m = from.t_m;
  to.at = at;
  to.point = Eigen::Map<const Vec3>(from.p_MC);
  to.normal = Eigen::Map<const Vec3>(from.normal);
  to.residual_m = from.residual_m;
  to.status = HitStatus::hit;
}

/** Fast solver from the seed, then the search as far as it is needed. */
bool findHit(const ContactSurface& surface, const Vec3& A, const Vec3& n, const SurfaceParameter* seed, bool derivatives,
             detail::RayHit& fast, FirstHit& result) {
  const auto& search = detail::SurfaceAccess::search(surface);
  result = FirstHit{};
  SurfaceParameter at = seed != nullptr && seed->patch >= 0 ? *seed : search.findSeed(A.data());
  bool safe = false;
  const bool found = at.patch >= 0 && search.solveFastRay(A.data(), n.data(), at, derivatives, fast, result.iterations, safe);
  if (found && safe) {
    toFirstHit(fast, at, result);
    return true;
  }
  if (!A.allFinite() || !n.allFinite() || std::abs(n.squaredNorm() - 1) > 1e-9) return false;
  LineSearch line(surface, A, n);
  if (found) {
    const double reach = std::abs(fast.t_m) * (1 + 1e-12) + 1e-15;
    line.run(-reach, reach);
    result.iterations += line.iterations();
    if (!line.foundOtherThan(fast.t_m) && !line.isDoubtful()) {
      toFirstHit(fast, at, result);
      return true;
    }
    result.iterations -= line.iterations();
  }
  line.run(-kInfinity, kInfinity);
  result.iterations += line.iterations();
  const Crossing* crossing = line.choose();
  if (crossing == nullptr) {
    result.status = line.isDoubtful() ? HitStatus::notConverged : HitStatus::missed;
    return false;
  }
  result.t_m = crossing->t;
  result.at = crossing->at;
  result.point = crossing->d.S;
  result.normal = crossing->normal;
  result.residual_m = crossing->residual;
  result.status = HitStatus::hit;
  return false;
}

}  // namespace

FirstHit ContactSurface::findFirstHit(const Vec3& A, const Vec3& n, const SurfaceParameter* seed) const {
  detail::RayHit fast;
  FirstHit result;
  findHit(*this, A, n, seed, false, fast, result);
  return result;
}

namespace detail {

namespace {

void copy(const double* from, int count, double* to) { std::copy(from, from + count, to); }

/** Everything of a hit that the careful search found. */
void setFromSurface(const ContactSurface& surface, const FirstHit& found, TrackedHit& hit) {
  const NurbsPatch& patch = surface.patch(found.at.patch);
  const Vec3 n(hit.n[0], hit.n[1], hit.n[2]);
  SurfaceDerivatives d;
  evaluatePatch(patch, found.at.u, found.at.v, d);
  hit.u = found.at.u;
  hit.v = found.at.v;
  hit.t_m = found.t_m;
  hit.cosTheta = -found.normal.dot(n);
  hit.residual_m = found.residual_m;
  hit.iterations = found.iterations;
  copy(found.point.data(), 3, hit.p_MC);
  copy(found.normal.data(), 3, hit.normal);
  const Vec3 N = d.Su.cross(d.Sv);
  const double D = N.dot(n), length = N.norm();
  if (!(std::abs(D) > 1e-9 * length) || !(length > 1e-9 * std::max(d.Su.squaredNorm(), d.Sv.squaredNorm()))) {
    // At a pole the parameters have no derivative: no prediction, and no curvature.
    std::fill(std::begin(hit.duvdA), std::end(hit.duvdA), 0.0);
    std::fill(std::begin(hit.nu), std::end(hit.nu), 0.0);
    std::fill(std::begin(hit.nv), std::end(hit.nv), 0.0);
    return;
  }
  const Vec3 du = d.Sv.cross(n) / D, dv = n.cross(d.Su) / D, m = N / length;
  copy(du.data(), 3, hit.duvdA);
  copy(dv.data(), 3, hit.duvdA + 3);
  const Vec3 bu = d.Suu.cross(d.Sv) + d.Su.cross(d.Suv), bv = d.Suv.cross(d.Sv) + d.Su.cross(d.Svv);
  const double scale = patch.normalSign() / length;
  const Vec3 nu = scale * (bu - m * m.dot(bu)), nv = scale * (bv - m * m.dot(bv));
  copy(nu.data(), 3, hit.nu);
  copy(nv.data(), 3, hit.nv);
}

}  // namespace

void trackHits(const ContactSurface& surface, const double* A, const double* n, const int* ids, int count, TrackedHit* hits) {
  const auto& search = SurfaceAccess::search(surface);
  const TrackedHit* last = nullptr;
  for (int i = 0; i < count; ++i) {
    TrackedHit& hit = hits[ids[i]];
    const Vec3 a(A[3 * i], A[3 * i + 1], A[3 * i + 2]), direction(n[3 * i], n[3 * i + 1], n[3 * i + 2]);
    SurfaceParameter seed;
    if (const TrackedHit* memory = hit.patch >= 0 ? &hit : last) {
      double moved[3];
      for (int k = 0; k < 3; ++k) moved[k] = a[k] - memory->A[k] + memory->t_m * (direction[k] - memory->n[k]);
      const double* j = memory->duvdA;
      seed = {memory->patch, memory->u + j[0] * moved[0] + j[1] * moved[1] + j[2] * moved[2],
              memory->v + j[3] * moved[0] + j[4] * moved[1] + j[5] * moved[2]};
    }
    copy(a.data(), 3, hit.A);
    copy(direction.data(), 3, hit.n);
    SurfaceParameter at = seed;
    int iterations = 0;
    bool safe = false;
    if (seed.patch >= 0 && search.solveFastRay(hit.A, hit.n, at, true, hit, iterations, safe) && safe) {
      hit.patch = at.patch;
      hit.status = HitStatus::hit;
      last = &hit;
      continue;
    }
    FirstHit found;
    const bool isFast = findHit(surface, a, direction, &seed, true, hit, found);
    hit.status = found.status;
    hit.patch = found.status == HitStatus::hit ? found.at.patch : -1;
    if (hit.patch < 0) continue;
    if (!isFast) setFromSurface(surface, found, hit);
    last = &hit;
  }
}

}  // namespace detail

}  // namespace genu::contact
