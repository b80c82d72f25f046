#define GENU_ISA baseline
#include "detail/RayKernel.inl"
