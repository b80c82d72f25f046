// Evaluates a minimal contact, or the same with one more part, a fixed number of times: what scripts/count_instructions counts.
//   contact_parts --list
//   contact_parts PART
// Minimal: a rigid femur on an insert whose thickness is the height above a plane, linear law in small strain, no damping, smooth
// rule, loads alone, one thread. It prints the mean force, so that a scene that lost its contact is seen.

#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "benchmarks/KneeScene.h"
#include "genu/contact/ContactPair.h"
#ifdef GENU_WITH_THREADS
#include "genu/contact/Threads.h"
#endif

namespace {

using namespace genu::contact;
using namespace genu::contact::test;

constexpr int kCounted = 20;

struct Counted {
  ContactPairDefinition definition = makeKnee(80, true, uhmwpe(), StrainMeasure::small);
  ContactPair::Options options;
  JointCoordinates rates{};
  bool fields = false, second = false, threads = false;
};

/** A part and how the minimal scene gets it. */
struct Part {
  const char* name;
  std::function<void(Counted&)> add;
};

BackSurface makeBack(std::vector<NurbsPatch> patches) { return {share(std::move(patches)), BackDirection::normal}; }

std::vector<Part> listParts() {
  std::vector<Part> parts = {
      {"minimal", [](Counted&) {}},
      {"back_of_insert",
       [](Counted& c) { c.definition.fixedThickness.source = makeBack(makePlane(0.002, 0, 0, Solid::below, 0.060)); }},
      {"back_of_femur",
       [](Counted& c) {
         std::vector<NurbsPatch> bone;
         for (const double z : {0.024, -0.024}) {
           NurbsPatchData back = makeCondyle(false, 0);
           for (Vec3& p : back.points) p = 0.92 * p + Vec3(0, 0, z);
           bone.emplace_back(back);
         }
         c.definition.movingThickness.source = makeBack(std::move(bone));
       }},
      {"log_strain", [](Counted& c) { c.definition.strain = StrainMeasure::large; }},
      {"power_law", [](Counted& c) { c.definition.material = uhmwpePowerLaw(); }},
      {"power_law_centre",
       [](Counted& c) {
         c.definition.material = uhmwpePowerLaw();
         c.definition.rule = ContactRule::centre;
       }},
      {"series", [](Counted& c) {
         c.definition.movingThickness = constantThickness(0.003);
         c.definition.movingMaterial = cartilage();
       }},
      {"stiffness", [](Counted& c) { c.options.withStiffness = true; }},
      {"damping",
       [](Counted& c) {
         c.definition.damping_sPerM = 1;
         c.rates = {0.1, 0, 0.2, 0.01, -0.01, 0};
       }},
      {"energy", [](Counted& c) { c.options.withEnergy = true; }},
      {"energy_gradient", [](Counted& c) { c.definition.correction = Correction::energy; }},
      {"fields", [](Counted& c) { c.fields = true; }},
      {"ray", [](Counted& c) { c.definition.distance = DistanceMethod::ray; }},
      {"search", [](Counted& c) { c.definition.tracking = Tracking::breadthFirst; }},
      {"grid_on_moving", [](Counted& c) {
         c.definition.gridOn = GridOn::moving;
         for (CompartmentDefinition& compartment : c.definition.compartments) {
           ElementPlane plane;
           plane.facing = PlaneFacing::down;
           compartment.elementSurface = plane;
         }
       }},
      {"second_contact", [](Counted& c) { c.second = true; }},
  };
#ifdef GENU_WITH_THREADS
  parts.push_back({"threads", [](Counted& c) { c.threads = true; }});
#endif
  return parts;
}

/** What is evaluated: its pairs and their memory. */
struct Scene {
  Counted counted;
  std::vector<ContactPair> pairs;
  std::vector<ContactWorkspace> workspaces;
  std::vector<ContactResult> results;
  JointCoordinates middle{};
  double force_N = 0;
  size_t numFields = 0;
};

}  // namespace

/** A C name, so that valgrind can be asked for it. */
extern "C" [[gnu::noinline]] void genuCountedEvaluations(void* pointer, int n, int first) {
  auto& scene = *static_cast<Scene*>(pointer);
  for (int i = 0; i < n; ++i) {
    const JointCoordinates q = wander(first + i, scene.middle);
    for (size_t k = 0; k < scene.pairs.size(); ++k) {
      scene.pairs[k].evaluate(q, scene.counted.rates, scene.workspaces[k], scene.counted.options, scene.results[k]);
      scene.force_N += scene.results[k].total.forceOnM_F.y() / n;
      if (scene.counted.fields) scene.numFields += scene.pairs[k].calcFields(scene.workspaces[k]).size();
    }
  }
}

namespace {

int count(const Part& part) {
  Scene scene;
  part.add(scene.counted);
  const int pairs = scene.counted.second ? 2 : 1;
  // One pose for all parts, so that what they find is the same contact: about 2100 elements.
  scene.middle = {0, 0, 0.2, 0, 0.04197, 0};
  for (int k = 0; k < pairs; ++k) scene.pairs.emplace_back(scene.counted.definition);
  for (const ContactPair& pair : scene.pairs) scene.workspaces.emplace_back(pair);
  scene.results.resize(scene.pairs.size());
#ifdef GENU_WITH_THREADS
  std::unique_ptr<Threads> threads;
  if (scene.counted.threads) {
    threads = std::make_unique<Threads>(2);
    for (ContactWorkspace& workspace : scene.workspaces) workspace.setTaskRunner(threads.get());
  }
#endif
  genuCountedEvaluations(&scene, 1, 0);  // the first is cold
  scene.force_N = 0;
  genuCountedEvaluations(&scene, kCounted, 1);
  std::printf("%s: %d evaluations, instruction set %s, mean force %.6f N, %d elements active, %d queries, %zu fields\n", part.name, kCounted,
              activeInstructionSet(), scene.force_N, scene.results[0].total.activeElements, scene.results[0].distanceQueries, scene.numFields);
  return scene.force_N > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<Part> parts = listParts();
  const std::string what = argc == 2 ? argv[1] : "";
  if (what == "--list") {
    for (const Part& part : parts) std::printf("%s\n", part.name);
    return 0;
  }
  for (const Part& part : parts) {
    if (what == part.name) return count(part);
  }
  std::fprintf(stderr, "usage: contact_parts --list | PART\n");
  return 2;
}
