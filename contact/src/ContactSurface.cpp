#include "genu/contact/ContactSurface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "detail/PatchKernel.h"

namespace genu::contact {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMaxIterations = 60;
constexpr int kTargetLeaves = 4096;

double squaredDistance(const Eigen::AlignedBox3d& box, const Vec3& q) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double d = std::max({box.min()[k] - q[k], 0.0, q[k] - box.max()[k]});
    sum += d * d;
  }
  return sum;
}

/** Does the line meet the box within [tMin, tMax]? Slab test. */
bool meets(const Eigen::AlignedBox3d& box, const Vec3& o, const Vec3& d, double tMin, double tMax, double slack) {
  for (int k = 0; k < 3; ++k) {
    const double lo = box.min()[k] - slack, hi = box.max()[k] + slack;
    if (std::abs(d[k]) < 1e-300) {
      if (o[k] < lo || o[k] > hi) return false;
      continue;
    }
    double t0 = (lo - o[k]) / d[k], t1 = (hi - o[k]) / d[k];
    if (t0 > t1) std::swap(t0, t1);
    tMin = std::max(tMin, t0);
    tMax = std::min(tMax, t1);
    if (tMin > tMax) return false;
  }
  return true;
}

/** Bezier control points of the sub-rectangle [s0, s1] x [t0, t1] (scaled span parameters) of a power-basis span; they
 contain the surface piece (convex hull property, weights > 0). */
Eigen::AlignedBox3d calcHullBox(const double* c, int pu, int pv, double s0, double s1, double t0, double t1) {
  using Homogeneous = Eigen::Vector4d;
  Homogeneous work[6][6];
  const auto at = [&](int a, int b) {
    const double* p = c + (a * (pv + 1) + b) * 4;
    return Homogeneous(p[0], p[1], p[2], p[3]);
  };
  // Polynomial in the local parameter of [lo, hi] mapped to [0, 1], then Bernstein coefficients.
  const auto toBernstein = [](Homogeneous* a, int n, double lo, double hi) {
    const double w = hi - lo;
    for (int i = 0; i < n; ++i) {  // Taylor shift to lo
      for (int j = n - 1; j >= i; --j) a[j] += lo * a[j + 1];
    }
    double f = 1;
    for (int i = 0; i <= n; ++i, f *= w) a[i] *= f;
    static const double binomial[6][6] = {{1},          {1, 1},         {1, 2, 1},
                                          {1, 3, 3, 1}, {1, 4, 6, 4, 1}, {1, 5, 10, 10, 5, 1}};
    Homogeneous out[6];
    for (int k = 0; k <= n; ++k) {
      out[k].setZero();
      for (int i = 0; i <= k; ++i) out[k] += binomial[k][i] / binomial[n][i] * a[i];
    }
    for (int k = 0; k <= n; ++k) a[k] = out[k];
  };
  for (int a = 0; a <= pu; ++a) {
    for (int b = 0; b <= pv; ++b) work[a][b] = at(a, b);
    toBernstein(work[a], pv, t0, t1);
  }
  Eigen::AlignedBox3d box;
  for (int b = 0; b <= pv; ++b) {
    Homogeneous column[6];
    for (int a = 0; a <= pu; ++a) column[a] = work[a][b];
    toBernstein(column, pu, s0, s1);
    for (int a = 0; a <= pu; ++a) box.extend(Vec3(column[a].head<3>() / column[a][3]));
  }
  return box;
}

/** Parameters, kept inside the domain; a closed direction wraps. */
struct Domain {
  double lo, hi;
  bool closed;
  double clampLo, clampHi;  // a hair inside a pole

  double fit(double t) const {
    if (closed) {
      if (t < lo || t > hi) {
        const double period = hi - lo;
        t -= period * std::floor((t - lo) / period);
      }
      return std::min(std::max(t, lo), hi);
    }
    return std::min(std::max(t, clampLo), clampHi);
  }
};

struct PatchInfo {
  Domain u, v;
  bool poleU0 = false, poleU1 = false, poleV0 = false, poleV1 = false;  // edges that shrink to a point
  double size = 0;
};

bool edgeShrinks(const NurbsPatch& patch, bool fixU, double value, double size) {
  Vec3 first = Vec3::Zero();
  for (int k = 0; k <= 16; ++k) {
    const double lo = fixU ? patch.vMin() : patch.uMin(), hi = fixU ? patch.vMax() : patch.uMax();
    const double t = lo + (hi - lo) * k / 16;
    const Vec3 p = fixU ? patch.calcPoint(value, t) : patch.calcPoint(t, value);
    if (k == 0) first = p;
    if ((p - first).norm() > 1e-9 * size) return false;
  }
  return true;
}

PatchInfo makeInfo(const NurbsPatch& patch) {
  PatchInfo info;
  Eigen::AlignedBox3d box;
  for (const Vec3& p : patch.data().points) box.extend(p);
  info.size = box.diagonal().norm();
  info.poleU0 = !patch.isClosedU() && edgeShrinks(patch, true, patch.uMin(), info.size);
  info.poleU1 = !patch.isClosedU() && edgeShrinks(patch, true, patch.uMax(), info.size);
  info.poleV0 = !patch.isClosedV() && edgeShrinks(patch, false, patch.vMin(), info.size);
  info.poleV1 = !patch.isClosedV() && edgeShrinks(patch, false, patch.vMax(), info.size);
  // At a pole the patch is evaluated this far inside it: the tangents exist there, the foot moves by 1e-12 of its size.
  const double hairU = 1e-12 * (patch.uMax() - patch.uMin()), hairV = 1e-12 * (patch.vMax() - patch.vMin());
  info.u = {patch.uMin(), patch.uMax(), patch.isClosedU(), patch.uMin() + (info.poleU0 ? hairU : 0),
            patch.uMax() - (info.poleU1 ? hairU : 0)};
  info.v = {patch.vMin(), patch.vMax(), patch.isClosedV(), patch.vMin() + (info.poleV0 ? hairV : 0),
            patch.vMax() - (info.poleV1 ? hairV : 0)};
  return info;
}

/** Newton on f = |S - Q|^2 / 2 in steps measured along the surface: unknowns (alpha, beta) = (|S_u| du, |S_v| dv), so that
 a pole, where |S_u| -> 0, keeps a well-scaled system. Turns negative curvature around where the Hessian is not positive
 definite, halves steps that do not descend, and works on the faces of the domain box. */
ClosestPoint solveLocal(const NurbsPatch& patch, const PatchInfo& info, int patchIndex, const Vec3& Q, double u, double v) {
  const Domain &du = info.u, &dv = info.v;
  // The residual cannot be smaller than the rounding of S.
  const double tol = std::max(ContactSurface::kDefaultTolerance_m, 8e-16 * info.size);
  ClosestPoint result;
  result.at.patch = patchIndex;
  u = du.fit(u);
  v = dv.fit(v);
  SurfaceDerivatives d;
  detail::evaluatePatch(patch, u, v, d);
  Vec3 r = d.S - Q;
  double f = 0.5 * r.squaredNorm();
  bool atBoundary = false;
  int iteration = 0;
  for (;; ++iteration) {
    const double lu = d.Su.norm(), lv = d.Sv.norm();
    const double gu = lu > 0 ? r.dot(d.Su) / lu : 0, gv = lv > 0 ? r.dot(d.Sv) / lv : 0;
    // A face is active when descent points out of the domain. A pole is not a border: one walks through it.
    const bool uLow = !du.closed && u <= du.clampLo && gu > 0, uHigh = !du.closed && u >= du.clampHi && gu < 0;
    const bool vLow = !dv.closed && v <= dv.clampLo && gv > 0, vHigh = !dv.closed && v >= dv.clampHi && gv < 0;
    const bool throughU = (uLow && info.poleU0 && dv.closed) || (uHigh && info.poleU1 && dv.closed);
    const bool throughV = (vLow && info.poleV0 && du.closed) || (vHigh && info.poleV1 && du.closed);
    const bool fixU = (uLow || uHigh) && !throughU, fixV = (vLow || vHigh) && !throughV;
    const double residual = std::max(fixU ? 0.0 : std::abs(gu), fixV ? 0.0 : std::abs(gv));
    atBoundary = (fixU && std::abs(gu) > tol) || (fixV && std::abs(gv) > tol);
    result.residual_m = residual;
    if (residual <= tol) {
      result.status = atBoundary ? QueryStatus::onBoundary : QueryStatus::converged;
      break;
    }
    if (iteration == kMaxIterations) {
      result.status = QueryStatus::notConverged;
      break;
    }
    if (throughU || throughV) {
      // All directions around a pole meet there: go on where f falls most steeply.
      double bestSlope = 0, bestTurn = 0;
      Vec3 axis = Vec3::Zero();  // mean outward normal
      SurfaceDerivatives other;
      constexpr int kDirections = 16;
      const double turnPeriod = throughU ? dv.hi - dv.lo : du.hi - du.lo;
      const double inward = throughU ? (uLow ? 1 : -1) : (vLow ? 1 : -1);
      for (int k = 0; k < kDirections; ++k) {
        const double turn = turnPeriod * k / kDirections;
        detail::evaluatePatch(patch, throughU ? u : du.fit(u + turn), throughV ? v : dv.fit(v + turn), other);
        axis += patch.normalSign() * other.Su.cross(other.Sv).normalized();
        const Vec3& along = throughU ? other.Su : other.Sv;
        const double slope = inward * (other.S - Q).dot(along) / along.norm();
        if (slope < bestSlope) {
          bestSlope = slope;
          bestTurn = turn;
        }
      }
      if (bestSlope == 0) {
        // The tip of a cone or dimple is the nearest point. The distance is smooth there, along the connecting line.
        const double side = -r.dot(axis) < 0 ? -1.0 : 1.0;
        result.residual_m = 0;
        result.status = QueryStatus::converged;
        result.iterations = iteration;
        result.at.u = u;
        result.at.v = v;
        result.p_MB = d.S;
        result.distance_m = side * r.norm();
        result.normal_M = r.norm() > 0 ? Vec3(-side * r.normalized()) : Vec3(axis.normalized());
        return result;
      }
      if (throughU) v = dv.fit(v + bestTurn);
      if (throughV) u = du.fit(u + bestTurn);
      detail::evaluatePatch(patch, u, v, d);
      r = d.S - Q;
      f = 0.5 * r.squaredNorm();
    }
    const double mu = d.Su.norm(), mv = d.Sv.norm();
    if (!(mu > 0) || !(mv > 0)) {  // not reachable inside the clamped domain of a regular patch
      result.status = QueryStatus::notConverged;
      break;
    }
    const double hu = r.dot(d.Su) / mu, hv = r.dot(d.Sv) / mv;
    const double guv = d.Su.dot(d.Sv) / (mu * mv);
    double a = 1 + r.dot(d.Suu) / (mu * mu), b = guv + r.dot(d.Suv) / (mu * mv), c = 1 + r.dot(d.Svv) / (mv * mv);
    double alpha = 0, beta = 0;
    if (fixU || fixV) {
      // One direction is left; a negative curvature is turned around so that the step descends.
      c = std::max(std::abs(c), 1e-3);
      a = std::max(std::abs(a), 1e-3);
      if (fixU) {
        beta = -hv / c;
      } else {
        alpha = -hu / a;
      }
    } else {
      if (!(a > 0) || !(a * c - b * b > 1e-6 * a * c)) {
        // Not convex here (past a center of curvature): take the eigenvalues' absolute values.
        const double mean = 0.5 * (a + c), half = 0.5 * (a - c), root = std::hypot(half, b);
        const double l1 = std::max(std::abs(mean + root), 1e-3), l2 = std::max(std::abs(mean - root), 1e-3);
        const double cos2 = root > 0 ? half / root : 1, sin2 = root > 0 ? b / root : 0;
        a = 0.5 * (l1 + l2) + 0.5 * (l1 - l2) * cos2;
        c = 0.5 * (l1 + l2) - 0.5 * (l1 - l2) * cos2;
        b = 0.5 * (l1 - l2) * sin2;
      }
      const double det = a * c - b * b;
      alpha = (-c * hu + b * hv) / det;
      beta = (-a * hv + b * hu) / det;
    }
    // One step moves at most a quarter of the domain each way.
    double shrink = 1;
    shrink = std::min(shrink, 0.25 * (du.hi - du.lo) / std::max(std::abs(alpha) / mu, 1e-300));
    shrink = std::min(shrink, 0.25 * (dv.hi - dv.lo) / std::max(std::abs(beta) / mv, 1e-300));
    alpha *= shrink;
    beta *= shrink;
    // On hitting a face, spend the rest of the step along it.
    if (!du.closed && !fixU) {
      const double target = u + alpha / mu, fitted = du.fit(target);
      if (fitted != target) {
        alpha = (fitted - u) * mu;
        if (!fixV) beta = -(hv + b * alpha) / c;
      }
    }
    if (!dv.closed && !fixV) {
      const double target = v + beta / mv, fitted = dv.fit(target);
      if (fitted != target) {
        beta = (fitted - v) * mv;
        if (!fixU) alpha = -(hu + b * beta) / a;
      }
    }
    const double stepLength = std::max(std::abs(alpha), std::abs(beta));
    double factor = 1;
    double un = u, vn = v;
    for (int halving = 0;; ++halving) {
      un = du.fit(u + factor * alpha / mu);
      vn = dv.fit(v + factor * beta / mv);
      detail::evaluatePatch(patch, un, vn, d);
      r = d.S - Q;
      const double fn = 0.5 * r.squaredNorm();
      // Near the solution f is flat to rounding; there the residual decides, not f.
      if (fn <= f * (1 + 1e-14) || factor * stepLength < 1e-7 * info.size || halving == 30) {
        f = fn;
        break;
      }
      factor *= 0.5;
    }
    if (un == u && vn == v) {  // the step is below the resolution of the parameters
      const double lastU = d.Su.norm() > 0 ? std::abs(r.dot(d.Su)) / d.Su.norm() : 0;
      const double lastV = d.Sv.norm() > 0 ? std::abs(r.dot(d.Sv)) / d.Sv.norm() : 0;
      result.residual_m = std::max(fixU ? 0.0 : lastU, fixV ? 0.0 : lastV);
      const bool fine = result.residual_m <= 100 * tol;
      result.status = !fine ? QueryStatus::notConverged : (fixU || fixV) && atBoundary ? QueryStatus::onBoundary : QueryStatus::converged;
      break;
    }
    u = un;
    v = vn;
  }
  result.iterations = iteration;
  result.at.u = u;
  result.at.v = v;
  result.p_MB = d.S;
  Vec3 n = d.Su.cross(d.Sv);
  const double length = n.norm();
  result.normal_M = length > 0 ? Vec3(n * (patch.normalSign() / length)) : patch.calcNormal(u, v);
  const double along = -r.dot(result.normal_M);
  const double lu = d.Su.norm(), lv = d.Sv.norm(), distance = r.norm();
  const bool nearPole = std::min(lu, lv) < 1e-5 * std::max(lu, lv);
  // At a pole (u, v) resolve the foot to a hair only; the distance errs by the square of that.
  if (nearPole && result.status == QueryStatus::notConverged && result.residual_m <= 1e-10 * info.size) {
    result.status = QueryStatus::converged;
  }
  // There one tangent drowns in rounding; the connecting line itself is then the better normal.
  if (nearPole && result.status == QueryStatus::converged && distance > 1e-5 * info.size) {
    result.normal_M = r * (along < 0 ? 1 : -1) / distance;
  }
  if (result.status == QueryStatus::converged) {
    result.distance_m = -r.dot(result.normal_M);
  } else {
    result.distance_m = along >= 0 ? distance : -distance;
  }
  return result;
}

/** Smaller |distance| wins; on a tie an inner foot beats a border foot. */
bool isBetter(const ClosestPoint& a, const ClosestPoint& b) {
  const double da = std::abs(a.distance_m), db = std::abs(b.distance_m);
  if (std::isinf(db)) return true;
  if (std::abs(da - db) > 1e-12 * (da + db) + 1e-15) return da < db;
  return a.status == QueryStatus::converged && b.status != QueryStatus::converged;
}

}  // namespace

struct ContactSurface::Search {
  struct Leaf {
    int patch;
    double u0, u1, v0, v1;
    Vec3 center;
    double radius;  // half diagonal of the piece's box
  };
  struct Node {
    Eigen::AlignedBox3d box;
    int left = -1, right = -1;  // children, or
    int leaf = -1;
  };
  std::vector<PatchInfo> info;
  std::vector<Leaf> leaves;
  std::vector<Node> nodes;

  int build(std::vector<int>& items, int begin, int end, const std::vector<Eigen::AlignedBox3d>& boxes) {
    const int index = static_cast<int>(nodes.size());
    nodes.emplace_back();
    Eigen::AlignedBox3d box, centers;
    for (int i = begin; i < end; ++i) {
      const auto& b = boxes[static_cast<size_t>(items[static_cast<size_t>(i)])];
      box.extend(b);
      centers.extend(b.center());
    }
    nodes[static_cast<size_t>(index)].box = box;
    if (end - begin == 1) {
      nodes[static_cast<size_t>(index)].leaf = items[static_cast<size_t>(begin)];
      return index;
    }
    int axis = 0;
    centers.diagonal().maxCoeff(&axis);
    const int middle = (begin + end) / 2;
    std::nth_element(items.begin() + begin, items.begin() + middle, items.begin() + end, [&](int a, int b) {
      const double ca = boxes[static_cast<size_t>(a)].center()[axis], cb = boxes[static_cast<size_t>(b)].center()[axis];
      return ca != cb ? ca < cb : a < b;
    });
    const int left = build(items, begin, middle, boxes);
    const int right = build(items, middle, end, boxes);
    nodes[static_cast<size_t>(index)].left = left;
    nodes[static_cast<size_t>(index)].right = right;
    return index;
  }
};

ContactSurface::ContactSurface(std::vector<NurbsPatch> patches) : patches_(std::move(patches)), search_(std::make_unique<Search>()) {
  if (patches_.empty()) throw std::invalid_argument("contact surface: has no patch; at least one is needed");
  int spans = 0;
  for (const NurbsPatch& p : patches_) spans += p.numSpansU() * p.numSpansV();
  const int pieces = std::max(1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(kTargetLeaves) / spans))));

  std::vector<Eigen::AlignedBox3d> boxes;
  for (int k = 0; k < numPatches(); ++k) {
    const NurbsPatch& p = patch(k);
    search_->info.push_back(makeInfo(p));
    const int pu = p.data().degreeU, pv = p.data().degreeV;
    for (int i = 0; i < p.numSpansU(); ++i) {
      for (int j = 0; j < p.numSpansV(); ++j) {
        for (int a = 0; a < pieces; ++a) {
          for (int b = 0; b < pieces; ++b) {
            const double s0 = -1 + 2.0 * a / pieces, s1 = -1 + 2.0 * (a + 1) / pieces;
            const double t0 = -1 + 2.0 * b / pieces, t1 = -1 + 2.0 * (b + 1) / pieces;
            Search::Leaf leaf;
            leaf.patch = k;
            leaf.u0 = p.spanU(i).center + s0 / p.spanU(i).invHalfWidth;
            leaf.u1 = p.spanU(i).center + s1 / p.spanU(i).invHalfWidth;
            leaf.v0 = p.spanV(j).center + t0 / p.spanV(j).invHalfWidth;
            leaf.v1 = p.spanV(j).center + t1 / p.spanV(j).invHalfWidth;
            leaf.center = p.calcPoint(0.5 * (leaf.u0 + leaf.u1), 0.5 * (leaf.v0 + leaf.v1));
            boxes.push_back(calcHullBox(p.spanCoefficients(i, j), pu, pv, s0, s1, t0, t1));
            leaf.radius = 0.5 * boxes.back().diagonal().norm();
            search_->leaves.push_back(leaf);
            box_.extend(boxes.back());
          }
        }
      }
    }
  }
  std::vector<int> items(boxes.size());
  for (size_t i = 0; i < items.size(); ++i) items[i] = static_cast<int>(i);
  search_->nodes.reserve(2 * items.size());
  search_->build(items, 0, static_cast<int>(items.size()), boxes);

  // Medial-ball radius at P on one side: the largest ball tangent at P that holds no other surface point,
  // r = min over Q of |P-Q|^2 / (2 |(P-Q).n|) on that side. Sampled, hence the factor one half.
  std::vector<Vec3> points, normals;
  const size_t stride = std::max<size_t>(1, search_->leaves.size() / 1024);
  for (size_t i = 0; i < search_->leaves.size(); i += stride) {
    const auto& leaf = search_->leaves[i];
    points.push_back(leaf.center);
    normals.push_back(patch(leaf.patch).calcNormal(0.5 * (leaf.u0 + leaf.u1), 0.5 * (leaf.v0 + leaf.v1)));
  }
  double inside = kInfinity, outside = kInfinity;
  const double size = box_.diagonal().norm();
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = 0; j < points.size(); ++j) {
      const Vec3 r = points[i] - points[j];
      const double square = r.squaredNorm();
      if (square < 1e-16 * size * size) continue;
      const double height = r.dot(normals[i]);  // > 0: the other point lies below the tangent plane
      if (std::abs(height) <= 1e-9 * std::sqrt(square)) continue;
      const double radius = square / (2 * std::abs(height));
      (height > 0 ? inside : outside) = std::min(height > 0 ? inside : outside, radius);
    }
  }
  safeInside_m_ = 0.5 * inside;
  safeOutside_m_ = 0.5 * outside;
}

ContactSurface::~ContactSurface() = default;
ContactSurface::ContactSurface(ContactSurface&&) noexcept = default;
ContactSurface& ContactSurface::operator=(ContactSurface&&) noexcept = default;

ClosestPoint ContactSurface::findLocalClosestPoint(const Vec3& Q, const SurfaceParameter& seed) const {
  return solveLocal(patch(seed.patch), search_->info[static_cast<size_t>(seed.patch)], seed.patch, Q, seed.u, seed.v);
}

ClosestPoint ContactSurface::findClosestPoint(const Vec3& Q, const SurfaceParameter* seed) const {
  ClosestPoint best;
  best.distance_m = kInfinity;
  if (!Q.allFinite()) return best;  // notConverged
  int iterations = 0;
  if (seed != nullptr && seed->patch >= 0) {
    best = findLocalClosestPoint(Q, *seed);
    if (best.status == QueryStatus::converged &&
        (best.distance_m < 0 ? -best.distance_m < safeInside_m_ : best.distance_m < safeOutside_m_)) {
      return best;
    }
    iterations = best.iterations;
    if (best.status == QueryStatus::notConverged) best.distance_m = kInfinity;
  }

  // Best of the feet found so far bounds the search; pieces whose box is farther cannot hold a better one.
  const auto& nodes = search_->nodes;
  struct Entry {
    int node;
    double square;
  };
  Entry stack[128];
  int top = 0;
  stack[top++] = {0, squaredDistance(nodes[0].box, Q)};
  double bound = best.distance_m * best.distance_m;
  constexpr int kKnown = 16;
  Vec3 known[kKnown];  // feet already found: a piece around one leads to the same foot
  int numKnown = 0;
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.square > bound) continue;
    const Search::Node& node = nodes[static_cast<size_t>(entry.node)];
    if (node.leaf < 0) {
      const double left = squaredDistance(nodes[static_cast<size_t>(node.left)].box, Q);
      const double right = squaredDistance(nodes[static_cast<size_t>(node.right)].box, Q);
      if (left < right) {
        stack[top++] = {node.right, right};
        stack[top++] = {node.left, left};
      } else {
        stack[top++] = {node.left, left};
        stack[top++] = {node.right, right};
      }
      continue;
    }
    const Search::Leaf& leaf = search_->leaves[static_cast<size_t>(node.leaf)];
    bool seen = false;
    for (int k = 0; k < numKnown && !seen; ++k) {
      seen = (known[k] - leaf.center).squaredNorm() < 4 * leaf.radius * leaf.radius;
    }
    if (seen) continue;
    const ClosestPoint found = findLocalClosestPoint(
        Q, SurfaceParameter{leaf.patch, 0.5 * (leaf.u0 + leaf.u1), 0.5 * (leaf.v0 + leaf.v1)});
    iterations += found.iterations;
    if (found.status == QueryStatus::notConverged && std::isfinite(best.distance_m)) continue;
    if (found.status == QueryStatus::converged && numKnown < kKnown) known[numKnown++] = found.p_MB;
    if (isBetter(found, best)) {
      best = found;
      bound = best.distance_m * best.distance_m;
    }
  }
  best.iterations = iterations;
  return best;
}

void ContactSurface::findLineHits(const Vec3& origin, const Vec3& direction, double tMin, double tMax,
                                  std::vector<LineHit>& hits) const {
  hits.clear();
  // Two directions across the line: the foot has both offsets zero.
  const Vec3 e1 = direction.unitOrthogonal(), e2 = direction.cross(e1);
  const double size = box_.diagonal().norm();
  const double tol = std::max(1e-13, 8e-16 * size);
  const auto& nodes = search_->nodes;
  int stack[128];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Search::Node& node = nodes[static_cast<size_t>(stack[--top])];
    if (!meets(node.box, origin, direction, tMin, tMax, 1e-12 * size)) continue;
    if (node.leaf < 0) {
      stack[top++] = node.left;
      stack[top++] = node.right;
      continue;
    }
    const Search::Leaf& leaf = search_->leaves[static_cast<size_t>(node.leaf)];
    const NurbsPatch& p = patch(leaf.patch);
    const PatchInfo& info = search_->info[static_cast<size_t>(leaf.patch)];
    double u = 0.5 * (leaf.u0 + leaf.u1), v = 0.5 * (leaf.v0 + leaf.v1);
    // Feet far outside the piece belong to other pieces; leave when Newton runs away.
    const double reachU = 2 * (leaf.u1 - leaf.u0), reachV = 2 * (leaf.v1 - leaf.v0);
    const double u0 = u, v0 = v;
    SurfaceDerivatives d;
    bool converged = false;
    for (int i = 0; i < 20; ++i) {
      detail::evaluatePatch(p, u, v, d);
      const Vec3 r = d.S - origin;
      const double f1 = r.dot(e1), f2 = r.dot(e2);
      if (std::max(std::abs(f1), std::abs(f2)) <= tol) {
        converged = true;
        break;
      }
      const double a = d.Su.dot(e1), b = d.Sv.dot(e1), c = d.Su.dot(e2), e = d.Sv.dot(e2);
      const double det = a * e - b * c;
      if (std::abs(det) <= 1e-12 * d.Su.norm() * d.Sv.norm()) break;  // the line grazes
      const double du = std::min(std::max((-f1 * e + f2 * b) / det, -reachU), reachU);
      const double dv = std::min(std::max((-f2 * a + f1 * c) / det, -reachV), reachV);
      const double un = info.u.fit(u + du), vn = info.v.fit(v + dv);
      if (un == u && vn == v) {
        converged = std::max(std::abs(f1), std::abs(f2)) <= 100 * tol;
        break;
      }
      u = un;
      v = vn;
      if (!info.u.closed && std::abs(u - u0) > 3 * reachU) break;
      if (!info.v.closed && std::abs(v - v0) > 3 * reachV) break;
    }
    if (!converged) continue;
    LineHit hit;
    hit.t_m = (d.S - origin).dot(direction);
    if (hit.t_m < tMin || hit.t_m > tMax) continue;
    hit.at = {leaf.patch, u, v};
    hit.point = d.S;
    const Vec3 n = d.Su.cross(d.Sv);
    hit.normal = n.norm() > 0 ? Vec3(p.normalSign() * n.normalized()) : p.calcNormal(u, v);
    bool known = false;
    for (const LineHit& h : hits) known = known || std::abs(h.t_m - hit.t_m) < 1e-9 * size;
    if (!known) hits.push_back(hit);
  }
  std::sort(hits.begin(), hits.end(), [](const LineHit& a, const LineHit& b) { return a.t_m < b.t_m; });
}

}  // namespace genu::contact
