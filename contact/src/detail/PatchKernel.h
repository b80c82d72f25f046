#pragma once

// Evaluation of one knot span from its power-basis table: the innermost loop of the engine.

#include <cstring>

#include "genu/contact/NurbsPatch.h"

namespace genu::contact::detail {

// One homogeneous point (x, y, z, w); the compiler maps it to whatever vector registers the target has.
typedef double Packed4 __attribute__((vector_size(32)));

inline void load(const double* from, Packed4& to) { std::memcpy(&to, from, sizeof to); }

inline Vec3 xyz(const Packed4& a) { return Vec3(a[0], a[1], a[2]); }

/** Value and derivatives of sum_ab c_ab s^a t^b, Horner in both directions. out = {f, fs, ft, fss, fst, ftt}. */
template <int PU, int PV>
inline void hornerFixed(const double* c, double s, double t, Packed4 out[6]) {
  Packed4 f = {}, fs = {}, fss = {}, g = {}, gs = {}, k = {};
  for (int a = PU; a >= 0; --a) {
    const double* row = c + a * (PV + 1) * 4;
    Packed4 r0, r1 = {}, r2 = {};
    load(row + PV * 4, r0);
    for (int b = PV - 1; b >= 0; --b) {
      Packed4 next;
      load(row + b * 4, next);
      r2 = r2 * t + r1;
      r1 = r1 * t + r0;
      r0 = r0 * t + next;
    }
    fss = fss * s + fs;
    fs = fs * s + f;
    f = f * s + r0;
    gs = gs * s + g;
    g = g * s + r1;
    k = k * s + r2;
  }
  out[0] = f;
  out[1] = fs;
  out[2] = g;
  out[3] = fss * 2.0;
  out[4] = gs;
  out[5] = k * 2.0;
}

inline void hornerAny(int pu, int pv, const double* c, double s, double t, Packed4 out[6]) {
  Packed4 f = {}, fs = {}, fss = {}, g = {}, gs = {}, k = {};
  for (int a = pu; a >= 0; --a) {
    const double* row = c + a * (pv + 1) * 4;
    Packed4 r0, r1 = {}, r2 = {};
    load(row + pv * 4, r0);
    for (int b = pv - 1; b >= 0; --b) {
      Packed4 next;
      load(row + b * 4, next);
      r2 = r2 * t + r1;
      r1 = r1 * t + r0;
      r0 = r0 * t + next;
    }
    fss = fss * s + fs;
    fs = fs * s + f;
    f = f * s + r0;
    gs = gs * s + g;
    g = g * s + r1;
    k = k * s + r2;
  }
  out[0] = f;
  out[1] = fs;
  out[2] = g;
  out[3] = fss * 2.0;
  out[4] = gs;
  out[5] = k * 2.0;
}

/** S and its first and second derivatives with respect to u and v, (u, v) inside the domain. */
inline void evaluatePatch(const NurbsPatch& patch, double u, double v, SurfaceDerivatives& out) {
  const int i = patch.findSpanU(u), j = patch.findSpanV(v);
  const NurbsPatch::Span& su = patch.spanU(i);
  const NurbsPatch::Span& sv = patch.spanV(j);
  const double s = (u - su.center) * su.invHalfWidth, t = (v - sv.center) * sv.invHalfWidth;
  const double* c = patch.spanCoefficients(i, j);
  const NurbsPatchData& data = patch.data();
  Packed4 h[6];
  if (data.degreeU == 3 && data.degreeV == 3) {
    hornerFixed<3, 3>(c, s, t, h);
  } else if (data.degreeU == 2 && data.degreeV == 2) {
    hornerFixed<2, 2>(c, s, t, h);
  } else {
    hornerAny(data.degreeU, data.degreeV, c, s, t, h);
  }
  const double a = su.invHalfWidth, b = sv.invHalfWidth;
  if (!data.isRational()) {
    out.S = xyz(h[0]);
    out.Su = xyz(h[1]) * a;
    out.Sv = xyz(h[2]) * b;
    out.Suu = xyz(h[3]) * (a * a);
    out.Suv = xyz(h[4]) * (a * b);
    out.Svv = xyz(h[5]) * (b * b);
    return;
  }
  // Quotient rule on A / w (Piegl & Tiller eq. 4.20).
  const double w = 1.0 / h[0][3];
  const double wu = h[1][3] * a, wv = h[2][3] * b, wuu = h[3][3] * a * a, wuv = h[4][3] * a * b, wvv = h[5][3] * b * b;
  out.S = xyz(h[0]) * w;
  out.Su = (xyz(h[1]) * a - wu * out.S) * w;
  out.Sv = (xyz(h[2]) * b - wv * out.S) * w;
  out.Suu = (xyz(h[3]) * (a * a) - 2 * wu * out.Su - wuu * out.S) * w;
  out.Suv = (xyz(h[4]) * (a * b) - wu * out.Sv - wv * out.Su - wuv * out.S) * w;
  out.Svv = (xyz(h[5]) * (b * b) - 2 * wv * out.Sv - wvv * out.S) * w;
}

}  // namespace genu::contact::detail
