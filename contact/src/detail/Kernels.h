#pragma once

// All that is compiled once per instruction set.

#include "CellKernel.h"
#include "EnergyKernel.h"
#include "FootKernel.h"
#include "RayKernel.h"

namespace genu::contact::detail {

struct Kernels {
  const char* name;
  SolveFoot solveFoot;
  SolveFeet solveFeet;
  SolveRay solveRay;
  CellKernels cells;
  EnergyKernels energy;
};

namespace baseline {
extern const Kernels kKernels;
}
namespace avx2 {
extern const Kernels kKernels;
}
namespace avx512 {
extern const Kernels kKernels;
}

/** Those in use: the widest that the processor has, or the ones forced. */
const Kernels& activeKernels();
/** For tests: "baseline", "avx2", "avx512"; nullptr chooses again. False when the processor or the build lacks it. */
bool forceInstructionSet(const char* name);

}  // namespace genu::contact::detail
