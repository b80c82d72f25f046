#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "detail/CellRule.h"
#include "detail/ContactPairImpl.h"
#include "detail/EnergyRule.h"
#include "detail/Kernels.h"

namespace genu::contact {

using namespace detail;

namespace {

StencilWeights makeStencilWeights(int mask) {
  StencilWeights w{};
  w.T[0][0] = 1;
  for (int axis = 0; axis < 2; ++axis) {
    const int plus = 1 + 2 * axis, minus = 2 + 2 * axis;
    const bool hasPlus = (mask >> (2 * axis)) & 1, hasMinus = (mask >> (2 * axis + 1)) & 1;
    double* first = w.T[1 + axis];
    double* second = w.T[3 + axis];
    if (hasPlus && hasMinus) {
      first[plus] = 0.5;
      first[minus] = -0.5;
      second[plus] = second[minus] = 0.5;
      second[0] = -1;
    } else if (hasPlus || hasMinus) {
      const double sign = hasPlus ? 1 : -1;
      first[hasPlus ? plus : minus] = sign;
      first[0] = -sign;
    }
  }
  if (mask & 16) {
    w.T[5][5] = w.T[5][8] = 0.25;
    w.T[5][6] = w.T[5][7] = -0.25;
  }
  return w;
}

}  // namespace

const StencilWeights& detail::stencilWeights(int mask) {
  static const std::array<StencilWeights, 32> table = [] {
    std::array<StencilWeights, 32> t{};
    for (int m = 0; m < 32; ++m) t[static_cast<size_t>(m)] = makeStencilWeights(m);
    return t;
  }();
  return table[static_cast<size_t>(mask)];
}

const GradedRule* detail::gradedRules() {
  static const std::array<GradedRule, GradedRule::kLevels> table = [] {
    std::array<GradedRule, GradedRule::kLevels> rules{};
    for (size_t level = 0; level < rules.size(); ++level) {
      GradedRule& rule = rules[level];
      const double t = 0.5 * static_cast<double>(level + 1);
      rule.largestRatio = std::sinh(t);
      std::fill(std::begin(rule.x), std::end(rule.x), 0.5);
      for (int k = 0; k < GradedRule::kPoints; ++k) {
        const double at = Gauss<GradedRule::kPoints>::x[k] + 0.5;
        rule.x[k] = std::sinh(t * at) / std::sinh(t);
        rule.w[k] = Gauss<GradedRule::kPoints>::w[k] * t * std::cosh(t * at) / std::sinh(t);
      }
    }
    return rules;
  }();
  return table.data();
}

bool detail::calcThicknessSlopeInM(const PairData& impl, const Compartment& c, const TrackedFoot& foot, double out[3]) {
  const auto row = [](const double* a) { return Vec3(a[0], a[1], a[2]); };
  Vec3 slope;
  if (impl.movingLayer == MovingLayer::map) {
    double dhdu = 0, dhdv = 0;
    c.map->interpolate(foot.patch, foot.u, foot.v, dhdu, dhdv);
    slope = dhdu * row(foot.duvdQ) + dhdv * row(foot.duvdQ + 3);
  } else {
    double clamped = std::abs(foot.calcFoot_m(1) - impl.planeMovingY_m);
    if (clampThickness(impl.definition.movingThickness, clamped)) return false;
    // B = Q - phi n, so dB_y/dQ = e_y - n_y n - phi H e_y, H = nu (x) ju + nv (x) jv.
    slope = Vec3::UnitY() - foot.normal[1] * row(foot.normal);
    if (foot.status == QueryStatus::converged) {
      slope -= foot.distance_m * (row(foot.nu) * foot.duvdQ[1] + row(foot.nv) * foot.duvdQ[4]);
    }
    if (!(foot.calcFoot_m(1) > impl.planeMovingY_m)) slope = -slope;
  }
  std::copy(slope.data(), slope.data() + 3, out);
  return true;
}

namespace {

/** The same where a ray along n hits: with respect to the place of the ray, seen at the hit C. */
bool calcThicknessSlopeOfRay(const PairData& impl, const Compartment& c, const TrackedHit& hit, const Vec3& n_M, double out[3]) {
  const auto row = [](const double* a) { return Vec3(a[0], a[1], a[2]); };
  Vec3 slope;
  if (impl.movingLayer == MovingLayer::map) {
    double dhdu = 0, dhdv = 0;
    c.map->interpolate(hit.patch, hit.u, hit.v, dhdu, dhdv);
    slope = dhdu * row(hit.duvdA) + dhdv * row(hit.duvdA + 3);
  } else {
    double clamped = std::abs(hit.p_MC[1] - impl.planeMovingY_m);
    if (clampThickness(impl.definition.movingThickness, clamped)) return false;
    // C = A + t n, dt = -N.dC0/(N.n) where dC0 is the shift of the ray at C.
    slope = Vec3::UnitY() + n_M.y() * row(hit.normal) / hit.cosTheta;
    if (!(hit.p_MC[1] > impl.planeMovingY_m)) slope = -slope;
  }
  std::copy(slope.data(), slope.data() + 3, out);
  return true;
}

/** Nodes and cells of a block: blocks never depend on the number of threads, so neither do results. */
constexpr int kNodesPerBlock = 64, kCellsPerBlock = 32;
constexpr double kAlways = 1e300;  // a way that is never gone

/** How far the polynomial through vectors at an element's nodes goes from the one at its centre, within the cell. */
template <class At>
double calcReach(const std::array<int, 9>& stencil, int mask, const At& at) {
  double values[3][kStencil] = {}, coefficients[3][kMonomials];
  for (size_t k = 0; k < kStencil; ++k) {
    if (stencil[k] < 0) continue;
    const double* vector = at(static_cast<size_t>(stencil[k]));
    for (int axis = 0; axis < 3; ++axis) values[axis][k] = vector[axis];
  }
  for (int axis = 0; axis < 3; ++axis) calcCoefficients(values[axis], mask, coefficients[axis]);
  double reach = 0;
  for (int m = 1; m < kMonomials; ++m) {
    const double x = coefficients[0][m], y = coefficients[1][m], z = coefficients[2][m];
    reach += (m < 3 ? 0.5 : 0.25) * std::sqrt(x * x + y * y + z * z);
  }
  return reach;
}

/** How far apart two poses bring any point of a box: its farthest corner (the distance of an affine map is convex). */
double calcLargestMotion(const std::array<Vec3, 8>& corner_F, const Pose& a, const Pose& b) {
  const Mat3 R = a.R.transpose() - b.R.transpose();
  const Vec3 p = a.R.transpose() * a.p - b.R.transpose() * b.p;
  double largest = 0;
  for (const Vec3& corner : corner_F) largest = std::max(largest, (R * corner - p).squaredNorm());
  return std::sqrt(largest);
}

/** The pressure law as the kernels see it. */
class CellLaw {
 public:
  explicit CellLaw(const PairData& impl) : impl_(impl) {
    view_.shape = impl_.shape;
    view_.respond = respond;
    view_.self = this;
    const auto* linear = std::get_if<LinearLayer>(&impl_.law);
    if (linear != nullptr && impl_.definition.strain == StrainMeasure::small) {
      view_.kind = LawView::linear;
      view_.K_Pa = linear->K_Pa();
    } else if (impl_.table) {
      view_.kind = LawView::table;
      view_.pieces = impl_.table->view();
    } else {
      view_.kind = LawView::other;
    }
  }
  CellLaw(const CellLaw&) = delete;  // the view points to it
  CellLaw& operator=(const CellLaw&) = delete;

  const LawView& view() const { return view_; }
  double calcPressure(double strain, double share) const {
    if (view_.kind == LawView::linear) return view_.K_Pa * strain;
    double p[4];
    respond(this, strain, share, p);
    return p[0];
  }

 private:
  static void respond(const void* self, double strain, double share, double answer[4]) {
    const auto& law = static_cast<const CellLaw*>(self)->impl_.law;
    LayerResponse r;
    answer[3] = 0;
    if (const auto* series = std::get_if<SeriesLayers>(&law)) {
      const SeriesResponse both = series->calcResponse<true>(strain, share, 1 - share);
      answer[3] = both.dpdhF_PaPerM - both.dpdhM_PaPerM;
      r = both;
    } else if (const auto* linear = std::get_if<LinearLayer>(&law)) {
      r = linear->calcResponse<true>(strain, 1.0);
    } else {
      r = std::get<PowerLawLayer>(law).calcResponse<true>(strain, 1.0);
    }
    answer[0] = r.p_Pa;
    answer[1] = r.dpdd_PaPerM;
    answer[2] = r.energy_JPerM2;
  }

  const PairData& impl_;
  LawView view_{};
};

/** One evaluation of one compartment, in phases; those that take blocks may run on several threads. */
class SmoothEvaluation {
 public:
  SmoothEvaluation(const PairData& impl, const Compartment& c, const EvaluationTask& task, CompartmentMemory& memory, NetLoad& load)
      : impl_(impl), c_(c), task_(task), kernels_(activeKernels().cells), R_MF_(task.X_FM.R.transpose()),
        offset_M_(R_MF_ * task.X_FM.p), memory_(memory), stamp_(task.stamp), load_(load), law_(impl), byRay_(impl.definition.distance == DistanceMethod::ray) {
    grid_.stencil = c.stencil.data()->data();
    grid_.place = c.place.data();
    grid_.feet = memory.feet.data();
    grid_.hits = byRay_ ? memory.hits.data() : nullptr;
    grid_.field = memory.field.data();
    grid_.usable = memory.usable.data();
    grid_.s = memory.s.data();
    grid_.r = memory.r.data();
    grid_.load = memory.load.data();
    grid_.share = memory.share.empty() ? nullptr : memory.share.data();
    grid_.byShare = memory.share.empty() ? nullptr : memory.byShare.data();
    grid_.weight = memory.weight.data();
    grid_.adjoint = memory.adjoint.data();
    grid_.touched = memory.touched.data();
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(grid_.R) = task.X_FM.R;
    grid_.corrected = impl.definition.correction != Correction::none;
    grid_.linear = law_.view().kind == LawView::linear;
    grid_.K_Pa = law_.view().K_Pa;
    grid_.damping_sPerM = impl.definition.damping_sPerM;
    Eigen::Map<Vec3>(grid_.v) = task.v_F;
    Eigen::Map<Vec3>(grid_.w) = task.w_F;
  }
  /** Finds the elements to look at and the nodes they need. Search modes query and test as they go. */
  void findCandidates() {
    memory_.tasks.clear();
    memory_.numNodes = 0;
    memory_.candidates.clear();
    moveMarks();
    if (isSearch()) {
      search();
      if (impl_.definition.tracking == Tracking::breadthFirstUnguarded && !memory_.tasks.empty()) return;
    }
    firstNode_ = memory_.numNodes;
    const Tracking tracking = impl_.definition.tracking;
    const bool exact = tracking != Tracking::all && tracking != Tracking::breadthFirstUnguarded;
    const double* mark_m = memory_.mark_m.data();
    const int numDue = kernels_.listDue(mark_m, c_.elements, exact ? memory_.way_m : std::numeric_limits<double>::infinity(), memory_.due.data());
    for (int i = 0; i < numDue; ++i) {
      const int e = memory_.due[static_cast<size_t>(i)];
      if (isSearch() && memory_.visit[static_cast<size_t>(e)] == stamp_) continue;
      if (exact && !byRay_ && -mark_m[e] <= memory_.way_m && isClear(e)) continue;
      gatherNodes(e, memory_.candidates.empty() ? -2 : memory_.candidates.back());
      memory_.candidates.push_back(e);
    }
  }

  int numNodeBlocks() const { return (numNewNodes() + kNodesPerBlock - 1) / kNodesPerBlock; }
  void queryBlock(int block) {
    const size_t from = firstNode_ + static_cast<size_t>(block) * kNodesPerBlock;
    query(from, std::min(from + kNodesPerBlock, memory_.numNodes));
  }

  /** Which candidates may be in contact. */
  void testCandidates() {
    const size_t searched = memory_.tasks.size();
    test(memory_.candidates.data(), static_cast<int>(memory_.candidates.size()));
    // Element order makes sums independent of how contact was found; only the search finds it in another one.
    if (searched > 0) {
      std::sort(memory_.tasks.begin(), memory_.tasks.end(), [](const CellTask& a, const CellTask& b) { return a.element < b.element; });
    }
    memory_.cellStride = integratesStiffness() ? kCellStride : kCellWeights;
    if (memory_.cells.size() < memory_.tasks.size() * static_cast<size_t>(memory_.cellStride)) {
      // Grows with the largest contact seen.
      memory_.cells.resize(2 * memory_.tasks.size() * static_cast<size_t>(memory_.cellStride));
    }
  }

  int numCellBlocks() const { return (static_cast<int>(memory_.tasks.size()) + kCellsPerBlock - 1) / kCellsPerBlock; }
  void integrateBlock(int block) {
    const int from = block * kCellsPerBlock, to = std::min(from + kCellsPerBlock, static_cast<int>(memory_.tasks.size()));
    kernels_.integrate(grid_, law_.view(), memory_.tasks.data() + from, to - from, task_.withEnergy, integratesStiffness(),
                       memory_.cells.data() + static_cast<size_t>(from) * static_cast<size_t>(memory_.cellStride));
  }

  void sum() {
    std::fill(memory_.touched.begin(), memory_.touched.end(), 0ul);
    const int count = static_cast<int>(memory_.tasks.size()), words = static_cast<int>(memory_.touched.size());
    kernels_.scatter(grid_, memory_.tasks.data(), count, integratesStiffness(), memory_.cells.data());
    NetSums total{};
    kernels_.sum(grid_, words, task_.withEnergy, total);
    load_.forceOnM_F = Vec3(total.force[0], total.force[1], total.force[2]);
    load_.momentOnM_Fo_F = Vec3(total.moment[0], total.moment[1], total.moment[2]);
    load_.scalarForce_N = total.scalar;
    load_.area_m2 = total.area;
    load_.energy_J = total.energy;
    load_.meanPressure_Pa = total.area > 0 ? total.scalar / total.area : 0;
    if (total.scalar > 0) {
      load_.centerOfPressure_F = Vec3(total.weighted[0], total.weighted[1], total.weighted[2]) / total.scalar;
    }
    memory_.previous.clear();
    for (int i = 0; i < count; ++i) {
      if (!(memory_.cells[static_cast<size_t>(i) * static_cast<size_t>(memory_.cellStride) + 3] > 0)) continue;
      ++load_.activeElements;
      memory_.previous.push_back(memory_.tasks[static_cast<size_t>(i)].element);
    }
    if (isGradient()) {
      calcEnergyGradient(impl_, c_, memory_, grid_, law_.view(), task_.withStiffness, gradient_);
      load_.forceOnM_F = gradient_.load.head<3>();
      load_.momentOnM_Fo_F = gradient_.load.tail<3>();
    } else if (task_.withStiffness) {
      const bool varies = impl_.movingLayer == MovingLayer::map || impl_.movingLayer == MovingLayer::plane;
      kernels_.sumStiffness(grid_, words, varies ? calcThicknessSlope : nullptr, this, stiffness_);
    }
    countNodes();
    const double largest_Pa = findPeak();
    // Polynomials through points on both sides of a wall overshoot, at worst below zero. What rounding leaves of a faint touch is none.
    const double rounding_N = 1e-9 * largest_Pa * std::abs(load_.area_m2), cell_m = c_.cellSize_m;
    const bool negative = load_.scalarForce_N < -rounding_N || load_.area_m2 < -1e-9 * cell_m * cell_m || load_.energy_J < -rounding_N * cell_m;
    load_.unresolvedCompartments = negative ? 1 : 0;
  }

  /** What the pressure rises from the peak to the top of the polynomial through nine places a quarter of a cell apart around it. */
  double calcPeakRise(const NetLoad& load) const {
    constexpr double kStep = 0.25;  // of a cell
    static constexpr double kTo[kStencil][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};
    const PeakPlace& peak = memory_.peak;
    if (peak.cell < 0) return 0;
    // Beyond the rectangle nothing counts: there the places end.
    const GridCell& cell = c_.cell[static_cast<size_t>(peak.cell)];
    const auto place = [](double at, int index, int count, bool wraps) {
      if (wraps) return at;
      const double low = index == 0 ? kStep - 0.5 : at, high = index == count - 1 ? 0.5 - kStep : at;
      return std::min(std::max(at, low), high);
    };
    PeakPlace middle = peak;
    middle.xi = place(peak.xi, cell.ix, c_.nx << cell.level, c_.wraps);
    middle.eta = place(peak.eta, cell.iz, c_.nz << cell.level, false);
    double strain[kStencil] = {}, share = 0;
    int mask = 0, corners = 0;
    for (int n = 0; n < kStencil; ++n) {
      PeakPlace at = middle;
      at.xi += kStep * kTo[n][0];
      at.eta += kStep * kTo[n][1];
      Probe probed;
      if (!probe(at, probed)) {
        if (n == 0) return 0;
        continue;
      }
      strain[n] = probed.s * probed.r;
      if (n == 0) share = probed.share;
      if (n > 0) n < 5 ? mask |= 1 << (n - 1) : ++corners;
    }
    double E[kMonomials], xi = 0, eta = 0;
    calcCoefficients(strain, corners == 4 ? mask | 16 : mask, E);
    const double here = evaluateAt(E, (peak.xi - middle.xi) / kStep, (peak.eta - middle.eta) / kStep);
    for (int m = 1; m < kMonomials; ++m) E[m] *= m < 3 ? 2 : 4;  // findMaximum looks half a unit far
    const double top = findMaximum(E, xi, eta);
    if (!(here > 0) || !(top > here)) return 0;
    return load.peakPressure_Pa * (law_.calcPressure(top, share) / law_.calcPressure(here, share) - 1);
  }

  int numNewNodes() const { return static_cast<int>(memory_.numNodes - firstNode_); }
  /** Grid points and, where it was sought between them, the place of the peak. */
  int numQueries() const { return static_cast<int>(memory_.numNodes) + numProbes_; }
  void addStiffness(Matrix6& byMotion, Matrix6& byRate) const {
    using Rows = Eigen::Matrix<double, 6, 8, Eigen::RowMajor>;
    if (isGradient()) {
      byMotion += gradient_.byMotion;
    } else {
      byMotion += Eigen::Map<const Rows>(stiffness_.byMotion).leftCols<6>();
      byRate += Eigen::Map<const Rows>(stiffness_.byRate).leftCols<6>();
    }
  }

 private:
  Vec3 locate(int node) const { return R_MF_ * Eigen::Map<const Vec3>(grid_.place + kPlaceStride * node) - offset_M_; }
  static void prefetch(const void* from, size_t bytes) {
    for (size_t i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<const char*>(from) + i);
  }
  bool isGradient() const { return impl_.definition.correction == Correction::energy; }
  bool integratesStiffness() const { return task_.withStiffness && !isGradient(); }
  bool isSearch() const {
    const Tracking tracking = impl_.definition.tracking;
    return tracking == Tracking::breadthFirst || tracking == Tracking::breadthFirstUnguarded;
  }

  // -- distance at nodes ----------------------------------------------------------------------------------------

  /** Nodes of an element that are not known yet; those of element `before` are. */
  void gatherNodes(int e, int before) {
    const auto& stencil = c_.stencil[static_cast<size_t>(e)];
    unsigned fresh = before == e - 1 ? c_.freshNodes[static_cast<size_t>(e)] : 511;
    size_t count = memory_.numNodes;
    for (; fresh != 0; fresh &= fresh - 1) {
      const int k = stencil[static_cast<size_t>(__builtin_ctz(fresh))];
      if (k < 0) continue;
      // Whether a node is new can not be foretold: no branch.
      memory_.nodes[count] = k;
      count += memory_.nodeVisit[static_cast<size_t>(k)] != stamp_;
      memory_.nodeVisit[static_cast<size_t>(k)] = stamp_;
    }
    memory_.numNodes = count;
  }

  /** Feet and fields of memory_.nodes[from .. to). */
  void query(size_t from, size_t to) {
    const int* nodes = memory_.nodes.data() + from;
    double* Q = memory_.query.data() + 3 * from;
    const int count = static_cast<int>(to - from);
    for (int i = 0; i < count; ++i) {  // what the phases below read
      const auto k = static_cast<size_t>(nodes[i]);
      prefetch(&memory_.feet[k], sizeof(TrackedFoot));
      prefetch(grid_.place + kPlaceStride * k, sizeof(double) * kPlaceStride);
    }
    for (int i = 0; i < count; ++i) {
      const Vec3 p_MA = locate(nodes[i]);
      std::copy(p_MA.data(), p_MA.data() + 3, Q + 3 * i);
    }
    trackFeet(*c_.moving, Q, nodes, count, memory_.feet.data(),
              task_.withStiffness || isGradient() ? FootDerivatives::second : FootDerivatives::first);
    if (byRay_) fireRays(nodes, count, Q);
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<size_t>(nodes[i]);
      if (byRay_) {
        const TrackedHit& hit = memory_.hits[k];
        const bool isHit = hit.status == HitStatus::hit;
        const double hM = isHit ? calcMovingThickness(hit.p_MC[1], {hit.patch, hit.u, hit.v}) : 0;
        memory_.field[k].hM_m = hM;
        memory_.usable[k] = isHit && !std::isnan(hM);
        continue;
      }
      const TrackedFoot& foot = memory_.feet[k];
      const double hM = calcMovingThickness(foot.calcFoot_m(1), {foot.patch, foot.u, foot.v});
      memory_.field[k].hM_m = hM;
      // Beyond the border there is no material: the gap is not known there.
      memory_.usable[k] = foot.status == QueryStatus::converged && !std::isnan(hM);
    }
    kernels_.setNodes(grid_, nodes, count);
  }

  void fireRays(const int* nodes, int count, const double* Q) {
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<size_t>(nodes[i]);
      const Vec3 n_M = R_MF_ * c_.normal_F[k];
      TrackedHit& hit = memory_.hits[k];
      if (hit.patch < 0 && memory_.feet[k].patch >= 0) {  // no hit to start from: start from the foot
        hit = TrackedHit{};
        hit.patch = memory_.feet[k].patch;
        hit.u = memory_.feet[k].u;
        hit.v = memory_.feet[k].v;
      }
      trackHits(*c_.moving, Q + 3 * i, n_M.data(), nodes + i, 1, memory_.hits.data());
    }
  }

  double calcMovingThickness(double y_m, const SurfaceParameter& at) const {
    switch (impl_.movingLayer) {
      case MovingLayer::none: break;
      case MovingLayer::constant: return impl_.constantMoving_m;
      case MovingLayer::plane: {
        double h = std::abs(y_m - impl_.planeMovingY_m);
        clampThickness(impl_.definition.movingThickness, h);
        return h;
      }
      case MovingLayer::map: return c_.map->interpolate(at);
    }
    return 0;
  }

  /** One of two layers of different material beyond the range of its law, while their sum is not. */
  bool isLayerUsedUp(size_t node) const {
    const auto* series = std::get_if<SeriesLayers>(&impl_.law);
    if (series == nullptr) return false;
    const NodeField& f = memory_.field[node];
    const double d_m = memory_.s[node] * f.c, hF_m = c_.hF_m[node];
    // A layer is never pressed by more than both together are.
    if (d_m <= kExtrapolationStrain * std::min(hF_m, f.hM_m)) return false;
    return series->calcResponse<false>(d_m, hF_m, f.hM_m).extrapolated;
  }

  /** What the queried elements' own nodes tell, for the status. */
  void countNodes() {
    for (size_t i = 0; i < memory_.numNodes; ++i) {
      const int node = memory_.nodes[i];
      if (node >= c_.elements) continue;
      const auto k = static_cast<size_t>(node);
      const TrackedFoot& foot = memory_.feet[k];
      const bool failed = foot.status == QueryStatus::notConverged || (byRay_ && memory_.hits[k].status == HitStatus::notConverged);
      const bool leaves = byRay_ ? memory_.hits[k].status == HitStatus::missed : foot.status == QueryStatus::onBoundary;
      if (failed) {
        ++load_.notConvergedQueries;
      } else if (!(foot.distance_m > 0)) {
        if (leaves) {
          ++load_.boundaryElements;
        } else if (!memory_.usable[k]) {
          ++load_.noThicknessElements;
        } else if (memory_.s[k] > 0) {
          const NodeField& f = memory_.field[k];
          const double strain = memory_.s[k] * memory_.r[k];
          load_.fullPenetrationElements += !(f.cosTheta > 0) || !(strain < 1);
          load_.extrapolatedElements += strain > kExtrapolationStrain || isLayerUsedUp(k);
        }
      }
    }
  }

  // -- which cells ----------------------------------------------------------------------------------------------

  void moveMarks() {
    if (!memory_.hasLast) {
      memory_.way_m = memory_.turn = 0;
      std::fill(memory_.mark_m.begin(), memory_.mark_m.end(), -kAlways);
    } else {
      memory_.way_m += calcLargestMotion(c_.corner_F, task_.X_FM, memory_.last_FM);
      memory_.turn += (task_.X_FM.R - memory_.last_FM.R).norm();  // no less than the angle's chord
    }
    memory_.last_FM = task_.X_FM;
    memory_.hasLast = true;
  }

  /** 1 / largestGain, a hair less. */
  static double perGain(int mask) { return mask == kAllNeighbors ? (1 - 1e-9) / kFullGain : (1 - 1e-9) / kEdgeGain; }
  /** No node's s changes faster than it moves, and the polynomial by at most largestGain times that. Positive marks: no contact
   before this way; negative ones: contact at least until then, as far as its bound can tell. */
  void setMark(size_t element, double bound, int mask) {
    const double way_m = std::abs(bound) * perGain(mask) + memory_.way_m;
    memory_.mark_m[element] = bound <= 0 ? way_m : -way_m;
  }

  /** True when an element's last test tells that it cannot be in contact.
   Since then its node k has moved by t + D (A_k - A), t the way of its centre A and D = R_MF - (R_MF then). To first order its s
   changes by -n_k.t - n_k.D (A_k - A). The polynomial through the n_k stays within `spread` of n in the cell, the one through the
   A_k - A within `cellReach`: its change is at most -n.t + spread |t| + |D^T n| cellReach. What the first order leaves out, with the
   largest curvature K around, is at most K/2 |way|^2 and, of n_k - n in the last term, K |D| stencilReach^2 at every node. */
  bool isClear(int e) {
    const auto i = static_cast<size_t>(e);
    const ElementLook& look = memory_.look[i];
    const Vec3 shift = locate(e) - Eigen::Map<const Vec3>(look.p_MA);
    const double shift_m = shift.norm(), turn = memory_.turn - look.turn, way_m = shift_m + turn * c_.stencilReach_m;
    if (!(way_m < look.reach_m)) return false;
    const Eigen::Map<const Vec3> n_M(look.normal_M);
    const double tilt = (task_.X_FM.R * n_M - Eigen::Map<const Vec3>(look.normal_F)).norm();
    // The Hessian of the distance, at a distance d from a surface of radius R, is at most 1/(R - d).
    const double rest_m = (0.5 * way_m * way_m + turn * c_.stencilReach_m * c_.stencilReach_m) / (look.radius_m - c_.stencilReach_m - way_m);
    const int mask = c_.neighbors[i];
    const double bound = look.bound_m - shift.dot(n_M) + look.spread * shift_m + tilt * c_.cellReach_m[i] + largestGain(mask) * rest_m;
    if (!(bound < 0)) return false;
    setMark(i, bound, mask);
    return true;
  }

  /** Tests elements whose nodes are known; returns how many may be in contact. */
  int test(const int* elements, int count) {
    const size_t before = memory_.tasks.size();
    memory_.tasks.resize(before + static_cast<size_t>(count) + 1);  // the kernel may write one past the last
    const int found = kernels_.testCells(grid_, elements, count, memory_.candidateBound.data(), memory_.candidateMask.data(),
                                         memory_.tasks.data() + before);
    memory_.tasks.resize(before + static_cast<size_t>(found));
    // Where a node is missing, or along rays, the polynomial is not held by the distances of its nodes. What the rule looks at is
    // then bounded by the distances themselves: cells with no node within half a cell's size of the moving surface carry nothing.
    const double reach_m = 0.5 * c_.cellSize_m;
    const double shallow_m = 0.05 * c_.cellSize_m;
    size_t kept = before, next = before;
    for (int i = 0; i < count; ++i) {
      const auto e = static_cast<size_t>(elements[i]);
      const int mask = memory_.candidateMask[static_cast<size_t>(i)];
      const double bound = memory_.candidateBound[static_cast<size_t>(i)];
      const bool isTask = mask >= 0 && bound > 0;
      const size_t task = next;
      next += isTask;
      if (mask == c_.neighbors[e] && !byRay_) {
        setMark(e, bound, mask);
        setLook(e, bound < shallow_m, bound);  // a deep one will not be clear soon
      } else {
        const double nearest_m = findNearest(e);
        if (nearest_m > reach_m) {
          memory_.mark_m[e] = memory_.way_m + (1 - 1e-9) * (nearest_m - reach_m);
          continue;
        }
        memory_.mark_m[e] = -kAlways;
      }
      if (isTask) memory_.tasks[kept++] = memory_.tasks[task];
    }
    memory_.tasks.resize(kept);
    return static_cast<int>(kept - before);
  }

  void setLook(size_t element, bool canTell, double bound_m) {
    ElementLook& look = memory_.look[element];
    look.reach_m = 0;
    if (!canTell) return;
    const TrackedFoot& foot = memory_.feet[element];
    look.bound_m = bound_m;
    std::copy(foot.Q, foot.Q + 3, look.p_MA);
    std::copy(foot.normal, foot.normal + 3, look.normal_M);
    Eigen::Map<Vec3>(look.normal_F) = task_.X_FM.R * Eigen::Map<const Vec3>(foot.normal);
    look.turn = memory_.turn;
    look.spread = calcReach(c_.stencil[element], c_.neighbors[element], [&](size_t k) { return memory_.feet[k].normal; });
    double margin_m = c_.predictor->calcBorderMargin_m(foot) - c_.stencilReach_m;
    if (margin_m < c_.stencilReach_m) {  // near a border: from each node
      margin_m = kAlways;
      for (const int k : c_.stencil[element]) {
        if (k >= 0) margin_m = std::min(margin_m, c_.predictor->calcBorderMargin_m(memory_.feet[static_cast<size_t>(k)]));
      }
    }
    const double distance_m = std::abs(foot.distance_m);
    look.reach_m = std::min(margin_m, c_.predictor->safe_m() - distance_m - c_.stencilReach_m);
    look.radius_m = c_.predictor->leastRadius_m() - distance_m;
  }

  /** Least signed distance of an element's nodes; -infinity where one is not known. */
  double findNearest(size_t element) const {
    double nearest_m = kAlways;
    for (const int k : c_.stencil[element]) {
      if (k < 0) continue;
      const TrackedFoot& foot = memory_.feet[static_cast<size_t>(k)];
      nearest_m = std::min(nearest_m, foot.status == QueryStatus::notConverged ? -kAlways : foot.distance_m);
    }
    return nearest_m;
  }

  /** Breadth-first from every element that was active, outward to a ring of inactive ones [BF2004 §2.2]. */
  void search() {
    for (const int start : memory_.previous) {
      if (memory_.visit[static_cast<size_t>(start)] == stamp_) continue;
      memory_.queue.clear();
      memory_.queue.push_back(start);
      memory_.visit[static_cast<size_t>(start)] = stamp_;
      for (size_t head = 0; head < memory_.queue.size(); ++head) {
        const int e = memory_.queue[head];
        const size_t from = memory_.numNodes;
        gatherNodes(e, -2);
        query(from, memory_.numNodes);
        if (test(&e, 1) == 0) continue;
        for (const int next : c_.stencil[static_cast<size_t>(e)]) {
          if (next < 0 || next >= c_.elements || memory_.visit[static_cast<size_t>(next)] == stamp_) continue;
          memory_.visit[static_cast<size_t>(next)] = stamp_;
          memory_.queue.push_back(next);
        }
      }
    }
  }

  // -- sums -----------------------------------------------------------------------------------------------------

  static bool calcThicknessSlope(const void* self, int node, double out[3]) {
    const auto& me = *static_cast<const SmoothEvaluation*>(self);
    double slope[3];
    const auto k = static_cast<size_t>(node);
    if (me.byRay_) {
      const Vec3 n_M = me.R_MF_ * me.c_.normal_F[k];
      if (!calcThicknessSlopeOfRay(me.impl_, me.c_, me.memory_.hits[k], n_M, slope)) return false;
    } else if (!calcThicknessSlopeInM(me.impl_, me.c_, me.memory_.feet[k], slope)) {
      return false;
    }
    Eigen::Map<Vec3>{out} = me.task_.X_FM.R * Eigen::Map<const Vec3>(slope);
    return true;
  }

  /** A place on the fixed surface between the nodes, looked at as a node is. */
  struct Probe {
    double place[kPlaceStride];
    TrackedFoot base;  // of the place on the fixed surface
    TrackedFoot foot;
    TrackedHit hit;
    NodeField field;
    char usable = 0;
    double s = 0, r = 0, share = 0;
    alignas(64) double load[kLoadStride];
  };

  /** False where there is no contact to be known of. */
  bool probe(const PeakPlace& at, Probe& out) const {
    const auto& stencil = c_.stencil[static_cast<size_t>(at.cell)];
    const StencilWeights& T = stencilWeights(at.mask);
    const double monomial[kMonomials] = {1, at.xi, at.eta, at.xi * at.xi, at.eta * at.eta, at.xi * at.eta};
    Vec3 A = Vec3::Zero();
    double h_m = 0, least_m = kAlways, most_m = 0;
    for (size_t n = 0; n < kStencil; ++n) {
      double w = 0;
      for (int c = 0; c < kMonomials; ++c) w += T.T[c][n] * monomial[c];
      if (w == 0) continue;
      const auto k = static_cast<size_t>(stencil[n]);
      A += w * c_.p_FA[k];
      h_m += w * c_.hF_m[k];
      least_m = std::min(least_m, c_.hF_m[k]);
      most_m = std::max(most_m, c_.hF_m[k]);
    }
    // From the polynomial onto the surface.
    const int first = 0;
    out.base = memory_.peakFoot;
    trackFeet(*c_.fixed, A.data(), &first, 1, &out.base, FootDerivatives::first);
    if (out.base.status == QueryStatus::notConverged) return false;
    A = c_.fixed->patch(out.base.patch).calcPoint(out.base.u, out.base.v);
    const Eigen::Map<const Vec3> n_F(out.base.normal);
    if (!(n_F.dot(c_.normal_F[static_cast<size_t>(at.cell)]) > 0)) return false;
    const Thickness& layer = impl_.definition.fixedThickness;
    if (!std::holds_alternative<BackSurface>(layer.source)) {  // which would take a search
      std::vector<LineHit> none;
      h_m = measureThickness(layer, A, n_F, none);
      clampThickness(layer, h_m);
      if (std::isnan(h_m)) return false;
    }
    // A parabola leaves its nodes by a quarter of their range at most; a step of the thickness, or its end, must not look thin.
    const double beyond_m = std::min(0.25 * (most_m - least_m), 0.125 * least_m);
    h_m = std::min(std::max(h_m, least_m - beyond_m), most_m + beyond_m);
    std::copy(A.data(), A.data() + 3, out.place);
    out.place[3] = 0;
    std::copy(n_F.data(), n_F.data() + 3, out.place + 4);
    out.place[7] = h_m;

    const Vec3 p_MA = R_MF_ * A - offset_M_;
    out.foot = memory_.feet[static_cast<size_t>(at.cell)];
    trackFeet(*c_.moving, p_MA.data(), &first, 1, &out.foot, FootDerivatives::first);
    double hM_m = 0;
    if (byRay_) {
      const Vec3 n_M = R_MF_ * n_F;
      out.hit = memory_.hits[static_cast<size_t>(at.cell)];
      trackHits(*c_.moving, p_MA.data(), n_M.data(), &first, 1, &out.hit);
      if (out.hit.status != HitStatus::hit) return false;
      hM_m = calcMovingThickness(out.hit.p_MC[1], {out.hit.patch, out.hit.u, out.hit.v});
    } else {
      if (out.foot.status != QueryStatus::converged) return false;
      hM_m = calcMovingThickness(out.foot.calcFoot_m(1), {out.foot.patch, out.foot.u, out.foot.v});
    }
    if (std::isnan(hM_m)) return false;
    out.field.hM_m = hM_m;
    out.usable = 1;
    CellGrid one = grid_;
    one.place = out.place;
    one.feet = &out.foot;
    one.hits = byRay_ ? &out.hit : nullptr;
    one.field = &out.field;
    one.usable = &out.usable;
    one.s = &out.s;
    one.r = &out.r;
    one.share = grid_.share == nullptr ? nullptr : &out.share;
    one.load = out.load;
    kernels_.setNodes(one, &first, 1);
    return true;
  }

  int findMask(int element) const {
    const auto at = std::lower_bound(memory_.tasks.begin(), memory_.tasks.end(), element, [](const CellTask& t, int e) { return t.element < e; });
    return at->mask;
  }

  /** Largest strain that is met at a node or at the place between them that promises most; the pressure grows with it. Returns a
   pressure that no cell's polynomial goes beyond. */
  double findPeak() {
    PeakPlace& peak = memory_.peak;
    kernels_.findPeak(grid_, memory_.tasks.data(), static_cast<int>(memory_.tasks.size()), peak);
    if (peak.node < 0) return 0;
    const auto node = static_cast<size_t>(peak.node);
    const double share = grid_.share != nullptr ? grid_.share[node] : 0, factor = memory_.field[node].factor;
    Probe between;
    const bool isSought = peak.cell >= 0;
    numProbes_ += isSought;
    const bool isKnown = isSought && probe(peak, between);
    if (isSought) memory_.peakFoot = between.base;
    if (isKnown && between.s * between.r > std::max(0.0, peak.nodeStrain)) {
      load_.maxStrain = between.s * between.r;
      load_.peakPressure_Pa = law_.calcPressure(load_.maxStrain, between.share) * between.field.factor;
      load_.peakPoint_F = Eigen::Map<const Vec3>(between.place);
    } else if (peak.nodeStrain > 0) {
      load_.maxStrain = peak.nodeStrain;
      load_.peakPressure_Pa = law_.calcPressure(peak.nodeStrain, share) * factor;
      load_.peakPoint_F = c_.p_FA[node];
      peak.cell = peak.node;
      peak.mask = findMask(peak.node);
      peak.xi = peak.eta = 0;
    } else {
      peak.cell = -1;
    }
    const bool isMissed = !(load_.maxStrain > 0) && load_.scalarForce_N > 0;
    if (!isMissed && !(load_.scalarForce_N < 0) && !(load_.energy_J < 0)) return load_.peakPressure_Pa;
    const double largest_Pa = law_.calcPressure(peak.largest, share) * factor;
    // Contact of a few cells, on a grid that is too coarse or as faint as the polynomials' error, that no place looked at has met.
    if (isMissed) {
      load_.peakPressure_Pa = std::min(load_.meanPressure_Pa, largest_Pa);
      load_.peakPoint_F = load_.centerOfPressure_F;
    }
    return largest_Pa;
  }

  const PairData& impl_;
  const Compartment& c_;
  const EvaluationTask& task_;
  const CellKernels& kernels_;
  const Mat3 R_MF_;
  const Vec3 offset_M_;
  CompartmentMemory& memory_;
  const unsigned stamp_;
  NetLoad& load_;
  CellLaw law_;
  const bool byRay_;
  size_t firstNode_ = 0;
  int numProbes_ = 0;
  CellGrid grid_{};
  StiffnessSums stiffness_;  // set by sum() where they are asked for
  EnergyGradient gradient_;
};

}  // namespace

void ContactPair::Impl::packCompartment(Compartment& c) {
  c.place.resize(kPlaceStride * c.numNodes());
  for (size_t k = 0; k < c.numNodes(); ++k) {
    double* place = c.place.data() + kPlaceStride * k;
    for (int j = 0; j < 3; ++j) {
      place[j] = c.p_FA[k][j];
      place[4 + j] = c.normal_F[k][j];
    }
    place[3] = c.area_m2[k];
    place[7] = c.hF_m[k];
  }
  c.stencilReach_m = 0;
  c.neighbors.resize(c.size());
  c.freshNodes.resize(c.size());
  c.cellReach_m.resize(c.size());
  for (size_t e = 0; e < c.size(); ++e) {
    int mask = 0, corners = 0;
    for (size_t k = 1; k < 9; ++k) {
      if (c.stencil[e][k] < 0) continue;
      c.stencilReach_m = std::max(c.stencilReach_m, (c.p_FA[static_cast<size_t>(c.stencil[e][k])] - c.p_FA[e]).norm());
      k < 5 ? mask |= 1 << (k - 1) : ++corners;
    }
    c.neighbors[e] = static_cast<unsigned char>(corners == 4 ? mask | 16 : mask);
    c.cellReach_m[e] = calcReach(c.stencil[e], c.neighbors[e], [&](size_t k) { return c.p_FA[k].data(); });
    unsigned fresh = 0;
    for (size_t k = 0; k < 9; ++k) {
      const int node = c.stencil[e][k];
      const bool known = node < 0 || (e > 0 && std::find(c.stencil[e - 1].begin(), c.stencil[e - 1].end(), node) != c.stencil[e - 1].end());
      if (!known) fresh |= 1u << k;
    }
    c.freshNodes[e] = static_cast<std::uint16_t>(fresh);
  }
}

void ContactPair::Impl::sizeSmoothMemory(const Compartment& c, CompartmentMemory& m) const {
  const size_t nodes = c.numNodes(), n = c.size();
  m.feet.resize(nodes);
  if (definition.distance == DistanceMethod::ray) {
    m.hits.resize(nodes);
  }
  m.nodeVisit.resize(nodes);
  m.usable.resize(nodes);
  m.field.resize(nodes);
  m.s.resize(nodes);
  m.r.resize(nodes);
  m.load.resize(kLoadStride * nodes);
  if (std::holds_alternative<SeriesLayers>(law)) {
    m.share.resize(nodes);
    m.byShare.resize(8 * nodes);
  }
  m.weight.resize(kWeightStride * nodes);
  m.adjoint.resize(kAdjointStride * nodes);
  if (definition.correction == Correction::energy) {
    m.gradient.resize(kGradientStride * nodes);
    m.energyNodes.resize(nodes);
    if (movingLayer == MovingLayer::map || movingLayer == MovingLayer::plane) m.layer.resize(kLayerStride * nodes);
  }
  m.touched.resize((nodes + 63) / 64);
  m.nodes.resize(nodes + 1);  // one is written past the last
  m.query.resize(3 * nodes);
  m.look.resize(n);
  m.candidates.reserve(n);
  m.due.resize(n);
  m.candidateMask.resize(n);
  m.candidateBound.resize(n);
  m.tasks.reserve(n + 1);
  m.mark_m.resize(n);
}

namespace {

/** Runs phases of up to kGroup compartments: task (compartment, block) in order, or side by side. */
struct Group {
  static constexpr size_t kGroup = 8;
  std::array<std::optional<SmoothEvaluation>, kGroup> evaluations;
  size_t count = 0;
  const TaskRunner* runner = nullptr;  // nullptr: in order

  template <class CountBlocks, class RunBlock>
  void run(CountBlocks countBlocks, RunBlock runBlock) {
    std::array<int, kGroup + 1> first{};
    for (size_t k = 0; k < count; ++k) first[k + 1] = first[k] + countBlocks(*evaluations[k]);
    if (runner == nullptr) {
      for (size_t k = 0; k < count; ++k) {
        for (int i = 0; i < first[k + 1] - first[k]; ++i) runBlock(*evaluations[k], i);
      }
      return;
    }
    struct Context {
      Group& group;
      const std::array<int, kGroup + 1>& first;
      RunBlock& runBlock;
    } context{*this, first, runBlock};
    runner->run(first[count],
                [](void* pointer, int index) {
                  Context& c = *static_cast<Context*>(pointer);
                  size_t k = 0;
                  while (index >= c.first[k + 1]) ++k;
                  c.runBlock(*c.group.evaluations[k], index - c.first[k]);
                },
                &context);
  }
};

/** Queries below which threads cost more than they give: starting them takes as long as some hundred queries. */
constexpr size_t kQueriesWorthThreads = 2000;

}  // namespace

void ContactPair::Impl::evaluateSmooth(std::vector<CompartmentMemory>& memory, EvaluationTask& task) const {
  const auto one = [](const SmoothEvaluation&) { return 1; };
  for (size_t from = 0; from < compartments.size(); from += Group::kGroup) {
    Group group;
    group.count = std::min(Group::kGroup, compartments.size() - from);
    size_t lastQueries = 0;
    for (size_t k = 0; k < group.count; ++k) {
      lastQueries += memory[from + k].numNodes;
      group.evaluations[k].emplace(*this, compartments[from + k], task, memory[from + k], task.loads[from + k]);
    }
    // As much to do as last time, or everything on a first one.
    if (task.runner != nullptr && task.runner->numThreads() > 1) {
      for (size_t k = 0; k < group.count; ++k) {
        if (!memory[from + k].hasLast) lastQueries += compartments[from + k].numNodes();
      }
      if (lastQueries >= kQueriesWorthThreads) group.runner = task.runner;
    }
    group.run(one, [](SmoothEvaluation& e, int) { e.findCandidates(); });
    group.run([](const SmoothEvaluation& e) { return e.numNodeBlocks(); }, [](SmoothEvaluation& e, int i) { e.queryBlock(i); });
    group.run(one, [](SmoothEvaluation& e, int) { e.testCandidates(); });
    group.run([](const SmoothEvaluation& e) { return e.numCellBlocks(); }, [](SmoothEvaluation& e, int i) { e.integrateBlock(i); });
    group.run(one, [](SmoothEvaluation& e, int) { e.sum(); });
    for (size_t k = 0; k < group.count; ++k) {
      const SmoothEvaluation& e = *group.evaluations[k];
      *task.queries += e.numQueries();
      if (task.withStiffness) e.addStiffness(task.byMotion, task.byRate);
    }
  }
}

double ContactPair::Impl::calcPeakRise(const Compartment& c, CompartmentMemory& memory, const Pose& X_FM, const NetLoad& load) const {
  EvaluationTask task;
  task.X_FM = X_FM;
  NetLoad unused;
  return SmoothEvaluation(*this, c, task, memory, unused).calcPeakRise(load);
}

void ContactPair::Impl::markUnresolved(const Compartment& c, const CompartmentMemory& memory, const NetLoad& load,
                                       std::vector<ElementField>& fields) const {
  constexpr double kShare = 0.1;  // of the largest strain
  struct Cell {
    double E[kMonomials];  // of the strain
  };
  std::vector<Cell> cells(memory.tasks.size());
  std::vector<int> cellOf(c.size(), -1);
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto element = static_cast<size_t>(memory.tasks[i].element);
    gatherStrain(c.stencil[element].data(), memory.usable.data(), memory.s.data(), memory.r.data(), memory.tasks[i].mask, cells[i].E);
    cellOf[element] = static_cast<int>(i);
  }
  for (size_t i = 0; i < cells.size(); ++i) {
    const auto element = static_cast<size_t>(memory.tasks[i].element);
    if (!fields[element].active) continue;
    for (size_t side = 1; side < 5; ++side) {
      const int beside = c.stencil[element][side];
      if (beside < 0 || beside >= c.elements) continue;
      const Cell* other = cellOf[static_cast<size_t>(beside)] < 0 ? nullptr : &cells[static_cast<size_t>(cellOf[static_cast<size_t>(beside)])];
      const int axis = side < 3 ? 0 : 1;
      const double out = side % 2 == 1 ? 0.5 : -0.5;
      // The one that bends more over the side is the one that knows less; with no contact beside it, it stands alone.
      if (other != nullptr && std::abs(other->E[3 + axis]) > std::abs(cells[i].E[3 + axis])) continue;
      for (const double along : {-0.25, 0.25}) {
        const auto value = [&](const Cell& cell, double to) {
          return std::max(0.0, axis == 0 ? evaluateAt(cell.E, to, along) : evaluateAt(cell.E, along, to));
        };
        const double difference = value(cells[i], out) - (other == nullptr ? 0 : value(*other, -out));
        if (std::abs(difference) > kShare * load.maxStrain) fields[element].unresolved = true;
      }
    }
  }
}

void ContactPair::Impl::findActive(const Compartment& c, const CompartmentMemory& memory, std::vector<Active>& active) const {
  if (definition.rule != ContactRule::smooth) {
    active = memory.active;
    return;
  }
  active.clear();
  const CellLaw cellLaw(*this);
  for (size_t i = 0; i < memory.tasks.size(); ++i) {
    const double* cell = memory.cells.data() + i * static_cast<size_t>(memory.cellStride);
    if (!(cell[3] > 0)) continue;
    Active a;
    a.element = memory.tasks[i].element;
    const auto k = static_cast<size_t>(a.element);
    const NodeField& f = memory.field[k];
    double area = 0;
    for (size_t n = 0; n < 5; ++n) {
      const int node = c.stencil[k][n];
      if (node < 0 || (cell[4 * n] == 0 && cell[4 * n + 1] == 0)) continue;
      const double* load = memory.load.data() + kLoadStride * node;
      a.force_N += cell[4 * n] * load[6];
      area += cell[4 * n + 1] * c.area_m2[static_cast<size_t>(node)];
    }
    a.share = area / c.area_m2[k];
    a.h_m = f.h_m;
    a.hM_m = f.hM_m;
    a.direction_F = Vec3(f.m[0], f.m[1], f.m[2]);
    a.d_m = std::max(0.0, memory.s[k] * f.c);
    if (memory.s[k] > 0) a.p_Pa = cellLaw.calcPressure(memory.s[k] * memory.r[k], c.hF_m[k] / f.h_m) * f.factor;
    active.push_back(a);
  }
}

}  // namespace genu::contact
