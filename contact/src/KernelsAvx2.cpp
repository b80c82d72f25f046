// Compiled for AVX2 and fused multiply-add, called only where the processor has them.
#define GENU_ISA avx2
#include "detail/Kernels.inl"
