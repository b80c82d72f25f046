#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "ElementFixtures.h"
#include "genu/model/Path.h"
#include "genu/musculoskeletal/Muscle.h"

namespace genu::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::kDegree;
using testing_support::legModel;
using testing_support::legUrdf;
using testing_support::liftModel;
using testing_support::liftUrdf;
using testing_support::TemporaryFile;
using testing_support::valueOf;

scene::Scene parse(const std::string& yaml) { return scene::parseScene(yaml, "scene.yaml"); }

// Straight, through a point of a third body, over each surface, with a moving point, in parallel and at odd angles.
const char* const kElements = R"(
poses: {zero: {hip: 0 deg, knee: "0 deg, 0 deg, 0 deg, 0 mm, 0 mm, 0 mm", ankle: 0 mm}}
wraps:
  condyle: {body: femur, cylinder: {R: 40 mm}, pose: "5 deg, -4 deg, 0 deg, 3 mm, -390 mm, 0 mm"}
  ball: {body: tibia, sphere: {R: 30 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, -60 mm, 5 mm"}
  egg: {body: tibia, ellipsoid: {a: 30 mm, b: 45 mm, c: 22 mm}, pose: "10 deg, 20 deg, 30 deg, -5 mm, -90 mm, 0 mm"}
ligaments:
  straight:
    {stiffness: 4000 N, slack: {strain: 4 %, pose: zero}, path: [{body: femur, at: "30 mm, -200 mm, 10 mm"}, {body: tibia, at: "20 mm, -150 mm, -10 mm"}]}
  via:
    stiffness: 20 N/mm
    slack: {force: 30 N, pose: zero}
    toe_strain: 0.05
    path: [{body: pelvis, at: "50 mm, 0 mm, 20 mm"}, {body: femur, at: "60 mm, -150 mm, 0 mm"}, {body: foot, at: "40 mm, 0 mm, 0 mm"}]
  over_cylinder:
    stiffness: 3000 N
    slack: {strain: 3 %, pose: zero}
    path: [{body: femur, at: "55 mm, -200 mm, 15 mm"}, {wrap: condyle}, {body: tibia, at: "10 mm, -180 mm, 5 mm"}]
  over_ball:
    stiffness: 3000 N
    slack: {strain: 5 %, pose: zero}
    path: [{body: femur, at: "40 mm, -380 mm, 12 mm"}, {wrap: ball}, {body: tibia, at: "-15 mm, -160 mm, 9 mm"}]
  over_egg:
    stiffness: 3000 N
    slack: {strain: 2 %, pose: zero}
    path: [{body: femur, at: "45 mm, -390 mm, 2 mm"}, {wrap: egg}, {body: tibia, at: "-20 mm, -200 mm, 7 mm"}]
springs:
  horn: {stiffness: 5 N/mm, rest: {force: 20 N, pose: zero}, acts: both, path: [{body: femur, at: "0 mm, -380 mm, 30 mm"}, {body: tibia, at: "10 mm, -20 mm, 25 mm"}]}
  moving:
    stiffness: 2 N/mm
    rest: {force: 10 N, pose: zero}
    path:
      - {body: femur, at: "50 mm, -300 mm, 0 mm"}
      - {body: tibia, moving: {coordinate: knee.rz, at: [[-60 deg, 30 mm, -50 mm, 0 mm], [0 deg, 45 mm, -60 mm, 3 mm], [50 deg, 60 mm, -52 mm, 8 mm]]}}
      - {body: tibia, at: "0 mm, -250 mm, 0 mm"}
)";

const char* const kMuscles = R"(
muscles:
  rigid:
    {max_force: 800 N, fibre_length: 120 mm, tendon_length: 110 mm, pennation: 12 deg, excitation: 0.4,
     path: [{body: pelvis, at: "60 mm, 20 mm, 0 mm"}, {body: femur, at: "50 mm, -300 mm, 5 mm"}]}
  compliant:
    {max_force: 600 N, fibre_length: 80 mm, tendon_length: 265 mm, tendon: compliant, pennation: 8 deg, excitation: 0.6,
     path: [{body: femur, at: "55 mm, -220 mm, 15 mm"}, {wrap: condyle}, {body: tibia, at: "10 mm, -170 mm, 5 mm"}]}
)";

class Leg {
 public:
  explicit Leg(const std::string& rest) : file_("leg.urdf", legUrdf()), knee_(parse(legModel(file_.path()) + rest)) {
    state_ = knee_.system().realizeTopology();
    knee_.system().realizeModel(state_);
  }
  KneeSystem& knee() { return knee_; }
  SimTK::State& state() { return state_; }
  void set(const SimTK::Vector& q, const SimTK::Vector& u) {
    state_.updQ() = q;
    state_.updU() = u;
  }
  /** Generalized forces of all force elements. */
  SimTK::Vector calcGeneralizedForces() {
    knee_.system().realize(state_, SimTK::Stage::Dynamics);
    SimTK::Vector f;
    knee_.matter().multiplyBySystemJacobianTranspose(state_, knee_.system().getRigidBodyForces(state_, SimTK::Stage::Dynamics), f);
    return f + knee_.system().getMobilityForces(state_, SimTK::Stage::Dynamics);
  }
  double calcEnergy() {
    knee_.system().realize(state_, SimTK::Stage::Dynamics);
    return knee_.system().calcPotentialEnergy(state_);
  }
  double value(const std::string& label) {
    knee_.system().realize(state_, SimTK::Stage::Dynamics);
    return valueOf(knee_.listElementColumns(), knee_.calcElementOutputs(state_), label);
  }

 private:
  TemporaryFile file_;
  KneeSystem knee_;
  SimTK::State state_;
};

struct Pose {
  SimTK::Vector q{8}, u{8};
};
Pose makePose(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Pose pose;
  for (int i = 0; i < 8; ++i) {
    const bool angle = i < 4;
    pose.q[i] = (angle ? 0.25 : 0.02) * unit(random);
    pose.u[i] = (angle ? 2.0 : 0.3) * unit(random);
  }
  return pose;
}

TEST(ForceElements, StateOrderIsThatOfTheTree) {
  Leg leg("");
  for (int i = 0; i < 8; ++i) EXPECT_EQ(leg.knee().stateIndex(i), i);
  EXPECT_EQ(leg.knee().coordinates()[0].name, "hip.angle");
  EXPECT_EQ(leg.knee().coordinates()[6].name, "knee.z");
  EXPECT_EQ(leg.knee().coordinates()[7].name, "ankle.translation");
  EXPECT_TRUE(leg.knee().elements().empty());
}

// Generalized force = -dV/dq. Central differences with h = 1e-6: truncation h^2 V'''/6, with V''' some 1e7 N/m^2 (4000 N per strain
// on 0.1 m, curvature of wraps 1/0.03 m) 2e-6 N; rounding 1e-15 V/h = 1e-8 N. A toe ends (jump of V''' only) harmlessly.
TEST(ForceElements, ForceIsTheGradientOfTheEnergy) {
  Leg leg(kElements);
  std::mt19937 random(7);
  int wrapped = 0;
  for (int trial = 0; trial < 40; ++trial) {
    Pose pose = makePose(random);
    leg.set(pose.q, SimTK::Vector(8, 0.0));
    const SimTK::Vector force = leg.calcGeneralizedForces();
    for (const auto& element : leg.knee().elements()) wrapped += element->calcPath(leg.state()).size() > 4 ? 1 : 0;
    for (int i = 0; i < 8; ++i) {
      const double h = 1e-6;
      SimTK::Vector q = pose.q;
      q[i] += h;
      leg.set(q, SimTK::Vector(8, 0.0));
      const double above = leg.calcEnergy();
      q[i] -= 2 * h;
      leg.set(q, SimTK::Vector(8, 0.0));
      const double slope = (above - leg.calcEnergy()) / (2 * h);
      EXPECT_NEAR(force[i], -slope, 2e-5 * (1 + std::abs(force[i]))) << trial << ", " << leg.knee().coordinates()[static_cast<size_t>(i)].name;
    }
  }
  EXPECT_GT(wrapped, 40);  // the surfaces do take part
}

// dL/dt = -power of the unit load, against central differences along the motion.
TEST(ForceElements, RateOfLengthIsThatOfTheMotion) {
  Leg leg(kElements);
  std::mt19937 random(8);
  const std::vector<std::string> names = {"ligaments.straight", "ligaments.via", "ligaments.over_cylinder", "ligaments.over_egg", "springs.moving"};
  const auto& scene = leg.knee().scene();
  for (int trial = 0; trial < 10; ++trial) {
    const Pose pose = makePose(random);
    for (const auto& definition : scene.elements) {
      const auto* ligament = dynamic_cast<const scene::LigamentDefinition*>(definition.get());
      const auto* spring = dynamic_cast<const scene::SpringDefinition*>(definition.get());
      const Path path(ligament != nullptr ? ligament->path : spring->path, scene, leg.knee().urdf(), "test");
      Path::Geometry g;
      const auto lengthAt = [&](double t) {
        leg.set(pose.q + t * pose.u, pose.u);
        leg.knee().system().realize(leg.state(), SimTK::Stage::Velocity);
        path.calcGeometry(leg.knee(), leg.state(), g);
        return g.length_m;
      };
      const double h = 1e-6, slope = (lengthAt(h) - lengthAt(-h)) / (2 * h);
      lengthAt(0);
      // h^2 L'''/6 with L''' = u^3/R^2 = 8/0.03^2: 1.5e-9; rounding 1e-16/h = 1e-10.
      EXPECT_NEAR(Path::calcRate_MPerS(leg.knee(), leg.state(), g), slope, 2e-8) << definition->key();
      // The same path without Simbody.
      EXPECT_NEAR(path.calcLength_m(leg.knee().urdf(), leg.knee().readCoordinates(leg.state()).data()), g.length_m, 1e-14);
    }
  }
}

// What all elements together do to the bodies sums up to nothing outside: forces in pairs on a free-floating tree. Ground takes the rest.
TEST(ForceElements, LoadsOfEveryPathBalance) {
  Leg leg(std::string(kElements) + kMuscles);
  std::mt19937 random(9);
  const Pose pose = makePose(random);
  leg.set(pose.q, pose.u);
  leg.knee().settleElements(leg.state());
  leg.knee().system().realize(leg.state(), SimTK::Stage::Dynamics);
  const auto& forces = leg.knee().system().getRigidBodyForces(leg.state(), SimTK::Stage::Dynamics);
  SimTK::Vec3 force(0), moment(0);
  double size = 0;
  for (SimTK::MobilizedBodyIndex b(0); b < leg.knee().matter().getNumBodies(); ++b) {
    const SimTK::Vec3 p = leg.knee().matter().getMobilizedBody(b).getBodyOriginLocation(leg.state());
    force += forces[b][1];
    moment += forces[b][0] + p % forces[b][1];
    size += forces[b][1].norm();
  }
  EXPECT_GT(size, 100);
  EXPECT_LT(force.norm(), 1e-13 * size);
  EXPECT_LT(moment.norm(), 1e-10 * size);  // over the egg: to the geodesic's tolerance
}

// Energy over a free swing: kinetic, gravity and elastic together stay; muscles do the work -integral T dL, which the outputs give by the
// trapezoidal rule (error of 0.25 ms steps: h^2/12 f'' t, below 1e-3 J).
TEST(ForceElements, EnergyBalanceWithAllElements) {
  const TemporaryFile file("leg.urdf", legUrdf());
  std::string text = legModel(file.path());
  text.insert(text.find("  joints"), "  gravity: 0 m/s^2, -9.81 m/s^2, 0 m/s^2\n");
  const std::string analysis = "analysis: {gait: {duration: 0.1 s, output_interval: 0.25 ms, accuracy: 1e-6, settle_first: false}}\n";
  const std::string holders =  // so that nothing flies away
      "  all: {stiffness: 20 N/mm, rest: {length: 0 mm}, acts: both, path: [{body: femur, at: \"0 mm, -380 mm, 5 mm\"}, {body: tibia, at: \"0 mm, 5 mm, 0 mm\"}]}\n";
  const scene::Scene scene = parse(text + kElements + holders + kMuscles + analysis);
  KneeSystem knee(scene);
  const GaitResult result = runGait(knee, scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  // The same without muscles tells the energy of everything else.
  const scene::Scene passive = parse(text + kElements + holders);
  KneeSystem meter(passive);
  SimTK::State state = meter.system().realizeTopology();
  meter.system().realizeModel(state);
  const auto energyOf = [&](const scene::Frame& frame) {
    for (int i = 0; i < 8; ++i) state.updQ()[i] = frame.q[static_cast<size_t>(i)], state.updU()[i] = frame.qdot[static_cast<size_t>(i)];
    meter.system().realize(state, SimTK::Stage::Dynamics);
    return meter.system().calcEnergy(state);
  };
  const double start = energyOf(result.frames.front());
  double work = 0, throughput = 0;
  for (size_t i = 1; i < result.frames.size(); ++i) {
    for (const std::string name : {"rigid", "compliant"}) {
      const auto get = [&](size_t k, const char* quantity) {
        return valueOf(result.elementColumns, result.frames[k].elements, name + quantity);
      };
      const double part = -0.5 * (get(i, ".force_N") + get(i - 1, ".force_N")) * (get(i, ".length_m") - get(i - 1, ".length_m"));
      work += part;
      throughput += std::abs(part);
    }
  }
  for (const scene::Frame& frame : result.frames) {  // a path that jumped through its surface would have made energy
    for (const char* name : {"over_ball", "over_egg", "over_cylinder", "compliant"}) {
      ASSERT_EQ(valueOf(result.elementColumns, frame.elements, std::string(name) + ".inside_wrap"), 0) << frame.time_s;
    }
  }
  const double change = energyOf(result.frames.back()) - start;
  EXPECT_GT(throughput, 0.5);
  EXPECT_NEAR(change, work, 2e-3 * throughput);
}

TEST(ForceElements, DampingTakesPower) {
  Leg leg(R"(
ligaments:
  damped: {stiffness: 4000 N, slack: {length: 250 mm}, damping: 0.01 s, path: [{body: femur, at: "30 mm, -200 mm, 10 mm"}, {body: tibia, at: "20 mm, -150 mm, -10 mm"}]}
)");
  std::mt19937 random(4);
  double total = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Pose pose = makePose(random);
    leg.set(pose.q, SimTK::Vector(8, 0.0));
    const SimTK::Vector still = leg.calcGeneralizedForces();
    leg.set(pose.q, pose.u);
    const SimTK::Vector moving = leg.calcGeneralizedForces();
    const double power = ~(moving - still) * pose.u;
    EXPECT_LE(power, 1e-12);
    total += power;
  }
  EXPECT_LT(total, -1);  // it does take some: 1000 N of tension, 1 % of it per 1/s of strain rate, metres per second
}

// -- statics in closed form ---------------------------------------------------------------------------------------

StaticResult solve(const std::string& yaml) {
  const StaticResult result = runStatic(parse(yaml));
  EXPECT_EQ(result.status, StaticResult::Status::converged) << result.statusText;
  return result;
}

// 20 N hang on a ligament of 30 mm: T = k (e - eps_l) = 20 N beyond the toe.
TEST(ForceElements, WeightOnALigament) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const StaticResult result = solve(liftModel(file.path(), "{free: {start: -31 mm}}") + R"(
ligaments:
  band: {stiffness: 400 N, slack: {length: 30 mm}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
)");
  const double strain = 20.0 / 400 + 0.03;
  EXPECT_NEAR(result.q[0], -0.03 * (1 + strain), 1e-9);  // residual 1e-6 N over 13 N/mm
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "band.force_N"), 20, 2e-6);
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "band.strain"), strain, 1e-8);
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "band.energy_J"), 400 * 0.03 * (std::pow(strain - 0.03, 2) / 2 + 0.03 * 0.03 / 6), 1e-9);
  ASSERT_EQ(result.paths.size(), 1u);
  EXPECT_NEAR(result.paths[0].points_m.back().y(), result.q[0], 1e-15);
}

// Held at a height: half a ring over the cylinder and two straight ends; the closed form of the length gives the force.
TEST(ForceElements, BandOverACylinder) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const StaticResult result = solve(liftModel(file.path(), "{prescribed: -50 mm}") + R"(
wraps: {drum: {body: ground, cylinder: {R: 10 mm}, side: y}}
springs:
  band: {stiffness: 1 N/mm, rest: {length: 100 mm}, path: [{body: ground, at: "-10 mm, -40 mm, 0 mm"}, {wrap: drum}, {body: body, at: "10 mm, 0 mm, 0 mm"}]}
)");
  const double length = 0.04 + contact::kPi * 0.01 + 0.05;
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "band.length_m"), length, 1e-15);
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "band.force_N"), 1000 * (length - 0.1), 1e-9);
  EXPECT_NEAR(result.constraintForce[0], 20 - 1000 * (length - 0.1), 1e-9);  // weight less pull
}

TEST(ForceElements, SlackLengthFromANamedPose) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const StaticResult result = solve(liftModel(file.path(), "{prescribed: -50 mm}") + R"(
poses: {low: {lift: -50 mm}, high: {lift: -30 mm}}
ligaments:
  strained: {stiffness: 400 N, slack: {strain: 2 %, pose: low}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
  pulled: {stiffness: 400 N, slack: {force: 7 N, pose: low}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
  pulled_per_length: {stiffness: 10 N/mm, slack: {force: 7 N, pose: low}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
  loose: {stiffness: 400 N, slack: {strain: -0.5, pose: low}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
springs:
  set: {stiffness: 1 N/mm, rest: {force: 5 N, pose: high}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
)");
  const auto value = [&](const char* label) { return valueOf(result.elementColumns, result.elements, label); };
  EXPECT_NEAR(value("strained.strain"), 0.02, 1e-15);
  EXPECT_NEAR(value("pulled.force_N"), 7, 1e-12);
  EXPECT_NEAR(value("pulled_per_length.force_N"), 7, 1e-12);
  EXPECT_EQ(value("loose.force_N"), 0);
  EXPECT_NEAR(value("set.force_N"), 25, 1e-9);  // 20 mm longer than where it has 5 N
}

// A muscle lifts 20 N: both tendons end at the same tension; the activation is the excitation.
TEST(ForceElements, MuscleHoldsAWeight) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  for (const std::string tendon : {"rigid", "compliant"}) {
    const StaticResult result = solve(liftModel(file.path(), "{free: {start: -150 mm}}") + R"(
muscles:
  lifter: {max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm, excitation: 0.15, tendon: )" + tendon + R"(,
           path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
)");
    const auto value = [&](const char* label) { return valueOf(result.elementColumns, result.elements, label); };
    EXPECT_NEAR(value("lifter.force_N"), 20, 2e-6) << tendon;
    EXPECT_EQ(value("lifter.activation"), 0.15);
    EXPECT_EQ(value("lifter.state"), 0);
    EXPECT_NEAR(value("lifter.fibre_velocity_m_per_s"), 0, 1e-12);
    // The fibre's own law at that length.
    musculoskeletal::MuscleCurves curves;
    const double l = value("lifter.fibre_length_m") / 0.06;
    EXPECT_NEAR(100 * (0.15 * curves.calcActive(l).value + curves.calcPassive(l).value), 20, 1e-5);
    const double stretch = (-result.q[0] - value("lifter.fibre_length_m")) / 0.09;
    EXPECT_NEAR(tendon == "rigid" ? 0.2 : curves.calcTendon(stretch).value, 0.2, 1e-7);
    EXPECT_NEAR(stretch, tendon == "rigid" ? 1 : curves.calcTendonLength(0.2), 1e-9);
  }
}

// An excitation step, as two rows of a table: excitation and activation stay in [0, 1], the force is finite and rises to most of F0.
TEST(ForceElements, ActivationStep) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  scene::Scene scene = parse(liftModel(file.path(), "{prescribed: -155 mm}") + R"(
muscles:
  lifter: {max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm, tendon: compliant, excitation: 0.0, activation: {rise: 10 ms, fall: 40 ms, steepness: inf},
           path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
analysis: {gait: {duration: 0.2 s, output_interval: 2 ms, accuracy: 1e-6}}
)");
  auto muscle = std::make_shared<scene::MuscleDefinition>(dynamic_cast<const scene::MuscleDefinition&>(*scene.elements[0]));
  scene::TimeSeries step;  // nearly a step: 1 ms, cut to [0, 1] where the spline overshoots
  step.source = "step";
  step.time_s = {0, 0.02, 0.021, 0.3};
  step.value = {0, 0, 1, 1};
  muscle->excitation = scene::TimeFunction(step);
  scene.elements = {muscle};
  const GaitResult result = runGait(scene);
  ASSERT_TRUE(result.complete) << result.statusText;
  double last = 0;
  for (const scene::Frame& frame : result.frames) {
    const double a = valueOf(result.elementColumns, frame.elements, "lifter.activation");
    const double e = valueOf(result.elementColumns, frame.elements, "lifter.excitation");
    EXPECT_TRUE(a >= -1e-4 && a <= 1 + 1e-4);
    EXPECT_TRUE(e >= 0 && e <= 1);
    const double force = valueOf(result.elementColumns, frame.elements, "lifter.force_N");
    EXPECT_TRUE(std::isfinite(force) && force >= 0);
    last = force;
  }
  EXPECT_GT(last, 60);
  EXPECT_EQ(result.frames.front().elements.size(), result.elementColumns.size());
}

TEST(ForceElements, TrackingControllerAtRest) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const StaticResult result = solve(liftModel(file.path(), "{free: {start: -150 mm}}") + R"(
muscles:
  lifter: {max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm, excitation: {track: {coordinate: lift.translation, target: -145 mm, gain: 0.1 1/mm, rest: 0.05}},
           path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
)");
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "lifter.excitation"), 0.05 + 100 * (-0.145 - result.q[0]), 1e-9);
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "lifter.force_N"), 20, 2e-6);
}

// The table is linear, and so is the spline through it: e0 = 0.05 at half of the time.
TEST(ForceElements, TrackingControllerWithFeedForward) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const TemporaryFile table("rest.csv", "time,e\n0,0.02\n0.25,0.035\n0.75,0.065\n1,0.08\n");
  const auto scene = [&](const std::string& rest) {
    return liftModel(file.path(), "{free: {start: -150 mm}}") + R"(
muscles:
  lifter: {max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm, excitation: {track: {coordinate: lift.translation, target: -145 mm, gain: 0.1 1/mm, rest: )" +
           rest + R"(}},
           path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
analysis: {static: {time: 0.5 s}}
)";
  };
  const StaticResult result = solve(scene("{table: " + table.path().string() + ", column: e, unit: 1}"));
  EXPECT_NEAR(valueOf(result.elementColumns, result.elements, "lifter.excitation"), 0.05 + 100 * (-0.145 - result.q[0]), 1e-9);
  EXPECT_NEAR(result.q[0], solve(scene("0.05")).q[0], 1e-9);
  const TemporaryFile high("high.csv", "time,e\n0,0.02\n1,1.2\n");
  try {
    solve(scene("{table: " + high.path().string() + ", column: e, unit: 1}"));
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("is 1.2 at 1 s"));
  }
}

// A stop of 10 N/mm below -20 mm carries the 20 N with 2 mm.
TEST(ForceElements, StopHoldsTheCoordinate) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const StaticResult result = solve(liftModel(file.path(), "{free: {start: -10 mm, limits: {lower: -20 mm, upper: 0 mm, stiffness: 10 N/mm}}}"));
  EXPECT_NEAR(result.q[0], -0.022, 1e-9);
}

// A pendulum held by a moment: M = m g r sin(angle); the force's point from tables over time.
TEST(ForceElements, MomentsAndPointsOfLoads) {
  const TemporaryFile file("arm.urdf",
                           "<robot name='arm'><link name='ground'/><link name='arm'><inertial><origin xyz='0 -0.3 0'/><mass value='2'/>"
                           "<inertia ixx='0.01' ixy='0' ixz='0' iyy='0.01' iyz='0' izz='0.01'/></inertial></link>"
                           "<joint name='pivot' type='revolute'><parent link='ground'/><child link='arm'/><axis xyz='0 0 1'/>"
                           "<limit effort='1' velocity='1' lower='-1' upper='1'/></joint></robot>");
  const std::string model = "genu: 1\nmodel:\n  urdf: " + file.path().string() +
                            "\n  gravity: 0 m/s^2, -10 m/s^2, 0 m/s^2\n  joints: {pivot: {angle: free}}\n";
  const StaticResult turned = solve(model + "loads: {motor: {body: arm, frame: ground, moment: \"0 N m, 0 N m, 3 N m\"}}\n");
  EXPECT_NEAR(std::sin(turned.q[0]), 0.5, 1e-7);  // 3 / (2 10 0.3)

  const TemporaryFile table("cop.csv", "time,px\n0,0.1\n1,0.3\n");
  const StaticResult pushed = solve(model + "loads:\n  push: {body: arm, frame: ground, force: \"0 N, 15 N, 0 N\", point: {body: ground, at: [{table: " +
                                    table.path().string() + ", column: px, unit: m}, 0 mm, 0 mm]}}\nanalysis: {static: {time: 0.5 s}}\n");
  EXPECT_NEAR(std::sin(pushed.q[0]), 15 * 0.2 / 6, 1e-7);
}

// Two balls on their layers, each with its own floating joint: each sinks as one alone does.
TEST(ForceElements, TwoFloatingJointsWithContact) {
  const auto body = [](const char* name) {
    return std::string("<link name='") + name +
           "'><inertial><mass value='1'/><inertia ixx='0.01' ixy='0' ixz='0' iyy='0.01' iyz='0' izz='0.01'/></inertial></link>";
  };
  const TemporaryFile file("balls.urdf", "<robot name='balls'><link name='ground'/>" + body("one") + body("two") +
                                             "<joint name='a' type='floating'><parent link='ground'/><child link='one'/></joint>"
                                             "<joint name='b' type='floating'><parent link='one'/><child link='two'/></joint></robot>");
  const std::string six = "{rx: {prescribed: 0 deg}, ry: {prescribed: 0 deg}, rz: {prescribed: 0 deg}, x: {prescribed: 0 mm}, y: free, z: {prescribed: 0 mm}}";
  const auto pair = [](const char* name, const char* fixed, const char* moving) {
    return std::string("  ") + name + ": {fixed: {body: " + fixed + ", surface: layer, thickness: 6 mm}, moving: {body: " + moving +
           ", surface: ball}, material: m, compartments: {all: {rectangle: \"-5 mm, 5 mm, -5 mm, 5 mm\", grid: 20x20}}}\n";
  };
  const std::string head = "genu: 1\nsurfaces: {layer: {plane: {y0: 60 mm}}, ball: {sphere: {R: 30 mm}}}\nmaterials: {m: {E: 463 MPa, nu: 0.46}}\n";
  const std::string joints = "model: {urdf: " + file.path().string() + ", joints: {a: " + six + ", b: " + six + "}}\n";
  const std::string push = "loads: {top: {body: two, frame: ground, force: \"0 N, -200 N, 0 N\"}}\n";
  const StaticResult both = solve(head + joints + push + "contact:\n" + pair("lower", "ground", "one") + pair("upper", "one", "two"));
  EXPECT_NEAR(both.q[4], both.q[10], 1e-10);  // the load goes through both
  EXPECT_NEAR(both.contacts[0].total.forceOnM_F.y(), 200, 1e-5);
  EXPECT_NEAR(both.contacts[1].total.forceOnM_F.y(), 200, 1e-5);
  const TemporaryFile single("one.urdf", "<robot name='one'><link name='ground'/>" + body("one") +
                                             "<joint name='a' type='floating'><parent link='ground'/><child link='one'/></joint></robot>");
  const StaticResult alone = solve(head + "model: {urdf: " + single.path().string() + ", joint: a, coordinates: " + six + "}\n" +
                                   "loads: {top: {body: one, frame: ground, force: \"0 N, -200 N, 0 N\"}}\ncontact:\n" +
                                   pair("lower", "ground", "one"));
  EXPECT_NEAR(both.q[4], alone.q[4], 1e-10);
}

TEST(ForceElements, SeriesIsTheStaticAnalysisOfEachTime) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  const TemporaryFile table("push.csv", "time,f\n0,-5\n1,-35\n");
  const std::string text = liftModel(file.path(), "{free: {start: -31 mm}}") + R"(
ligaments:
  band: {stiffness: 400 N, slack: {length: 30 mm}, path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
loads: {push: {coordinate: lift.translation, value: {table: )" + table.path().string() + R"(, column: f, unit: N}}}
analysis: {series: {duration: 1 s, output_interval: 0.25 s}}
)";
  const scene::Trajectory series = runSeries(parse(text));
  ASSERT_TRUE(series.complete) << series.statusText;
  ASSERT_EQ(series.frames.size(), 5u);
  for (size_t i = 0; i < 5; ++i) {
    const double weight = 20 + 5 + 30 * 0.25 * static_cast<double>(i);
    EXPECT_NEAR(series.frames[i].q[0], -0.03 * (1 + 0.03 + weight / 400), 1e-9);
  }
}

// -- defined behaviour at the edges -------------------------------------------------------------------------------

TEST(ForceElements, CoincidentPointsPullNowhere) {
  Leg leg(R"(
springs:
  nothing: {stiffness: 5 N/mm, rest: {length: 0 mm}, acts: both, path: [{body: pelvis, at: "20 mm, 100 mm, 0 mm"}, {body: femur, at: "0 mm, 0 mm, 0 mm"}]}
)");
  const SimTK::Vector force = leg.calcGeneralizedForces();
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(force[i], 0, 1e-15);  // the axis of the hip: up to rounding
  EXPECT_NEAR(leg.value("nothing.length_m"), 0, 1e-16);
}

TEST(ForceElements, EndInsideItsWrapIsSaid) {
  Leg leg(R"(
wraps: {ball: {body: femur, sphere: {R: 30 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, -100 mm, 0 mm"}}
springs:
  inside: {stiffness: 5 N/mm, rest: {length: 0 mm}, path: [{body: femur, at: "0 mm, -90 mm, 0 mm"}, {wrap: ball}, {body: tibia, at: "0 mm, 0 mm, 0 mm"}]}
)");
  EXPECT_EQ(leg.value("inside.inside_wrap"), 1);
  EXPECT_TRUE(std::isfinite(leg.value("inside.force_N")));
}

TEST(ForceElements, MuscleShorterThanItsTendonHangs) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  for (const std::string tendon : {"rigid", "compliant"}) {
    const StaticResult result = solve(liftModel(file.path(), "{prescribed: -50 mm}") + R"(
muscles:
  lifter: {max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm, excitation: 1, tendon: )" + tendon + R"(,
           path: [{body: ground, at: "0 mm, 0 mm, 0 mm"}, {body: body, at: "0 mm, 0 mm, 0 mm"}]}
)");
    EXPECT_EQ(valueOf(result.elementColumns, result.elements, "lifter.force_N"), 0) << tendon;
    EXPECT_EQ(valueOf(result.elementColumns, result.elements, "lifter.state"), static_cast<double>(musculoskeletal::MuscleState::slack));
  }
}

// A scene without elements holds none of their machinery.
TEST(ForceElements, NothingIsPaidWithoutThem) {
  Leg leg("");
  EXPECT_EQ(leg.knee().forces().getNumForces(), 0);
  EXPECT_EQ(leg.state().getNZ(), 0);
}

// -- bad input ----------------------------------------------------------------------------------------------------

std::string errorOf(const std::string& rest) {
  const TemporaryFile file("lift.urdf", liftUrdf());
  try {
    KneeSystem knee(parse(liftModel(file.path()) + rest));
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}
std::string ligament(const std::string& keys, const std::string& path = "[{body: ground, at: \"0 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 9 mm, 0 mm\"}]") {
  return "ligaments:\n  band: {" + keys + ", path: " + path + "}\n";
}
std::string muscle(const std::string& keys) {
  return "muscles:\n  pull: {" + keys + ", path: [{body: ground, at: \"0 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 9 mm, 0 mm\"}]}\n";
}

TEST(ForceElements, BadInputNamesPlaceValueAndRange) {
  const std::string good = "stiffness: 400 N, slack: {length: 30 mm}";
  EXPECT_THAT(errorOf(ligament("stiffness: 400 N, slack: {length: -30 mm}")), AllOf(HasSubstr("scene.yaml:7: ligaments.band.slack.length"), HasSubstr("> 0")));
  EXPECT_THAT(errorOf(ligament("stiffness: -4 N, slack: {length: 30 mm}")), HasSubstr("ligaments.band.stiffness"));
  EXPECT_THAT(errorOf(ligament("stiffness: 4 MPa, slack: {length: 30 mm}")), HasSubstr("ligaments.band.stiffness"));
  EXPECT_THAT(errorOf(ligament("stiffness: 400 N")), AllOf(HasSubstr("ligaments.band.slack"), HasSubstr("missing")));
  EXPECT_THAT(errorOf(ligament("stiffness: 400 N, slack: {length: 3 mm, strain: 0.1}")), HasSubstr("one of length, strain"));
  EXPECT_THAT(errorOf(ligament("stiffness: 400 N, slack: {strain: 0.1, pose: extension}")), AllOf(HasSubstr("pose \"extension\""), HasSubstr("define it")));
  EXPECT_THAT(errorOf(ligament(good + ", toe_strain: 1.5")), AllOf(HasSubstr("ligaments.band.toe_strain"), HasSubstr("0 <= toe strain < 1")));
  EXPECT_THAT(errorOf(ligament(good + ", dampng: 1 s")), HasSubstr("did you mean \"damping\""));
  EXPECT_THAT(errorOf(ligament(good, "[{body: ground, at: \"0 mm, 0 mm, 0 mm\"}, {body: femur, at: \"0 mm, 9 mm, 0 mm\"}]")),
              AllOf(HasSubstr("scene.yaml:7: ligaments.band.path, point 2"), HasSubstr("unknown link \"femur\"; known: ground, body")));
  EXPECT_THAT(errorOf(ligament(good, "[{body: ground, at: \"0 mm, 0 mm, 0 mm\"}]")), HasSubstr("two at least"));
  EXPECT_THAT(errorOf(ligament(good, "[{body: body, at: \"0 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 9 mm, 0 mm\"}]")), HasSubstr("its length never changes"));
  EXPECT_THAT(errorOf(ligament(good, "[{body: ground, at: \"0 mm, 0 mm, 0 mm\"}, {wrap: drum}, {body: body, at: \"0 mm, 9 mm, 0 mm\"}]")), HasSubstr("unknown wrap \"drum\""));
  const std::string hill = "max_force: 100 N, fibre_length: 60 mm, tendon_length: 90 mm";
  EXPECT_THAT(errorOf(muscle(hill + ", excitation: 1.2")), AllOf(HasSubstr("muscles.pull.excitation"), HasSubstr("is 1.2; allowed: 0 to 1")));
  EXPECT_THAT(errorOf(muscle("max_force: 100 N, fibre_length: 0 mm, tendon_length: 90 mm, excitation: 0")), AllOf(HasSubstr("muscles.pull.fibre_length"), HasSubstr("> 0")));
  EXPECT_THAT(errorOf(muscle(hill + ", excitation: 0, pennation: 85 deg")), HasSubstr("pennation"));
  EXPECT_THAT(errorOf(muscle(hill + ", excitation: {track: {coordinate: hip.angle, target: 0 deg, gain: 1 1/deg}}")), HasSubstr("lift.translation"));
  EXPECT_THAT(errorOf("wraps: {drum: {body: ground, cylinder: {R: 0 mm}}}\n"), HasSubstr("wraps.drum.cylinder.R"));
  EXPECT_THAT(errorOf("wraps: {drum: {body: ground, sphere: {R: 9 mm}, side: x}}\n"), HasSubstr("is for cylinders"));
  EXPECT_THAT(errorOf("poses: {up: {}}\n"), HasSubstr("poses.up"));
  EXPECT_THAT(errorOf(ligament(good) + "springs:\n  band: {stiffness: 1 N/mm, rest: {length: 1 mm}, path: [{body: ground, at: \"0 mm, 0 mm, 0 mm\"}, {body: body, at: \"0 mm, 9 mm, 0 mm\"}]}\n"),
              AllOf(HasSubstr("springs.band"), HasSubstr("taken by ligaments.band")));
  EXPECT_THAT(errorOf("ligamentes: {}\n"), HasSubstr("did you mean \"ligaments\""));
}

TEST(ForceElements, JointsOfTheUrdfAreAllListed) {
  const TemporaryFile file("leg.urdf", legUrdf());
  const auto error = [&](const std::string& joints) -> std::string {
    try {
      KneeSystem knee(parse("genu: 1\nmodel: {urdf: " + file.path().string() + ", joints: " + joints + "}\n"));
    } catch (const InputError& e) {
      return e.what();
    }
    return "no InputError";
  };
  EXPECT_THAT(error("{hip: {angle: free}}"), AllOf(HasSubstr("joint 'knee'"), HasSubstr("must list it")));
  EXPECT_THAT(error("{hip: {translation: free}, knee: {angle: free}}"), HasSubstr("but the scene's joint must be 'prismatic'"));
  EXPECT_THAT(error("{hip: {angle: free}, shoulder: {angle: free}}"), AllOf(HasSubstr("scene.yaml:2: model.joints.shoulder: "), HasSubstr("unknown joint \"shoulder\"; known: ankle, hip, knee")));
  EXPECT_THAT(error("{knee: {rx: free}}"), AllOf(HasSubstr("model.joints.knee.ry"), HasSubstr("missing")));
}

}  // namespace
}  // namespace genu::model
