#pragma once

// Integration of the pressure over the part of one grid cell where the surfaces overlap (docs/theory.md, "Smooth rim").
//
// In a cell, xi and eta in [-1/2, 1/2] along x and z, the penetration s (> 0 in contact) and the ratio r = c/h (strain = s r)
// are polynomials through the nodes of the 3 x 3 stencil around it:
//   s = sum S_cd xi^c eta^d,  cd in {00, 10, 01, 20, 02, 11};   smooth weights g: the same without 11.
// The moments  A_ab = int_{s>0} xi^a eta^b  and  M_ab = int_{s>0} P(s r) xi^a eta^b  then give every net quantity as a sum over
// nodes. P(0) = 0, so that the moving rim adds nothing to the derivative of M: the net load is C1 in the pose.
//
// Order of the nodes of a stencil: C, E (+x), W, N (+z), S, NE, NW, SE, SW. Order of monomials: 1, xi, eta, xi^2, eta^2, xi eta.
//
// This file is compiled once per instruction set (CellKernel.h). Everything has internal linkage and no library header is
// included, so that code for one processor cannot take the place of the same function elsewhere.

#include "CellKernel.h"

namespace genu::contact::detail {
namespace {

#ifndef GENU_INLINE
#define GENU_INLINE inline __attribute__((always_inline))
#endif

inline double absolute(double x) { return __builtin_fabs(x); }
inline double larger(double a, double b) { return a > b ? a : b; }
inline double smaller(double a, double b) { return a < b ? a : b; }
inline double clampToCell(double x) { return smaller(0.5, larger(-0.5, x)); }

constexpr int kStencil = 9;       // nodes
constexpr int kMonomials = 6;     // of s
constexpr int kSmooth = 5;        // of weights
constexpr int kPowers[kMonomials][2] = {{0, 0}, {1, 0}, {0, 1}, {2, 0}, {0, 2}, {1, 1}};
constexpr int kMoments = 15;      // xi^a eta^b, a + b <= 4
constexpr int momentIndex(int a, int b) { return (a + b) * (a + b + 1) / 2 + b; }

/** Which neighbors of a cell can be used: bit 0 E, 1 W, 2 N, 3 S, 4 all four corners. */
constexpr int kAllNeighbors = 31;

}  // namespace

/** Weights T[monomial][node] of a stencil whose neighbors are given by a mask: central differences where both neighbors
 exist, one-sided first differences where one does, nothing where none does. */
struct StencilWeights {
  double T[6][9];
};
/** One of the 32 tables, made once. */
const StencilWeights& stencilWeights(int mask);

namespace {

/** Coefficients of s from the nodes' values. */
inline void calcCoefficients(const double* s, int mask, double S[kMonomials]) {
  if (mask == kAllNeighbors) {
    S[0] = s[0];
    S[1] = 0.5 * (s[1] - s[2]);
    S[2] = 0.5 * (s[3] - s[4]);
    S[3] = 0.5 * (s[1] + s[2]) - s[0];
    S[4] = 0.5 * (s[3] + s[4]) - s[0];
    S[5] = 0.25 * (s[5] - s[6] - s[7] + s[8]);
    return;
  }
  const StencilWeights& w = stencilWeights(mask);
  for (int m = 0; m < kMonomials; ++m) {
    S[m] = 0;
    for (int k = 0; k < kStencil; ++k) {
      if (w.T[m][k] != 0) S[m] += w.T[m][k] * s[k];  // an unusable node may hold anything
    }
  }
}

/** Coefficients of a smooth quantity of the nodes, as of r = c/h, in a cell. */
template <class OfNode>
inline void gatherSmooth(const OfNode& ofNode, const int* stencil, int mask, double R[kSmooth]) {
  if ((mask & 15) == 15) {
    const double c = ofNode(stencil[0]), e = ofNode(stencil[1]), w = ofNode(stencil[2]), n = ofNode(stencil[3]), s = ofNode(stencil[4]);
    R[0] = c;
    R[1] = 0.5 * (e - w);
    R[2] = 0.5 * (n - s);
    R[3] = 0.5 * (e + w) - c;
    R[4] = 0.5 * (n + s) - c;
    return;
  }
  double r[kStencil] = {};
  for (int n = 0; n < 5; ++n) r[n] = stencil[n] >= 0 ? ofNode(stencil[n]) : 0;
  double all[kMonomials];
  calcCoefficients(r, mask & 15, all);
  for (int k = 0; k < kSmooth; ++k) R[k] = all[k];
}

/** Node weights of int p g from the moments: sum over k of T[k][n] moments[k], n over the cross C, E, W, N, S. */
template <int kStride>
inline void spreadSmooth(const double moments[kSmooth], int mask, double* weight) {
  if ((mask & 15) == 15) {
    weight[0] = moments[0] - moments[3] - moments[4];
    weight[kStride] = 0.5 * (moments[3] + moments[1]);
    weight[2 * kStride] = 0.5 * (moments[3] - moments[1]);
    weight[3 * kStride] = 0.5 * (moments[4] + moments[2]);
    weight[4 * kStride] = 0.5 * (moments[4] - moments[2]);
    return;
  }
  const StencilWeights& T = stencilWeights(mask);
  for (int n = 0; n < 5; ++n) {
    double sum = 0;
    for (int k = 0; k < kSmooth; ++k) sum += T.T[k][n] * moments[k];
    weight[kStride * n] = sum;
  }
}

inline double evaluateAt(const double* S, double xi, double eta) {
  return S[0] + xi * (S[1] + S[3] * xi + S[5] * eta) + eta * (S[2] + S[4] * eta);
}
/** Bounds of s over the cell. */
inline double upperBound(const double S[kMonomials]) {
  return S[0] + 0.5 * (absolute(S[1]) + absolute(S[2])) + 0.25 * (larger(S[3], 0.0) + larger(S[4], 0.0) + absolute(S[5]));
}
inline double lowerBound(const double S[kMonomials]) {
  return S[0] - 0.5 * (absolute(S[1]) + absolute(S[2])) + 0.25 * (smaller(S[3], 0.0) + smaller(S[4], 0.0) - absolute(S[5]));
}
/** Largest change of s anywhere in the cell when no node's s changes by more than 1: the sum of the absolute node weights
 at the worst corner, 7/4 for the full stencil, up to 13/4 for one-sided ones. */
constexpr double kFullGain = 1.75, kEdgeGain = 3.25;
inline double largestGain(int mask) { return mask == kAllNeighbors ? kFullGain : kEdgeGain; }

/** Coefficients of the strain s r in a cell. */
inline void gatherStrain(const int* stencil, const char* usable, const double* s, const double* r, int mask, double E[kMonomials]) {
  double strain[kStencil];
  for (int n = 0; n < kStencil; ++n) {
    const int k = stencil[n];
    strain[n] = k >= 0 && usable[k] ? s[k] * r[k] : 0;
  }
  calcCoefficients(strain, mask, E);
}

/** Largest value of the polynomial in the cell and where. */
inline double findMaximum(const double S[kMonomials], double& xiBest, double& etaBest) {
  double best = -1e300;
  const auto take = [&](double xi, double eta) {
    const double value = evaluateAt(S, xi, eta);
    if (value > best) {
      best = value;
      xiBest = xi;
      etaBest = eta;
    }
  };
  const double det = 4 * S[3] * S[4] - S[5] * S[5];
  if (S[3] < 0 && det > 0) {
    const double xi = (-2 * S[4] * S[1] + S[5] * S[2]) / det, eta = (-2 * S[3] * S[2] + S[5] * S[1]) / det;
    if (absolute(xi) <= 0.5 && absolute(eta) <= 0.5) {
      take(xi, eta);
      return best;
    }
  }
  for (double side = -0.5; side < 1; side += 1) {
    take(side, -0.5);
    take(side, 0.5);
    if (S[4] < 0) take(side, clampToCell(-(S[2] + S[5] * side) / (2 * S[4])));
    if (S[3] < 0) take(clampToCell(-(S[1] + S[5] * side) / (2 * S[3])), side);
  }
  return best;
}

/** Real roots of a + b t + c t^2, ascending; returns their number. */
inline int solveQuadratic(double a, double b, double c, double root[2]) {
  // A quadratic term that cannot matter within |t| <= 1/2 of the cell: linear.
  if (absolute(c) <= 1e-14 * larger(absolute(a), absolute(b))) {
    if (b == 0) return 0;
    root[0] = -a / b;
    return 1;
  }
  const double discriminant = b * b - 4 * a * c;
  if (!(discriminant > 0)) return 0;
  const double q = -0.5 * (b + __builtin_copysign(__builtin_sqrt(discriminant), b));
  root[0] = q / c;
  root[1] = q != 0 ? a / q : root[0];
  if (root[0] > root[1]) {
    const double t = root[0];
    root[0] = root[1];
    root[1] = t;
  }
  return 2;
}

/** Gauss-Legendre nodes and weights on [-1/2, 1/2]. */
template <int N>
struct Gauss;
template <>
struct Gauss<3> {
  static constexpr int n = 3;
  static constexpr double x[3] = {-0.3872983346207417, 0, 0.3872983346207417};
  static constexpr double w[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
};
template <>
struct Gauss<4> {
  static constexpr int n = 4;
  static constexpr double x[4] = {-0.4305681557970263, -0.1699905217924281, 0.1699905217924281, 0.4305681557970263};
  static constexpr double w[4] = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269};
};
template <>
struct Gauss<5> {
  static constexpr int n = 5;
  static constexpr double x[5] = {-0.4530899229693320, -0.2692346550528416, 0, 0.2692346550528416, 0.4530899229693320};
  static constexpr double w[5] = {0.1184634425280945, 0.2393143352496832, 0.2844444444444444, 0.2393143352496832, 0.1184634425280945};
};
template <>
struct Gauss<6> {
  static constexpr int n = 6;
  static constexpr double x[6] = {-0.4662347571015760, -0.3306046932331323, -0.1193095930415984,
                                  0.1193095930415984,  0.3306046932331323,  0.4662347571015760};
  static constexpr double w[6] = {0.0856622461895852, 0.1803807865240693, 0.2339569672863455,
                                  0.2339569672863455, 0.1803807865240693, 0.0856622461895852};
};
template <>
struct Gauss<8> {
  static constexpr int n = 8;
  static constexpr double x[8] = {-0.4801449282487681, -0.3983332387068134, -0.2627662049581645, -0.0917173212478249,
                                  0.0917173212478249,  0.2627662049581645,  0.3983332387068134,  0.4801449282487681};
  static constexpr double w[8] = {0.0506142681451881, 0.1111905172266872, 0.1568533229389437, 0.1813418916891810,
                                  0.1813418916891810, 0.1568533229389437, 0.1111905172266872, 0.0506142681451881};
};

/** Integration lines of the region s > 0 of a cell: outer variable a, inner variable b, the one in which s changes faster;
 `swapped` tells that a is eta. s = s0 + sa a + saa a^2 + (sb + sab a) b + sbb b^2. */
constexpr int kMaxLines = 96;  // 6 splits, at most 12 lines a piece, whole vectors
struct Lines {
  double a[kMaxLines], weight[kMaxLines];
  int count;
  double from[7], to[7];  // pieces whose lines lie in the region from end to end and are not listed
  int numWhole;
  bool swapped;
  double s0, sa, sb, saa, sbb, sab;
};

/** The rule for a law whose strain runs from nearly 0 to `strain`. */
inline const GradedRule& findGraded(const LawShape& shape, double strain) {
  const GradedRule* rule = shape.graded;
  const GradedRule* last = rule + GradedRule::kLevels - 1;
  while (rule != last && strain > shape.atZero * rule->largestRatio) ++rule;
  return *rule;
}

/** Graded rules for a range whose strain is known at both ends and in the middle: none where plain points will do, from both ends
 where the strain vanishes at both (which of them is the shallower one would be decided by rounding). */
struct GradedParts {
  struct Part {
    const GradedRule* rule;
    double from, to;  // crowded at `from`
  } part[2];
  int count;
};
inline GradedParts gradeParts(const LawShape& shape, double from, double to, double strainFrom, double strainMiddle, double strainTo) {
  const double middle = 0.5 * (from + to);
  if (strainFrom < 0.5 * strainMiddle && strainTo < 0.5 * strainMiddle) {
    const GradedRule* rule = &findGraded(shape, strainMiddle);
    return {{{rule, from, middle}, {rule, to, middle}}, 2};
  }
  if (strainFrom < 0.5 * strainTo) return {{{&findGraded(shape, strainTo), from, to}, {}}, 1};
  if (strainTo < 0.5 * strainFrom) return {{{&findGraded(shape, strainFrom), to, from}, {}}, 1};
  return {{}, 0};
}

/** How the region meets a line: the same for all lines of a piece. */
enum class Meeting { none, part, whole };
inline Meeting meetLine(double c0, double c1, double c2) {
  const double low = c0 + 0.25 * c2 - 0.5 * c1, high = c0 + 0.25 * c2 + 0.5 * c1;
  if ((low > 0) != (high > 0)) return Meeting::part;
  // Both ends on one side: it crosses twice or not at all.
  if (absolute(c1) < absolute(c2) && c1 * c1 > 4 * c2 * c0) return Meeting::part;
  return low > 0 ? Meeting::whole : Meeting::none;
}

/** The outer range is split where the rim crosses the cell's border, so that the integrand is analytic on each piece; pieces outside
 the region have no lines. With a law, points crowd where a piece's lines reach little depth; r is the cell's strain per s. Without,
 pieces inside it are listed as wholes. */
inline void findLines(const double S[kMonomials], Lines& lines, bool wholePieces, const LawShape* shape = nullptr, double r = 0) {
  const bool swapped = lines.swapped = absolute(S[1]) > absolute(S[2]);
  const double sa = lines.sa = swapped ? S[2] : S[1], sb = lines.sb = swapped ? S[1] : S[2];
  const double saa = lines.saa = swapped ? S[4] : S[3], sbb = lines.sbb = swapped ? S[3] : S[4];
  const double s0 = lines.s0 = S[0], sab = lines.sab = S[5];
  double split[6];
  bool turns[6];
  int n = 0;
  const auto add = [&](double a, bool isTurn) {
    if (a > -0.5 && a < 0.5) {
      int i = n++;
      for (; i > 0 && split[i - 1] > a; --i) {
        split[i] = split[i - 1];
        turns[i] = turns[i - 1];
      }
      split[i] = a;
      turns[i] = isTurn;
    }
  };
  double root[2];
  for (double side = -0.5; side < 1; side += 1) {
    const double c0 = s0 + side * (sb + sbb * side), c1 = sa + sab * side;
    if (absolute(c0) > 0.5 * absolute(c1) + 0.25 * absolute(saa)) continue;  // no root on this side
    const int count = solveQuadratic(c0, c1, saa, root);
    for (int k = 0; k < count; ++k) add(root[k], false);
  }
  if (absolute(sb) - 0.5 * absolute(sab) <= absolute(sbb) && sbb != 0) {
    // Where the rim turns back inside the cell the inner interval opens like a square root.
    const int count = solveQuadratic(sb * sb - 4 * sbb * s0, 2 * sb * sab - 4 * sbb * sa, sab * sab - 4 * sbb * saa, root);
    for (int k = 0; k < count; ++k) {
      if (absolute(sb + sab * root[k]) <= absolute(sbb)) add(root[k], true);
    }
  }
  lines.count = lines.numWhole = 0;
  double from = -0.5;
  bool fromTurn = false;
  for (int piece = 0; piece <= n; ++piece) {
    const double to = piece < n ? split[piece] : 0.5;
    const bool toTurn = piece < n && turns[piece];
    const double width = to - from, middle = 0.5 * (from + to);
    const auto put = [&](double a, double weight) {
      lines.a[lines.count] = a;
      lines.weight[lines.count++] = weight;
    };
    const Meeting meeting =
        width > 0 ? meetLine(s0 + middle * (sa + saa * middle), sb + sab * middle, sbb) : Meeting::none;
    if (meeting == Meeting::whole && wholePieces) {
      lines.from[lines.numWhole] = from;
      lines.to[lines.numWhole++] = to;
    } else if (meeting != Meeting::none) {
      if (fromTurn || toTurn) {
        for (int i = 0; i < 8; ++i) {
          const double t = Gauss<8>::x[i] + 0.5;  // a = from + width t^2 (3 - 2t): square-root ends become analytic
          put(from + width * t * t * (3 - 2 * t), width * 6 * t * (1 - t) * Gauss<8>::w[i]);
        }
      } else {
        GradedParts parts = {{}, 0};
        if (shape != nullptr) {
          const auto depth = [&](double a) {  // largest on the line: at its top, or at the deeper end
            const double c0 = s0 + a * (sa + saa * a), c1 = absolute(sb + sab * a);
            return larger(c1 < -sbb ? c0 - 0.25 * c1 * c1 / sbb : c0 + 0.5 * c1 + 0.25 * sbb, 0.0) * r;
          };
          parts = gradeParts(*shape, from, to, depth(from), depth(middle), depth(to));
        }
        for (int k = 0; k < parts.count; ++k) {
          const GradedParts::Part& part = parts.part[k];
          const double reach = part.to - part.from;
          for (int i = 0; i < GradedRule::kPoints; ++i) put(part.from + reach * part.rule->x[i], absolute(reach) * part.rule->w[i]);
        }
        if (parts.count == 0) {
          for (int i = 0; i < 5; ++i) put(middle + width * Gauss<5>::x[i], width * Gauss<5>::w[i]);
        }
      }
    }
    from = to;
    fromTurn = toTurn;
  }
}

/** Moments of one cell. */
struct alignas(64) CellMoments {
  double area[16];           ///< int xi^a eta^b; kMoments are used
  double pressure[8];        ///< int P xi^a eta^b, in the order of monomials; kSmooth are used
  double energy[8];          ///< int U
  double slopeR[16];         ///< int P' r xi^a eta^b: for ds (law with a slope that varies); kMoments are used
  double slopeS[16];         ///< int P' s xi^a eta^b: for dr
  double slopeShare[16];     ///< int dP/dshare xi^a eta^b; layers in series only
};

/** Area moments of the whole cell, exact. */
constexpr double kFullArea[kMoments] = {1, 0, 0, 1.0 / 12, 0, 1.0 / 12, 0, 0, 0, 0, 1.0 / 80, 0, 1.0 / 144, 0, 1.0 / 80};

/** P = s: moments of s over a full cell. */
inline void calcFullLinearMoments(const double S[kMonomials], double pressure[kSmooth]) {
  pressure[0] = S[0] + (S[3] + S[4]) * (1.0 / 12);
  pressure[1] = S[1] * (1.0 / 12);
  pressure[2] = S[2] * (1.0 / 12);
  pressure[3] = S[0] * (1.0 / 12) + S[3] * (1.0 / 80) + S[4] * (1.0 / 144);
  pressure[4] = S[0] * (1.0 / 12) + S[3] * (1.0 / 144) + S[4] * (1.0 / 80);
}

/** P = s: moments of s from those of the region. */
inline void calcLinearMoments(const double S[kMonomials], const double area[kMoments], double pressure[kSmooth]) {
  for (int m = 0; m < kSmooth; ++m) {
    double sum = 0;
    for (int c = 0; c < kMonomials; ++c) {
      sum += S[c] * area[momentIndex(kPowers[m][0] + kPowers[c][0], kPowers[m][1] + kPowers[c][1])];
    }
    pressure[m] = sum;
  }
}

/** Points of a rule for a whole cell and the monomials there, times its weights: of the moments (15 of 16) and of the smooth ones
 (5 of 8). Points beyond `used` lie at the centre and have no weight. */
struct PointRule {
  static constexpr int kMost = 16;
  double w[kMost], xi[kMost], eta[kMost], moments[kMost][16], smooth[kMost][8];
  int used;
  constexpr void add(double x, double y, double weight) {
    const int k = used++;
    w[k] = weight;
    xi[k] = x;
    eta[k] = y;
    double powerXi = weight;
    for (int a = 0; a <= 4; ++a) {
      double power = powerXi;
      for (int b = 0; a + b <= 4; ++b) {
        moments[k][momentIndex(a, b)] = power;
        power *= y;
      }
      powerXi *= x;
    }
    for (int m = 0; m < kSmooth; ++m) smooth[k][m] = moments[k][momentIndex(kPowers[m][0], kPowers[m][1])];
  }
};
/** Seven points, exact to degree 5 (Radon 1948; Abramowitz & Stegun 25.4.62). */
constexpr PointRule makeRadonRule() {
  PointRule rule{};
  constexpr double far = 0.4830458915396480, wide = 0.3872983346207417, narrow = 0.2886751345948129;  // halves of sqrt 14/15, 3/5, 1/3
  rule.add(0, 0, 2.0 / 7);
  rule.add(0, far, 5.0 / 63);
  rule.add(0, -far, 5.0 / 63);
  for (int i = 0; i < 4; ++i) rule.add(i < 2 ? wide : -wide, i % 2 == 0 ? narrow : -narrow, 5.0 / 36);
  return rule;
}
/** Four Gauss points each way. */
constexpr PointRule makeTensorRule() {
  PointRule rule{};
  for (int i = 0; i < 16; ++i) rule.add(Gauss<4>::x[i / 4], Gauss<4>::x[i % 4], Gauss<4>::w[i / 4] * Gauss<4>::w[i % 4]);
  return rule;
}
constexpr PointRule kRadonRule = makeRadonRule(), kTensorRule = makeTensorRule();

inline double evaluateSmoothAt(const double R[kSmooth], double xi, double eta) {
  return R[0] + xi * (R[1] + R[3] * xi) + eta * (R[2] + R[4] * eta);
}

/** Quadrature of a law in one cell: few points where the law hardly bends in a full cell, otherwise Gauss points along integration
 lines. */
struct LawQuadrature {
  const PointRule* points;  // nullptr: lines
  bool mild;                // lines: plain points will do
};
inline LawQuadrature chooseQuadrature(const double S[kMonomials], const double R[kSmooth], bool full, const LawShape& shape) {
  const double center = S[0] * R[0], half = 0.5 * (absolute(S[1]) + absolute(S[2])) * R[0];
  if (full) {
    const double ratio = smaller(larger(center, shape.atZero), shape.atOne - center) / half;
    if (ratio > 2) return {ratio > 4 ? &kRadonRule : &kTensorRule, false};
  }
  // From the rim, strain 0, to the cell's deepest point.
  const double deepest = larger(center, 0.0) + half;
  return {nullptr, shape.atZero > 5 * deepest && shape.atOne > 10 * deepest};
}

}  // namespace
}  // namespace genu::contact::detail
