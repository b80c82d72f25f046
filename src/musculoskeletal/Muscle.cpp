#include "genu/musculoskeletal/Muscle.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "Range.h"

namespace genu::musculoskeletal {

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kLeastCosine = 0.1;  // of the pennation

double calcHeight_m(const Muscle& m) { return m.optimalFibreLength_m * std::sin(m.pennationAtOptimal_rad); }

double calcShortest_m(const Muscle& m) {
  return std::max(kShortestFibre * m.optimalFibreLength_m, calcHeight_m(m) / std::sqrt(1 - kLeastCosine * kLeastCosine));
}

double calcCosine(const Muscle& m, double fibreLength_m) {
  const double sine = calcHeight_m(m) / fibreLength_m;
  return std::sqrt(1 - sine * sine);
}

MuscleState classify(const Muscle& m, double fibreLength_m) {
  if (fibreLength_m < calcShortest_m(m)) return MuscleState::fibreTooShort;
  return fibreLength_m > kLongestFibre * m.optimalFibreLength_m ? MuscleState::fibreTooLong : MuscleState::ok;
}

/** Root of gain f_v(v) + beta v = force, gain and beta >= 0 and not both 0. */
double solveVelocity(const Muscle& m, double gain, double force) {
  if (m.fibreDamping == 0) return m.curves.calcVelocityOfForce(force / gain);
  const auto excess = [&](double v) { return gain * m.curves.calcVelocity(v).value + m.fibreDamping * v - force; };
  double low = -1, high = 1;
  while (excess(low) > 0) low *= 2;
  while (excess(high) < 0) high *= 2;
  double v = std::min(std::max(force / (gain + m.fibreDamping) - 1, low), high);
  // Newton where it stays in the bracket, halving otherwise and after 50 steps: the bracket closes, so that it always ends at the root.
  for (int k = 0;; ++k) {
    const double e = excess(v);
    (e > 0 ? high : low) = v;
    double next = v - e / (gain * m.curves.calcVelocity(v).slope + m.fibreDamping);
    if (k >= 50 || !(next > low && next < high)) next = 0.5 * (low + high);
    const double tolerance = 1e-15 * (1 + std::abs(v));
    if (std::abs(next - v) <= tolerance || !(high - low > tolerance)) return next;
    v = next;
  }
}

}  // namespace

const char* toString(MuscleState state) {
  switch (state) {
    case MuscleState::ok: return "ok";
    case MuscleState::slack: return "slack";
    case MuscleState::fibreTooShort: return "fibre_too_short";
    case MuscleState::fibreTooLong: return "fibre_too_long";
  }
  return "";
}

void Muscle::validate(bool compliantTendon) const {
  require(maxIsometricForce_N > 0, "muscle: largest isometric force", maxIsometricForce_N, "N", "> 0 N");
  require(optimalFibreLength_m > 0, "muscle: optimal fibre length", optimalFibreLength_m, "m", "> 0 m");
  require(tendonSlackLength_m > 0 || (tendonSlackLength_m == 0 && !compliantTendon), "muscle: tendon slack length", tendonSlackLength_m, "m",
          "> 0 m, or 0 m with a rigid tendon");
  require(pennationAtOptimal_rad >= 0 && pennationAtOptimal_rad <= 80 * kPi / 180, "muscle: pennation at optimal fibre length",
          pennationAtOptimal_rad * 180 / kPi, "deg", "0 to 80 deg");
  require(maxContractionVelocity_perS > 0, "muscle: largest contraction velocity", maxContractionVelocity_perS, "optimal lengths per second",
          "> 0");
  require(fibreDamping > 0 || (fibreDamping == 0 && !compliantTendon), "muscle: fibre damping", fibreDamping, "",
          "> 0, or 0 with a rigid tendon");
  curves.validate();
}

MuscleResponse calcRigidTendon(const Muscle& m, double activation, double length_m, double rate_MPerS) {
  MuscleResponse r;
  const double along_m = length_m - m.tendonSlackLength_m, height_m = calcHeight_m(m);
  if (!(along_m > 0)) {
    r.state = MuscleState::slack;
    r.fibreLength_m = height_m;
    r.cosPennation = 0;
    return r;
  }
  const double lo = m.optimalFibreLength_m, vMax = lo * m.maxContractionVelocity_perS;
  const double l = std::hypot(along_m, height_m), cosine = along_m / l;
  const double turn_perM = (1 - cosine) * (1 + cosine) / l;  // d(cosine)/dL
  const double v = rate_MPerS * cosine / vMax;
  const CurvePoint active = m.curves.calcActive(l / lo), passive = m.curves.calcPassive(l / lo), velocity = m.curves.calcVelocity(v);
  const double f = activation * active.value * velocity.value + passive.value + m.fibreDamping * v;
  r.fibreLength_m = l;
  r.fibreVelocity_MPerS = v * vMax;
  r.cosPennation = cosine;
  r.energy_J = m.maxIsometricForce_N * lo * m.curves.calcPassiveEnergy(l / lo);
  r.state = classify(m, l);
  if (!(f > 0)) return r;
  const double byVelocity = activation * active.value * velocity.slope + m.fibreDamping;
  const double byLength = (activation * active.slope * velocity.value + passive.slope) * cosine / lo + byVelocity * rate_MPerS * turn_perM / vMax;
  r.tension_N = m.maxIsometricForce_N * f * cosine;
  r.dTdL_NPerM = m.maxIsometricForce_N * (byLength * cosine + f * turn_perM);
  r.dTdRate_NSPerM = m.maxIsometricForce_N * byVelocity * cosine * cosine / vMax;
  r.dTdActivation_N = m.maxIsometricForce_N * cosine * active.value * velocity.value;
  return r;
}

MuscleResponse calcCompliantTendon(const Muscle& m, double activation, double fibreLength_m, double length_m) {
  MuscleResponse r;
  const double lo = m.optimalFibreLength_m, l = std::max(fibreLength_m, calcShortest_m(m));
  const double cosine = calcCosine(m, l), stretch = (length_m - l * cosine) / m.tendonSlackLength_m;
  const bool taut = stretch > 1;
  const CurvePoint tendon = taut ? m.curves.calcTendon(stretch) : CurvePoint{0, 0};
  const double gain = activation * m.curves.calcActive(l / lo).value;
  const double v = solveVelocity(m, gain, tendon.value / cosine - m.curves.calcPassive(l / lo).value);
  r.tension_N = m.maxIsometricForce_N * tendon.value;
  r.dTdL_NPerM = m.maxIsometricForce_N * tendon.slope / m.tendonSlackLength_m;
  r.fibreLength_m = l;
  r.fibreVelocity_MPerS = v * lo * m.maxContractionVelocity_perS;
  r.cosPennation = cosine;
  r.energy_J = m.maxIsometricForce_N * (lo * m.curves.calcPassiveEnergy(l / lo) +
                                        (taut ? m.tendonSlackLength_m * m.curves.calcTendonEnergy(stretch) : 0));
  r.state = taut ? classify(m, fibreLength_m) : MuscleState::slack;
  // A fibre at its shortest does not shorten further.
  if (!(fibreLength_m > l) && l == calcShortest_m(m)) r.fibreVelocity_MPerS = std::max(0.0, r.fibreVelocity_MPerS);
  return r;
}

FibreEquilibrium findFibreEquilibrium(const Muscle& m, double activation, double length_m) {
  FibreEquilibrium r;
  const double lo = m.optimalFibreLength_m, shortest = calcShortest_m(m);
  const auto excess = [&](double l) {  // of the fibre's pull over the tendon's
    const double cosine = calcCosine(m, l), stretch = (length_m - l * cosine) / m.tendonSlackLength_m;
    const double pull = activation * m.curves.calcActive(l / lo).value + m.curves.calcPassive(l / lo).value;
    return pull * cosine - (stretch > 1 ? m.curves.calcTendon(stretch).value : 0);
  };
  const double along_m = length_m - m.tendonSlackLength_m;
  const double longest = along_m > 0 ? std::hypot(along_m, calcHeight_m(m)) : 0;  // the tendon hangs from here on
  r.fibreLength_m = shortest;
  if (!(longest > shortest)) {
    r.state = MuscleState::slack;
    return r;
  }
  if (!(excess(shortest) < 0)) {
    r.state = MuscleState::fibreTooShort;
    r.residual = excess(shortest);
    return r;
  }
  constexpr int kSteps = 256;
  double low = shortest, high = longest;
  for (int k = 1; k <= kSteps; ++k) {
    const double l = k == kSteps ? longest : shortest + (longest - shortest) * k / kSteps;
    if (!(excess(l) < 0)) {
      high = l;
      break;
    }
    low = l;
  }
  while (high - low > 1e-14 * longest) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (excess(middle) < 0 ? low : high) = middle;
    ++r.iterations;
  }
  r.fibreLength_m = 0.5 * (low + high);
  r.residual = excess(r.fibreLength_m);
  r.state = classify(m, r.fibreLength_m);
  return r;
}

void ActivationDynamics::validate() const {
  require(activationTime_s > 0, "muscle: activation time", activationTime_s, "s", "> 0 s");
  require(deactivationTime_s > 0, "muscle: deactivation time", deactivationTime_s, "s", "> 0 s");
  if (!(steepness > 0)) require(false, "muscle: steepness of the activation's switch", steepness, "", "> 0");
}

double ActivationDynamics::calcRate_perS(double activation, double excitation) const {
  const double difference = excitation - activation, slow = 0.5 + 1.5 * activation;
  const double s = difference == 0 ? 0 : 0.5 * std::tanh(steepness * difference);
  return difference * ((0.5 + s) / (activationTime_s * slow) + (0.5 - s) * slow / deactivationTime_s);
}

Muscle withMillardParameters(Muscle muscle) {
  muscle.curves.tendonStrain = 0.049;
  muscle.curves.passiveStrain = 0.7;
  muscle.fibreDamping = 0.1;
  return muscle;
}

ActivationDynamics millardActivation() { return {0.010, 0.040, std::numeric_limits<double>::infinity()}; }

}  // namespace genu::musculoskeletal
