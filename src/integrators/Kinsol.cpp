#include <kinsol/kinsol.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <vector>

#include "Sundials.h"

namespace genu::integrators {

namespace {

using model::EquilibriumOutcome;
using model::EquilibriumProblem;

struct Solve {
  EquilibriumProblem& problem;
  EquilibriumOutcome& outcome;
  bool interrupted = false;

  static int force(N_Vector z, N_Vector r, void* self) {
    return static_cast<Solve*>(self)->problem.calcForce(N_VGetArrayPointer(z), N_VGetArrayPointer(r)) ? 0 : 1;
  }
  static int jacobian(N_Vector z, N_Vector r, SUNMatrix matrix, void* self, N_Vector, N_Vector) {
    auto& solve = *static_cast<Solve*>(self);
    if (!solve.problem.mayContinue()) {
      solve.interrupted = true;
      return -1;
    }
    double* values = SUNDenseMatrix_Data(matrix);
    if (!solve.problem.calcStiffness(N_VGetArrayPointer(z), N_VGetArrayPointer(r), values)) return 1;
    const int n = solve.problem.size();
    for (int k = 0; k < n * n; ++k) values[k] = -values[k];
    return 0;
  }
  static void message(int code, const char*, const char*, char* text, void* self) {
    if (code < 0) static_cast<Solve*>(self)->outcome.reason = text;
  }
};

}  // namespace

void genuSolveWithKinsol(EquilibriumProblem& problem, double* z, EquilibriumOutcome& outcome) {
  constexpr double kLength_m = 1e-3;  // a pose's unit
  constexpr long kMostIterations = 200;
  Solve solve{problem, outcome};
  const auto n = static_cast<sunindextype>(problem.size());
  SUNContext context = nullptr;
  if (SUNContext_Create(nullptr, &context) != 0) {
    outcome.reason = "no SUNDIALS context";
    return;
  }
  N_Vector pose = N_VMake_Serial(n, z, context), poseScale = N_VNew_Serial(n, context), forceScale = N_VNew_Serial(n, context);
  SUNMatrix matrix = SUNDenseMatrix(n, n, context);
  SUNLinearSolver solver = SUNLinSol_Dense(pose, matrix, context);
  void* memory = KINCreate(context);
  N_VConst(1 / kLength_m, poseScale);
  N_VConst(1 / problem.maxResidual_N(), forceScale);
  // The residual decides, not the step: KINSOL's second criterion is set out of reach. A step may be longer than ours, which has no line search. A new Jacobian costs one evaluation of contact: one each step.
  const bool ok = memory != nullptr && KINSetErrHandlerFn(memory, Solve::message, &solve) == 0 && KINSetUserData(memory, &solve) == 0 &&
                  KINInit(memory, Solve::force, pose) == 0 && KINSetFuncNormTol(memory, 1) == 0 && KINSetScaledStepTol(memory, 1e-16) == 0 &&
                  KINSetMaxNewtonStep(memory, 4 * problem.maxMove_m() / kLength_m) == 0 && KINSetNumMaxIters(memory, kMostIterations) == 0 &&
                  KINSetMaxSetupCalls(memory, 1) == 0 && KINSetLinearSolver(memory, solver, matrix) == 0 &&
                  KINSetJacFn(memory, Solve::jacobian) == 0;
  if (ok) {
    const int flag = KINSol(memory, pose, KIN_LINESEARCH, poseScale, forceScale);
    outcome.converged = flag == KIN_SUCCESS || flag == KIN_INITIAL_GUESS_OK;
    if (!outcome.converged && outcome.reason.empty()) outcome.reason = "KINSOL ended with code " + std::to_string(flag);
    long iterations = 0;
    KINGetNumNonlinSolvIters(memory, &iterations);
    outcome.iterations = static_cast<int>(iterations);
  } else if (outcome.reason.empty()) {
    outcome.reason = "KINSOL could not be set up";
  }
  if (solve.interrupted) outcome.reason = "interrupted";
  if (memory != nullptr) KINFree(&memory);
  SUNLinSolFree(solver);
  SUNMatDestroy(matrix);
  N_VDestroy(forceScale);
  N_VDestroy(poseScale);
  N_VDestroy(pose);
  SUNContext_Free(&context);
}

}  // namespace genu::integrators
