// Compiled for AVX-512 with 256-bit vectors (32 registers in place of 16), called only where the processor has them.
#define GENU_ISA avx512
#include "detail/CellKernel.inl"
#include "detail/FootKernel.inl"
#include "detail/RayKernel.inl"
