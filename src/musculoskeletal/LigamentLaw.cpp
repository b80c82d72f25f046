#include "genu/musculoskeletal/LigamentLaw.h"

#include <algorithm>
#include <cmath>

#include "Range.h"

namespace genu::musculoskeletal {

namespace {

void requireReference(double length_m, double tension_N, const char* stiffnessName, double stiffness, const char* unit, double toeStrain) {
  require(length_m > 0, "ligament: length in the reference pose", length_m, "m", "> 0 m");
  require(tension_N >= 0, "ligament: tension in the reference pose", tension_N, "N", ">= 0 N");
  require(stiffness > 0, stiffnessName, stiffness, unit, "> 0");
  require(toeStrain >= 0 && toeStrain < 1, "ligament: toe strain", toeStrain, "", "0 to below 1");
}

}  // namespace

void LigamentLaw::validate() const {
  require(stiffness_N > 0, "ligament: stiffness", stiffness_N, "N per unit strain", "> 0 N");
  require(slackLength_m > 0, "ligament: slack length", slackLength_m, "m", "> 0 m");
  require(toeStrain >= 0 && toeStrain < 1, "ligament: toe strain", toeStrain, "", "0 to below 1");
  require(dampingTime_s >= 0, "ligament: damping time", dampingTime_s, "s", ">= 0 s");
}

LigamentResponse calcResponse(const LigamentLaw& law, double length_m, double rate_MPerS) {
  LigamentResponse r;
  const double L0 = law.slackLength_m, k = law.stiffness_N, toe = law.toeStrain;
  const double e = (length_m - L0) / L0;
  if (!(e > 0)) return r;
  double f = 0, slope = 0, work = 0;  // work: the integral of f over e
  if (e < 2 * toe) {
    f = e * e / (4 * toe);
    slope = e / (2 * toe);
    work = e * e * e / (12 * toe);
  } else {
    f = e - toe;
    slope = 1;
    work = (2.0 / 3) * toe * toe + 0.5 * (e - 2 * toe) * e;
  }
  const double strainRate_perS = rate_MPerS / L0, factor = std::max(0.0, 1 + law.dampingTime_s * strainRate_perS);
  r.tension_N = k * f * factor;
  r.dTdL_NPerM = k * slope * factor / L0;
  r.dTdRate_NSPerM = factor > 0 ? k * f * law.dampingTime_s / L0 : 0;
  r.energy_J = k * work * L0;
  r.dissipation_W = k * f * (factor - 1) * rate_MPerS;
  return r;
}

double calcSlackLengthFromStrain_m(double referenceLength_m, double referenceStrain) {
  require(referenceLength_m > 0, "ligament: length in the reference pose", referenceLength_m, "m", "> 0 m");
  require(referenceStrain > -1, "ligament: strain in the reference pose", referenceStrain, "", "above -1");
  return referenceLength_m / (1 + referenceStrain);
}

double calcSlackLengthFromTension_m(double referenceLength_m, double referenceTension_N, double stiffness_N, double toeStrain) {
  requireReference(referenceLength_m, referenceTension_N, "ligament: stiffness", stiffness_N, "N per unit strain", toeStrain);
  const double f = referenceTension_N / stiffness_N;
  return referenceLength_m / (1 + (f < toeStrain ? 2 * std::sqrt(f * toeStrain) : f + toeStrain));
}

double calcSlackLengthFromTensionPerLength_m(double referenceLength_m, double referenceTension_N, double stiffness_NPerM, double toeStrain) {
  requireReference(referenceLength_m, referenceTension_N, "ligament: stiffness", stiffness_NPerM, "N/m", toeStrain);
  // T = K L0 f(e) and L0 = L/(1 + e):  f(e) = phi (1 + e), phi = T/(K L).
  const double phi = referenceTension_N / (stiffness_NPerM * referenceLength_m);
  require(phi < 1, "ligament: tension in the reference pose over stiffness times length", phi, "", "below 1");
  const double inToe = 2 * (toeStrain * phi + std::sqrt(toeStrain * phi * (toeStrain * phi + 1)));
  const double e = inToe < 2 * toeStrain ? inToe : (phi + toeStrain) / (1 - phi);
  return referenceLength_m / (1 + e);
}

}  // namespace genu::musculoskeletal
