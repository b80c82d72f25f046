#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace genu::model {

/** The initial value problem y' = f(t, y) that an integrator sees. It knows neither Simbody nor contact. */
class OdeProblem {
 public:
  enum class Evaluation {
    ok,
    retry,  ///< y is outside the model's range: shorten the step
    stop,   ///< give up; the reason is kept by the problem
  };
  virtual ~OdeProblem() = default;
  virtual int size() const = 0;
  /** y begins with so many coordinates and as many of their rates; 0: it is of no such form. */
  virtual int numCoordinates() const { return 0; }
  /** Never throws: exceptions may not cross the integrators' C code. */
  virtual Evaluation evaluate(double t, const double* y, double* ydot) noexcept = 0;
  virtual bool hasJacobian() const { return false; }
  /** df/dy, column by column: jacobian[j * size() + i] = df_i/dy_j. Only with hasJacobian(). */
  virtual Evaluation calcJacobian(double /*t*/, const double* /*y*/, double* /*jacobian*/) noexcept { return Evaluation::stop; }
  /** Absolute tolerance of each component, > 0; there is no relative one. */
  virtual const std::vector<double>& absoluteTolerances() const = 0;
  /** A component's name in messages: "rate of z". */
  virtual std::string describeComponent(int component) const { return "component " + std::to_string(component + 1); }

  // Problems whose components are not independent: m constraints g(t, q) = 0 on the coordinates q, and with them g' = G u + dg/dt = 0 on the
  // rates. evaluate() gives rates that keep them.

  virtual int numConstraints() const { return 0; }
  /** Moves y onto the constraints: coordinates first, then rates. `error`, if not null, an estimate of y's error, loses its part across the
   constraints. */
  virtual Evaluation project(double /*t*/, double* /*y*/, double* /*error*/) noexcept { return Evaluation::stop; }
  /** The constrained system with multipliers lambda (of the constraint forces) and mu, size() + 2 m residuals that are zero on a solution
   [Gear, Leimkuhler & Gupta, J Comput Appl Math 12 (1985) 77]:

     q' - u - G^T mu,   M u' + G^T lambda - f(t, q, u, z),   z' - h(t, q, u, z),   g(t, q),   G u + dg/dt

   Of index 2; mu is zero but for errors of the method. `multipliers`: lambda, then mu. */
  virtual Evaluation calcResidual(double /*t*/, const double* /*y*/, const double* /*ydot*/, const double* /*multipliers*/,
                                  double* /*residual*/) noexcept {
    return Evaluation::stop;
  }
  /** d(residual)/d(y, multipliers) + c d(residual)/d(ydot, 0), column by column. Only with hasJacobian(). */
  virtual Evaluation calcResidualJacobian(double /*t*/, const double* /*y*/, const double* /*ydot*/, const double* /*multipliers*/, double /*c*/,
                                          double* /*jacobian*/) noexcept {
    return Evaluation::stop;
  }
  /** Rates and multipliers of a y that is on the constraints. */
  virtual Evaluation calcMultipliers(double /*t*/, const double* /*y*/, double* /*ydot*/, double* /*multipliers*/) noexcept {
    return Evaluation::stop;
  }
};

/** One stiff integrator, stepping at its own pace up to a stop time that it does not pass. */
class OdeIntegrator {
 public:
  struct Statistics {
    long stepsTaken = 0, stepsAttempted = 0, errorTestFailures = 0, convergenceFailures = 0, evaluations = 0, jacobians = 0;
  };
  virtual ~OdeIntegrator() = default;
  virtual std::string name() const = 0;
  /** @return false with errorText() set when it cannot start */
  virtual bool initialize(double t0, const std::vector<double>& y0, double stopTime) = 0;
  /** Takes one internal step. @return false with errorText() set on failure */
  virtual bool step() = 0;
  virtual double time() const = 0;
  /** Moves the stop time on after it was reached; what was learned of the motion is kept. @return false: initialize() anew */
  virtual bool continueTo(double /*stopTime*/) { return false; }
  /** No step from here on may be longer; what has a fixed step takes it in parts. Infinity: no limit. */
  virtual void limitStep(double /*longest*/) {}
  /** Of fixed-step methods the step that was asked for, or their own; 0: steps are chosen by tolerances. */
  virtual double fixedStep_s() const { return 0; }
  /** The component that stopped the last step, or limited it; -1: not known. */
  virtual int worstComponent() { return -1; }
  /** What the last step alone errs by, with signs, as estimated for its length; false: not known. */
  [[nodiscard]] virtual bool getStepErrors(std::vector<double>& /*errors*/) { return false; }
  /** The solution inside the last step. */
  [[nodiscard]] virtual bool interpolate(double t, std::vector<double>& y) = 0;
  virtual Statistics statistics() = 0;
  virtual const std::string& errorText() const = 0;
};

/** The component with the largest error over its tolerance; -1: none has any. In the header for integrators that do not link Genu::model. */
inline int findWorst(const double* errors, const std::vector<double>& tolerances) {
  int worst = -1;
  double largest = 0;
  for (size_t i = 0; i < tolerances.size(); ++i) {
    const double share = std::abs(errors[i]) / tolerances[i];
    if (share > largest) largest = share, worst = static_cast<int>(i);
  }
  return worst;
}

struct OdeSettings {
  int maxOrder = 0;       ///< of multistep methods; 0: the method's own
  double step_s = 0;      ///< of fixed-step methods; 0: the method's own
};

/** An integrator by name: listOdeIntegrators() has them.
    @throws InputError for an unknown name, listing the known ones, or a setting that this integrator does not take; `where` is the key it
    came from */
std::unique_ptr<OdeIntegrator> makeOdeIntegrator(const std::string& name, OdeProblem& problem, const OdeSettings& settings,
                                                 const std::string& where);

struct OdeIntegratorKind {
  enum class Step { adaptive, either, fixed };  ///< fixed: always; either: where OdeSettings gives one
  std::string name;
  std::string library;                          ///< whose code it is: "SUNDIALS CVODE"
  std::string description;                      ///< one line
  int lowestOrder = 0, highestOrder = 0;        ///< of OdeSettings::maxOrder; 0: it takes none
  Step step = Step::adaptive;
  /** What it can integrate: independent unknowns only (`eliminated`), problems with constraints only, or both. */
  enum class Unknowns { eliminated, constraints, both };
  Unknowns unknowns = Unknowns::eliminated;
  std::function<std::unique_ptr<OdeIntegrator>(OdeProblem&, const OdeSettings&)> make;
  /** How it solves the equations of a step: it has none, with a Jacobian that it takes by differences, with OdeProblem::calcJacobian where there is one. */
  enum class Equations { none, differenced, exact };
  Equations equations = Equations::exact;
  bool ratesOnly = false;                       ///< weighs errors by the tolerances of rates alone
};
/** Adds a kind; one of the same name is replaced. */
void registerOdeIntegrator(OdeIntegratorKind kind);
/** In the order in which they were added. */
std::vector<OdeIntegratorKind> listOdeIntegrators();
/** @throws InputError for an unknown name, listing the known ones and telling one that this build leaves out; `where` is the key it came from */
const OdeIntegratorKind& findOdeIntegrator(const std::string& name, const std::string& where);
/** The name that a scene gives, or the standard: "cvode-bdf" where it was registered, else "cpodes", the same method. */
std::string chooseIntegrator(const std::string& given);
/** Begins a message about a setting, `max_order` or `step`: "scene.yaml:12: analysis.gait.max_order". */
using PlaceOfSetting = std::function<std::string(const char* setting)>;
/** @throws InputError a setting that the kind does not take */
void checkOdeSettings(const OdeIntegratorKind& kind, const OdeSettings& settings, const PlaceOfSetting& placeOf);

}  // namespace genu::model
