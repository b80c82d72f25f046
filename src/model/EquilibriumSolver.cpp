#include "genu/model/EquilibriumSolver.h"

#include <map>

namespace genu::model {

namespace {

std::map<std::string, EquilibriumSolver>& solvers() {
  static std::map<std::string, EquilibriumSolver> all;
  return all;
}

}  // namespace

void registerEquilibriumSolver(const std::string& name, EquilibriumSolver solver) { solvers()[name] = std::move(solver); }

const EquilibriumSolver* findEquilibriumSolver(const std::string& name) {
  const auto found = solvers().find(name);
  return found == solvers().end() ? nullptr : &found->second;
}

}  // namespace genu::model
