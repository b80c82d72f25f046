// Everything that is compiled once per instruction set, in namespace GENU_ISA.

#include "CellKernel.inl"
#include "EnergyKernel.inl"
#include "FootKernel.inl"
#include "FeetKernel.inl"
#include "Kernels.h"
#include "RayKernel.inl"

#define GENU_TEXT_OF(x) #x
#define GENU_TEXT(x) GENU_TEXT_OF(x)

namespace genu::contact::detail::GENU_ISA {

const Kernels kKernels = {GENU_TEXT(GENU_ISA), solveFoot, solveFeet, solveRay,
                          {listDue, setNodes, testCells, integrate, scatter, sum, sumStiffness, findPeak, calcRimArea, listLawPoints},
                          {setFirst, integrateEnergy, sumFirst, sumSecond}};

}  // namespace genu::contact::detail::GENU_ISA
