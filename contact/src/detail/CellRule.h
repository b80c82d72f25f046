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

#define GENU_INLINE inline __attribute__((always_inline))

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
inline double largestGain(int mask) { return mask == kAllNeighbors ? 1.75 : 3.25; }

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
struct Gauss<8> {
  static constexpr int n = 8;
  static constexpr double x[8] = {-0.4801449282487681, -0.3983332387068134, -0.2627662049581645, -0.0917173212478249,
                                  0.0917173212478249,  0.2627662049581645,  0.3983332387068134,  0.4801449282487681};
  static constexpr double w[8] = {0.0506142681451881, 0.1111905172266872, 0.1568533229389437, 0.1813418916891810,
                                  0.1813418916891810, 0.1568533229389437, 0.1111905172266872, 0.0506142681451881};
};

/** Integration lines of the region s > 0 of a cell: outer variable a, inner variable b, the one in which s changes faster;
 `swapped` tells that a is eta. s = s0 + sa a + saa a^2 + (sb + sab a) b + sbb b^2. */
constexpr int kMaxLines = 56;  // 6 splits, 8 lines a piece
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
        double shallow = 1, deep = 1;
        bool turned = false;
        if (shape != nullptr) {
          const auto depth = [&](double a) {  // at the deeper end of the line
            const double c0 = s0 + a * (sa + saa * a) + 0.25 * sbb, c1 = 0.5 * (sb + sab * a);
            return larger(c0 + absolute(c1), 0.0) * r;
          };
          shallow = depth(from);
          deep = depth(to);
          turned = shallow > deep;
          if (turned) {
            const double t = shallow;
            shallow = deep;
            deep = t;
          }
        }
        if (shallow < 0.5 * deep) {
          const GradedRule& rule = findGraded(*shape, deep);
          for (int i = 0; i < GradedRule::kPoints; ++i) {
            put(turned ? to - width * rule.x[i] : from + width * rule.x[i], width * rule.w[i]);
          }
        } else {
          for (int i = 0; i < 5; ++i) put(middle + width * Gauss<5>::x[i], width * Gauss<5>::w[i]);
        }
      }
    }
    from = to;
    fromTurn = toTurn;
  }
}

/** Calls interval(a, weight, b0, b1) for every part of a line where s > 0. */
template <class Interval>
inline void forEachInterval(const Lines& lines, Interval interval) {
  double root[2];
  for (int i = 0; i < lines.count; ++i) {
    const double a = lines.a[i], sbb = lines.sbb;
    const double c0 = lines.s0 + a * (lines.sa + lines.saa * a), c1 = lines.sb + lines.sab * a;
    const int count = solveQuadratic(c0, c1, sbb, root);
    double at[4] = {-0.5, 0, 0, 0};
    int m = 1;
    for (int k = 0; k < count; ++k) {
      if (root[k] > -0.5 && root[k] < 0.5) at[m++] = root[k];
    }
    at[m] = 0.5;
    for (int k = 0; k < m; ++k) {
      const double b = 0.5 * (at[k] + at[k + 1]);
      if (c0 + b * (c1 + sbb * b) > 0) interval(a, lines.weight[i], at[k], at[k + 1]);
    }
  }
}

/** Moments of one cell. */
struct CellMoments {
  double area[kMoments];     ///< int xi^a eta^b
  double pressure[8];        ///< int P xi^a eta^b, in the order of monomials; kSmooth are used
  double energy[8];          ///< int U
  double slopeR[16];         ///< int P' r xi^a eta^b: for ds (law with a slope that varies); kMoments are used
  double slopeS[16];         ///< int P' s xi^a eta^b: for dr
  double slopeShare[16];     ///< int dP/dshare xi^a eta^b; layers in series only
};

/** Area moments of the whole cell, exact. */
constexpr double kFullArea[kMoments] = {1, 0, 0, 1.0 / 12, 0, 1.0 / 12, 0, 0, 0, 0, 1.0 / 80, 0, 1.0 / 144, 0, 1.0 / 80};

/** From moments of the lines' (outer, inner) variables to those of (xi, eta). */
inline void unswap(bool swapped, const double* local, double* moments) {
  for (int j = 0; j <= 4; ++j) {
    for (int k = 0; j + k <= 4; ++k) moments[momentIndex(j, k)] = swapped ? local[momentIndex(k, j)] : local[momentIndex(j, k)];
  }
}

/** Eight lines at a time. Between its two roots a quadratic has the sign against that of b^2, outside them the other. */
inline void calcRimArea(const double S[kMonomials], double area[kMoments]) {
  Lines lines;
  findLines(S, lines, true);
  constexpr int kLanes = 8;
  constexpr double kFull[5] = {1, 0, 1.0 / 12, 0, 1.0 / 80};  // int b^k over the cell
  constexpr double kInverse[5] = {1, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5};
  while (lines.count % kLanes != 0) {
    lines.a[lines.count] = 0;
    lines.weight[lines.count++] = 0;
  }
  const double c2 = absolute(lines.sbb) > 1e-300 ? lines.sbb : 1e-300;  // the second root is then far away
  const double inverse = 1 / c2, outside = c2 > 0 ? 1 : 0, sign = c2 > 0 ? -1 : 1;
  double sums[kMoments][kLanes] = {};
  for (int first = 0; first < lines.count; first += kLanes) {
    double I[5][kLanes];
    const double* a = lines.a + first;
    const double* weight = lines.weight + first;
    for (int l = 0; l < kLanes; ++l) {
      const double c0 = lines.s0 + a[l] * (lines.sa + lines.saa * a[l]), c1 = lines.sb + lines.sab * a[l];
      const double discriminant = c1 * c1 - 4 * c2 * c0;
      const bool crosses = discriminant > 0;
      const double root = __builtin_sqrt(crosses ? discriminant : 0);
      const double q = -0.5 * (c1 < 0 ? c1 - root : c1 + root);
      const double r1 = q * inverse, r2 = q != 0 ? c0 / q : r1;
      double lo = r1 < r2 ? r1 : r2, hi = r1 < r2 ? r2 : r1;
      lo = lo > -0.5 ? lo : -0.5;
      lo = lo < 0.5 ? lo : 0.5;
      hi = hi > -0.5 ? hi : -0.5;
      hi = hi < 0.5 ? hi : 0.5;
      lo = crosses ? lo : 0;
      hi = crosses ? hi : 0;
      const double base = crosses ? outside : c0 > 0 ? 1 : 0;
      const double lo2 = lo * lo, hi2 = hi * hi;
      I[0][l] = weight[l] * (base * kFull[0] + sign * (hi - lo));
      I[1][l] = weight[l] * (sign / 2) * (hi2 - lo2);
      I[2][l] = weight[l] * (base * kFull[2] + (sign / 3) * (hi2 * hi - lo2 * lo));
      I[3][l] = weight[l] * (sign / 4) * (hi2 * hi2 - lo2 * lo2);
      I[4][l] = weight[l] * (base * kFull[4] + (sign / 5) * (hi2 * hi2 * hi - lo2 * lo2 * lo));
    }
    double power[kLanes];
    for (int l = 0; l < kLanes; ++l) power[l] = 1;
    for (int j = 0; j <= 4; ++j) {
      for (int k = 0; j + k <= 4; ++k) {
        for (int l = 0; l < kLanes; ++l) sums[momentIndex(j, k)][l] += power[l] * I[k][l];
      }
      for (int l = 0; l < kLanes; ++l) power[l] *= a[l];
    }
  }
  double local[kMoments];
  for (int i = 0; i < kMoments; ++i) {
    const double* x = sums[i];
    local[i] = ((x[0] + x[4]) + (x[1] + x[5])) + ((x[2] + x[6]) + (x[3] + x[7]));
  }
  for (int piece = 0; piece < lines.numWhole; ++piece) {
    const double from = lines.from[piece], to = lines.to[piece];
    double powerFrom = from, powerTo = to;
    for (int j = 0; j <= 4; ++j) {
      const double integral = (powerTo - powerFrom) * kInverse[j];
      for (int k = 0; j + k <= 4; k += 2) local[momentIndex(j, k)] += integral * kFull[k];
      powerFrom *= from;
      powerTo *= to;
    }
  }
  unswap(lines.swapped, local, area);
}

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

/** Monomials of a tensor Gauss rule, times its weights: of the moments (15 of 16) and of the smooth ones (5 of 8). */
template <int N>
struct TensorRule {
  double moments[N * N][16], smooth[N * N][8], xi[N * N], eta[N * N];
  constexpr TensorRule() : moments{}, smooth{}, xi{}, eta{} {
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        const int k = N * i + j;
        xi[k] = Gauss<N>::x[i];
        eta[k] = Gauss<N>::x[j];
        double powerXi = Gauss<N>::w[i] * Gauss<N>::w[j];
        for (int a = 0; a <= 4; ++a) {
          double power = powerXi;
          for (int b = 0; a + b <= 4; ++b) {
            moments[k][momentIndex(a, b)] = power;
            power *= eta[k];
          }
          powerXi *= xi[k];
        }
        for (int m = 0; m < kSmooth; ++m) smooth[k][m] = moments[k][momentIndex(kPowers[m][0], kPowers[m][1])];
      }
    }
  }
};
template <int N>
constexpr TensorRule<N> kTensor{};

inline double evaluateSmoothAt(const double R[kSmooth], double xi, double eta) {
  return R[0] + xi * (R[1] + R[3] * xi) + eta * (R[2] + R[4] * eta);
}

template <int N, bool WithEnergy, bool WithSlope, class Response>
inline void addTensor(const double S[kMonomials], const double R[kSmooth], const Response& response, CellMoments& m) {
  const TensorRule<N>& rule = kTensor<N>;
  double pressure[8] = {}, energies[8] = {}, slopeR[16] = {}, slopeS[16] = {};
  for (int i = 0; i < N * N; ++i) {
    const double s = evaluateAt(S, rule.xi[i], rule.eta[i]), r = evaluateSmoothAt(R, rule.xi[i], rule.eta[i]);
    double p = 0, dp = 0, energy = 0;
    response(s * r, p, dp, energy);
    for (int k = 0; k < 8; ++k) pressure[k] += p * rule.smooth[i][k];
    if (WithEnergy) {
      for (int k = 0; k < 8; ++k) energies[k] += energy * rule.smooth[i][k];
    }
    if (WithSlope) {
      const double x = dp * r, y = dp * s;
      for (int k = 0; k < 16; ++k) slopeR[k] += x * rule.moments[i][k];
      for (int k = 0; k < 16; ++k) slopeS[k] += y * rule.moments[i][k];
    }
  }
  for (int k = 0; k < 8; ++k) {
    m.pressure[k] = pressure[k];
    m.energy[k] = energies[k];
  }
  for (int k = 0; k < 16; ++k) {
    m.slopeR[k] = slopeR[k];
    m.slopeS[k] = slopeS[k];
  }
}

/** Quadrature of a law in one cell: tensor Gauss points where the law hardly bends in a full cell, otherwise Gauss points along
 integration lines. */
struct LawQuadrature {
  int tensor;  // points each way, 0: lines
  bool mild;   // lines: plain points will do
};
inline LawQuadrature chooseQuadrature(const double S[kMonomials], const double R[kSmooth], bool full, const LawShape& shape) {
  const double center = S[0] * R[0], half = 0.5 * (absolute(S[1]) + absolute(S[2])) * R[0];
  if (full) {
    const double ratio = smaller(larger(center, shape.atZero), shape.atOne - center) / half;
    if (ratio > 2) return {ratio > 4 ? 3 : 4, false};
  }
  // From the rim, strain 0, to the cell's deepest point.
  const double deepest = larger(center, 0.0) + half;
  return {0, shape.atZero > 5 * deepest && shape.atOne > 10 * deepest};
}

/** Calls at(w, b) for the points of an interval of a line; the strain along it is strainAt(b). One place in the code calls `at`, so
 that it is compiled into the loop. */
template <class StrainAt, class At>
GENU_INLINE void forEachInnerPoint(const LawShape& shape, bool mild, double b0, double b1, const StrainAt& strainAt, const At& at) {
  struct Points {
    const double *x, *w;
    int n;
    double from, width;
  } parts[2];
  int count = 1;
  const double width = b1 - b0, middle = 0.5 * (b0 + b1);
  const auto graded = [&](double shallow, double deep, double strain) {
    const GradedRule& rule = findGraded(shape, strain);
    return Points{rule.x, rule.w, GradedRule::kPoints, shallow, deep - shallow};
  };
  if (mild) {  // nearly linear: a polynomial of degree 4 and little more
    parts[0] = {Gauss<3>::x, Gauss<3>::w, 3, middle, width};
  } else {
    const double e0 = strainAt(b0), e1 = strainAt(b1);
    if (b0 > -0.5 && b0 < 0.5 && b1 > -0.5 && b1 < 0.5) {  // between two rims
      const double deep = strainAt(middle);
      parts[0] = graded(b0, middle, deep);
      parts[1] = graded(b1, middle, deep);
      count = 2;
    } else if (e0 < 0.5 * e1) {
      parts[0] = graded(b0, b1, e1);
    } else if (e1 < 0.5 * e0) {
      parts[0] = graded(b1, b0, e0);
    } else {
      parts[0] = {Gauss<5>::x, Gauss<5>::w, 5, middle, width};
    }
  }
  for (int i = 0; i < count; ++i) {
    const Points& p = parts[i];
    const double scale = absolute(p.width);
    for (int k = 0; k < p.n; ++k) at(scale * p.w[k], p.from + p.width * p.x[k]);
  }
}

/** Moments of a nonlinear law. `response` gives p, dp/dstrain and energy density at a strain. */
template <bool WithEnergy, bool WithSlope, class Response>
inline void calcLawMoments(const double S[kMonomials], const double R[kSmooth], bool full, const LawShape& shape,
                           const Response& response, CellMoments& m) {
  const LawQuadrature rule = chooseQuadrature(S, R, full, shape);
  if (rule.tensor != 0) {
    rule.tensor == 3 ? addTensor<3, WithEnergy, WithSlope>(S, R, response, m) : addTensor<4, WithEnergy, WithSlope>(S, R, response, m);
    return;
  }
  Lines lines;
  findLines(S, lines, false, rule.mild ? nullptr : &shape, R[0]);
  const double q0 = lines.swapped ? R[2] : R[1], q1 = lines.swapped ? R[1] : R[2];
  const double q00 = lines.swapped ? R[4] : R[3], q11 = lines.swapped ? R[3] : R[4];
  // Sums over the inner variable: of P b^k, U b^k and the slopes' b^k.
  double pressure[kSmooth] = {}, energies[kSmooth] = {}, slopeR[kMoments] = {}, slopeS[kMoments] = {};  // (outer, inner)
  forEachInterval(lines, [&](double a, double weight, double b0, double b1) {
    const double s0 = lines.s0 + a * (lines.sa + lines.saa * a), s1 = lines.sb + lines.sab * a, s2 = lines.sbb;
    const double r0 = R[0] + a * (q0 + q00 * a);
    double sumP[3] = {}, sumU[3] = {}, sumR[5] = {}, sumS[5] = {};
    const auto at = [&](double w, double b) __attribute__((always_inline)) {
      const double s = s0 + b * (s1 + s2 * b), r = r0 + b * (q1 + q11 * b);
      double p = 0, dp = 0, energy = 0;
      response(s * r, p, dp, energy);
      const double b2 = b * b, wp = w * p;
      sumP[0] += wp;
      sumP[1] += wp * b;
      sumP[2] += wp * b2;
      if (WithEnergy) {
        const double wu = w * energy;
        sumU[0] += wu;
        sumU[1] += wu * b;
        sumU[2] += wu * b2;
      }
      if (WithSlope) {
        const double b3 = b2 * b, b4 = b2 * b2, x = w * dp * r, y = w * dp * s;
        sumR[0] += x;
        sumR[1] += x * b;
        sumR[2] += x * b2;
        sumR[3] += x * b3;
        sumR[4] += x * b4;
        sumS[0] += y;
        sumS[1] += y * b;
        sumS[2] += y * b2;
        sumS[3] += y * b3;
        sumS[4] += y * b4;
      }
    };
    const auto strainAt = [&](double b) { return larger(s0 + b * (s1 + s2 * b), 0.0) * (r0 + b * (q1 + q11 * b)); };
    forEachInnerPoint(shape, rule.mild, b0, b1, strainAt, [&](double w, double b) __attribute__((always_inline)) { at(weight * w, b); });
    const double a2 = a * a;
    const auto addSmooth = [&](const double* sums, double* to) {  // 1, a, b, a^2, b^2
      to[0] += sums[0];
      to[1] += a * sums[0];
      to[2] += sums[1];
      to[3] += a2 * sums[0];
      to[4] += sums[2];
    };
    addSmooth(sumP, pressure);
    if (WithEnergy) addSmooth(sumU, energies);
    if (WithSlope) {
      double power = 1;
      for (int j = 0; j <= 4; ++j) {
        for (int k = 0; j + k <= 4; ++k) {
          slopeR[momentIndex(j, k)] += power * sumR[k];
          slopeS[momentIndex(j, k)] += power * sumS[k];
        }
        power *= a;
      }
    }
  });
  constexpr int kSwap[kSmooth] = {0, 2, 1, 4, 3};
  for (int k = 0; k < kSmooth; ++k) {
    m.pressure[k] = pressure[lines.swapped ? kSwap[k] : k];
    m.energy[k] = energies[lines.swapped ? kSwap[k] : k];
  }
  if (WithSlope) {
    unswap(lines.swapped, slopeR, m.slopeR);
    unswap(lines.swapped, slopeS, m.slopeS);
  }
}

/** Calls at(w, xi, eta) for the same points one by one. */
template <class At>
inline void forEachLawPoint(const double S[kMonomials], const double R[kSmooth], bool full, const LawShape& shape, const At& at) {
  const LawQuadrature rule = chooseQuadrature(S, R, full, shape);
  const auto tensor = [&](const auto& points, int n) {
    for (int i = 0; i < n * n; ++i) at(points.moments[i][0], points.xi[i], points.eta[i]);
  };
  if (rule.tensor == 3) return tensor(kTensor<3>, 3);
  if (rule.tensor == 4) return tensor(kTensor<4>, 4);
  Lines lines;
  findLines(S, lines, false, rule.mild ? nullptr : &shape, R[0]);
  forEachInterval(lines, [&](double a, double weight, double b0, double b1) {
    const auto place = [&](double b, double& xi, double& eta) {
      xi = lines.swapped ? b : a;
      eta = lines.swapped ? a : b;
    };
    const auto strainAt = [&](double b) {
      double xi, eta;
      place(b, xi, eta);
      return larger(evaluateAt(S, xi, eta), 0.0) * evaluateSmoothAt(R, xi, eta);
    };
    forEachInnerPoint(shape, rule.mild, b0, b1, strainAt, [&](double w, double b) {
      double xi, eta;
      place(b, xi, eta);
      at(weight * w, xi, eta);
    });
  });
}

/** Moments of layers in series, whose law depends on the place through the share Q of the fixed layer. `respond(strain, share, answer)`
 gives p, dp/dstrain, energy density and dp/dshare. */
template <bool WithSlope, class Respond>
inline void calcSharedMoments(const double S[kMonomials], const double R[kSmooth], const double Q[kSmooth], bool full,
                              const LawShape& shape, const Respond& respond, CellMoments& m) {
  for (int k = 0; k < kSmooth; ++k) m.pressure[k] = m.energy[k] = 0;
  for (int k = 0; k < kMoments; ++k) m.slopeR[k] = m.slopeS[k] = m.slopeShare[k] = 0;
  forEachLawPoint(S, R, full, shape, [&](double w, double xi, double eta) {
    const double s = evaluateAt(S, xi, eta), r = evaluateSmoothAt(R, xi, eta);
    double answer[4];
    respond(s * r, evaluateSmoothAt(Q, xi, eta), answer);
    const double monomial[kSmooth] = {1, xi, eta, xi * xi, eta * eta};
    for (int k = 0; k < kSmooth; ++k) {
      m.pressure[k] += w * answer[0] * monomial[k];
      m.energy[k] += w * answer[2] * monomial[k];
    }
    if (!WithSlope) return;
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
  });
}

}  // namespace
}  // namespace genu::contact::detail
