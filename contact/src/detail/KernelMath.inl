#pragma once

// Vectors of four and span evaluation that the fast solvers share; included once per instruction set with GENU_ISA set to
// its namespace, see FootKernel.h.

#include "FootKernel.h"

namespace genu::contact::detail::GENU_ISA {

namespace {

#ifdef __AVX__

typedef double V4 __attribute__((vector_size(32)));

inline V4 load(const double* p) {
  V4 v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
inline V4 make(double x, double y, double z, double w) { return V4{x, y, z, w}; }
inline double get(V4 v, int k) { return v[k]; }
/** Sums of the four lanes of a, b, c, d. */
inline V4 sums(V4 a, V4 b, V4 c, V4 d) {
  const V4 ab = __builtin_shufflevector(a, b, 0, 4, 2, 6) + __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const V4 cd = __builtin_shufflevector(c, d, 0, 4, 2, 6) + __builtin_shufflevector(c, d, 1, 5, 3, 7);
  return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) + __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}
inline V4 turned(V4 a) { return __builtin_shufflevector(a, a, 1, 2, 0, 3); }

#else

// Pairs stay in registers on every 64-bit target; a vector of four would go through memory here.
typedef double Pair __attribute__((vector_size(16)));
struct V4 {
  Pair lo, hi;
};
inline V4 operator+(V4 a, V4 b) { return {a.lo + b.lo, a.hi + b.hi}; }
inline V4 operator-(V4 a, V4 b) { return {a.lo - b.lo, a.hi - b.hi}; }
inline V4 operator*(V4 a, V4 b) { return {a.lo * b.lo, a.hi * b.hi}; }
inline V4 operator*(V4 a, double t) { return {a.lo * t, a.hi * t}; }
inline V4 load(const double* p) {
  V4 v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
inline V4 make(double x, double y, double z, double w) { return {Pair{x, y}, Pair{z, w}}; }
inline double get(V4 v, int k) { return k < 2 ? v.lo[k] : v.hi[k - 2]; }
inline double sum(V4 a) {
  const Pair p = a.lo + a.hi;
  return p[0] + p[1];
}
inline V4 sums(V4 a, V4 b, V4 c, V4 d) { return make(sum(a), sum(b), sum(c), sum(d)); }
inline V4 turned(V4 a) { return {Pair{a.lo[1], a.hi[0]}, Pair{a.lo[0], a.hi[1]}}; }

#endif

inline V4 cross(V4 a, V4 b) { return turned(a * turned(b) - turned(a) * b); }
inline void store(V4 v, double* to) {
  to[0] = get(v, 0);
  to[1] = get(v, 1);
  to[2] = get(v, 2);
}
inline double dot3(V4 a, V4 b) {
  const V4 p = a * b;
  return get(p, 0) + get(p, 1) + get(p, 2);
}

inline int findSpan(const PatchTables::Direction& d, double x) {
  int k = static_cast<int>((x - d.lo) * d.bucketScale);
  k = k < d.numBuckets ? k : d.numBuckets - 1;
  int i = d.buckets[k];
  while (i + 1 < d.numSpans && x >= d.breaks[i + 1]) ++i;
  return i;
}

/** Into the period, or false when outside an open domain. */
inline bool locate(const PatchTables::Direction& d, double& x) {
  if (x >= d.lo && x <= d.hi) return true;
  if (!d.closed) return false;
  const double period = d.hi - d.lo;
  if (!(x >= d.lo - period && x <= d.hi + period)) return false;
  x += x < d.lo ? period : -period;
  x = x < d.lo ? d.lo : x > d.hi ? d.hi : x;
  return true;
}

/** Value and derivatives of sum_ab c_ab s^a t^b: f, fs, ft, half of fss and of ftt, fst. */
template <class T>
struct Values {
  T f, fs, ft, halfFss, fst, halfFtt;
};

/** Horner in both directions, derivatives carried along; coefficient(i) gives c_ab, i = a (nv + 1) + b. The first rounds only start
 the sums. */
template <int PU, int PV, class T, class S, class Coefficient>
inline Values<T> evaluateHorner(int pu, int pv, const Coefficient& coefficient, S s, S t) {
  const int nu = PU > 0 ? PU : pu, nv = PV > 0 ? PV : pv;
  const T zero = {};
  Values<T> o = {zero, zero, zero, zero, zero, zero};
#pragma GCC unroll 6
  for (int k = 0; k <= nu; ++k) {
    const int row = (nu - k) * (nv + 1);
    T r0 = coefficient(row + nv), r1 = zero, r2 = zero;
#pragma GCC unroll 6
    for (int m = 0; m < nv; ++m) {
      r2 = m == 0 ? zero : m == 1 ? r1 : r2 * t + r1;
      r1 = m == 0 ? r0 : r1 * t + r0;
      r0 = r0 * t + coefficient(row + nv - 1 - m);
    }
    o.halfFss = k < 2 ? zero : k == 2 ? o.fs : o.halfFss * s + o.fs;
    o.fs = k == 0 ? zero : k == 1 ? o.f : o.fs * s + o.f;
    o.fst = k == 0 ? zero : k == 1 ? o.ft : o.fst * s + o.ft;
    o.f = k == 0 ? r0 : o.f * s + r0;
    o.ft = k == 0 ? r1 : o.ft * s + r1;
    o.halfFtt = k == 0 ? r2 : o.halfFtt * s + r2;
  }
  return o;
}

template <int PU, int PV>
inline Values<V4> evaluateSpan(int pu, int pv, const double* c, double s, double t) {
  return evaluateHorner<PU, PV, V4>(pu, pv, [c](int i) { return load(c + 4 * i); }, s, t);
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
