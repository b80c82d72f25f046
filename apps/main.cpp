#include "genu/program/Program.h"
#ifdef GENU_WITH_SUNDIALS
#include "genu/integrators/Sundials.h"
#endif

int main(int argc, char** argv) {
#ifdef GENU_WITH_SUNDIALS
  genu::integrators::registerSundials();
#endif
  return genu::app::runProgram(argc, argv);
}
