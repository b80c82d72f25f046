// The fast solver for many feet; included once per instruction set with GENU_ISA set to its namespace, see FootKernel.h.

#include "FootKernel.inl"
#include "Lanes.inl"

namespace genu::contact::detail::GENU_ISA {

namespace {

/** Fewer feet of a span than this go one by one. */
constexpr int kFewestLanes = kLanes / 4 + 1;

/** One coordinate of a span in all lanes. */
template <int PU, int PV>
inline Values<V> evaluateCoordinate(int pu, int pv, const double* c, V s, V t) {
  return evaluateHorner<PU, PV, V>(pu, pv, [c](int i) { return all(c[4 * i]); }, s, t);
}

/** Feet still to be found, and where each one's search is. */
struct FeetPool {
  double u[kFeetAtOnce], v[kFeetAtOnce], lastStep[kFeetAtOnce];
  int patch[kFeetAtOnce], i[kFeetAtOnce], j[kFeetAtOnce], span[kFeetAtOnce], evaluations[kFeetAtOnce];
  unsigned long pending, left;  // one bit each
};

/** Puts foot k at its (u, v) into the pool, or among those left where that lies outside the patch. */
inline void place(const PatchTables* patches, FeetPool& pool, int k) {
  const PatchTables& patch = patches[pool.patch[k]];
  const unsigned long bit = 1ul << k;
  if (!locate(patch.u, pool.u[k]) || !locate(patch.v, pool.v[k])) {
    pool.left |= bit;
    return;
  }
  pool.i[k] = findSpan(patch.u, pool.u[k]);
  pool.j[k] = findSpan(patch.v, pool.v[k]);
  pool.span[k] = patch.firstSpan + pool.i[k] * patch.v.numSpans + pool.j[k];
  pool.pending |= bit;
}

/** One bit for each of kFeetAtOnce numbers that equals x. */
inline unsigned long findEqual(const int* numbers, int x) {
  unsigned long equal = 0;
#if defined(__AVX512F__)
  for (int k = 0; k < kFeetAtOnce; k += 16) {
    equal |= static_cast<unsigned long>(_mm512_cmpeq_epi32_mask(_mm512_loadu_si512(numbers + k), _mm512_set1_epi32(x))) << k;
  }
#elif defined(__AVX2__)
  for (int k = 0; k < kFeetAtOnce; k += 8) {
    const __m256i eight = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(numbers + k));
    const auto bits8 = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(eight, _mm256_set1_epi32(x)))));
    equal |= static_cast<unsigned long>(bits8) << k;
  }
#else
  for (int k = 0; k < kFeetAtOnce; ++k) equal |= static_cast<unsigned long>(numbers[k] == x) << k;
#endif
  return equal;
}

struct FeetTask {
  const PatchTables* patches;
  double safeInside_m, safeOutside_m;
  const double* Q;
  const int* ids;
  FootDerivatives derivatives;
  TrackedFoot* feet;
};

/** One step of Newton's method for the feet whose numbers are in `lane`, all in one span: see solve() for one foot. */
template <int PU, int PV, bool kRational>
void stepSpan(const FeetTask& task, FeetPool& pool, const int (&lane)[kLanes], int used) {
  const int first = lane[0];
  const PatchTables& patch = task.patches[pool.patch[first]];
  const double *su = patch.u.spans + 3 * pool.i[first], *sv = patch.v.spans + 3 * pool.j[first];
  const long stride = (patch.u.degree + 1) * (patch.v.degree + 1) * 4;
  const double* c = patch.coefficients + (static_cast<long>(pool.i[first]) * patch.v.numSpans + pool.j[first]) * stride;
  double numbers[6][kLanes];
  for (int l = 0; l < kLanes; ++l) {  // those beyond the last repeat it
    const int k = lane[l];
    const double* at = task.Q + 3 * k;
    numbers[0][l] = pool.u[k];
    numbers[1][l] = pool.v[k];
    numbers[2][l] = pool.lastStep[k];
    for (int j = 0; j < 3; ++j) numbers[3 + j][l] = at[j];
  }
  const V u = loadLanes(numbers[0]), v = loadLanes(numbers[1]), lastStep = loadLanes(numbers[2]);
  const V3 q = {loadLanes(numbers[3]), loadLanes(numbers[4]), loadLanes(numbers[5])};
  const V s = (u - su[0]) * su[1], t = (v - sv[0]) * sv[1];
  V3 f, fs, ft, hss, fst, htt;
  const auto evaluate = [&](int axis, V V3::*x) __attribute__((always_inline)) {
    const Values<V> o = evaluateCoordinate<PU, PV>(patch.u.degree, patch.v.degree, c + axis, s, t);
    f.*x = o.f;
    fs.*x = o.fs;
    ft.*x = o.ft;
    hss.*x = o.halfFss;
    fst.*x = o.fst;
    htt.*x = o.halfFtt;
  };
  evaluate(0, &V3::x);
  evaluate(1, &V3::y);
  evaluate(2, &V3::z);
  if (kRational) {  // quotient rule on A / w (Piegl & Tiller eq. 4.20)
    const Values<V> o = evaluateCoordinate<PU, PV>(patch.u.degree, patch.v.degree, c + 3, s, t);
    const V w = 1 / o.f;
    f = f * w;
    fs = (fs - f * o.fs) * w;
    ft = (ft - f * o.ft) * w;
    hss = (hss - fs * o.fs - f * o.halfFss) * w;
    fst = (fst - ft * o.fs - fs * o.ft - f * o.fst) * w;
    htt = (htt - ft * o.ft - f * o.halfFtt) * w;
  }
  const V3 r = f - q;
  const V gs = dot(r, fs), gt = dot(r, ft), A = dot(fs, fs), C = dot(ft, ft);
  const V a = A + 2 * dot(r, hss), b = dot(fs, ft) + dot(r, fst), cc = C + 2 * dot(r, htt);
  const V det = a * cc - b * b;
  const Mask regular = (a > 0.02 * A) & (cc > 0.02 * C) & (det > 0.01 * a * cc) & (A > 1e-6 * C) & (C > 1e-6 * A);
  const V inv = 1 / det;
  V ds = (b * gt - cc * gs) * inv, dt = (b * gs - a * gt) * inv;
  const V step = 2 * (ds * ds * A + dt * dt * C);
  const Mask inSpan = (s + ds <= 1) & (s + ds >= -1) & (t + dt <= 1) & (t + dt >= -1);
  const V reach = magnitude(r.x) + magnitude(r.y) + magnitude(r.z);
  const double tol = patch.tolerance_m;
  const Mask good = (0.5 * (3 * patch.bend_perM + reach * patch.twist_perM2) * step <= 0.5 * tol) & inSpan;
  const Mask small = (gs * gs <= tol * tol * A) & (gt * gt <= tol * tol * C);
  const V stay = choose(small & ~good, V{}, all(1));
  ds = ds * stay;
  dt = dt * stay;
  const V uNew = u + ds * su[2], vNew = v + dt * sv[2];
  const V3 xs = fs + hss * (2 * ds) + fst * dt, xt = ft + fst * ds + htt * (2 * dt);
  const V3 B = f + (fs + hss * ds + fst * dt) * ds + (ft + htt * dt) * dt;
  const V3 N = cross(xs, xt);
  const V scale = patch.normalSign / squareRoot(dot(N, N));
  const V3 n = N * scale;
  const V distance = dot(n, q - B);
  const Mask safe = (distance < task.safeOutside_m) & (distance > -task.safeInside_m);
  const int isRegular = bits(regular), isDone = bits(regular & (good | small) & safe), isFound = bits(good | small);
  const int goesOn = bits((step < 0.25 * lastStep) & (ds < 6) & (ds > -6) & (dt < 6) & (dt > -6));

  TrackedFoot* to[kLanes];
  for (int l = 0; l < used; ++l) {
    const int k = lane[l];
    to[l] = nullptr;
    if (isDone >> l & 1) {
      to[l] = task.feet + task.ids[k];
    } else if (!(isRegular >> l & 1) || (isFound >> l & 1) || !(goesOn >> l & 1) || ++pool.evaluations[k] > 4) {
      pool.left |= 1ul << k;
    } else {
      pool.lastStep[k] = step[l];
      pool.u[k] = uNew[l];
      pool.v[k] = vNew[l];
      place(task.patches, pool, k);
    }
  }
  if (isDone == 0) return;
  const auto write = [&](const V(&number)[8], long offset) __attribute__((always_inline)) {
    Line lines[kLanes];
    turn(number, lines);
    for (int l = 0; l < used; ++l) {
      if (to[l] != nullptr) store(lines[l], reinterpret_cast<double*>(to[l]) + offset);
    }
  };
  if (task.derivatives == FootDerivatives::none) {
    write({uNew, vNew, V{}, V{}, V{}, V{}, V{}, V{}}, 0);
  } else {
    const V hu = inv * su[2], hv = inv * sv[2];
    const V3 ju = (fs * cc - ft * b) * hu, jv = (ft * a - fs * b) * hv;
    write({uNew, vNew, ju.x, ju.y, ju.z, jv.x, jv.y, jv.z}, 0);
  }
  write({q.x, q.y, q.z, distance, n.x, n.y, n.z, V{}}, 8);
  if (task.derivatives == FootDerivatives::second) {
    const V3 bs = cross(hss, ft) * all(2) + cross(fs, fst), bt = cross(fst, ft) + cross(fs, htt) * all(2);
    const V3 nu = (bs - n * dot(n, bs)) * (scale * su[1]), nv = (bt - n * dot(n, bt)) * (scale * sv[1]);
    write({nu.x, nu.y, nu.z, nv.x, nv.y, nv.z, V{}, V{}}, 16);
  }
  for (int l = 0; l < used; ++l) {
    if (to[l] == nullptr) continue;
    to[l]->patch = pool.patch[first];
    to[l]->status = QueryStatus::converged;
  }
}

void stepOneByOne(const FeetTask& task, FeetPool& pool, const int (&lane)[kLanes], int used) {
  for (int l = 0; l < used; ++l) {
    const int k = lane[l];
    const double* q = task.Q + 3 * k;
    TrackedFoot& foot = task.feet[task.ids[k]];
    const TrackedFoot before = foot;
    FootSearch search = {pool.u[k], pool.v[k], 0, 0, {}};
    const bool found = solveFoot(task.patches[pool.patch[k]], q, search, task.derivatives, foot) == FootOutcome::found;
    if (!found || !(foot.distance_m < task.safeOutside_m && foot.distance_m > -task.safeInside_m)) {
      foot = before;
      pool.left |= 1ul << k;
      continue;
    }
    for (int j = 0; j < 3; ++j) foot.Q[j] = q[j];
    foot.patch = pool.patch[k];
    foot.status = QueryStatus::converged;
  }
}

int solveFeet(const PatchTables* patches, double safeInside_m, double safeOutside_m, const double* Q, const int* ids, int count,
              FootDerivatives derivatives, TrackedFoot* feet, int* left) {
  const FeetTask task = {patches, safeInside_m, safeOutside_m, Q, ids, derivatives, feet};
  FeetPool pool;
  pool.pending = pool.left = 0;
  for (int k = 0; k < count; ++k) {
    const TrackedFoot& memory = feet[ids[k]];
    pool.patch[k] = memory.patch;
    if (memory.patch < 0) {
      pool.left |= 1ul << k;
      continue;
    }
    const double x = Q[3 * k] - memory.Q[0], y = Q[3 * k + 1] - memory.Q[1], z = Q[3 * k + 2] - memory.Q[2];
    const double* j = memory.duvdQ;
    pool.u[k] = memory.u + j[0] * x + j[1] * y + j[2] * z;
    pool.v[k] = memory.v + j[3] * x + j[4] * y + j[5] * z;
    pool.lastStep[k] = 1e300;
    pool.evaluations[k] = 0;
    place(patches, pool, k);
  }
  while (pool.pending != 0) {
    int lane[kLanes];
    int used = 0;
    unsigned long same = pool.pending & findEqual(pool.span, pool.span[__builtin_ctzl(pool.pending)]);
    for (; same != 0 && used < kLanes; same &= same - 1) {
      const int k = __builtin_ctzl(same);
      lane[used++] = k;
      pool.pending &= ~(1ul << k);
    }
    if (kLanes < 4 || used < kFewestLanes) {
      stepOneByOne(task, pool, lane, used);
      continue;
    }
    for (int l = used; l < kLanes; ++l) lane[l] = lane[used - 1];
    const PatchTables& patch = patches[pool.patch[lane[0]]];
    const int pu = patch.u.degree, pv = patch.v.degree;
    if (pu == 3 && pv == 3) {
      patch.rational ? stepSpan<3, 3, true>(task, pool, lane, used) : stepSpan<3, 3, false>(task, pool, lane, used);
    } else if (pu == 2 && pv == 2) {
      patch.rational ? stepSpan<2, 2, true>(task, pool, lane, used) : stepSpan<2, 2, false>(task, pool, lane, used);
    } else {
      patch.rational ? stepSpan<0, 0, true>(task, pool, lane, used) : stepSpan<0, 0, false>(task, pool, lane, used);
    }
  }
  int numLeft = 0;
  for (unsigned long rest = pool.left; rest != 0; rest &= rest - 1) left[numLeft++] = __builtin_ctzl(rest);
  return numLeft;
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
