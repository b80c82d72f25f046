// Compiled for AVX2 and FMA, called only where the processor has them.
#define GENU_ISA avx2
#include "detail/CellKernel.inl"
#include "detail/FootKernel.inl"
#include "detail/RayKernel.inl"
