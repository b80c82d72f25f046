// Any control points, weights, pose and query must end in a status, never in a crash, a hang or an unnoticed NaN.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"

namespace {

using namespace genu::contact;

/** Reads numbers from the fuzzer's bytes; zeros when they run out. */
struct Source {
  const std::uint8_t* data;
  std::size_t left;
  /** In [-1, 1], any bit pattern of two bytes. */
  double next() {
    std::int16_t value = 0;
    const std::size_t n = left < sizeof value ? left : sizeof value;
    std::memcpy(&value, data, n);
    data += n;
    left -= n;
    return value / 32768.0;
  }
};

void require(bool ok) {
  if (!ok) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source{data, size};
  NurbsPatchData d;
  d.degreeU = 1 + static_cast<int>(2.49 * (1 + source.next()));
  d.degreeV = 1 + static_cast<int>(2.49 * (1 + source.next()));
  d.numU = d.degreeU + 2;
  d.numV = d.degreeV + 2;
  const auto makeKnots = [](int degree) {
    std::vector<double> knots(static_cast<std::size_t>(degree) + 1, 0.0);
    knots.push_back(0.4);
    knots.insert(knots.end(), static_cast<std::size_t>(degree) + 1, 1.0);
    return knots;
  };
  d.knotsU = makeKnots(d.degreeU);
  d.knotsV = makeKnots(d.degreeV);
  for (int i = 0; i < d.numU * d.numV; ++i) {
    d.points.emplace_back(0.1 * source.next(), 0.1 * source.next(), 0.1 * source.next());
    d.weights.push_back(std::exp(4 * source.next()));
  }
  try {
    std::vector<NurbsPatch> patches;
    patches.emplace_back(d);
    const auto moving = std::make_shared<const ContactSurface>(std::move(patches));
    const ClosestPoint foot = moving->findClosestPoint(0.2 * Vec3(source.next(), source.next(), source.next()));
    require(foot.status == QueryStatus::notConverged || std::isfinite(foot.distance_m));
    ContactPairDefinition definition;
    CompartmentDefinition c;
    c.name = "all";
    c.x0_m = c.z0_m = -0.05;
    c.x1_m = c.z1_m = 0.05;
    c.nx = c.nz = 5;
    c.fixedSurface = std::make_shared<const ContactSurface>(makePlane(0.01, 0, 0, Solid::below, 0.1));
    c.movingSurface = moving;
    definition.compartments.push_back(c);
    definition.fixedThickness.source = ConstantThickness{0.01};
    definition.material.E_Pa = 4e6;
    definition.material.nu = 0.45;
    definition.strain = StrainMeasure::large;
    const ContactPair pair(definition);
    ContactWorkspace workspace(pair);
    ContactResult result;
    for (int i = 0; i < 2; ++i) {
      pair.evaluate(JointCoordinates{source.next(), source.next(), source.next(), 0.1 * source.next(), 0.1 * source.next(), 0},
                    workspace, {true}, result);
      require(std::isfinite(result.total.scalarForce_N) && result.total.scalarForce_N >= 0);
      require(result.total.forceOnM_F.allFinite() && result.total.momentOnM_Fo_F.allFinite());
      require(result.total.energy_J >= 0);
    }
  } catch (const std::invalid_argument&) {
    // a refused definition is an answer
  }
  return 0;
}
