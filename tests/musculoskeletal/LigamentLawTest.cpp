#include "genu/musculoskeletal/LigamentLaw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "Refusal.h"

namespace genu::musculoskeletal {
namespace {

using testing::HasSubstr;

LigamentLaw acl(double dampingTime_s = 0) { return {5000, 0.030, 0.03, dampingTime_s}; }

double atStrain(const LigamentLaw& law, double e) { return law.slackLength_m * (1 + e); }

TEST(LigamentLaw, IsTheToeLinearLaw) {
  const LigamentLaw law = acl();
  // k e^2/(4 eps_l) and k (e - eps_l), by hand.
  EXPECT_EQ(calcResponse(law, atStrain(law, -0.2)).tension_N, 0);
  EXPECT_EQ(calcResponse(law, law.slackLength_m).tension_N, 0);
  EXPECT_NEAR(calcResponse(law, atStrain(law, 0.03)).tension_N, 5000 * 0.0009 / 0.12, 1e-9);
  EXPECT_NEAR(calcResponse(law, atStrain(law, 0.06)).tension_N, 150, 1e-9);
  EXPECT_NEAR(calcResponse(law, atStrain(law, 0.10)).tension_N, 350, 1e-9);
  // The transition strain of OpenSim's form, e_t = 0.06: at it the tension is k e_t/2 in both.
  EXPECT_NEAR(calcResponse(law, atStrain(law, 0.06)).tension_N, 5000 * 0.06 / 2, 1e-9);
}

TEST(LigamentLaw, DerivativesAndEnergyAreThoseOfTheTension) {
  for (const double tau : {0.0, 0.02}) {
    const LigamentLaw law = acl(tau);
    for (const double rate : {-0.3, -0.05, 0.0, 0.2}) {
      for (double e = -0.0493; e < 0.15; e += 0.01) {
        const double L = atStrain(law, e), h = 1e-7, hRate = 1e-5;
        const LigamentResponse r = calcResponse(law, L, rate);
        const auto tension = [&](double dL, double dRate) { return calcResponse(law, L + dL, rate + dRate).tension_N; };
        // Quadratic and linear in L, linear in the rate: central differences are exact but for rounding, 1e-16 of 1000 N over the step.
        EXPECT_NEAR(r.dTdL_NPerM, (tension(h, 0) - tension(-h, 0)) / (2 * h), 1e-6 * 2e5);
        EXPECT_NEAR(r.dTdRate_NSPerM, (tension(0, hRate) - tension(0, -hRate)) / (2 * hRate), 1e-7);
        const double elastic = calcResponse(law, L).tension_N;
        const double slope = (calcResponse(law, L + h).energy_J - calcResponse(law, L - h).energy_J) / (2 * h);
        EXPECT_NEAR(slope, elastic, 1e-6);  // rounding 1e-16 J over 1e-7 m; the third derivative k/(eps L0^2) times h^2 is 1e-6 of that
        EXPECT_NEAR(r.dissipation_W, (r.tension_N - elastic) * rate, 1e-12);
        EXPECT_GE(r.dissipation_W, 0);
        EXPECT_GE(r.tension_N, 0);
      }
    }
  }
}

TEST(LigamentLaw, IsContinuouslyDifferentiableAtSlackAndAtTheEndOfTheToe) {
  const LigamentLaw law = acl(0.05);
  for (const double e : {0.0, 0.06}) {
    for (const double rate : {-0.2, 0.0, 0.5}) {
      const double L = atStrain(law, e), h = 1e-12;
      const LigamentResponse below = calcResponse(law, L - h, rate), above = calcResponse(law, L + h, rate);
      // The second derivative is k factor/(2 eps L0^2), 1e8 N/m^2: times 2e-12 m.
      EXPECT_NEAR(below.tension_N, above.tension_N, 1e-6);
      EXPECT_NEAR(below.dTdL_NPerM, above.dTdL_NPerM, 1e-3);
      EXPECT_NEAR(below.dTdRate_NSPerM, above.dTdRate_NSPerM, 1e-6);
    }
  }
}

TEST(LigamentLaw, AFastReleaseDoesNotPush) {
  const LigamentLaw law = acl(1);
  const LigamentResponse r = calcResponse(law, atStrain(law, 0.05), -1);
  EXPECT_EQ(r.tension_N, 0);
  EXPECT_EQ(r.dTdRate_NSPerM, 0);
  EXPECT_NEAR(r.dissipation_W, calcResponse(law, atStrain(law, 0.05)).tension_N * 1, 1e-12);
}

TEST(LigamentLaw, WithoutToeIsALine) {
  const LigamentLaw law = {2000, 0.05, 0, 0};
  EXPECT_NEAR(calcResponse(law, 0.051).tension_N, 40, 1e-10);
  EXPECT_NEAR(calcResponse(law, 0.051).energy_J, 0.5 * 40 * 0.001, 1e-13);
}

TEST(LigamentLaw, SlackFromAReferencePoseGivesBackWhatWasSaid) {
  const double L = 0.0347, toe = 0.03, k = 4000, K = 120e3;
  for (const double strain : {-0.15, 0.0, 0.02, 0.08}) {
    const LigamentLaw law = {k, calcSlackLengthFromStrain_m(L, strain), toe, 0};
    EXPECT_NEAR(L / law.slackLength_m - 1, strain, 1e-15);
  }
  for (const double tension : {0.0, 1e-6, 3.0, 119.0, 121.0, 800.0}) {  // the toe ends at 120 N
    const LigamentLaw law = {k, calcSlackLengthFromTension_m(L, tension, k, toe), toe, 0};
    EXPECT_NEAR(calcResponse(law, L).tension_N, tension, 1e-10);
    const double L0 = calcSlackLengthFromTensionPerLength_m(L, tension, K, toe);
    EXPECT_NEAR(calcResponse({K * L0, L0, toe, 0}, L).tension_N, tension, 1e-10);
  }
}

TEST(LigamentLaw, RefusesWhatHasNoMeaning) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message([] { LigamentLaw{-5, 0.03}.validate(); }), HasSubstr("stiffness = -5 N per unit strain is not allowed; allowed: > 0 N"));
  EXPECT_THAT(message([] { LigamentLaw{5, -0.03}.validate(); }), HasSubstr("slack length = -0.03 m is not allowed; allowed: > 0 m"));
  EXPECT_THAT(message([&] { LigamentLaw{nan, 0.03}.validate(); }), HasSubstr("stiffness = nan"));
  EXPECT_THAT(message([] { LigamentLaw{5, 0.03, 1.0}.validate(); }), HasSubstr("toe strain = 1 is not allowed"));
  EXPECT_THAT(message([] { LigamentLaw{5, 0.03, 0.03, -1}.validate(); }), HasSubstr("damping time = -1 s"));
  EXPECT_THAT(message([] { calcSlackLengthFromStrain_m(0.03, -1); }), HasSubstr("strain in the reference pose = -1"));
  EXPECT_THAT(message([] { calcSlackLengthFromStrain_m(0, 0.1); }), HasSubstr("length in the reference pose = 0 m"));
  EXPECT_THAT(message([] { calcSlackLengthFromTension_m(0.03, -1, 100, 0.03); }), HasSubstr("tension in the reference pose = -1 N"));
  EXPECT_THAT(message([] { calcSlackLengthFromTensionPerLength_m(0.03, 4000, 120e3, 0.03); }), HasSubstr("allowed: below 1"));
  acl().validate();
}

}  // namespace
}  // namespace genu::musculoskeletal
