// Body of the smooth rule's arithmetic; included once per instruction set with GENU_ISA set to its namespace.

#include "CellKernel.h"
#include "CellLaw.inl"
#include "CellRule.h"
#include "Lanes.inl"

namespace genu::contact::detail::GENU_ISA {

namespace {

// ---- candidates -------------------------------------------------------------------------------------------------

int listDue(const double* mark, int count, double way, int* list) {
  int found = 0, e = 0;
  for (; e + kLanes <= count; e += kLanes) {
    unsigned due = static_cast<unsigned>(bits(~(loadLanes(mark + e) > way)));
    for (; due != 0; due &= due - 1) list[found++] = e + __builtin_ctz(due);
  }
  for (; e < count; ++e) {
    if (!(mark[e] > way)) list[found++] = e;
  }
  return found;
}

// ---- nodes ------------------------------------------------------------------------------------------------------

void setNodes(const CellGrid& g, const int* nodes, int count) {
  const double* R = g.R;
  const bool byRay = g.hits != nullptr;
  for (int first = 0; first < count; first += kLanes) {
    const int used = count - first < kLanes ? count - first : kLanes;
    int node[kLanes];
    double numbers[5][kLanes];
    Line places[kLanes];
    for (int l = 0; l < kLanes; ++l) {  // those beyond the last repeat it
      const int k = node[l] = nodes[first + (l < used ? l : used - 1)];
      const double* N = byRay ? g.hits[k].normal : g.feet[k].normal;
      for (int j = 0; j < 3; ++j) numbers[j][l] = N[j];
      numbers[3][l] = byRay ? -g.hits[k].t_m : -g.feet[k].distance_m;
      numbers[4][l] = g.field[k].hM_m;
      places[l] = loadLine(g.place + kPlaceStride * k);
    }
    V place[8];
    turnBack(places, place);
    const V3 A = {place[0], place[1], place[2]}, n = {place[4], place[5], place[6]};
    const V3 N = {loadLanes(numbers[0]), loadLanes(numbers[1]), loadLanes(numbers[2])};
    const V hM = loadLanes(numbers[4]);
    const V3 u = {-(R[0] * N.x + R[1] * N.y + R[2] * N.z), -(R[3] * N.x + R[4] * N.y + R[5] * N.z), -(R[6] * N.x + R[7] * N.y + R[8] * N.z)};
    const V3 sum = n + u;
    const V cosTheta = dot(n, u), h = place[7] + hM;
    const Mask corrected = (cosTheta > 0) & (Mask{} - g.corrected);
    const V length = choose(corrected, squareRoot(dot(sum, sum)), V{}), inverse = choose(corrected, 1 / length, V{});
    const V c = choose(corrected, byRay ? 2 * inverse * cosTheta : 2 * inverse, all(1));
    const V3& plain = byRay && !g.corrected ? n : u;
    const V3 m = {choose(corrected, sum.x * inverse, plain.x), choose(corrected, sum.y * inverse, plain.y),
                  choose(corrected, sum.z * inverse, plain.z)};
    V factor = all(1);
    if (g.damping_sPerM > 0) {
      // Rate of approach: the velocity of M's point at A against the force on it.
      const V3 velocity = {g.v[0] + g.w[1] * A.z - g.w[2] * A.y, g.v[1] + g.w[2] * A.x - g.w[0] * A.z, g.v[2] + g.w[0] * A.y - g.w[1] * A.x};
      factor = 1 - g.damping_sPerM * dot(m, velocity);
      factor = choose(factor > 0, factor, V{});
    }
    const V r = c / h, scalar = place[3] * factor * (g.linear ? g.K_Pa * r : all(1));
    const V3 force = m * scalar, moment = cross(A, force);
    Line directions[kLanes], rest[kLanes], loads[kLanes];
    const V direction[8] = {m.x, m.y, m.z, length, u.x, u.y, u.z, cosTheta}, others[8] = {c, h, hM, factor, r, place[7] / h, V{}, V{}};
    const V load[8] = {force.x, force.y, force.z, moment.x, moment.y, moment.z, scalar, V{}};
    turn(direction, directions);
    turn(others, rest);
    turn(load, loads);
    for (int l = 0; l < used; ++l) {
      const int k = node[l];
      g.s[k] = numbers[3][l];
      if (!g.usable[k]) continue;
      double* field = g.field[k].m;
      store(directions[l], field);
      store(rest[l], field + 8);
      store(loads[l], g.load + kLoadStride * k);
      g.r[k] = get(rest[l], 4);
      if (g.share != nullptr) g.share[k] = get(rest[l], 5);
    }
  }
}

// ---- cells ------------------------------------------------------------------------------------------------------

inline int usableNeighbors(const CellGrid& g, const int* stencil) {
  int mask = 0, corners = 0;
  for (int k = 1; k < kStencil; ++k) {
    if (stencil[k] < 0 || !g.usable[stencil[k]]) continue;
    if (k < 5) {
      mask |= 1 << (k - 1);
    } else {
      ++corners;
    }
  }
  return corners == 4 ? mask | 16 : mask;
}

int testCells(const CellGrid& g, const int* candidates, int count, double* bound, int* mask, CellTask* tasks) {
  int found = 0;
  for (int i = 0; i < count; ++i) {
    const int e = candidates[i];
    const int* stencil = g.stencil + 9 * e;
    mask[i] = -1;
    if (!g.usable[stencil[0]]) continue;
    mask[i] = usableNeighbors(g, stencil);
    double s[kStencil];
    for (int k = 0; k < kStencil; ++k) s[k] = stencil[k] >= 0 ? g.s[stencil[k]] : 0;
    CellTask& task = tasks[found];
    calcCoefficients(s, mask[i], task.S);
    bound[i] = upperBound(task.S);
    if (!(bound[i] > 0)) continue;
    task.element = e;
    task.mask = mask[i];
    ++found;
  }
  return found;
}

/** Coefficients of the smooth load density from its nodes, 8 numbers each. */
inline void gatherLoad(const CellGrid& g, const int* stencil, int mask, Line G[kSmooth]) {
  if ((mask & 15) == 15) {
    const Line c = loadLine(g.load + kLoadStride * stencil[0]), e = loadLine(g.load + kLoadStride * stencil[1]),
             w = loadLine(g.load + kLoadStride * stencil[2]), n = loadLine(g.load + kLoadStride * stencil[3]),
             s = loadLine(g.load + kLoadStride * stencil[4]);
    G[0] = c;
    G[1] = 0.5 * (e - w);
    G[2] = 0.5 * (n - s);
    G[3] = 0.5 * (e + w) - c;
    G[4] = 0.5 * (n + s) - c;
    return;
  }
  const StencilWeights& T = stencilWeights(mask);
  for (int k = 0; k < kSmooth; ++k) {
    Line sum = {};
    for (int n = 0; n < 5; ++n) {
      if (T.T[k][n] != 0) sum += T.T[k][n] * loadLine(g.load + kLoadStride * stencil[n]);
    }
    G[k] = sum;
  }
}

inline void contract(const double moments[kMoments], const Line G[kSmooth], int count, double* out) {
  for (int c = 0; c < count; ++c) {
    Line sum = {};
    for (int k = 0; k < kSmooth; ++k) {
      sum += moments[momentIndex(kPowers[k][0] + kPowers[c][0], kPowers[k][1] + kPowers[c][1])] * G[k];
    }
    store(sum, out + 8 * c);
  }
}

template <bool kWithStiffness>
void integrateAs(const CellGrid& g, const LawView& law, const CellTask* tasks, int count, bool withEnergy, double* out) {
  const bool isLinear = g.linear;
  constexpr int stride = kWithStiffness ? kCellStride : kCellWeights;
  for (int i = 0; i < count; ++i, out += stride) {
    const CellTask& task = tasks[i];
    const int* stencil = g.stencil + 9 * task.element;
    const double* S = task.S;
    CellMoments m;
    const bool full = lowerBound(S) >= 0;
    const bool readsLaw = !isLinear || withEnergy;
    double R[kSmooth] = {};
    LawQuadrature rule = {nullptr, true};
    if (readsLaw) {
      gatherSmooth([&](int k) { return g.r[k]; }, stencil, task.mask, R);
      rule = chooseQuadrature(S, R, full, law.shape);
    }
    Lines lines;
    if (full) {
      for (int k = 0; k < kMoments; ++k) m.area[k] = kFullArea[k];
    } else {
      if (isLinear) {
        calcRimArea(S, m.area);
      } else if (rule.mild) {  // the same lines for area and law
        findLawLines(S, R, law.shape, true, lines);
        sumArea<2>(lines, m.area);
      } else {
        findLines(S, lines, true);
        padLines(lines);
        sumArea<2>(lines, m.area);
      }
      if (!(m.area[0] > 0)) {
        out[3] = 0;
        continue;
      }
    }
    if (readsLaw && rule.points == nullptr && g.share == nullptr && (isLinear || !rule.mild || full)) findLawLines(S, R, law.shape, rule.mild, lines);
    if (isLinear) {
      if (withEnergy) calcLawMoments<true, false>(S, R, rule, lines, law, m);
      if (full) {
        calcFullLinearMoments(S, m.pressure);
      } else {
        calcLinearMoments(S, m.area, m.pressure);
      }
    } else if (g.share != nullptr) {
      double Q[kSmooth];
      gatherSmooth([&](int k) { return g.share[k]; }, stencil, task.mask, Q);
      calcSharedMoments<kWithStiffness>(S, R, Q, full, law, m);
    } else {
      withEnergy ? calcLawMoments<true, kWithStiffness>(S, R, rule, lines, law, m)
                 : calcLawMoments<false, kWithStiffness>(S, R, rule, lines, law, m);
    }
    const double area[kSmooth] = {m.area[0], m.area[1], m.area[2], m.area[3], m.area[5]};
    spreadSmooth<4>(m.pressure, task.mask, out);
    spreadSmooth<4>(area, task.mask, out + 1);
    if (withEnergy) spreadSmooth<4>(m.energy, task.mask, out + 2);  // not read otherwise
    for (int n = 1; n < 5; ++n) out[4 * n + 3] = 0;
    out[3] = m.area[0];
    if (kWithStiffness) {
      Line G[kSmooth];
      gatherLoad(g, stencil, task.mask, G);
      contract(isLinear ? m.area : m.slopeR, G, kMonomials, out + kBySOffset);
      if (!isLinear) contract(m.slopeS, G, kSmooth, out + kByROffset);
      if (g.share != nullptr) contract(m.slopeShare, G, kSmooth, out + kByShareOffset);
    }
  }
}

void integrate(const CellGrid& g, const LawView& law, const CellTask* tasks, int count, bool withEnergy, bool withStiffness, double* out) {
  withStiffness ? integrateAs<true>(g, law, tasks, count, withEnergy, out) : integrateAs<false>(g, law, tasks, count, withEnergy, out);
}

inline void addLine(const Line& line, double* to) { store(loadLine(to) + line, to); }

void scatter(const CellGrid& g, const CellTask* tasks, int count, bool withStiffness, const double* out) {
  const int stride = withStiffness ? kCellStride : kCellWeights;
  typedef double V4 __attribute__((vector_size(32)));
  for (int i = 0; i < count; ++i, out += stride) {
    if (!(out[3] > 0)) continue;
    const CellTask& task = tasks[i];
    const int* stencil = g.stencil + 9 * task.element;
    const int nodes = withStiffness ? kStencil : 5;
    for (int n = 0; n < nodes; ++n) {
      const int k = stencil[n];
      if (k < 0) continue;
      unsigned long& word = g.touched[k >> 6];
      const unsigned long bit = 1ul << (k & 63);
      if (word & bit) continue;
      word |= bit;
      for (int j = 0; j < kWeightStride; ++j) g.weight[kWeightStride * k + j] = 0;
      if (withStiffness) {
        store(Line{}, g.adjoint + kAdjointStride * k);
        store(Line{}, g.adjoint + kAdjointStride * k + 8);
        if (g.byShare != nullptr) store(Line{}, g.byShare + 8 * k);
      }
    }
    for (int n = 0; n < 5; ++n) {
      if (stencil[n] < 0) continue;
      double* to = g.weight + kWeightStride * stencil[n];
      V4 a, b;
      __builtin_memcpy(&a, to, sizeof a);
      __builtin_memcpy(&b, out + 4 * n, sizeof b);
      a += b;
      __builtin_memcpy(to, &a, sizeof a);
    }
    if (!withStiffness) continue;
    const double* byS = out + kBySOffset;
    const double* byR = out + kByROffset;
    if (g.byShare != nullptr) {
      const StencilWeights& T = stencilWeights(task.mask);
      for (int n = 0; n < 5; ++n) {
        for (int c = 0; c < kSmooth; ++c) {
          if (T.T[c][n] != 0) addLine(T.T[c][n] * loadLine(out + kByShareOffset + 8 * c), g.byShare + 8 * stencil[n]);
        }
      }
    }
    if (task.mask == kAllNeighbors) {
      const Line s1 = 0.5 * loadLine(byS + 8), s2 = 0.5 * loadLine(byS + 16), s3 = loadLine(byS + 24), s4 = loadLine(byS + 32),
               s5 = 0.25 * loadLine(byS + 40);
      const auto to = [&](int n) { return g.adjoint + kAdjointStride * stencil[n]; };
      addLine(loadLine(byS) - s3 - s4, to(0));
      addLine(0.5 * s3 + s1, to(1));
      addLine(0.5 * s3 - s1, to(2));
      addLine(0.5 * s4 + s2, to(3));
      addLine(0.5 * s4 - s2, to(4));
      addLine(s5, to(5));
      addLine(-s5, to(6));
      addLine(-s5, to(7));
      addLine(s5, to(8));
      if (!g.linear) {
        const Line r1 = 0.5 * loadLine(byR + 8), r2 = 0.5 * loadLine(byR + 16), r3 = loadLine(byR + 24), r4 = loadLine(byR + 32);
        addLine(loadLine(byR) - r3 - r4, to(0) + 8);
        addLine(0.5 * r3 + r1, to(1) + 8);
        addLine(0.5 * r3 - r1, to(2) + 8);
        addLine(0.5 * r4 + r2, to(3) + 8);
        addLine(0.5 * r4 - r2, to(4) + 8);
      }
      continue;
    }
    const StencilWeights& T = stencilWeights(task.mask);
    for (int n = 0; n < kStencil; ++n) {
      for (int c = 0; c < kMonomials; ++c) {
        if (T.T[c][n] == 0) continue;
        double* to = g.adjoint + kAdjointStride * stencil[n];
        addLine(T.T[c][n] * loadLine(byS + 8 * c), to);
        if (!g.linear && c < kSmooth) addLine(T.T[c][n] * loadLine(byR + 8 * c), to + 8);
      }
    }
  }
}

// ---- sums -------------------------------------------------------------------------------------------------------

template <class Visit>
inline void forEachTouched(const CellGrid& g, int numWords, Visit visit) {
  for (int word = 0; word < numWords; ++word) {
    for (unsigned long bits = g.touched[word]; bits != 0; bits &= bits - 1) visit(64 * word + __builtin_ctzl(bits));
  }
}

void sum(const CellGrid& g, int numWords, bool withEnergy, NetSums& total) {
  Line first = {};
  double second[4] = {};
  double energy = 0;
  forEachTouched(g, numWords, [&](int k) {
    const double* w = g.weight + kWeightStride * k;
    const double* L = g.load + kLoadStride * k;
    if (w[0] == 0 && w[1] == 0) return;  // an unusable node may hold anything
    first += w[0] * loadLine(L);
    const double* place = g.place + kPlaceStride * k;
    const double scalar = w[0] * L[6];
    for (int j = 0; j < 3; ++j) second[j] += scalar * place[j];
    second[3] += w[1] * place[3];
    if (withEnergy) energy += w[2] * place[3] * g.field[k].h_m;
  });
  for (int j = 0; j < 3; ++j) {
    total.force[j] = get(first, j);
    total.moment[j] = get(first, 3 + j);
    total.weighted[j] = second[j];
  }
  total.scalar = get(first, 6);
  total.area = second[3];
  total.energy = energy;
}

inline void rotate(const double R[9], const double a[3], double b[3]) {
  for (int i = 0; i < 3; ++i) b[i] = R[3 * i] * a[0] + R[3 * i + 1] * a[1] + R[3 * i + 2] * a[2];
}

/** A small motion (v, w) of M at Fo moves A by -(v + w x A) in M; du = w x u + H (v + w x A), H the Hessian of the signed
 distance. By ray, the hit C = A - s n takes the place of A: ds = -u.(v + w x C)/cos(theta), du = w x u + H (v + w x C), H the change of
 the normal at C with the ray's place. Rows of six columns: v, w. */
void sumStiffness(const CellGrid& g, int numWords, ThicknessSlope thicknessSlope, const void* self, StiffnessSums& total) {
  Line K[6] = {}, D[6] = {};
  const bool damped = g.damping_sPerM > 0, byRay = g.hits != nullptr;
  forEachTouched(g, numWords, [&](int k) {
    if (!g.usable[k]) return;
    const NodeField& f = g.field[k];
    const double* A = g.place + kPlaceStride * k;
    const double* adjoint = g.adjoint + kAdjointStride * k;
    const double *u = f.u, *m = f.m;
    double P[3] = {A[0], A[1], A[2]};
    double perS = 1;
    const double *surfaceNu = g.feet[k].nu, *surfaceNv = g.feet[k].nv, *surfaceJ = g.feet[k].duvdQ;
    bool bends = g.feet[k].status == QueryStatus::converged;
    if (byRay) {
      for (int j = 0; j < 3; ++j) P[j] -= g.s[k] * A[4 + j];
      perS = 1 / f.cosTheta;
      const TrackedHit& hit = g.hits[k];
      surfaceNu = hit.nu;
      surfaceNv = hit.nv;
      surfaceJ = hit.duvdA;
      bends = true;
    }
    const Line ds = perS * makeLine(-u[0], -u[1], -u[2], P[2] * u[1] - P[1] * u[2], P[0] * u[2] - P[2] * u[0], P[1] * u[0] - P[0] * u[1], 0, 0);
    double W[3][3] = {};
    if (bends) {
      double nu[3], nv[3], ju[3], jv[3];
      rotate(g.R, surfaceNu, nu);
      rotate(g.R, surfaceNv, nv);
      rotate(g.R, surfaceJ, ju);
      rotate(g.R, surfaceJ + 3, jv);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) W[i][j] = nu[i] * ju[j] + nv[i] * jv[j];
      }
    }
    const auto row = [&](int i, double x, double y, double z) {
      const double* w = W[i];
      return makeLine(w[0], w[1], w[2], x + P[1] * w[2] - P[2] * w[1], y + P[2] * w[0] - P[0] * w[2], z + P[0] * w[1] - P[1] * w[0], 0, 0);
    };
    Line dm[3] = {row(0, 0, u[2], -u[1]), row(1, -u[2], 0, u[0]), row(2, u[1], -u[0], 0)};  // du first
    Line dr = {};
    if (f.length > 0) {
      const Line along = m[0] * dm[0] + m[1] * dm[1] + m[2] * dm[2];
      const double inverse = 1 / f.length;
      for (int i = 0; i < 3; ++i) dm[i] = (dm[i] - m[i] * along) * inverse;
      // c = 2/length, by ray 2 cos(theta)/length = length - 2/length
      dr = along * ((byRay ? 1 + 2 * inverse * inverse : -2 * inverse * inverse) / f.h_m);
    } else if (byRay && !g.corrected) {
      for (int i = 0; i < 3; ++i) dm[i] = Line{};  // along n, which stays
    }
    double slope[3];
    if (thicknessSlope != nullptr && thicknessSlope(self, k, slope)) {
      const Line wrench = makeLine(slope[0], slope[1], slope[2], P[1] * slope[2] - P[2] * slope[1], P[2] * slope[0] - P[0] * slope[2],
                         P[0] * slope[1] - P[1] * slope[0], 0, 0);
      dr += wrench * (g.r[k] / f.h_m);
      if (g.share != nullptr) {  // dh = -wrench, share = hF/h
        const Line dShare = wrench * (g.share[k] / f.h_m);
        for (int i = 0; i < 6; ++i) K[i] += g.byShare[8 * k + i] * dShare;
      }
    }
    const double scale = g.weight[kWeightStride * k] * A[3] * (g.linear ? g.K_Pa : 1);
    Line df[3];
    const double value = g.linear ? g.r[k] : 1;
    for (int i = 0; i < 3; ++i) {
      df[i] = (scale * f.factor * value) * dm[i];
      if (g.linear) df[i] += (scale * f.factor * m[i]) * dr;
    }
    if (damped && f.factor > 0) {
      const double at[3] = {g.v[0] + g.w[1] * A[2] - g.w[2] * A[1], g.v[1] + g.w[2] * A[0] - g.w[0] * A[2],
                            g.v[2] + g.w[0] * A[1] - g.w[1] * A[0]};  // velocity of M's point at A
      const Line dFactor = -g.damping_sPerM * (at[0] * dm[0] + at[1] * dm[1] + at[2] * dm[2]);
      for (int i = 0; i < 3; ++i) df[i] += (scale * value * m[i]) * dFactor;
      const Line wrench = makeLine(m[0], m[1], m[2], A[1] * m[2] - A[2] * m[1], A[2] * m[0] - A[0] * m[2], A[0] * m[1] - A[1] * m[0], 0, 0);
      for (int i = 0; i < 6; ++i) D[i] += (-g.damping_sPerM * scale * value * get(wrench, i)) * wrench;
    }
    for (int i = 0; i < 6; ++i) {
      K[i] += adjoint[i] * ds;
      if (!g.linear) K[i] += adjoint[8 + i] * dr;
    }
    for (int i = 0; i < 3; ++i) K[i] += df[i];
    K[3] += A[1] * df[2] - A[2] * df[1];
    K[4] += A[2] * df[0] - A[0] * df[2];
    K[5] += A[0] * df[1] - A[1] * df[0];
  });
  for (int i = 0; i < 6; ++i) {
    store(K[i], total.byMotion + 8 * i);
    store(D[i], total.byRate + 8 * i);
  }
}

inline void calcStrain(const CellGrid& g, const CellTask& task, double E[kMonomials]) {
  gatherStrain(g.stencil + 9 * task.element, g.usable, g.s, g.r, task.mask, E);
}

/** The polynomial of the neighbor on one side of a cell, at (xi, eta) of the neighbor; 0 where it does not touch. */
inline double evaluateNeighbor(const CellGrid& g, const CellTask* tasks, int count, int element, double xi, double eta) {
  int low = 0, high = count;  // tasks are in element order
  while (low < high) {
    const int middle = (low + high) / 2;
    if (tasks[middle].element < element) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == count || tasks[low].element != element) return 0;
  double E[kMonomials];
  calcStrain(g, tasks[low], E);
  return evaluateAt(E, xi, eta);
}

/** The place with the largest strain. Where the surface turns away within a cell, its polynomial overshoots beyond the turn, and those of
 its neighbors do not: a place between the nodes counts as much as the least of them says, less what they differ by. */
void findPeak(const CellGrid& g, const CellTask* tasks, int count, PeakPlace& peak) {
  peak = {-1e300, -1, -1, 0, 0, 0, 0};
  for (int i = 0; i < count; ++i) {
    const int k = tasks[i].element;
    const double strain = g.s[k] * g.r[k];
    if (!(strain > peak.nodeStrain)) continue;
    peak.nodeStrain = strain;
    peak.node = k;
  }
  const double least = peak.largest = larger(peak.nodeStrain, 0.0);
  double best = least, bestOwn = least;
  for (int i = 0; i < count; ++i) {
    double E[kMonomials];
    calcStrain(g, tasks[i], E);
    if (!(upperBound(E) > best)) continue;
    double xi = 0, eta = 0;
    const double own = findMaximum(E, xi, eta);
    if (!(own > least)) continue;
    peak.largest = larger(peak.largest, own);
    const int* stencil = g.stencil + 9 * tasks[i].element;
    double value = own;
    if (xi != 0) value = smaller(value, evaluateNeighbor(g, tasks, count, stencil[xi > 0 ? 1 : 2], xi - __builtin_copysign(1, xi), eta));
    if (eta != 0) value = smaller(value, evaluateNeighbor(g, tasks, count, stencil[eta > 0 ? 3 : 4], xi, eta - __builtin_copysign(1, eta)));
    value = larger(value - (own - value), larger(E[0], 0.0));
    if (value > best || (value == best && own > bestOwn)) {
      best = value;
      bestOwn = own;
      peak.cell = tasks[i].element;
      peak.mask = tasks[i].mask;
      peak.xi = xi;
      peak.eta = eta;
    }
  }
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
