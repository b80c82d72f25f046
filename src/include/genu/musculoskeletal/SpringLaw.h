#pragma once

namespace genu::musculoskeletal {

/** A linear spring and damper along a path, for the horns and hoops of menisci and other short attachments.

   f = k (L - L0) + c dL/dt,   energy k (L - L0)^2 / 2

 L length of the path [m], L0 rest length [m]. In tension only: nothing while L <= L0, and never below 0 (the damper cannot push).
 Positive f pulls the ends together. */
struct SpringLaw {
  double stiffness_NPerM = 0;  ///< k > 0
  double restLength_m = 0;     ///< L0 >= 0
  double damping_NSPerM = 0;   ///< c >= 0
  bool tensionOnly = true;

  /** @throws std::invalid_argument naming the quantity, its value and the allowed range */
  void validate() const;
};

struct SpringResponse {
  double tension_N = 0;
  double dTdL_NPerM = 0;
  double dTdRate_NSPerM = 0;
  double energy_J = 0;
  double dissipation_W = 0;  ///< >= 0
};

SpringResponse calcResponse(const SpringLaw& law, double length_m, double rate_MPerS);

}  // namespace genu::musculoskeletal
