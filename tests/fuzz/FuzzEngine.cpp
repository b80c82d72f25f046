// Any control points, knots, weights, method, pose and query must end in a status, never in a crash, a hang or an unnoticed NaN.

#include <cmath>
#include <memory>
#include <stdexcept>

#include "Source.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"

namespace {

using namespace genu::contact;
using genu::fuzz::require;
using genu::fuzz::Source;

std::vector<double> makeKnots(int degree, double inner) {
  std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
  knots.push_back(inner);
  knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, 1.0);
  return knots;
}

/** The order in which a call's arguments are read is the compiler's choice, that of a braced list is not. */
Vec3 readVec(Source& source) { return Vec3{source.next(), source.next(), source.next()}; }

NurbsPatch readPatch(Source& source, double scale_m) {
  NurbsPatchData d;
  d.degreeU = 1 + source.choose(5);
  d.degreeV = 1 + source.choose(5);
  d.numU = d.degreeU + 2;
  d.numV = d.degreeV + 2;
  d.knotsU = makeKnots(d.degreeU, 0.5 + 0.5 * source.next());  // at an end: a repeated knot
  d.knotsV = makeKnots(d.degreeV, 0.5 + 0.5 * source.next());
  const int shape = source.choose(4);
  const bool rational = source.choose(2) == 1;
  for (int i = 0; i < d.numU; ++i) {
    for (int j = 0; j < d.numV; ++j) {
      Vec3 p = readVec(source);
      if (shape == 1 && i == 0) p = Vec3(0, 0.1, 0);          // a pole
      if (shape == 2 && i > 0 && j == 0) p = d.points[0] * (1 / scale_m);  // an edge shrunk to a point
      if (shape == 3) p = Vec3(static_cast<double>(i) / d.numU - 0.4, 0.1 * p.y(), static_cast<double>(j) / d.numV - 0.4);  // a sheet
      d.points.emplace_back(scale_m * p);
      if (rational) d.weights.push_back(std::exp(4 * source.next()));
    }
  }
  d.flipNormal = source.choose(2) == 1;
  return NurbsPatch(d);
}

Material readMaterial(Source& source) {
  Material m;
  m.law = static_cast<MaterialLaw>(source.choose(3));
  m.E_Pa = 4e6 * std::exp(8 * source.next());
  m.nu = 0.25 * (1 + source.next());
  m.eps0 = 0.06 * std::exp(4 * source.next());
  m.p0_Pa = 18e6;
  m.n = 1 + 4 * std::abs(source.next());
  return m;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source{data, size};
  try {
    constexpr double kScales[] = {0.1, 0.1, 1e-6, 1e3};
    const double scale_m = kScales[source.choose(4)];
    std::vector<NurbsPatch> patches;
    patches.push_back(readPatch(source, scale_m));
    const auto moving = std::make_shared<const ContactSurface>(std::move(patches));
    const Vec3 Q = 2 * scale_m * readVec(source);
    const ClosestPoint foot = moving->findClosestPoint(Q);
    require(foot.status == QueryStatus::notConverged || std::isfinite(foot.distance_m));
    const FirstHit hit = moving->findFirstHit(Q, Vec3{source.next(), source.next(), 1}.normalized());
    require(hit.status != HitStatus::hit || std::isfinite(hit.t_m));

    ContactPairDefinition d;
    CompartmentDefinition c;
    c.name = "all";
    c.x0_m = c.z0_m = -0.5 * scale_m;
    c.x1_m = c.z1_m = 0.5 * scale_m;
    c.nx = c.nz = 1 + source.choose(7);
    c.fixedSurface = std::make_shared<const ContactSurface>(makePlane(0.1 * scale_m, 0.5 * source.next(), 0, Solid::below, scale_m));
    c.movingSurface = moving;
    d.gridOn = static_cast<GridOn>(source.choose(2));
    if (d.gridOn == GridOn::moving) c.elementSurface = ElementPlane{PlaneFacing::down};
    d.compartments.push_back(c);
    d.fixedThickness.source = ConstantThickness{scale_m * std::exp(-3 + 3 * source.next())};
    if (source.choose(2) == 1) d.movingThickness.source = ConstantThickness{scale_m * std::exp(-6 + 6 * source.next())};
    d.material = readMaterial(source);
    if (source.choose(3) == 0) d.movingMaterial = readMaterial(source);
    d.strain = static_cast<StrainMeasure>(source.choose(2));
    d.rule = static_cast<ContactRule>(source.choose(2));
    d.distance = static_cast<DistanceMethod>(source.choose(2));
    d.correction = static_cast<Correction>(source.choose(3));
    d.tracking = static_cast<Tracking>(source.choose(4));
    if (source.choose(2) == 1) d.damping_sPerM = std::abs(source.next());
    const ContactPair pair(d);
    ContactWorkspace workspace(pair);
    ContactResult result;
    ContactPair::Options options;
    options.withEnergy = true;
    options.withStiffness = d.rule == ContactRule::smooth && source.choose(2) == 1;
    for (int i = 0; i < 3; ++i) {
      JointCoordinates q{}, rates{};
      for (std::size_t k = 0; k < 6; ++k) {
        q[k] = k < 3 ? 3.2 * source.next() : scale_m * source.next();
        rates[k] = source.next();
      }
      pair.evaluate(q, rates, workspace, options, result);
      if (result.status == EvaluationStatus::notConverged) continue;
      require(std::isfinite(result.total.scalarForce_N) && std::isfinite(result.total.energy_J));
      require(result.total.forceOnM_F.allFinite() && result.total.momentOnM_Fo_F.allFinite());
      require(result.total.scalarForce_N >= 0 && result.total.energy_J >= 0);
      require(result.stiffness.allFinite() && result.damping.allFinite());
    }
    pair.calcFields(workspace);
  } catch (const std::invalid_argument&) {
    // a refused definition is an answer
  }
  return 0;
}
