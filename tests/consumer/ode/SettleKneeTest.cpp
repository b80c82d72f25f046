// Another multibody engine, the Open Dynamics Engine, settles a knee with the contact of libgenu_contact.so. The equilibrium
// does not depend on who integrates: the pose must be that of `genu static`. The scene library only reads the files; all
// contact goes through genu_contact.h.

#include <gtest/gtest.h>
#include <ode/ode.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "genu/contact/genu_contact.h"
#include "genu/scene/SceneFile.h"

namespace {

using namespace genu;
using contact::Mat3;
using contact::Vec3;
using Vec6 = std::array<double, 6>;
enum Coordinate { rx, ry, rz, x, y, z };
constexpr Coordinate kFree[3] = {rx, y, z}, kHeld[3] = {ry, rz, x};
constexpr double kArm_m = 0.025;  // a moment over it counts as a force, as in `genu static`

void check(genu_status status) {
  if (status >= GENU_BAD_ARGUMENT) throw std::runtime_error(genu_last_error());
}

/** The contact of a scene, through the C interface. */
class Contact {
 public:
  explicit Contact(const contact::ContactPairDefinition& d) {
    genu_pair_options options;
    genu_pair_options_init(&options, sizeof options);
    std::vector<genu_compartment> compartments;
    for (const contact::CompartmentDefinition& c : d.compartments) {
      compartments.push_back({c.name.c_str(), c.x0_m, c.x1_m, c.z0_m, c.z1_m, c.nx, c.nz, handOver(*c.fixedSurface),
                              handOver(*c.movingSurface)});
    }
    options.compartments = compartments.data();
    options.num_compartments = static_cast<int>(compartments.size());
    options.use_element_plane = d.planeY_m.has_value();
    options.element_plane_y = d.planeY_m.value_or(0);
    options.fixed_thickness = toThickness(d.fixedThickness);
    options.moving_thickness = toThickness(d.movingThickness);
    if (d.material.law != contact::MaterialLaw::linear || d.movingMaterial) {
      throw std::runtime_error("the scene's layers must have one linear material");
    }
    options.material.youngs_modulus = d.material.E_Pa;
    options.material.poisson_ratio = d.material.nu;
    options.strain = d.strain == contact::StrainMeasure::large ? GENU_STRAIN_LARGE : GENU_STRAIN_SMALL;
    options.correction =
        d.correction == contact::Correction::none ? GENU_CORRECTION_NONE : GENU_CORRECTION_MIDSURFACE;
    options.rule = d.rule == contact::ContactRule::centre ? GENU_RULE_CENTRE : GENU_RULE_SMOOTH;
    check(genu_pair_create(&options, &pair_));
    check(genu_workspace_create(pair_, &workspace_));
    genu_result_init(&result_, sizeof result_);
  }
  ~Contact() {
    genu_workspace_destroy(workspace_);
    genu_pair_destroy(pair_);
    for (genu_surface* surface : surfaces_) genu_surface_destroy(surface);
  }
  Contact(const Contact&) = delete;
  Contact& operator=(const Contact&) = delete;

  const genu_result& evaluate(const Vec6& q, const Vec6* rates = nullptr, bool withStiffness = false) {
    genu_evaluate_options options;
    genu_evaluate_options_init(&options, sizeof options);
    options.with_stiffness = withStiffness;
    check(genu_evaluate(pair_, workspace_, q.data(), rates ? rates->data() : nullptr, &options, &result_, nullptr, 0));
    return result_;
  }

 private:
  genu_surface* handOver(const contact::ContactSurface& surface) {
    std::vector<genu_nurbs_patch> patches;
    std::vector<std::vector<double>> points;
    for (int k = 0; k < surface.numPatches(); ++k) {
      const contact::NurbsPatchData& p = surface.patch(k).data();
      std::vector<double>& own = points.emplace_back();
      for (const Vec3& point : p.points) own.insert(own.end(), point.data(), point.data() + 3);
      patches.push_back({p.degreeU, p.degreeV, p.numU, p.numV, static_cast<int>(p.knotsU.size()),
                         static_cast<int>(p.knotsV.size()), p.flipNormal, p.knotsU.data(), p.knotsV.data(), own.data(),
                         p.weights.empty() ? nullptr : p.weights.data()});
    }
    genu_surface* made = nullptr;
    check(genu_surface_create_nurbs(patches.data(), static_cast<int>(patches.size()), &made));
    surfaces_.push_back(made);
    return made;
  }

  genu_thickness toThickness(const contact::Thickness& t) {
    genu_thickness out = {};
    if (const auto* h = std::get_if<contact::ConstantThickness>(&t.source)) {
      out.kind = GENU_THICKNESS_CONSTANT;
      out.value = h->h_m;
    } else if (const auto* plane = std::get_if<contact::HeightAbovePlane>(&t.source)) {
      out.kind = GENU_THICKNESS_ABOVE_PLANE;
      out.value = plane->planeY_m;
    } else if (const auto* back = std::get_if<contact::BackSurface>(&t.source)) {
      out.kind =
          back->direction == contact::BackDirection::normal ? GENU_THICKNESS_BACK_NORMAL : GENU_THICKNESS_BACK_CLOSEST;
      out.back = handOver(*back->surface);
    }
    out.min = t.min_m.value_or(0);
    out.max = t.max_m.value_or(0);
    out.missing = t.missing_m.value_or(0);
    out.map_samples_u = t.mapSamplesU;
    out.map_samples_v = t.mapSamplesV;
    return out;
  }

  std::vector<genu_surface*> surfaces_;
  genu_pair* pair_ = nullptr;
  genu_workspace* workspace_ = nullptr;
  genu_result result_;
};

/** The knee as a rigid body of ODE. With ry and rz held, rx turns M about the x axis of F and x is constant: the motion is
 planar. ODE's joint Plane2D holds a body in its X-Y plane, so that ODE's axes are (y, z, x) of F. */
class OdeKnee {
 public:
  static constexpr double kMass_kg = 0.3, kInertia_kgm2 = 2e-4;  // any: the equilibrium does not depend on them

  OdeKnee(const Vec6& start) : x_(start[x]) {
    dInitODE2(0);
    world_ = dWorldCreate();
    dWorldSetGravity(world_, 0, 0, 0);
    body_ = dBodyCreate(world_);
    dMass mass;
    dMassSetParameters(&mass, kMass_kg, 0, 0, 0, kInertia_kgm2, kInertia_kgm2, kInertia_kgm2, 0, 0, 0);
    dBodySetMass(body_, &mass);
    const contact::Pose pose = contact::calcPose({start[rx], start[ry], start[rz], start[x], start[y], start[z]});
    const Mat3 R = toOde() * pose.R * toOde().transpose();
    dMatrix3 rotation;  // rows of four
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 4; ++j) rotation[4 * i + j] = j < 3 ? R(i, j) : 0;
    }
    dBodySetRotation(body_, rotation);
    dBodySetPosition(body_, start[y], start[z], 0);
    dJointAttach(dJointCreatePlane2D(world_, nullptr), body_, nullptr);
  }
  ~OdeKnee() {
    dWorldDestroy(world_);
    dCloseODE();
  }
  OdeKnee(const OdeKnee&) = delete;
  OdeKnee& operator=(const OdeKnee&) = delete;

  Vec6 coordinates() const {
    const dReal* r = dBodyGetRotation(body_);
    Mat3 R;
    for (int i = 0; i < 3; ++i) R.row(i) << r[4 * i], r[4 * i + 1], r[4 * i + 2];
    R = toOde().transpose() * R * toOde();
    const dReal* p = dBodyGetPosition(body_);
    return {std::atan2(-R(1, 2), R(2, 2)), std::asin(R(0, 2)), std::atan2(-R(0, 1), R(0, 0)), x_ + p[2], p[0], p[1]};
  }
  /** Of rx, y, z; the others are held. */
  Vec3 rates() const {
    const dReal *w = dBodyGetAngularVel(body_), *v = dBodyGetLinearVel(body_);
    return {w[2], v[0], v[1]};
  }
  /** (moment about x through Mo, force y, force z), over one step. */
  void step(const Vec3& load, double dt) {
    dBodyAddForce(body_, load[1], load[2], 0);
    dBodyAddTorque(body_, 0, 0, load[0]);
    dWorldStep(world_, dt);
  }

 private:
  static Mat3 toOde() { return (Mat3() << 0, 1, 0, 0, 0, 1, 1, 0, 0).finished(); }
  dWorldID world_;
  dBodyID body_;
  double x_;
};

/** The scene's one load: a force in F's axes at a point of the moving body or of the fixed one. */
struct Load {
  Vec3 force_F, point;
  bool onMoving;
};

/** What acts on the free coordinates at a pose: contact and load; moment about Mo along x, forces along y and z. */
Vec3 toFree(const Vec3& force_F, const Vec3& momentAboutFo_F, const Vec3& p_FMo) {
  return {(momentAboutFo_F - p_FMo.cross(force_F)).x(), force_F.y(), force_F.z()};
}
Vec3 netLoad(const genu_result& contact, const Load& load, const Vec6& q) {
  const contact::Pose pose = contact::calcPose({q[0], q[1], q[2], q[3], q[4], q[5]});
  const Vec3 at = load.onMoving ? pose.apply(load.point) : load.point;
  const Vec3 force = Eigen::Map<const Vec3>(contact.total.force_on_moving) + load.force_F;
  const Vec3 moment =
      Eigen::Map<const Vec3>(contact.total.moment_on_moving_about_fixed_origin) + at.cross(load.force_F);
  return toFree(force, moment, pose.p);
}
double largest(const Vec3& load) { return std::max({std::abs(load[0]) / kArm_m, std::abs(load[1]), std::abs(load[2])}); }

/** The last row of motion.sto, in rad and m. */
Vec6 readPose(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line, last;
  while (std::getline(in, line)) {
    if (!line.empty()) last = line;
  }
  std::istringstream row(last);
  double time;
  Vec6 q;
  row >> time;
  for (double& value : q) row >> value;
  if (!row) throw std::runtime_error("no pose in " + file.string());
  for (int k = 0; k < 3; ++k) q[static_cast<size_t>(k)] *= contact::kPi / 180;
  return q;
}

class SettleKnee : public testing::TestWithParam<const char*> {};

TEST_P(SettleKnee, OdeFindsThePoseOfGenuStatic) {
  const std::filesystem::path file = std::filesystem::path(GENU_SOURCE_DIR) / "models" / GetParam() / "static.yaml";
  const std::filesystem::path results =
      std::filesystem::temp_directory_path() / ("genu-ode-" + std::to_string(::getpid()) + "-" + GetParam());
  const std::string command = std::string("'") + GENU_PROGRAM + "' static '" + file.string() +
                              "' --quiet --no-maps --no-plots --output '" + results.string() + "' > '" +
                              results.string() + ".log' 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const Vec6 expected = readPose(results / "motion.sto");
  std::filesystem::remove_all(results);
  std::filesystem::remove(results.string() + ".log");

  const scene::Scene scene = scene::readScene(file);
  ASSERT_EQ(scene.contacts.size(), 1u);
  ASSERT_EQ(scene.loads.size(), 1u);
  ASSERT_TRUE(scene.model && scene.staticAnalysis);
  const scene::LoadSpec& spec = scene.loads[0];
  ASSERT_NE(spec.frame, spec.body);
  Load load;
  for (size_t k = 0; k < 3; ++k) {
    load.force_F[static_cast<int>(k)] = std::get<double>(spec.force_N[k]);
    load.point[static_cast<int>(k)] = std::get<double>(spec.point_m[k]);
  }
  load.onMoving = spec.pointBody == spec.body;
  Vec6 start{};
  for (const Coordinate k : kHeld) {
    start[k] = std::get<double>(std::get<scene::PrescribedCoordinate>(scene.model->coordinates[k]).motion);
  }
  for (const Coordinate k : kFree) ASSERT_TRUE(std::holds_alternative<scene::FreeCoordinate>(scene.model->coordinates[k]));
  Contact contact(scene.contacts[0].definition);

  // Start where the contact carries a tenth of the load, found by halving; tilted and 1 mm aside, far from the answer.
  start[rx] = 0.02;
  start[z] = 1e-3;
  double low = 0.02, high = 0.06;
  while (high - low > 1e-9) {
    start[y] = 0.5 * (low + high);
    (contact.evaluate(start).total.force_on_moving[1] > 0.1 * load.force_F.norm() ? low : high) = start[y];
  }

  // Damped fall. Step and damping follow the contact's stiffness of each free coordinate: an explicit step must be short
  // against the fastest mode, damping near critical is the quickest way to rest.
  OdeKnee knee(start);
  const double inertia[3] = {OdeKnee::kInertia_kgm2, OdeKnee::kMass_kg, OdeKnee::kMass_kg};
  const double maxResidual_N = scene.staticAnalysis->maxResidual_N;
  Vec3 damping = Vec3::Zero(), residual;
  Vec6 q = start;
  double dt = 0;
  int steps = 0, quiet = 0;
  for (; steps < 400000 && quiet < 100; ++steps) {
    q = knee.coordinates();
    const Vec3 u = knee.rates();
    const Vec6 rates = {u[0], 0, 0, 0, u[1], u[2]};
    const bool renew = steps % 50 == 0;
    const genu_result& result = contact.evaluate(q, &rates, renew);
    ASSERT_LT(result.total.full_penetration_elements, 1) << "step " << steps;
    residual = netLoad(result, load, q);
    if (renew) {
      const auto K = [&](int row, int column) { return result.stiffness[6 * row + column]; };
      const double stiffness[3] = {-(K(3, rx) - (q[y] * K(2, rx) - q[z] * K(1, rx))), -K(1, y), -K(2, z)};
      double fastest = 3000;  // [rad/s], while there is hardly any contact
      for (int k = 0; k < 3; ++k) {
        const double omega = std::sqrt(std::abs(stiffness[k]) / inertia[k]);
        fastest = std::max(fastest, omega);
        damping[k] = 2 * inertia[k] * std::max(omega, 100.0);
      }
      dt = 0.1 / fastest;
    }
    quiet = largest(residual) < maxResidual_N ? quiet + 1 : 0;
    knee.step(residual - damping.cwiseProduct(u), dt);
  }
  ASSERT_EQ(quiet, 100) << "not at rest after " << steps << " steps, residual " << largest(residual) << " N";

  // How far two poses may be apart whose net loads are below maxResidual_N each, and whose held coordinates differ by what
  // ODE's joint let them drift: solve K dq = dload with the derivative K of the net load at the pose, by central differences
  // (steps of 1e-7; its error is some 1e-3, so that twice the bound is allowed). 1e-12: rounding of the file's numbers.
  const auto derivative = [&](const Coordinate (&columns)[3]) {
    Mat3 K;
    for (int k = 0; k < 3; ++k) {
      Vec6 plus = q, minus = q;
      plus[columns[k]] += 1e-7;
      minus[columns[k]] -= 1e-7;
      K.col(k) = (netLoad(contact.evaluate(plus), load, plus) - netLoad(contact.evaluate(minus), load, minus)) / 2e-7;
    }
    return K;
  };
  const Mat3 inverse = derivative(kFree).inverse();
  Vec3 drift;
  for (int k = 0; k < 3; ++k) drift[k] = std::abs(q[kHeld[k]] - expected[kHeld[k]]);
  EXPECT_LT(drift.maxCoeff(), 1e-10) << "ODE does not hold the prescribed coordinates";
  const Vec3 loads = maxResidual_N * Vec3(kArm_m, 1, 1);
  const Vec3 tolerance = 2 * (inverse.cwiseAbs() * (2 * loads) + (inverse * derivative(kHeld)).cwiseAbs() * drift) +
                         Vec3::Constant(1e-12);
  EXPECT_LT(tolerance.maxCoeff(), 1e-6) << "the tolerance would prove nothing";
  std::printf("%s: %d steps, residual %.1e N, drift %.1e\n", GetParam(), steps, largest(residual), drift.maxCoeff());
  for (int k = 0; k < 3; ++k) {
    std::printf("  %-2s ODE %.12g, genu static %.12g, difference %.1e, allowed %.1e\n",
                scene::kCoordinateNames[kFree[k]], q[kFree[k]], expected[kFree[k]], q[kFree[k]] - expected[kFree[k]],
                tolerance[k]);
    EXPECT_NEAR(q[kFree[k]], expected[kFree[k]], tolerance[k]) << scene::kCoordinateNames[kFree[k]];
  }
}

INSTANTIATE_TEST_SUITE_P(Models, SettleKnee, testing::Values("artificial_knee", "natural_knee"));

}  // namespace
