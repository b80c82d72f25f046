#pragma once

#include <functional>
#include <string>

namespace genu::model {

/** Forces r(z) = 0 in free coordinates z [m] (angles times kAngleLength_m), r [N]. Nothing throws: solvers may be C code. */
class EquilibriumProblem {
 public:
  virtual ~EquilibriumProblem() = default;
  virtual int size() const = 0;
  /** @return false: z is not a valid pose */
  virtual bool calcForce(const double* z, double* r) noexcept = 0;
  /** -dr/dz, column by column; r: the force at z. */
  virtual bool calcStiffness(const double* z, const double* r, double* stiffness) noexcept = 0;
  /** False: the user wants it to end. */
  virtual bool mayContinue() noexcept = 0;
  virtual double maxResidual_N() const = 0;
  virtual double maxMove_m() const = 0;  ///< of one iteration
};

struct EquilibriumOutcome {
  bool converged = false;
  int iterations = 0;
  std::string reason;  ///< why it did not converge
};

/** Improves z. */
using EquilibriumSolver = std::function<EquilibriumOutcome(EquilibriumProblem&, double* z)>;

/** Makes a method available to static analyses: "kinsol". */
void registerEquilibriumSolver(const std::string& name, EquilibriumSolver solver);
/** Null: no such method in this program. */
const EquilibriumSolver* findEquilibriumSolver(const std::string& name);

}  // namespace genu::model
