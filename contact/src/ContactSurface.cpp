#include "genu/contact/ContactSurface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "detail/BezierHull.h"
#include "detail/PatchKernel.h"
#include "detail/Kernels.h"
#include "detail/SurfaceSearch.h"

namespace genu::contact {

namespace {

using detail::Domain;
using detail::PatchInfo;

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

double justBelow(double knot) { return std::nextafter(knot, -kInfinity); }

/** Knots inside the domain across which the normal jumps. */
std::vector<double> findCreases(const NurbsPatch& patch, bool alongU) {
  const NurbsPatchData& data = patch.data();
  const std::vector<double>& knots = alongU ? data.knotsU : data.knotsV;
  const std::vector<double>& breaks = alongU ? patch.breaksU() : patch.breaksV();
  const double lo = alongU ? patch.vMin() : patch.uMin(), hi = alongU ? patch.vMax() : patch.uMax();
  std::vector<double> creases;
  for (size_t i = 1; i + 1 < breaks.size(); ++i) {
    const double knot = breaks[i];
    if (std::count(knots.begin(), knots.end(), knot) < (alongU ? data.degreeU : data.degreeV)) continue;
    double jump = 0;
    constexpr int kSamples = 33;
    for (int k = 0; k < kSamples; ++k) {
      const double at = lo + (hi - lo) * (k + 0.5) / kSamples, before = justBelow(knot);
      const Vec3 a = alongU ? patch.calcNormal(before, at) : patch.calcNormal(at, before);
      const Vec3 b = alongU ? patch.calcNormal(knot, at) : patch.calcNormal(at, knot);
      jump = std::max(jump, (a - b).norm());
    }
    if (jump > 1e-6) creases.push_back(knot);
  }
  return creases;
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
  info.creasesU = findCreases(patch, true);
  info.creasesV = findCreases(patch, false);
  return info;
}

/** The crease nearest to a parameter, NaN when none is near. */
double findCreaseNear(const std::vector<double>& creases, double t, const Domain& domain) {
  double best = std::numeric_limits<double>::quiet_NaN(), least = 0.01 * (domain.hi - domain.lo);
  for (const double crease : creases) {
    if (std::abs(t - crease) > least) continue;
    least = std::abs(t - crease);
    best = crease;
  }
  return best;
}

/** A foot on a crease or where two creases cross, near (u, v): the distance grows on all sides, but nowhere is it stationary, and
 Newton jumps from side to side. False: there is none. */
bool solveOnCrease(const NurbsPatch& patch, const PatchInfo& info, const Vec3& Q, double tol, double u, double v, ClosestPoint& result) {
  SurfaceDerivatives d;
  const auto slope = [&](double a, double b, bool alongU) {
    detail::evaluatePatch(patch, a, b, d);
    const Vec3& T = alongU ? d.Su : d.Sv;
    const double length = T.norm();
    return length > 0 ? (d.S - Q).dot(T) / length : 0;
  };
  const auto growsAcrossU = [&](double a, double b) { return slope(a, b, true) >= -tol && slope(justBelow(a), b, true) <= tol; };
  const auto growsAcrossV = [&](double a, double b) { return slope(a, b, false) >= -tol && slope(a, justBelow(b), false) <= tol; };
  bool atBorder = false;
  double residual = 0;
  // Nearest point of a line of constant v (alongU) or u.
  const auto followLine = [&](double& a, double& b, bool alongU) {
    const Domain& domain = alongU ? info.u : info.v;
    double& t = alongU ? a : b;
    const double range = domain.hi - domain.lo;
    t = domain.fit(t);
    for (int i = 0; i < kMaxIterations; ++i) {
      const double g = slope(a, b, alongU);
      const bool outward = !domain.closed && ((t <= domain.clampLo && g > 0) || (t >= domain.clampHi && g < 0));
      atBorder = outward && std::abs(g) > tol;
      residual = outward ? 0 : std::abs(g);
      if (std::abs(g) <= tol || outward) return true;
      const Vec3& T = alongU ? d.Su : d.Sv;
      const double length = T.norm(), f = (d.S - Q).squaredNorm();
      const double bend = 1 + (d.S - Q).dot(alongU ? d.Suu : d.Svv) / (length * length);
      double step = -g / (length * std::max(std::abs(bend), 1e-3));
      step = std::min(std::max(step, -0.25 * range), 0.25 * range);
      const double from = t;
      for (int halving = 0; halving < 30; ++halving, step *= 0.5) {
        t = domain.fit(from + step);
        detail::evaluatePatch(patch, a, b, d);
        if ((d.S - Q).squaredNorm() <= f * (1 + 1e-14)) break;
      }
      if (t == from) return residual <= 100 * tol;  // the step is below the resolution of the parameter
    }
    return false;
  };
  double creaseU = findCreaseNear(info.creasesU, u, info.u), creaseV = findCreaseNear(info.creasesV, v, info.v);
  double a = u, b = creaseV;
  bool found = false;
  if (!std::isnan(creaseV)) {
    found = followLine(a, b, true) && growsAcrossV(a, b);
    if (!found && std::isnan(creaseU)) creaseU = findCreaseNear(info.creasesU, a, info.u);
  }
  if (!found && !std::isnan(creaseU)) {
    a = creaseU;
    b = v;
    found = followLine(a, b, false) && growsAcrossU(a, b);
    if (!found && std::isnan(creaseV)) creaseV = findCreaseNear(info.creasesV, b, info.v);
  }
  if (!found && !std::isnan(creaseU) && !std::isnan(creaseV)) {
    a = creaseU;
    b = creaseV;
    atBorder = false;
    residual = 0;
    found = growsAcrossU(a, b) && growsAcrossV(a, b);
  }
  if (!found) return false;
  const double beforeA = a == creaseU ? justBelow(a) : a, beforeB = b == creaseV ? justBelow(b) : b;
  Vec3 axis = patch.calcNormal(a, b) + patch.calcNormal(beforeA, beforeB);  // mean outward normal
  if (beforeA != a && beforeB != b) axis += patch.calcNormal(beforeA, b) + patch.calcNormal(a, beforeB);
  const Vec3 r = patch.calcPoint(a, b) - Q;
  const double distance = r.norm(), side = r.dot(axis) > 0 ? -1 : 1;
  result.at.u = a;
  result.at.v = b;
  result.p_MB = Q + r;
  result.residual_m = residual;
  result.status = atBorder ? QueryStatus::onBoundary : QueryStatus::converged;
  result.distance_m = side * distance;
  result.normal_M = distance > 0 ? Vec3(-side * r / distance) : Vec3(axis.normalized());
  return true;
}

/** Newton on f = |S - Q|^2 / 2 in steps measured along the surface: unknowns (alpha, beta) = (|S_u| du, |S_v| dv), so that
 a pole, where |S_u| -> 0, keeps a well-scaled system. Turns negative curvature around where the Hessian is not positive
 definite, halves steps that do not descend, and works on the faces of the domain box. */
ClosestPoint solveLocal(const NurbsPatch& patch, const PatchInfo& info, int patchIndex, const Vec3& Q, double u, double v) {
  const Domain &du = info.u, &dv = info.v;
  ClosestPoint result;
  result.at.patch = patchIndex;
  u = du.fit(u);
  v = dv.fit(v);
  SurfaceDerivatives d;
  detail::evaluatePatch(patch, u, v, d);
  Vec3 r = d.S - Q;
  double f = 0.5 * r.squaredNorm();
  // The residual cannot be smaller than the rounding of S, nor, from afar, of Q.
  const double tol = std::max({ContactSurface::kDefaultTolerance_m, 8e-16 * info.size, 8e-16 * r.norm()});
  bool atBoundary = false;
  const bool creased = !info.creasesU.empty() || !info.creasesV.empty();
  int iteration = 0, stalls = 0;
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
        // Not below a thousandth of the larger one: near the centre of a sphere both are small.
        const double least = 1e-3 * std::min(1.0, std::max(std::abs(mean) + root, 1e-9));
        const double l1 = std::max(std::abs(mean + root), least), l2 = std::max(std::abs(mean - root), least);
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
    int halving = 0;
    for (;; ++halving) {
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
    if (creased && halving >= 8 && ++stalls == 2 && solveOnCrease(patch, info, Q, tol, u, v, result)) {
      result.iterations = iteration;
      return result;
    }
  }
  result.iterations = iteration;
  if (creased && result.status == QueryStatus::notConverged && solveOnCrease(patch, info, Q, tol, u, v, result)) return result;
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
  if (nearPole && result.status == QueryStatus::converged) {
    // A line where a tangent vanishes although the surface goes on is stationary without being near: look beside it.
    SurfaceDerivatives beside;
    for (const double side : {-1e-3, 1e-3}) {
      const double un = lu < lv ? du.fit(u + side * (du.hi - du.lo)) : u, vn = lu < lv ? v : dv.fit(v + side * (dv.hi - dv.lo));
      detail::evaluatePatch(patch, un, vn, beside);
      const double step = (beside.S - d.S).norm(), fall = f - 0.5 * (beside.S - Q).squaredNorm();
      // A foot's slope is at most 1e-10 of the size; rounding makes 1e-7 of it in the shortest step.
      if (step > 1e-9 * info.size && fall > 1e-6 * info.size * step) result.status = QueryStatus::notConverged;
    }
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

/** Largest |normal - normal in the middle| over a rectangle, from its corners and edges; half as much again covers what lies
 between them. */
double calcNormalSpread(const NurbsPatch& patch, double u0, double u1, double v0, double v1) {
  const Vec3 middle = patch.calcNormal(0.5 * (u0 + u1), 0.5 * (v0 + v1));
  double spread = 0;
  for (int k = 0; k < 9; ++k) {
    const Vec3 n = patch.calcNormal(u0 + 0.5 * (k / 3) * (u1 - u0), v0 + 0.5 * (k % 3) * (v1 - v0));
    spread = std::max(spread, 1.5 * (n - middle).norm());
  }
  return spread;
}

/** Smaller |distance| wins; on a tie an inner foot beats a border foot. */
bool isBetter(const ClosestPoint& a, const ClosestPoint& b) {
  const double da = std::abs(a.distance_m), db = std::abs(b.distance_m);
  if (std::isinf(db)) return true;
  if (std::abs(da - db) > 1e-12 * (da + db) + 1e-15) return da < db;
  return a.status == QueryStatus::converged && b.status != QueryStatus::converged;
}

}  // namespace

int ContactSurface::Search::build(std::vector<int>& items, int begin, int end, const std::vector<Eigen::AlignedBox3d>& boxes) {
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

void ContactSurface::Search::addTables(const NurbsPatch& patch) {
  const PatchInfo& patchInfo = info.back();
  detail::PatchTables t;
  const auto setDirection = [&](detail::PatchTables::Direction& d, bool alongU) {
    const std::vector<double>& breaks = alongU ? patch.breaksU() : patch.breaksV();
    d.breaks = breaks.data();
    d.numSpans = static_cast<int>(breaks.size()) - 1;
    d.lo = breaks.front();
    d.hi = breaks.back();
    d.closed = alongU ? patch.isClosedU() : patch.isClosedV();
    d.degree = alongU ? patch.data().degreeU : patch.data().degreeV;
    std::vector<double> spans;
    for (int i = 0; i < d.numSpans; ++i) {
      const NurbsPatch::Span& span = alongU ? patch.spanU(i) : patch.spanV(i);
      spans.insert(spans.end(), {span.center, span.invHalfWidth, 1 / span.invHalfWidth});
    }
    d.numBuckets = std::min(4096, 16 * d.numSpans);  // few hold a knot
    d.bucketScale = d.numBuckets / (d.hi - d.lo);
    std::vector<unsigned short> buckets;
    for (int k = 0; k < d.numBuckets; ++k) {
      // One rounding low: the search only walks up.
      const double x = d.lo + (k - 1e-9) / d.bucketScale;
      const int span = alongU ? patch.findSpanU(x) : patch.findSpanV(x);
      buckets.push_back(static_cast<unsigned short>(std::min(span, 65535)));
    }
    spanStorage.push_back(std::move(spans));
    bucketStorage.push_back(std::move(buckets));
    d.spans = spanStorage.back().data();
    d.buckets = bucketStorage.back().data();
  };
  setDirection(t.u, true);
  setDirection(t.v, false);
  t.coefficients = patch.spanCoefficients(0, 0);
  t.firstSpan = tables.empty() ? 0 : tables.back().firstSpan + tables.back().u.numSpans * tables.back().v.numSpans;
  t.normalSign = patch.normalSign();
  t.tolerance_m = std::max(kDefaultTolerance_m, 8e-16 * patchInfo.size);
  t.rational = patch.data().isRational();
  t.bend_perM = t.twist_perM2 = 0;
  if (patchInfo.poleU0 || patchInfo.poleU1 || patchInfo.poleV0 || patchInfo.poleV1) t.bend_perM = t.twist_perM2 = kInfinity;
  // Third derivatives from differences of the second over a thousandth of a span, sampled; 1.5 covers what lies between.
  SurfaceDerivatives d, du, dv;
  for (int i = 0; i < t.u.numSpans; ++i) {
    for (int j = 0; j < t.v.numSpans; ++j) {
      const double hu = 1 / patch.spanU(i).invHalfWidth, hv = 1 / patch.spanV(j).invHalfWidth;
      for (int k = 0; k < 9; ++k) {
        const double u = patch.spanU(i).center + 0.99 * (k / 3 - 1) * hu, v = patch.spanV(j).center + 0.99 * (k % 3 - 1) * hv;
        detail::evaluatePatch(patch, u, v, d);
        detail::evaluatePatch(patch, u + 1e-3 * hu, v, du);
        detail::evaluatePatch(patch, u, v + 1e-3 * hv, dv);
        const double lu = d.Su.norm(), lv = d.Sv.norm();
        if (!(lu > 0) || !(lv > 0)) continue;
        const auto bend = [&](const SurfaceDerivatives& e) {
          return std::max({e.Suu.norm() / (lu * lu), e.Suv.norm() / (lu * lv), e.Svv.norm() / (lv * lv)});
        };
        SurfaceDerivatives cu, cv;
        cu.Suu = du.Suu - d.Suu;
        cu.Suv = du.Suv - d.Suv;
        cu.Svv = du.Svv - d.Svv;
        cv.Suu = dv.Suu - d.Suu;
        cv.Suv = dv.Suv - d.Suv;
        cv.Svv = dv.Svv - d.Svv;
        t.bend_perM = std::max(t.bend_perM, 1.5 * bend(d));
        t.twist_perM2 = std::max({t.twist_perM2, 1.5 * bend(cu) / (1e-3 * hu * lu), 1.5 * bend(cv) / (1e-3 * hv * lv)});
      }
    }
  }
  tables.push_back(t);
}

namespace {

/** Parameters of a point at fraction f of an edge (numbered as in EdgeLink). */
Vec2 onEdge(const NurbsPatch& p, int edge, double f) {
  const double u = p.uMin() + f * (p.uMax() - p.uMin()), v = p.vMin() + f * (p.vMax() - p.vMin());
  return edge == 0 ? Vec2(p.uMin(), v) : edge == 1 ? Vec2(p.uMax(), v) : edge == 2 ? Vec2(u, p.vMin()) : Vec2(u, p.vMax());
}

}  // namespace

void ContactSurface::Search::linkEdges(const std::vector<NurbsPatch>& patches, double size) {
  constexpr int kSamples = 9;
  using Edge = std::array<Vec3, kSamples>;
  std::vector<Edge> edges;
  for (const NurbsPatch& p : patches) {
    for (int e = 0; e < 4; ++e) {
      Edge points;
      for (int k = 0; k < kSamples; ++k) {
        const Vec2 at = onEdge(p, e, k / (kSamples - 1.0));
        points[static_cast<size_t>(k)] = p.calcPoint(at.x(), at.y());
      }
      edges.push_back(points);
    }
  }
  links.resize(patches.size());
  const auto differ = [&](const Edge& a, const Edge& b, bool reversed) {
    double worst = 0;
    for (size_t k = 0; k < kSamples; ++k) worst = std::max(worst, (a[k] - b[reversed ? kSamples - 1 - k : k]).norm());
    return worst > 1e-7 * size;
  };
  for (size_t a = 0; a < edges.size(); ++a) {
    if ((edges[a][0] - edges[a][kSamples / 2]).norm() <= 1e-7 * size) continue;  // a pole
    for (size_t b = 0; b < edges.size(); ++b) {
      if (b / 4 == a / 4) continue;
      for (const bool reversed : {false, true}) {
        if (differ(edges[a], edges[b], reversed)) continue;
        links[a / 4][a % 4] = {static_cast<int>(b / 4), static_cast<int>(b % 4), reversed};
      }
    }
  }
}

void ContactSurface::Search::fillCells(const std::vector<NurbsPatch>& patches, const Eigen::AlignedBox3d& box) {
  const size_t stride = leaves.size() / 8192 + 1;
  for (size_t i = 0; i < leaves.size(); i += stride) {
    const Leaf& leaf = leaves[i];
    detail::Seed seed;
    const double u = 0.5 * (leaf.u0 + leaf.u1), v = 0.5 * (leaf.v0 + leaf.v1);
    const SurfaceDerivatives d = patches[static_cast<size_t>(leaf.patch)].evaluate(u, v);
    const double a = d.Su.squaredNorm(), b = d.Su.dot(d.Sv), c = d.Sv.squaredNorm(), det = a * c - b * b;
    if (!(det > 1e-6 * a * c)) continue;
    const Vec3 du = (c * d.Su - b * d.Sv) / det, dv = (a * d.Sv - b * d.Su) / det;
    for (int k = 0; k < 3; ++k) {
      seed.S[k] = static_cast<float>(d.S[k]);
      seed.du[k] = static_cast<float>(du[k]);
      seed.dv[k] = static_cast<float>(dv[k]);
    }
    seed.u = static_cast<float>(u);
    seed.v = static_cast<float>(v);
    seed.patch = leaf.patch;
    seeds.push_back(seed);
  }
  // A margin of four cells; points farther away go to the hierarchy of boxes.
  constexpr int kMargin = 4, kAcross = 28;
  const double cell = std::max(box.sizes().maxCoeff(), 1e-9) / kAcross;
  invCell = 1 / cell;
  cellOrigin = box.min().array() - kMargin * cell;
  for (int k = 0; k < 3; ++k) numCells[k] = static_cast<int>(std::ceil(box.sizes()[k] / cell)) + 2 * kMargin;
  cells.assign(static_cast<size_t>(numCells[0]) * static_cast<size_t>(numCells[1]) * static_cast<size_t>(numCells[2]), -1);
  const auto index = [&](int x, int y, int z) { return static_cast<size_t>((x * numCells[1] + y) * numCells[2] + z); };
  const auto distance = [&](int s, int x, int y, int z) {
    const detail::Seed& seed = seeds[static_cast<size_t>(s)];
    return (cellOrigin + cell * Vec3(x + 0.5, y + 0.5, z + 0.5) - Vec3(seed.S[0], seed.S[1], seed.S[2])).squaredNorm();
  };
  for (size_t s = 0; s < seeds.size(); ++s) {
    int at[3];
    for (int k = 0; k < 3; ++k) {
      at[k] = std::min(std::max(static_cast<int>((static_cast<double>(seeds[s].S[k]) - cellOrigin[k]) * invCell), 0), numCells[k] - 1);
    }
    std::int16_t& here = cells[index(at[0], at[1], at[2])];
    if (here < 0 || distance(static_cast<int>(s), at[0], at[1], at[2]) < distance(here, at[0], at[1], at[2])) {
      here = static_cast<std::int16_t>(s);
    }
  }
  // Nearest seeds spread from cell to cell, one layer a round, from the cells that the round before has changed.
  std::vector<int> changed, touched;
  std::vector<std::int16_t> old;
  std::vector<char> listed(cells.size(), 0);
  for (size_t i = 0; i < cells.size(); ++i) {
    if (cells[i] >= 0) changed.push_back(static_cast<int>(i));
  }
  const auto visitNeighbors = [&](int i, auto&& visit) {
    const int z = i % numCells[2], y = i / numCells[2] % numCells[1], x = i / numCells[2] / numCells[1];
    for (int a = std::max(x - 1, 0); a <= std::min(x + 1, numCells[0] - 1); ++a) {
      for (int b = std::max(y - 1, 0); b <= std::min(y + 1, numCells[1] - 1); ++b) {
        for (int c = std::max(z - 1, 0); c <= std::min(z + 1, numCells[2] - 1); ++c) visit(index(a, b, c));
      }
    }
  };
  for (int round = 0; round < kMargin; ++round) {
    old = cells;
    touched.clear();
    for (const int from : changed) {
      visitNeighbors(from, [&](size_t i) {
        if (listed[i] == 0) {
          listed[i] = 1;
          touched.push_back(static_cast<int>(i));
        }
      });
    }
    changed.clear();
    for (const int at : touched) {
      const auto i = static_cast<size_t>(at);
      listed[i] = 0;
      const int z = at % numCells[2], y = at / numCells[2] % numCells[1], x = at / numCells[2] / numCells[1];
      int best = old[i];
      double nearest = best < 0 ? kInfinity : distance(best, x, y, z);
      int last = best;  // neighbors often share a seed
      visitNeighbors(at, [&](size_t n) {
        const int s = old[n];
        if (s < 0 || s == best || s == last) return;
        last = s;
        const double r = distance(s, x, y, z);
        if (r < nearest) {
          nearest = r;
          best = s;
        }
      });
      if (best == old[i]) continue;
      cells[i] = static_cast<std::int16_t>(best);
      changed.push_back(at);
    }
  }
}

SurfaceParameter ContactSurface::Search::findSeed(const double* Q) const {
  int at[3];
  for (int k = 0; k < 3; ++k) {
    const double x = (Q[k] - cellOrigin[k]) * invCell;
    if (!(x >= 0 && x < numCells[k])) return {};
    at[k] = static_cast<int>(x);
  }
  const int s = cells[static_cast<size_t>((at[0] * numCells[1] + at[1]) * numCells[2] + at[2])];
  if (s < 0) return {};
  const detail::Seed& seed = seeds[static_cast<size_t>(s)];
  const float x = static_cast<float>(Q[0]) - seed.S[0], y = static_cast<float>(Q[1]) - seed.S[1],
              z = static_cast<float>(Q[2]) - seed.S[2];
  const detail::PatchTables& t = tables[static_cast<size_t>(seed.patch)];
  const auto clamp = [](double value, const detail::PatchTables::Direction& d) {
    return d.closed ? value : std::min(std::max(value, d.lo), d.hi);
  };
  return {seed.patch, clamp(static_cast<double>(seed.u + seed.du[0] * x + seed.du[1] * y + seed.du[2] * z), t.u),
          clamp(static_cast<double>(seed.v + seed.dv[0] * x + seed.dv[1] * y + seed.dv[2] * z), t.v)};
}

bool ContactSurface::Search::crossEdge(SurfaceParameter& at, double& u, double& v) const {
  const detail::PatchTables& t = tables[static_cast<size_t>(at.patch)];
  const bool outU = !t.u.closed && (u < t.u.lo || u > t.u.hi);
  const int edge = outU ? (u < t.u.lo ? 0 : 1) : (v < t.v.lo ? 2 : 3);
  const detail::EdgeLink& link = links[static_cast<size_t>(at.patch)][static_cast<size_t>(edge)];
  if (link.patch < 0) return false;
  const detail::PatchTables::Direction& along = outU ? t.v : t.u;
  double f = std::min(std::max(((outU ? v : u) - along.lo) / (along.hi - along.lo), 0.0), 1.0);
  if (link.reversed) f = 1 - f;
  const detail::PatchTables& other = tables[static_cast<size_t>(link.patch)];
  at.patch = link.patch;
  u = link.edge == 0 ? other.u.lo : link.edge == 1 ? other.u.hi : other.u.lo + f * (other.u.hi - other.u.lo);
  v = link.edge == 2 ? other.v.lo : link.edge == 3 ? other.v.hi : other.v.lo + f * (other.v.hi - other.v.lo);
  return true;
}

bool ContactSurface::Search::solveFast(const double* Q, SurfaceParameter& at, detail::FootDerivatives derivatives, detail::TrackedFoot& foot,
                                       detail::FootSearch& search) const {
  const detail::SolveFoot solve = detail::activeKernels().solveFoot;
  search.u = at.u;
  search.v = at.v;
  int iterations = 0;
  constexpr int kHops = 4;
  for (int hop = 0; hop <= kHops; ++hop) {
    const detail::PatchTables& t = tables[static_cast<size_t>(at.patch)];
    const detail::FootOutcome outcome = solve(t, Q, search, derivatives, foot);
    search.iterations = iterations += search.iterations;
    if (outcome == detail::FootOutcome::found) {
      at.u = search.u;
      at.v = search.v;
      return true;
    }
    if (outcome == detail::FootOutcome::failed) return false;
    if (!crossEdge(at, search.u, search.v)) return false;
  }
  return false;
}

ContactSurface::ContactSurface(std::vector<NurbsPatch> patches) : patches_(std::move(patches)), search_(std::make_unique<Search>()) {
  if (patches_.empty()) throw std::invalid_argument("contact surface: has no patch; at least one is needed");
  int spans = 0;
  for (const NurbsPatch& p : patches_) spans += p.numSpansU() * p.numSpansV();
  const int pieces = std::max(1, static_cast<int>(std::ceil(std::sqrt(static_cast<double>(kTargetLeaves) / spans))));

  std::vector<Eigen::AlignedBox3d> boxes;
  for (int k = 0; k < numPatches(); ++k) {
    const NurbsPatch& p = patch(k);
    search_->info.push_back(makeInfo(p));
    search_->addTables(p);
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
            leaf.normal = p.calcNormal(0.5 * (leaf.u0 + leaf.u1), 0.5 * (leaf.v0 + leaf.v1));
            Eigen::AlignedBox3d box;
            detail::visitHull(p.spanCoefficients(i, j), pu, pv, s0, s1, t0, t1, [&](const Vec3& P) {
              box.extend(P);
              const double height = (P - leaf.center).dot(leaf.normal);
              leaf.low = std::min(leaf.low, height);
              leaf.high = std::max(leaf.high, height);
              leaf.reach = std::max(leaf.reach, (P - leaf.center - height * leaf.normal).norm());
            });
            boxes.push_back(box);
            leaf.radius = 0.5 * boxes.back().diagonal().norm();
            leaf.spread = calcNormalSpread(p, leaf.u0, leaf.u1, leaf.v0, leaf.v1);
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
    normals.push_back(leaf.normal);
  }
  double inside = kInfinity, outside = kInfinity;
  const double size = box_.diagonal().norm();
  const auto tighten = [size](double square, double height, double& radius) {
    if (square >= 2 * height * radius) return;  // the most frequent outcome first
    if (square < 1e-16 * size * size || height * height <= 1e-18 * square) return;
    radius = std::min(radius, square / (2 * height));
  };
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const Vec3 r = points[i] - points[j];
      const double square = r.squaredNorm();
      for (const double height : {r.dot(normals[i]), -r.dot(normals[j])}) {  // > 0: the other point lies below the tangent plane
        if (height > 0) {
          tighten(square, height, inside);
        } else {
          tighten(square, -height, outside);
        }
      }
    }
  }
  safeInside_m_ = 0.5 * inside;
  safeOutside_m_ = 0.5 * outside;
  search_->safeInside = safeInside_m_;
  search_->safeOutside = safeOutside_m_;
  search_->linkEdges(patches_, size);
  search_->fillCells(patches_, box_);
}

ContactSurface::~ContactSurface() = default;
ContactSurface::ContactSurface(ContactSurface&&) noexcept = default;
ContactSurface& ContactSurface::operator=(ContactSurface&&) noexcept = default;

namespace {

ClosestPoint makeClosestPoint(const SurfaceParameter& at, const detail::TrackedFoot& foot, const detail::FootSearch& search) {
  ClosestPoint result;
  result.at = at;
  result.p_MB = Eigen::Map<const Vec3>(search.p_MB);
  result.normal_M = Eigen::Map<const Vec3>(foot.normal);
  result.distance_m = foot.distance_m;
  result.residual_m = search.residual_m;
  result.status = QueryStatus::converged;
  result.iterations = search.iterations;
  return result;
}

}  // namespace

ClosestPoint ContactSurface::findLocalClosestPoint(const Vec3& Q, const SurfaceParameter& seed) const {
  return solveLocal(patch(seed.patch), search_->info[static_cast<size_t>(seed.patch)], seed.patch, Q, seed.u, seed.v);
}

ClosestPoint ContactSurface::findClosestPoint(const Vec3& Q, const SurfaceParameter* seed) const {
  // So far away that a foot could not be told from its neighbors: every search would end unconverged, after a long time.
  constexpr double kFarthest = 1e12;
  if (!(squaredDistance(box_, Q) <= kFarthest * kFarthest * box_.diagonal().squaredNorm())) {
    ClosestPoint none;
    none.at = {0, patch(0).uMin(), patch(0).vMin()};
    none.distance_m = kInfinity;
    return none;
  }
  // The fast solver's foot counts where the foot is provably unique; everything else is left to the careful search.
  detail::FootSearch fast{};
  detail::TrackedFoot foot;
  const bool warm = seed != nullptr && seed->patch >= 0;
  SurfaceParameter at = warm ? *seed : search_->findSeed(Q.data());
  if (at.patch >= 0 && search_->solveFast(Q.data(), at, detail::FootDerivatives::none, foot, fast) && search_->isSafe(foot.distance_m)) {
    return makeClosestPoint(at, foot, fast);
  }
  int iterations = fast.iterations;
  ClosestPoint best;
  best.distance_m = kInfinity;
  if (!Q.allFinite()) return best;  // notConverged
  if (warm) {
    best = findLocalClosestPoint(Q, *seed);
    if (best.status == QueryStatus::converged && search_->isSafe(best.distance_m)) return best;
    iterations += best.iterations;
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
  constexpr int kEnoughStarts = 64, kManyStarts = 512;
  int starts = 0;
  bool tied = false;
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
    // Near the middle of a round solid the boxes of most pieces are nearer than the foot; their slabs are thinner. The first
    // starts are made all the same: they find feet that a piece's own start misses. Within about 1e-3 of the radius of the middle
    // all pieces tie, so many that after some hundred starts only one that could be nearer by a tenth is worth another: then the
    // distance is an upper bound within that.
    if (starts >= kEnoughStarts) {
      const double height = (leaf.center - Q).dot(leaf.normal), gap = std::max(height + leaf.low, -height - leaf.high);
      if (gap > 0 && gap * gap > (starts < kManyStarts ? 1 : 0.81) * bound) {
        tied = tied || gap * gap <= bound;
        continue;
      }
    }
    // With a foot of a point nearby known, as on a border, most pieces are farther than it by their slabs and widths.
    if (warm && leaf.boundSquaredDistance(Q) > bound) continue;
    bool seen = false;
    for (int k = 0; k < numKnown && !seen; ++k) {
      seen = (known[k] - leaf.center).squaredNorm() < 4 * leaf.radius * leaf.radius;
    }
    if (seen) continue;
    ++starts;
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
  if (tied && best.status == QueryStatus::converged) best.status = QueryStatus::notConverged;
  return best;
}

CertifiedClosestPoint ContactSurface::findClosestPointCertified(const Vec3& Q, double gap_m) const {
  CertifiedClosestPoint result;
  result.foot.distance_m = kInfinity;
  if (!Q.allFinite()) return result;
  // A node of the box hierarchy, or (node < 0) a rectangle of one span.
  struct Piece {
    double bound;
    int node, patch, i, j;
    double s0, s1, t0, t1;
  };
  const auto later = [](const Piece& a, const Piece& b) { return a.bound > b.bound; };
  std::vector<Piece> heap;
  const auto push = [&](const Piece& piece) {
    if (piece.bound >= std::abs(result.foot.distance_m) - gap_m) return;
    heap.push_back(piece);
    std::push_heap(heap.begin(), heap.end(), later);
  };
  const auto tryFrom = [&](int patchIndex, double u, double v) {
    const ClosestPoint found =
        solveLocal(patch(patchIndex), search_->info[static_cast<size_t>(patchIndex)], patchIndex, Q, u, v);
    if (found.status != QueryStatus::notConverged && isBetter(found, result.foot)) result.foot = found;
  };
  push({std::sqrt(squaredDistance(search_->nodes[0].box, Q)), 0, 0, 0, 0, 0, 0, 0, 0});
  constexpr int kMaxPieces = 200000;
  for (int count = 0; !heap.empty(); ++count) {
    std::pop_heap(heap.begin(), heap.end(), later);
    const Piece piece = heap.back();
    heap.pop_back();
    const double wanted = std::abs(result.foot.distance_m) - gap_m;
    if (piece.bound >= wanted || count == kMaxPieces) {
      // Best first: everything left is at least this far; what was dropped was beyond the wanted bound of its time.
      result.lowerBound_m = std::max(0.0, std::min(piece.bound, wanted));
      result.certified = piece.bound >= wanted;
      return result;
    }
    if (piece.node >= 0) {
      const Search::Node& node = search_->nodes[static_cast<size_t>(piece.node)];
      if (node.leaf < 0) {
        for (const int child : {node.left, node.right}) {
          push({std::sqrt(squaredDistance(search_->nodes[static_cast<size_t>(child)].box, Q)), child, 0, 0, 0, 0, 0, 0, 0});
        }
        continue;
      }
      const Search::Leaf& leaf = search_->leaves[static_cast<size_t>(node.leaf)];
      const NurbsPatch& p = patch(leaf.patch);
      const double u = 0.5 * (leaf.u0 + leaf.u1), v = 0.5 * (leaf.v0 + leaf.v1);
      tryFrom(leaf.patch, u, v);
      const int i = p.findSpanU(u), j = p.findSpanV(v);
      const auto s = [&](double x) { return (x - p.spanU(i).center) * p.spanU(i).invHalfWidth; };
      const auto t = [&](double x) { return (x - p.spanV(j).center) * p.spanV(j).invHalfWidth; };
      push({piece.bound, -1, leaf.patch, i, j, s(leaf.u0), s(leaf.u1), t(leaf.v0), t(leaf.v1)});
      continue;
    }
    const NurbsPatch& p = patch(piece.patch);
    const double* c = p.spanCoefficients(piece.i, piece.j);
    const double sm = 0.5 * (piece.s0 + piece.s1), tm = 0.5 * (piece.t0 + piece.t1);
    for (int k = 0; k < 4; ++k) {
      Piece child = piece;
      (k % 2 ? child.s0 : child.s1) = sm;
      (k / 2 ? child.t0 : child.t1) = tm;
      // Two bounds: distance to the hull's box, and the hull's extent along the line of sight to the piece's middle.
      // The second errs by the square of the piece's size only, so that few pieces remain around the foot.
      const Vec3 middle = p.calcPoint(p.spanU(piece.i).center + 0.5 * (child.s0 + child.s1) / p.spanU(piece.i).invHalfWidth,
                                      p.spanV(piece.j).center + 0.5 * (child.t0 + child.t1) / p.spanV(piece.j).invHalfWidth);
      const Vec3 sight = (middle - Q).normalized();
      Eigen::AlignedBox3d box;
      double along = kInfinity;
      detail::visitHull(c, p.data().degreeU, p.data().degreeV, child.s0, child.s1, child.t0, child.t1, [&](const Vec3& P) {
        box.extend(P);
        along = std::min(along, (P - Q).dot(sight));
      });
      child.bound = std::max({piece.bound, std::sqrt(squaredDistance(box, Q)), along});
      push(child);
    }
  }
  // Every piece was shown to be no nearer than the foot known at that time, less the gap.
  result.lowerBound_m = std::max(0.0, std::abs(result.foot.distance_m) - gap_m);
  result.certified = true;
  return result;
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
