// Damping of the Hunt-Crossley type: p max(0, 1 + c approach).

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace test;

using Vector6 = Eigen::Matrix<double, 6, 1>;

ContactPairDefinition makeDampedDish(double damping_sPerM, Material material = uhmwpe(), ContactRule rule = ContactRule::smooth) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), material, 0.012, 30);
  d.damping_sPerM = damping_sPerM;
  d.copyTolerance = -1;
  d.rule = rule;
  return d;
}

ContactResult evaluate(const ContactPair& pair, const JointCoordinates& q, const JointCoordinates& qdot, bool withStiffness = false) {
  ContactWorkspace workspace(pair);
  ContactResult r;
  ContactPair::Options options;
  options.withEnergy = true;
  options.withStiffness = withStiffness;
  pair.evaluate(q, qdot, workspace, options, r);
  return r;
}

Vector6 toVector(const NetLoad& load) {
  Vector6 w;
  w << load.forceOnM_F, load.momentOnM_Fo_F;
  return w;
}

/** A pose with the condyle about 0.1 mm deep in the dish. */
JointCoordinates findPose(const ContactPair& pair) {
  double low = 0.03, high = 0.06;
  while (high - low > 1e-9) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0.01, 0.02, 0.2, 0.0003, y, 0.0001}, {}).total.scalarForce_N > 1000 ? low : high) = y;
  }
  return {0.01, 0.02, 0.2, 0.0003, high, 0.0001};
}

TEST(Damping, OfASphereThatMovesStraightDownIsTheFactor) {
  // Sphere straight onto a flat layer: approach at A is v cos(theta/2), theta/2 at most 0.058 at the rim (D = 0.2 mm, R = 30 mm), so
  // that the factor 1 + c v cos(theta/2) lies within 1.7e-3 c v below 1 + c v; for c v = 0.5.
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.01)), share(makeSphere(0.030)), aboveZero(), uhmwpe(), 0.005, 50);
  d.copyTolerance = -1;
  const JointCoordinates q{0, 0, 0, 0, 0.0358, 0};
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    d.rule = rule;
    d.damping_sPerM = 0;
    const double elastic = evaluate(ContactPair(d), q, {}).total.forceOnM_F.y();
    d.damping_sPerM = 10;
    const ContactPair pair(d);
    const double v = 0.05;
    const double down = evaluate(pair, q, {0, 0, 0, 0, -v, 0}).total.forceOnM_F.y() / elastic;
    EXPECT_LT(down, 1.5);
    EXPECT_GT(down, 1.5 - 0.5 * 1.7e-3);
    const double up = evaluate(pair, q, {0, 0, 0, 0, v, 0}).total.forceOnM_F.y() / elastic;
    EXPECT_GT(up, 0.5);
    EXPECT_LT(up, 0.5 + 0.5 * 1.7e-3);
    // Faster than 1/c apart: nothing is left, and nothing pulls.
    const ContactResult fast = evaluate(pair, q, {0, 0, 0, 0, 0.11, 0});
    EXPECT_EQ(fast.total.forceOnM_F.y(), 0);
    EXPECT_EQ(fast.total.peakPressure_Pa, 0);
    EXPECT_GT(fast.total.energy_J, 0);
  }
}

TEST(Damping, OffCostsNothingAndRatesDoNotMatter) {
  const ContactPair pair(makeDampedDish(0));
  const JointCoordinates q = findPose(pair), qdot{1, 2, 3, 0.1, 0.2, 0.3};
  EXPECT_EQ(toVector(evaluate(pair, q, {}).total), toVector(evaluate(pair, q, qdot).total));
}

TEST(Damping, NeverGivesPowerNorPulls) {
  // Against the undamped load at the same pose, over random rates: the damped one takes power, whatever the motion; no pressure is
  // negative.
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    const ContactPair elastic(makeDampedDish(0, uhmwpe(), rule)), damped(makeDampedDish(20, uhmwpe(), rule));
    const JointCoordinates q = findPose(elastic);
    const NetLoad undamped = evaluate(elastic, q, {}).total;
    std::mt19937 random(3);
    std::normal_distribution<double> unit(0, 1);
    int clipped = 0;
    for (int i = 0; i < 200; ++i) {
      JointCoordinates qdot;
      for (size_t k = 0; k < 6; ++k) qdot[k] = unit(random) * (k < 3 ? 3 : 0.1);
      ContactWorkspace workspace(damped);
      ContactResult r;
      damped.evaluate(q, qdot, workspace, {}, r);
      const SpatialVelocity V = calcSpatialVelocity(q, qdot);
      const Vec3 p(q[3], q[4], q[5]);
      EXPECT_LE(ContactPair::calcPower(r.total, V, p), ContactPair::calcPower(undamped, V, p));
      const auto fields = damped.calcFields(workspace);
      for (const ElementField& f : fields[0]) {
        EXPECT_GE(f.p_Pa, 0);
        // The smooth rule's shares may be negative by the weights of cells that only a corner touches.
        EXPECT_GE(f.force_N, rule == ContactRule::smooth ? -1e-3 * undamped.scalarForce_N : 0);
        clipped += f.active && f.d_m > 0 && f.p_Pa == 0;
      }
    }
    EXPECT_GT(clipped, 0);  // the random motions do reach the cut-off
  }
}

TEST(Damping, AClosedCycleLosesEnergy) {
  // One period of a bouncing and rocking motion: the work of the load on M over the cycle is the loss, and negative.
  const ContactPair pair(makeDampedDish(2));
  const JointCoordinates middle = findPose(pair);
  ContactWorkspace workspace(pair);
  ContactResult r;
  double work_J = 0;
  constexpr int kSteps = 400;
  for (int i = 0; i < kSteps; ++i) {
    const double w = 2 * kPi / 0.02, t = 0.02 * i / kSteps;
    const double amplitude[6] = {0.002, 0.001, 0.01, 1e-4, 1.5e-4, 1e-4}, phase[6] = {0, 1, 2, 0.5, 0, 1.5};
    JointCoordinates q = middle, qdot;
    for (size_t k = 0; k < 6; ++k) {
      q[k] += amplitude[k] * std::sin(w * t + phase[k]);
      qdot[k] = amplitude[k] * w * std::cos(w * t + phase[k]);
    }
    pair.evaluate(q, qdot, workspace, {}, r);
    work_J += ContactPair::calcPower(r.total, calcSpatialVelocity(q, qdot), Vec3(q[3], q[4], q[5])) * 0.02 / kSteps;
  }
  EXPECT_LT(work_J, -1e-3);
}

TEST(Damping, MatrixAndStiffnessAreTheDerivatives) {
  for (const Material& material : {uhmwpe(), uhmwpePowerLaw()}) {
    auto d = makeDampedDish(3, material);
    if (material.law != MaterialLaw::linear) d.compartments[0].nx = d.compartments[0].nz = 60;  // see the Stiffness tests
    const ContactPair pair(d);
    const JointCoordinates q = findPose(pair);
    const JointCoordinates qdot{0.3, -0.2, 0.5, 0.02, -0.05, 0.03};
    const ContactResult r = evaluate(pair, q, qdot, true);
    for (size_t j = 0; j < 6; ++j) {
      const auto difference = [&](double step, bool ofRates) {
        const auto at = [&](double times) {
          JointCoordinates x = q, v = qdot;
          (ofRates ? v : x)[j] += times * step;
          return toVector(evaluate(pair, x, v).total);
        };
        return Vector6((at(-2) - 8 * at(-1) + 8 * at(1) - at(2)) / (12 * step));
      };
      const auto expectClose = [&](const Vector6& actual, const Vector6& expected, const char* what) {
        const double moment = std::max(expected.tail<3>().norm(), 0.01 * expected.head<3>().norm());
        EXPECT_LT((actual - expected).head<3>().norm(), 1e-7 * expected.head<3>().norm()) << what << " " << j;
        EXPECT_LT((actual - expected).tail<3>().norm(), 1e-7 * moment) << what << " " << j;
      };
      const auto column = static_cast<Eigen::Index>(j);
      // The load is linear in the rates while nothing is cut off: any step will do.
      expectClose(r.damping.col(column), difference(j < 3 ? 1e-2 : 1e-3, true), "rate");
      expectClose(r.stiffness.col(column), difference(j < 3 ? 5e-6 : 1e-7, false), "coordinate");
    }
  }
}

TEST(Damping, BadValuesAreNamed) {
  const auto message = [](double damping, Correction correction) {
    auto d = makeDampedDish(damping);
    d.correction = correction;
    try {
      ContactPair pair(d);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_NE(message(-1, Correction::midsurface).find("damping = -1 s/m"), std::string::npos);
  EXPECT_NE(message(NAN, Correction::midsurface).find("damping = nan"), std::string::npos);
  EXPECT_NE(message(1, Correction::energy).find("correction energy with damping"), std::string::npos);
}

}  // namespace
}  // namespace genu::contact
