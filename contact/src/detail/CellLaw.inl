#pragma once

// The region s > 0 of one cell and a pressure law in it, line by line; included once per instruction set with GENU_ISA set to its
// namespace, see FootKernel.h.

#include "CellKernel.h"
#include "CellRule.h"
#include "Lanes.inl"

namespace genu::contact::detail::GENU_ISA {

namespace {

// ---- lines ------------------------------------------------------------------------------------------------------

/** Where lines of one cell meet the rim: s > 0 between lo and hi where s bends down along them, outside where it bends up. */
struct LineBorders {
  V lo, hi;
};
inline LineBorders findBorders(const Lines& lines, double c2, V a) {
  const V c0 = lines.s0 + a * (lines.sa + lines.saa * a), c1 = lines.sb + lines.sab * a;
  const V discriminant = c1 * c1 - 4 * c2 * c0;
  const Mask crosses = discriminant > 0;
  const V root = squareRoot(choose(crosses, discriminant, V{}));
  const V q = -0.5 * (c1 + choose(c1 < 0, -root, root));
  const V r1 = q / c2, r2 = choose(q != 0, c0 / q, r1);
  V lo = choose(r1 < r2, r1, r2), hi = choose(r1 < r2, r2, r1);
  lo = choose(lo > -0.5, lo, all(-0.5));
  lo = choose(lo < 0.5, lo, all(0.5));
  hi = choose(hi > -0.5, hi, all(-0.5));
  hi = choose(hi < 0.5, hi, all(0.5));
  return {choose(crosses, lo, all(-0.5)), choose(crosses, hi, all(-0.5))};
}
/** The second derivative along the lines, not zero: the second root is then far away. */
inline double findBend(const Lines& lines) { return absolute(lines.sbb) > 1e-300 ? lines.sbb : 1e-300; }

inline void padLines(Lines& lines) {
  for (; lines.count % kLanes != 0; ++lines.count) lines.a[lines.count] = lines.weight[lines.count] = 0;
}

/** Sums over the lanes of eight vectors. */
GENU_INLINE Line sumLanes(const V (&x)[8]) {
  Line turned[kLanes];
  turn(x, turned);
  Line total = turned[0];
#pragma GCC unroll 8
  for (int l = 1; l < kLanes; ++l) total += turned[l];
  return total;
}

/** int xi^a eta^b up to degree kDegree, from padded lines. */
template <int kDegree>
void sumArea(const Lines& lines, double* area) {
  constexpr double kFull[5] = {1, 0, 1.0 / 12, 0, 1.0 / 80};  // int b^k over the cell
  constexpr double kInverse[5] = {1, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5};
  const double c2 = findBend(lines), outside = c2 > 0 ? 1 : 0, sign = c2 > 0 ? -1 : 1;
  V sums[16] = {};
  for (int first = 0; first < lines.count; first += kLanes) {
    const V a = loadLanes(lines.a + first);
    const LineBorders at = findBorders(lines, c2, a);
    const V lo = at.lo, hi = at.hi, lo2 = lo * lo, hi2 = hi * hi;
    const V I[5] = {outside * kFull[0] + sign * (hi - lo), (sign / 2) * (hi2 - lo2), outside * kFull[2] + (sign / 3) * (hi2 * hi - lo2 * lo),
                    (sign / 4) * (hi2 * hi2 - lo2 * lo2), outside * kFull[4] + (sign / 5) * (hi2 * hi2 * hi - lo2 * lo2 * lo)};
    V power = loadLanes(lines.weight + first);
    for (int j = 0; j <= kDegree; ++j) {
      for (int k = 0; j + k <= kDegree; ++k) sums[momentIndex(j, k)] += power * I[k];
      power *= a;
    }
  }
  const V low[8] = {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7]};
  double local[16];
  store(sumLanes(low), local);
  if (kDegree > 2) {
    const V high[8] = {sums[8], sums[9], sums[10], sums[11], sums[12], sums[13], sums[14], V{}};
    store(sumLanes(high), local + 8);
  }
  for (int piece = 0; piece < lines.numWhole; ++piece) {
    const double from = lines.from[piece], to = lines.to[piece];
    double powerFrom = from, powerTo = to;
    for (int j = 0; j <= kDegree; ++j) {
      const double integral = (powerTo - powerFrom) * kInverse[j];
      for (int k = 0; j + k <= kDegree; k += 2) local[momentIndex(j, k)] += integral * kFull[k];
      powerFrom *= from;
      powerTo *= to;
    }
  }
  for (int j = 0; j <= kDegree; ++j) {  // from (outer, inner) to (xi, eta)
    for (int k = 0; j + k <= kDegree; ++k) area[momentIndex(j, k)] = local[lines.swapped ? momentIndex(k, j) : momentIndex(j, k)];
  }
}

void calcRimArea(const double* S, double* area) {
  Lines lines;
  findLines(S, lines, true);
  padLines(lines);
  sumArea<4>(lines, area);
}

/** Adds points along lines: `outer` one for each lane, or the same for all. */
inline void addPoints(const Lines& lines, V w, V outer, V inner, LawPoints& points) {
  storeLanes(w, points.w + points.count);
  storeLanes(outer, (lines.swapped ? points.eta : points.xi) + points.count);
  storeLanes(inner, (lines.swapped ? points.xi : points.eta) + points.count);
  points.count += kLanes;
}

/** Nearly linear laws: a polynomial of degree 4 and little more along each line, all lines side by side. */
inline void addMildPoints(const Lines& lines, V weight, V a, V from, V to, LawPoints& points) {
  const V width = to - from, middle = 0.5 * (from + to);
  if (bits(width > 0) == 0) return;
  for (int k = 0; k < 3; ++k) addPoints(lines, weight * width * Gauss<3>::w[k], a, middle + width * Gauss<3>::x[k], points);
}

/** The points of one part of a line, crowded at `from` where the law needs it. */
inline void addLinePoints(const Lines& lines, const GradedRule& rule, double weight, double a, double from, double to, LawPoints& points) {
  const double width = to - from, scale = weight * absolute(width);
  for (int k = 0; k < GradedRule::kPadded; k += kLanes) {
    addPoints(lines, scale * loadLanes(rule.w + k), all(a), from + width * loadLanes(rule.x + k), points);
  }
}

/** Gauss-Legendre points of order 5 on [0, 1]. */
constexpr GradedRule kPlainRule = {0,
                                   {Gauss<5>::x[0] + 0.5, Gauss<5>::x[1] + 0.5, 0.5, Gauss<5>::x[3] + 0.5, Gauss<5>::x[4] + 0.5, 0.5, 0.5, 0.5},
                                   {Gauss<5>::w[0], Gauss<5>::w[1], Gauss<5>::w[2], Gauss<5>::w[3], Gauss<5>::w[4], 0, 0, 0}};

inline void listLinePoints(const Lines& lines, const double* R, const LawShape& shape, bool mild, LawPoints& points) {
  points.count = 0;
  const double c2 = findBend(lines);
  const double q0 = lines.swapped ? R[2] : R[1], q1 = lines.swapped ? R[1] : R[2];
  const double q00 = lines.swapped ? R[4] : R[3], q11 = lines.swapped ? R[3] : R[4];
  for (int first = 0; first < lines.count; first += kLanes) {
    const V a = loadLanes(lines.a + first), weight = loadLanes(lines.weight + first);
    const LineBorders at = findBorders(lines, c2, a);
    const V half = all(0.5);
    const V from[2] = {c2 > 0 ? -half : at.lo, c2 > 0 ? at.hi : half}, to[2] = {c2 > 0 ? at.lo : at.hi, half};
    if (mild) {
      for (int side = 0; side < 2; ++side) addMildPoints(lines, weight, a, from[side], to[side], points);
      continue;
    }
    const V s0 = lines.s0 + a * (lines.sa + lines.saa * a), s1 = lines.sb + lines.sab * a, r0 = R[0] + a * (q0 + q00 * a);
    const auto strainAt = [&](V b) {
      const V s = s0 + b * (s1 + lines.sbb * b);
      return choose(s > 0, s, V{}) * (r0 + b * (q1 + q11 * b));
    };
    for (int side = 0; side < 2; ++side) {
      const Mask used = (to[side] > from[side]) & (weight > 0);
      unsigned rest = static_cast<unsigned>(bits(used));
      if (rest == 0) continue;
      // Between two rims: from each to the middle.
      const unsigned twice = static_cast<unsigned>(bits((from[side] > -0.5) & (to[side] < 0.5)));
      const V middle = 0.5 * (from[side] + to[side]);
      double b0[kLanes], b1[kLanes], bm[kLanes], e0[kLanes], e1[kLanes], em[kLanes];
      storeLanes(from[side], b0);
      storeLanes(to[side], b1);
      storeLanes(middle, bm);
      storeLanes(strainAt(from[side]), e0);
      storeLanes(strainAt(to[side]), e1);
      storeLanes(strainAt(middle), em);
      for (; rest != 0; rest &= rest - 1) {
        const int l = __builtin_ctz(rest);
        const double outer = lines.a[first + l], w = lines.weight[first + l];
        if (twice >> l & 1) {
          const GradedRule& rule = findGraded(shape, em[l]);
          addLinePoints(lines, rule, w, outer, b0[l], bm[l], points);
          addLinePoints(lines, rule, w, outer, b1[l], bm[l], points);
        } else if (e0[l] < 0.5 * e1[l]) {
          addLinePoints(lines, findGraded(shape, e1[l]), w, outer, b0[l], b1[l], points);
        } else if (e1[l] < 0.5 * e0[l]) {
          addLinePoints(lines, findGraded(shape, e0[l]), w, outer, b1[l], b0[l], points);
        } else {
          addLinePoints(lines, kPlainRule, w, outer, b0[l], b1[l], points);
        }
      }
    }
  }
}

/** The lines along which a law is read, padded. */
inline void findLawLines(const double* S, const double* R, const LawShape& shape, bool mild, Lines& lines) {
  findLines(S, lines, false, mild ? nullptr : &shape, R[0]);
  padLines(lines);
}

void listLawPoints(const double* S, const double* R, bool full, const LawShape& shape, LawPoints& points) {
  const LawQuadrature rule = chooseQuadrature(S, R, full, shape);
  if (rule.points == nullptr) {
    Lines lines;
    findLawLines(S, R, shape, rule.mild, lines);
    return listLinePoints(lines, R, shape, rule.mild, points);
  }
  points.count = (rule.points->used + kLanes - 1) / kLanes * kLanes;
  for (int i = 0; i < points.count; ++i) {
    points.w[i] = rule.points->w[i];
    points.xi[i] = rule.points->xi[i];
    points.eta[i] = rule.points->eta[i];
  }
}

// ---- laws -------------------------------------------------------------------------------------------------------

/** A law's table at the strains of all lanes, see PressureTable.h. @pre within the table */
template <bool kWithEnergy, bool kWithSlope>
GENU_INLINE void readTableLanes(const LawTable& table, V strain, V& p, V& dp, V& energy) {
  const V x = choose(strain < 0, V{}, strain) + table.scale;
  const Mask piece = (reinterpret_cast<Mask>(x) >> LawTable::kShift) - static_cast<long>(table.firstBits);
  Line lines[kLanes];
#pragma GCC unroll 8
  for (int l = 0; l < kLanes; ++l) lines[l] = loadLine(table.pieces + LawTable::kStride * piece[l]);
  V c[8];
  turnBack(lines, c);
  const V t = x - c[0];
  p = c[2] + t * (c[3] + t * (c[4] + t * (c[5] + t * (c[6] + t * c[7]))));
  if (kWithSlope) dp = c[3] + t * (2 * c[4] + t * (3 * c[5] + t * (4 * c[6] + t * (5 * c[7]))));
  if (kWithEnergy) {
    energy = c[1] + t * (c[2] + t * (c[3] * (1.0 / 2) + t * (c[4] * (1.0 / 3) + t * (c[5] * (1.0 / 4) +
                    t * (c[6] * (1.0 / 5) + t * (c[7] * (1.0 / 6)))))));
  }
}

/** A law at the strains of all lanes. kTabled: it has a table, and they lie in it. */
template <bool kTabled, bool kWithEnergy, bool kWithSlope>
GENU_INLINE void respond(const LawView& law, V strain, V& p, V& dp, V& energy) {
  if (kTabled) return readTableLanes<kWithEnergy, kWithSlope>(law.pieces, strain, p, dp, energy);
  if (law.kind == LawView::linear) {
    p = law.K_Pa * strain;
    if (kWithSlope) dp = all(law.K_Pa);
    if (kWithEnergy) energy = 0.5 * p * strain;
    return;
  }
  double answers[3][kLanes];
  for (int l = 0; l < kLanes; ++l) {
    double answer[4];
    const double at = strain[l];
    if (law.kind == LawView::table && at < law.pieces.largestStrain) {
      readTable<true>(law.pieces, larger(at, 0.0), answer[0], answer[1], answer[2]);
    } else {
      law.respond(law.self, at, 1, answer);
    }
    for (int k = 0; k < 3; ++k) answers[k][l] = answer[k];
  }
  p = loadLanes(answers[0]);
  dp = loadLanes(answers[1]);
  energy = loadLanes(answers[2]);
}

/** Whether all strains of a cell lie in the law's table. */
inline bool isTabled(const double S[kMonomials], const double R[kSmooth], const LawView& law) {
  const double ratio = R[0] + 0.5 * (absolute(R[1]) + absolute(R[2])) + 0.25 * (larger(R[3], 0.0) + larger(R[4], 0.0));
  return law.kind == LawView::table && upperBound(S) * ratio < law.pieces.largestStrain;
}

/** S and R at points of all lanes. */
GENU_INLINE V evaluateLanes(const double S[kMonomials], V xi, V eta) {
  return S[0] + xi * (S[1] + S[3] * xi + S[5] * eta) + eta * (S[2] + S[4] * eta);
}
GENU_INLINE V evaluateSmoothLanes(const double R[kSmooth], V xi, V eta) { return R[0] + xi * (R[1] + R[3] * xi) + eta * (R[2] + R[4] * eta); }

/** int v xi^a eta^b from the points' weighted values v. */
inline void sumMoments(const LawPoints& points, const double* values, double moments[16]) {
  V sums[16] = {};
  for (int i = 0; i < points.count; i += kLanes) {
    const V v = loadLanes(values + i), xi = loadLanes(points.xi + i), eta = loadLanes(points.eta + i);
    V power[5] = {v, v * xi, v * xi * xi, {}, {}};
    power[3] = power[2] * xi;
    power[4] = power[3] * xi;
    for (int a = 0; a <= 4; ++a) {
      V value = power[a];
      for (int b = 0; a + b <= 4; ++b) {
        sums[momentIndex(a, b)] += value;
        value *= eta;
      }
    }
  }
  const V low[8] = {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7]};
  const V high[8] = {sums[8], sums[9], sums[10], sums[11], sums[12], sums[13], sums[14], V{}};
  store(sumLanes(low), moments);
  store(sumLanes(high), moments + 8);
}

/** Moments of a law at the points of a rule for whole cells. */
template <bool kTabled, bool kWithEnergy, bool kWithSlope>
void calcPointMoments(const double S[kMonomials], const double R[kSmooth], const LawView& law, const PointRule& rule, CellMoments& m) {
  constexpr int kPoints = PointRule::kMost;
  double ps[kPoints], energies[kPoints], xs[kPoints], ys[kPoints];
  for (int i = 0; i < rule.used; i += kLanes) {
    const V xi = loadLanes(rule.xi + i), eta = loadLanes(rule.eta + i);
    const V s = evaluateLanes(S, xi, eta), r = evaluateSmoothLanes(R, xi, eta);
    V p, dp = {}, energy = {};
    respond<kTabled, kWithEnergy, kWithSlope>(law, s * r, p, dp, energy);
    storeLanes(p, ps + i);
    if (kWithEnergy) storeLanes(energy, energies + i);
    if (kWithSlope) {
      storeLanes(dp * r, xs + i);
      storeLanes(dp * s, ys + i);
    }
  }
  Line pressure = {}, energy = {}, slopeR[2] = {}, slopeS[2] = {};
  for (int i = 0; i < rule.used; ++i) {
    const Line smooth = loadLine(rule.smooth[i]);
    pressure += ps[i] * smooth;
    if (kWithEnergy) energy += energies[i] * smooth;
    if (kWithSlope) {
      const Line low = loadLine(rule.moments[i]), high = loadLine(rule.moments[i] + 8);
      slopeR[0] += xs[i] * low;
      slopeR[1] += xs[i] * high;
      slopeS[0] += ys[i] * low;
      slopeS[1] += ys[i] * high;
    }
  }
  store(pressure, m.pressure);
  if (kWithEnergy) store(energy, m.energy);
  for (int k = 0; kWithSlope && k < 2; ++k) {
    store(slopeR[k], m.slopeR + 8 * k);
    store(slopeS[k], m.slopeS + 8 * k);
  }
}

/** Moments of a nonlinear law along lines. */
template <bool kTabled, bool kWithEnergy, bool kWithSlope>
void calcLineMoments(const double S[kMonomials], const double R[kSmooth], const LawQuadrature& rule, const Lines& lines, const LawView& law,
                     CellMoments& m) {
  LawPoints points;
  listLinePoints(lines, R, law.shape, rule.mild, points);
  double x[kWithSlope ? LawPoints::kMost : 1], y[kWithSlope ? LawPoints::kMost : 1];  // w dp r, w dp s
  V pressure[8] = {}, energies[8] = {};
  for (int i = 0; i < points.count; i += kLanes) {
    const V w = loadLanes(points.w + i), xi = loadLanes(points.xi + i), eta = loadLanes(points.eta + i);
    const V s = evaluateLanes(S, xi, eta), r = evaluateSmoothLanes(R, xi, eta);
    V p, dp = {}, energy = {};
    respond<kTabled, kWithEnergy, kWithSlope>(law, s * r, p, dp, energy);
    p *= w;
    pressure[0] += p;
    pressure[1] += p * xi;
    pressure[2] += p * eta;
    pressure[3] += p * xi * xi;
    pressure[4] += p * eta * eta;
    if (kWithEnergy) {
      energy *= w;
      energies[0] += energy;
      energies[1] += energy * xi;
      energies[2] += energy * eta;
      energies[3] += energy * xi * xi;
      energies[4] += energy * eta * eta;
    }
    if (kWithSlope) {
      storeLanes(w * dp * r, x + i);
      storeLanes(w * dp * s, y + i);
    }
  }
  store(sumLanes(pressure), m.pressure);
  if (kWithEnergy) store(sumLanes(energies), m.energy);
  if (kWithSlope) {
    sumMoments(points, x, m.slopeR);
    sumMoments(points, y, m.slopeS);
  }
}

/** Moments of a nonlinear law. */
template <bool kWithEnergy, bool kWithSlope>
void calcLawMoments(const double S[kMonomials], const double R[kSmooth], const LawQuadrature& rule, const Lines& lines, const LawView& law,
                    CellMoments& m) {
  const bool tabled = isTabled(S, R, law);
  if (rule.points != nullptr) {
    tabled ? calcPointMoments<true, kWithEnergy, kWithSlope>(S, R, law, *rule.points, m)
           : calcPointMoments<false, kWithEnergy, kWithSlope>(S, R, law, *rule.points, m);
  } else {
    tabled ? calcLineMoments<true, kWithEnergy, kWithSlope>(S, R, rule, lines, law, m)
           : calcLineMoments<false, kWithEnergy, kWithSlope>(S, R, rule, lines, law, m);
  }
}

void readLaw(const double* S, const double* R, const double* share, const LawView& law, const LawPoints& points, LawReading& reading) {
  const bool tabled = isTabled(S, R, law);
  for (int i = 0; i < points.count; i += kLanes) {
    const V xi = loadLanes(points.xi + i), eta = loadLanes(points.eta + i);
    const V s = evaluateLanes(S, xi, eta), r = evaluateSmoothLanes(R, xi, eta);
    storeLanes(s, reading.s + i);
    storeLanes(r, reading.r + i);
    if (share == nullptr) {
      V p, dp, energy;
      tabled ? respond<true, true, true>(law, s * r, p, dp, energy) : respond<false, true, true>(law, s * r, p, dp, energy);
      storeLanes(p, reading.p + i);
      storeLanes(dp, reading.dp + i);
      storeLanes(energy, reading.energy + i);
      continue;
    }
    const V shares = evaluateSmoothLanes(share, xi, eta), strain = s * r;
    for (int l = 0; l < kLanes; ++l) {
      double answer[4];
      law.respond(law.self, strain[l], shares[l], answer);
      reading.p[i + l] = answer[0];
      reading.dp[i + l] = answer[1];
      reading.energy[i + l] = answer[2];
    }
  }
}

void calcEnergyMoments(const double* G, const LawPoints& points, const LawReading& reading, double* byS, double* byR, double* byG) {
  V ofS[8] = {}, ofR[8] = {}, ofG[8] = {};
  for (int i = 0; i < points.count; i += kLanes) {
    const V w = loadLanes(points.w + i), xi = loadLanes(points.xi + i), eta = loadLanes(points.eta + i);
    const V load = w * loadLanes(reading.p + i) * evaluateSmoothLanes(G, xi, eta), energy = w * loadLanes(reading.energy + i);
    const V monomial[kMonomials] = {all(1), xi, eta, xi * xi, eta * eta, xi * eta};
    const V r = load * loadLanes(reading.r + i), s = load * loadLanes(reading.s + i);
    for (int m = 0; m < kMonomials; ++m) ofS[m] += r * monomial[m];
    for (int m = 0; m < kSmooth; ++m) {
      ofR[m] += s * monomial[m];
      ofG[m] += energy * monomial[m];
    }
  }
  store(sumLanes(ofS), byS);
  store(sumLanes(ofR), byR);
  store(sumLanes(ofG), byG);
}

/** Moments of layers in series, whose law depends on the place through the share Q of the fixed layer. */
template <bool kWithSlope>
void calcSharedMoments(const double S[kMonomials], const double R[kSmooth], const double Q[kSmooth], bool full, const LawView& law,
                       CellMoments& m) {
  for (int k = 0; k < kSmooth; ++k) m.pressure[k] = m.energy[k] = 0;
  for (int k = 0; k < kMoments; ++k) m.slopeR[k] = m.slopeS[k] = m.slopeShare[k] = 0;
  LawPoints points;
  listLawPoints(S, R, full, law.shape, points);
  for (int i = 0; i < points.count; ++i) {
    const double w = points.w[i], xi = points.xi[i], eta = points.eta[i];
    if (w == 0) continue;
    const double s = evaluateAt(S, xi, eta), r = evaluateSmoothAt(R, xi, eta);
    double answer[4];
    law.respond(law.self, s * r, evaluateSmoothAt(Q, xi, eta), answer);
    const double monomial[kSmooth] = {1, xi, eta, xi * xi, eta * eta};
    for (int k = 0; k < kSmooth; ++k) {
      m.pressure[k] += w * answer[0] * monomial[k];
      m.energy[k] += w * answer[2] * monomial[k];
    }
    if (!kWithSlope) continue;
    double powerXi = w;
    for (int a = 0; a <= 4; ++a) {
      double power = powerXi;
      for (int b = 0; a + b <= 4; ++b) {
        m.slopeR[momentIndex(a, b)] += answer[1] * r * power;
        m.slopeS[momentIndex(a, b)] += answer[1] * s * power;
        m.slopeShare[momentIndex(a, b)] += answer[3] * power;
        power *= eta;
      }
      powerXi *= xi;
    }
  }
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
