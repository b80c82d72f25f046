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
bool run(Flow& flow, double duration, double longestStep) {
  const int steps = std::max(1, int(std::ceil(duration / longestStep)));
  bool shortest = true;
  for (int i = 0; i < steps; ++i) {
    flow.step(duration / steps);
    shortest = shortest && flow.y[3] >= 0;
  }
  return shortest;
}

constexpr double kCoarseStep = 1.0, kFineStep = 0.2;  // where the shortest half axis is 1
constexpr double kLongestDuration = 25;  // half a turn of an ellipsoid of 100:1, over both its tips, takes 2 ln(400) = 12
constexpr double kNotLonger = 1.03;  // than the shortest string in a plane, with the error of its quadrature
constexpr double kSecondWay = 1.5, kSecondSlope = 1.01, kTie = 1e-2;  // how much longer another way may seem and still be tried
constexpr double kLeastReach = 1e-3;  // over the length
constexpr double kCoarseSize = 1e-3, kCoarseEnough = 1e-2, kFineSize = 1e-7;

struct Guess {
  double theta, duration;
};

/** A geodesic from the tangent at P, and what is missing for its end to be that of a string to Q. */
struct Trial {
  Guess guess;
  Start start;
  Vec3 x, t, b;                // the end, its tangent and the one across
  double h;
  double jacobi, jacobiSlope;  // displacement along b, and its rate along the arc, per angle of the tangent at P
  bool shortest;
  double miss, reach;          // how far the end's tangent passes Q by, along b, and how that changes with the angle at P
  double left;                 // angle on the unit sphere to the place whose tangent goes through Q, where it is that of tangency
  double turn, ahead;          // Newton's step: angle at P, and along the geodesic on the unit sphere
  double length;               // from P to Q, right to second order in the steps

  double calcSize() const { return std::max(std::abs(turn), std::abs(ahead)); }
  /** Of a string: the second variation of its length is not negative. It is 0 in a focus, as on the axis of a body of revolution. */
  bool isMinimum(double tolerance) const { return shortest && reach > -tolerance * length; }

  /** Where Newton's step is too large it is cut. */
  Guess calcNext(double part = 1) const {
    return {guess.theta + part * std::clamp(turn / start.turnByTheta, -0.5, 0.5),
            std::clamp(guess.duration + part * std::clamp(h * ahead, -1.0, 1.0), 0.0, kLongestDuration)};
  }
};

void setEnd(const Problem& p, const Flow& flow, Trial& r) {
  const Vec3 q(flow.y[0], flow.y[1], flow.y[2]), qDot(flow.v[0], flow.v[1], flow.v[2]);
  const Vec3 Dq = p.D.cwiseProduct(q), DqDot = p.D.cwiseProduct(qDot);
  const double h = Dq.norm(), hDot = Dq.dot(DqDot) / h;
  r.h = h;
  r.x = p.D.cwiseProduct(Dq) / h;
  r.t = p.D.cwiseProduct(DqDot - Dq * (hDot / h)).normalized();
  r.b = q.cross(r.t).normalized();
  r.jacobi = flow.y[3] / h;
  r.jacobiSlope = (flow.v[3] - r.jacobi * hDot) * h * r.start.rootF;

  const Vec3 toQ = p.Q - r.x, th = r.t.cwiseQuotient(p.D).normalized();
  const double arc = flow.y[4] / (h * r.start.rootF), freeQ = std::max(0.0, toQ.dot(r.t));
  r.length = r.start.free + arc + toQ.dot(r.t);
  r.miss = toQ.dot(r.b);
  r.reach = r.jacobi + freeQ * r.jacobiSlope;
  r.left = std::atan2(th.dot(p.uQ), r.x.cwiseQuotient(p.D).dot(p.uQ)) - std::atan2(p.sinQ, p.cosQ);
  // A small or negative reach, near or behind a focus, is replaced: the step then still shortens the string.
  r.turn = r.miss / std::max(std::abs(r.reach), kLeastReach * r.length);
  const Vec3 moved = r.jacobi * r.b + r.start.shift * r.t;
  r.ahead = r.left - moved.cwiseQuotient(p.D).dot(th) * r.turn;
}

/** From a place of the curve of tangency of P; the duration is corrected until nothing more than `enough` is left. */
Trial calcTrial(const Problem& p, const Guess& guess, double longestStep, double enough) {
  Trial r;
  r.guess = guess;
  r.start = calcStart(p, guess.theta);
  Flow flow = r.start.flow;
  r.shortest = run(flow, guess.duration, longestStep);
  setEnd(p, flow, r);
  for (int k = 0; k < 4 && std::abs(r.left) > enough; ++k) {
    const double step = std::max(-r.guess.duration, std::clamp(r.h * r.left, -longestStep, longestStep));
    flow.step(step);
    r.guess.duration += step;
    r.shortest = r.shortest && flow.y[3] >= 0;
    setEnd(p, flow, r);
  }
  return r;
}

/** Newton's method with long steps of the flow; it goes part of its way only while the steps do not become smaller. */
bool approach(const Problem& p, Guess guess, Trial& r, int& integrations) {
  if (!(guess.duration <= kLongestDuration)) return false;  // numbers too large for the planes
  double part = 1, last = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 24; ++k) {
    r = calcTrial(p, guess, kCoarseStep, kCoarseEnough);
    ++integrations;
    const double size = r.calcSize();
    if (!std::isfinite(size)) return false;
    part = size < 0.8 * last ? std::min(1.0, 2 * part) : std::max(0.25, 0.5 * part);
    last = size;
    guess = r.calcNext(size < kCoarseSize ? 1 : part);
    if (r.calcSize() < kCoarseSize) {
      r.guess = guess;
      return r.isMinimum(kLeastReach);
    }
  }
  return false;
}

/** Newton's method with short steps; the last one is applied to the result itself. */
bool finish(const Problem& p, Guess guess, EllipsoidGeodesic& g, int& integrations) {
  for (int k = 0; k < 12; ++k) {
    const Trial r = calcTrial(p, guess, kFineStep, kFineSize);
    ++integrations;
    if (!std::isfinite(r.calcSize())) return false;
    guess = r.calcNext();
    if (!(r.calcSize() < kFineSize)) continue;
    if (!r.isMinimum(1e-9)) return false;
    const Start start = calcStart(p, guess.theta);
    const Vec3 bh = r.b.cwiseQuotient(p.D), th = r.t.cwiseQuotient(p.D);
    const double along = (r.left - r.turn * r.jacobi * bh.dot(th) / th.norm()) / th.norm();
    const Vec3 xh = (r.x + r.turn * r.jacobi * r.b + along * r.t).cwiseQuotient(p.D).normalized();
    const Vec3 n = xh.cwiseQuotient(p.D).normalized();
    g.tangentP_m = start.x;
    g.directionP = start.t;
    g.tangentQ_m = p.D.cwiseProduct(xh);
    g.directionQ = r.t + r.turn * r.jacobiSlope * r.b;
    g.directionQ = (g.directionQ - n.dot(g.directionQ) * n).normalized();
    g.freeP_m = start.free;
    g.freeQ_m = p.sinQ / p.cosQ / g.directionQ.cwiseQuotient(p.D).norm();
    g.arc_m = std::max(0.0, r.length - g.freeP_m - g.freeQ_m);
    g.theta = guess.theta;
    g.duration = guess.duration;
    g.converged = true;
    return true;
  }
  return false;
}

constexpr int kPlanes = 16;

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

/** Duration to the first place whose tangent plane goes through Q, by steps and then Newton's method; < 0 if there is none. */
double findDuration(const Problem& p, double theta) {
  Trial r;
  r.start = calcStart(p, theta);
  Flow flow = r.start.flow;
  double duration = 0;
  setEnd(p, flow, r);
  while (!(r.left <= 0)) {
    if (!(duration < kLongestDuration)) return -1;
    flow.step(0.5);
    duration += 0.5;
    setEnd(p, flow, r);
  }
  for (int k = 0; k < 3 && duration > 0; ++k) {
    const double step = std::clamp(r.h * r.left, -1.0, 1.0);
    flow.step(step);
    duration += step;
    setEnd(p, flow, r);
  }
  return std::isfinite(duration) ? std::max(0.0, duration) : -1;
}

double calcLength(const EllipsoidGeodesic& g) { return g.freeP_m + g.arc_m + g.freeQ_m; }

void scale(EllipsoidGeodesic& g, double unit_m) {
  for (double* length : {&g.freeP_m, &g.arc_m, &g.freeQ_m}) *length *= unit_m;
  g.tangentP_m *= unit_m;
  g.tangentQ_m *= unit_m;
}

/** The shortest of what Newton finds from all planes and from all changes of sign of the miss along the curve of tangency of P. */
EllipsoidGeodesic search(const Problem& p) {
  EllipsoidGeodesic best;
  int integrations = 0;
  const auto tryGuess = [&](const Guess& guess) {
    Trial trial;
    EllipsoidGeodesic found;
    if (approach(p, guess, trial, integrations) && finish(p, trial.guess, found, integrations) &&
        (!best.converged || calcLength(found) < calcLength(best))) {
      best = found;
    }
  };
  const Planes planes(p);
  for (int i = 0; i < kPlanes; ++i) tryGuess(planes.calcGuess(planes.calcString(2 * kPi * i / kPlanes)));

  constexpr int kStarts = 64;
  const double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto calcMiss = [&](double theta, Guess& guess) {
    guess = {theta, findDuration(p, theta)};
    ++integrations;
    return guess.duration < 0 ? kNone : calcTrial(p, guess, kCoarseStep, kCoarseEnough).miss;
  };
  Guess guess, before;
  double missBefore = calcMiss(0, before);
  for (int k = 1; k <= kStarts; ++k) {
    const double miss = calcMiss(2 * kPi * k / kStarts, guess);
    if (missBefore * miss <= 0) {
      Guess low = before, high = guess, middle = guess;
      for (int i = 0; i < 6; ++i) {
        const bool sameSide = calcMiss(0.5 * (low.theta + high.theta), middle) * missBefore > 0;
        (sameSide ? low : high) = middle;
      }
      if (middle.duration >= 0) tryGuess(middle);
    }
    before = guess;
    missBefore = miss;
  }
  best.integrations = integrations;
  return best;
}

}  // namespace

EllipsoidGeodesic searchGeodesic(const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m) {
  const double unit_m = halfAxes_m.minCoeff();
  EllipsoidGeodesic g = search(Problem(halfAxes_m, p_P_m, p_Q_m, unit_m));
  scale(g, unit_m);
  return g;
}

EllipsoidGeodesic findGeodesic(const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m) {
  const double unit_m = halfAxes_m.minCoeff();
  const Problem problem(halfAxes_m, p_P_m, p_Q_m, unit_m);
  const Planes planes(problem);
  std::array<Planes::String, kPlanes> strings;
  for (int i = 0; i < kPlanes; ++i) strings[i] = planes.calcString(2 * kPi * i / kPlanes);
  // Two ways are tried: the shortest string, and the shortest other one that is locally shortest or else a quarter of a turn or more away,
  // where the lengths hardly differ.
  std::array<int, 2> ways = {0, -1};
  for (int i = 1; i < kPlanes; ++i) {
    if (strings[i].length < strings[ways[0]].length) ways[0] = i;
  }
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kPlanes; ++i) {
    const double length = strings[i].length;
    const bool local = length <= strings[(i + 1) % kPlanes].length && length < strings[(i + kPlanes - 1) % kPlanes].length;
    const int apart = std::abs(i - ways[0]), turn = std::min(apart, kPlanes - apart);
    const double allowed = turn == 0 ? 0 : local ? kSecondWay : turn >= kPlanes / 4 ? kSecondSlope : 0;
    if (length < allowed * strings[ways[0]].length && length < least) {
      ways[1] = i;
      least = length;
    }
  }
  EllipsoidGeodesic result;
  int integrations = 0;
  std::array<Trial, 2> trials;
  std::array<bool, 2> found = {false, false};
  for (int k = 0; k < 2; ++k) {
    const int i = ways[k];
    if (i < 0) continue;
    // The minimum of the parabola through three planes.
    const double before = strings[(i + kPlanes - 1) % kPlanes].length, at = strings[i].length, after = strings[(i + 1) % kPlanes].length;
    const double bend = before - 2 * at + after;
    const double turn = 2 * kPi / kPlanes * (i + (bend > 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0));
    const Planes::String refined = planes.calcString(turn);
    const Planes::String& start = refined.length < at ? refined : strings[i];
    found[k] = approach(problem, planes.calcGuess(start), trials[k], integrations) &&
               trials[k].length <= kNotLonger * strings[ways[0]].length;
  }
  for (int k = 0; k < 2; ++k) {
    if (!found[k] || (found[1 - k] && trials[k].length > (1 + kTie) * trials[1 - k].length)) continue;
    EllipsoidGeodesic candidate;
    if (finish(problem, trials[k].guess, candidate, integrations) &&
        (!result.converged || calcLength(candidate) < calcLength(result))) {
      result = candidate;
    }
  }
  if (!result.converged) result = search(problem);
  result.integrations += integrations;
  scale(result, unit_m);
  return result;
}

Vec3 calcPointOnGeodesic_m(const EllipsoidGeodesic& geodesic, const Vec3& halfAxes_m, const Vec3& p_P_m, const Vec3& p_Q_m, double part) {
  const double unit_m = halfAxes_m.minCoeff();
  const Problem problem(halfAxes_m, p_P_m, p_Q_m, unit_m);
  return calcTrial(problem, {geodesic.theta, part * geodesic.duration}, kFineStep, std::numeric_limits<double>::infinity()).x * unit_m;
}

}  // namespace genu::musculoskeletal
