#include "Sundials.h"

#include <arkode/arkode_arkstep.h>
#include <cvode/cvode.h>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "genu/model/OdeIntegrator.h"

namespace genu::integrators {

namespace {

using model::OdeIntegrator;
using model::OdeProblem;
using model::OdeSettings;

constexpr double kSmallestStep = 1e-10;  ///< of the run: ends the creeping towards a state that cannot be passed
constexpr long kMostSteps = 10'000'000;

/** What both drivers share: vectors, the linear solver, and the calls back to the problem. */
class SundialsDriver : public OdeIntegrator {
 public:
  SundialsDriver(std::string name, OdeProblem& problem) : problem_(problem), name_(std::move(name)) {}
  ~SundialsDriver() override = default;

  std::string name() const override { return name_; }
  double time() const override { return time_; }
  const std::string& errorText() const override { return error_; }

  Statistics statistics() override {
    Statistics s;
    count(s);
    s.evaluations = evaluations_;
    s.jacobians = jacobians_;
    return s;
  }

  bool step() override {
    if (time_ >= stop_) return false;
    double reached = time_;
    const int flag = advance(stop_, y_.get(), &reached);
    time_ = reached;
    if (flag >= 0) {
      if (++taken_ < kMostSteps) return true;
      error_ = "more than ten million steps; loosen the accuracy or check for a motion without damping";
      return false;
    }
    if (error_.empty()) error_ = name_ + " failed with code " + std::to_string(flag);
    return false;
  }

  int worstComponent() override {
    if (!dense_ || getErrors(dense_.get()) != 0) return -1;
    return model::findWorst(N_VGetArrayPointer(dense_.get()), problem_.absoluteTolerances());
  }

  bool getStepErrors(std::vector<double>& errors) override {
    if (!dense_ || getErrors(dense_.get()) != 0) return false;
    const double* values = N_VGetArrayPointer(dense_.get());
    errors.assign(values, values + problem_.size());
    return true;
  }

  void limitStep(double longest) override {
    setLongest(std::isfinite(longest) ? longest : 0);
    // The length of the next step is chosen already: a stop cuts it.
    setStop(std::min(stop_, time_ + longest));
  }

  bool continueTo(double stopTime) override {
    stop_ = stopTime;
    return setStop(stopTime);
  }

  bool initialize(double t0, const std::vector<double>& y0, double stopTime) override {
    error_.clear();
    evaluations_ = jacobians_ = taken_ = 0;
    release();
    if (context_.value != nullptr) {
      y_.reset(), dense_.reset(), matrix_.reset(), solver_.reset(), iteration_.reset();
      SUNContext_Free(&context_.value);
    }
    if (SUNContext_Create(nullptr, &context_.value) != 0) return fail("no SUNDIALS context");
    const auto n = static_cast<sunindextype>(problem_.size());
    y_.reset(N_VNew_Serial(n, context_.value));
    dense_.reset(N_VNew_Serial(n, context_.value));
    time_ = t0;
    stop_ = stopTime;
    span_ = stopTime - t0;
    std::copy(y0.begin(), y0.end(), N_VGetArrayPointer(y_.get()));
    N_VConst(0, dense_.get());
    if (rightSide(t0, y_.get(), dense_.get(), this) != 0) return fail("the start is not a valid state");
    bool atRest = true;
    for (sunindextype i = 0; i < n; ++i) atRest = atRest && N_VGetArrayPointer(dense_.get())[i] == 0;
    // The first step is derived from y'; nothing can be derived from 0. The error test corrects a step that is too long.
    firstStep_ = atRest ? 1e-5 * span_ : 0;
    return setUp();
  }

  bool interpolate(double t, std::vector<double>& y) override {
    if (getDense(t, dense_.get()) < 0) return false;
    const double* values = N_VGetArrayPointer(dense_.get());
    y.assign(values, values + problem_.size());
    return true;
  }

 protected:
  virtual bool setUp() = 0;
  /** What the integrator's memory has counted, if there is any. */
  virtual void count(Statistics& s) = 0;
  /** Frees the integrator's memory, if there is any. */
  virtual void release() = 0;
  virtual int advance(double stop, N_Vector y, double* reached) = 0;
  virtual int getDense(double t, N_Vector y) = 0;
  virtual bool setStop(double t) = 0;

  /** 0: none. */
  virtual void setLongest(double h) = 0;
  /** The estimated error of each component of the last step in dense_. */
  virtual int getErrors(N_Vector errors) = 0;

  bool fail(const std::string& what) {
    if (error_.empty()) error_ = what;
    return false;
  }

  static int toFlag(OdeProblem::Evaluation evaluation) {
    return evaluation == OdeProblem::Evaluation::ok ? 0 : evaluation == OdeProblem::Evaluation::retry ? 1 : -1;
  }
  static int rightSide(double t, N_Vector y, N_Vector rate, void* self) {
    auto& driver = *static_cast<SundialsDriver*>(self);
    ++driver.evaluations_;
    return toFlag(driver.problem_.evaluate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(rate)));
  }
  static int jacobian(double t, N_Vector y, N_Vector, SUNMatrix matrix, void* self, N_Vector, N_Vector, N_Vector) {
    auto& driver = *static_cast<SundialsDriver*>(self);
    ++driver.jacobians_;
    return toFlag(driver.problem_.calcJacobian(t, N_VGetArrayPointer(y), SUNDenseMatrix_Data(matrix)));
  }
  static int weights(N_Vector, N_Vector weight, void* self) {
    const auto& tolerances = static_cast<SundialsDriver*>(self)->problem_.absoluteTolerances();
    for (size_t i = 0; i < tolerances.size(); ++i) N_VGetArrayPointer(weight)[i] = 1 / tolerances[i];
    return 0;
  }
  static void message(int code, const char*, const char*, char* text, void* self) {
    if (code < 0) static_cast<SundialsDriver*>(self)->error_ = text;
  }

  struct Context {
    SUNContext value = nullptr;
    ~Context() {
      if (value != nullptr) SUNContext_Free(&value);
    }
  };
  struct Free {
    void operator()(N_Vector v) const { N_VDestroy(v); }
    void operator()(SUNMatrix m) const { SUNMatDestroy(m); }
    void operator()(SUNLinearSolver s) const { SUNLinSolFree(s); }
    void operator()(SUNNonlinearSolver s) const { SUNNonlinSolFree(s); }
  };
  using Vector = std::unique_ptr<std::remove_pointer_t<N_Vector>, Free>;
  using Matrix = std::unique_ptr<std::remove_pointer_t<SUNMatrix>, Free>;
  using LinearSolver = std::unique_ptr<std::remove_pointer_t<SUNLinearSolver>, Free>;
  using NonlinearSolver = std::unique_ptr<std::remove_pointer_t<SUNNonlinearSolver>, Free>;

  void makeLinearSolver() {
    const auto n = static_cast<sunindextype>(problem_.size());
    matrix_.reset(SUNDenseMatrix(n, n, context_.value));
    solver_.reset(SUNLinSol_Dense(y_.get(), matrix_.get(), context_.value));
  }

  OdeProblem& problem_;
  Context context_;  // first in, last out
  Vector y_, dense_;
  Matrix matrix_;
  LinearSolver solver_;
  NonlinearSolver iteration_;
  double time_ = 0, stop_ = 0, span_ = 0, firstStep_ = 0;
  long evaluations_ = 0, jacobians_ = 0, taken_ = 0;
  std::string error_;

 private:
  std::string name_;
};

class Cvode : public SundialsDriver {
 public:
  Cvode(OdeProblem& problem, bool stiff, int maxOrder)
      : SundialsDriver(stiff ? "cvode-bdf" : "cvode-adams", problem), stiff_(stiff), maxOrder_(maxOrder) {}
  ~Cvode() override { release(); }

 protected:
  void count(Statistics& s) override {
    if (memory_ == nullptr) return;
    CVodeGetNumSteps(memory_, &s.stepsTaken);
    CVodeGetNumErrTestFails(memory_, &s.errorTestFailures);
    CVodeGetNumNonlinSolvConvFails(memory_, &s.convergenceFailures);
    s.stepsAttempted = s.stepsTaken + s.errorTestFailures + s.convergenceFailures;
  }
  void release() override {
    if (memory_ != nullptr) CVodeFree(&memory_);
  }
  int getErrors(N_Vector errors) override { return CVodeGetEstLocalErrors(memory_, errors); }
  bool setStop(double t) override { return CVodeSetStopTime(memory_, t) == 0; }
  void setLongest(double h) override { CVodeSetMaxStep(memory_, h); }
  bool setUp() override {
    memory_ = CVodeCreate(stiff_ ? CV_BDF : CV_ADAMS, context_.value);
    if (memory_ == nullptr) return fail("CVODE could not be made");
    bool ok = CVodeSetErrHandlerFn(memory_, message, this) == 0 && CVodeSetUserData(memory_, this) == 0 &&
              CVodeInit(memory_, rightSide, time_, y_.get()) == 0 && CVodeWFtolerances(memory_, &Cvode::weightsOf) == 0 &&
              CVodeSetMaxOrd(memory_, maxOrder_) == 0 && CVodeSetStopTime(memory_, stop_) == 0 &&
              CVodeSetMaxNumSteps(memory_, kMostSteps) == 0 && CVodeSetMinStep(memory_, kSmallestStep * span_) == 0 &&
              CVodeSetInitStep(memory_, firstStep_) == 0;
    if (stiff_) {
      makeLinearSolver();
      ok = ok && CVodeSetLinearSolver(memory_, solver_.get(), matrix_.get()) == 0;
      if (problem_.hasJacobian()) ok = ok && CVodeSetJacFn(memory_, jacobian) == 0;
    } else {
      iteration_.reset(SUNNonlinSol_FixedPoint(y_.get(), 0, context_.value));
      ok = ok && CVodeSetNonlinearSolver(memory_, iteration_.get()) == 0;
    }
    if (problem_.numConstraints() > 0) ok = ok && CVodeSetProjFn(memory_, project) == 0;
    return ok || fail("CVODE could not be set up");
  }
  int advance(double stop, N_Vector y, double* reached) override { return CVode(memory_, stop, y, reached, CV_ONE_STEP); }
  int getDense(double t, N_Vector y) override { return CVodeGetDky(memory_, t, 0, y); }

 private:
  // CVODE passes the user data, as the others do.
  static int weightsOf(N_Vector y, N_Vector weight, void* self) { return weights(y, weight, self); }

  static int project(double t, N_Vector y, N_Vector correction, double, N_Vector error, void* self) {
    auto& driver = *static_cast<Cvode*>(self);
    N_VScale(1, y, correction);
    double* moved = N_VGetArrayPointer(correction);
    const int flag = toFlag(driver.problem_.project(t, moved, error != nullptr ? N_VGetArrayPointer(error) : nullptr));
    N_VLinearSum(1, correction, -1, y, correction);
    return flag;
  }

  bool stiff_;
  int maxOrder_;
  void* memory_ = nullptr;
};

/** IDA on the constrained system with multipliers (OdeProblem::calcResidual), index 2: errors of the multipliers are left out of the error test. */
class Ida : public SundialsDriver {
 public:
  Ida(OdeProblem& problem, int maxOrder)
      : SundialsDriver("ida", problem), maxOrder_(maxOrder), differential_(problem.size()), all_(differential_ + 2 * problem.numConstraints()) {}
  ~Ida() override { release(); }

 protected:
  void count(Statistics& s) override {
    if (memory_ == nullptr) return;
    IDAGetNumSteps(memory_, &s.stepsTaken);
    IDAGetNumErrTestFails(memory_, &s.errorTestFailures);
    IDAGetNumNonlinSolvConvFails(memory_, &s.convergenceFailures);
    s.stepsAttempted = s.stepsTaken + s.errorTestFailures + s.convergenceFailures;
  }
  void release() override {
    if (memory_ != nullptr) IDAFree(&memory_);
    rate_.reset(), unknowns_.reset(), kinds_.reset();
  }
  int getErrors(N_Vector errors) override {
    Vector all(N_VNew_Serial(all_, context_.value));
    const int flag = IDAGetEstLocalErrors(memory_, all.get());
    if (flag == 0) std::copy_n(N_VGetArrayPointer(all.get()), differential_, N_VGetArrayPointer(errors));
    return flag;
  }
  bool setStop(double t) override { return IDASetStopTime(memory_, t) == 0; }
  void setLongest(double h) override { IDASetMaxStep(memory_, h); }

  bool setUp() override {
    memory_ = IDACreate(context_.value);
    if (memory_ == nullptr) return fail("IDA could not be made");
    for (Vector* v : {&rate_, &unknowns_, &kinds_}) v->reset(N_VNew_Serial(all_, context_.value));
    double *unknowns = N_VGetArrayPointer(unknowns_.get()), *rate = N_VGetArrayPointer(rate_.get()), *kinds = N_VGetArrayPointer(kinds_.get());
    std::copy_n(N_VGetArrayPointer(y_.get()), differential_, unknowns);
    std::fill_n(rate, all_, 0.0);
    ++evaluations_;
    const auto start = problem_.calcMultipliers(time_, unknowns, rate, unknowns + differential_);
    if (start != OdeProblem::Evaluation::ok) return fail("the start is not a valid state");
    for (int i = 0; i < all_; ++i) kinds[i] = i < differential_ ? 1 : 0;
    matrix_.reset(SUNDenseMatrix(all_, all_, context_.value));
    solver_.reset(SUNLinSol_Dense(unknowns_.get(), matrix_.get(), context_.value));
    bool ok = IDASetErrHandlerFn(memory_, message, this) == 0 && IDASetUserData(memory_, this) == 0 &&
              IDAInit(memory_, residual, time_, unknowns_.get(), rate_.get()) == 0 && IDAWFtolerances(memory_, weightsOfAll) == 0 &&
              IDASetMaxOrd(memory_, maxOrder_) == 0 && IDASetStopTime(memory_, stop_) == 0 && IDASetMaxNumSteps(memory_, kMostSteps) == 0 &&
              IDASetMinStep(memory_, kSmallestStep * span_) == 0 && IDASetId(memory_, kinds_.get()) == 0 && IDASetSuppressAlg(memory_, 1) == 0 &&
              IDASetLinearSolver(memory_, solver_.get(), matrix_.get()) == 0;
    if (firstStep_ > 0) ok = ok && IDASetInitStep(memory_, firstStep_) == 0;
    if (problem_.hasJacobian()) ok = ok && IDASetJacFn(memory_, residualJacobian) == 0;
    return ok || fail("IDA could not be set up");
  }
  int advance(double stop, N_Vector, double* reached) override {
    return IDASolve(memory_, stop, reached, unknowns_.get(), rate_.get(), IDA_ONE_STEP);
  }
  int getDense(double t, N_Vector y) override {
    Vector all(N_VNew_Serial(all_, context_.value));
    const int flag = IDAGetDky(memory_, t, 0, all.get());
    if (flag == 0) std::copy_n(N_VGetArrayPointer(all.get()), differential_, N_VGetArrayPointer(y));
    return flag;
  }

 private:
  static int residual(double t, N_Vector y, N_Vector rate, N_Vector r, void* self) {
    auto& driver = *static_cast<Ida*>(self);
    ++driver.evaluations_;
    const double* unknowns = N_VGetArrayPointer(y);
    return toFlag(driver.problem_.calcResidual(t, unknowns, N_VGetArrayPointer(rate), unknowns + driver.differential_, N_VGetArrayPointer(r)));
  }
  static int residualJacobian(double t, double c, N_Vector y, N_Vector rate, N_Vector, SUNMatrix matrix, void* self, N_Vector, N_Vector, N_Vector) {
    auto& driver = *static_cast<Ida*>(self);
    ++driver.jacobians_;
    const double* unknowns = N_VGetArrayPointer(y);
    return toFlag(driver.problem_.calcResidualJacobian(t, unknowns, N_VGetArrayPointer(rate), unknowns + driver.differential_, c,
                                                       SUNDenseMatrix_Data(matrix)));
  }
  /** Newton's iteration also weighs the multipliers: lambda by the force of a contact of kStiffness_NPerM moved by the tolerance of the first coordinate, mu by the
   tolerance of its rate. */
  static int weightsOfAll(N_Vector, N_Vector weight, void* self) {
    constexpr double kStiffness_NPerM = 5e7;
    auto& driver = *static_cast<Ida*>(self);
    const auto& tolerances = driver.problem_.absoluteTolerances();
    const auto n = static_cast<size_t>(driver.differential_), m = (static_cast<size_t>(driver.all_) - n) / 2;
    const auto first = static_cast<size_t>(driver.problem_.numCoordinates());
    double* w = N_VGetArrayPointer(weight);
    for (size_t i = 0; i < n; ++i) w[i] = 1 / tolerances[i];
    for (size_t i = 0; i < m; ++i) w[n + i] = 1 / (kStiffness_NPerM * tolerances[0]), w[n + m + i] = 1 / tolerances[first];
    return 0;
  }

  int maxOrder_, differential_, all_;
  Vector rate_, unknowns_, kinds_;
  void* memory_ = nullptr;
};

class Arkode : public SundialsDriver {
 public:
  /** step_s > 0: fixed. */
  Arkode(std::string name, OdeProblem& problem, int order, double step_s)
      : SundialsDriver(std::move(name), problem), order_(order), step_s_(step_s) {}
  ~Arkode() override { release(); }

  double fixedStep_s() const override { return step_s_; }

 protected:
  void count(Statistics& s) override {
    if (memory_ == nullptr) return;
    ARKStepGetNumSteps(memory_, &s.stepsTaken);
    ARKStepGetNumStepAttempts(memory_, &s.stepsAttempted);
    ARKStepGetNumErrTestFails(memory_, &s.errorTestFailures);
    ARKStepGetNumNonlinSolvConvFails(memory_, &s.convergenceFailures);
  }
  void release() override {
    if (memory_ != nullptr) ARKStepFree(&memory_);
    before_.reset();
  }
  int getErrors(N_Vector errors) override { return step_s_ > 0 ? -1 : ARKStepGetEstLocalErrors(memory_, errors); }
  bool setStop(double t) override {
    fixedStop_ = t;
    return step_s_ > 0 || ARKStepSetStopTime(memory_, t) == 0;
  }
  void setLongest(double h) override {
    if (step_s_ <= 0) ARKStepSetMaxStep(memory_, h);
  }
  bool setUp() override {
    depth_ = 0;
    part_ = 0;
    before_.reset(N_VClone(y_.get()));
    N_VScale(1, y_.get(), before_.get());
    beforeTime_ = time_;
    memory_ = ARKStepCreate(nullptr, rightSide, time_, y_.get(), context_.value);
    if (memory_ == nullptr) return fail("ARKODE could not be made");
    makeLinearSolver();
    bool ok = ARKStepSetErrHandlerFn(memory_, message, this) == 0 && ARKStepSetUserData(memory_, this) == 0 &&
              ARKStepWFtolerances(memory_, weights) == 0 && ARKStepSetLinearSolver(memory_, solver_.get(), matrix_.get()) == 0 &&
              setStop(stop_) && ARKStepSetMaxNumSteps(memory_, kMostSteps) == 0;
    if (problem_.hasJacobian()) ok = ok && ARKStepSetJacFn(memory_, jacobian) == 0;
    if (order_ == 1) {
      double one = 1;
      ButcherTable table(ARKodeButcherTable_Create(1, 1, 0, &one, &one, &one, nullptr), ARKodeButcherTable_Free);
      ok = ok && ARKStepSetTables(memory_, 1, 0, table.get(), nullptr) == 0;
    } else {
      ok = ok && ARKStepSetTableNum(memory_, tableOf(order_), ARKODE_ERK_NONE) == 0;
    }
    // Newton starts from the step before continued: from its last value, ARKODE's standard, a stage begins in another state of contact and most steps are repeated
    // (1.1 s for the artificial gait in place of 0.2). A Jacobian costs little more than an evaluation: one per stage.
    ok = ok && ARKStepSetPredictorMethod(memory_, 1) == 0 && ARKStepSetDeduceImplicitRhs(memory_, 1) == 0 &&
         ARKStepSetLSetupFrequency(memory_, 1) == 0 && ARKStepSetJacEvalFrequency(memory_, 1) == 0 && ARKStepSetNonlinConvCoef(memory_, 0.3) == 0;
    // With a fixed step Newton has to get there by itself.
    ok = ok && ARKStepSetMaxNonlinIters(memory_, step_s_ > 0 ? 10 : 4) == 0;
    if (step_s_ > 0) {
      ok = ok && ARKStepSetFixedStep(memory_, fixedStep()) == 0;
    } else {
      ok = ok && ARKStepSetMinStep(memory_, kSmallestStep * span_) == 0 && ARKStepSetInitStep(memory_, firstStep_) == 0;
    }
    return ok || fail("ARKODE could not be set up");
  }
  int advance(double stop, N_Vector y, double* reached) override {
    if (step_s_ <= 0) return ARKStepEvolve(memory_, stop, y, reached, ARK_ONE_STEP);
    // A fixed step that does not converge is halved; the step grows back where it is a multiple again. It ends at a stop by its length: at a stop of its own ARKODE hands back its
    // interpolant, which for a method of first order is constant, the mean of both ends of the step.
    if (depth_ > 0) {
      for (++part_; depth_ > 0 && part_ % 2 == 0; --depth_) part_ /= 2;
      if (depth_ == 0) part_ = 0;
    }
    N_VScale(1, y, before_.get());
    const double from = beforeTime_ = *reached;
    int flag = -1;
    for (;; ++depth_, part_ *= 2) {
      const double h = std::ldexp(fixedStep(), -depth_), left = fixedStop_ - from;
      const bool last = h > left * (1 - 1e-9);
      if (ARKStepSetFixedStep(memory_, last ? left : h) != 0) return flag;
      flag = ARKStepEvolve(memory_, stop, y, reached, ARK_ONE_STEP);
      if (flag >= 0 && last) *reached = fixedStop_;
      if (flag >= 0 || depth_ >= kMostHalvings) return flag;
      error_.clear();
      N_VScale(1, before_.get(), y);
      *reached = from;
      if (ARKStepReset(memory_, from, y) != 0) return flag;
    }
  }
  /** Of a fixed step of first order: the line between its ends. */
  int getDense(double t, N_Vector y) override {
    if (order_ > 1) return ARKStepGetDky(memory_, t, 0, y);
    const double share = time_ > beforeTime_ ? (t - beforeTime_) / (time_ - beforeTime_) : 1;
    N_VLinearSum(share, y_.get(), 1 - share, before_.get(), y);
    return 0;
  }

 private:
  using ButcherTable = std::unique_ptr<std::remove_pointer_t<ARKodeButcherTable>, void (*)(ARKodeButcherTable)>;

  /** Stiffly accurate, L-stable methods. */
  static ARKODE_DIRKTableID tableOf(int order) {
    switch (order) {
      case 2:
        return ARKODE_TRBDF2_3_3_2;
      case 4:
        return ARKODE_SDIRK_5_3_4;
      case 5:
        return ARKODE_ARK548L2SA_DIRK_8_4_5;
      default:
        return ARKODE_ARK324L2SA_DIRK_4_2_3;
    }
  }

  double fixedStep() const { return span_ / std::ceil(span_ / step_s_ - 1e-9); }

  static constexpr int kMostHalvings = 12;
  int order_;
  double step_s_;
  int depth_ = 0;
  long part_ = 0;      // where in the whole step, in parts of the present length
  Vector before_;      // y at the beginning of a fixed step
  double beforeTime_ = 0, fixedStop_ = 0;
  void* memory_ = nullptr;
};

}  // namespace

OdeIntegrator* genuMakeSundials(SundialsKind kind, OdeProblem& problem, const OdeSettings& settings) {
  const auto orderOr = [&settings](int standard) { return settings.maxOrder > 0 ? settings.maxOrder : standard; };
  constexpr double kEulerStep_s = 1e-3;
  switch (kind) {
    case SundialsKind::cvodeBdf:
      return new Cvode(problem, true, orderOr(2));
    case SundialsKind::cvodeAdams:
      return new Cvode(problem, false, orderOr(12));
    case SundialsKind::ida:
      return new Ida(problem, orderOr(2));
    case SundialsKind::arkodeDirk:
      return new Arkode("arkode-dirk", problem, orderOr(3), settings.step_s);
    case SundialsKind::implicitEuler:
      return new Arkode("implicit-euler", problem, 1, settings.step_s > 0 ? settings.step_s : kEulerStep_s);
  }
  return nullptr;
}

}  // namespace genu::integrators
