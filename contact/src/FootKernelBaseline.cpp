#define GENU_ISA baseline
#include "detail/FootKernel.inl"
