#define GENU_ISA baseline
#include "detail/Kernels.inl"
