#pragma once

#include "genu/musculoskeletal/MuscleCurves.h"

namespace genu::musculoskeletal {

/** A Hill-type muscle with its tendon, in series [Zajac 1989, Crit Rev Biomed Eng 17:359; De Groote et al. 2016, see MuscleCurves.h].

   L = l cos(alpha) + lT,   l sin(alpha) = lo sin(alpha0)       pennation: the muscle keeps its height
   fibre force over F0:  f = a f_l(l/lo) f_v(v) + f_p(l/lo) + beta v,   v = (dl/dt)/(lo v_max)
   tension  T = F0 f cos(alpha) = F0 f_t(lT/Ls)                 equilibrium, compliant tendon
   rigid tendon: lT = Ls

 L length of the path [m], l fibre and lT tendon length [m], lo optimal fibre length, Ls tendon slack length, alpha pennation, a activation.
 A path shorter than a rigid tendon, or a tendon that hangs, pulls with nothing: `slack`. Tension is never negative. */
struct Muscle {
  double maxIsometricForce_N = 0;      ///< F0
  double optimalFibreLength_m = 0;     ///< lo
  double tendonSlackLength_m = 0;      ///< Ls
  double pennationAtOptimal_rad = 0;   ///< alpha0, 0 to 80 deg
  double maxContractionVelocity_perS = 10;  ///< v_max, optimal lengths per second
  double fibreDamping = 0.1;           ///< beta >= 0; > 0 where the tendon is compliant: the fibre's velocity is then defined at a = 0 too
  MuscleCurves curves;

  /** @throws std::invalid_argument naming the quantity, its value and the allowed range */
  void validate(bool compliantTendon) const;
};

enum class MuscleState {
  ok,
  slack,          ///< the tendon hangs
  fibreTooShort,  ///< below 0.2 optimal lengths, or pennated beyond acos 0.1: beyond the curves' range, numbers continue
  fibreTooLong,   ///< above 1.8: likewise
};
const char* toString(MuscleState state);

struct MuscleResponse {
  double tension_N = 0;
  double dTdL_NPerM = 0;        ///< at constant activation and rate; compliant: at constant fibre length
  double dTdRate_NSPerM = 0;    ///< by dL/dt; 0 with a compliant tendon
  double dTdActivation_N = 0;   ///< 0 with a compliant tendon
  double fibreLength_m = 0, fibreVelocity_MPerS = 0;
  double cosPennation = 1;
  double energy_J = 0;          ///< of the passive fibre and the tendon
  MuscleState state = MuscleState::ok;
};

/** Rigid tendon. @param activation 0 to 1 */
MuscleResponse calcRigidTendon(const Muscle& muscle, double activation, double length_m, double rate_MPerS);

/** Compliant tendon: tension from the fibre length, a state of the system, and that state's rate: the root of
 a f_l f_v(v) + beta v = f_t/cos(alpha) - f_p, which is monotone in v. */
MuscleResponse calcCompliantTendon(const Muscle& muscle, double activation, double fibreLength_m, double length_m);

struct FibreEquilibrium {
  double fibreLength_m = 0;
  double residual = 0;     ///< of the force balance, over F0
  int iterations = 0;
  /** slack: the path is shorter than tendon and shortest fibre. fibreTooShort: even the shortest fibre holds the tendon. The fibre is then
   the shortest one. */
  MuscleState state = MuscleState::ok;
};

/** Fibre length at which fibre and tendon balance at rest. Between the shortest fibre, where the tendon pulls more, and the one that lets
 the tendon hang, where it does not pull, there is a root: it is bracketed in steps of 1/256 of that range and found to 1e-14 of it. Where
 the descending limb of f_l makes several, it is the shortest fibre's, which is stable. */
FibreEquilibrium findFibreEquilibrium(const Muscle& muscle, double activation, double length_m);

/** da/dt from the excitation u [De Groote et al. 2016]:

   da/dt = (u - a) ((1/2 + s)/(tau_act (1/2 + 3a/2)) + (1/2 - s) (1/2 + 3a/2)/tau_deact),  s = tanh(b (u - a))/2

 b = infinity is the switch between rising and falling of Winters 1995 and Thelen 2003; the published b = 0.1 nearly takes the mean of both. */
struct ActivationDynamics {
  double activationTime_s = 0.015, deactivationTime_s = 0.060;
  double steepness = 0.1;  ///< b > 0, infinity allowed
  /** @throws std::invalid_argument */
  void validate() const;
  double calcRate_perS(double activation, double excitation) const;
};

/** The second set: times, damping and strains of Millard et al. 2013 (J Biomech Eng 135:021005) with the closed forms above. */
Muscle withMillardParameters(Muscle muscle);
ActivationDynamics millardActivation();

}  // namespace genu::musculoskeletal
