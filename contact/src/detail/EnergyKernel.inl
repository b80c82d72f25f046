// Body of the energy form's arithmetic; included once per instruction set with GENU_ISA set to its namespace.

#include "CellLaw.inl"
#include "CellRule.h"
#include "EnergyKernel.h"
#include "KernelMath.inl"
#include "Lanes.inl"

namespace genu::contact::detail::GENU_ISA {

namespace {

// ---- nodes in lanes ---------------------------------------------------------------------------------------------

GENU_INLINE V3 rotateLanes(const double R[9], const V3& a) {
  return {R[0] * a.x + R[1] * a.y + R[2] * a.z, R[3] * a.x + R[4] * a.y + R[5] * a.z, R[6] * a.x + R[7] * a.y + R[8] * a.z};
}
GENU_INLINE V3 rotateBack(const double R[9], const V3& a) {
  return {R[0] * a.x + R[3] * a.y + R[6] * a.z, R[1] * a.x + R[4] * a.y + R[7] * a.z, R[2] * a.x + R[5] * a.y + R[8] * a.z};
}

/** Line `offset` of what each lane's node has in an array of `stride` numbers a node. */
GENU_INLINE void loadNodes(const double* array, long stride, long offset, const int (&node)[kLanes], V (&to)[8]) {
  Line lines[kLanes];
  for (int l = 0; l < kLanes; ++l) lines[l] = loadLine(array + stride * node[l] + offset);
  turnBack(lines, to);
}

/** Up to kLanes nodes: place, field and foot. */
struct NodeLanes {
  V3 A, n, u;              // F
  V3 ju, jv, nu, nv;       // gradients of the foot's parameters, slopes of its normal: M
  V parameterU, parameterV, distance;
  V3 normal_M;
  V area, h, r, perLength2;  // 1/length^2, 0 without correction
};

GENU_INLINE void loadNodeLanes(const CellGrid& g, const int (&node)[kLanes], NodeLanes& o) {
  constexpr long kFoot = sizeof(TrackedFoot) / sizeof(double), kField = sizeof(NodeField) / sizeof(double);
  const auto* feet = reinterpret_cast<const double*>(g.feet);
  const auto* fields = reinterpret_cast<const double*>(g.field);
  V x[8];
  loadNodes(g.place, kPlaceStride, 0, node, x);
  o.A = {x[0], x[1], x[2]};
  o.area = x[3];
  o.n = {x[4], x[5], x[6]};
  loadNodes(fields, kField, 0, node, x);
  o.perLength2 = choose(x[3] > 0, 1 / (x[3] * x[3]), V{});
  o.u = {x[4], x[5], x[6]};
  loadNodes(fields, kField, 8, node, x);
  o.h = x[1];
  o.r = x[4];
  loadNodes(feet, kFoot, 0, node, x);
  o.parameterU = x[0];
  o.parameterV = x[1];
  o.ju = {x[2], x[3], x[4]};
  o.jv = {x[5], x[6], x[7]};
  loadNodes(feet, kFoot, 8, node, x);
  o.distance = x[3];
  o.normal_M = {x[4], x[5], x[6]};
  loadNodes(feet, kFoot, 16, node, x);
  o.nu = {x[0], x[1], x[2]};
  o.nv = {x[3], x[4], x[5]};
}

/** d(length)/length of n + u by the shift of the query point and by the turn; W: Hessian of the distance. */
struct LengthChange {
  V3 byShift, byTurn;
};
GENU_INLINE LengthChange calcLengthChange(const CellGrid& g, const NodeLanes& o, const V3& n_M) {
  const V3 Wn = rotateLanes(g.R, o.nu * dot(o.ju, n_M) + o.nv * dot(o.jv, n_M));
  return {Wn * o.perLength2, cross(o.u, o.n) * o.perLength2};
}

void setFirst(const EnergyGrid& e, const int* nodes, int count) {
  const CellGrid& g = e.cells;
  for (int first = 0; first < count; first += kLanes) {
    const int used = count - first < kLanes ? count - first : kLanes;
    int node[kLanes];
    for (int l = 0; l < kLanes; ++l) node[l] = nodes[first + (l < used ? l : used - 1)];
    NodeLanes o;
    loadNodeLanes(g, node, o);
    const LengthChange length = calcLengthChange(g, o, rotateBack(g.R, o.n));
    const V3 turn_s = cross(o.A, o.u);
    V3 shift = length.byShift, turnR = length.byTurn + cross(o.A, length.byShift);
    V3 layer = {}, turnG = {};
    if (e.layer != nullptr) {
      V x[8];
      loadNodes(e.layer, kLayerStride, 0, node, x);
      const V3 slope = rotateLanes(g.R, {x[0], x[1], x[2]}) * (-1 / o.h), turned = cross(o.A, slope);
      shift = shift + slope;
      turnR = turnR + turned;
      layer = slope * (o.area * o.h);
      turnG = turned * (o.area * o.h);
    }
    Line s[kLanes], r[kLanes], G[kLanes];
    const V ofS[8] = {-o.u.x, -o.u.y, -o.u.z, -turn_s.x, -turn_s.y, -turn_s.z, V{}, V{}};
    const V ofR[8] = {-o.r * shift.x, -o.r * shift.y, -o.r * shift.z, -o.r * turnR.x, -o.r * turnR.y, -o.r * turnR.z, V{}, V{}};
    const V ofG[8] = {layer.x, layer.y, layer.z, turnG.x, turnG.y, turnG.z, V{}, V{}};
    turn(ofS, s);
    turn(ofR, r);
    turn(ofG, G);
    for (int l = 0; l < used; ++l) {
      double* to = e.gradient + static_cast<long>(kGradientStride) * node[l];
      store(s[l], to);
      store(r[l], to + 8);
      store(G[l], to + 16);
    }
  }
}

// ---- cells ------------------------------------------------------------------------------------------------------

/** Coefficients of the nodes' lines at `offset` of their gradients, `count` of them. */
GENU_INLINE void gatherGradient(const EnergyGrid& e, const int* stencil, int mask, int offset, int count, double (*to)[8]) {
  const auto at = [&](int n) { return e.gradient + static_cast<long>(kGradientStride) * stencil[n] + offset; };
  if (mask == kAllNeighbors || (count == kSmooth && (mask & 15) == 15)) {
    const Line c = loadLine(at(0)), east = loadLine(at(1)), west = loadLine(at(2)), north = loadLine(at(3)), south = loadLine(at(4));
    store(c, to[0]);
    store(0.5 * (east - west), to[1]);
    store(0.5 * (north - south), to[2]);
    store(0.5 * (east + west) - c, to[3]);
    store(0.5 * (north + south) - c, to[4]);
    if (count > kSmooth) store(0.25 * ((loadLine(at(5)) - loadLine(at(6))) + (loadLine(at(8)) - loadLine(at(7)))), to[5]);
    return;
  }
  const StencilWeights& T = stencilWeights(mask);
  for (int m = 0; m < count; ++m) {
    Line sum = {};
    for (int n = 0; n < kStencil; ++n) {
      if (T.T[m][n] != 0) sum += T.T[m][n] * loadLine(at(n));
    }
    store(sum, to[m]);
  }
}

/** Sums of products over the points of cells: the upper triangle of a symmetric 6 x 6 matrix, row by row. */
constexpr int kTriangle = 21;

template <bool kLayerVaries>
void addProducts(const EnergyGrid& e, const CellTask& task, const int* stencil, const double* G, const LawPoints& points, const LawReading& reading,
                 V (&sums)[kTriangle]) {
  double dS[kMonomials][8], dR[kSmooth][8], dG[kSmooth][8];
  gatherGradient(e, stencil, task.mask, 0, kMonomials, dS);
  gatherGradient(e, stencil, task.mask, 8, kSmooth, dR);
  if (kLayerVaries) gatherGradient(e, stencil, task.mask, 16, kSmooth, dG);
  for (int i = 0; i < points.count; i += kLanes) {
    const V w = loadLanes(points.w + i), xi = loadLanes(points.xi + i), eta = loadLanes(points.eta + i);
    const V s = loadLanes(reading.s + i), r = loadLanes(reading.r + i), wp = w * loadLanes(reading.p + i);
    const V area = evaluateSmoothLanes(G, xi, eta), slope = w * area * loadLanes(reading.dp + i), load = wp * area;
    const V xi2 = xi * xi, eta2 = eta * eta, xiEta = xi * eta;
    V ds[6], dr[6], de[6], dArea[6];
    for (int j = 0; j < 6; ++j) {
      ds[j] = dS[0][j] + xi * dS[1][j] + eta * dS[2][j] + xi2 * dS[3][j] + eta2 * dS[4][j] + xiEta * dS[5][j];
      dr[j] = dR[0][j] + xi * dR[1][j] + eta * dR[2][j] + xi2 * dR[3][j] + eta2 * dR[4][j];
      de[j] = r * ds[j] + s * dr[j];
      if (kLayerVaries) dArea[j] = wp * (dG[0][j] + xi * dG[1][j] + eta * dG[2][j] + xi2 * dG[3][j] + eta2 * dG[4][j]);
    }
    int at = 0;
    for (int j = 0; j < 6; ++j) {
      const V byStrain = slope * de[j], byS = load * dr[j], byR = load * ds[j];
      for (int k = j; k < 6; ++k) {
        sums[at] += byStrain * de[k] + byS * ds[k] + byR * dr[k];
        if (kLayerVaries) sums[at] += dArea[j] * de[k] + de[j] * dArea[k];
        ++at;
      }
    }
  }
}

void integrateEnergy(const EnergyGrid& e, const LawView& law, const CellTask* tasks, int count, const double* cells, int cellStride,
                     bool withStiffness, EnergySums& total) {
  const CellGrid& g = e.cells;
  LawPoints points;
  LawReading reading;
  V sums[kTriangle] = {};
  for (int i = 0; i < count; ++i) {
    if (!(cells[static_cast<long>(i) * cellStride + 3] > 0)) continue;
    const CellTask& task = tasks[i];
    const int* stencil = g.stencil + 9 * task.element;
    double R[kSmooth], G[kSmooth], share[kSmooth], byS[8], byR[8], byG[8];
    gatherSmooth([&](int k) { return g.r[k]; }, stencil, task.mask, R);
    gatherSmooth([&](int k) { return g.place[kPlaceStride * k + 3] * g.field[k].h_m; }, stencil, task.mask, G);
    if (g.share != nullptr) gatherSmooth([&](int k) { return g.share[k]; }, stencil, task.mask, share);
    listLawPoints(task.S, R, lowerBound(task.S) >= 0, law.shape, points);
    readLaw(task.S, R, g.share != nullptr ? share : nullptr, law, points, reading);
    calcEnergyMoments(G, points, reading, byS, byR, byG);
    if (withStiffness) {
      e.layer != nullptr ? addProducts<true>(e, task, stencil, G, points, reading, sums)
                         : addProducts<false>(e, task, stencil, G, points, reading, sums);
    }
    double share9[kStencil][3] = {};  // of each node's s, r and area times thickness
    spreadSmooth<3>(byS, task.mask, share9[0]);
    spreadSmooth<3>(byR, task.mask, share9[0] + 1);
    spreadSmooth<3>(byG, task.mask, share9[0] + 2);
    if ((task.mask & 16) != 0) {
      share9[5][0] = share9[8][0] = 0.25 * byS[5];
      share9[6][0] = share9[7][0] = -0.25 * byS[5];
    }
    for (int n = 0; n < kStencil; ++n) {
      const int k = stencil[n];
      if (k < 0 || !g.usable[k]) continue;
      double* to = e.gradient + static_cast<long>(kGradientStride) * k + 6;
      for (int j = 0; j < 3; ++j) to[8 * j] += share9[n][j];
    }
  }
  if (!withStiffness) return;
  int at = 0;
  for (int j = 0; j < 6; ++j) {
    for (int k = j; k < 6; ++k) {
      double lanes[kLanes], sum = 0;
      storeLanes(sums[at++], lanes);
      for (const double lane : lanes) sum += lane;
      total.byMotion[8 * j + k] = total.byMotion[8 * k + j] = -sum;
    }
  }
}

// ---- sums -------------------------------------------------------------------------------------------------------

void sumFirst(const EnergyGrid& e, const int* nodes, int count, EnergySums& sums) {
  Line load = {};
  for (int i = 0; i < count; ++i) {
    const double* g = e.gradient + static_cast<long>(kGradientStride) * nodes[i];
    load = load - (g[6] * loadLine(g) + g[14] * loadLine(g + 8) + g[22] * loadLine(g + 16));
  }
  store(load, sums.load);
}

/** Taylor coefficients to the third order: c21 is f_sst / 2. */
template <class T>
struct Taylor {
  T c00, c10, c01, c20, c11, c02, c30, c21, c12, c03;
};

template <int PU, int PV>
GENU_INLINE Taylor<V> evaluateTaylor(int pu, int pv, const double* c, V s, V t) {
  const int nu = PU > 0 ? PU : pu, nv = PV > 0 ? PV : pv;
  Taylor<V> o = {};
#pragma GCC unroll 6
  for (int k = 0; k <= nu; ++k) {
    const double* row = c + 4 * (nu - k) * (nv + 1);
    V r0 = {}, r1 = {}, r2 = {}, r3 = {};
#pragma GCC unroll 6
    for (int m = 0; m <= nv; ++m) {
      r3 = m < 3 ? r3 : m == 3 ? r2 : r3 * t + r2;
      r2 = m < 2 ? r2 : m == 2 ? r1 : r2 * t + r1;
      r1 = m < 1 ? r1 : m == 1 ? r0 : r1 * t + r0;
      r0 = m < 1 ? all(row[4 * nv]) : r0 * t + row[4 * (nv - m)];
    }
    o.c30 = k < 3 ? o.c30 : k == 3 ? o.c20 : o.c30 * s + o.c20;
    o.c20 = k < 2 ? o.c20 : k == 2 ? o.c10 : o.c20 * s + o.c10;
    o.c21 = k < 2 ? o.c21 : k == 2 ? o.c11 : o.c21 * s + o.c11;
    o.c10 = k < 1 ? o.c10 : k == 1 ? o.c00 : o.c10 * s + o.c00;
    o.c11 = k < 1 ? o.c11 : k == 1 ? o.c01 : o.c11 * s + o.c01;
    o.c12 = k < 1 ? o.c12 : k == 1 ? o.c02 : o.c12 * s + o.c02;
    o.c00 = k < 1 ? r0 : o.c00 * s + r0;
    o.c01 = k < 1 ? r1 : o.c01 * s + r1;
    o.c02 = k < 1 ? r2 : o.c02 * s + r2;
    o.c03 = k < 1 ? r3 : o.c03 * s + r3;
  }
  return o;
}

GENU_INLINE void divide(Taylor<V>& f, const Taylor<V>& w) {  // quotient rule on A / w (Piegl & Tiller eq. 4.20)
  const V per = 1 / w.c00;
  f.c00 = f.c00 * per;
  f.c10 = (f.c10 - w.c10 * f.c00) * per;
  f.c01 = (f.c01 - w.c01 * f.c00) * per;
  f.c20 = (f.c20 - w.c10 * f.c10 - w.c20 * f.c00) * per;
  f.c11 = (f.c11 - w.c10 * f.c01 - w.c01 * f.c10 - w.c11 * f.c00) * per;
  f.c02 = (f.c02 - w.c01 * f.c01 - w.c02 * f.c00) * per;
  f.c30 = (f.c30 - w.c10 * f.c20 - w.c20 * f.c10 - w.c30 * f.c00) * per;
  f.c21 = (f.c21 - w.c10 * f.c11 - w.c01 * f.c20 - w.c20 * f.c01 - w.c11 * f.c10 - w.c21 * f.c00) * per;
  f.c12 = (f.c12 - w.c10 * f.c02 - w.c01 * f.c11 - w.c11 * f.c01 - w.c02 * f.c10 - w.c12 * f.c00) * per;
  f.c03 = (f.c03 - w.c01 * f.c02 - w.c02 * f.c01 - w.c03 * f.c00) * per;
}

/** Second derivatives by the query point of a quantity that depends on the foot's parameters q: with first derivatives D_i by them and
 second ones C_ij, they are  c_ij q_i (x) q_j + sum_j (e_j (x) q_j + q_j (x) e_j),  q_i here the gradients. */
struct SecondForm {
  V c00, c01, c11;
  V3 e0, e1;
};

/** The foot's equation (S - Q).S_i = 0, differentiated twice: M_ij = S_i.S_j + r.S_ij, r = S - Q;
 M_ij q_j,ab = S_ij,a q_j,b + S_ij,b q_j,a - G_ijk q_j,a q_k,b,  G_ijk = S_ik.S_j + S_jk.S_i + S_ij.S_k + r.S_ijk. */
struct FootEquation {
  V M00, M01, M11, perDet, G000, G001, G011, G111;
  V3 S00, S01, S11;
  GENU_INLINE SecondForm calcForm(V D0, V D1, V C00, V C01, V C11) const {
    const V E0 = (M11 * D0 - M01 * D1) * perDet, E1 = (M00 * D1 - M01 * D0) * perDet;
    return {C00 - E0 * G000 - E1 * G001, C01 - E0 * G001 - E1 * G011, C11 - E0 * G011 - E1 * G111, S00 * E0 + S01 * E1, S01 * E0 + S11 * E1};
  }
};

/** Rows of a 3 x 3 matrix. */
struct Rows {
  V3 x, y, z;
};
GENU_INLINE Rows operator+(const Rows& a, const Rows& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
GENU_INLINE Rows operator-(const Rows& a, const Rows& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
GENU_INLINE Rows operator*(const Rows& a, V t) { return {a.x * t, a.y * t, a.z * t}; }
GENU_INLINE Rows outer(const V3& a, const V3& b) { return {b * a.x, b * a.y, b * a.z}; }
GENU_INLINE Rows crossMatrix(const V3& a) { return {{V{}, -a.z, a.y}, {a.z, V{}, -a.x}, {-a.y, a.x, V{}}}; }
GENU_INLINE Rows transposed(const Rows& a) { return {{a.x.x, a.y.x, a.z.x}, {a.x.y, a.y.y, a.z.y}, {a.x.z, a.y.z, a.z.z}}; }
/** A x each row. */
GENU_INLINE Rows crossRows(const V3& A, const Rows& m) { return {cross(A, m.x), cross(A, m.y), cross(A, m.z)}; }
/** A x each column. */
GENU_INLINE Rows crossColumns(const V3& A, const Rows& m) {
  return {m.z * A.y - m.y * A.z, m.x * A.z - m.z * A.x, m.y * A.x - m.x * A.y};
}
/** In F, from gradients q0, q1 in F. */
GENU_INLINE Rows calcSecond(const double R[9], const SecondForm& f, const V3& q0, const V3& q1) {
  const V3 e0 = rotateLanes(R, f.e0), e1 = rotateLanes(R, f.e1);
  const Rows half = outer(q0, e0 + q0 * (0.5 * f.c00) + q1 * f.c01) + outer(q1, e1 + q1 * (0.5 * f.c11));
  return half + transposed(half);
}

/** Sums of the four blocks of a 6 x 6 matrix. */
struct Blocks {
  Rows shiftShift, shiftTurn, turnShift, turnTurn;
};

/** Second derivatives of the energy by the motion through these nodes, all with their feet in one span. Symbols: docs/theory.md, "Energy". */
template <int PU, int PV, bool kRational>
void addSecond(const EnergyGrid& e, const PatchTables& patch, int spanU, int spanV, const int (&node)[kLanes], int used, Blocks& total) {
  const CellGrid& g = e.cells;
  NodeLanes o;
  loadNodeLanes(g, node, o);
  double shares[3][kLanes];
  for (int l = 0; l < kLanes; ++l) {
    const double* from = e.gradient + static_cast<long>(kGradientStride) * node[l] + 6;
    for (int j = 0; j < 3; ++j) shares[j][l] = l < used ? from[8 * j] : 0;
  }
  const V byS = loadLanes(shares[0]), byR = loadLanes(shares[1]) * o.r, byG = loadLanes(shares[2]) * o.area;

  const double *su = patch.u.spans + 3 * spanU, *sv = patch.v.spans + 3 * spanV;
  const long stride = (patch.u.degree + 1) * (patch.v.degree + 1) * 4;
  const double* c = patch.coefficients + (static_cast<long>(spanU) * patch.v.numSpans + spanV) * stride;
  const V s = (o.parameterU - su[0]) * su[1], t = (o.parameterV - sv[0]) * sv[1];
  V3 S0, S1, S000, S001, S011, S111;
  FootEquation foot;
  Taylor<V> weight = {};
  if (kRational) weight = evaluateTaylor<PU, PV>(patch.u.degree, patch.v.degree, c + 3, s, t);
  const auto evaluate = [&](int axis, V V3::*x) __attribute__((always_inline)) {
    Taylor<V> f = evaluateTaylor<PU, PV>(patch.u.degree, patch.v.degree, c + axis, s, t);
    if (kRational) divide(f, weight);
    S0.*x = f.c10;
    S1.*x = f.c01;
    foot.S00.*x = 2 * f.c20;
    foot.S01.*x = f.c11;
    foot.S11.*x = 2 * f.c02;
    S000.*x = 6 * f.c30;
    S001.*x = 2 * f.c21;
    S011.*x = 2 * f.c12;
    S111.*x = 6 * f.c03;
  };
  evaluate(0, &V3::x);
  evaluate(1, &V3::y);
  evaluate(2, &V3::z);
  const V3 &S00 = foot.S00, &S01 = foot.S01, &S11 = foot.S11, &N = o.normal_M;
  const V3 q0 = o.ju * all(su[1]), q1 = o.jv * all(sv[1]), N0 = o.nu * all(su[2]), N1 = o.nv * all(sv[2]);

  const V3 r = N * -o.distance;
  const V g00 = dot(S0, S0), g01 = dot(S0, S1), g11 = dot(S1, S1);
  foot.M00 = g00 + dot(r, S00);
  foot.M01 = g01 + dot(r, S01);
  foot.M11 = g11 + dot(r, S11);
  const V det = foot.M00 * foot.M11 - foot.M01 * foot.M01, area2 = g00 * g11 - g01 * g01;
  // At a pole or a centre of curvature feet have no derivatives, and theirs are zero (TrackFeet.cpp).
  const Mask regular = (dot(q0, q0) + dot(q1, q1) > 0) & (det > 0) & (area2 > 0);
  foot.perDet = choose(regular, 1 / det, V{});
  foot.G000 = 3 * dot(S00, S0) + dot(r, S000);
  foot.G001 = 2 * dot(S01, S0) + dot(S00, S1) + dot(r, S001);
  foot.G011 = 2 * dot(S01, S1) + dot(S11, S0) + dot(r, S011);
  foot.G111 = 3 * dot(S11, S1) + dot(r, S111);

  // n.N, N the normal at the foot, by the parameters: n = along N + b_k S_k, and N_ij.S_k = -(N_i.S_jk + N_j.S_ik + N.S_ijk).
  const V3 n_M = rotateBack(g.R, o.n);
  const V n0 = dot(n_M, S0), n1 = dot(n_M, S1), along = dot(n_M, N), perArea = choose(regular, 1 / area2, V{});
  const V b0 = (g11 * n0 - g01 * n1) * perArea, b1 = (g00 * n1 - g01 * n0) * perArea;
  const V3 t00 = S00 * b0 + S01 * b1, t01 = S01 * b0 + S11 * b1;  // b_k S_0k, b_k S_1k
  const V C00 = -along * dot(N0, N0) - 2 * dot(N0, t00) - (b0 * dot(N, S000) + b1 * dot(N, S001));
  const V C01 = -along * dot(N0, N1) - dot(N0, t01) - dot(N1, t00) - (b0 * dot(N, S001) + b1 * dot(N, S011));
  const V C11 = -along * dot(N1, N1) - 2 * dot(N1, t01) - (b0 * dot(N, S011) + b1 * dot(N, S111));
  const SecondForm third = foot.calcForm(dot(n_M, N0), dot(n_M, N1), C00, C01, C11);

  const V3 p0 = rotateLanes(g.R, q0), p1 = rotateLanes(g.R, q1);
  const Rows T = calcSecond(g.R, third, p0, p1);  // third derivative of the distance, once along n
  const Rows W = outer(rotateLanes(g.R, N0), p0) + outer(rotateLanes(g.R, N1), p1);
  const LengthChange length = calcLengthChange(g, o, n_M);
  V3 both = length.byShift, chi = {};
  Rows byShift = T * (byR * o.perLength2) - W * byS;
  Rows extra = crossMatrix(o.u) * byS + crossMatrix(length.byShift) * byR;
  if (e.layer != nullptr) {
    V x[8];
    loadNodes(e.layer, kLayerStride, 0, node, x);
    const V3 slope = rotateLanes(g.R, {x[0], x[1], x[2]});
    const SecondForm form = foot.calcForm(x[3] * su[2], x[4] * sv[2], x[5] * (su[2] * su[2]), x[6] * (su[2] * sv[2]), x[7] * (sv[2] * sv[2]));
    const V weightOfLayer = byG - byR / o.h;
    chi = slope * (-1 / o.h);
    both = both + chi;
    byShift = byShift + calcSecond(g.R, form, p0, p1) * weightOfLayer;
    extra = extra + crossMatrix(slope) * weightOfLayer;
  }
  const V3 y = both + length.byShift * all(2);
  byShift = byShift + (outer(both, both) + outer(length.byShift, length.byShift) * all(2) + outer(chi, chi)) * byR;
  const Rows Wn = {cross(W.x, o.n), cross(W.y, o.n), cross(W.z, o.n)};  // W [n x]
  const Rows mixed = (outer(y, length.byTurn) - Wn * o.perLength2) * byR;  // transposed: turn, shift
  Rows turnTurn = (outer(length.byTurn, length.byTurn) * all(3) - outer(o.u, o.n) * o.perLength2) * byR;
  const V cosine = dot(o.n, o.u) * o.perLength2 * byR;
  turnTurn.x.x += cosine;
  turnTurn.y.y += cosine;
  turnTurn.z.z += cosine;

  // From the shift of M's point at A to (v, w): shift = v + w x A.
  const Rows moved = crossRows(o.A, byShift), shiftTurn = moved + mixed + extra;
  total.shiftShift = total.shiftShift + byShift;
  total.shiftTurn = total.shiftTurn + shiftTurn;
  total.turnShift = total.turnShift + transposed(moved + mixed);
  total.turnTurn = total.turnTurn + crossColumns(o.A, shiftTurn) + crossRows(o.A, transposed(mixed)) + turnTurn;
}

using AddSecond = void (*)(const EnergyGrid&, const PatchTables&, int, int, const int (&)[kLanes], int, Blocks&);

void sumSecond(const EnergyGrid& e, const PatchTables* patches, const int* nodes, int count, EnergySums& sums) {
  Blocks total = {};
  for (int from = 0; from < count; from += kFeetAtOnce) {
    const int inChunk = count - from < kFeetAtOnce ? count - from : kFeetAtOnce;
    int spanU[kFeetAtOnce], spanV[kFeetAtOnce], span[kFeetAtOnce];
    unsigned long pending = 0;
    for (int k = 0; k < inChunk; ++k) {
      const int node = nodes[from + k];
      const double* weights = e.gradient + static_cast<long>(kGradientStride) * node + 6;
      if (weights[0] == 0 && weights[8] == 0 && weights[16] == 0) continue;
      const TrackedFoot& foot = e.cells.feet[node];
      const PatchTables& patch = patches[foot.patch];
      spanU[k] = findSpan(patch.u, foot.u);
      spanV[k] = findSpan(patch.v, foot.v);
      span[k] = patch.firstSpan + spanU[k] * patch.v.numSpans + spanV[k];
      pending |= 1ul << k;
    }
    while (pending != 0) {
      const int first = __builtin_ctzl(pending);
      int node[kLanes];
      int used = 0;
      for (unsigned long rest = pending; rest != 0 && used < kLanes; rest &= rest - 1) {
        const int k = __builtin_ctzl(rest);
        if (span[k] != span[first]) continue;
        node[used++] = nodes[from + k];
        pending &= ~(1ul << k);
      }
      for (int l = used; l < kLanes; ++l) node[l] = node[used - 1];
      const PatchTables& patch = patches[e.cells.feet[node[0]].patch];
      const int pu = patch.u.degree, pv = patch.v.degree;
      const AddSecond add = pu == 3 && pv == 3   ? (patch.rational ? addSecond<3, 3, true> : addSecond<3, 3, false>)
                            : pu == 2 && pv == 2 ? (patch.rational ? addSecond<2, 2, true> : addSecond<2, 2, false>)
                                                 : (patch.rational ? addSecond<0, 0, true> : addSecond<0, 0, false>);
      add(e, patch, spanU[first], spanV[first], node, used, total);
    }
  }
  const auto addBlock = [&](const Rows& block, int row, int column) {
    const V3* rows[3] = {&block.x, &block.y, &block.z};
    for (int i = 0; i < 3; ++i) {
      const V* columns[3] = {&rows[i]->x, &rows[i]->y, &rows[i]->z};
      for (int j = 0; j < 3; ++j) {
        for (int l = 0; l < kLanes; ++l) sums.byMotion[8 * (row + i) + column + j] -= (*columns[j])[l];
      }
    }
  };
  addBlock(total.shiftShift, 0, 0);
  addBlock(total.shiftTurn, 0, 3);
  addBlock(total.turnShift, 3, 0);
  addBlock(total.turnTurn, 3, 3);
}

}  // namespace

}  // namespace genu::contact::detail::GENU_ISA
