#include "genu/model/CutOff.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "genu/model/Analysis.h"

namespace genu::model {

namespace {

using contact::CompartmentDefinition;

bool overlap(const CompartmentDefinition& a, const CompartmentDefinition& b) {
  return a.x0_m < b.x1_m && b.x0_m < a.x1_m && a.z0_m < b.z1_m && b.z0_m < a.z1_m;
}

/** The rectangle with a margin of whole cells of its own size. */
CompartmentDefinition withMargin(const CompartmentDefinition& part, const std::vector<CompartmentDefinition>& all) {
  CompartmentDefinition wide = part;
  const auto grow = [&](double& edge, int& cells, double side, int direction) {
    const int count = std::max(1, cells / 10);
    CompartmentDefinition tried = part;
    double& moved = &edge == &wide.x0_m ? tried.x0_m : &edge == &wide.x1_m ? tried.x1_m : &edge == &wide.z0_m ? tried.z0_m : tried.z1_m;
    moved += direction * side * count;
    const bool taken = std::any_of(all.begin(), all.end(), [&](const CompartmentDefinition& other) { return other.name != part.name && overlap(tried, other); });
    if (taken) return;
    edge = moved;
    cells += count;
  };
  const double dx = (part.x1_m - part.x0_m) / part.nx, dz = (part.z1_m - part.z0_m) / part.nz;
  grow(wide.x0_m, wide.nx, dx, -1);
  grow(wide.x1_m, wide.nx, dx, 1);
  grow(wide.z0_m, wide.nz, dz, -1);
  grow(wide.z1_m, wide.nz, dz, 1);
  return wide;
}

}  // namespace

std::vector<CutOff> findCutOffs(const scene::Scene& scene, const std::vector<scene::Frame>& frames) {
  std::vector<CutOff> result;
  for (size_t i = 0; i < scene.contacts.size(); ++i) {
    const auto& parts = scene.contacts[i].definition.compartments;
    for (size_t k = 0; k < parts.size(); ++k) {
      if (!std::holds_alternative<contact::ElementPlane>(parts[k].elementSurface) || !parts[k].refined.empty()) continue;
      const scene::Frame* strongest = nullptr;
      for (const scene::Frame& frame : frames) {
        const double force = frame.contacts[i].compartments[k].scalarForce_N;
        if (force > 0 && (strongest == nullptr || force > strongest->contacts[i].compartments[k].scalarForce_N)) strongest = &frame;
      }
      if (strongest == nullptr) continue;
      const auto forceOf = [&](const CompartmentDefinition& part) {
        scene::Scene alone = scene;
        alone.contacts = {scene.contacts[i]};
        alone.contacts[0].definition.compartments = {part};
        return replay({strongest->time_s}, {strongest->q}, alone, {}, false).frames[0].contacts[0].total.scalarForce_N;
      };
      try {
        const bool damped = scene.contacts[i].definition.damping_sPerM > 0;  // the frame's force then is not that of its pose alone
        const double inside = damped ? forceOf(parts[k]) : strongest->contacts[i].compartments[k].scalarForce_N;
        const double wide = forceOf(withMargin(parts[k], parts));
        if (wide - inside > kToleratedCutOff * inside) result.push_back({scene.contacts[i].name, parts[k].name, strongest->time_s, inside, wide - inside});
      } catch (const std::runtime_error&) {  // nothing that could carry there: no thickness, another surface
      }
    }
  }
  return result;
}

std::string describe(const CutOff& cutOff, const scene::Scene& scene) {
  return fmt::format("{}: at t = {:g} s contact goes on beyond the rectangle, where it carries nothing: {:.3g} N within a tenth of its sides, {:.4g} N inside; enlarge it",
                     scene.where("contact." + cutOff.contact + ".compartments." + cutOff.compartment + ".rectangle"), cutOff.time_s, cutOff.outside_N, cutOff.force_N);
}

}  // namespace genu::model
