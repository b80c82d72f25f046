// Body of the fast ray solver; included once per instruction set with GENU_ISA set to its namespace. No library headers but
// plain data, see FootKernel.h.

#include "KernelMath.inl"
#include "RayKernel.h"

namespace genu::contact::detail::GENU_ISA {

namespace {

constexpr int kMaxRayEvaluations = 8;

template <int PU, int PV, bool kRational>
FootOutcome shoot(const PatchTables& patch, const double* A, const double* n, bool derivatives, RayHit& hit) {
  const V4 origin = make(A[0], A[1], A[2], 1);  // the fourth lane cancels against the weight
  const V4 along = make(n[0], n[1], n[2], 0);
  const double tol = patch.tolerance_m;
  double u = hit.u, v = hit.v, lastStep = 0;
  for (int k = 1; k <= kMaxRayEvaluations; ++k) {
    hit.iterations = k;
    if (!locate(patch.u, u) || !locate(patch.v, v)) {
      hit.u = u;
      hit.v = v;
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
    // S_s ds + S_t dt - n dtau = -r by Cramer's rule, with D = (S_s x S_t).n and across = n x r, whose length is the residual.
    const V4 r = o.f - origin, across = cross(along, r), N = cross(o.fs, o.ft);
    const V4 first = sums(o.ft * across, o.fs * across, across * across, N * along);
    const V4 second = sums(N * N, o.fs * o.fs, o.ft * o.ft, r * along);
    const double D = get(first, 3), NN = get(second, 0), A2 = get(second, 1), C2 = get(second, 2);
    if (!(patch.normalSign * D < 0) || !(D * D > 0.01 * NN) || !(NN > 1e-6 * A2 * C2) || !(A2 > 1e-6 * C2) || !(C2 > 1e-6 * A2)) {
      return FootOutcome::failed;
    }
    const double inv = 1 / D;
    double ds = -get(first, 0) * inv, dt = get(first, 1) * inv;
    const double square = get(first, 2);
    // (|ds||S_s| + |dt||S_t|)^2 <= 2 (...): the square of the step along the surface. The curvature it meets is what is left.
    const double step = 2 * (ds * ds * A2 + dt * dt * C2);
    const bool inSpan = s + ds <= 1 && s + ds >= -1 && t + dt <= 1 && t + dt >= -1;
    const double nextResidual = 0.5 * patch.bend_perM * step;
    double residual = nextResidual;
    bool done = nextResidual <= 0.5 * tol && inSpan;
    if (!done && square <= tol * tol) {
      residual = __builtin_sqrt(square);
      ds = dt = 0;
      done = true;
    }
    if (done) {
      hit.u = u + ds * su[2];
      hit.v = v + dt * sv[2];
      hit.residual_m = residual;
      const V4 B = o.f + (o.fs + o.halfFss * ds + o.fst * dt) * ds + (o.ft + o.halfFtt * dt) * dt;
      const V4 xs = o.fs + o.halfFss * (2 * ds) + o.fst * dt, xt = o.ft + o.fst * ds + o.halfFtt * (2 * dt);
      const V4 M = cross(xs, xt);
      const double DM = dot3(M, along), scale = patch.normalSign / __builtin_sqrt(dot3(M, M));
      const V4 normal = M * scale;
      store(B, hit.p_MC);
      store(normal, hit.normal);
      // Where the ray meets the tangent plane: what is left across the ray does not enter.
      hit.t_m = dot3(M, B - origin) / DM;
      hit.cosTheta = -DM * scale;
      if (derivatives) {
        store(cross(xt, along) * (su[2] / DM), hit.duvdA);
        store(cross(along, xs) * (sv[2] / DM), hit.duvdA + 3);
        const V4 bs = cross(o.halfFss, xt) * 2.0 + cross(xs, o.fst), bt = cross(o.fst, xt) + cross(xs, o.halfFtt) * 2.0;
        store((bs - normal * dot3(normal, bs)) * (scale * su[1]), hit.nu);
        store((bt - normal * dot3(normal, bt)) * (scale * sv[1]), hit.nv);
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

FootOutcome solveRay(const PatchTables& patch, const double* A, const double* n, bool derivatives, RayHit& hit) {
  const int pu = patch.u.degree, pv = patch.v.degree;
  if (pu == 3 && pv == 3) {
    return patch.rational ? shoot<3, 3, true>(patch, A, n, derivatives, hit) : shoot<3, 3, false>(patch, A, n, derivatives, hit);
  }
  if (pu == 2 && pv == 2) {
    return patch.rational ? shoot<2, 2, true>(patch, A, n, derivatives, hit) : shoot<2, 2, false>(patch, A, n, derivatives, hit);
  }
  return patch.rational ? shoot<0, 0, true>(patch, A, n, derivatives, hit) : shoot<0, 0, false>(patch, A, n, derivatives, hit);
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
