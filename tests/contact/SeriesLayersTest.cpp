// Two layers of different materials in series: the law itself, and both contact rules with it.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace test;

Material power(double n, MaterialLaw law = MaterialLaw::powerLaw) {
  Material m = uhmwpePowerLaw(law);
  m.n = n;
  return m;
}
Material soft(double E_Pa) {
  Material m = cartilage();
  m.E_Pa = E_Pa;
  return m;
}

/** Strain of one layer under a pressure, written out from PressureLaw.h, continuation included. */
double strainUnder(const Material& m, StrainMeasure strain, double p) {
  const double c = (1 - m.nu) / ((1 + m.nu) * (1 - 2 * m.nu));
  double x = p / (c * m.E_Pa);
  if (m.law != MaterialLaw::linear) {
    const double s = p / m.p0_Pa, factor = m.law == MaterialLaw::powerLaw ? m.n : 1;
    x = m.eps0 / (2 * c) * (s + factor * std::pow(s, m.n));
  }
  if (strain == StrainMeasure::small) return x;
  const double start = -std::log(1 - kExtrapolationStrain);
  return x <= start ? -std::expm1(-x) : kExtrapolationStrain + (x - start) * (1 - kExtrapolationStrain);
}

struct Pair {
  const char* name;
  Material fixed, moving;
};
const std::vector<Pair>& allPairs() {
  static const std::vector<Pair> pairs = {
      {"linear on linear", uhmwpe(), cartilage()},
      {"linear on power", cartilage(), power(3)},
      {"power on linear", power(2.5), uhmwpe()},
      {"power on power", power(3), power(7.3, MaterialLaw::powerLawConsistent)},
      {"steep on linear", power(20), cartilage()},
      {"moduli apart by 1e6", soft(1e3), soft(1e9)},
  };
  return pairs;
}

const std::vector<std::pair<double, double>>& allThicknesses() {  // [m]
  static const std::vector<std::pair<double, double>> all = {{0.002, 0.003}, {0.003, 1e-7}, {1e-7, 0.003}, {1e-7, 1e-7},
                                                             {0.01, 1e-12}, {0, 0.002},    {0.002, 0}};
  return all;
}

TEST(SeriesLayers, PressureCausesThePenetrationThatAsksForIt) {
  // Closed form the other way round: d(p) = hF eF(p) + hM eM(p). The condition of p(d) is d/(p d') <= 1 for laws that stiffen
  // under small strain; under large strain 1/(1 - e) <= 20 at e = 0.95. The test's own d carries 2e-16 per layer.
  for (const Pair& pair : allPairs()) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers series(pair.fixed, pair.moving, strain);
      for (const auto& [hF, hM] : allThicknesses()) {
        for (double p = 1e-3; p < 1e9; p *= 7) {
          const double eF = hF > 0 ? strainUnder(pair.fixed, strain, p) : 0, eM = hM > 0 ? strainUnder(pair.moving, strain, p) : 0;
          if (std::max(eF, eM) > kExtrapolationStrain) break;
          const auto r = series.calcResponse(hF * eF + hM * eM, hF, hM);
          EXPECT_NEAR(r.p_Pa / p, 1, strain == StrainMeasure::small ? 4e-15 : 4e-14) << pair.name << " " << hF << " " << hM << " p " << p;
          EXPECT_FALSE(r.extrapolated);
        }
      }
    }
  }
}

TEST(SeriesLayers, SlopeAndEnergyAreTheDerivativeAndTheIntegral) {
  for (const Pair& pair : allPairs()) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers series(pair.fixed, pair.moving, strain);
      for (const auto& [hF, hM] : allThicknesses()) {
        for (const double e : {1e-3, 0.05, 0.4, 0.8, 1.3}) {
          const double d = e * (hF + hM);
          const auto at = [&](double times) { return series.calcResponse(times * d, hF, hM); };
          const auto r = at(1);
          // Five-point differences of step 1e-4 d: p's fifth derivative is at most that of the logarithm at 0.95, 4!/(0.05)^5 e^5,
          // or n^5 of a power: 1e-16 x 1e6; rounding 1e-16/1e-4 x 10.
          const double k = 1e-4;
          const double slope = (at(1 - 2 * k).p_Pa - 8 * at(1 - k).p_Pa + 8 * at(1 + k).p_Pa - at(1 + 2 * k).p_Pa) / (12 * k * d);
          const double pressure = (at(1 - 2 * k).energy_JPerM2 - 8 * at(1 - k).energy_JPerM2 + 8 * at(1 + k).energy_JPerM2 -
                                   at(1 + 2 * k).energy_JPerM2) / (12 * k * d);
          EXPECT_NEAR(r.dpdd_PaPerM / slope, 1, 1e-8) << pair.name << " " << hF << " " << hM << " e " << e;
          EXPECT_NEAR(r.p_Pa / pressure, 1, 1e-8) << pair.name << " " << hF << " " << hM << " e " << e;
        }
        // And from 0, by Gauss-Legendre on pieces that shrink towards 0 (a pressure like d^(1/n) bends there).
        static const double x[] = {0, 0.5384693101056831, 0.9061798459386640}, w[] = {0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
        double end = 0.5 * (hF + hM);
        while (series.calcResponse(end, hF, hM).extrapolated) end *= 0.8;  // p' has a kink where the continuation starts
        double sum = 0, high = end;
        for (int i = 0; i < 250; ++i) {
          const double low = 0.9 * high, middle = 0.5 * (low + high), half = 0.5 * (high - low);
          for (int j = 0; j < 3; ++j) {
            sum += w[j] * half * series.calcResponse(middle + half * x[j], hF, hM).p_Pa;
            if (j > 0) sum += w[j] * half * series.calcResponse(middle - half * x[j], hF, hM).p_Pa;
          }
          high = low;
        }
        EXPECT_NEAR(series.calcResponse(end, hF, hM).energy_JPerM2 / sum, 1, 1e-8) << pair.name << " " << hF << " " << hM;
      }
    }
  }
}

TEST(SeriesLayers, SlopesByThickness) {
  for (const Pair& pair : allPairs()) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers series(pair.fixed, pair.moving, strain);
      const double hF = 0.002, hM = 0.003;
      for (const double d : {1e-5, 3e-4, 2e-3, 4e-3}) {
        const auto r = series.calcResponse(d, hF, hM);
        const double k = 1e-4;  // five points, as above
        const auto slope = [&](bool fixed) {
          const auto p = [&](double times) {
            return series.calcResponse(d, fixed ? hF * (1 + times * k) : hF, fixed ? hM : hM * (1 + times * k)).p_Pa;
          };
          return (p(-2) - 8 * p(-1) + 8 * p(1) - p(2)) / (12 * k * (fixed ? hF : hM));
        };
        // Of a hard layer's compliance 1e-6 of the sum's little is left in a difference: against the larger slope.
        const double scale = 1e-8 * std::max(std::abs(r.dpdhF_PaPerM), std::abs(r.dpdhM_PaPerM)) ;
        EXPECT_NEAR(r.dpdhF_PaPerM, slope(true), scale) << pair.name << " " << d;
        EXPECT_NEAR(r.dpdhM_PaPerM, slope(false), scale) << pair.name << " " << d;
        // p depends on ratios of lengths: d p_d + hF p_hF + hM p_hM = 0 (Euler).
        EXPECT_NEAR((hF * r.dpdhF_PaPerM + hM * r.dpdhM_PaPerM) / (d * r.dpdd_PaPerM), -1, 1e-13);
      }
      // A layer that is not there yet: the slope where it begins.
      const auto none = series.calcResponse(3e-4, hF, 0), thin = series.calcResponse(3e-4, hF, 1e-12);
      EXPECT_NEAR(none.dpdhM_PaPerM / thin.dpdhM_PaPerM, 1, 1e-6);
      EXPECT_EQ(series.calcResponse<false>(3e-4, hF, hM).p_Pa, series.calcResponse<true>(3e-4, hF, hM).p_Pa);
    }
  }
}

TEST(SeriesLayers, AThinLayerFadesAway) {
  // h -> 0 of one layer: p is that of the other alone, pressed less by what the thin one gives way. Exactly zero is the limit itself.
  for (const Pair& pair : allPairs()) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers series(pair.fixed, pair.moving, strain);
      const PressureLaw alone = makePressureLaw(pair.fixed, strain);
      const double hF = 0.002, d = 0.0003;
      const auto limit = std::visit([&](const auto& l) { return l.template calcResponse<true>(d, hF); }, alone);
      EXPECT_EQ(series.calcResponse(d, hF, 0).p_Pa, limit.p_Pa);
      EXPECT_EQ(series.calcResponse(d, hF, 0).energy_JPerM2, limit.energy_JPerM2);
      for (const double hM : {1e-7, 1e-10, 1e-14}) {
        const auto r = series.calcResponse(d, hF, hM);
        const double left = d - hM * strainUnder(pair.moving, strain, r.p_Pa);
        const double expected = std::visit([&](const auto& l) { return l.template calcResponse<true>(left, hF).p_Pa; }, alone);
        EXPECT_LE(r.p_Pa, limit.p_Pa * (1 + 1e-15));
        EXPECT_NEAR(r.p_Pa / expected, 1, 1e-13) << pair.name << " " << hM;
      }
    }
  }
}

TEST(SeriesLayers, ExchangeAndScale) {
  for (const Pair& pair : allPairs()) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      const SeriesLayers a(pair.fixed, pair.moving, strain), b(pair.moving, pair.fixed, strain);
      double last = 0;
      for (const double d : {1e-9, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 6e-3}) {
        const auto r = a.calcResponse(d, 0.002, 0.003), s = b.calcResponse(d, 0.003, 0.002);
        EXPECT_NEAR(r.p_Pa / s.p_Pa, 1, 1e-14);
        EXPECT_NEAR(r.energy_JPerM2 / s.energy_JPerM2, 1, 1e-13);
        EXPECT_GT(r.p_Pa, last);
        last = r.p_Pa;
        const auto scaled = a.calcResponse(7 * d, 0.014, 0.021);  // p depends on ratios of lengths only
        EXPECT_NEAR(scaled.p_Pa / r.p_Pa, 1, 1e-13);
        EXPECT_NEAR(7 * scaled.dpdd_PaPerM / r.dpdd_PaPerM, 1, 1e-12);
        EXPECT_NEAR(scaled.energy_JPerM2 / (7 * r.energy_JPerM2), 1, 1e-12);
      }
    }
  }
}

TEST(SeriesLayers, OneLayerBeyondItsRangeFlagsThePair) {
  // The soft layer is at its limit long before the sum of both is; there p and p' go on continuously.
  const Material hard = uhmwpe();
  const SeriesLayers series(soft(1e5), hard, StrainMeasure::large);
  const double K = soft(1e5).confinementFactor() * 1e5, hF = 0.001, hM = 0.009;
  const double limit_Pa = -K * std::log(1 - kExtrapolationStrain);
  const double d = hF * kExtrapolationStrain + hM * strainUnder(hard, StrainMeasure::large, limit_Pa);
  ASSERT_LT(d / (hF + hM), 0.1);
  const auto below = series.calcResponse(d * (1 - 1e-9), hF, hM), above = series.calcResponse(d * (1 + 1e-9), hF, hM);
  EXPECT_FALSE(below.extrapolated);
  EXPECT_TRUE(above.extrapolated);
  EXPECT_NEAR(above.p_Pa / below.p_Pa, 1, 1e-7);
  EXPECT_NEAR(above.dpdd_PaPerM / below.dpdd_PaPerM, 1, 1e-6);
}

// ---- in contact ---------------------------------------------------------------------------------------------------------

/** A sphere with its own layer on a flat layer. */
ContactPairDefinition makeLayeredSphere(const Pair& pair, StrainMeasure strain, double hF, double hM) {
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.1)), share(makeSphere(0.030)), constantThickness(hF), pair.fixed, 0.005, 40);
  d.movingThickness = constantThickness(hM);
  d.movingMaterial = pair.moving;
  d.strain = strain;
  return d;
}

TEST(SeriesContact, LinearLayersAreOneOfTheSummedCompliance) {
  // R1 of ReferenceCasesTest with K/h -> 1/(hF/KF + hM/KM).
  const double R = 0.030, D = 0.2e-3, h = 0.006;
  for (const auto& [hF, hM] : std::vector<std::pair<double, double>>{{0.004, 0.002}, {0.006, 1e-7}}) {
    const Pair pair{"", uhmwpe(), cartilage()};
    const double KF = uhmwpe().confinementFactor() * uhmwpe().E_Pa, KM = cartilage().confinementFactor() * cartilage().E_Pa;
    const double exact = kPi * D * D / (hF / KF + hM / KM) * (R - 2 * D / 3);
    auto d = makeLayeredSphere(pair, StrainMeasure::small, hF, hM);
    const auto smooth = ContactPair(d).evaluate(JointCoordinates{0, 0, 0, 0, h + R - D, 0});
    EXPECT_NEAR(smooth.total.forceOnM_F.y() / exact, 1, 1e-6);
    d.rule = ContactRule::centre;
    d.compartments[0].nx = d.compartments[0].nz = 400;
    const auto centre = ContactPair(d).evaluate(JointCoordinates{0, 0, 0, 0, h + R - D, 0});
    EXPECT_NEAR(centre.total.forceOnM_F.y() / exact, 1, 2e-5);  // N^-2.5 with N = 138: 4.5e-6, phases up to 4 times it
  }
}

TEST(SeriesContact, NonlinearLayersAreTheQuadrature) {
  // F = 2 pi int p(d) cos(theta/2) rho drho, as R2 of ReferenceCasesTest, p by bisection of d(p).
  const double R = 0.030, D = 0.2e-3, h = 0.006, a = R - D;
  for (const Pair& pair : {Pair{"", cartilage(), power(3)}, Pair{"", power(2.5), power(5, MaterialLaw::powerLawConsistent)}}) {
    for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
      for (const auto& [hF, hM] : std::vector<std::pair<double, double>>{{0.0008, 0.0004}, {0.001, 1e-7}}) {
        const auto integrand = [&](double rho) {
          const double half = std::cos(0.5 * std::acos(std::min(1.0, a / rho))), d = (R - rho) / half;
          double low = 0, high = 1e10;
          for (int i = 0; i < 200; ++i) {
            const double p = 0.5 * (low + high);
            (hF * strainUnder(pair.fixed, strain, p) + hM * strainUnder(pair.moving, strain, p) < d ? low : high) = p;
          }
          return 2 * kPi * low * half * rho;
        };
        // p ~ d^(1/n) only above s = 1; near the rim every law is linear. Simpson with 2000 pieces.
        double exact = 0;
        constexpr int kPieces = 2000;
        const double step = D / kPieces;
        for (int i = 0; i <= kPieces; ++i) exact += (i == 0 || i == kPieces ? 1 : i % 2 == 1 ? 4 : 2) * step / 3 * integrand(a + i * step);
        const auto definition = makeLayeredSphere(pair, strain, hF, hM);
        const auto r = ContactPair(definition).evaluate(JointCoordinates{0.3, 0.2, 0.1, 0, h + R - D, 0});
        // The power laws bend at s = 1, within one cell of the rim on stiff layers: 1e-5 instead of the linear law's 1e-6.
        EXPECT_NEAR(r.total.forceOnM_F.y() / exact, 1, 2e-5) << hF << " " << hM;
        EXPECT_NEAR(r.total.peakPressure_Pa / (integrand(a) / (2 * kPi * a)), 1, 1e-5);
      }
    }
  }
}

TEST(SeriesContact, StiffnessIsTheDerivativeOfTheLoad) {
  for (const StrainMeasure strain : {StrainMeasure::small, StrainMeasure::large}) {
    for (const auto& [hF, hM] : std::vector<std::pair<double, double>>{{0.004, 0.002}, {0.004, 1e-7}, {1e-7, 0.004}}) {
      auto d = makeLayeredSphere({"", uhmwpe(), cartilage()}, strain, hF, hM);
      d.copyTolerance = -1;
      const ContactPair pair(d);
      const JointCoordinates q{0.1, 0.2, 0.3, 0.0003, 0.0358, 0.0002};
      ContactPair::Options options;
      options.withStiffness = true;
      const Matrix6 K = pair.evaluate(q, options).stiffness;
      for (size_t j = 3; j < 6; ++j) {  // a sphere does not feel its rotation
        const double step = 5e-7;
        const auto load = [&](double times) {
          JointCoordinates at = q;
          at[j] += times * step;
          return pair.evaluate(at, {}).total.forceOnM_F;
        };
        const Vec3 expected = (load(-2) - 8 * load(-1) + 8 * load(1) - load(2)) / (12 * step);
        const Vec3 column = K.block(0, static_cast<Eigen::Index>(j), 3, 1);
        EXPECT_LT((column - expected).norm(), 1e-7 * K.topRightCorner(3, 3).norm()) << j << ", " << hF << " " << hM;
      }
    }
  }
}

// The shares hF/h and hM/h vary from node to node and with the pose.
TEST(SeriesContact, VaryingSharesKeepTheOrderAndTheStiffness) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  const auto fixed = share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), moving = share(std::move(condyle));
  const JointCoordinates q{0.01, 0.02, 0.2, 0.0003, 0.0415, 0.0001};
  const auto make = [&](int n) {
    auto d = makeScene(fixed, moving, aboveZero(), uhmwpe(), 0.012, n);
    d.movingMaterial = cartilage();
    d.movingThickness.source = HeightAbovePlane{0.03};  // of the condyle: a plane above it
    d.strain = StrainMeasure::large;
    d.copyTolerance = -1;
    return ContactPair(d);
  };
  const double exact = make(240).evaluate(q).total.forceOnM_F.y();
  EXPECT_NEAR(make(30).evaluate(q).total.forceOnM_F.y() / exact, 1, 2e-6);  // one material: 4e-7 on the same scene
  const ContactPair pair = make(30);
  ContactPair::Options options;
  options.withStiffness = true;
  const Matrix6 K = pair.evaluate(q, options).stiffness;
  for (size_t j = 0; j < 6; ++j) {
    const double step = j < 3 ? 5e-6 : 1e-7;  // see the Stiffness tests
    const auto load = [&](double times) {
      JointCoordinates at = q;
      at[j] += times * step;
      const NetLoad l = pair.evaluate(at, {}).total;
      Eigen::Matrix<double, 6, 1> w;
      w << l.forceOnM_F, l.momentOnM_Fo_F;
      return w;
    };
    const Eigen::Matrix<double, 6, 1> expected = (load(-2) - 8 * load(-1) + 8 * load(1) - load(2)) / (12 * step);
    EXPECT_LT((K.col(static_cast<Eigen::Index>(j)) - expected).norm() / expected.norm(), 1e-7) << j;
  }
}

TEST(SeriesContact, ALayerBeyondItsRangeIsReported) {
  // Soft 1 mm on hard 9 mm, pressed 1.2 mm: the sum is strained by 12 %, the soft layer is used up.
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    auto d = makeLayeredSphere({"", soft(1e5), uhmwpe()}, StrainMeasure::large, 0.001, 0.009);
    d.rule = rule;
    const ContactPair pair(d);
    EXPECT_EQ(pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.036 - 0.2e-3, 0}).status, EvaluationStatus::ok);
    const auto r = pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.036 - 1.2e-3, 0});
    EXPECT_EQ(r.status, EvaluationStatus::extrapolated);
    EXPECT_GT(r.total.extrapolatedElements, 0);
    EXPECT_LT(r.total.extrapolatedElements, r.total.activeElements);
  }
}

}  // namespace
}  // namespace genu::contact
