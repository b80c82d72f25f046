#pragma once

// Body of the fast solver; included once per instruction set with GENU_ISA set to its namespace. No library headers but
// plain data, see FootKernel.h.

#include "FootKernel.h"
#include "KernelMath.inl"

namespace genu::contact::detail::GENU_ISA {

namespace {

constexpr int kMaxEvaluations = 8;

template <int PU, int PV, bool kRational>
FootOutcome solve(const PatchTables& patch, const double* Q, FootSearch& search, FootDerivatives derivatives, TrackedFoot& foot) {
  const V4 q = make(Q[0], Q[1], Q[2], 1);  // the fourth lane cancels against the weight
  const double tol = patch.tolerance_m;
  double u = search.u, v = search.v, lastStep = 0;
  for (int k = 1; k <= kMaxEvaluations; ++k) {
    search.iterations = k;
    if (!locate(patch.u, u) || !locate(patch.v, v)) {
      search.u = u;
      search.v = v;
      return FootOutcome::leftPatch;
    }
    const int i = findSpan(patch.u, u), j = findSpan(patch.v, v);
    const double *su = patch.u.spans + 3 * i, *sv = patch.v.spans + 3 * j;
    const double s = (u - su[0]) * su[1], t = (v - sv[0]) * sv[1];
    const long stride = (patch.u.degree + 1) * (patch.v.degree + 1) * 4;
    Values<V4> o = evaluateSpan<PU, PV>(patch.u.degree, patch.v.degree,
                                    patch.coefficients + (static_cast<long>(i) * patch.v.numSpans + j) * stride, s, t);
    if (kRational) {  // quotient rule on A / w (Piegl & Tiller eq. 4.20); derivatives get a zero fourth lane
      const double w = 1 / get(o.f, 3);
      const double ws = get(o.fs, 3), wt = get(o.ft, 3);
      const double wss = get(o.halfFss, 3), wst = get(o.fst, 3), wtt = get(o.halfFtt, 3);
      o.f = o.f * w;
      o.fs = (o.fs - o.f * ws) * w;
      o.ft = (o.ft - o.f * wt) * w;
      o.halfFss = (o.halfFss - o.fs * ws - o.f * wss) * w;
      o.fst = (o.fst - o.ft * ws - o.fs * wt - o.f * wst) * w;
      o.halfFtt = (o.halfFtt - o.ft * wt - o.f * wtt) * w;
    } else {
      o.f = make(get(o.f, 0), get(o.f, 1), get(o.f, 2), 1);
    }
    const V4 r = o.f - q;
    const V4 first = sums(r * o.fs, r * o.ft, o.fs * o.fs, o.ft * o.ft);
    const V4 second = sums(o.fs * o.ft, r * o.halfFss, r * o.fst, r * o.halfFtt);
    const double gs = get(first, 0), gt = get(first, 1), A = get(first, 2), C = get(first, 3);
    const double a = A + 2 * get(second, 1), b = get(second, 0) + get(second, 2), c = C + 2 * get(second, 3);
    const double det = a * c - b * b;
    // Poles, centers of curvature and worse go to the safeguarded solver.
    if (!(a > 0.02 * A) || !(c > 0.02 * C) || !(det > 0.01 * a * c) || !(A > 1e-6 * C) || !(C > 1e-6 * A)) {
      return FootOutcome::failed;
    }
    const double inv = 1 / det;
    double ds = (b * gt - c * gs) * inv, dt = (b * gs - a * gt) * inv;
    // (|ds||S_s| + |dt||S_t|)^2 <= 2 (...): the square of the step along the surface.
    const double step = 2 * (ds * ds * A + dt * dt * C);
    const bool inSpan = s + ds <= 1 && s + ds >= -1 && t + dt <= 1 && t + dt >= -1;
    const double reach = __builtin_fabs(get(r, 0)) + __builtin_fabs(get(r, 1)) + __builtin_fabs(get(r, 2));  // >= |r|
    const double nextResidual = 0.5 * (3 * patch.bend_perM + reach * patch.twist_perM2) * step;
    const bool good = nextResidual <= 0.5 * tol && inSpan;
    double residual = nextResidual;
    bool done = good;
    if (!good && gs * gs <= tol * tol * A && gt * gt <= tol * tol * C) {
      const double rs = gs * gs * C > gt * gt * A ? gs * gs / A : gt * gt / C;
      residual = __builtin_sqrt(rs);
      ds = dt = 0;
      done = true;
    }
    if (done) {
      search.u = u + ds * su[2];
      search.v = v + dt * sv[2];
      search.residual_m = residual;
      foot.u = search.u;
      foot.v = search.v;
      const V4 B = o.f + (o.fs + o.halfFss * ds + o.fst * dt) * ds + (o.ft + o.halfFtt * dt) * dt;
      const V4 xs = o.fs + o.halfFss * (2 * ds) + o.fst * dt, xt = o.ft + o.fst * ds + o.halfFtt * (2 * dt);
      const V4 N = cross(xs, xt);
      const double scale = patch.normalSign / __builtin_sqrt(dot3(N, N));
      const V4 n = N * scale;
      store(B, search.p_MB);
      store(n, foot.normal);
      foot.distance_m = dot3(n, q - B);
      if (derivatives != FootDerivatives::none) {
        const double hu = inv * su[2], hv = inv * sv[2];
        store((o.fs * c - o.ft * b) * hu, foot.duvdQ);
        store((o.ft * a - o.fs * b) * hv, foot.duvdQ + 3);
      }
      if (derivatives == FootDerivatives::second) {
        const V4 bs = cross(o.halfFss, o.ft) * 2.0 + cross(o.fs, o.fst), bt = cross(o.fst, o.ft) + cross(o.fs, o.halfFtt) * 2.0;
        store((bs - n * dot3(n, bs)) * (scale * su[1]), foot.nu);
        store((bt - n * dot3(n, bt)) * (scale * sv[1]), foot.nv);
      }
      return FootOutcome::found;
    }
    // A step that is not well below the one before it is a bad sign.
    if (k > 1 && !(step < 0.25 * lastStep)) return FootOutcome::failed;
    if (!(ds < 6 && ds > -6 && dt < 6 && dt > -6)) return FootOutcome::failed;
    lastStep = step;
    u += ds * su[2];
    v += dt * sv[2];
  }
  return FootOutcome::failed;
}

FootOutcome solveFoot(const PatchTables& patch, const double* Q, FootSearch& search, FootDerivatives derivatives, TrackedFoot& foot) {
  const int pu = patch.u.degree, pv = patch.v.degree;
  if (pu == 3 && pv == 3) {
    return patch.rational ? solve<3, 3, true>(patch, Q, search, derivatives, foot)
                          : solve<3, 3, false>(patch, Q, search, derivatives, foot);
  }
  if (pu == 2 && pv == 2) {
    return patch.rational ? solve<2, 2, true>(patch, Q, search, derivatives, foot)
                          : solve<2, 2, false>(patch, Q, search, derivatives, foot);
  }
  return patch.rational ? solve<0, 0, true>(patch, Q, search, derivatives, foot)
                        : solve<0, 0, false>(patch, Q, search, derivatives, foot);
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
