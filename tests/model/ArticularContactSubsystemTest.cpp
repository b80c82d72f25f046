#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "KneeFixtures.h"
#include "genu/model/ArticularContactSubsystem.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {
namespace {

using namespace testing_support;
using SimTK::Stage;
using SimTK::Transform;

contact::Vec3 toEigen(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

/** Two free bodies in space with the sphere-on-layer pair between frames that are neither body's own. */
struct FreeBodies {
  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::GeneralForceSubsystem forces{system};
  ArticularContactSubsystem contact{system};
  SimTK::MobilizedBody::Free fixed, moving;
  Transform X_FixedF{SimTK::Rotation(0.4, SimTK::UnitVec3(1, 2, 3)), SimTK::Vec3(0.1, -0.05, 0.02)};
  Transform X_MovingM{SimTK::Rotation(-1.1, SimTK::UnitVec3(3, -1, 2)), SimTK::Vec3(-0.02, 0.07, 0.03)};
  std::shared_ptr<const contact::ContactPair> pair;

  explicit FreeBodies(contact::Correction correction = contact::Correction::midsurface, double damping_sPerM = 0) {
    const SimTK::Body::Rigid body(SimTK::MassProperties(2, SimTK::Vec3(0), SimTK::Inertia(0.01, 0.01, 0.01)));
    fixed = SimTK::MobilizedBody::Free(matter.updGround(), body);
    moving = SimTK::MobilizedBody::Free(matter.updGround(), body);
    auto definition = sphereScene("", 30, correction).contacts[0].definition;
    definition.damping_sPerM = damping_sPerM;
    pair = std::make_shared<const contact::ContactPair>(definition);
    contact.addContactPair("sphere", pair,
                           {fixed.getMobilizedBodyIndex(), X_FixedF, moving.getMobilizedBodyIndex(), X_MovingM});
    system.realizeTopology();
  }

  /** The fixed body anywhere, the moving one so that M has pose X_FM in F. */
  SimTK::State place(const Transform& X_FM) {
    SimTK::State state = system.getDefaultState();
    system.realizeModel(state);
    const Transform X_GFixed(SimTK::Rotation(0.9, SimTK::UnitVec3(-1, 1, 0.5)), SimTK::Vec3(0.3, 1.2, -0.4));
    fixed.setQToFitTransform(state, X_GFixed);
    moving.setQToFitTransform(state, X_GFixed * X_FixedF * X_FM * ~X_MovingM);
    return state;
  }
};

const Transform kPressed(SimTK::Rotation(0.2, SimTK::UnitVec3(0.3, 1, -0.2)), SimTK::Vec3(0.8e-3, 35.8e-3, -0.5e-3));

TEST(ArticularContactSubsystem, PutsTheEnginesLoadOnBothBodiesOfAnyTree) {
  FreeBodies bodies;
  const SimTK::State state = bodies.place(kPressed);
  bodies.system.realize(state, Stage::Dynamics);

  contact::Pose X_FM;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) X_FM.R(i, j) = kPressed.R()[i][j];
  }
  X_FM.p = toEigen(kPressed.p());
  const contact::NetLoad expected = bodies.pair->evaluate(contact::calcCoordinates(X_FM)).total;
  ASSERT_GT(expected.scalarForce_N, 1000);

  const auto& spatial = bodies.system.getRigidBodyForces(state, Stage::Dynamics);
  const SimTK::SpatialVec onMoving = spatial[bodies.moving.getMobilizedBodyIndex()];
  const SimTK::SpatialVec onFixed = spatial[bodies.fixed.getMobilizedBodyIndex()];
  const Transform X_GF = bodies.fixed.getBodyTransform(state) * bodies.X_FixedF;
  // Back from (moment about the body's origin, force) in ground to (force, moment about Fo) in F. Tolerance: the pose
  // loses 1e-16 m over the meters to ground and back; times a stiffness of 1e7 N/m that is 1e-9 N.
  const SimTK::Vec3 p_GMo = bodies.moving.getBodyOriginLocation(state), p_GFo = X_GF.p();
  const SimTK::Vec3 force_F = ~X_GF.R() * onMoving[1];
  const SimTK::Vec3 moment_F = ~X_GF.R() * (onMoving[0] + (p_GMo - p_GFo) % onMoving[1]);
  EXPECT_LT((toEigen(force_F) - expected.forceOnM_F).norm(), 1e-7);
  EXPECT_LT((toEigen(moment_F) - expected.momentOnM_Fo_F).norm(), 1e-8);

  // Newton's third law in ground: force and moment about ground's origin vanish.
  const SimTK::Vec3 p_GFixed = bodies.fixed.getBodyOriginLocation(state);
  EXPECT_LT((onMoving[1] + onFixed[1]).norm(), 1e-10);
  EXPECT_LT((onMoving[0] + p_GMo % onMoving[1] + onFixed[0] + p_GFixed % onFixed[1]).norm(), 1e-10);
}

TEST(ArticularContactSubsystem, ReportsTheEnginesEnergyLazily) {
  FreeBodies bodies;
  const SimTK::State state = bodies.place(kPressed);
  bodies.system.realize(state, Stage::Dynamics);
  EXPECT_EQ(bodies.contact.getCounters(state).evaluations, 1) << "one evaluation, without energy";
  EXPECT_EQ(bodies.contact.getResult(state, 0).total.energy_J, 0);
  const double energy = bodies.system.calcPotentialEnergy(state);
  EXPECT_EQ(bodies.contact.getCounters(state).evaluations, 2);
  EXPECT_EQ(energy, bodies.contact.getResultWithEnergy(state, 0).total.energy_J);
  contact::ContactWorkspace cold(*bodies.pair);
  contact::ContactResult result;
  bodies.pair->evaluate(bodies.contact.calcPose(state, 0), cold, {true}, result);
  EXPECT_NEAR(energy / result.total.energy_J, 1, 1e-10);
}

TEST(ArticularContactSubsystem, AddsToGravityAndSprings) {
  const SimTK::Vec3 attachment(0.02, 0, 0), gravity(0, -9.81, 0);
  const double stiffness = 1e4, length = 0.01;
  FreeBodies alone, together;
  SimTK::Force::Gravity(together.forces, together.matter, gravity);
  SimTK::Force::TwoPointLinearSpring(together.forces, together.fixed, attachment, together.moving, SimTK::Vec3(0),
                                     stiffness, length);
  together.system.realizeTopology();
  const auto forceOnMoving = [](FreeBodies& bodies) {
    const SimTK::State state = bodies.place(kPressed);
    bodies.system.realize(state, Stage::Dynamics);
    return bodies.system.getRigidBodyForces(state, Stage::Dynamics)[bodies.moving.getMobilizedBodyIndex()][1];
  };
  const SimTK::State state = together.place(kPressed);
  together.system.realize(state, Stage::Position);
  const SimTK::Vec3 line =
      together.fixed.findStationLocationInGround(state, attachment) - together.moving.getBodyOriginLocation(state);
  const SimTK::Vec3 others = stiffness * (line.norm() - length) * line / line.norm() + 2 * gravity;  // 2 kg
  EXPECT_LT((forceOnMoving(together) - forceOnMoving(alone) - others).norm(), 1e-9);
}

// With the distance along the closest line and constant thickness the force is the gradient of the energy
// (Correction::none). Central differences of step e err by e^2 E'''/6 ~ (1e-6)^2 * 1e7/1e-3 / 6 ~ 2e-3 N of 1.5e3 N,
// and kinks of single elements at the rim add the same order: 1e-5 relative.
TEST(ArticularContactSubsystem, ForceIsTheGradientOfTheEnergyWithoutCorrection) {
  const TemporaryFile urdf("gradient.urdf", kneeUrdf());
  scene::Scene scene = kneeScene(urdf.path());
  scene.contacts[0].definition.correction = contact::Correction::none;
  scene.contacts[0].definition.fixedThickness.source = contact::ConstantThickness{8e-3};
  scene.loads.clear();
  for (scene::CoordinateSpec& spec : scene.model->coordinates) spec = scene::FreeCoordinate{};
  KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  const double pose[6] = {0.002, 0.03, -0.4, 1e-3, 37.8e-3, 0.3e-3};
  const auto energyAt = [&](int coordinate, double change) {
    for (int i = 0; i < 6; ++i) knee.joint().setOneQ(state, i, pose[i] + (i == coordinate ? change : 0));
    knee.system().realize(state, Stage::Dynamics);
    return knee.system().calcPotentialEnergy(state);
  };
  energyAt(0, 0);
  SimTK::Vector generalized;
  knee.matter().multiplyBySystemJacobianTranspose(state, knee.system().getRigidBodyForces(state, Stage::Dynamics),
                                                  generalized);
  ASSERT_GT(knee.contact().getResult(state, 0).compartments[0].activeElements, 20);
  ASSERT_GT(knee.contact().getResult(state, 0).compartments[1].activeElements, 20);
  for (int i = 0; i < 6; ++i) {
    const double step = i < 3 ? 2e-5 : 5e-7;
    const double slope = (energyAt(i, step) - energyAt(i, -step)) / (2 * step);
    const double scale = generalized[4] * (i < 3 ? 0.025 : 1.0);
    EXPECT_NEAR(-slope, generalized[i], 1e-5 * scale) << scene::kCoordinateNames[static_cast<size_t>(i)];
  }
}

TEST(ArticularContactSubsystem, RatesAreThoseOfTheJointAndPowerFeedsTheEnergy) {
  const TemporaryFile urdf("rates.urdf", kneeUrdf(3, "xyz='0.1 0.2 -0.3' rpy='0.3 -0.2 0.5'"));
  scene::Scene scene = kneeScene(urdf.path());
  scene.contacts[0].definition.correction = contact::Correction::none;
  scene.contacts[0].definition.fixedThickness.source = contact::ConstantThickness{8e-3};
  for (scene::CoordinateSpec& spec : scene.model->coordinates) spec = scene::FreeCoordinate{};
  KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  const contact::JointCoordinates q = {0.002, 0.03, -0.4, 1e-3, 37.8e-3, 0.3e-3};
  const contact::JointCoordinates u = {0.2, -0.5, 1.5, 0.02, -0.03, 0.01};
  const auto energyAt = [&](double time) {
    for (int i = 0; i < 6; ++i) {
      const auto k = static_cast<size_t>(i);
      knee.joint().setOneQ(state, i, q[k] + time * u[k]);
      knee.joint().setOneU(state, i, u[k]);
    }
    knee.system().realize(state, Stage::Velocity);
    return knee.contact().getResultWithEnergy(state, 0).total.energy_J;
  };
  const double dt = 5e-6;  // moves of 1e-7 m
  const double slope = (energyAt(dt) - energyAt(-dt)) / (2 * dt);
  energyAt(0);
  const ArticularContactSubsystem::Rates& rates = knee.contact().getRates(state, 0);
  const contact::SpatialVelocity expected = contact::calcSpatialVelocity(q, u);
  EXPECT_LT((rates.V_FM.w_FM - expected.w_FM).norm(), 1e-13);
  EXPECT_LT((rates.V_FM.v_FMo - expected.v_FMo).norm(), 1e-15);
  EXPECT_NEAR(rates.power_W / -slope, 1, 1e-4);
}

TEST(ArticularContactSubsystem, CopiedStateStartsColdAndHistoryDoesNotMatter) {
  FreeBodies bodies;
  SimTK::State warm = bodies.place(kPressed);
  bodies.system.realize(warm, Stage::Dynamics);
  for (int i = 0; i < 20; ++i) {  // wander away and back
    Transform pose = kPressed;
    pose.updP() += SimTK::Vec3(1e-3 * std::sin(i), 2e-3 * std::cos(i), -1e-3 * std::sin(2 * i));
    const SimTK::State there = bodies.place(pose);
    warm.updQ() = there.getQ();
    bodies.system.realize(warm, Stage::Dynamics);
  }
  warm.updQ() = bodies.place(kPressed).getQ();
  bodies.system.realize(warm, Stage::Dynamics);
  const SimTK::State copy = warm;
  EXPECT_EQ(bodies.contact.getCounters(copy).evaluations, 0);
  bodies.system.realize(copy, Stage::Dynamics);
  const contact::NetLoad& a = bodies.contact.getResult(warm, 0).total;
  const contact::NetLoad& b = bodies.contact.getResult(copy, 0).total;
  // The foot's tangential residual of 1e-13 m changes the distance in second order only.
  EXPECT_NEAR(a.forceOnM_F.y() / b.forceOnM_F.y(), 1, 1e-12);
  EXPECT_LT((a.momentOnM_Fo_F - b.momentOnM_Fo_F).norm(), 1e-11);
  EXPECT_EQ(a.activeElements, b.activeElements);
}

// A sphere bounces on the layer under gravity, integrated by one of Simbody's own integrators; total energy is kept
// when the force is conservative. The integrator's accuracy of 1e-9 per step over some thousand steps (a kink whenever
// an element enters or leaves costs one of them its order) leaves 1e-5 of the exchanged energy.
TEST(ArticularContactSubsystem, EnergyIsConservedUndamped) {
  const TemporaryFile urdf("energy.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 40, contact::Correction::none);
  scene.model->gravity_mPerS2 = {0, -9.81, 0};
  KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  knee.prescribe(state, 0, false);
  knee.joint().setOneQ(state, y, 36.1e-3);  // 0.1 mm above the layer
  knee.joint().setOneU(state, y, -0.05);
  knee.system().realize(state, Stage::Acceleration);
  const double start = knee.system().calcEnergy(state), kinetic = knee.system().calcKineticEnergy(state);

  SimTK::RungeKuttaMersonIntegrator integrator(knee.system());
  integrator.setAccuracy(1e-9);
  SimTK::TimeStepper stepper(knee.system(), integrator);
  stepper.initialize(state);
  double largestContactEnergy = 0, drift = 0;
  for (int i = 1; i <= 30; ++i) {
    stepper.stepTo(i * 3e-4);
    const SimTK::State& now = integrator.getState();
    knee.system().realize(now, Stage::Dynamics);
    largestContactEnergy = std::max(largestContactEnergy, knee.contact().getResultWithEnergy(now, 0).total.energy_J);
    drift = std::max(drift, std::abs(knee.system().calcEnergy(now) - start));
  }
  EXPECT_GT(largestContactEnergy, 0.5 * kinetic) << "it must have bounced";
  EXPECT_LT(drift, 1e-5 * kinetic);
}

/** A ball dropped on the layer, which bounces within 9 ms, by one of Simbody's own integrators. */
struct Bounce {
  double kinetic_J = 0;           // at the start
  double largestContactEnergy_J = 0;
  double largestRise_J = -1e300;  // of the total energy, between outputs
  double largestDrift_J = 0;      // of the total energy
  double largestImbalance_J = 0;  // of the total energy and the integral of the dissipated power
  double lost_J = 0;              // at the end
};
Bounce bounce(contact::Correction correction, double damping_sPerM) {
  const TemporaryFile urdf("bounce.urdf", kneeUrdf());
  scene::Scene scene = sphereScene(urdf.path(), 40, correction);
  scene.contacts[0].definition.damping_sPerM = damping_sPerM;
  scene.model->gravity_mPerS2 = {0, -9.81, 0};
  KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  knee.prescribe(state, 0, false);
  knee.joint().setOneQ(state, y, 36.1e-3);  // 0.1 mm above the layer
  knee.joint().setOneU(state, y, -0.05);
  knee.system().realize(state, Stage::Acceleration);
  Bounce out;
  out.kinetic_J = knee.system().calcKineticEnergy(state);
  const double start = knee.system().calcEnergy(state);

  SimTK::RungeKuttaMersonIntegrator integrator(knee.system());
  integrator.setAccuracy(1e-9);
  SimTK::TimeStepper stepper(knee.system(), integrator);
  stepper.initialize(state);
  constexpr double kStep_s = 2e-5;
  constexpr int kSteps = 450;
  double dissipated_J = 0, before_W = 0, middle_W = 0, last = start;
  for (int i = 1; i <= kSteps; ++i) {
    stepper.stepTo(i * kStep_s);
    const SimTK::State& now = integrator.getState();
    knee.system().realize(now, Stage::Dynamics);
    const double energy = knee.system().calcEnergy(now), power_W = knee.contact().getRates(now, 0).dissipated_W;
    EXPECT_GE(power_W, 0);
    out.largestContactEnergy_J = std::max(out.largestContactEnergy_J, knee.contact().getResultWithEnergy(now, 0).total.energy_J);
    out.largestRise_J = std::max(out.largestRise_J, energy - last);
    out.largestDrift_J = std::max(out.largestDrift_J, std::abs(energy - start));
    last = energy;
    if (i % 2 == 1) {
      middle_W = power_W;
    } else {  // Simpson's rule
      dissipated_J += kStep_s / 3 * (before_W + 4 * middle_W + power_W);
      before_W = power_W;
      out.largestImbalance_J = std::max(out.largestImbalance_J, std::abs(energy + dissipated_J - start));
    }
  }
  out.lost_J = start - last;
  EXPECT_GT(out.largestContactEnergy_J, 0.4 * out.kinetic_J) << "it must have bounced";
  return out;
}

// The balance closes to the integrator's 1e-5 (see EnergyIsConservedUndamped) and that of Simpson's rule: the power begins like t^2,
// which costs h^3/T^3 of the loss, h = 20 us of a contact of T = 2 ms: 1e-6.
TEST(ArticularContactSubsystem, DampingTakesWhatTheBalanceMisses) {
  const Bounce b = bounce(contact::Correction::none, 5);
  // One equation of motion for comparison: F = (K/h) pi d^2 (R - d/3) max(0, 1 - c v), vertical springs under the ball, midpoint rule.
  const contact::Material m = polyethylene();
  const double K_Pa = (1 - m.nu) * m.E_Pa / ((1 + m.nu) * (1 - 2 * m.nu)), mass_kg = 2 * b.kinetic_J / (0.05 * 0.05), dt = 1e-7;
  const auto acceleration = [&](double x, double v) {
    const double d = std::max(0.0, -x);
    return K_Pa / 6e-3 * SimTK::Pi * d * d * (0.03 - d / 3) * std::max(0.0, 1 - 5 * v) / mass_kg - 9.81;
  };
  double x = 1e-4, v = -0.05;
  for (int i = 0; i < 90000; ++i) {
    const double xm = x + 0.5 * dt * v, vm = v + 0.5 * dt * acceleration(x, v);
    x += dt * vm;
    v += dt * acceleration(xm, vm);
  }
  ASSERT_GT(x, 0);  // free again: no elastic energy left
  const double lost_J = b.kinetic_J - mass_kg * (0.5 * v * v + 9.81 * (x - 1e-4));
  std::printf("damped ball: loses %.2f %% of its first kinetic energy (one equation of motion: %.2f %%), balance closes to %.1e of it\n",
              100 * b.lost_J / b.kinetic_J, 100 * lost_J / b.kinetic_J, b.largestImbalance_J / b.kinetic_J);
  // Distances along normals instead of verticals: theta^2/2 = d/R at most, d = 0.09 mm, of the force; less of the energies.
  EXPECT_NEAR(b.lost_J / lost_J, 1, 3e-3);
  EXPECT_LT(b.largestImbalance_J, 1.1e-5 * b.kinetic_J);
  EXPECT_LT(b.largestRise_J, 1e-7 * b.kinetic_J);  // monotonic, to the integrator's error of the steps in an interval
}

// Conservative forms keep the energy as in EnergyIsConservedUndamped. The paper's form does not while the ball is pressed in: force and
// energy there belong to different distances, in the order of theta^2, 1.3e-2 at the rim of this contact.
TEST(ArticularContactSubsystem, EnergyFormIsConservedAndThePapersIsNot) {
  const Bounce energy = bounce(contact::Correction::energy, 0), none = bounce(contact::Correction::none, 0),
               paper = bounce(contact::Correction::midsurface, 0);
  std::printf("largest drift of the total energy, of the kinetic energy at the start: correction energy %.1e, none %.1e, midsurface %.1e\n",
              energy.largestDrift_J / energy.kinetic_J, none.largestDrift_J / none.kinetic_J, paper.largestDrift_J / paper.kinetic_J);
  EXPECT_LT(energy.largestDrift_J, 1e-5 * energy.kinetic_J);
  EXPECT_LT(none.largestDrift_J, 1e-5 * none.kinetic_J);
  EXPECT_GT(paper.largestDrift_J, 1e-4 * paper.kinetic_J);
  EXPECT_LT(paper.largestDrift_J, 1.3e-2 * paper.kinetic_J);
}

TEST(ArticularContactSubsystem, DampedLoadOfBodiesAnywhereIsTheEngines) {
  FreeBodies bodies(contact::Correction::midsurface, 1);
  const auto check = [&](const Transform& X_FM) {
    SimTK::State state = bodies.place(X_FM);
    for (int i = 0; i < 6; ++i) {
      bodies.fixed.setOneU(state, i, 0.1 * std::cos(2.0 * i));
      bodies.moving.setOneU(state, i, 0.1 * std::sin(1.0 + i));
    }
    bodies.system.realize(state, Stage::Dynamics);
    EXPECT_EQ(bodies.contact.getCounters(state).evaluations, 1) << "the load at rest is not needed";
    const contact::ContactResult& damped = bodies.contact.getDampedResult(state, 0);
    EXPECT_EQ(bodies.contact.getCounters(state).evaluations, 1);
    const ArticularContactSubsystem::Rates& rates = bodies.contact.getRates(state, 0);
    const contact::NetLoad elastic = bodies.contact.getResult(state, 0).total;
    // It takes what the pressures times approach say, and what acts on the body is the damped load.
    EXPECT_GT(rates.dissipated_W, 0);
    const contact::Vec3 p = bodies.contact.calcPose(state, 0).p;
    EXPECT_NEAR(contact::ContactPair::calcPower(elastic, rates.V_FM, p) - rates.power_W, rates.dissipated_W, 1e-12 * std::abs(rates.power_W));
    const SimTK::Vec3 f_G = bodies.system.getRigidBodyForces(state, Stage::Dynamics)[bodies.moving.getMobilizedBodyIndex()][1];
    const SimTK::Vec3 f_F = ~(bodies.fixed.getBodyTransform(state) * bodies.X_FixedF).R() * f_G;
    EXPECT_LT((toEigen(f_F) - damped.total.forceOnM_F).norm(), 1e-9);
    EXPECT_GT((toEigen(f_F) - elastic.forceOnM_F).norm(), 10);
    // The same velocity through the load's definition: an element that approaches at v_n adds p c v_n; as the sphere's centre moves at v,
    // all elements of this small contact do within theta = 0.12 of its vertical part.
    const double vy = rates.V_FM.v_FMo.y();
    EXPECT_NEAR(damped.total.scalarForce_N / elastic.scalarForce_N, 1 - vy, 0.12 * rates.V_FM.v_FMo.norm());
    return damped.total;
  };
  const contact::NetLoad plain = check(kPressed);
  // A quarter turn of the ball about y is gimbal lock. The ball is round: were it not for its own rates the load would be the same.
  const auto turned = [](double about_y) { return Transform(SimTK::Rotation(about_y, SimTK::YAxis), kPressed.p()); };
  const contact::NetLoad locked = check(turned(SimTK::Pi / 2)), near = check(turned(SimTK::Pi / 2 - 1e-6));
  // Poses 1e-6 rad apart give velocities and loads as close: relative 1e-6 and the stiffness over 1e-6 * 36 mm times 0.2.
  EXPECT_LT((locked.forceOnM_F - near.forceOnM_F).norm(), 1e-5 * plain.scalarForce_N);
}

TEST(ArticularContactSubsystem, RatesOfTheCoordinatesInvertTheVelocity) {
  for (const double ry : {0.3, -1.2, 1.5707, SimTK::Pi / 2, -SimTK::Pi / 2}) {
    contact::JointCoordinates q = {0.4, ry, -0.7, 0.1, 0.2, 0.3};
    const contact::SpatialVelocity V{{0.3, -0.5, 0.8}, {0.1, 0.2, -0.3}};
    const contact::JointCoordinates qdot = ArticularContactSubsystem::calcCoordinateRates(q, V);
    EXPECT_NEAR(q[1], ry, 1.1e-10);
    const contact::SpatialVelocity back = contact::calcSpatialVelocity(q, qdot);
    // Rounding of rates as large as w / cos(ry), at most 1e10 at the lock.
    EXPECT_LT((back.w_FM - V.w_FM).norm(), 1e-15 / std::abs(std::cos(q[1])) * 4);
    EXPECT_EQ(back.v_FMo, V.v_FMo);
  }
}

TEST(ArticularContactSubsystem, ThreadsChangeNoBit) {
  // Counts; runs the last task first.
  class Runner final : public contact::TaskRunner {
   public:
    void run(int count, void (*task)(void*, int), void* context) const override {
      ++runs;
      for (int i = count - 1; i >= 0; --i) task(context, i);
    }
    int numThreads() const override { return 2; }
    mutable int runs = 0;
  } runner;
  const auto forces = [](const contact::TaskRunner* threads) {
    const TemporaryFile urdf("threads.urdf", kneeUrdf());
    const scene::Scene scene = sphereScene(urdf.path(), 100);
    KneeSystem knee(scene);
    knee.contact().setTaskRunner(threads);
    SimTK::State state = knee.system().realizeTopology();
    knee.system().realizeModel(state);
    knee.joint().setOneQ(state, y, 35.8e-3);
    knee.system().realize(state, Stage::Dynamics);
    return knee.contact().getResult(state, 0).total;
  };
  const contact::NetLoad serial = forces(nullptr), threaded = forces(&runner);
  EXPECT_GT(runner.runs, 0);
  EXPECT_GT(serial.scalarForce_N, 1000);
  EXPECT_EQ(serial.forceOnM_F, threaded.forceOnM_F);
  EXPECT_EQ(serial.momentOnM_Fo_F, threaded.momentOnM_Fo_F);
}

TEST(ArticularContactSubsystem, RejectsNonsense) {
  FreeBodies bodies;
  const auto index = bodies.fixed.getMobilizedBodyIndex();
  EXPECT_THROW(bodies.contact.addContactPair("self", bodies.pair, {index, {}, index, {}}), std::invalid_argument);
  EXPECT_THROW(bodies.contact.addContactPair("null", nullptr, {index, {}, bodies.moving.getMobilizedBodyIndex(), {}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace genu::model
