#include "genu/contact/PressureLaw.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "contact/Scenes.h"

namespace genu::contact {
namespace {

using test::uhmwpe;
using test::uhmwpePowerLaw;

LayerResponse respond(const PressureLaw& law, double d, double h) {
  return std::visit([&](const auto& l) { return l.template calcResponse<true>(d, h); }, law);
}

struct LawCase {
  const char* name;
  Material material;
  StrainMeasure strain;
};

Material powerWith(double n, MaterialLaw law = MaterialLaw::powerLaw) {
  Material m = uhmwpePowerLaw(law);
  m.n = n;
  return m;
}

class EveryLaw : public testing::TestWithParam<LawCase> {};

TEST_P(EveryLaw, SlopeAndEnergyAreConsistentEverywhere) {
  const PressureLaw law = makePressureLaw(GetParam().material, GetParam().strain);
  const double h = 0.006;
  for (const double e : {1e-8, 1e-5, 1e-3, 0.01, 0.1, 0.4, 0.8, 0.9499, 0.9501, 1.0, 1.7, 5.0}) {
    const double d = e * h, step = 1e-5 * d;
    const auto r = respond(law, d, h), lo = respond(law, d - step, h), hi = respond(law, d + step, h);
    // Central differences: truncation (1e-5)^2 of the value times the law's curvature (< 100 below 0.95 of log),
    // rounding 1e-16/1e-5.
    EXPECT_NEAR((hi.p_Pa - lo.p_Pa) / (2 * step) / r.dpdd_PaPerM, 1, 2e-8) << e;
    EXPECT_NEAR((hi.energy_JPerM2 - lo.energy_JPerM2) / (2 * step) / r.p_Pa, 1, 2e-8) << e;
    EXPECT_EQ(r.extrapolated, e > 0.95);
    EXPECT_TRUE(std::isfinite(r.p_Pa));
    EXPECT_GT(r.p_Pa, 0);
  }
}

TEST_P(EveryLaw, ContinuationIsC1) {
  const PressureLaw law = makePressureLaw(GetParam().material, GetParam().strain);
  const double h = 0.006, d = kExtrapolationStrain * h, step = 1e-12 * d;
  const auto below = respond(law, d - step, h), above = respond(law, d + step, h);
  EXPECT_NEAR(below.p_Pa / above.p_Pa, 1, 1e-9);
  EXPECT_NEAR(below.dpdd_PaPerM / above.dpdd_PaPerM, 1, 1e-9);
  EXPECT_NEAR(below.energy_JPerM2 / above.energy_JPerM2, 1, 1e-9);
}

TEST_P(EveryLaw, NoPenetrationGivesExactlyZero) {
  const PressureLaw law = makePressureLaw(GetParam().material, GetParam().strain);
  for (const double d : {0.0, -1e-9, -1.0}) {
    const auto r = respond(law, d, 0.006);
    EXPECT_EQ(r.p_Pa, 0);
    EXPECT_EQ(r.dpdd_PaPerM, 0);
    EXPECT_EQ(r.energy_JPerM2, 0);
    EXPECT_FALSE(r.extrapolated);
  }
}

TEST_P(EveryLaw, MatchesItsOwnEquation) {
  const Material& m = GetParam().material;
  const PressureLaw law = makePressureLaw(m, GetParam().strain);
  const double c = m.confinementFactor();
  for (const double e : {1e-6, 0.01, 0.05, 0.3, 0.9}) {
    const double x = GetParam().strain == StrainMeasure::small ? e : -std::log(1 - e);
    const double p = respond(law, e * 0.006, 0.006).p_Pa;
    if (m.law == MaterialLaw::linear) {
      EXPECT_NEAR(p / (c * m.E_Pa * x), 1, 1e-10);  // log(1 - e) in the test loses digits at 1e-6
    } else {
      const double s = p / m.p0_Pa, factor = m.law == MaterialLaw::powerLaw ? m.n : 1;
      EXPECT_NEAR(0.5 * m.eps0 * (s + factor * std::pow(s, m.n)) / (c * x), 1, 1e-10);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, EveryLaw,
    testing::Values(LawCase{"linear_small", uhmwpe(), StrainMeasure::small}, LawCase{"linear_large", uhmwpe(), StrainMeasure::large},
                    LawCase{"power_small", uhmwpePowerLaw(), StrainMeasure::small},
                    LawCase{"power_large", uhmwpePowerLaw(), StrainMeasure::large},
                    LawCase{"power_n2p5_small", powerWith(2.5), StrainMeasure::small},
                    LawCase{"power_n2p5_large", powerWith(2.5), StrainMeasure::large},
                    LawCase{"consistent_small", uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::small},
                    LawCase{"consistent_large", uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::large},
                    LawCase{"consistent_n20_large", powerWith(20, MaterialLaw::powerLawConsistent), StrainMeasure::large}),
    [](const auto& test_info) { return test_info.param.name; });

TEST(PowerLaw, WithExponentOneIsLinearWithModulusP0OverEps0) {
  Material linear = uhmwpe();
  linear.E_Pa = 18.4e6 / 0.0597;
  for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
    for (const MaterialLaw law : {MaterialLaw::powerLaw, MaterialLaw::powerLawConsistent}) {
      const auto a = makePressureLaw(powerWith(1, law), strain), b = makePressureLaw(linear, strain);
      for (const double e : {1e-6, 0.1, 0.9, 1.2}) {
        const auto ra = respond(a, e * 0.006, 0.006), rb = respond(b, e * 0.006, 0.006);
        EXPECT_NEAR(ra.p_Pa / rb.p_Pa, 1, 1e-14);
        EXPECT_NEAR(ra.energy_JPerM2 / rb.energy_JPerM2, 1, 1e-9);
      }
    }
  }
}

TEST(PowerLaw, RootsAreSolvedOverTheWholeRange) {
  for (const double n : {1.0001, 1.5, 2.0, 3.0, 5.0, 20.0, 50.0}) {
    const PowerLawLayer law(powerWith(n), StrainMeasure::small);
    for (double y = 1e-18; y < 1e7; y *= 10) {
      const double s = law.solve(y);
      // Condition of s^n: a relative rounding of s is amplified n times.
      EXPECT_NEAR((s + n * std::pow(s, n)) / y, 1, 1e-15 * (8 + 2 * n)) << "n " << n << " y " << y;
    }
  }
}

TEST(PowerLaw, PrintedFormAgreesWithTable4AndConsistentFormDoesNot) {
  // Table 4, medial, nonlinear: 15.58 MPa at a strain near 1.7 % (the linear run's depth scaled with the area).
  const double h = 1, e = 0.0170;
  EXPECT_NEAR(respond(makePressureLaw(uhmwpePowerLaw(), StrainMeasure::small), e * h, h).p_Pa, 15.58e6, 0.3e6);
  EXPECT_GT(respond(makePressureLaw(uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::small), e * h, h).p_Pa, 20e6);
}

TEST(SeriesLayers, OfOneMaterialIsOneLayerOfSummedThickness) {
  for (const Material& m : {uhmwpe(), uhmwpePowerLaw(), powerWith(2.5, MaterialLaw::powerLawConsistent)}) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers series(m, m, strain);
      const PressureLaw single = makePressureLaw(m, strain);
      for (const double d : {1e-7, 1e-4, 1e-3, 2.5e-3}) {
        const LayerResponse a = series.calcResponse(d, 0.002, 0.001), b = respond(single, d, 0.003);
        EXPECT_NEAR(a.p_Pa / b.p_Pa, 1, 1e-12);
        EXPECT_NEAR(a.dpdd_PaPerM / b.dpdd_PaPerM, 1, 1e-11);
        EXPECT_NEAR(a.energy_JPerM2 / b.energy_JPerM2, 1, 1e-11);
      }
    }
  }
}

TEST(SeriesLayers, AddCompliances) {
  Material soft = test::cartilage(), hard = uhmwpe();
  const SeriesLayers series(soft, hard, StrainMeasure::small);
  const double Ks = soft.confinementFactor() * soft.E_Pa, Kh = hard.confinementFactor() * hard.E_Pa;
  const auto r = series.calcResponse(1e-4, 0.002, 0.008);
  EXPECT_NEAR(r.p_Pa, 1e-4 / (0.002 / Ks + 0.008 / Kh), 1e-9 * r.p_Pa);
  EXPECT_NEAR(r.energy_JPerM2, 0.5 * r.p_Pa * 1e-4, 1e-9 * r.energy_JPerM2);
}

TEST(Material, RejectsWhatHasNoMeaning) {
  const auto message = [](Material m) {
    try {
      m.validate();
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  Material m = uhmwpe();
  m.nu = 0.5;
  EXPECT_NE(message(m).find("nu = 0.5"), std::string::npos);
  m = uhmwpe();
  m.E_Pa = -1;
  EXPECT_NE(message(m).find("E [Pa] = -1"), std::string::npos);
  m = uhmwpePowerLaw();
  m.n = 0.5;
  EXPECT_NE(message(m).find("n = 0.5"), std::string::npos);
  EXPECT_EQ(message(uhmwpePowerLaw()), "");
}

}  // namespace
}  // namespace genu::contact
