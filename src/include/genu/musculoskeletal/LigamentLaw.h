#pragma once

namespace genu::musculoskeletal {

/** Tension of a ligament bundle: nothing when slack, then a quadratic toe, then a line [Blankevoort & Huiskes 1991, J Biomech Eng 113:263].

   e = L/L0 - 1                                 strain, L length of the path [m], L0 slack length [m]
   f(e) = 0                  e <= 0
          e^2 / (4 eps_l)    0 <= e <= 2 eps_l
          e - eps_l          e >= 2 eps_l
   T = k f(e) max(0, 1 + tau de/dt)

 k stiffness [N per unit strain], eps_l toe strain (0.03; OpenSim's "transition strain" is 2 eps_l), tau damping time [s]. T is C1 in L, at
 slack too, and never compressive. Energy is the integral of k f over L from L0; the damping part always takes power, T_damping dL/dt >= 0
 (where 1 + tau de/dt is cut off, all of the elastic tension).
 OpenSim adds c de/dt [c in N s] instead, only while lengthening, faded in over the first percent of strain: c corresponds to k tau f(e).

 Slack length from a pose: see the functions below. */
struct LigamentLaw {
  double stiffness_N = 0;    ///< per unit strain
  double slackLength_m = 0;
  double toeStrain = 0.03;   ///< eps_l; 0: a line from slack on
  double dampingTime_s = 0;

  /** @throws std::invalid_argument naming the quantity, its value and the allowed range */
  void validate() const;
};

struct LigamentResponse {
  double tension_N = 0;
  double dTdL_NPerM = 0;
  double dTdRate_NSPerM = 0;  ///< by dL/dt
  double energy_J = 0;        ///< elastic
  double dissipation_W = 0;   ///< >= 0
};

/** @param length_m > 0  @param rate_MPerS dL/dt */
LigamentResponse calcResponse(const LigamentLaw& law, double length_m, double rate_MPerS = 0);

/** Slack length of a bundle whose length in a reference pose is known, from its strain there: L0 = L/(1 + e).
 @throws std::invalid_argument for a length that is not positive or a strain that is not above -1 */
double calcSlackLengthFromStrain_m(double referenceLength_m, double referenceStrain);

/** The same from the tension there; 0: just slack. Closed form.
 @throws std::invalid_argument for numbers out of range */
double calcSlackLengthFromTension_m(double referenceLength_m, double referenceTension_N, double stiffness_N, double toeStrain);

/** The same for a stiffness K per length: k = K L0 depends on the result. @throws also where T >= K L: such a tension needs no length at all. */
double calcSlackLengthFromTensionPerLength_m(double referenceLength_m, double referenceTension_N, double stiffness_NPerM, double toeStrain);

}  // namespace genu::musculoskeletal
