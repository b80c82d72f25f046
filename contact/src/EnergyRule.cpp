#include "detail/EnergyRule.h"

#include <algorithm>
#include <cmath>

#include "detail/CellRule.h"
#include "detail/Kernels.h"

namespace genu::contact::detail {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix36 = Eigen::Matrix<double, 3, 6>;

Mat3 crossMatrix(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

Vector6 wrench(const Vec3& f, const Vec3& at) {
  Vector6 w;
  w << f, at.cross(f);
  return w;
}

Vec3 vec(const double* a) { return Vec3(a[0], a[1], a[2]); }

/** Hessian of the signed distance at a foot, in M. */
Mat3 calcHessian(const TrackedFoot& foot) {
  if (foot.status != QueryStatus::converged) return Mat3::Zero();
  return vec(foot.nu) * vec(foot.duvdQ).transpose() + vec(foot.nv) * vec(foot.duvdQ + 3).transpose();
}

/** Gradient of the moving layer's thickness with respect to the query point, in M. */
Vec3 calcThicknessGradient(const PairData& impl, const Compartment& c, const TrackedFoot& foot) {
  double slope[3];
  return calcThicknessSlopeInM(impl, c, foot, slope) ? vec(slope) : Vec3(Vec3::Zero());
}

/** One node: first derivatives by the motion, and what the second ones need. */
struct Node {
  Node(const PairData& impl, const Compartment& c, const CellGrid& grid, const Pose& X_FM, int k)
      : A(c.p_FA[static_cast<size_t>(k)]), n(c.normal_F[static_cast<size_t>(k)]), foot(grid.feet[k]), f(grid.field[k]), u(vec(f.u)),
        m(vec(f.m)), r(grid.r[k]), area(c.area_m2[static_cast<size_t>(k)]) {
    W.noalias() = X_FM.R * calcHessian(foot) * X_FM.R.transpose();
    du.leftCols<3>() = W;
    du.rightCols<3>() = -crossMatrix(u) - W * crossMatrix(A);
    ds = -wrench(u, A);
    if (f.length > 0) lambda = (m.transpose() * du).transpose() / f.length;
    if (impl.movingLayer == MovingLayer::map || impl.movingLayer == MovingLayer::plane) {
      slope_F = X_FM.R * calcThicknessGradient(impl, c, foot);
      chi = -wrench(slope_F, A) / f.h_m;
    }
  }
  /** D_j(ds_i) and so on: rows i, columns j. `third` is T(n, ., .) in F, T the third derivative of the distance; `hessianH` that of the
   thickness, in F. */
  void calcSecond(const Mat3& third, const Mat3& hessianH, Matrix6& d2s, Matrix6& d2r, Matrix6& d2G) const {
    const Mat3 Ax = crossMatrix(A);
    d2s.topRows<3>() = -du;
    d2s.bottomRows<3>() = -Ax * du;
    Matrix36 delta;  // v + w x A
    delta << Mat3::Identity(), -Ax;
    Matrix36 w;
    w << Mat3::Zero(), Mat3::Identity();
    Matrix6 change = Matrix6::Zero();  // of (d length)/length + dh/h
    if (f.length > 0) {
      // m.D_j(du_i), du_i = w_i x u + W delta_i; the motion carries W along and moves the query point by -delta_j.
      Matrix6 bend = w.transpose() * (-crossMatrix(m) * du);           // m.(w_i x du_j) = w_i.(du_j x m)
      const Matrix36 Wdelta = W * delta;
      bend += Wdelta.transpose() * crossMatrix(m) * w;                 // m.(w_j x W delta_i) = W delta_i.(m x w_j)
      const Vec3 Wm = W * m;
      for (int j = 3; j < 6; ++j) {                                    // -m.W(w_j x delta_i)
        const Vec3 wj = w.col(j);
        bend.col(j) -= (delta.transpose() * crossMatrix(wj).transpose()) * Wm;
      }
      bend -= delta.transpose() * ((third + W * W) / f.length) * delta;  // T(m, ., .), T(u, a, b) = a.W W b
      const Matrix6 d2length = (du.transpose() * du) / f.length - f.length * lambda * lambda.transpose() + bend;
      change += d2length / f.length - lambda * lambda.transpose();
    }
    d2G.setZero();
    if (!slope_F.isZero(0) || !hessianH.isZero(0)) {
      Matrix6 d2h = delta.transpose() * hessianH * delta;
      for (int j = 3; j < 6; ++j) d2h.col(j) -= delta.transpose() * Vec3(w.col(j)).cross(slope_F);
      change += d2h / f.h_m - chi * chi.transpose();
      d2G = area * d2h;
    }
    const Vector6 both = lambda + chi;
    d2r = r * (both * both.transpose()) - r * change;
  }

  const Vec3 A, n;
  const TrackedFoot& foot;
  const NodeField& f;
  const Vec3 u, m;
  const double r, area;
  Mat3 W;
  Matrix36 du;
  Vector6 ds, lambda = Vector6::Zero(), chi = Vector6::Zero();  // d(length)/length, dh/h
  Vec3 slope_F = Vec3::Zero();
};

/** First derivatives of a node's s, r and area times thickness by the motion. */
void calcFirst(const PairData& impl, const Compartment& c, const CellGrid& grid, const Pose& X_FM, int k, double* ds, double* dr, double* dG) {
  using Map6 = Eigen::Map<Vector6>;
  const TrackedFoot& foot = grid.feet[k];
  const NodeField& f = grid.field[k];
  const Vec3 &A = c.p_FA[static_cast<size_t>(k)], u = vec(f.u), m = vec(f.m);
  Map6{ds} = -wrench(u, A);
  Vector6 change = Vector6::Zero();  // of length and thickness
  if (f.length > 0) {
    Vec3 Wm = Vec3::Zero();  // Hessian of the distance times m
    if (foot.status == QueryStatus::converged) {
      const Vec3 m_M = X_FM.R.transpose() * m;
      Wm = X_FM.R * (vec(foot.nu) * vec(foot.duvdQ).dot(m_M) + vec(foot.nv) * vec(foot.duvdQ + 3).dot(m_M));
    }
    change << Wm, -m.cross(u) - Wm.cross(A);
    change /= f.length;
  }
  if (impl.movingLayer == MovingLayer::map || impl.movingLayer == MovingLayer::plane) {
    const Vector6 chi = -wrench(X_FM.R * calcThicknessGradient(impl, c, foot), A) / f.h_m;
    change += chi;
    Map6{dG} = c.area_m2[static_cast<size_t>(k)] * f.h_m * chi;
  } else {
    Map6{dG}.setZero();
  }
  Map6{dr} = -grid.r[k] * change;
}

/** Differences of the distance's Hessian and of the thickness's gradient over a small step. */
void calcThird(const PairData& impl, const Compartment& c, const Node& node, const Pose& X_FM, Mat3& third, Mat3& hessianH) {
  third.setZero();
  hessianH.setZero();
  if (node.foot.status != QueryStatus::converged) return;
  const Mat3& R = X_FM.R;
  const Vec3 Q = vec(node.foot.Q), n_M = R.transpose() * node.n;
  // The Hessian varies on the scale of the radii of curvature: the error of a central difference is the square of the ratio, 1e-9,
  // that of rounding 1e-13/1e-4.
  const double step = 1e-4 * std::min({c.moving->safeDistanceInside_m(), c.moving->safeDistanceOutside_m(), 1.0});
  const bool varies = impl.movingLayer == MovingLayer::map || impl.movingLayer == MovingLayer::plane;
  const int directions = varies ? 3 : 1;
  const int first = 0;
  for (int d = 0; d < directions; ++d) {
    const Vec3 e = varies ? Vec3(Vec3::Unit(d)) : n_M;
    Mat3 H[2];
    Vec3 g[2];
    for (int side = 0; side < 2; ++side) {
      TrackedFoot foot = node.foot;
      const Vec3 at = Q + (side == 0 ? step : -step) * e;
      trackFeet(*c.moving, at.data(), &first, 1, &foot);
      H[side] = calcHessian(foot);
      if (varies) g[side] = calcThicknessGradient(impl, c, foot);
    }
    third += (varies ? n_M[d] : 1.0) * (H[0] - H[1]) / (2 * step);
    if (varies) hessianH.col(d) = (g[0] - g[1]) / (2 * step);
  }
  third = (R * third * R.transpose()).eval();
  hessianH = (R * (0.5 * (hessianH + hessianH.transpose())) * R.transpose()).eval();
}

}  // namespace

void calcEnergyGradient(const PairData& impl, const Compartment& c, CompartmentMemory& memory, const CellGrid& grid, const LawView& law,
                        const Pose& X_FM, bool withStiffness, EnergyGradient& out) {
  out = EnergyGradient{};
  // `touched` marks the nodes of crosses; here the corners of stencils count too.
  std::vector<unsigned long>& touched = memory.touched;
  const auto isActive = [&](size_t i) { return memory.cells[i * static_cast<size_t>(memory.cellStride) + 3] > 0; };
  for (size_t i = 0; i < memory.tasks.size(); ++i) {
    if (!isActive(i)) continue;
    for (const int k : c.stencil[static_cast<size_t>(memory.tasks[i].element)]) {
      if (k >= 0 && grid.usable[k]) touched[static_cast<size_t>(k) / 64] |= 1ul << (k % 64);
    }
  }
  const auto forEachNode = [&](const auto& visit) {
    for (size_t word = 0; word < touched.size(); ++word) {
      for (unsigned long bits = touched[word]; bits != 0; bits &= bits - 1) {
        const int k = static_cast<int>(64 * word) + __builtin_ctzl(bits);
        if (grid.usable[k]) visit(k, memory.gradient.data() + static_cast<size_t>(kGradientStride) * static_cast<size_t>(k));
      }
    }
  };
  using Map6 = Eigen::Map<Vector6>;
  forEachNode([&](int k, double* g) {
    calcFirst(impl, c, grid, X_FM, k, g, g + 6, g + 12);
    g[18] = g[19] = g[20] = 0;
  });
  const CellKernels& kernels = activeKernels().cells;
  LawPoints points;
  LawReading reading;
  const bool layerVaries = impl.movingLayer == MovingLayer::map || impl.movingLayer == MovingLayer::plane;
  for (size_t i = 0; i < memory.tasks.size(); ++i) {
    if (!isActive(i)) continue;
    const CellTask& task = memory.tasks[i];
    const auto& stencil = c.stencil[static_cast<size_t>(task.element)];
    double R[kSmooth], G[kSmooth], share[kSmooth];
    gatherSmooth([&](int k) { return grid.r[k]; }, stencil.data(), task.mask, R);
    gatherSmooth([&](int k) { return c.area_m2[static_cast<size_t>(k)] * grid.field[k].h_m; }, stencil.data(), task.mask, G);
    if (grid.share != nullptr) gatherSmooth([&](int k) { return grid.share[k]; }, stencil.data(), task.mask, share);
    Eigen::Matrix<double, 6, kMonomials> dS;
    Eigen::Matrix<double, 6, kSmooth> dR, dG;
    if (withStiffness) {
      dS.setZero();
      dR.setZero();
      dG.setZero();
      const StencilWeights& T = stencilWeights(task.mask);
      for (size_t n = 0; n < kStencil; ++n) {
        const int k = stencil[n];
        if (k < 0 || !grid.usable[k]) continue;
        const double* g = memory.gradient.data() + static_cast<size_t>(kGradientStride) * static_cast<size_t>(k);
        for (int m = 0; m < kMonomials; ++m) {
          const double t = T.T[m][n];
          if (t == 0) continue;
          dS.col(m) += t * Eigen::Map<const Vector6>(g);
          if (m >= kSmooth) continue;
          dR.col(m) += t * Eigen::Map<const Vector6>(g + 6);
          if (layerVaries) dG.col(m) += t * Eigen::Map<const Vector6>(g + 12);
        }
      }
    }
    double byS[8], byR[8], byG[8];
    kernels.listLawPoints(task.S, R, lowerBound(task.S) >= 0, law.shape, points);
    kernels.readLaw(task.S, R, grid.share != nullptr ? share : nullptr, law, points, reading);
    kernels.calcEnergyMoments(G, points, reading, byS, byR, byG);
    for (int at = 0; withStiffness && at < points.count; ++at) {
      const double w = points.w[at], xi = points.xi[at], eta = points.eta[at];
      if (w == 0) continue;
      const double s = reading.s[at], r = reading.r[at], p = reading.p[at], area = evaluateSmoothAt(G, xi, eta);
      const double monomial[kMonomials] = {1, xi, eta, xi * xi, eta * eta, xi * eta};
      const Eigen::Map<const Vector6> x(monomial);
      const Vector6 ds = dS * x, dr = dR * x.head<kSmooth>(), de = r * ds + s * dr;
      out.byMotion.noalias() -= (w * area * reading.dp[at]) * de * de.transpose();
      out.byMotion.noalias() -= (w * area * p) * (dr * ds.transpose() + ds * dr.transpose());
      if (layerVaries) {
        const Vector6 dArea = dG * x.head<kSmooth>();
        out.byMotion.noalias() -= (w * p) * (dArea * de.transpose() + de * dArea.transpose());
      }
    }
    double weight[kStencil][3] = {};  // of each node's s, r and area times thickness
    spreadSmooth<3>(byS, task.mask, weight[0]);
    spreadSmooth<3>(byR, task.mask, weight[0] + 1);
    spreadSmooth<3>(byG, task.mask, weight[0] + 2);
    if ((task.mask & 16) != 0) {
      weight[5][0] = weight[8][0] = 0.25 * byS[5];
      weight[6][0] = weight[7][0] = -0.25 * byS[5];
    }
    for (size_t n = 0; n < kStencil; ++n) {
      const int k = stencil[n];
      if (k < 0 || !grid.usable[k]) continue;
      double* g = memory.gradient.data() + static_cast<size_t>(kGradientStride) * static_cast<size_t>(k);
      for (int j = 0; j < 3; ++j) g[18 + j] += weight[n][j];
    }
  }
  forEachNode([&](int k, double* g) {
    out.load -= g[18] * Map6(g) + g[19] * Map6(g + 6) + g[20] * Map6(g + 12);
    if (!withStiffness || (g[18] == 0 && g[19] == 0 && g[20] == 0)) return;
    const Node node(impl, c, grid, X_FM, k);
    Mat3 third, hessianH;
    calcThird(impl, c, node, X_FM, third, hessianH);
    Matrix6 d2s, d2r, d2G;
    node.calcSecond(third, hessianH, d2s, d2r, d2G);
    out.byMotion -= g[18] * d2s + g[19] * d2r + g[20] * d2G;
  });
}

}  // namespace genu::contact::detail
