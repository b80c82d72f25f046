// A grid on the moving body (ContactPairDefinition::gridOn).

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace genu::contact {
namespace {

using namespace test;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double h = 0.006;

JointCoordinates at(const Vec3& p, const Mat3& R = Mat3::Identity()) { return calcCoordinates(Pose{R, p}); }

/** A condyle that carries the grid, over a dish. */
ContactPairDefinition makeCondyleGrid(GridOn gridOn, const Material& material = uhmwpe(), StrainMeasure strain = StrainMeasure::small) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  auto d = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), constantThickness(h), material,
                     0.010, 30);
  d.strain = strain;
  d.gridOn = gridOn;
  if (gridOn == GridOn::moving) d.compartments[0].elementSurface = ElementPlane{PlaneFacing::down};
  d.copyTolerance = -1;
  return d;
}

const JointCoordinates kPressed{0.01, 0.02, 0.05, 0.0003, 0.0414, 0.0001};

TEST(GridOnMoving, SphereOnFlatLayerIsTheClosedForm) {
  // Elements on the sphere at angle psi from its lowest point: AB = D - R(1 - cos psi) along y, theta = psi; with the linear law
  // p cos(theta/2) = K AB/h, and F = 2 pi R^2 (K/h) int AB sin(psi) dpsi = pi R K D^2/h: larger by 2D/(3R) than with the grid on
  // the layer. Tolerance: the smooth rule's N^-4 with N = 10 cells per contact radius, as in ReferenceCasesTest.
  const double R = 0.030, D = 0.2e-3, K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.005, 40);
  d.gridOn = GridOn::moving;
  const double exact = kPi * R * K * D * D / h;
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()).toRotationMatrix();
  const Vec3 center(0.013, h + R - D, -0.02);
  for (const Mat3& rotation : {Mat3(Mat3::Identity()), turn}) {
    ElementSphere s;
    s.zero = rotation.transpose() * -Vec3::UnitY();
    s.axis = rotation.transpose() * Vec3::UnitZ();
    s.angle0_rad = s.elevation0_rad = -0.16;
    s.angle1_rad = s.elevation1_rad = 0.16;
    d.compartments[0].elementSurface = s;
    const auto r = ContactPair(d).evaluate(at(center, rotation));
    ASSERT_EQ(r.status, EvaluationStatus::ok);
    EXPECT_LT((r.total.forceOnM_F - Vec3(0, exact, 0)).norm() / exact, 1e-6) << r.total.forceOnM_F.transpose();
    EXPECT_LT((r.total.momentOnM_Fo_F - center.cross(Vec3(0, exact, 0))).norm() / (exact * center.norm()), 1e-6);
    EXPECT_NEAR(r.total.peakPressure_Pa / (K * D / h), 1, 1e-6);
    EXPECT_NEAR(r.total.area_m2 / (2 * kPi * R * D), 1, 1e-5);
    EXPECT_LT((r.total.peakPoint_F - (center - R * Vec3::UnitY())).norm(), 1e-6);
    EXPECT_LT((r.total.centerOfPressure_F - r.total.peakPoint_F).head<1>().norm(), 1e-6);
  }
}

TEST(GridOnMoving, ThePoseWhoseInverseHasNoCoordinates) {
  // R_FM with R(2,0) = 1: the inverse rotation is at gimbal lock of the 1-2-3 sequence. The exchanged pair works with poses.
  const double R = 0.030, D = 0.2e-3;
  auto d = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.005, 40);
  d.gridOn = GridOn::moving;
  const JointCoordinates q{0.5 * kPi, 0, 0.5 * kPi, 0, h + R - D, 0};
  ASSERT_NEAR(std::abs(calcPose(q).R(2, 0)), 1, 1e-12);
  ElementSphere s;
  s.zero = calcPose(q).R.transpose() * -Vec3::UnitY();
  s.axis = s.zero->unitOrthogonal();
  s.angle0_rad = s.elevation0_rad = -0.16;
  s.angle1_rad = s.elevation1_rad = 0.16;
  d.compartments[0].elementSurface = s;
  ContactPair::Options options;
  options.withStiffness = true;
  const auto r = ContactPair(d).evaluate(q, options);
  const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa, exact = kPi * R * K * D * D / h;
  EXPECT_NEAR(r.total.forceOnM_F.y() / exact, 1, 1e-6);
  EXPECT_NEAR(r.stiffness(1, 4) / (-2 * exact / D), 1, 1e-5);  // dF/dy = -2 pi R K D/h; one order less than the force
}

TEST(GridOnMoving, IdenticalSpheresWithTheirLayersExchanged) {
  // Inversion through the middle between the centres exchanges the bodies and turns +y rays into -y rays: the force on M is the
  // same, the moment on F about Mo is that on M about Fo. Both pairs do the same arithmetic on mirrored numbers; what differs is
  // the charts of the spheres that feet fall in (tolerance of a foot 1e-13 m against 0.2 mm: 1e-9).
  const double R = 0.030;
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    auto onFixed = makeScene(share(makeSphere(R)), share(makeSphere(R)), constantThickness(0.002), uhmwpe(), 0.006, 31);
    onFixed.movingThickness = constantThickness(0.003);
    onFixed.movingMaterial = cartilage();
    onFixed.strain = StrainMeasure::large;
    onFixed.rule = rule;
    auto onMoving = onFixed;
    onMoving.gridOn = GridOn::moving;
    std::swap(onMoving.material, *onMoving.movingMaterial);
    onMoving.fixedThickness = constantThickness(0.003);
    onMoving.movingThickness = constantThickness(0.002);
    onMoving.compartments[0].elementSurface = ElementPlane{PlaneFacing::down};
    const ContactPair a(onFixed), b(onMoving);
    EXPECT_EQ(a.numElements(), b.numElements());
    EXPECT_EQ(b.definition().gridOn, GridOn::moving);
    EXPECT_EQ(b.definition().material, onMoving.material);
    const Vec3 p = (2 * R - 0.0003) * Vec3(0.04, 1, -0.02).normalized();
    const NetLoad A = a.evaluate(at(p)).total, B = b.evaluate(at(p)).total;
    const double F = A.forceOnM_F.norm();
    ASSERT_GT(F, 10);
    EXPECT_LT((B.forceOnM_F - A.forceOnM_F).norm(), 1e-9 * F);
    EXPECT_LT((B.momentOnM_Fo_F - (p.cross(A.forceOnM_F) - A.momentOnM_Fo_F)).norm(), 1e-9 * F * R);
    EXPECT_NEAR(B.energy_J, A.energy_J, 1e-9 * A.energy_J);
    EXPECT_NEAR(B.area_m2, A.area_m2, 1e-9 * A.area_m2);
    EXPECT_NEAR(B.peakPressure_Pa, A.peakPressure_Pa, 1e-9 * A.peakPressure_Pa);
    EXPECT_LT((B.peakPoint_F + A.peakPoint_F - p).norm(), 1e-9);
    EXPECT_LT((B.centerOfPressure_F + A.centerOfPressure_F - p).norm(), 1e-9);
  }
}

TEST(GridOnMoving, TheChoiceChangesTheForceAsPredicted) {
  // dF/F = (D/3) tr(kappa_M + kappa_F) to leading order (theory.md); what is left out is smaller by about D kappa and theta^2,
  // both below 1 % here. A ball in a dish, on a ball, and on a saddle's convex direction.
  const double R = 0.030, D = 0.05e-3;
  struct Case {
    std::vector<NurbsPatch> fixed;
    double curvature;  // trace of kappa_F, positive where concave
  };
  for (const Case& c : {Case{makeDish(0, 0.060, 0.045, Solid::below, 0.02), 1 / 0.060 + 1 / 0.045},
                        Case{makeParaboloid(0, -0.080, -0.080, Solid::below, 0.02), -2 / 0.080},
                        Case{makeParaboloid(0, -0.050, 0.070, Solid::below, 0.02), -1 / 0.050 + 1 / 0.070}}) {
    auto onFixed = makeScene(share(c.fixed), share(makeSphere(R)), constantThickness(h), uhmwpe(), 0.005, 60);
    auto onMoving = onFixed;
    onMoving.gridOn = GridOn::moving;
    onMoving.compartments[0].elementSurface = ElementPlane{PlaneFacing::down};
    const JointCoordinates q = at({0, R - D, 0});
    const double a = ContactPair(onFixed).evaluate(q).total.forceOnM_F.y(), b = ContactPair(onMoving).evaluate(q).total.forceOnM_F.y();
    const double predicted = D / 3 * (2 / R + c.curvature);
    EXPECT_NEAR((b / a - 1) / predicted, 1, 0.02) << predicted;
  }
}

TEST(GridOnMoving, StiffnessIsTheDerivativeOfTheLoad) {
  struct Case {
    Material material;
    StrainMeasure strain;
    std::optional<Material> movingMaterial;
  };
  for (const Case& c : {Case{uhmwpe(), StrainMeasure::small, {}}, Case{cartilage(), StrainMeasure::large, {}},
                        Case{uhmwpe(), StrainMeasure::small, cartilage()}}) {
    auto d = makeCondyleGrid(GridOn::moving, c.material, c.strain);
    if (c.movingMaterial) {
      d.movingMaterial = c.movingMaterial;
      d.movingThickness = constantThickness(0.002);
    }
    const ContactPair pair(d);
    ContactPair::Options options;
    options.withStiffness = true;
    const auto r = pair.evaluate(kPressed, options);
    ASSERT_GT(r.total.scalarForce_N, 5);
    for (size_t j = 0; j < 6; ++j) {
      const double step = j < 3 ? 2e-5 : 5e-7;  // five-point differences, as in SmoothRuleTest
      const auto load = [&](double times) {
        JointCoordinates q = kPressed;
        q[j] += times * step;
        const NetLoad l = pair.evaluate(q, {}).total;
        Vector6 w;
        w << l.forceOnM_F, l.momentOnM_Fo_F;
        return w;
      };
      const Vector6 expected = (load(-2) - 8 * load(-1) + 8 * load(1) - load(2)) / (12 * step);
      const Vector6 column = r.stiffness.col(static_cast<Eigen::Index>(j));
      EXPECT_LT((column - expected).norm() / expected.norm(), 1e-7) << "column " << j << ": " << column.transpose() << " | " << expected.transpose();
    }
  }
}

TEST(GridOnMoving, LoadIsTheGradientOfTheEnergy) {
  // Action and reaction: with the correction off, a constant thickness and whole elements the load on F is the gradient of the
  // energy in the frame of M. Mapped to M and F it must be that in the six coordinates: -dE = f.v + m.w for every motion.
  // Central differences of step 1e-6: the square of the step over the penetration, 1e-4 of 1e-2; the energy's own kinks at
  // switching cells are of the third order in the step (p ~ d).
  auto d = makeCondyleGrid(GridOn::moving, cartilage(), StrainMeasure::large);
  d.correction = Correction::none;
  d.rule = ContactRule::centre;
  const ContactPair pair(d);
  const auto r = pair.evaluate(kPressed);
  ASSERT_GT(r.total.scalarForce_N, 5);
  for (size_t j = 0; j < 6; ++j) {
    const double step = j < 3 ? 2e-6 : 1e-7;
    JointCoordinates low = kPressed, high = kPressed, rate{};
    low[j] -= step;
    high[j] += step;
    rate[j] = 1;
    const double work = ContactPair::calcPower(r.total, calcSpatialVelocity(kPressed, rate), calcPose(kPressed).p);
    const double slope = (pair.evaluate(high).total.energy_J - pair.evaluate(low).total.energy_J) / (2 * step);
    const double scale = r.total.scalarForce_N * (j < 3 ? 0.03 : 1);
    EXPECT_NEAR(work, -slope, 1e-6 * scale) << j;
  }
}

TEST(GridOnMoving, FieldsAreInF) {
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    auto d = makeCondyleGrid(GridOn::moving);
    d.rule = rule;
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactResult r;
    pair.evaluate(kPressed, workspace, {}, r);
    const auto fields = pair.calcFields(workspace);
    const Pose X = calcPose(kPressed);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    int active = 0;
    for (const ElementField& f : fields[0]) {
      // On the moving surface, normal outward from M: downwards.
      const ClosestPoint foot = d.compartments[0].movingSurface->findClosestPoint(X.applyInverse(f.p_FA));
      EXPECT_LT(std::abs(foot.distance_m), 1e-9);
      EXPECT_GT(f.normal_F.dot(X.R * foot.normal_M), 1 - 1e-9);
      EXPECT_LT(f.normal_F.y(), 0);
      if (!f.active) continue;
      ++active;
      // Signed distance to the fixed surface, both rules; the force on M points off the dish.
      const ClosestPoint onF = d.compartments[0].fixedSurface->findClosestPoint(f.p_FA);
      EXPECT_NEAR(f.distance_m, onF.distance_m, 1e-9);
      EXPECT_GT(f.forceDirection_F.y(), 0.9);
      force += f.force_N * f.forceDirection_F;
      moment += f.p_FA.cross(f.force_N * f.forceDirection_F);
    }
    EXPECT_EQ(active, r.total.activeElements);
    // Centre rule: the sum itself. Smooth rule: the cell's own direction instead of the nodes', second order in the cell.
    const double tolerance = rule == ContactRule::centre ? 1e-12 : 2e-3;
    EXPECT_LT((force - r.total.forceOnM_F).norm(), tolerance * r.total.scalarForce_N);
    EXPECT_LT((moment - r.total.momentOnM_Fo_F).norm(), tolerance * r.total.scalarForce_N * 0.04);
  }
}

TEST(GridOnMoving, WarmIsCold) {
  for (const Tracking tracking : {Tracking::all, Tracking::lipschitz, Tracking::breadthFirst}) {
    auto d = makeCondyleGrid(GridOn::moving);
    d.tracking = tracking;
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactPair::Options options;
    options.withStiffness = true;
    ContactResult warm;
    for (int i = 0; i < 40; ++i) {
      JointCoordinates q = kPressed;
      q[2] += 0.004 * i;
      q[4] += 0.0004 * std::sin(0.7 * i);
      q[3] += 0.00005 * i;
      pair.evaluate(q, workspace, options, warm);
      const auto cold = pair.evaluate(q, options);
      const double F = std::max(1.0, cold.total.scalarForce_N);
      EXPECT_LT((warm.total.forceOnM_F - cold.total.forceOnM_F).norm(), 1e-9 * F);
      EXPECT_LT((warm.total.momentOnM_Fo_F - cold.total.momentOnM_Fo_F).norm(), 1e-9 * F * 0.05);
      EXPECT_LT((warm.stiffness - cold.stiffness).norm(), 1e-6 * std::max(1.0, cold.stiffness.norm()));
    }
    // The same pose again is copied, in the coordinates of the user.
    pair.evaluate(kPressed, workspace, {}, warm);
    EXPECT_FALSE(warm.copied);  // copyTolerance -1
  }
  auto d = makeCondyleGrid(GridOn::moving);
  d.copyTolerance = 1e-6;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult r;
  pair.evaluate(kPressed, workspace, {}, r);
  JointCoordinates q = kPressed;
  q[4] += 5e-7;
  pair.evaluate(q, workspace, {}, r);
  EXPECT_TRUE(r.copied);
}

TEST(GridOnMoving, MessagesNameTheRightBody) {
  const auto message = [](const ContactPairDefinition& d) -> std::string {
    try {
      ContactPair{d};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  auto d = makeCondyleGrid(GridOn::moving);
  ASSERT_EQ(message(d), "");
  auto bad = d;
  bad.compartments[0].elementSurface = ElementPlane{PlaneFacing::up};  // the condyle's outer side faces down
  EXPECT_NE(message(bad).find("the moving surface"), std::string::npos) << message(bad);
  bad = d;
  bad.compartments[0].fixedSurface = nullptr;
  EXPECT_NE(message(bad).find("the fixed surface is missing"), std::string::npos) << message(bad);
  bad = d;
  bad.compartments[0].x0_m = 1;
  bad.compartments[0].x1_m = 2;
  EXPECT_NE(message(bad).find("and the moving surface"), std::string::npos) << message(bad);
  bad = d;
  bad.fixedThickness.source = HeightAbovePlane{0.0085};  // the dish crosses it
  EXPECT_NE(message(bad).find("thickness of the fixed body"), std::string::npos) << message(bad);
  bad = d;
  bad.planeY_m = -1;
  EXPECT_NE(message(bad).find("the moving surface (y"), std::string::npos) << message(bad);
  EXPECT_NE(message(bad).find("raise the plane"), std::string::npos) << message(bad);
}

}  // namespace
}  // namespace genu::contact
