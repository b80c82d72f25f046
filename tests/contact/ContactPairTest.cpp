#include "genu/contact/ContactPair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace test;

/** Two wavy condyles side by side over two dishes, one compartment each: several contact regions, lift-off, tilt. */
ContactPairDefinition makeKnee(int n = 24, double wave = 0.0003) {
  ContactPairDefinition d;
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, wave));
  const auto dish = makeDish(0.008, 0.058, 0.035, Solid::below, 0.016);
  for (const double side : {1.0, -1.0}) {
    const Pose X{Mat3::Identity(), Vec3(0, 0, 0.024 * side)};
    CompartmentDefinition c;
    c.name = side > 0 ? "medial" : "lateral";
    c.x0_m = -0.015;
    c.x1_m = 0.015;
    c.z0_m = 0.024 * side - 0.012;
    c.z1_m = 0.024 * side + 0.012;
    c.nx = c.nz = n;
    c.fixedSurface = shareIn(dish, X);
    c.movingSurface = shareIn(condyle, X);
    d.compartments.push_back(c);
  }
  d.fixedThickness = aboveZero();
  d.material = uhmwpe();
  return d;
}

/** Height of Mo at which the pair just touches with the other coordinates as given. */
double findTouchHeight(const ContactPair& pair, JointCoordinates q) {
  double apart = 0.07, touching = 0.02;
  while (apart - touching > 1e-9) {
    q[4] = 0.5 * (apart + touching);
    (pair.evaluate(q, {false}).total.activeElements > 0 ? touching : apart) = q[4];
  }
  return apart;
}

/** Pose pressed `depth` into the layer at the level tilt. */
JointCoordinates kneePose(double depth, double rx = 0, double rz = -0.3) {
  static const double height = findTouchHeight(ContactPair(makeKnee()), {0, 0.02, -0.3, 0.001, 0, 0.0005});
  return {rx, 0.02, rz, 0.001, height - depth, 0.0005};
}

double relative(const Vec3& a, const Vec3& b, double scale) { return (a - b).norm() / scale; }

TEST(ContactPair, OutOfContactIsExactlyZero) {
  const ContactPair pair(makeKnee());
  const auto r = pair.evaluate(kneePose(-0.01));
  EXPECT_EQ(r.status, EvaluationStatus::ok);
  EXPECT_EQ(r.total.activeElements, 0);
  EXPECT_EQ(r.total.forceOnM_F, Vec3::Zero());
  EXPECT_EQ(r.total.momentOnM_Fo_F, Vec3::Zero());
  EXPECT_EQ(r.total.scalarForce_N, 0);
  EXPECT_EQ(r.total.meanPressure_Pa, 0);
  EXPECT_EQ(r.total.energy_J, 0);
  EXPECT_EQ(r.total.centerOfPressure_F, Vec3::Zero());
}

TEST(ContactPair, TotalsAreTheSumOfCompartmentsAndOfElements) {
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    auto definition = makeKnee();
    definition.rule = rule;
    const ContactPair pair(definition);
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(kneePose(0.0004), workspace, {true}, r);
    ASSERT_GT(r.compartments[0].activeElements, 10);
    ASSERT_GT(r.compartments[1].activeElements, 10);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    double scalar = 0, area = 0, peak = 0;
    for (const auto& fields : pair.calcFields(workspace)) {
      for (const ElementField& f : fields) {
        force += f.force_N * f.forceDirection_F;
        moment += f.p_FA.cross(f.force_N * f.forceDirection_F);
        scalar += f.force_N;
        area += f.contactShare * f.area_m2;
        peak = std::max(peak, f.p_Pa);
        EXPECT_GE(f.contactShare, 0);
        // A full cell's weights also reach to its neighbors, whose areas differ by the surface's slope: a few 1e-3.
        EXPECT_LE(f.contactShare, 1.01);
      }
    }
    const double F = r.total.forceOnM_F.norm();
    const bool centre = rule == ContactRule::centre;
    // The smooth rule's cells take their direction from several nodes: only the scalar sums are exact element by element.
    const double vectorTolerance = centre ? 1e-13 : 0.01;
    EXPECT_LT(relative(force, r.total.forceOnM_F, F), vectorTolerance);
    EXPECT_LT(relative(moment, r.total.momentOnM_Fo_F, r.total.momentOnM_Fo_F.norm()), vectorTolerance);
    EXPECT_NEAR(scalar, r.total.scalarForce_N, 1e-12 * F);
    EXPECT_NEAR(area, r.total.area_m2, 1e-12 * area);
    if (centre) {
      EXPECT_EQ(peak, r.total.peakPressure_Pa);
    } else {
      EXPECT_GE(r.total.peakPressure_Pa, peak);
    }
    EXPECT_EQ(r.total.forceOnF_F(), -r.total.forceOnM_F);
    EXPECT_NEAR(r.total.meanPressure_Pa, scalar / area, 1e-12 * r.total.meanPressure_Pa);
  }
}

// ---- tracking ------------------------------------------------------------------------------------------------------

/** A walk with small steps, jumps, lift-off and re-contact. */
std::vector<JointCoordinates> makeWalk(int count) {
  std::mt19937 random(7);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<JointCoordinates> walk;
  JointCoordinates q = kneePose(0.0003);
  for (int i = 0; i < count; ++i) {
    if (i % 25 == 24) {
      q = kneePose(0.0004 * uniform(random), 0.03 * uniform(random), -0.8 + 0.7 * uniform(random));
      q[3] += 0.004 * uniform(random);
      q[5] += 0.002 * uniform(random);
    } else {
      for (size_t k = 0; k < 3; ++k) q[k] += 0.002 * g(random);
      for (size_t k = 3; k < 6; ++k) q[k] += 2e-5 * g(random);
    }
    walk.push_back(q);
  }
  return walk;
}

class Tracked : public testing::TestWithParam<Tracking> {};

TEST_P(Tracked, ChangesNothing) {
  // Feet agree to the query tolerance, 1e-13 m along the surface; the distance errs by its square. What is left is the
  // rounding of a few hundred summands.
  auto definition = makeKnee();
  definition.tracking = GetParam();
  const ContactPair pair(definition);
  definition.tracking = Tracking::all;
  const ContactPair reference(definition);
  ContactWorkspace workspace(pair);
  int inContact = 0, saved = 0;
  for (const JointCoordinates& q : makeWalk(1500)) {
    ContactResult warm;
    pair.evaluate(q, workspace, {true}, warm);
    const ContactResult cold = reference.evaluate(q);
    ASSERT_EQ(warm.total.activeElements, cold.total.activeElements);
    const double scale = std::max(1.0, cold.total.scalarForce_N);
    ASSERT_LT(relative(warm.total.forceOnM_F, cold.total.forceOnM_F, scale), 1e-11);
    ASSERT_LT(relative(warm.total.momentOnM_Fo_F, cold.total.momentOnM_Fo_F, scale), 1e-11);
    ASSERT_NEAR(warm.total.energy_J, cold.total.energy_J, 1e-11 * std::max(1.0, cold.total.energy_J));
    ASSERT_NEAR(warm.total.peakPressure_Pa, cold.total.peakPressure_Pa, 1e-9 * std::max(1e6, cold.total.peakPressure_Pa));
    inContact += cold.total.activeElements > 0;
    saved += cold.distanceQueries - warm.distanceQueries;
  }
  EXPECT_GT(inContact, 375);  // a quarter of the walk, so that the comparison says something
  if (GetParam() == Tracking::lipschitz || GetParam() == Tracking::breadthFirst) {
    EXPECT_GT(saved, 1500 * pair.numElements() / 2);
  }
}

INSTANTIATE_TEST_SUITE_P(Modes, Tracked, testing::Values(Tracking::all, Tracking::lipschitz, Tracking::breadthFirst));

/** Three balls on one body over one compartment: contact regions that come and go separately. */
ContactPairDefinition makeThreeBalls() {
  std::vector<NurbsPatch> balls;
  for (const Vec3& center : {Vec3(-0.007, 0, 0), Vec3(0.007, 0, -0.004), Vec3(0.006, 0, 0.007)}) {
    for (const NurbsPatch& chart : makeSphere(0.005)) balls.push_back(chart.transformed(Pose{Mat3::Identity(), center}));
  }
  return makeScene(share(makePlane(0.008, 0, 0, Solid::below, 0.05)), share(balls), constantThickness(0.008), uhmwpe(), 0.013, 40);
}

std::vector<JointCoordinates> makeRocking() {
  std::vector<JointCoordinates> poses;
  for (int i = 0; i < 120; ++i) {
    const double t = i / 120.0;
    poses.push_back({0.04 * std::sin(23 * t), 0, 0.05 * std::cos(17 * t), 0, 0.008 + 0.005 - 0.0002, 0});
  }
  return poses;
}

/** Rocking balls with every element evaluated. */
const std::vector<ContactResult>& rockWithAll() {
  static const std::vector<ContactResult> results = [] {
    auto d = makeThreeBalls();
    d.tracking = Tracking::all;
    const ContactPair pair(d);
    std::vector<ContactResult> r;
    for (const JointCoordinates& q : makeRocking()) r.push_back(pair.evaluate(q));
    return r;
  }();
  return results;
}

TEST(Tracking, FollowsSeveralRegionsOfOneCompartment) {
  for (const Tracking tracking : {Tracking::lipschitz, Tracking::breadthFirst}) {
    auto d = makeThreeBalls();
    d.tracking = tracking;
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactResult r;
    size_t i = 0;
    for (const JointCoordinates& q : makeRocking()) {
      pair.evaluate(q, workspace, {}, r);
      const ContactResult& cold = rockWithAll()[i++];
      ASSERT_EQ(r.total.activeElements, cold.total.activeElements);
      ASSERT_LT(relative(r.total.forceOnM_F, cold.total.forceOnM_F, std::max(1.0, cold.total.scalarForce_N)), 1e-11);
    }
  }
}

TEST(Tracking, TheSearchAloneMissesSeparateNewContact) {
  // Why breadth-first from the previous set is not the default: it cannot see a region that appears elsewhere.
  auto d = makeThreeBalls();
  d.tracking = Tracking::breadthFirstUnguarded;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  int wrong = 0;
  double largest = 0;
  size_t i = 0;
  for (const JointCoordinates& q : makeRocking()) {
    pair.evaluate(q, workspace, {}, r);
    const ContactResult& cold = rockWithAll()[i++];
    ASSERT_LE(r.total.activeElements, cold.total.activeElements);
    wrong += r.total.activeElements != cold.total.activeElements;
    if (cold.total.scalarForce_N > 0) largest = std::max(largest, 1 - r.total.scalarForce_N / cold.total.scalarForce_N);
  }
  std::printf("unguarded breadth-first search: wrong in %d of 120 poses, force too low by up to %.0f %%\n", wrong, 100 * largest);
  EXPECT_GT(wrong, 0);
}

TEST(Copy, SamePoseIsCopiedAndToleranceBoundsTheError) {
  auto d = makeKnee();
  ContactPair exact(d);
  ContactWorkspace workspace(exact);
  ContactResult first, second;
  const JointCoordinates q = kneePose(0.0004);
  exact.evaluate(q, workspace, {true}, first);
  EXPECT_FALSE(first.copied);
  exact.evaluate(q, workspace, {true}, second);
  EXPECT_TRUE(second.copied);
  EXPECT_EQ(second.distanceQueries, 0);
  EXPECT_EQ(first.total.forceOnM_F, second.total.forceOnM_F);  // bit for bit
  EXPECT_EQ(first.total.energy_J, second.total.energy_J);

  JointCoordinates moved = q;
  moved[4] += 1e-9;
  exact.evaluate(moved, workspace, {true}, second);
  EXPECT_FALSE(second.copied);  // tolerance 0: only the same pose

  d.copyTolerance = 1e-8;
  ContactPair tolerant(d);
  ContactWorkspace other(tolerant);
  tolerant.evaluate(q, other, {true}, first);
  tolerant.evaluate(moved, other, {true}, second);
  EXPECT_TRUE(second.copied);
  // The force error is the stiffness times the tolerance: K A / h of the whole active area bounds the stiffness.
  const double bound = 2140.6e6 * first.total.area_m2 / 0.008 * 1e-8;
  const auto truth = exact.evaluate(moved);
  EXPECT_LT((second.total.forceOnM_F - truth.total.forceOnM_F).norm(), bound);

  // Analyses that difference close poses ask for identical ones only.
  tolerant.evaluate(q, other, {true}, first);
  ContactPair::Options samePose;
  samePose.withEnergy = samePose.copyOnlySamePose = true;
  tolerant.evaluate(moved, other, samePose, second);
  EXPECT_FALSE(second.copied);
  EXPECT_EQ(second.total.activeElements, truth.total.activeElements);

  d.copyTolerance = -1;
  ContactPair never(d);
  ContactWorkspace third(never);
  never.evaluate(q, third, {}, first);
  never.evaluate(q, third, {}, second);
  EXPECT_FALSE(second.copied);
}

TEST(Copy, EnergyIsComputedWhenItWasNotStored) {
  const ContactPair pair(makeKnee());
  ContactWorkspace workspace(pair);
  ContactResult r;
  pair.evaluate(kneePose(0.0004), workspace, {false}, r);
  EXPECT_EQ(r.total.energy_J, 0);
  pair.evaluate(kneePose(0.0004), workspace, {true}, r);
  EXPECT_FALSE(r.copied);
  EXPECT_GT(r.total.energy_J, 0);
}

TEST(Workspace, ResetMakesTheNextEvaluationCold) {
  const ContactPair pair(makeKnee());
  ContactWorkspace workspace(pair);
  ContactResult a, b;
  pair.evaluate(kneePose(0.0004), workspace, {}, a);
  pair.evaluate(kneePose(0.0002), workspace, {}, b);
  workspace.reset();
  pair.evaluate(kneePose(0.0004), workspace, {}, b);
  EXPECT_EQ(a.distanceQueries, b.distanceQueries);
  EXPECT_EQ(a.total.forceOnM_F, b.total.forceOnM_F);
}

// ---- invariances -----------------------------------------------------------------------------------------------------

TEST(Invariance, MovingTheMovingSurfaceInItsBodyAndTheBodyBackChangesNothing) {
  const Pose X = calcPose({0.4, -0.3, 0.8, 0.02, -0.01, 0.03});
  auto d = makeKnee();
  const ContactPair reference(d);
  for (auto& c : d.compartments) {
    std::vector<NurbsPatch> patches;
    for (int k = 0; k < c.movingSurface->numPatches(); ++k) patches.push_back(c.movingSurface->patch(k).transformed(X));
    c.movingSurface = share(std::move(patches));
  }
  const ContactPair moved(d);
  for (const double rx : {-0.01, 0.0, 0.02}) {
    const JointCoordinates q = kneePose(0.0004, rx);
    const auto a = reference.evaluate(q), b = moved.evaluate(calcCoordinates(calcPose(q) * X.inverse()));
    // Moving the points rounds them by 1e-17 m; over a depth of 0.4 mm that is 1e-13 of the pressure.
    EXPECT_LT(relative(a.total.forceOnM_F, b.total.forceOnM_F, a.total.scalarForce_N), 1e-11);
    EXPECT_LT(relative(a.total.momentOnM_Fo_F, b.total.momentOnM_Fo_F, a.total.scalarForce_N), 1e-11);
    EXPECT_EQ(a.total.activeElements, b.total.activeElements);
  }
}

TEST(Invariance, ShiftingTheWholeSceneShiftsTheMomentOnly) {
  const Vec3 shift(0.1, 0.05, -0.2);
  auto d = makeKnee();
  const ContactPair reference(d);
  for (auto& c : d.compartments) {
    std::vector<NurbsPatch> patches;
    for (int k = 0; k < c.fixedSurface->numPatches(); ++k) {
      patches.push_back(c.fixedSurface->patch(k).transformed(Pose{Mat3::Identity(), shift}));
    }
    c.fixedSurface = share(std::move(patches));
    c.x0_m += shift.x();
    c.x1_m += shift.x();
    c.z0_m += shift.z();
    c.z1_m += shift.z();
  }
  d.fixedThickness.source = HeightAbovePlane{shift.y()};
  const ContactPair moved(d);
  JointCoordinates q = kneePose(0.0004, 0.01), qs = q;
  for (int k = 0; k < 3; ++k) qs[static_cast<size_t>(3 + k)] += shift[k];
  const auto a = reference.evaluate(q), b = moved.evaluate(qs);
  const double F = a.total.scalarForce_N;
  EXPECT_LT(relative(a.total.forceOnM_F, b.total.forceOnM_F, F), 1e-10);
  const Vec3 expected = a.total.momentOnM_Fo_F + shift.cross(a.total.forceOnM_F);
  EXPECT_LT(relative(b.total.momentOnM_Fo_F, expected, F), 1e-10);
}

TEST(Invariance, TurningTheSceneAboutTheVerticalTurnsTheLoads) {
  // A half turn about y maps the grid onto itself.
  auto d = makeKnee();
  const ContactPair reference(d);
  const Pose Y{Mat3(Eigen::AngleAxisd(kPi, Vec3::UnitY())), Vec3::Zero()};
  for (auto& c : d.compartments) {
    std::vector<NurbsPatch> patches;
    for (int k = 0; k < c.fixedSurface->numPatches(); ++k) patches.push_back(c.fixedSurface->patch(k).transformed(Y));
    c.fixedSurface = share(std::move(patches));
    std::swap(c.z0_m, c.z1_m);
    c.z0_m *= -1;
    c.z1_m *= -1;
  }
  const ContactPair turned(d);
  const JointCoordinates q = kneePose(0.0004, 0.01);
  const auto a = reference.evaluate(q), b = turned.evaluate(calcCoordinates(Y * calcPose(q)));
  EXPECT_LT(relative(Y.R * a.total.forceOnM_F, b.total.forceOnM_F, a.total.scalarForce_N), 1e-10);
  EXPECT_LT(relative(Y.R * a.total.momentOnM_Fo_F, b.total.momentOnM_Fo_F, a.total.scalarForce_N), 1e-10);
}

// ---- energy ------------------------------------------------------------------------------------------------------------

struct EnergyCase {
  const char* name;
  Material material;
  StrainMeasure strain;
};
class Energy : public testing::TestWithParam<EnergyCase> {};

/** Generalized force of the contact on M along coordinate k: virtual power of a unit rate. */
double generalizedForce(const ContactResult& r, const JointCoordinates& q, size_t k) {
  JointCoordinates rate{};
  rate[k] = 1;
  return ContactPair::calcPower(r.total, calcSpatialVelocity(q, rate), Vec3(q[3], q[4], q[5]));
}

TEST_P(Energy, WithoutCorrectionTheCentreRulesForceIsItsGradient) {
  auto d = makeKnee(12);
  d.rule = ContactRule::centre;
  d.material = GetParam().material;
  d.strain = GetParam().strain;
  d.correction = Correction::none;
  const ContactPair pair(d);
  const JointCoordinates q = kneePose(0.0004, 0.004);
  const auto r = pair.evaluate(q);
  double largest = 0;
  std::array<double, 6> Q{}, dE{};
  for (size_t k = 0; k < 6; ++k) {
    // Central differences with Richardson extrapolation. Steps so small that no element changes state: an element that
    // enters adds (K/2h) step^2, which would leave an error of first order in the step.
    const double step = (k < 3 ? 1e-6 : 2e-8);
    const auto slope = [&](double e) {
      JointCoordinates lo = q, hi = q;
      lo[k] -= e;
      hi[k] += e;
      return (pair.evaluate(hi).total.energy_J - pair.evaluate(lo).total.energy_J) / (2 * e);
    };
    dE[k] = (4 * slope(0.5 * step) - slope(step)) / 3;
    Q[k] = generalizedForce(r, q, k);
    largest = std::max(largest, std::abs(Q[k]) * (k < 3 ? 1 / 0.025 : 1));
  }
  for (size_t k = 0; k < 6; ++k) {
    // Rounding: energy of ~0.1 J to 1e-16 over a step of 2e-8 m is 1e-9 of the force.
    EXPECT_NEAR(Q[k], -dE[k], 1e-6 * largest * (k < 3 ? 0.025 : 1)) << "coordinate " << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, Energy,
                         testing::Values(EnergyCase{"linear", uhmwpe(), StrainMeasure::small},
                                         EnergyCase{"log", uhmwpe(), StrainMeasure::large},
                                         EnergyCase{"power", uhmwpePowerLaw(), StrainMeasure::small},
                                         EnergyCase{"power_log", uhmwpePowerLaw(), StrainMeasure::large},
                                         EnergyCase{"consistent", uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::small}),
                         [](const auto& test_info) { return test_info.param.name; });

TEST(Energy, MidsurfaceFormIsConservativeOnlyToTheOrderOfThetaSquared) {
  // An element's force leans by theta/2 from the gradient of its energy; on a smooth patch the sideways parts cancel in
  // pairs and the resultant differs by the order of theta^2. Sphere on a layer: theta at the rim ~ sqrt(2 D / R).
  double ratio[2];
  const double depth[2] = {0.1e-3, 0.4e-3};
  for (int i = 0; i < 2; ++i) {
    const double R = 0.03, h = 0.006, D = depth[i];
    const ContactPair pair(makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(),
                                     1.2 * std::sqrt(2 * R * D), 401));
    const auto energyAt = [&](double y) { return pair.evaluate(JointCoordinates{0, 0, 0, 0, y, 0}).total.energy_J; };
    const double y = h + R - D, step = 1e-7;
    const double gradient = -(energyAt(y + step) - energyAt(y - step)) / (2 * step);
    const double force = pair.evaluate(JointCoordinates{0, 0, 0, 0, y, 0}).total.forceOnM_F.y();
    const double thetaSquared = 2 * D / R;
    ratio[i] = (gradient / force - 1) / thetaSquared;
    EXPECT_GT(std::abs(gradient / force - 1), 1e-4);  // not conservative,
    EXPECT_LT(std::abs(gradient / force - 1), thetaSquared);  // by the order of theta^2
  }
  EXPECT_NEAR(ratio[0] / ratio[1], 1, 0.05);  // the order is two: next term theta^4
}

// ---- layers -------------------------------------------------------------------------------------------------------------

TEST(Layers, OfBothBodiesAddUp) {
  const double R = 0.03;
  auto d = makeScene(share(makePlane(0.002, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(0.002), cartilage(),
                     0.005, 51);
  d.movingThickness = constantThickness(0.003);
  d.strain = StrainMeasure::large;
  const ContactPair both(d);
  d.movingThickness = Thickness{};
  d.fixedThickness = constantThickness(0.005);
  const ContactPair one(d);
  d.fixedThickness = Thickness{};
  d.movingThickness = constantThickness(0.005);
  const ContactPair moving(d);
  const JointCoordinates q = {0, 0, 0, 0, 0.002 + R - 0.0004, 0};
  const double F = one.evaluate(q).total.forceOnM_F.y();
  EXPECT_GT(F, 1);
  EXPECT_NEAR(both.evaluate(q).total.forceOnM_F.y(), F, 1e-13 * F);
  EXPECT_NEAR(moving.evaluate(q).total.forceOnM_F.y(), F, 1e-13 * F);
}

TEST(Layers, ThicknessMapOfAConcentricBackIsConstant) {
  // Cartilage sphere over a concentric bone sphere: the bilinear map is exact, both ways of measuring agree.
  const double R = 0.03, h = 0.003;
  for (const BackDirection direction : {BackDirection::closest, BackDirection::normal}) {
    auto d = makeScene(share(makePlane(0.002, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(0.002), cartilage(),
                       0.005, 51);
    d.movingThickness.source = BackSurface{share(makeSphere(R - h)), direction};
    const ContactPair mapped(d);
    ASSERT_EQ(mapped.thicknessMapReports().size(), 1u);
    EXPECT_EQ(mapped.thicknessMapReports()[0].missed, 0);
    EXPECT_NEAR(mapped.thicknessMapReports()[0].min_m, h, 1e-12);
    EXPECT_NEAR(mapped.thicknessMapReports()[0].max_m, h, 1e-12);
    d.movingThickness = constantThickness(h);
    const ContactPair constant(d);
    const JointCoordinates q = {0.3, 0.2, -0.5, 0, 0.002 + R - 0.0004, 0};
    EXPECT_NEAR(mapped.evaluate(q).total.forceOnM_F.y() / constant.evaluate(q).total.forceOnM_F.y(), 1, 1e-9);
  }
}

TEST(Layers, BilinearMapConvergesWithTheSquareOfItsSpacing) {
  // Bone sphere off center: thickness varies smoothly over (u, v).
  const double R = 0.03;
  auto d = makeScene(share(makePlane(0.002, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(0.002), cartilage(),
                     0.005, 51);
  d.movingThickness.source =
      BackSurface{shareIn(makeSphere(0.026), Pose{Mat3::Identity(), Vec3(0.001, -0.0012, 0.0007)}), BackDirection::closest};
  const JointCoordinates q = {0.1, 0, -0.2, 0, 0.002 + R - 0.0004, 0};
  const auto force = [&](int samples) {
    d.movingThickness.mapSamplesU = d.movingThickness.mapSamplesV = samples;
    return ContactPair(d).evaluate(q).total.forceOnM_F.y();
  };
  const double reference = force(257);
  const double e1 = std::abs(force(17) - reference), e2 = std::abs(force(65) - reference);
  EXPECT_GT(e1 / e2, 16 * 0.5);  // order two: a factor 16, where the foot lies in its cell moves it
  EXPECT_LT(e2 / reference, 5e-4);  // 65 samples over the whole half sphere
}

TEST(Layers, FixedBackSurfaceAlongTheNormal) {
  const double h = 0.004;
  auto d = makeScene(share(makePlane(0.006, 0.2, 0, Solid::below, 0.1)), share(makeSphere(0.03)), Thickness{}, uhmwpe(), 0.005, 21);
  d.fixedThickness.source = BackSurface{share(makePlane(0.006 - h * std::hypot(1, 0.2), 0.2, 0, Solid::below, 0.1)), BackDirection::normal};
  const ContactPair pair(d);
  EXPECT_NEAR(pair.gridReports()[0].minThickness_m, h, 1e-14);
  EXPECT_NEAR(pair.gridReports()[0].maxThickness_m, h, 1e-14);
}

TEST(Layers, MissedBackIsCountedLeftOutOrReplaced) {
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.1)), share(makeSphere(0.03)), Thickness{}, uhmwpe(), 0.004, 20);
  // A bone patch that covers |x| <= 2 mm of |x| <= 4 mm only.
  std::vector<NurbsPatch> bone = makePlane(0.002, 0, 0, Solid::below, 0.002);
  d.fixedThickness.source = BackSurface{share(bone), BackDirection::normal};
  const ContactPair out(d);
  EXPECT_EQ(out.gridReports()[0].missedBack, 300);
  EXPECT_EQ(out.gridReports()[0].elements, 100);
  d.fixedThickness.missing_m = 0.003;
  const ContactPair in(d);
  EXPECT_EQ(in.gridReports()[0].elements, 400);
  EXPECT_NEAR(in.gridReports()[0].minThickness_m, 0.003, 1e-15);
}

TEST(Layers, ClampsAreAppliedAndCounted) {
  auto d = makeScene(share(makePlane(0.006, 0.5, 0, Solid::below, 0.1)), share(makeSphere(0.03)), aboveZero(), uhmwpe(), 0.004, 20);
  d.fixedThickness.min_m = 0.005;
  d.fixedThickness.max_m = 0.007;
  const ContactPair pair(d);
  EXPECT_EQ(pair.gridReports()[0].minThickness_m, 0.005);
  EXPECT_EQ(pair.gridReports()[0].maxThickness_m, 0.007);
  EXPECT_EQ(pair.gridReports()[0].clamped, 200);  // |0.5 x| > 1 mm: half of |x| <= 4 mm
}

// ---- grid -------------------------------------------------------------------------------------------------------------------

TEST(Grid, CellsThatMissTheSurfaceAreSkippedAndCounted) {
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.003)), share(makeSphere(0.03)), constantThickness(0.006), uhmwpe(),
                     0.006, 12);
  const ContactPair pair(d);
  EXPECT_EQ(pair.gridReports()[0].cells, 144);
  EXPECT_EQ(pair.gridReports()[0].elements, 36);
  EXPECT_EQ(pair.gridReports()[0].missedSurface, 108);
}

TEST(Grid, TakesTheHighestUpwardCrossingAboveThePlane) {
  // A fixed ball: verticals cross it twice; only the top faces up. A lower plane lies inside the rectangle as a second patch.
  std::vector<NurbsPatch> patches = makeSphere(0.01);
  for (auto& p : makePlane(-0.02, 0, 0, Solid::below, 0.02)) patches.push_back(p);
  auto d = makeScene(share(patches), share(makePlane(0, 0, 0, Solid::above, 0.1)), constantThickness(0.005), uhmwpe(), 0.012, 24);
  const ContactPair both(d);
  EXPECT_EQ(both.gridReports()[0].elements, 576);
  d.planeY_m = -0.01;
  const ContactPair above(d);
  EXPECT_EQ(above.gridReports()[0].elements + above.gridReports()[0].belowPlane, 576);
  ContactWorkspace workspace(above);
  ContactResult r;
  above.evaluate(JointCoordinates{0, 0, 0, 0, 0.0098, 0}, workspace, {}, r);
  const auto fields = above.calcFields(workspace);
  for (const ElementField& f : fields[0]) {
    EXPECT_NEAR(f.p_FA.norm(), 0.01, 1e-12);
    EXPECT_GT(f.normal_F.y(), 0);
  }
  EXPECT_GT(r.total.activeElements, 0);
}

TEST(Grid, ErrorsNameTheCause) {
  const auto message = [](ContactPairDefinition d) {
    try {
      ContactPair pair(std::move(d));
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  using testing::HasSubstr;
  const auto scene = [] {
    return makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.1)), share(makeSphere(0.03)), constantThickness(0.006), uhmwpe(), 0.005, 10);
  };
  auto d = scene();
  d.compartments[0].fixedSurface = share(makePlane(0.006, 0, 0, Solid::above, 0.1));
  EXPECT_THAT(message(d), HasSubstr("normals are inverted"));
  d = scene();
  d.compartments[0].x0_m = 1;
  d.compartments[0].x1_m = 2;
  EXPECT_THAT(message(d), HasSubstr("no overlap between the grid"));
  d = scene();
  d.planeY_m = 0.01;
  EXPECT_THAT(message(d), HasSubstr("lower the plane"));
  d = scene();
  d.fixedThickness.source = HeightAbovePlane{0.01};
  EXPECT_THAT(message(d), HasSubstr("thickness would be negative"));
  d = scene();
  d.fixedThickness = constantThickness(-0.001);
  EXPECT_THAT(message(d), HasSubstr("thickness of the fixed body = -0.001 m"));
  d = scene();
  d.fixedThickness = Thickness{};
  EXPECT_THAT(message(d), HasSubstr("both bodies are rigid"));
  d = scene();
  d.movingThickness.source = HeightAbovePlane{0.01};  // the sphere reaches from -30 to 30 mm
  EXPECT_THAT(message(d), HasSubstr("crosses the plane"));
  d = scene();
  d.material.nu = 0.5;
  EXPECT_THAT(message(d), HasSubstr("nu = 0.5"));
  d = scene();
  d.compartments[0].nx = 0;
  EXPECT_THAT(message(d), HasSubstr("grid 0x10"));
  d = scene();
  std::swap(d.compartments[0].x0_m, d.compartments[0].x1_m);
  EXPECT_THAT(message(d), HasSubstr("is empty"));
}

TEST(Grid, RectangleIsFoundFromTheSurface) {
  const auto r = findRectangle(ContactSurface(makePlane(0.006, 0.1, 0, Solid::below, 0.02)));
  EXPECT_NEAR(r[0], -0.02, 1e-15);
  EXPECT_NEAR(r[1], 0.02, 1e-15);
  EXPECT_NEAR(r[2], -0.02, 1e-15);
  EXPECT_NEAR(r[3], 0.02, 1e-15);
  EXPECT_THROW(findRectangle(ContactSurface(makePlane(0.006, 0.1, 0, Solid::above, 0.02))), std::invalid_argument);
}

// ---- status ------------------------------------------------------------------------------------------------------------------

TEST(Status, TellsExtrapolationAndFullPenetration) {
  auto d = makeScene(share(makePlane(0.002, 0, 0, Solid::below, 0.1)), share(makeSphere(0.03)), constantThickness(0.002), cartilage(),
                     0.012, 25);
  d.strain = StrainMeasure::large;
  const ContactPair pair(d);
  const auto at = [&](double depth) { return pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.002 + 0.03 - depth, 0}); };
  EXPECT_EQ(at(0.0015).status, EvaluationStatus::ok);
  const auto deep = at(0.00195);
  EXPECT_EQ(deep.status, EvaluationStatus::extrapolated);
  EXPECT_GT(deep.total.extrapolatedElements, 0);
  EXPECT_NEAR(deep.total.maxStrain, 0.975, 0.001);
  const auto through = at(0.0025);
  EXPECT_EQ(through.status, EvaluationStatus::fullPenetration);
  EXPECT_TRUE(std::isfinite(through.total.scalarForce_N));
  EXPECT_GT(through.total.scalarForce_N, deep.total.scalarForce_N);
}

TEST(Status, ElementsBeyondTheMovingBorderAreNotInContactButCounted) {
  auto d = makeScene(share(makePlane(0.006, 0, 0, Solid::below, 0.1)), share(makePlane(0, 0, 0, Solid::above, 0.004)),
                     constantThickness(0.006), uhmwpe(), 0.008, 16);
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.0059, 0}, workspace, {}, r);
  int onBorder = 0;
  for (const auto& fields : pair.calcFields(workspace)) {
    for (const ElementField& f : fields) onBorder += f.footOnBorder;
  }
  EXPECT_EQ(onBorder, 192);
  EXPECT_EQ(r.total.activeElements, 64);   // the part under the moving sheet
  EXPECT_EQ(r.total.boundaryElements, 192);
  EXPECT_NEAR(r.total.peakPressure_Pa, 2140.582192e6 * 0.1 / 6, 10);
}

TEST(Status, NotANumberIsReported) {
  const ContactPair pair(makeKnee(4));
  const auto r = pair.evaluate(JointCoordinates{0, 0, std::nan(""), 0, 0.04, 0});
  EXPECT_EQ(r.status, EvaluationStatus::notConverged);
  EXPECT_EQ(r.total.forceOnM_F, Vec3(Vec3::Zero()));
}

}  // namespace
}  // namespace genu::contact
