#include "genu/program/Program.h"

int main(int argc, char** argv) { return genu::app::runProgram(argc, argv); }
