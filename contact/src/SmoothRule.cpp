#include <algorithm>
#include <cmath>

#include "detail/CellRule.h"
#include "detail/ContactPairImpl.h"

namespace genu::contact {

using namespace detail;

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

/** How far apart two poses bring any point of a box: its farthest corner (the distance of an affine map is convex). */
double calcLargestMotion(const std::array<Vec3, 8>& corner_F, const Pose& a, const Pose& b) {
  const Mat3 R = a.R.transpose() - b.R.transpose();
  const Vec3 p = a.R.transpose() * a.p - b.R.transpose() * b.p;
  double largest = 0;
  for (const Vec3& corner : corner_F) largest = std::max(largest, (R * corner - p).squaredNorm());
  return std::sqrt(largest);
}

/** One evaluation of one compartment. */
class SmoothEvaluation {
 public:
  SmoothEvaluation(const PairData& impl, const Compartment& c, const Pose& X_FM, bool withEnergy, bool withStiffness,
                   CompartmentMemory& memory, unsigned stamp, NetLoad& load)
      : impl_(impl), c_(c), X_FM_(X_FM), R_MF_(X_FM.R.transpose()), offset_M_(R_MF_ * X_FM.p), withEnergy_(withEnergy),
        withStiffness_(withStiffness), memory_(memory), stamp_(stamp), load_(load) {
    if (const auto* linear = std::get_if<LinearLayer>(&impl.law)) {
      K_Pa_ = linear->K_Pa();
      isLinear_ = impl.definition.strain == StrainMeasure::small;
    }
    series_ = std::get_if<SeriesLayers>(&impl.law);
  }

  int run(Matrix6* stiffness) {
    memory_.active.clear();
    memory_.nodes.clear();
    findCells();
    // Element order makes sums independent of how contact was found; only the search finds it in another one.
    const auto inOrder = [](const Active& a, const Active& b) { return a.element < b.element; };
    if (!std::is_sorted(memory_.active.begin(), memory_.active.end(), inOrder)) {
      std::sort(memory_.active.begin(), memory_.active.end(), inOrder);
    }
    memory_.previous.clear();
    for (const Active& a : memory_.active) memory_.previous.push_back(a.element);
    integrate();
    sumNodes(stiffness);
    findPeak();
    return static_cast<int>(memory_.nodes.size());
  }

 private:
  Vec3 locate(int node) const { return R_MF_ * c_.p_FA[static_cast<size_t>(node)] - offset_M_; }
  Vec3 toF(const double v[3]) const { return X_FM_.R * Vec3(v[0], v[1], v[2]); }

  // -- distance at nodes ----------------------------------------------------------------------------------------

  void gatherNodes(int e) {
    for (const int k : c_.stencil[static_cast<size_t>(e)]) {
      if (k < 0 || memory_.nodeVisit[static_cast<size_t>(k)] == stamp_) continue;
      memory_.nodeVisit[static_cast<size_t>(k)] = stamp_;
      memory_.nodes.push_back(k);
    }
  }

  void queryNodes(size_t from) {
    const size_t count = memory_.nodes.size() - from;
    for (size_t i = 0; i < count; ++i) {
      const Vec3 p_MA = locate(memory_.nodes[from + i]);
      std::copy(p_MA.data(), p_MA.data() + 3, memory_.query.data() + 3 * i);
    }
    trackFeet(*c_.moving, memory_.query.data(), memory_.nodes.data() + from, static_cast<int>(count), memory_.feet.data());
    for (size_t i = 0; i < count; ++i) setField(memory_.nodes[from + i]);
  }

  void setField(int node) {
    const auto k = static_cast<size_t>(node);
    const TrackedFoot& foot = memory_.feet[k];
    NodeField& f = memory_.field[k];
    memory_.weight[k] = memory_.weightArea[k] = memory_.weightEnergy[k] = 0;
    const bool isElement = node < c_.elements;
    f.usable = false;
    f.s_m = -foot.distance_m;
    if (foot.status == QueryStatus::notConverged) {
      if (isElement) ++load_.notConvergedQueries;
      return;
    }
    if (foot.status == QueryStatus::onBoundary) {
      if (!(foot.distance_m > 0)) {  // behind the surface but beyond its border: there is no material
        if (isElement) ++load_.boundaryElements;
        return;
      }
      f.u_F = X_FM_.R * (Vec3(foot.p_MB[0], foot.p_MB[1], foot.p_MB[2]) - Vec3(foot.Q[0], foot.Q[1], foot.Q[2])) / foot.distance_m;
    } else {
      f.u_F = -toF(foot.normal);
    }
    double hM = 0;
    switch (impl_.movingLayer) {
      case MovingLayer::none: break;
      case MovingLayer::constant: hM = impl_.constantMoving_m; break;
      case MovingLayer::plane:
        hM = std::abs(foot.p_MB[1] - impl_.planeMovingY_m);
        clampThickness(impl_.definition.movingThickness, hM);
        break;
      case MovingLayer::map: hM = c_.map->interpolate(SurfaceParameter{foot.patch, foot.u, foot.v}); break;
    }
    if (std::isnan(hM)) {
      if (isElement && f.s_m > 0) ++load_.noThicknessElements;
      return;
    }
    f.usable = true;
    f.hM_m = hM;
    f.h_m = c_.hF_m[k] + hM;
    const Vec3 sum = c_.normal_F[k] + f.u_F;
    const double length = sum.norm(), cosTheta = c_.normal_F[k].dot(f.u_F);
    if (impl_.definition.correction == Correction::midsurface && cosTheta > 0) {
      f.length = length;
      f.m_F = sum / length;
      f.c = 2 / length;
    } else {
      f.length = 0;
      f.m_F = f.u_F;
      f.c = 1;
    }
    f.r = f.c / f.h_m;
    if (isElement && f.s_m > 0) {
      const double strain = f.s_m * f.r;
      load_.fullPenetrationElements += !(cosTheta > 0) || !(strain < 1);
      load_.extrapolatedElements += strain > kExtrapolationStrain;
    }
  }

  // -- cells ----------------------------------------------------------------------------------------------------

  int usableNeighbors(const std::array<int, 9>& stencil) const {
    int mask = 0, corners = 0;
    for (size_t k = 1; k < 9; ++k) {
      if (stencil[k] < 0 || !memory_.field[static_cast<size_t>(stencil[k])].usable) continue;
      if (k < 5) {
        mask |= 1 << (k - 1);
      } else {
        ++corners;
      }
    }
    return corners == 4 ? mask | 16 : mask;
  }

  /** Coefficients of s in an element; false where its centre cannot be used. */
  bool calcCell(int e, double S[kMonomials], int& mask) const {
    const auto& stencil = c_.stencil[static_cast<size_t>(e)];
    if (!memory_.field[static_cast<size_t>(e)].usable) return false;
    mask = usableNeighbors(stencil);
    double s[kStencil];
    for (size_t k = 0; k < kStencil; ++k) s[k] = stencil[k] >= 0 ? memory_.field[static_cast<size_t>(stencil[k])].s_m : 0;
    calcCoefficients(s, mask, S);
    return true;
  }

  /** Tests an element whose nodes are known; returns whether it may be in contact. */
  bool testCell(int e, double motion) {
    const auto i = static_cast<size_t>(e);
    double S[kMonomials];
    int mask = 0;
    memory_.threshold_m[i] = -1;  // look again next time
    if (!calcCell(e, S, mask)) return false;
    const double bound = upperBound(S);
    if (bound <= 0) {
      // No node's s changes faster than it moves, and the polynomial by at most largestGain times that. A node that the cell
      // could not use may become usable: then no promise is made.
      if (mask == staticNeighbors(e)) memory_.threshold_m[i] = -bound / largestGain(mask) - motion;
      return false;
    }
    Active a;
    a.element = e;
    memory_.active.push_back(a);
    return true;
  }

  int staticNeighbors(int e) const {
    const auto& stencil = c_.stencil[static_cast<size_t>(e)];
    int mask = 0, corners = 0;
    for (size_t k = 1; k < 9; ++k) {
      if (stencil[k] < 0) continue;
      if (k < 5) {
        mask |= 1 << (k - 1);
      } else {
        ++corners;
      }
    }
    return corners == 4 ? mask | 16 : mask;
  }

  void findCells() {
    const Tracking tracking = impl_.definition.tracking;
    const bool searches = tracking == Tracking::breadthFirst || tracking == Tracking::breadthFirstUnguarded;
    double motion = 0;
    if (!memory_.hasReference) {
      memory_.reference_FM = X_FM_;
      memory_.hasReference = true;
      std::fill(memory_.threshold_m.begin(), memory_.threshold_m.end(), -1.0);
    } else {
      motion = calcLargestMotion(c_.corner_F, X_FM_, memory_.reference_FM);
      // Far from the reference every threshold has been used up by the triangle inequality: take a new one.
      if (motion > 0.25 * c_.cellSize_m) {
        for (double& t : memory_.threshold_m) t -= motion;
        memory_.reference_FM = X_FM_;
        motion = 0;
      }
    }
    if (searches) {
      // Breadth-first from every element that was active, outward to a ring of inactive ones [BF2004 §2.2].
      for (const int start : memory_.previous) {
        if (memory_.visit[static_cast<size_t>(start)] == stamp_) continue;
        memory_.queue.clear();
        memory_.queue.push_back(start);
        memory_.visit[static_cast<size_t>(start)] = stamp_;
        for (size_t head = 0; head < memory_.queue.size(); ++head) {
          const int e = memory_.queue[head];
          const size_t from = memory_.nodes.size();
          gatherNodes(e);
          queryNodes(from);
          if (!testCell(e, motion)) continue;
          for (const int next : c_.stencil[static_cast<size_t>(e)]) {
            if (next < 0 || next >= c_.elements || memory_.visit[static_cast<size_t>(next)] == stamp_) continue;
            memory_.visit[static_cast<size_t>(next)] = stamp_;
            memory_.queue.push_back(next);
          }
        }
      }
      if (tracking == Tracking::breadthFirstUnguarded && !memory_.active.empty()) return;
    }
    const bool exact = tracking != Tracking::all && tracking != Tracking::breadthFirstUnguarded;
    memory_.candidates.clear();
    for (int e = 0; e < c_.elements; ++e) {
      if (exact && memory_.threshold_m[static_cast<size_t>(e)] > motion) continue;
      if (searches && memory_.visit[static_cast<size_t>(e)] == stamp_) continue;
      memory_.candidates.push_back(e);
    }
    const size_t from = memory_.nodes.size();
    for (const int e : memory_.candidates) gatherNodes(e);
    queryNodes(from);
    for (const int e : memory_.candidates) testCell(e, motion);
  }

  /** P, dP/dstrain and energy density of the law at one element. */
  auto response(int e) const {
    const auto i = static_cast<size_t>(e);
    const double share = c_.hF_m[i] / memory_.field[i].h_m;  // of the fixed layer, layers in series
    return [this, share](double strain, double& p, double& dp, double& energy) {
      if (isLinear_) {
        p = K_Pa_ * strain;
        dp = K_Pa_;
        energy = 0.5 * p * strain;
      } else if (impl_.table) {
        impl_.table->calcResponse<true>(strain, p, dp, energy);
      } else {
        LayerResponse r;
        if (series_) {
          r = series_->calcResponse(strain, share, 1 - share);
        } else {
          r = std::visit([&](const auto& law) { return callLaw(law, strain); }, impl_.law);
        }
        p = r.p_Pa;
        dp = r.dpdd_PaPerM;
        energy = r.energy_JPerM2;
      }
    };
  }
  template <class Law>
  static LayerResponse callLaw(const Law& law, double strain) {
    if constexpr (std::is_same_v<Law, SeriesLayers>) {
      return law.calcResponse(strain, 0.5, 0.5);  // not reached: series have their own branch
    } else {
      return law.template calcResponse<true>(strain, 1.0);
    }
  }

  void integrate() {
    if (withStiffness_) {
      for (const int k : memory_.nodes) {
        memory_.adjointS[static_cast<size_t>(k)].fill(0);
        memory_.adjointR[static_cast<size_t>(k)].fill(0);
      }
    }
    size_t kept = 0;
    for (size_t i = 0; i < memory_.active.size(); ++i) {
      Active& a = memory_.active[i];
      if (integrateCell(a)) memory_.active[kept++] = a;
    }
    memory_.active.resize(kept);
  }

  bool integrateCell(Active& a) {
    const int e = a.element;
    const auto center = static_cast<size_t>(e);
    const auto& stencil = c_.stencil[center];
    double S[kMonomials];
    int mask = 0;
    calcCell(e, S, mask);
    const StencilWeights& T = stencilWeights(mask);
    CellMoments m;
    const bool full = lowerBound(S) >= 0;
    if (full) {
      std::copy(std::begin(kFullArea), std::end(kFullArea), m.area);
    } else {
      calcRimArea(S, m.area);
      if (!(m.area[0] > 0)) return false;
    }
    const NodeField& f = memory_.field[center];
    double R[kSmooth] = {};
    if (!isLinear_ || withEnergy_) {
      for (int k = 0; k < kSmooth; ++k) {
        for (size_t n = 0; n < 5; ++n) {
          if (T.T[k][n] != 0) R[k] += T.T[k][n] * memory_.field[static_cast<size_t>(stencil[n])].r;
        }
      }
    }
    if (isLinear_) {
      calcLinearMoments(S, m.area, m.pressure);
      if (withEnergy_) {
        CellMoments points;
        calcLawMoments<true, false>(S, R, full, false, response(e), points);
        std::copy(std::begin(points.energy), std::end(points.energy), m.energy);
      }
    } else {
      // The law bends on the scale of the strain itself: cells near the rim need more points.
      const double range = (0.5 * (std::abs(S[1]) + std::abs(S[2]))) * f.r;
      const bool curved = range > 0.1 * std::max(S[0] * f.r, 0.0);
      const auto law = response(e);
      if (withStiffness_) {
        withEnergy_ ? calcLawMoments<true, true>(S, R, full, curved, law, m) : calcLawMoments<false, true>(S, R, full, curved, law, m);
      } else {
        withEnergy_ ? calcLawMoments<true, false>(S, R, full, curved, law, m) : calcLawMoments<false, false>(S, R, full, curved, law, m);
      }
    }

    // Scatter to nodes: int p g = sum_k weight_k g_k.
    double share = 0, force = 0;
    for (size_t n = 0; n < 5; ++n) {
      double w = 0, wArea = 0, wEnergy = 0;
      for (int k = 0; k < kSmooth; ++k) {
        const double t = T.T[k][n];
        if (t == 0) continue;
        w += t * m.pressure[k];
        wArea += t * m.area[momentIndex(kPowers[k][0], kPowers[k][1])];
        if (withEnergy_) wEnergy += t * m.energy[k];
      }
      if (stencil[n] < 0) continue;
      const auto node = static_cast<size_t>(stencil[n]);
      memory_.weight[node] += w;
      memory_.weightArea[node] += wArea;
      if (withEnergy_) memory_.weightEnergy[node] += wEnergy;
      share += wArea * c_.area_m2[node];
      force += w * c_.area_m2[node] * (isLinear_ ? K_Pa_ * memory_.field[node].r : 1);
    }
    a.share = share / c_.area_m2[center];
    a.force_N = force;
    a.h_m = f.h_m;
    a.hM_m = f.hM_m;
    a.direction_F = f.m_F;
    a.d_m = std::max(0.0, f.s_m * f.c);
    if (f.s_m > 0) {
      double p = 0, dp = 0, energy = 0;
      response(e)(f.s_m * f.r, p, dp, energy);
      a.p_Pa = p;
    }
    if (withStiffness_) addAdjoints(T, stencil, m);
    return true;
  }

  /** d(load)/d(s at a node) and d(load)/d(r at a node), as wrenches. */
  void addAdjoints(const StencilWeights& T, const std::array<int, 9>& stencil, const CellMoments& m) {
    Eigen::Matrix<double, 6, kSmooth> G = Eigen::Matrix<double, 6, kSmooth>::Zero();
    for (size_t n = 0; n < 5; ++n) {
      if (stencil[n] < 0) continue;
      const auto node = static_cast<size_t>(stencil[n]);
      const NodeField& f = memory_.field[node];
      if (!f.usable) continue;
      const Vector6 g = wrench(f.m_F * (c_.area_m2[node] * (isLinear_ ? K_Pa_ * f.r : 1)), c_.p_FA[node]);
      for (int k = 0; k < kSmooth; ++k) {
        if (T.T[k][n] != 0) G.col(k) += T.T[k][n] * g;
      }
    }
    const double* slopeR = isLinear_ ? m.area : m.slopeR;
    const auto contract = [&](const double* moments, int monomial) {
      Vector6 sum = Vector6::Zero();
      for (int k = 0; k < kSmooth; ++k) {
        sum += moments[momentIndex(kPowers[k][0] + kPowers[monomial][0], kPowers[k][1] + kPowers[monomial][1])] * G.col(k);
      }
      return sum;
    };
    for (int c = 0; c < kMonomials; ++c) {
      const Vector6 byS = contract(slopeR, c);
      for (size_t n = 0; n < kStencil; ++n) {
        if (T.T[c][n] == 0) continue;
        Eigen::Map<Vector6>(memory_.adjointS[static_cast<size_t>(stencil[n])].data()) += T.T[c][n] * byS;
      }
    }
    if (isLinear_) return;
    for (int k = 0; k < kSmooth; ++k) {
      const Vector6 byR = contract(m.slopeS, k);
      for (size_t n = 0; n < 5; ++n) {
        if (T.T[k][n] == 0) continue;
        Eigen::Map<Vector6>(memory_.adjointR[static_cast<size_t>(stencil[n])].data()) += T.T[k][n] * byR;
      }
    }
  }

  // -- sums -----------------------------------------------------------------------------------------------------

  void sumNodes(Matrix6* stiffness) {
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero(), weighted = Vec3::Zero();
    double scalar = 0, area = 0, energy = 0;
    // Ascending node order, whatever the order of queries was.
    for (size_t k = 0; k < c_.numNodes(); ++k) {
      if (memory_.nodeVisit[k] != stamp_) continue;
      const double wArea = memory_.weightArea[k], w = memory_.weight[k];
      if (w == 0 && wArea == 0) continue;
      const NodeField& f = memory_.field[k];
      const double a = c_.area_m2[k];
      const double p = w * a * (isLinear_ ? K_Pa_ * f.r : 1);
      const Vec3 fVector = p * f.m_F;
      force += fVector;
      moment += c_.p_FA[k].cross(fVector);
      weighted += p * c_.p_FA[k];
      scalar += p;
      area += wArea * a;
      if (withEnergy_) energy += memory_.weightEnergy[k] * a * f.h_m;
    }
    load_.forceOnM_F = force;
    load_.momentOnM_Fo_F = moment;
    load_.scalarForce_N = scalar;
    load_.area_m2 = area;
    load_.energy_J = energy;
    load_.activeElements = static_cast<int>(memory_.active.size());
    load_.meanPressure_Pa = area > 0 ? scalar / area : 0;
    load_.centerOfPressure_F = scalar > 0 ? Vec3(weighted / scalar) : Vec3(Vec3::Zero());
    if (withStiffness_) addStiffness(*stiffness);
  }

  /** Derivatives with respect to a small motion (v, w) of M at Fo: point A moves by -(v + w x A) in M. */
  void addStiffness(Matrix6& stiffness) const {
    for (size_t k = 0; k < c_.numNodes(); ++k) {
      if (memory_.nodeVisit[k] != stamp_) continue;
      const double weight = memory_.weight[k];
      const auto& byS = memory_.adjointS[k];
      const bool touched = weight != 0 || std::any_of(byS.begin(), byS.end(), [](double x) { return x != 0; });
      if (!touched) continue;
      const NodeField& f = memory_.field[k];
      const TrackedFoot& foot = memory_.feet[k];
      const Vec3& A = c_.p_FA[k];
      const Vector6 ds = -wrench(f.u_F, A);
      stiffness.noalias() += Eigen::Map<const Vector6>(byS.data()) * ds.transpose();

      Mat3 W = Mat3::Zero();  // Hessian of the signed distance, in F
      if (foot.status == QueryStatus::converged) {
        const Vec3 nu(foot.nu[0], foot.nu[1], foot.nu[2]), nv(foot.nv[0], foot.nv[1], foot.nv[2]);
        const Vec3 ju(foot.duvdQ[0], foot.duvdQ[1], foot.duvdQ[2]), jv(foot.duvdQ[3], foot.duvdQ[4], foot.duvdQ[5]);
        W.noalias() = (X_FM_.R * nu) * (X_FM_.R * ju).transpose() + (X_FM_.R * nv) * (X_FM_.R * jv).transpose();
      }
      const Mat3 Ax = crossMatrix(A);
      Matrix36 du;
      du.leftCols<3>() = W;
      du.rightCols<3>() = -crossMatrix(f.u_F) - W * Ax;
      Matrix36 dm = du;
      Eigen::Matrix<double, 1, 6> dr = Eigen::Matrix<double, 1, 6>::Zero();
      if (f.length > 0) {
        const Eigen::Matrix<double, 1, 6> along = f.m_F.transpose() * du;
        dm = (du - f.m_F * along) / f.length;
        dr = along * (-2 / (f.length * f.length) / f.h_m);
      }
      Vec3 slopeH = Vec3::Zero();  // of the moving layer with respect to the query point, in F
      if (impl_.movingLayer == MovingLayer::map) {
        double dhdu = 0, dhdv = 0;
        c_.map->interpolate(foot.patch, foot.u, foot.v, dhdu, dhdv);
        slopeH = X_FM_.R * Vec3(dhdu * foot.duvdQ[0] + dhdv * foot.duvdQ[3], dhdu * foot.duvdQ[1] + dhdv * foot.duvdQ[4],
                                dhdu * foot.duvdQ[2] + dhdv * foot.duvdQ[5]);
      } else if (impl_.movingLayer == MovingLayer::plane) {
        double clamped = std::abs(foot.p_MB[1] - impl_.planeMovingY_m);
        if (!clampThickness(impl_.definition.movingThickness, clamped)) {
          // B = Q - phi n, so dB_y/dQ = e_y - n_y n - phi W e_y.
          const Vec3 y_F = X_FM_.R.col(1), n_F = -f.u_F;
          slopeH = (y_F - foot.normal[1] * n_F - foot.distance_m * (W * y_F)) * (foot.p_MB[1] > impl_.planeMovingY_m ? 1.0 : -1.0);
        }
      }
      if (!slopeH.isZero(0)) dr += wrench(slopeH, A).transpose() * (f.r / f.h_m);

      const double scale = weight * c_.area_m2[k];
      Matrix36 df;
      if (isLinear_) {
        df = (scale * K_Pa_) * (f.r * dm + f.m_F * dr);
      } else {
        df = scale * dm;
        stiffness.noalias() += Eigen::Map<const Vector6>(memory_.adjointR[k].data()) * dr;
      }
      stiffness.topRows<3>() += df;
      stiffness.bottomRows<3>().noalias() += Ax * df;
    }
  }

  /** Largest point value of the strain field; the pressure grows with it. */
  void findPeak() {
    double best = 0;
    for (const Active& a : memory_.active) {
      const NodeField& f = memory_.field[static_cast<size_t>(a.element)];
      best = std::max(best, f.s_m * f.r);
    }
    for (const Active& a : memory_.active) {
      const auto i = static_cast<size_t>(a.element);
      const auto& stencil = c_.stencil[i];
      double strain[kStencil], E[kMonomials];
      for (size_t n = 0; n < kStencil; ++n) {
        const bool known = stencil[n] >= 0 && memory_.field[static_cast<size_t>(stencil[n])].usable;
        strain[n] = known ? memory_.field[static_cast<size_t>(stencil[n])].s_m * memory_.field[static_cast<size_t>(stencil[n])].r : 0;
      }
      const int mask = usableNeighbors(stencil);
      calcCoefficients(strain, mask, E);
      if (!(upperBound(E) > best) && !(E[0] >= best)) continue;
      double xi = 0, eta = 0;
      const double peak = findMaximum(E, xi, eta);
      if (!(peak > 0) || (peak < best && load_.peakPressure_Pa > 0)) continue;
      best = std::max(best, peak);
      double p = 0, dp = 0, energy = 0;
      response(a.element)(peak, p, dp, energy);
      if (p < load_.peakPressure_Pa) continue;
      load_.peakPressure_Pa = p;
      load_.maxStrain = peak;
      const StencilWeights& T = stencilWeights(mask);
      const double monomial[kMonomials] = {1, xi, eta, xi * xi, eta * eta, xi * eta};
      load_.peakPoint_F.setZero();
      for (size_t n = 0; n < kStencil; ++n) {
        double w = 0;
        for (int c = 0; c < kMonomials; ++c) w += T.T[c][n] * monomial[c];
        if (w != 0) load_.peakPoint_F += w * c_.p_FA[static_cast<size_t>(stencil[n])];
      }
    }
  }

  const PairData& impl_;
  const Compartment& c_;
  const Pose& X_FM_;
  const Mat3 R_MF_;
  const Vec3 offset_M_;
  const bool withEnergy_, withStiffness_;
  CompartmentMemory& memory_;
  const unsigned stamp_;
  NetLoad& load_;
  double K_Pa_ = 0;
  bool isLinear_ = false;
  const SeriesLayers* series_ = nullptr;
};

}  // namespace

void ContactPair::Impl::evaluateSmooth(const Compartment& c, const Pose& X_FM, bool withEnergy, CompartmentMemory& memory, unsigned stamp,
                                       NetLoad& load, int& queries, Matrix6* stiffness) const {
  SmoothEvaluation evaluation(*this, c, X_FM, withEnergy, stiffness != nullptr, memory, stamp, load);
  queries += evaluation.run(stiffness);
}

}  // namespace genu::contact
