// Compiled for AVX-512, called only where the processor has it.
#define GENU_ISA avx512
#include "detail/Kernels.inl"
