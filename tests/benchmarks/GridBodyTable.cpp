// How much the answer depends on which body carries the element grid (ContactPairDefinition::gridOn).
//   build/release/bin/grid_body_table [--quick]
// Each scene is evaluated twice at the same pose, with the grid on the fixed and on the moving body, both fine enough that the
// grids themselves differ by less than the last digit shown (120 x 120; --quick 60 x 60). Shown: the load of the fixed grid, and
// the relative change with the moving one, of
//   force   vector resultant |dF| / |F|, with the sign of the change of the scalar force
//   moment  about Fo, |dM| / |M|
//   peak, area
//   approach  how much deeper M must sink along y for the same vertical force, in um and of the largest penetration
//   theta^2  mean of theta^2 weighted by p dA, theta the angle between the two surfaces' normals
//   predicted  change of the force to leading order, (D/3) sum(kappa_M + kappa_F) (docs/theory.md), with the largest penetration D
//           of each compartment and the curvatures where it is, weighted by the compartments' forces
// The moving grids are cylinders about M's z axis 25 mm above the centre of pressure (knees), or concentric spheres.

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"
#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"

namespace {

using namespace genu;
using namespace genu::contact;
using namespace genu::contact::test;

const std::filesystem::path kModels = std::filesystem::path(GENU_SOURCE_DIR) / "models";

struct Case {
  std::string name;
  ContactPairDefinition onFixed, onMoving;
  JointCoordinates q;
};

ContactResult evaluate(const ContactPair& pair, const JointCoordinates& q) {
  ContactPair::Options options;
  options.withStiffness = true;
  return pair.evaluate(q, options);
}

/** Elements of M on a cylinder about its z axis, 25 mm above each compartment's centre of pressure. */
ContactPairDefinition putGridOnMoving(const ContactPairDefinition& onFixed, const ContactResult& r, const Pose& X_FM, int n) {
  ContactPairDefinition d = onFixed;
  d.gridOn = GridOn::moving;
  d.planeY_m.reset();
  for (size_t k = 0; k < d.compartments.size(); ++k) {
    CompartmentDefinition& c = d.compartments[k];
    ElementCylinder cylinder;
    cylinder.point_m = X_FM.applyInverse(r.compartments[k].centerOfPressure_F + Vec3(0, 0.025, 0));
    cylinder.zero = X_FM.R.transpose() * -Vec3::UnitY();
    const double reach_m = std::max(2e-3, 1.6 * std::sqrt(r.compartments[k].area_m2));
    cylinder.angle0_rad = -reach_m / 0.025;
    cylinder.angle1_rad = reach_m / 0.025;
    cylinder.axial0_m = -reach_m;
    cylinder.axial1_m = reach_m;
    c.elementSurface = cylinder;
    c.nx = c.nz = n;
  }
  return d;
}

/** Sum of the principal curvatures where a surface is closest to a point [1/m], > 0 where it is convex. */
double calcCurvature(const ContactSurface& surface, const Vec3& point) {
  const ClosestPoint foot = surface.findClosestPoint(point);
  const SurfaceDerivatives d = surface.patch(foot.at.patch).evaluate(foot.at.u, foot.at.v);
  const double E = d.Su.dot(d.Su), F = d.Su.dot(d.Sv), G = d.Sv.dot(d.Sv);
  const double L = d.Suu.dot(foot.normal_M), M = d.Suv.dot(foot.normal_M), N = d.Svv.dot(foot.normal_M);
  return -(E * N - 2 * F * M + G * L) / (E * G - F * F);
}

void print(const Case& c) {
  const ContactPair fixed(c.onFixed), moving(c.onMoving);
  const ContactResult a = evaluate(fixed, c.q), b = evaluate(moving, c.q);
  const NetLoad &A = a.total, &B = b.total;

  ContactWorkspace workspace(fixed);
  ContactResult again;
  fixed.evaluate(c.q, workspace, {}, again);
  double weight = 0, theta2 = 0, deepest = 0, predicted = 0;
  const auto fields = fixed.calcFields(workspace);
  for (size_t k = 0; k < fields.size(); ++k) {
    double own = 0;
    Vec3 where = Vec3::Zero();
    for (const ElementField& e : fields[k]) {
      if (!e.active) continue;
      if (e.d_m > own) {
        own = e.d_m;
        where = e.p_FA;
      }
      const double half = std::acos(std::min(1.0, e.forceDirection_F.dot(e.normal_F)));
      weight += e.force_N;
      theta2 += e.force_N * 4 * half * half;
      deepest = std::max(deepest, e.d_m);
    }
    // A concave fixed surface bends with the moving one.
    const CompartmentDefinition& part = c.onFixed.compartments[k];
    const double sum = calcCurvature(*part.movingSurface, calcPose(c.q).applyInverse(where)) - calcCurvature(*part.fixedSurface, where);
    predicted += a.compartments[k].scalarForce_N / A.scalarForce_N * own / 3 * sum;
  }
  theta2 /= weight;

  // Approach: Newton in y from the same pose.
  JointCoordinates q = c.q;
  for (int i = 0; i < 20; ++i) {
    const ContactResult r = evaluate(moving, q);
    const double step = (A.forceOnM_F.y() - r.total.forceOnM_F.y()) / r.stiffness(1, 4);
    q[4] += step;
    if (std::abs(step) < 1e-14) break;
  }
  const double sink_m = c.q[4] - q[4];
  const double force = std::copysign((B.forceOnM_F - A.forceOnM_F).norm() / A.forceOnM_F.norm(), B.scalarForce_N - A.scalarForce_N);
  std::printf("| %s | %.1f | %.2f | %.1f | %.1f | %.2e | %+.3f | %+.3f | %.3f | %+.3f | %+.3f | %+.2f (%+.3f) |\n", c.name.c_str(), A.scalarForce_N,
              A.peakPressure_Pa * 1e-6, A.area_m2 * 1e6, deepest * 1e6, theta2, 100 * predicted, 100 * force,
              100 * (B.momentOnM_Fo_F - A.momentOnM_Fo_F).norm() / A.momentOnM_Fo_F.norm(), 100 * (B.peakPressure_Pa / A.peakPressure_Pa - 1),
              100 * (B.area_m2 / A.area_m2 - 1), sink_m * 1e6, 100 * sink_m / deepest);
  if (a.status != EvaluationStatus::ok || b.status != EvaluationStatus::ok) {
    std::printf("  status: %s, %s\n", toString(a.status), toString(b.status));
  }
}

Case makeSphereOnFlat(double press_m, int n) {
  constexpr double R = 0.030, h = 0.006;
  const double a = std::sqrt(2 * R * press_m);
  Case c;
  char name[64];
  std::snprintf(name, sizeof name, "sphere 30 mm on flat, %.1f mm", press_m * 1e3);
  c.name = name;
  c.q = {0, 0, 0, 0.012, h + R - press_m, 0};
  c.onFixed = makeScene(share(makePlane(h, 0, 0, Solid::below, 0.1)), share(makeSphere(R)), constantThickness(h), uhmwpe(), 1.3 * a, n, 0.012);
  c.onMoving = c.onFixed;
  c.onMoving.gridOn = GridOn::moving;
  ElementSphere s;
  s.angle1_rad = s.elevation1_rad = 1.3 * a / R;
  s.angle0_rad = s.elevation0_rad = -s.angle1_rad;
  c.onMoving.compartments[0].elementSurface = s;
  return c;
}

Case makeBallInCup(int n) {
  constexpr double R1 = 0.024, R2 = 0.025, press = 0.2e-3, reach = 0.7;
  Case c;
  c.name = "ball 24 mm in cup 25 mm, 0.2 mm";
  c.q = {0, 0, 0, 0, -(R2 - R1 + press), 0};
  std::vector<NurbsPatch> cup;
  const Vec3 center(0.012, 0, 0);
  for (const NurbsPatch& p : makeSphere(R2)) cup.push_back(p.flipped().transformed(Pose{Mat3::Identity(), center}));
  c.q[3] = center.x();
  c.onFixed = makeScene(share(std::move(cup)), share(makeSphere(R1)), constantThickness(0.006), uhmwpe(), 0.01, n);
  ElementSphere s;
  s.angle0_rad = s.elevation0_rad = -reach;
  s.angle1_rad = s.elevation1_rad = reach;
  c.onMoving = c.onFixed;
  c.onMoving.gridOn = GridOn::moving;
  c.onMoving.compartments[0].elementSurface = s;
  s.facing = RoundFacing::inward;
  s.center_m = center;
  c.onFixed.compartments[0].elementSurface = s;
  return c;
}

Case makeCondyleInDish(int n) {
  Case c;
  c.name = "condyle in dish";
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  c.onFixed = makeScene(share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.02)), share(std::move(condyle)), aboveZero(), uhmwpe(), 0.012, n);
  c.q = {0.01, 0.02, 0.2, 0.0003, 0.042, 0.0001};
  const ContactPair pair(c.onFixed);
  double low = 0.03, high = 0.06;
  while (high - low > 1e-12) {
    c.q[4] = 0.5 * (low + high);
    (pair.evaluate(c.q, ContactPair::Options{}).total.scalarForce_N > 1500 ? low : high) = c.q[4];
  }
  c.onMoving = putGridOnMoving(c.onFixed, pair.evaluate(c.q), calcPose(c.q), n);
  return c;
}

Case makeModel(const std::string& file, const std::string& name, int n) {
  scene::ReadOptions options;
  options.requireModel = true;
  options.gridOverride = std::pair{n, n};
  auto scene = scene::readScene(kModels / file, options);
  scene.staticAnalysis->method = scene::StaticSpec::Method::newton;
  const model::StaticResult result = model::runStatic(scene);
  if (result.status != model::StaticResult::Status::converged) throw std::runtime_error(result.statusText);
  Case c;
  c.name = name;
  c.q = scene::takeSix(result.q);
  c.onFixed = scene.contacts[0].definition;
  c.onFixed.fixedThickness.mapSamplesU = c.onFixed.fixedThickness.mapSamplesV = 129;  // used when it is the body without the grid
  c.onFixed.movingThickness.mapSamplesU = c.onFixed.movingThickness.mapSamplesV = 129;
  c.onMoving = putGridOnMoving(c.onFixed, ContactPair(c.onFixed).evaluate(c.q), calcPose(c.q), n);
  return c;
}

}  // namespace

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::strcmp(argv[1], "--quick") == 0;
  const int n = quick ? 60 : 120;
  std::printf("| scene | force N | peak MPa | area mm2 | depth um | theta^2 | predicted %% | force %% | moment %% | peak %% | area %% | sinks um (%% of depth) |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  print(makeSphereOnFlat(0.1e-3, n));
  print(makeSphereOnFlat(0.2e-3, n));
  print(makeSphereOnFlat(0.4e-3, n));
  print(makeBallInCup(n));
  print(makeCondyleInDish(n));
  print(makeModel("artificial_knee/static.yaml", "artificial knee, static", n));
  print(makeModel("natural_knee/static.yaml", "natural knee, static", n));
  return 0;
}
