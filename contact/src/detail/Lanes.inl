#pragma once

// Vectors with one query or one cell per lane, and what moves them to and from lines of eight numbers per query; included once
// per instruction set with GENU_ISA set to its namespace, see FootKernel.h.

#ifdef __AVX__
#include <immintrin.h>  // emits nothing: all of it is always inlined
#endif

#ifndef GENU_INLINE
#define GENU_INLINE inline __attribute__((always_inline))
#endif

namespace genu::contact::detail::GENU_ISA {

namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 8;
#elif defined(__AVX__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif

typedef double V __attribute__((vector_size(8 * kLanes)));
typedef long Mask __attribute__((vector_size(8 * kLanes)));  // a comparison: -1 where it holds
// Eight numbers in as many vectors as they need: a single one of 64 bytes would live in memory where there are no such registers.
#if defined(__AVX512F__)
typedef V Line;
inline double get(Line line, int k) { return line[k]; }
GENU_INLINE Line makeLine(double a, double b, double c, double d, double e, double f, double g, double h) {
  return Line{a, b, c, d, e, f, g, h};
}
#else
constexpr int kParts = 8 / kLanes;
struct Line {
  V part[kParts];
};
inline double get(const Line& line, int k) { return line.part[k / kLanes][k % kLanes]; }
#define GENU_LINE_OPERATOR(op)                                                \
  GENU_INLINE Line operator op(const Line& a, const Line& b) {                \
    Line c;                                                                   \
    for (int k = 0; k < kParts; ++k) c.part[k] = a.part[k] op b.part[k];      \
    return c;                                                                 \
  }
GENU_LINE_OPERATOR(+)
GENU_LINE_OPERATOR(-)
#undef GENU_LINE_OPERATOR
GENU_INLINE Line operator*(const Line& a, double b) {
  Line c;
  for (int k = 0; k < kParts; ++k) c.part[k] = a.part[k] * b;
  return c;
}
GENU_INLINE Line operator*(double b, const Line& a) { return a * b; }
GENU_INLINE Line operator-(const Line& a) { return a * -1.0; }
GENU_INLINE Line& operator+=(Line& a, const Line& b) { return a = a + b; }
GENU_INLINE Line makeLine(double a, double b, double c, double d, double e, double f, double g, double h) {
#ifdef __AVX__
  return Line{{V{a, b, c, d}, V{e, f, g, h}}};
#else
  return Line{{V{a, b}, V{c, d}, V{e, f}, V{g, h}}};
#endif
}
#endif

inline V all(double x) { return V{} + x; }
inline V loadLanes(const double* p) {
  V x;
  __builtin_memcpy(&x, p, sizeof x);
  return x;
}
inline void storeLanes(V x, double* to) { __builtin_memcpy(to, &x, sizeof x); }
inline V choose(Mask where, V yes, V no) { return where ? yes : no; }
inline V magnitude(V x) {
  return reinterpret_cast<V>(reinterpret_cast<Mask>(x) & (Mask{} + 0x7fffffffffffffffl));
}
// `bits`: one bit per lane.
#if defined(__AVX512F__)
inline V squareRoot(V x) { return _mm512_maskz_sqrt_pd(255, x); }
inline int bits(Mask where) { return _mm512_movepi64_mask(reinterpret_cast<__m512i>(where)); }
#elif defined(__AVX__)
inline V squareRoot(V x) { return _mm256_sqrt_pd(x); }
inline int bits(Mask where) { return _mm256_movemask_pd(reinterpret_cast<V>(where)); }
#else
inline V squareRoot(V x) { return V{__builtin_sqrt(x[0]), __builtin_sqrt(x[1])}; }
inline int bits(Mask where) { return static_cast<int>((where[0] & 1) | (where[1] & 2)); }
#endif

struct V3 {
  V x, y, z;
};
inline V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(const V3& a, V t) { return {a.x * t, a.y * t, a.z * t}; }
inline V dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V3 cross(const V3& a, const V3& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

#if defined(__AVX512F__)
inline Line loadLine(const double* p) { return loadLanes(p); }
inline void store(const Line& line, double* to) { storeLanes(line, to); }
#else
inline Line loadLine(const double* p) {
  Line line;
  for (int k = 0; k < kParts; ++k) line.part[k] = loadLanes(p + kLanes * k);
  return line;
}
inline void store(const Line& line, double* to) {
  for (int k = 0; k < kParts; ++k) storeLanes(line.part[k], to + kLanes * k);
}
#endif

/** Eight numbers of every lane -> one line per lane; turnBack: the other way. */
#if defined(__AVX512F__)
GENU_INLINE void turn(const V (&x)[8], Line (&to)[8]) {
  V a[8], b[8];
#pragma GCC unroll 4
  for (int k = 0; k < 8; k += 2) {  // pairs of lanes
    a[k] = __builtin_shufflevector(x[k], x[k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    a[k + 1] = __builtin_shufflevector(x[k], x[k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
#pragma GCC unroll 4
  for (int k = 0; k < 8; k += 4) {
#pragma GCC unroll 2
    for (int i = 0; i < 2; ++i) {
      b[k + i] = __builtin_shufflevector(a[k + i], a[k + 2 + i], 0, 1, 8, 9, 4, 5, 12, 13);
      b[k + 2 + i] = __builtin_shufflevector(a[k + i], a[k + 2 + i], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  }
#pragma GCC unroll 4
  for (int i = 0; i < 4; ++i) {
    to[i] = __builtin_shufflevector(b[i], b[4 + i], 0, 1, 2, 3, 8, 9, 10, 11);
    to[4 + i] = __builtin_shufflevector(b[i], b[4 + i], 4, 5, 6, 7, 12, 13, 14, 15);
  }
}
GENU_INLINE void turnBack(const Line (&x)[8], V (&to)[8]) { turn(x, to); }
#elif defined(__AVX__)
GENU_INLINE void turnFour(const V* x, V (&to)[4]) {
  const V a = __builtin_shufflevector(x[0], x[1], 0, 4, 2, 6), b = __builtin_shufflevector(x[0], x[1], 1, 5, 3, 7);
  const V c = __builtin_shufflevector(x[2], x[3], 0, 4, 2, 6), d = __builtin_shufflevector(x[2], x[3], 1, 5, 3, 7);
  to[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  to[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  to[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  to[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}
GENU_INLINE void turn(const V (&x)[8], Line (&to)[4]) {
  V low[4], high[4];
  turnFour(x, low);
  turnFour(x + 4, high);
#pragma GCC unroll 4
  for (int l = 0; l < 4; ++l) to[l] = Line{{low[l], high[l]}};
}
GENU_INLINE void turnBack(const Line (&x)[4], V (&to)[8]) {
  V low[4], high[4], turned[4];
#pragma GCC unroll 4
  for (int l = 0; l < 4; ++l) {
    low[l] = x[l].part[0];
    high[l] = x[l].part[1];
  }
  turnFour(low, turned);
  for (int k = 0; k < 4; ++k) to[k] = turned[k];
  turnFour(high, turned);
  for (int k = 0; k < 4; ++k) to[4 + k] = turned[k];
}
#else
GENU_INLINE void turnBack(const Line (&x)[kLanes], V (&to)[8]) {
#pragma GCC unroll 8
  for (int k = 0; k < 8; ++k) {
    double lanes[kLanes];
    for (int l = 0; l < kLanes; ++l) lanes[l] = get(x[l], k);
    to[k] = loadLanes(lanes);
  }
}
GENU_INLINE void turn(const V (&x)[8], Line (&to)[kLanes]) {
#pragma GCC unroll 2
  for (int l = 0; l < kLanes; ++l) to[l] = makeLine(x[0][l], x[1][l], x[2][l], x[3][l], x[4][l], x[5][l], x[6][l], x[7][l]);
}
#endif

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
