#include "detail/EnergyRule.h"

#include <algorithm>
#include <cmath>

#include "detail/Kernels.h"
#include "detail/PatchKernel.h"
#include "detail/SurfaceSearch.h"

namespace genu::contact::detail {

namespace {

/** One line of CompartmentMemory::layer. */
void setLayer(const PairData& impl, const Compartment& c, const TrackedFoot& foot, bool withSecond, double* layer) {
  std::fill(layer, layer + kLayerStride, 0.0);
  if (!calcThicknessSlopeInM(impl, c, foot, layer) || !withSecond) return;
  double* second = layer + 3;
  if (impl.movingLayer == MovingLayer::map) {
    c.map->interpolate(foot.patch, foot.u, foot.v, second[0], second[1]);
    second[3] = c.map->calcMixedSlope(foot.patch, foot.u, foot.v);
    return;
  }
  SurfaceDerivatives d;
  evaluatePatch(c.moving->patch(foot.patch), foot.u, foot.v, d);
  const double sign = foot.calcFoot_m(1) > impl.planeMovingY_m ? 1 : -1;
  const double slopes[5] = {d.Su.y(), d.Sv.y(), d.Suu.y(), d.Suv.y(), d.Svv.y()};
  std::transform(slopes, slopes + 5, second, [&](double slope) { return sign * slope; });
}

}  // namespace

void calcEnergyGradient(const PairData& impl, const Compartment& c, CompartmentMemory& memory, const CellGrid& grid, const LawView& law,
                        bool withStiffness, EnergyGradient& out) {
  // `touched` marks the nodes of crosses; here the corners of stencils count too.
  std::vector<unsigned long>& touched = memory.touched;
  const int numTasks = static_cast<int>(memory.tasks.size());
  for (size_t i = 0; i < memory.tasks.size(); ++i) {
    if (!(memory.cells[i * static_cast<size_t>(memory.cellStride) + 3] > 0)) continue;
    for (const int k : c.stencil[static_cast<size_t>(memory.tasks[i].element)]) {
      if (k >= 0 && grid.usable[k]) touched[static_cast<size_t>(k) / 64] |= 1ul << (k % 64);
    }
  }
  int numNodes = 0;
  for (size_t word = 0; word < touched.size(); ++word) {
    for (unsigned long bits = touched[word]; bits != 0; bits &= bits - 1) {
      const int k = static_cast<int>(64 * word) + __builtin_ctzl(bits);
      if (grid.usable[k]) memory.energyNodes[static_cast<size_t>(numNodes++)] = k;
    }
  }
  const int* nodes = memory.energyNodes.data();
  EnergyGrid energy = {grid, memory.gradient.data(), nullptr};
  if (!memory.layer.empty()) {
    for (int i = 0; i < numNodes; ++i) {
      const auto k = static_cast<size_t>(nodes[i]);
      setLayer(impl, c, memory.feet[k], withStiffness, memory.layer.data() + kLayerStride * k);
    }
    energy.layer = memory.layer.data();
  }
  const EnergyKernels& kernels = activeKernels().energy;
  EnergySums sums = {};
  kernels.setFirst(energy, nodes, numNodes);
  kernels.integrate(energy, law, memory.tasks.data(), numTasks, memory.cells.data(), memory.cellStride, withStiffness, sums);
  kernels.sumFirst(energy, nodes, numNodes, sums);
  if (withStiffness) kernels.sumSecond(energy, SurfaceAccess::search(*c.moving).tables.data(), nodes, numNodes, sums);
  out.load = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(sums.load);
  out.byMotion = Eigen::Map<const Eigen::Matrix<double, 6, 8, Eigen::RowMajor>>(sums.byMotion).leftCols<6>();
}

}  // namespace genu::contact::detail
