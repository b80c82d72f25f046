#include "genu/musculoskeletal/Muscle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "Refusal.h"

namespace genu::musculoskeletal {
namespace {

using testing::HasSubstr;

/** Numbers of a vastus. */
Muscle vastus(double pennation_rad = 0.25) { return {1500, 0.09, 0.12, pennation_rad, 10, 0.1, {}}; }

TEST(RigidTendon, IsTheProductOfItsCurves) {
  const Muscle m = vastus(0);
  // Isometric at optimal length, full activation: F0 (f_l(1) + f_p(1)).
  const double expected = 1500 * (m.curves.calcActive(1).value + m.curves.calcPassive(1).value);
  EXPECT_NEAR(calcRigidTendon(m, 1, 0.21, 0).tension_N, expected, 1e-9);
  // Half activation, at a quarter of the largest velocity, lengthening and shortening.
  for (const double v : {-0.25, 0.25}) {
    const double f = 0.5 * m.curves.calcActive(1).value * m.curves.calcVelocity(v).value + m.curves.calcPassive(1).value + 0.1 * v;
    EXPECT_NEAR(calcRigidTendon(m, 0.5, 0.21, v * 0.9).tension_N, std::max(0.0, 1500 * f), 1e-9);
  }
  // Pennated: at optimal fibre length the path is lo cos(alpha0) + Ls.
  const Muscle p = vastus(0.4);
  const MuscleResponse r = calcRigidTendon(p, 1, 0.09 * std::cos(0.4) + 0.12, 0);
  EXPECT_NEAR(r.fibreLength_m, 0.09, 1e-15);
  EXPECT_NEAR(r.cosPennation, std::cos(0.4), 1e-15);
  EXPECT_NEAR(r.tension_N, expected * std::cos(0.4), 1e-9);
}

TEST(RigidTendon, DerivativesAreThoseOfTheTension) {
  for (const double pennation : {0.0, 0.3, 0.6}) {
    const Muscle m = vastus(pennation);
    for (double L = 0.17; L < 0.28; L += 0.011) {
      for (const double rate : {-0.4, 0.0, 0.5}) {
        for (const double a : {0.1, 0.7}) {
          const MuscleResponse r = calcRigidTendon(m, a, L, rate);
          const auto T = [&](double da, double dL, double dRate) { return calcRigidTendon(m, a + da, L + dL, rate + dRate).tension_N; };
          if (T(0, 1e-6, 1e-4) == 0) continue;  // cut off
          // Central differences: step^2 of the third derivative, 1e5 N/m^3 x 10^3 at most, and rounding 1e-13 N over the step.
          EXPECT_NEAR(r.dTdL_NPerM, (T(0, 1e-6, 0) - T(0, -1e-6, 0)) / 2e-6, 1e-3) << L << " " << rate;
          EXPECT_NEAR(r.dTdRate_NSPerM, (T(0, 0, 1e-5) - T(0, 0, -1e-5)) / 2e-5, 1e-4);
          EXPECT_NEAR(r.dTdActivation_N, (T(1e-5, 0, 0) - T(-1e-5, 0, 0)) / 2e-5, 1e-6);
        }
      }
    }
  }
}

TEST(RigidTendon, PathsShorterThanTheTendonPullWithNothing) {
  const Muscle m = vastus();
  for (const double L : {0.12, 0.1, 0.0}) {
    const MuscleResponse r = calcRigidTendon(m, 1, L, -1);
    EXPECT_EQ(r.tension_N, 0);
    EXPECT_EQ(r.state, MuscleState::slack);
  }
  EXPECT_EQ(calcRigidTendon(m, 1, 0.121, 0).state, MuscleState::fibreTooShort);
  EXPECT_EQ(calcRigidTendon(m, 1, 0.30, 0).state, MuscleState::fibreTooLong);
  EXPECT_EQ(calcRigidTendon(m, 0, 0.21, -5).tension_N, 0);  // damping does not push
}

TEST(CompliantTendon, EquilibriumIsFoundFromAnyParameters) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  int found = 0, slack = 0, tooShort = 0;
  for (int i = 0; i < 20000; ++i) {
    Muscle m = vastus(0.7 * unit(random));
    m.optimalFibreLength_m = 0.02 + 0.4 * unit(random);
    m.tendonSlackLength_m = 0.005 + 0.4 * unit(random);
    m.curves.tendonStrain = 0.02 + 0.1 * unit(random);
    const double a = i % 10 == 0 ? 0 : unit(random), L = (0.6 + unit(random)) * (m.optimalFibreLength_m + m.tendonSlackLength_m);
    const FibreEquilibrium e = findFibreEquilibrium(m, a, L);
    if (e.state == MuscleState::slack) {
      ++slack;
      EXPECT_EQ(calcCompliantTendon(m, a, e.fibreLength_m, L).tension_N, 0);
      continue;
    }
    if (e.state == MuscleState::fibreTooShort) {
      ++tooShort;
      EXPECT_GE(e.residual, 0);
      continue;
    }
    ++found;
    // 1e-14 of the fibre's length times the stiffest tendon: f_t' x lo/Ls, up to 500 x 80, more where it is stretched far.
    const MuscleResponse r = calcCompliantTendon(m, a, e.fibreLength_m, L);
    const double stiffness = 1 + r.dTdL_NPerM * m.optimalFibreLength_m / m.maxIsometricForce_N;
    EXPECT_LT(std::abs(e.residual), 1e-12 * stiffness);
    EXPECT_NEAR(r.fibreVelocity_MPerS / (10 * m.optimalFibreLength_m), 0, 1e-10 * stiffness) << "at rest";
    EXPECT_LE(e.iterations, 60);
  }
  EXPECT_GT(found, 10000);
  EXPECT_GT(slack, 100);
  std::printf("%d in balance, %d slack, %d with the shortest fibre\n", found, slack, tooShort);
}

TEST(CompliantTendon, StiffensToTheRigidOne) {
  // A tendon of strain eT differs from a rigid one by the fibre's change of length, of the order of eT.
  const double a = 0.6, L = 0.205;
  double before = 0;
  for (const double strain : {0.02, 0.01, 0.005}) {
    Muscle m = vastus();
    m.curves.tendonStrain = strain;
    const FibreEquilibrium e = findFibreEquilibrium(m, a, L);
    const double difference = calcCompliantTendon(m, a, e.fibreLength_m, L).tension_N - calcRigidTendon(m, a, L, 0).tension_N;
    if (before != 0) {
      EXPECT_NEAR(before / difference, 2, 0.15);
    }
    before = difference;
  }
}

TEST(CompliantTendon, VelocitySolvesTheBalance) {
  const Muscle m = vastus();
  for (const double a : {0.0, 0.01, 0.5, 1.0}) {
    for (double l = 0.03; l < 0.16; l += 0.01) {
      for (const double L : {0.17, 0.2, 0.23}) {
        const MuscleResponse r = calcCompliantTendon(m, a, l, L);
        if (r.fibreVelocity_MPerS == 0) continue;  // held at the shortest
        const double x = r.fibreLength_m / 0.09, v = r.fibreVelocity_MPerS / 0.9;
        const double f = a * m.curves.calcActive(x).value * m.curves.calcVelocity(v).value + m.curves.calcPassive(x).value + 0.1 * v;
        EXPECT_NEAR(1500 * f * r.cosPennation, r.tension_N, 1e-11 * (1500 + r.tension_N)) << a << " " << l << " " << L;
      }
    }
  }
}

TEST(CompliantTendon, FibreWorkIsWhatTheTendonDoesNotStore) {
  // Passive, quasi-static stretch of the path: the work of the tension is the change of the energy.
  const Muscle m = vastus(0.3);
  const auto at = [&](double L) { return calcCompliantTendon(m, 0, findFibreEquilibrium(m, 0, L).fibreLength_m, L); };
  for (const double L : {0.22, 0.24, 0.26}) {
    const double h = 1e-5;
    EXPECT_NEAR((at(L + h).energy_J - at(L - h).energy_J) / (2 * h), at(L).tension_N, 1e-5 * at(L).tension_N + 1e-6);
  }
}

TEST(ActivationDynamics, FollowsTheClosedFormOfTheSwitch) {
  const ActivationDynamics sharp = {0.015, 0.060, std::numeric_limits<double>::infinity()};
  EXPECT_NEAR(sharp.calcRate_perS(0.2, 0.9), 0.7 / (0.015 * 0.8), 1e-12);
  EXPECT_NEAR(sharp.calcRate_perS(0.9, 0.2), -0.7 * 1.85 / 0.060, 1e-12);
  EXPECT_EQ(sharp.calcRate_perS(0.4, 0.4), 0);
  const ActivationDynamics smooth;
  const double s = 0.5 * std::tanh(0.07);
  EXPECT_NEAR(smooth.calcRate_perS(0.2, 0.9), 0.7 * ((0.5 + s) / (0.015 * 0.8) + (0.5 - s) * 0.8 / 0.060), 1e-12);
  EXPECT_NEAR(millardActivation().calcRate_perS(0.2, 0.9), 0.7 / (0.010 * 0.8), 1e-12);
}

TEST(Muscle, RefusesWhatHasNoMeaning) {
  const auto refused = [](auto change, bool compliant = true) {
    Muscle m = vastus();
    change(m);
    return message([&] { m.validate(compliant); });
  };
  EXPECT_EQ(refused([](Muscle&) {}), "nothing was thrown");
  EXPECT_THAT(refused([](Muscle& m) { m.optimalFibreLength_m = 0; }), HasSubstr("optimal fibre length = 0 m is not allowed; allowed: > 0 m"));
  EXPECT_THAT(refused([](Muscle& m) { m.maxIsometricForce_N = -1; }), HasSubstr("largest isometric force = -1 N"));
  EXPECT_THAT(refused([](Muscle& m) { m.tendonSlackLength_m = 0; }), HasSubstr("tendon slack length = 0 m"));
  EXPECT_EQ(refused([](Muscle& m) { m.tendonSlackLength_m = 0; }, false), "nothing was thrown");
  EXPECT_THAT(refused([](Muscle& m) { m.pennationAtOptimal_rad = 1.5; }), HasSubstr("deg is not allowed; allowed: 0 to 80 deg"));
  EXPECT_THAT(refused([](Muscle& m) { m.fibreDamping = 0; }), HasSubstr("fibre damping = 0"));
  EXPECT_THAT(refused([](Muscle& m) { m.maxContractionVelocity_perS = std::nan(""); }), HasSubstr("velocity = nan"));
  EXPECT_THAT(message([] { ActivationDynamics{0, 0.06}.validate(); }), HasSubstr("activation time = 0 s"));
  EXPECT_THAT(message([] { ActivationDynamics{0.01, 0.06, 0}.validate(); }), HasSubstr("steepness"));
  millardActivation().validate();
  withMillardParameters(vastus()).validate(true);
}

}  // namespace
}  // namespace genu::musculoskeletal
