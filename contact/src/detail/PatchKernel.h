#pragma once

// Evaluation of one knot span from its power-basis table: the innermost loop of the engine.

#include <cstring>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact::detail {

/** One homogeneous point (x, y, z, w) as two pairs: every 64-bit target has registers for those, and the compiler keeps
 them there (a single vector of four spills to memory on targets without AVX). */
struct Packed4 {
  typedef double Pair __attribute__((vector_size(16)));
  Pair xy = {0, 0}, zw = {0, 0};

  static Packed4 load(const double* from) {
    Packed4 p;
    std::memcpy(&p.xy, from, sizeof p.xy);
    std::memcpy(&p.zw, from + 2, sizeof p.zw);
    return p;
  }
  /** this * t + other */
  void timesPlus(double t, const Packed4& other) {
    xy = xy * t + other.xy;
    zw = zw * t + other.zw;
  }
  Vec3 xyz() const { return Vec3(xy[0], xy[1], zw[0]); }
  double w() const { return zw[1]; }
};

/** Value and derivatives of sum_ab c_ab s^a t^b, Horner in both directions: f, fs, ft, half of fss and of ftt, fst.
 PU, PV > 0: degrees known at compile time; otherwise pu, pv. */
struct SpanValues {
  Packed4 f, fs, ft, halfFss, fst, halfFtt;
};

template <int PU, int PV>
inline void evaluateSpan(int pu, int pv, const double* c, double s, double t, SpanValues& out) {
  const int degreeU = PU > 0 ? PU : pu, degreeV = PV > 0 ? PV : pv;
  SpanValues v;
  for (int a = degreeU; a >= 0; --a) {
    const double* row = c + a * (degreeV + 1) * 4;
    Packed4 r0 = Packed4::load(row + degreeV * 4), r1, r2;
    for (int b = degreeV - 1; b >= 0; --b) {
      r2.timesPlus(t, r1);
      r1.timesPlus(t, r0);
      r0.timesPlus(t, Packed4::load(row + b * 4));
    }
    v.halfFss.timesPlus(s, v.fs);
    v.fs.timesPlus(s, v.f);
    v.f.timesPlus(s, r0);
    v.fst.timesPlus(s, v.ft);
    v.ft.timesPlus(s, r1);
    v.halfFtt.timesPlus(s, r2);
  }
  out = v;
}

/** S and its first and second derivatives with respect to u and v, (u, v) inside the domain. */
inline void evaluatePatch(const NurbsPatch& patch, double u, double v, SurfaceDerivatives& out) {
  const int i = patch.findSpanU(u), j = patch.findSpanV(v);
  const NurbsPatch::Span& su = patch.spanU(i);
  const NurbsPatch::Span& sv = patch.spanV(j);
  const double s = (u - su.center) * su.invHalfWidth, t = (v - sv.center) * sv.invHalfWidth;
  const double* c = patch.spanCoefficients(i, j);
  const NurbsPatchData& data = patch.data();
  SpanValues h;
  if (data.degreeU == 3 && data.degreeV == 3) {
    evaluateSpan<3, 3>(3, 3, c, s, t, h);
  } else if (data.degreeU == 2 && data.degreeV == 2) {
    evaluateSpan<2, 2>(2, 2, c, s, t, h);
  } else {
    evaluateSpan<0, 0>(data.degreeU, data.degreeV, c, s, t, h);
  }
  const double a = su.invHalfWidth, b = sv.invHalfWidth;
  out.S = h.f.xyz();
  out.Su = h.fs.xyz() * a;
  out.Sv = h.ft.xyz() * b;
  out.Suu = h.halfFss.xyz() * (2 * a * a);
  out.Suv = h.fst.xyz() * (a * b);
  out.Svv = h.halfFtt.xyz() * (2 * b * b);
  if (!data.isRational()) return;
  // Quotient rule on A / w (Piegl & Tiller eq. 4.20).
  const double w = 1.0 / h.f.w();
  const double wu = h.fs.w() * a, wv = h.ft.w() * b;
  const double wuu = h.halfFss.w() * 2 * a * a, wuv = h.fst.w() * a * b, wvv = h.halfFtt.w() * 2 * b * b;
  out.S *= w;
  out.Su = (out.Su - wu * out.S) * w;
  out.Sv = (out.Sv - wv * out.S) * w;
  out.Suu = (out.Suu - 2 * wu * out.Su - wuu * out.S) * w;
  out.Suv = (out.Suv - wu * out.Sv - wv * out.Su - wuv * out.S) * w;
  out.Svv = (out.Svv - 2 * wv * out.Sv - wvv * out.S) * w;
}

}  // namespace genu::contact::detail
