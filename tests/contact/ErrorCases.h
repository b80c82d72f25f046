#pragma once

// The cases on which the error estimate is fitted (training) and checked (test). Every case is a problem (scene, law, pose), a
// reference of at least 400 x 400 elements over the rectangle, and grids to be judged. All from fixed seeds.
//   training: sphere on plane, unequal paraboloid on plane, sphere in dish, contact across the end of the fixed surface,
//             contact across the border of the moving surface, condyle on dish
//   test:     the same kinds with other radii and poses, and kinds the fit has not seen: cylinder cut by the rectangle,
//             ellipsoid in a trough, sphere cut by the rectangle, two spheres in two compartments
// Laws: linear, logarithmic, power law in turn. Loads: from patches of about one cell to nearly the whole rectangle.

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"
#include "genu/contact/ErrorEstimate.h"

namespace genu::contact::test {

struct ErrorProblem {
  std::string kind;
  ContactPairDefinition definition;  // its grids are not used
  JointCoordinates q{};
  bool mayShift = true;              // the rectangle may be shifted: contact lies inside it
  std::array<double, 4> limits{};    // of contact, x0 x1 z0 z1: rectangle and end of the fixed surface, first compartment
  ContactResult reference;
};

enum class ErrorSet { training, test };

inline int numKinds(ErrorSet set) { return set == ErrorSet::training ? 6 : 10; }

/** Smooth rule, cells of at most 1/400 of the rectangle over the box around the contact. */
inline ContactResult calcReference(ErrorProblem& problem) {
  ContactPairDefinition d = problem.definition;
  d.rule = ContactRule::smooth;
  for (CompartmentDefinition& c : d.compartments) c.nx = c.nz = 80;
  const ContactPair scout(d);
  ContactWorkspace workspace(scout);
  ContactResult r;
  scout.evaluate(problem.q, workspace, {}, r);
  const auto fields = scout.calcFields(workspace);
  for (size_t k = 0; k < d.compartments.size(); ++k) {
    CompartmentDefinition& c = d.compartments[k];
    const double dx = (c.x1_m - c.x0_m) / c.nx, dz = (c.z1_m - c.z0_m) / c.nz;
    double box[4] = {1e9, -1e9, 1e9, -1e9};
    for (const ElementField& f : fields[k]) {
      if (!f.active) continue;
      box[0] = std::min(box[0], c.x0_m + (f.ix - 1) * dx);
      box[1] = std::max(box[1], c.x0_m + (f.ix + 2) * dx);
      box[2] = std::min(box[2], c.z0_m + (f.iz - 1) * dz);
      box[3] = std::max(box[3], c.z0_m + (f.iz + 2) * dz);
    }
    if (!(box[1] > box[0])) {
      c.nx = c.nz = 400;
      continue;
    }
    // Grids of 8 cells shift by up to half of one: contact that might then cross the rectangle's border keeps its rectangle.
    const double clear = (c.x1_m - c.x0_m) / 16;
    if (box[0] < c.x0_m + clear || box[1] > c.x1_m - clear || box[2] < c.z0_m + clear || box[3] > c.z1_m - clear) problem.mayShift = false;
    const std::array<double, 4> limits = k == 0 ? problem.limits : std::array<double, 4>{c.x0_m, c.x1_m, c.z0_m, c.z1_m};
    const double size = c.x1_m - c.x0_m;
    c.x0_m = std::max(box[0], limits[0]);
    c.x1_m = std::min(box[1], limits[1]);
    c.z0_m = std::max(box[2], limits[2]);
    c.z1_m = std::min(box[3], limits[3]);
    c.nx = std::max(160, static_cast<int>(std::ceil((c.x1_m - c.x0_m) / size * 400)));
    c.nz = std::max(160, static_cast<int>(std::ceil((c.z1_m - c.z0_m) / size * 400)));
  }
  return ContactPair(d).evaluate(problem.q, {});
}

inline ErrorProblem makeErrorProblem(ErrorSet set, int kind, int number) {
  std::mt19937 random(static_cast<unsigned>((set == ErrorSet::training ? 1000 : 2000) + 100 * kind + number));
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); };
  static const char* const kNames[] = {"sphere_plane", "paraboloid", "sphere_dish", "fixed_end", "moving_border", "condyle_dish",
                                       "cylinder_cut", "ellipsoid_trough", "sphere_cut", "two_spheres"};
  ErrorProblem p;
  p.kind = kNames[kind];
  const double h = uniform(0.003, 0.008), half = 0.010;
  const double radius = set == ErrorSet::training ? uniform(0.02, 0.04) : uniform(0.015, 0.06);
  // Radius of the contact on a plane: log-uniform; D = a^2 / 2R.
  const double a = half * std::exp(uniform(std::log(0.06), std::log(0.75)));
  const double cx = uniform(-0.02, 0.02), cz = uniform(-0.02, 0.02);  // away from the origin: moments
  const double sx = uniform(-0.001, 0.001), sz = uniform(-0.001, 0.001);
  const double D = std::min(a * a / (2 * radius), 0.5 * h);
  const auto plane = [&](double extent = 0.2) { return share(makePlane(h, 0, 0, Solid::below, extent)); };
  std::shared_ptr<const ContactSurface> fixed, moving;
  Thickness thickness = constantThickness(h);
  double x = cx, z = cz;  // centre of the rectangle
  switch (kind) {
    case 0:
      fixed = plane();
      moving = share(makeSphere(radius));
      p.q = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), cx + sx, h + radius - D, cz + sz};
      break;
    case 1: {
      const double ratio = uniform(0.3, 1);
      fixed = plane();
      moving = share(makeParaboloid(0, radius, radius * ratio, Solid::above, 0.02));
      p.q = {0, uniform(-1, 1), 0, cx + sx, h - D, cz + sz};
      break;
    }
    case 2: {  // conformal: the dish's curvature widens the patch
      const double outer = radius * uniform(1.5, 3), frontal = outer * uniform(0.7, 1);
      fixed = share(makeDish(h, outer, frontal, Solid::below, 0.013));
      moving = share(makeSphere(radius));
      thickness = aboveZero();
      x = z = 0;
      const double widened = 1 - radius / outer;
      p.q = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), 0.5 * sx, h + radius - D * widened, 0.5 * sz};
      break;
    }
    case 3: {  // the plane ends within the contact
      const double end = uniform(0.003, 0.006);
      fixed = plane(end);
      moving = share(makeSphere(radius));
      x = z = 0;
      p.q = {0, 0, 0, uniform(-0.2, 1) * std::min(a, end) + (end - std::min(a, end)), h + radius - D, uniform(-0.3, 0.3) * a};
      break;
    }
    case 4: {  // the moving paraboloid ends within the contact
      fixed = plane();
      moving = share(makeParaboloid(0, radius, 1.5 * radius, Solid::above, a * uniform(0.6, 0.95)));
      p.q = {0, uniform(-1, 1), 0, cx + sx, h - D, cz + sz};
      break;
    }
    case 5: {
      std::vector<NurbsPatch> condyle;
      condyle.emplace_back(makeCondyle(false, uniform(0, 0.0002)));
      fixed = share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.013));
      moving = share(std::move(condyle));
      thickness = aboveZero();
      x = z = 0;
      p.q = {uniform(-0.03, 0.03), uniform(-0.1, 0.1), uniform(0.1, 0.5), uniform(-0.001, 0.001), 0.045, uniform(-0.001, 0.001)};
      break;
    }
    case 6:  // a strip that the rectangle cuts, turned
      fixed = plane();
      moving = share(makeCylinder(radius, 0.08));
      p.q = {0, uniform(-1.5, 1.5), 0, cx + sx, h + radius - 0.6 * D, cz + sz};
      p.mayShift = false;
      break;
    case 7:
      fixed = share(makeDish(h, 0.05, std::numeric_limits<double>::infinity(), Solid::below, 0.013));
      moving = share(makeEllipsoid(0.02, 0.025, 0.03));
      thickness = aboveZero();
      x = z = 0;
      p.q = {0, uniform(-0.8, 0.8), 0, 0.5 * sx, h + 0.025 - 0.5 * D, 0.5 * sz};
      break;
    case 8:
      fixed = plane();
      moving = share(makeSphere(radius));
      p.q = {0, 0, 0, cx + half + uniform(-0.6, 0.6) * a, h + radius - D, cz + sz};
      p.mayShift = false;
      break;
    default:
      fixed = plane();
      moving = share(makeSphere(radius));
      p.q = {0, 0, 0, cx + sx, h + radius - D, cz + sz};
      break;
  }
  const int law = (kind + number) % 3;
  p.definition = makeScene(fixed, moving, thickness, law == 2 ? uhmwpePowerLaw() : uhmwpe(), half, 20, x, z);
  p.definition.strain = law == 1 ? StrainMeasure::large : StrainMeasure::small;
  if (kind == 9) {  // a second, smaller sphere beside the first
    CompartmentDefinition second = p.definition.compartments[0];
    const double other = 0.7 * radius;
    std::vector<NurbsPatch> patches;
    for (const NurbsPatch& patch : makeSphere(other)) {
      patches.push_back(patch.transformed(Pose{Mat3::Identity(), {0.001, other - radius + uniform(-0.5, 0.3) * D, 0.03}}));
    }
    second.name = "second";
    second.movingSurface = share(std::move(patches));
    second.z0_m += 0.03;
    second.z1_m += 0.03;
    p.definition.compartments.push_back(second);
  }
  const CompartmentDefinition& c = p.definition.compartments[0];
  p.limits = {c.x0_m, c.x1_m, c.z0_m, c.z1_m};
  if (kind == 3) {
    const double end = fixed->boundingBox().max().x();
    p.limits = {std::max(c.x0_m, -end), std::min(c.x1_m, end), std::max(c.z0_m, -end), std::min(c.z1_m, end)};
  }
  if (kind == 5) {  // height for a penetration between 0.05 and 0.6 mm, by bisection on the first contact
    ContactPairDefinition probe = p.definition;
    probe.compartments[0].nx = probe.compartments[0].nz = 40;
    const ContactPair pair(probe);
    double low = 0.030, high = 0.060;
    for (int i = 0; i < 20; ++i) {
      const double middle = 0.5 * (low + high);
      JointCoordinates q = p.q;
      q[4] = middle;
      (pair.evaluate(q, {}).total.area_m2 > 0 ? low : high) = middle;
    }
    p.q[4] = low - std::exp(uniform(std::log(0.03e-3), std::log(0.5e-3)));
  }
  p.reference = calcReference(p);
  return p;
}

/** The problem's grid of about n x n cells with a phase in [0, 1) cells each way. */
inline ContactPairDefinition makeErrorGrid(const ErrorProblem& p, ContactRule rule, int n, double phaseX, double phaseZ) {
  ContactPairDefinition d = p.definition;
  d.rule = rule;
  for (CompartmentDefinition& c : d.compartments) {
    const double dx = (c.x1_m - c.x0_m) / n, dz = (c.z1_m - c.z0_m) / n;
    c.nx = c.nz = n;
    if (!p.mayShift) continue;
    c.x0_m += (phaseX - 0.5) * dx;
    c.x1_m += (phaseX - 0.5) * dx;
    c.z0_m += (phaseZ - 0.5) * dz;
    c.z1_m += (phaseZ - 0.5) * dz;
  }
  return d;
}

inline LoadError calcError(const NetLoad& a, const NetLoad& b) {
  LoadError e;
  e.force_N = (a.forceOnM_F - b.forceOnM_F).norm();
  e.moment_Nm = (a.momentOnM_Fo_F - b.momentOnM_Fo_F).norm();
  e.peakPressure_Pa = std::abs(a.peakPressure_Pa - b.peakPressure_Pa);
  e.meanPressure_Pa = std::abs(a.meanPressure_Pa - b.meanPressure_Pa);
  e.area_m2 = std::abs(a.area_m2 - b.area_m2);
  return e;
}

}  // namespace genu::contact::test
