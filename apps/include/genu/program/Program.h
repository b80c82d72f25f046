#pragma once

namespace genu::app {

/** The program `genu`, docs/program.md: commands, options, messages and exit codes. An executable that calls it understands the force
 elements that its own sources register (model::registerForceElement, docs/extending.md) besides those of Genu:

   int main(int argc, char** argv) { return genu::app::runProgram(argc, argv); }

 Once per process: it sets up the log and the handling of SIGINT and SIGTERM. Throws nothing; errors go to stderr. Returns the exit code. */
int runProgram(int argc, char** argv);

}  // namespace genu::app
