#include "EllipsoidGeodesic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace genu::musculoskeletal {

namespace {

using contact::kPi;

constexpr int kComponents = 5;  // the normal q, the Jacobi field times h, and z of the arc length
using State = std::array<double, kComponents>;

/** Moves y'' = (mu(q) - c) y, mu = 2 q.Aq - 2E, A the first three of c. */
struct Flow {
  State y, v, c;
  double twiceEnergy;

  State calcAcceleration(const State& at) const {
    const double mu = 2 * (c[0] * at[0] * at[0] + c[1] * at[1] * at[1] + c[2] * at[2] * at[2]) - twiceEnergy;
    State a;
    for (int i = 0; i < kComponents; ++i) a[i] = (mu - c[i]) * at[i];
    return a;
  }

  void step(double H);
};

constexpr int kRows = 6;

/** At 0, of the polynomial in 1/n^2 through values at n = 1 to kRows. */
constexpr std::array<double, kRows + 1> calcExtrapolationWeights() {
  std::array<double, kRows + 1> weights{};
  for (int n = 1; n <= kRows; ++n) {
    weights[n] = 1;
    for (int j = 1; j <= kRows; ++j) {
      if (j != n) weights[n] *= double(n * n) / double(n * n - j * j);
    }
  }
  return weights;
}

/** Stoermer's rule in 1 to 6 parts, whose error is a series in even powers of a part's length: extrapolated, of order 12 [Hairer, Norsett &
 Wanner, Solving Ordinary Differential Equations I, section II.14]. */
void Flow::step(double H) {
  constexpr std::array<double, kRows + 1> kWeights = calcExtrapolationWeights();
  const State a0 = calcAcceleration(y);
  State dy{}, dv{};
  for (int n = 1; n <= kRows; ++n) {
    const double h = H / n;
    State moved, at, a, delta;
    for (int i = 0; i < kComponents; ++i) {
      moved[i] = delta[i] = h * (v[i] + 0.5 * h * a0[i]);
      at[i] = y[i] + moved[i];
    }
    a = calcAcceleration(at);
    for (int k = 1; k < n; ++k) {
      for (int i = 0; i < kComponents; ++i) {
        delta[i] += h * h * a[i];
        moved[i] += delta[i];
        at[i] = y[i] + moved[i];
      }
      a = calcAcceleration(at);
    }
    for (int i = 0; i < kComponents; ++i) {
      dy[i] += kWeights[n] * moved[i];
      dv[i] += kWeights[n] * (delta[i] / h - v[i] + 0.5 * h * a[i]);
    }
  }
  for (int i = 0; i < kComponents; ++i) {
    y[i] += dy[i];
    v[i] += dv[i];
  }
}

constexpr double kLongestStep = 0.8;  // in 1/sqrt(largest of A): the shortest half axis is 1

/** Lengths over the shortest half axis. Hatted vectors are divided by the half axes: there the ellipsoid is the unit sphere. */
struct Problem {
  Vec3 D;              // half axes
  Vec3 P, Q;
  Vec3 uP, uQ;         // unit vectors along P^ and Q^
  Vec3 e1, e2;         // complete uP to a frame
  double cosP, sinP;   // the curve of tangency of P is cosP uP + sinP (e1 cos(theta) + e2 sin(theta))
  double cosQ, sinQ;

  Problem(const Vec3& halfAxes, const Vec3& p, const Vec3& q, double unit) : D(halfAxes / unit), P(p / unit), Q(q / unit) {
    const Vec3 Ph = P.cwiseQuotient(D), Qh = Q.cwiseQuotient(D);
    const double rP = Ph.norm(), rQ = Qh.norm();
    uP = Ph / rP;
    uQ = Qh / rQ;
    e1 = uP.unitOrthogonal();
    e2 = uP.cross(e1);
    // An end within rounding inside counts as on the surface.
    cosP = rP > 1 ? 1 / rP : 1;
    sinP = rP > 1 ? std::sqrt((rP - 1) * (rP + 1)) / rP : 0;
    cosQ = rQ > 1 ? 1 / rQ : 1;
    sinQ = rQ > 1 ? std::sqrt((rQ - 1) * (rQ + 1)) / rQ : 0;
  }
};

struct Start {
  Flow flow;
  Vec3 x, t;
  double free;              // length of the tangent from P
  double rootF;
  double turnByTheta;       // angle of the tangent at P, in the surface's tangent plane, per theta
  double shift;             // how far the start moves along the geodesic, per that angle
};

Start calcStart(const Problem& p, double theta) {
  Start s;
  const double cosine = std::cos(theta), sine = std::sin(theta);
  const Vec3 e = cosine * p.e1 + sine * p.e2, across = p.D.cwiseProduct(cosine * p.e2 - sine * p.e1);
  const Vec3 xh = p.cosP * p.uP + p.sinP * e, along = p.D.cwiseProduct(p.cosP * e - p.sinP * p.uP);
  const double speed = along.norm();
  s.x = p.D.cwiseProduct(xh);
  s.t = along / speed;
  s.free = p.sinP / p.cosP * speed;
  const Vec3 A = p.D.cwiseProduct(p.D).cwiseInverse(), normal = xh.cwiseQuotient(p.D), At = A.cwiseProduct(s.t);
  const double nu = normal.norm(), h = 1 / nu, tAt = At.dot(s.t);
  const Vec3 q = normal / nu, qDot = (At - q.dot(At) * q) / std::sqrt(tAt);
  s.rootF = nu * std::sqrt(tAt);
  const Vec3 b = q.cross(s.t);
  s.turnByTheta = across.dot(b) * p.cosP / speed;
  s.shift = p.sinP * across.dot(s.t) / s.turnByTheta;
  const double hDot = q.cwiseProduct(p.D).dot(qDot.cwiseProduct(p.D)) / h;
  s.flow.y = {q[0], q[1], q[2], s.free * h, 0};
  s.flow.v = {qDot[0], qDot[1], qDot[2], 1 / (h * s.rootF) + s.free * hDot, nu};
  s.flow.c = {A[0], A[1], A[2], A[0] * A[1] * A[2] / (s.rootF * s.rootF), 0};
  s.flow.twiceEnergy = qDot.squaredNorm() + q.dot(A.cwiseProduct(q));
  return s;
}

/** @return whether no conjugate point was passed: the geodesic is a locally shortest one */
bool run(Flow& flow, double duration) {
  const int steps = std::max(1, int(std::ceil(duration / kLongestStep)));
  bool shortest = true;
  for (int i = 0; i < steps; ++i) {
    flow.step(duration / steps);
    shortest = shortest && flow.y[3] >= 0;
  }
  return shortest;
}

struct End {
  Vec3 x, t, b;
  double arc, h;
  double jacobi, jacobiSlope;  // displacement along b, and its rate along the arc, per angle of the tangent at P
};

End calcEnd(const Problem& p, const Start& s, const Flow& flow) {
  End e;
  const Vec3 q(flow.y[0], flow.y[1], flow.y[2]), qDot(flow.v[0], flow.v[1], flow.v[2]);
  const Vec3 Dq = p.D.cwiseProduct(q), DqDot = p.D.cwiseProduct(qDot);
  e.h = Dq.norm();
  const double hDot = Dq.dot(DqDot) / e.h;
  e.x = p.D.cwiseProduct(Dq) / e.h;
  e.t = p.D.cwiseProduct(DqDot - Dq * (hDot / e.h)).normalized();
  e.b = q.cross(e.t).normalized();
  e.arc = flow.y[4] / (e.h * s.rootF);
  e.jacobi = flow.y[3] / e.h;
  e.jacobiSlope = (flow.v[3] - e.jacobi * hDot) * e.h * s.rootF;
  return e;
}

struct Guess {
  double theta, duration;
};

constexpr int kMaxIntegrations = 25;

/** Newton's method for theta and the duration, so that the tangent at the end points at Q. */
bool solve(const Problem& p, Guess guess, EllipsoidGeodesic& r, double longest) {
  const double angleQ = std::atan2(p.sinQ, p.cosQ);
  double last = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kMaxIntegrations; ++k) {
    const Start s = calcStart(p, guess.theta);
    Flow flow = s.flow;
    const bool shortest = run(flow, guess.duration);
    const End e = calcEnd(p, s, flow);
    ++r.integrations;
    // Across: Q seen from the tangent. Along: the angle that is left to the place whose tangent goes through Q, where it is that of tangency.
    const Vec3 toQ = p.Q - e.x, th = e.t.cwiseQuotient(p.D).normalized();
    const double left = std::atan2(th.dot(p.uQ), e.x.cwiseQuotient(p.D).dot(p.uQ)) - angleQ;
    const double freeQ = std::max(0.0, toQ.dot(e.t)), miss = toQ.dot(e.b);
    const double reach = e.jacobi + freeQ * e.jacobiSlope;
    if (!std::isfinite(miss) || !std::isfinite(left) || !std::isfinite(reach)) return false;
    const double floor = 0.05 * (e.arc + s.free + freeQ);
    const double turn = miss / std::max(std::abs(reach), floor);
    const Vec3 moved = e.jacobi * e.b + s.shift * e.t;
    const double ahead = left - moved.cwiseQuotient(p.D).dot(th) * turn;
    const double size = std::max(std::abs(turn), std::abs(ahead));
    if (size < 1e-12 || (size < 1e-9 && size >= last)) {
      if (!shortest || !(reach > 0) || !(guess.duration >= 0)) return false;
      r.freeP_m = s.free;
      r.arc_m = e.arc;
      r.freeQ_m = p.sinQ / p.cosQ * p.D.cwiseProduct(th).norm();
      if (!(r.freeP_m + r.arc_m + r.freeQ_m <= longest)) return false;
      r.tangentP_m = s.x;
      r.tangentQ_m = e.x;
      r.directionP = s.t;
      r.directionQ = e.t;
      r.theta = guess.theta;
      r.duration = guess.duration;
      r.converged = true;
      return true;
    }
    last = size;
    guess.theta += std::clamp(turn / s.turnByTheta, -0.5, 0.5);
    guess.duration = std::max(0.0, guess.duration + std::clamp(e.h * ahead, -1.0, 1.0));
  }
  return false;
}

/** Taut strings in the planes through P and Q: each cuts the unit sphere in a circle. The first way: the plane through the centre, on the
 side away from it; others turn about the line PQ. */
struct Planes {
  const Problem& p;
  Vec3 line, up, across;   // unit vectors: from P^ to Q^; from the centre to the line; their product
  double height, alongP, alongQ;

  explicit Planes(const Problem& problem) : p(problem) {
    const Vec3 Ph = p.P.cwiseQuotient(p.D), Qh = p.Q.cwiseQuotient(p.D);
    line = (Qh - Ph).normalized();
    alongP = Ph.dot(line);
    alongQ = Qh.dot(line);
    const Vec3 foot = Ph - alongP * line;
    height = foot.norm();
    if (height > 1e-12) {
      up = (foot - foot.dot(line) * line).normalized();
    } else {  // through the centre: any plane is as good, this one is decided by the line
      height = 0;
      up = line.unitOrthogonal();
    }
    across = line.cross(up);
  }

  struct String {
    double length, duration;
    Vec3 tangentP, along;  // on the unit sphere
  };

  String calcString(double turn) const {
    const double cosine = std::cos(turn), sine = std::sin(turn);
    const Vec3 e = cosine * up + sine * across;
    const Vec3 centre = height * sine * (sine * up - cosine * across);
    const double radius2 = std::max(1e-300, 1 - height * height * sine * sine), radius = std::sqrt(radius2), y = height * cosine;
    // In the plane, from the circle's centre: P = (alongP, y), Q = (alongQ, y). Tangent points, over the radius, going over the top.
    const double rP2 = alongP * alongP + y * y, rQ2 = alongQ * alongQ + y * y;
    const double freeP = std::sqrt(std::max(0.0, rP2 - radius2)), freeQ = std::sqrt(std::max(0.0, rQ2 - radius2));
    const double xP = (alongP * radius + y * freeP) / rP2, yP = (y * radius - alongP * freeP) / rP2;
    const double xQ = (alongQ * radius - y * freeQ) / rQ2, yQ = (y * radius + alongQ * freeQ) / rQ2;
    double angle = std::atan2(xP * yQ - yP * xQ, xP * xQ + yP * yQ);  // clockwise, < 0
    angle = angle > 1e-9 ? 2 * kPi - angle : -std::min(angle, 0.0);
    String s;
    s.tangentP = centre + radius * (xP * line + yP * e);
    s.along = yP * line - xP * e;
    const Vec3 endAlong = yQ * line - xQ * e;
    s.length = freeP * s.along.cwiseProduct(p.D).norm() + freeQ * endAlong.cwiseProduct(p.D).norm();
    s.duration = 0;
    // Midpoint rule; the direction turns by the angle of a part.
    constexpr int kParts = 8;
    const double part = angle / kParts, c = std::cos(part), d = std::sin(part);
    const double half = 0.5 * part, cHalf = std::cos(half), sHalf = std::sin(half);
    double x = xP * cHalf + yP * sHalf, w = yP * cHalf - xP * sHalf;
    for (int i = 0; i < kParts; ++i) {
      const double ds = radius * part;
      s.length += ds * (w * line - x * e).cwiseProduct(p.D).norm();
      s.duration += ds / (centre + radius * (x * line + w * e)).cwiseQuotient(p.D).norm();
      const double next = x * c + w * d;
      w = w * c - x * d;
      x = next;
    }
    return s;
  }

  Guess calcGuess(const String& s) const {
    // Both the place of tangency and the direction there tell theta; one of them always does.
    const Vec3 e = p.sinP * s.tangentP + p.cosP * s.along;
    return {std::atan2(e.dot(p.e2), e.dot(p.e1)), s.duration};
  }
};

}  // namespace

EllipsoidGeodesic findGeodesic(const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m) {
  const double unit_m = halfAxes_m.minCoeff();
  const Problem problem(halfAxes_m, p_P_m, p_Q_m, unit_m);
  const Planes planes(problem);
  constexpr int kPlanes = 16;
  std::array<Planes::String, kPlanes> strings;
  for (int i = 0; i < kPlanes; ++i) strings[i] = planes.calcString(2 * kPi * i / kPlanes);
  int best = -1, second = -1;
  for (int i = 0; i < kPlanes; ++i) {
    const double length = strings[i].length;
    if (length > strings[(i + 1) % kPlanes].length || length >= strings[(i + kPlanes - 1) % kPlanes].length) continue;
    if (best < 0 || length < strings[best].length) {
      second = best;
      best = i;
    } else if (second < 0 || length < strings[second].length) {
      second = i;
    }
  }
  EllipsoidGeodesic result;
  if (best < 0) best = 0;
  int integrations = 0;
  for (const int i : {best, second}) {
    if (i < 0 || (i == second && result.converged && strings[second].length > 1.25 * strings[best].length)) continue;
    // The minimum of the parabola through three planes.
    const double before = strings[(i + kPlanes - 1) % kPlanes].length, at = strings[i].length, after = strings[(i + 1) % kPlanes].length;
    const double bend = before - 2 * at + after;
    const double turn = 2 * kPi / kPlanes * (i + (bend > 0 ? 0.5 * (before - after) / bend : 0));
    const Planes::String refined = planes.calcString(turn);
    const Planes::String& start = refined.length < at ? refined : strings[i];
    EllipsoidGeodesic candidate;
    solve(problem, planes.calcGuess(start), candidate, 1.2 * start.length);
    integrations += candidate.integrations;
    const auto length = [](const EllipsoidGeodesic& g) { return g.freeP_m + g.arc_m + g.freeQ_m; };
    if (candidate.converged && (!result.converged || length(candidate) < length(result))) result = candidate;
  }
  result.integrations = integrations;
  for (double* length : {&result.freeP_m, &result.arc_m, &result.freeQ_m}) *length *= unit_m;
  result.tangentP_m *= unit_m;
  result.tangentQ_m *= unit_m;
  return result;
}

Vec3 calcPointOnGeodesic_m(const EllipsoidGeodesic& geodesic, const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m, double part) {
  const double unit_m = halfAxes_m.minCoeff();
  const Problem problem(halfAxes_m, p_P_m, p_Q_m, unit_m);
  const Start start = calcStart(problem, geodesic.theta);
  Flow flow = start.flow;
  run(flow, part * geodesic.duration);
  return calcEnd(problem, start, flow).x * unit_m;
}

}  // namespace genu::musculoskeletal
