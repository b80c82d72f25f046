#include "genu/musculoskeletal/SpringLaw.h"

#include "Range.h"

namespace genu::musculoskeletal {

void SpringLaw::validate() const {
  require(stiffness_NPerM > 0, "stiffness", stiffness_NPerM, "N/m", "> 0");
  require(restLength_m >= 0, "rest length", restLength_m, "m", ">= 0");
  require(damping_NSPerM >= 0, "damping", damping_NSPerM, "N s/m", ">= 0");
}

SpringResponse calcResponse(const SpringLaw& law, double length_m, double rate_MPerS) {
  SpringResponse r;
  const double stretch = length_m - law.restLength_m;
  if (law.tensionOnly && !(stretch > 0)) return r;
  const double elastic = law.stiffness_NPerM * stretch;
  r.energy_J = 0.5 * elastic * stretch;
  r.tension_N = elastic + law.damping_NSPerM * rate_MPerS;
  if (law.tensionOnly && !(r.tension_N > 0)) {  // shortens faster than it can follow: all of the elastic force is lost
    r.tension_N = 0;
    r.dissipation_W = -elastic * rate_MPerS;
    return r;
  }
  r.dTdL_NPerM = law.stiffness_NPerM;
  r.dTdRate_NSPerM = law.damping_NSPerM;
  r.dissipation_W = law.damping_NSPerM * rate_MPerS * rate_MPerS;
  return r;
}

}  // namespace genu::musculoskeletal
