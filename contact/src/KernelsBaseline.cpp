#define GENU_ISA baseline
#include "detail/CellKernel.inl"
#include "detail/FootKernel.inl"
#include "detail/RayKernel.inl"
