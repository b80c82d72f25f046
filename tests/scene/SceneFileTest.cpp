#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "TestFiles.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/io/Files.h"
#include "genu/io/NurbsFile.h"
#include "genu/scene/Elements.h"
#include "genu/scene/SceneFile.h"

namespace genu::scene {
namespace {

using test::messageOf;
using test::TemporaryFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

/** Lines 1 to 10: the smallest complete scene, sphere R = 30 mm on a 6 mm layer. */
const std::string kSphere = R"(genu: 1
surfaces:
  insert: {plane: {y0: 6 mm}}
  femur: {sphere: {R: 30 mm}}
materials:
  insert: {E: 463 MPa, nu: 0.46}
contact:
  knee:
    fixed: {surface: insert, thickness: 6 mm}
    moving: {surface: femur}
    material: insert
    compartments:
      all: {rectangle: "-5 mm, 5 mm, -4 mm, 4 mm", grid: 30x20}
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

Scene parse(const std::string& yaml, const ReadOptions& options = {}) { return parseScene(yaml, "s.yaml", options); }

std::string messageFor(const std::string& yaml, const ReadOptions& options = {}) {
  return messageOf([&] { parseScene(yaml, "s.yaml", options); });
}

/** Message after one change of the small scene. */
std::string messageAfter(const std::string& from, const std::string& to) {
  return messageFor(replaced(kSphere, from, to));
}

TEST(SceneFile, SmallestScene) {
  const Scene scene = parse(kSphere);
  EXPECT_EQ(scene.name, "s");
  EXPECT_FALSE(scene.model.has_value());
  ASSERT_EQ(scene.contacts.size(), 1u);
  const auto& definition = scene.contacts[0].definition;
  EXPECT_EQ(scene.contacts[0].name, "knee");
  EXPECT_EQ(definition.material.E_Pa, 463e6);
  EXPECT_EQ(definition.material.nu, 0.46);
  EXPECT_EQ(std::get<contact::ConstantThickness>(definition.fixedThickness.source).h_m, 0.006);
  EXPECT_TRUE(std::holds_alternative<contact::RigidBody>(definition.movingThickness.source));
  ASSERT_EQ(definition.compartments.size(), 1u);
  const auto& compartment = definition.compartments[0];
  EXPECT_EQ(compartment.name, "all");
  EXPECT_EQ(compartment.x0_m, -0.005);
  EXPECT_EQ(compartment.x1_m, 0.005);
  EXPECT_EQ(compartment.z0_m, -0.004);
  EXPECT_EQ(compartment.z1_m, 0.004);
  EXPECT_EQ(compartment.nx, 30);
  EXPECT_EQ(compartment.nz, 20);
  EXPECT_EQ(definition.strain, contact::StrainMeasure::small);
  EXPECT_EQ(definition.correction, contact::Correction::midsurface);
  EXPECT_EQ(definition.rule, contact::ContactRule::smooth);
  EXPECT_EQ(definition.tracking, contact::Tracking::lipschitz);
  EXPECT_EQ(definition.copyTolerance, 0);
  EXPECT_FALSE(definition.planeY_m.has_value());
  EXPECT_TRUE(scene.unused.empty());
  EXPECT_EQ(scene.inputHashes.at("s.yaml"), io::calcSha256(kSphere));
  EXPECT_EQ(scene.where("contact.knee.material"), "s.yaml:11: contact.knee.material");
  EXPECT_EQ(scene.where("contact.knee.strain.x"), "s.yaml:8: contact.knee.strain.x");
}

TEST(SceneFile, AnalyticSurfacesTurnToTheSideTheyAreUsedOn) {
  // A plane is the fixed body of one pair and the moving body of another.
  const std::string yaml = R"(genu: 1
surfaces:
  flat: {plane: {y0: 6 mm, sx: 0.1}}
  ball: {sphere: {R: 30 mm}}
materials: {m: {E: 463 MPa, nu: 0.46}}
contact:
  a: {fixed: {surface: flat, thickness: 6 mm}, moving: {surface: ball}, material: m, compartments: {c: {rectangle: [-5 mm, 5 mm, -5 mm, 5 mm]}}}
  b: {fixed: {surface: ball, thickness: 6 mm}, moving: {surface: flat}, material: m, compartments: {c: {rectangle: [-5 mm, 5 mm, -5 mm, 5 mm]}}}
)";
  const Scene scene = parse(yaml);
  const auto& down = *scene.contacts[0].definition.compartments[0].fixedSurface;
  const auto& up = *scene.contacts[1].definition.compartments[0].movingSurface;
  EXPECT_GT(down.patch(0).calcNormal(0, 0).y(), 0.9);
  EXPECT_LT(up.patch(0).calcNormal(0, 0).y(), -0.9);
  // Closed surfaces are one object whatever the side.
  EXPECT_EQ(scene.contacts[0].definition.compartments[0].movingSurface,
            scene.contacts[1].definition.compartments[0].fixedSurface);
  EXPECT_THAT(scene.surfaces[0].usedBy,
              ElementsAre("contact.a.compartments.c, fixed", "contact.b.compartments.c, moving"));
  EXPECT_EQ(scene.surfaces[0].kind, "plane");
  EXPECT_EQ(scene.contacts[0].definition.compartments[0].nx, 30);
}

TEST(SceneFile, EveryAnalyticSurface) {
  for (const char* surface :
       {"plane: {}", "plane: {y0: 1 mm, sx: 0.1, sz: -0.2}", "dish: {y0: 6 mm, Rs: 60 mm, Rf: 35 mm}",
        "dish: {Rs: 60 mm, Rf: inf}", "dish: {Rs: inf, Rf: 35 mm}", "dish: {Rs: .inf, Rf: inf}",
        "paraboloid: {Rx: -2 m, Rz: 2 m}", "paraboloid: {Rx: inf, Rz: -inf}", "sphere: {R: 30 mm}",
        "cylinder: {R: 25 mm, length: 20 mm}", "ellipsoid: {a: 1 cm, b: 20 mm, c: 0.03 m}",
        "torus: {Rs: 30 mm, Rf: 10 mm}"}) {
    SCOPED_TRACE(surface);
    const std::string pose = ", pose: \"0 deg, 10 deg, 0 deg, 1 mm, -2 mm, 3 mm\"";
    const Scene moving = parse(replaced(kSphere, "sphere: {R: 30 mm}", surface + pose));
    EXPECT_GE(moving.surfaces[1].patches, 1);
    const Scene fixed = parse(replaced(kSphere, "plane: {y0: 6 mm}", surface + pose));
    EXPECT_GE(fixed.surfaces[0].controlPoints, 4);
  }
}

TEST(SceneFile, DampingAndTheEnergyForm) {
  const auto with = [](const std::string& keys) { return replaced(kSphere, "    material: insert", "    material: insert\n" + keys); };
  EXPECT_EQ(parse(kSphere).contacts[0].definition.damping_sPerM, 0);
  EXPECT_EQ(parse(with("    damping: 0.5 s/m")).contacts[0].definition.damping_sPerM, 0.5);
  EXPECT_EQ(parse(with("    damping: 0.002 s/mm")).contacts[0].definition.damping_sPerM, 2);
  EXPECT_EQ(parse(with("    correction: energy")).contacts[0].definition.correction, contact::Correction::energy);
  const auto message = [&](const std::string& keys) { return messageOf([&] { parse(with(keys)); }); };
  EXPECT_THAT(message("    damping: 0.5"), AllOf(HasSubstr(".damping: \"0.5\" has no unit"), HasSubstr("s/m, s/mm")));
  EXPECT_THAT(message("    damping: 5 N s/m"), AllOf(HasSubstr("is a damping"), HasSubstr("an inverse speed is needed")));
  EXPECT_THAT(message("    damping: -1 s/m"), AllOf(HasSubstr(".damping"), HasSubstr("-1 s/m"), HasSubstr(">= 0")));
  EXPECT_THAT(message("    correction: energetic"), HasSubstr("midsurface, none, energy"));
  EXPECT_THAT(message("    correction: energy\n    rule: centre"), AllOf(HasSubstr(".correction: is energy"), HasSubstr("rule: centre")));
  EXPECT_THAT(message("    correction: energy\n    damping: 1 s/m"), AllOf(HasSubstr(".correction: is energy"), HasSubstr("damping")));
}

TEST(SceneFile, WarnsOfTheUnguardedSearchAlone) {
  EXPECT_TRUE(listWarnings(parse(kSphere)).empty());
  const auto warnings = listWarnings(parse(replaced(kSphere, "    material: insert", "    material: insert\n    tracking: breadth-first-unguarded")));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0], AllOf(HasSubstr(".tracking: breadth-first-unguarded can miss a new, separate contact region"),
                                 HasSubstr("the load may be wrong by all of it"), HasSubstr("lipschitz is exact and faster")));
}

TEST(SceneFile, PoseMovesTheSurface) {
  const Scene scene = parse(replaced(kSphere, "sphere: {R: 30 mm}",
                                     "sphere: {R: 30 mm}, pose: [0 deg, 0 deg, 90 deg, 10 mm, 20 mm, -30 mm]"));
  const auto foot = scene.contacts[0].definition.compartments[0].movingSurface->findClosestPoint({0.01, 1, -0.03});
  EXPECT_NEAR(foot.p_MB.y(), 0.05, 1e-12);
  EXPECT_NEAR(foot.distance_m, 0.95, 1e-12);
}

TEST(SceneFile, HeightFieldsReachBeyondTheRectangles) {
  const std::string yaml = replaced(kSphere, "-5 mm, 5 mm, -4 mm, 4 mm", "200 mm, 210 mm, -4 mm, 4 mm");
  const auto box = parse(yaml).contacts[0].definition.compartments[0].fixedSurface->boundingBox();
  EXPECT_GE(box.max().x(), 4 * 0.21);
  const auto own = parse(replaced(yaml, "{plane: {y0: 6 mm}}", "{plane: {y0: 6 mm}, extent: 0.3 m}"));
  EXPECT_NEAR(own.contacts[0].definition.compartments[0].fixedSurface->boundingBox().max().x(), 0.3, 1e-9);
}

TEST(SceneFile, ContactOptions) {
  const std::string yaml = replaced(kSphere, "    material: insert\n", R"(    material: {fixed: insert, moving: soft}
    strain: large
    distance: ray
    correction: none
    tracking: breadth-first-unguarded
    copy_tolerance: 1 um
    element_plane: -2 mm
)");
  const Scene scene = parse(replaced(
      replaced(yaml, "  insert: {E",
               "  soft: {law: power-law-consistent, eps0: 0.0597, p0: 18.4 MPa, n: 3, nu: 0.46}\n  insert: {E"),
      "{surface: femur}", "{surface: femur, thickness: {height_above: 2 mm, min: 1 mm, max: 4 mm, map_samples: 5x7}}"));
  const auto& definition = scene.contacts[0].definition;
  EXPECT_EQ(definition.strain, contact::StrainMeasure::large);
  EXPECT_EQ(definition.distance, contact::DistanceMethod::ray);
  EXPECT_EQ(definition.correction, contact::Correction::none);
  EXPECT_EQ(definition.tracking, contact::Tracking::breadthFirstUnguarded);
  EXPECT_EQ(definition.copyTolerance, 1e-6);
  EXPECT_EQ(definition.planeY_m, -0.002);
  ASSERT_TRUE(definition.movingMaterial.has_value());
  EXPECT_EQ(definition.movingMaterial->law, contact::MaterialLaw::powerLawConsistent);
  EXPECT_EQ(definition.movingMaterial->p0_Pa, 18.4e6);
  EXPECT_EQ(std::get<contact::HeightAbovePlane>(definition.movingThickness.source).planeY_m, 0.002);
  EXPECT_EQ(definition.movingThickness.min_m, 0.001);
  EXPECT_EQ(definition.movingThickness.max_m, 0.004);
  EXPECT_EQ(definition.movingThickness.mapSamplesU, 5);
  EXPECT_EQ(definition.movingThickness.mapSamplesV, 7);
  EXPECT_EQ(parse(replaced(kSphere, "material: insert", "material: insert\n    copy_tolerance: never"))
                .contacts[0]
                .definition.copyTolerance,
            -1);
  EXPECT_EQ(parse(replaced(kSphere, "material: insert", "material: insert\n    rule: centre")).contacts[0].definition.rule,
            contact::ContactRule::centre);
}

TEST(SceneFile, BackSurface) {
  const std::string yaml =
      replaced(replaced(kSphere, "thickness: 6 mm", "thickness: {back: bone, along: closest, missing: 3 mm}"),
               "materials:", "  bone: {plane: {y0: 1 mm}}\n  spare: {sphere: {R: 1 mm}}\nmaterials:");
  const Scene scene = parse(yaml);
  const auto& back = std::get<contact::BackSurface>(scene.contacts[0].definition.fixedThickness.source);
  ASSERT_TRUE(back.surface);
  EXPECT_EQ(back.direction, contact::BackDirection::closest);
  EXPECT_EQ(scene.contacts[0].definition.fixedThickness.missing_m, 0.003);
  EXPECT_THAT(scene.unused, ElementsAre("surfaces.spare"));
  EXPECT_THAT(messageFor(replaced(yaml, "back: bone", "back: bine")),
              AllOf(StartsWith("s.yaml:11: contact.knee.fixed.thickness.back: unknown surface \"bine\""),
                    HasSubstr("did you mean \"bone\"")));
}

TEST(SceneFile, AutomaticRectangle) {
  const std::string yaml = replaced(kSphere, "\"-5 mm, 5 mm, -4 mm, 4 mm\"", "auto");
  EXPECT_THAT(
      messageFor(yaml),
      AllOf(StartsWith("s.yaml:13: contact.knee.compartments.all.rectangle: \"auto\" needs a surface with an end"),
            HasSubstr("extent")));
  const Scene scene = parse(replaced(yaml, "{plane: {y0: 6 mm}}", "{plane: {y0: 6 mm}, extent: 20 mm}"));
  const auto& c = scene.contacts[0].definition.compartments[0];
  EXPECT_NEAR(c.x0_m, -0.02, 1e-6);
  EXPECT_NEAR(c.z1_m, 0.02, 1e-6);
  EXPECT_THAT(scene.surfaces[0].usedBy, ElementsAre("contact.knee.compartments.all, fixed"));
}

TEST(SceneFile, ContactPairsAreBuiltAndErrorsKeepTheirPlace) {
  const auto pairs = makeContactPairs(parse(kSphere));
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0]->numElements(), 600);
  // A rectangle beside the sphere: no overlap between grid and surface.
  const Scene away =
      parse(replaced(replaced(kSphere, "plane: {y0: 6 mm}", "sphere: {R: 6 mm}"), "-5 mm, 5 mm", "50 mm, 55 mm"));
  EXPECT_THAT(messageOf([&] { makeContactPairs(away); }),
              AllOf(StartsWith("s.yaml:8: contact.knee: "), HasSubstr("all")));
}

// The scene's pieces make the engine's case: pi K D^2/h (R - 2D/3), sphere R pressed D into a layer h, minimum
// distance.
TEST(SceneFile, SphereOnLayerHasItsClosedForm) {
  const double R = 0.03, D = 0.2e-3, h = 0.006;
  const auto pair = makeContactPairs(parse(replaced(kSphere, "30x20", "200x160")))[0];
  const contact::ContactResult result = pair->evaluate(parsePose("20 deg, -30 deg, 40 deg, 0 mm, 35.8 mm, 0 mm"));
  const double K_Pa = pair->definition().material.confinementFactor() * 463e6;
  const double exact_N = contact::kPi * K_Pa * D * D / h * (R - 2 * D / 3);
  // Whole cells on 30 x 30 err by 6e-4 and as N^-2.5 at best; 160 cells over 8 mm: below 1e-4.
  EXPECT_NEAR(result.total.forceOnM_F.y() / exact_N, 1.0, 1e-4);
}

TEST(SceneFile, NurbsSurface) {
  const TemporaryFolder folder;
  std::vector<io::NamedPatch> patches;
  patches.push_back({"medial", contact::makePlane(0.006, 0, 0, contact::Solid::below, 0.02)[0].data()});
  patches.push_back({"lateral", contact::makePlane(0.007, 0, 0, contact::Solid::below, 0.02)[0].data()});
  io::writeNurbsFile(folder.path() / "insert.json", patches);
  const auto read = [&](const std::string& surface, const ReadOptions& options = {}) {
    return parseScene(replaced(kSphere, "{plane: {y0: 6 mm}}", surface), folder.path() / "s.yaml", options);
  };
  const Scene scene = read("{nurbs: insert.json, patches: [lateral]}");
  const auto& surface = *scene.contacts[0].definition.compartments[0].fixedSurface;
  ASSERT_EQ(surface.numPatches(), 1);
  EXPECT_NEAR(surface.boundingBox().max().y(), 0.007, 1e-12);
  EXPECT_EQ(scene.surfaces[0].file, folder.path() / "insert.json");
  EXPECT_EQ(scene.inputHashes.at("insert.json"), io::calcSha256(io::readFile(folder.path() / "insert.json")));
  EXPECT_EQ(read("{nurbs: insert.json}").surfaces[0].patches, 2);
  const double up = surface.patch(0).calcNormal(0, 0).y();
  const Scene flipped = read("{nurbs: insert.json, patches: lateral, flip_normals: true}");
  EXPECT_EQ(flipped.contacts[0].definition.compartments[0].fixedSurface->patch(0).calcNormal(0, 0).y(), -up);

  const auto message = [&](const std::string& text) { return messageOf([&] { read(text); }); };
  EXPECT_THAT(message("{nurbs: none.json}"),
              AllOf(HasSubstr("s.yaml:3: surfaces.insert.nurbs: "), HasSubstr("none.json\" not found")));
  EXPECT_THAT(message("{nurbs: insert.json, patches: [medal]}"),
              AllOf(HasSubstr("s.yaml:3: surfaces.insert.patches[0]: "), HasSubstr("did you mean \"medial\"")));
  EXPECT_THAT(message("{nurbs: insert.json, patches: [medial, medial]}"), HasSubstr("listed twice"));
  folder.write("bad.json", "{\"format\": 3}");
  EXPECT_THAT(message("{nurbs: bad.json}"),
              AllOf(HasSubstr("surfaces.insert.nurbs: "), HasSubstr("bad.json: /format: ")));

  const std::string metres = io::readFile(folder.path() / "insert.json");
  folder.write("metres.json", replaced(metres, "\"length_unit\": \"mm\"", "\"length_unit\": \"m\""));
  EXPECT_THAT(
      message("{nurbs: metres.json, patches: medial}"),
      AllOf(HasSubstr("surfaces.insert.nurbs: the surface is"), HasSubstr("is length_unit in the file right?")));

  // The data folder: from the options, from the environment, or not at all.
  std::filesystem::create_directories(folder.path() / "data" / "tka");
  std::filesystem::copy(folder.path() / "insert.json", folder.path() / "data" / "tka" / "x.json");
  ReadOptions options;
  options.dataDir = folder.path() / "data";
  EXPECT_EQ(read("{nurbs: \"data:tka/x.json\"}", options).surfaces[0].file, folder.path() / "data" / "tka" / "x.json");
  EXPECT_EQ(read("{nurbs: \"${GENU_DATA}/tka/x.json\"}", options).surfaces[0].patches, 2);
  const char* before = std::getenv("GENU_DATA_DIR");
  const std::string kept = before == nullptr ? "" : before;
  ::unsetenv("GENU_DATA_DIR");
  EXPECT_THAT(message("{nurbs: \"data:tka/x.json\"}"), AllOf(HasSubstr("data folder"), HasSubstr("GENU_DATA_DIR")));
  ::setenv("GENU_DATA_DIR", options.dataDir.c_str(), 1);
  EXPECT_EQ(read("{nurbs: \"data:tka/x.json\"}").surfaces[0].patches, 2);
  if (kept.empty()) {
    ::unsetenv("GENU_DATA_DIR");
  } else {
    ::setenv("GENU_DATA_DIR", kept.c_str(), 1);
  }
}

// ---------------------------------------------------------------------------------------------------------------
// Wrong input.
// ---------------------------------------------------------------------------------------------------------------

TEST(SceneErrors, MissingFile) {
  EXPECT_THAT(messageOf([] { readScene("no/such/scene.yaml"); }), HasSubstr("no/such/scene.yaml\" not found"));
}

TEST(SceneErrors, Yaml) {
  EXPECT_THAT(messageFor("genu: 1\nsurfaces: {a: [1, 2}\n"),
              AllOf(StartsWith("s.yaml:2: not valid YAML"), HasSubstr("column")));
  EXPECT_THAT(messageFor("genu: 1\n  surfaces:\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(messageFor(""), HasSubstr("genu: 1"));
  EXPECT_THAT(messageFor("just text"), HasSubstr("must be a mapping"));
  EXPECT_THAT(messageFor(kSphere + "---\ngenu: 1\n"), HasSubstr("second YAML document"));
  EXPECT_THAT(messageFor(kSphere + "genu: 1\n"),
              AllOf(StartsWith("s.yaml:14: genu: this key was given before, in line 1")));
  EXPECT_THAT(messageAfter("  insert: {E: 463 MPa, nu: 0.46}", "  insert: {E: 463 MPa, nu: 0.46, E: 1 MPa}"),
              StartsWith("s.yaml:6: materials.insert.E: this key was given before"));
  EXPECT_THAT(messageFor(std::string(2000, '[')), HasSubstr("not valid YAML"));
  // Texts on which reading all documents would never end, or would end early without a word.
  EXPECT_THAT(messageFor(", genu: 1\n"), StartsWith("s.yaml:1: "));
  EXPECT_THAT(messageFor(kSphere + "...\nmore: 1\n"), HasSubstr("a scene is one document"));
}

TEST(SceneErrors, Version) {
  EXPECT_THAT(messageAfter("genu: 1", "genu: 2"),
              AllOf(StartsWith("s.yaml:1: genu: is \"2\""), HasSubstr("from 1 to 1")));
  EXPECT_THAT(messageAfter("genu: 1\n", ""), AllOf(HasSubstr("genu: this key is missing"), HasSubstr("genu: 1")));
}

TEST(SceneErrors, UnknownKeysNameTheNearest) {
  EXPECT_THAT(messageAfter("materials:", "matreials:"),
              AllOf(StartsWith("s.yaml:5: matreials: unknown key"), HasSubstr("did you mean \"materials\"")));
  EXPECT_THAT(
      messageAfter("thickness", "thicknes"),
      AllOf(StartsWith("s.yaml:9: contact.knee.fixed.thicknes: unknown key"), HasSubstr("did you mean \"thickness\"")));
  EXPECT_THAT(messageAfter("plane: {y0: 6 mm}", "plane: {yo: 6 mm}"),
              AllOf(StartsWith("s.yaml:3: surfaces.insert.plane.yo"), HasSubstr("known: y0, sx, sz")));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "spere: {R: 30 mm}"), HasSubstr("did you mean \"sphere\""));
  EXPECT_THAT(messageAfter("material: insert", "material: insret"),
              AllOf(StartsWith("s.yaml:11: contact.knee.material: unknown material \"insret\""),
                    HasSubstr("did you mean \"insert\"")));
  EXPECT_THAT(messageAfter("surface: femur", "surface: femr"),
              AllOf(StartsWith("s.yaml:10: contact.knee.moving.surface"), HasSubstr("did you mean \"femur\"")));
  EXPECT_THAT(messageAfter("material: insert", "material: insert\n    strain: larg"),
              AllOf(HasSubstr("contact.knee.strain: is \"larg\""), HasSubstr("did you mean \"large\""),
                    HasSubstr("small, large")));
}

TEST(SceneErrors, Units) {
  EXPECT_THAT(messageAfter("E: 463 MPa", "E: 463"),
              AllOf(StartsWith("s.yaml:6: materials.insert.E: \"463\" has no unit"), HasSubstr("MPa, kPa, Pa, GPa")));
  EXPECT_THAT(messageAfter("E: 463 MPa", "E: 463 mm"),
              AllOf(StartsWith("s.yaml:6: materials.insert.E"), HasSubstr("is a length")));
  EXPECT_THAT(messageAfter("y0: 6 mm", "y0: 6"), StartsWith("s.yaml:3: surfaces.insert.plane.y0: \"6\" has no unit"));
  EXPECT_THAT(messageAfter("-5 mm, 5 mm", "-5, 5 mm"),
              StartsWith("s.yaml:13: contact.knee.compartments.all.rectangle[0]: \"-5\" has no unit"));
  EXPECT_THAT(messageAfter("nu: 0.46", "nu: .nan"),
              AllOf(StartsWith("s.yaml:6: materials.insert.nu"), HasSubstr("is not a number")));
  EXPECT_THAT(messageAfter("R: 30 mm", "R: inf"),
              AllOf(StartsWith("s.yaml:4: surfaces.femur.sphere.R"), HasSubstr("is infinite")));
}

TEST(SceneErrors, Ranges) {
  EXPECT_THAT(messageAfter("nu: 0.46", "nu: 0.5"),
              AllOf(StartsWith("s.yaml:6: materials.insert.nu: is 0.5"), HasSubstr("0 <= nu < 0.5")));
  EXPECT_THAT(messageAfter("nu: 0.46", "nu: -0.1"), HasSubstr("0 <= nu < 0.5"));
  EXPECT_THAT(messageAfter("E: 463 MPa", "E: 0 MPa"),
              AllOf(StartsWith("s.yaml:6: materials.insert.E: is \"0 MPa\""), HasSubstr("> 0")));
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: -6 mm"),
              AllOf(StartsWith("s.yaml:9: contact.knee.fixed.thickness: is \"-6 mm\""), HasSubstr("> 0")));
  EXPECT_THAT(messageAfter("grid: 30x20", "grid: 30x-20"),
              AllOf(StartsWith("s.yaml:13: contact.knee.compartments.all.grid"), HasSubstr("1 to 4000")));
  EXPECT_THAT(
      messageAfter("grid: 30x20", "grid: [30, 0]"),
      AllOf(StartsWith("s.yaml:13: contact.knee.compartments.all.grid[1]: is \"0\""), HasSubstr("from 1 to 4000")));
  EXPECT_THAT(messageAfter("-5 mm, 5 mm", "5 mm, -5 mm"),
              AllOf(StartsWith("s.yaml:13: "), HasSubstr("x0 = 5 mm is not below x1 = -5 mm")));
  EXPECT_THAT(messageAfter("-4 mm, 4 mm", "4 mm, 4 mm"), HasSubstr("z0 = 4 mm is not below z1"));
  EXPECT_THAT(messageAfter("-5 mm, 5 mm, ", ""), AllOf(HasSubstr("has 2 values"), HasSubstr("x0, x1, z0, z1")));
  EXPECT_THAT(messageAfter("R: 30 mm", "R: -30 mm"), HasSubstr("surfaces.femur.sphere.R: is \"-30 mm\"; allowed: > 0"));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "torus: {Rs: 10 mm, Rf: 10 mm}"),
              HasSubstr("surfaces.femur.torus.Rf: is 10 mm; allowed: 0 < Rf < Rs"));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "paraboloid: {Rx: 0 mm, Rz: 1 m}"),
              HasSubstr("surfaces.femur.paraboloid.Rx: is 0"));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "dish: {Rs: -1 m, Rf: 1 m}"),
              HasSubstr("surfaces.femur.dish.Rs: is negative"));
  EXPECT_THAT(messageAfter("E: 463 MPa", "law: power-law, eps0: 0.0597, p0: 18.4 MPa, n: 0.5"),
              HasSubstr("materials.insert.n: is 0.5; allowed: n >= 1"));
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: {constant: 6 mm, min: 8 mm, max: 7 mm}"),
              HasSubstr("thickness.max: is 7 mm, below min = 8 mm"));
}

TEST(SceneErrors, Structure) {
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: none"),
              AllOf(StartsWith("s.yaml:8: contact.knee: neither body"), HasSubstr("thickness")));
  EXPECT_THAT(messageAfter("{surface: femur}", "{}"), HasSubstr("no moving surface"));
  EXPECT_THAT(messageAfter("material: insert", "material: insert\n    distance: rays"),
              AllOf(HasSubstr("rays"), HasSubstr("minimum"), HasSubstr("ray")));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "sphere: {R: 30 mm}, plane: {}"), HasSubstr("a surface is one thing"));
  EXPECT_THAT(messageAfter("{sphere: {R: 30 mm}}", "{pose: \"\"}"), HasSubstr("no kind of surface"));
  EXPECT_THAT(messageAfter("{sphere: {R: 30 mm}}", "{sphere: {R: 30 mm}, extent: 1 m}"),
              HasSubstr("unknown key \"extent\""));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "sphere:"),
              HasSubstr("surfaces.femur.sphere: is empty, keys with values are needed"));
  EXPECT_THAT(messageAfter("sphere: {R: 30 mm}", "sphere: {R: [1 mm]}"), HasSubstr("is a list, a length"));
  EXPECT_THAT(messageAfter("insert: {E: 463 MPa, nu: 0.46}", "insert: {E: 463 MPa, nu: 0.46, n: 3}"),
              HasSubstr("unknown key \"n\""));
  EXPECT_THAT(messageAfter("insert: {E: 463 MPa, nu: 0.46}", "insert: {eps0: 0.06, nu: 0.46}"),
              HasSubstr("add \"law: power-law\""));
  EXPECT_THAT(messageAfter("E: 463 MPa, ", ""),
              HasSubstr("materials.insert.E: this key is missing; write \"E: 463 MPa\""));
  EXPECT_THAT(messageAfter("  insert: {E", "  in.sert: {E"), HasSubstr("the name \"in.sert\" is not allowed"));
  EXPECT_THAT(messageAfter("      all:", "      total:"), HasSubstr("\"total\" is taken"));
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: {height_above: 0 mm, constant: 6 mm}"),
              HasSubstr("one source"));
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: {min: 1 mm}"), HasSubstr("says nothing about the layer"));
  EXPECT_THAT(messageAfter("thickness: 6 mm", "thickness: {constant: 6 mm, along: normal}"),
              HasSubstr("unknown key \"along\""));
  EXPECT_THAT(messageFor(kSphere + "      more: {rectangle: \"4 mm, 8 mm, 0 mm, 1 mm\"}\n"),
              AllOf(StartsWith("s.yaml:14: "), HasSubstr("\"all\" and \"more\""), HasSubstr("overlap by 1 mm x 1 mm")));
  EXPECT_EQ(parse(kSphere + "      more: {rectangle: \"5 mm, 8 mm, 0 mm, 1 mm\"}\n")
                .contacts[0]
                .definition.compartments.size(),
            2u);
  ReadOptions options;
  options.requireModel = true;
  EXPECT_THAT(messageFor(kSphere, options), AllOf(HasSubstr("model: this key is missing"), HasSubstr("urdf")));
}

// ---------------------------------------------------------------------------------------------------------------
// Model, loads, analysis.
// ---------------------------------------------------------------------------------------------------------------

class ModelScene : public testing::Test {
 protected:
  void SetUp() override {
    folder_.write("knee.urdf", "<robot name=\"knee\"/>");
    folder_.write("gait.csv", "time,percent,rz,axial,gap,note\n0,0,-5,-1,1,a\n0.5,50,-20,-2,,b\n1,100,-6,-1.5,2,c\n");
    folder_.write("gait.sto", "n\ninDegrees=yes\nendheader\ntime\trz\n0\t-5\n1\t-6\n");
  }
  Scene read(const std::string& yaml) const { return parseScene(yaml, folder_.path() / "s.yaml"); }
  std::string message(const std::string& from, const std::string& to) const {
    const std::string full = messageOf([&] { read(replaced(kModel, from, to)); });
    const std::string prefix = (folder_.path() / "s.yaml").string() + ":";
    EXPECT_THAT(full, StartsWith(prefix));
    return full.substr(std::min(prefix.size(), full.size()));
  }

  const std::string kModel = kSphere + R"(model:
  urdf: knee.urdf
  joint: tibiofemoral
  gravity: "0, -9.81, 0 m/s^2"
  coordinates:
    rz: {prescribed: {table: gait.csv, column: rz, unit: deg, offset: 1 deg}}
    ry: {prescribed: "5 deg"}
    x: {prescribed: {table: gait.csv, column: axial, unit: mm, time: {column: percent, unit: percent}, scale: -2}}
    y: {free: {start: 33 mm, damping: 1 N s/mm}}
    z: free
loads:
  axial: {body: femur, frame: tibia, force: [0 N, {table: gait.csv, column: axial, unit: 1, scale: 686 N}, 0 N], point: {at: "0 mm, 0 mm, 9.6 mm"}}
  adduction: {coordinate: rx, value: 2 N m}
analysis:
  cycle: 1 s
  static: {method: both, max_time: 5 s}
  gait: {output_interval: 20 ms, accuracy: 1e-5, settle_first: false}
output: {maps: false}
)";
  TemporaryFolder folder_;
};

TEST_F(ModelScene, ReadsEverything) {
  const Scene scene = read(kModel);
  ASSERT_TRUE(scene.model.has_value());
  EXPECT_EQ(scene.model->urdf, folder_.path() / "knee.urdf");
  EXPECT_EQ(scene.model->joint, "tibiofemoral");
  EXPECT_EQ(scene.model->gravity_mPerS2, (std::array<double, 3>{0, -9.81, 0}));
  const auto& q = scene.model->coordinates;
  EXPECT_TRUE(std::holds_alternative<FreeCoordinate>(q[0]));  // rx: not mentioned
  EXPECT_NEAR(std::get<double>(std::get<PrescribedCoordinate>(q[1]).motion), 5 * contact::kPi / 180, 1e-16);
  const auto& rz = std::get<TimeSeries>(std::get<PrescribedCoordinate>(q[2]).motion);
  EXPECT_THAT(rz.time_s, ElementsAre(0, 0.5, 1));
  EXPECT_NEAR(rz.value[1], -19 * contact::kPi / 180, 1e-15);
  EXPECT_EQ(rz.source, "gait.csv, column rz");
  const auto& x = std::get<TimeSeries>(std::get<PrescribedCoordinate>(q[3]).motion);
  EXPECT_THAT(x.time_s, ElementsAre(0, 0.5, 1));
  EXPECT_NEAR(x.value[1], 0.004, 1e-18);
  const auto& y = std::get<FreeCoordinate>(q[4]);
  EXPECT_EQ(y.start, 0.033);
  EXPECT_EQ(y.damping, 1000);
  EXPECT_FALSE(std::get<FreeCoordinate>(q[5]).start.has_value());
  ASSERT_EQ(scene.loads.size(), 1u);
  EXPECT_EQ(scene.loads[0].body, "femur");
  EXPECT_EQ(scene.loads[0].frame, "tibia");
  EXPECT_EQ(scene.loads[0].pointBody, "femur");
  EXPECT_EQ(std::get<double>(scene.loads[0].point_m[2]), 0.0096);
  EXPECT_EQ(std::get<double>(scene.loads[0].force_N[0]), 0);
  EXPECT_THAT(std::get<TimeSeries>(scene.loads[0].force_N[1]).value, ElementsAre(-686, -1372, -1029));
  ASSERT_EQ(scene.generalizedLoads.size(), 1u);
  EXPECT_EQ(scene.generalizedLoads[0].coordinate, 0);
  EXPECT_EQ(std::get<double>(scene.generalizedLoads[0].value), 2);
  EXPECT_EQ(scene.staticAnalysis->method, StaticSpec::Method::both);
  EXPECT_EQ(scene.staticAnalysis->maxTime_s, 5);
  EXPECT_EQ(scene.gait->duration_s, 1);
  EXPECT_EQ(scene.gait->outputInterval_s, 0.02);
  EXPECT_EQ(scene.gait->accuracy, 1e-5);
  EXPECT_FALSE(scene.gait->settleFirst);
  EXPECT_FALSE(scene.output.maps);
  EXPECT_TRUE(scene.output.plots);
  EXPECT_EQ(scene.inputHashes.size(), 3u);
  EXPECT_EQ(scene.where("loads.axial.body"), (folder_.path() / "s.yaml").string() + ":25: loads.axial.body");
}

TEST_F(ModelScene, OneNumberChangesTheCycle) {
  std::string yaml = replaced(kModel, "cycle: 1 s", "cycle: 2 s");
  yaml = replaced(yaml, "unit: deg, offset", "unit: deg, time: {column: percent, unit: percent}, offset");
  yaml = replaced(yaml, "unit: 1, scale", "unit: 1, time: {column: percent, unit: '%'}, scale");
  const Scene scene = read(yaml);
  EXPECT_EQ(scene.gait->duration_s, 2);
  EXPECT_THAT(std::get<TimeSeries>(scene.loads[0].force_N[1]).time_s, ElementsAre(0, 1, 2));
}

TEST_F(ModelScene, StorageFilesCarryTheirAngleUnit) {
  const Scene scene =
      read(replaced(kModel, "table: gait.csv, column: rz, unit: deg, offset: 1 deg", "table: gait.sto, column: rz"));
  EXPECT_NEAR(std::get<TimeSeries>(std::get<PrescribedCoordinate>(scene.model->coordinates[2]).motion).value[0],
              -5 * contact::kPi / 180, 1e-16);
  EXPECT_THAT(message("table: gait.csv, column: rz, unit: deg", "table: gait.sto, column: rz, unit: rad"),
              AllOf(StartsWith("19: model.coordinates.rz.prescribed.unit"), HasSubstr("inDegrees=yes")));
}

TEST_F(ModelScene, TableErrors) {
  EXPECT_THAT(message("cycle: 1 s", "cycle: 2 s"),
              AllOf(StartsWith("19: model.coordinates.rz.prescribed.table: gait.csv, column rz ends at 1 s, before the "
                               "run does (2 s, analysis.gait.duration)")));
  EXPECT_THAT(message("gait: {", "gait: {duration: 1.5 s, "), AllOf(HasSubstr("ends at 1 s"), HasSubstr("1.5 s")));
  EXPECT_THAT(message("static: {", "static: {time: 3 s, "),
              AllOf(HasSubstr("ends at 1 s"), HasSubstr("analysis.static.time")));
  EXPECT_THAT(message("column: rz", "column: r"),
              AllOf(StartsWith("19: "), HasSubstr("unknown column \"r\""), HasSubstr("known: time, percent, rz")));
  EXPECT_THAT(message("column: rz", "column: gap"),
              AllOf(StartsWith("19: "), HasSubstr("gait.csv:3: column \"gap\" (5) is empty")));
  EXPECT_THAT(message("column: rz, unit: deg", "column: rz"),
              AllOf(StartsWith("19: "), HasSubstr("unit: this key is missing"), HasSubstr("deg, rad")));
  EXPECT_THAT(message("unit: deg", "unit: mm"),
              AllOf(StartsWith("19: model.coordinates.rz.prescribed.unit"), HasSubstr("deg, rad")));
  EXPECT_THAT(message("table: gait.csv", "table: gate.csv"), AllOf(StartsWith("19: "), HasSubstr("not found")));
  EXPECT_THAT(message("unit: deg,", "unit: deg, tim: t,"), HasSubstr("did you mean \"time\""));
  folder_.write("nan.csv", "time,rz\n0,1\n0.5,nan\n1,2\n");
  EXPECT_THAT(message("table: gait.csv", "table: nan.csv"),
              AllOf(StartsWith("19: "), HasSubstr("nan.csv:3: column \"rz\" (2) is nan")));
  folder_.write("back.csv", "time,rz\n0,1\n0.5,1\n0.5,2\n");
  EXPECT_THAT(message("table: gait.csv", "table: back.csv"),
              AllOf(StartsWith("19: "), HasSubstr("back.csv:4: column \"time\" is 0.5 after 0.5")));
  folder_.write("late.csv", "time,rz\n0.2,1\n0.5,1\n1,2\n");
  EXPECT_THAT(message("table: gait.csv", "table: late.csv"), HasSubstr("begins at 0.2 s, after the run does (0 s)"));
  folder_.write("short.csv", "time,rz\n0,1\n");
  EXPECT_THAT(message("table: gait.csv", "table: short.csv"), HasSubstr("at least two"));
}

TEST_F(ModelScene, LoadErrors) {
  EXPECT_THAT(message("coordinate: rx", "coordinate: rz"),
              AllOf(StartsWith("26: loads.adduction.coordinate: \"rz\" is prescribed (model.coordinates.rz, line 19)"),
                    HasSubstr("free")));
  EXPECT_THAT(message("coordinate: rx", "coordinate: rw"), AllOf(HasSubstr("allowed: rx, ry, rz, x, y, z")));
  EXPECT_THAT(message("value: 2 N m", "value: 2 N"),
              AllOf(StartsWith("26: loads.adduction.value"), HasSubstr("moment")));
  EXPECT_THAT(message("frame: tibia, ", ""),
              AllOf(StartsWith("25: loads.axial.frame: this key is missing"), HasSubstr("frame: tibia")));
  EXPECT_THAT(message("force: [0 N, ", "force: ["), AllOf(HasSubstr("has 2 values"), HasSubstr("fx, fy, fz")));
  EXPECT_THAT(message("unit: 1, scale: 686 N", "unit: N, scale: 686 N"),
              AllOf(HasSubstr("loads.axial.force[1].scale"), HasSubstr("a force is needed")));
  EXPECT_THAT(message("9.6 mm", "9.6"), HasSubstr("loads.axial.point.at[2]: \"9.6\" has no unit"));
  EXPECT_THAT(messageOf([&] { read(kSphere + "loads: {a: {body: f, frame: t, force: \"0 N, 0 N, 0 N\"}}\n"); }),
              HasSubstr("needs a model"));
}

TEST_F(ModelScene, CoordinateAndAnalysisErrors) {
  EXPECT_THAT(message("z: free", "z: fre"),
              AllOf(StartsWith("23: model.coordinates.z: is \"fre\""), HasSubstr("allowed: free")));
  EXPECT_THAT(message("z: free", "z: 5 mm"), HasSubstr("write {prescribed: \"5 mm\"}"));
  EXPECT_THAT(message("z: free", "zz: free"),
              AllOf(StartsWith("23: model.coordinates.zz: unknown key"), HasSubstr("rx, ry, rz, x, y, z")));
  EXPECT_THAT(message("z: free", "z: {free: {}, prescribed: 5 mm}"), HasSubstr("either free or prescribed"));
  EXPECT_THAT(message("start: 33 mm", "start: 33 deg"), HasSubstr("is an angle, a length is needed"));
  EXPECT_THAT(message("damping: 1 N s/mm", "damping: -1 N s/mm"), HasSubstr(">= 0"));
  EXPECT_THAT(message("-9.81, 0 m/s^2", "-9.81, 0"), HasSubstr("has no unit"));
  EXPECT_THAT(message("knee.urdf", "no.urdf"), AllOf(StartsWith("15: model.urdf"), HasSubstr("not found")));
  EXPECT_THAT(message("method: both", "method: newtn"),
              AllOf(HasSubstr("did you mean \"newton\""), HasSubstr("newton, implicit-euler, both")));
  EXPECT_THAT(message("accuracy: 1e-5", "accuracy: 0"), HasSubstr("allowed: 1e-12 to 0.001"));
  EXPECT_THAT(message("accuracy: 1e-5", "step: 0 s"), HasSubstr("allowed: > 0"));
  EXPECT_THAT(message("accuracy: 1e-5", "max_order: 13"), HasSubstr("12"));
  EXPECT_THAT(message("20 ms", "2 s"), HasSubstr("longer than the run"));
  EXPECT_THAT(message("20 ms", "1e-9 s"), HasSubstr("at most 1e+06"));
  EXPECT_THAT(message("settle_first: false", "settle_first: no"), HasSubstr("true, false"));
  EXPECT_THAT(message("settle_first: false", "error_estimate: 5 %"), HasSubstr("true, false"));
  EXPECT_FALSE(read(kModel).gait->errorEstimate);
  EXPECT_TRUE(read(replaced(kModel, "settle_first: false", "error_estimate: true")).gait->errorEstimate);
  EXPECT_THAT(message("cycle: 1 s", "cycle: 0 s"), HasSubstr("> 0"));
}

// ---------------------------------------------------------------------------------------------------------------
// Command line.
// ---------------------------------------------------------------------------------------------------------------

TEST(CommandLine, Pose) {
  const auto q = parsePose("0 deg, 90 deg, -0.5 rad, 0 mm, 35.8 mm, 1 cm");
  EXPECT_NEAR(q[1], contact::kPi / 2, 1e-15);
  EXPECT_EQ(q[2], -0.5);
  EXPECT_EQ(q[4], 0.0358);
  EXPECT_EQ(q[5], 0.01);
  EXPECT_THAT(messageOf([] { parsePose("0, 0 deg, 0 deg, 0 mm, 0 mm, 0 mm"); }),
              AllOf(StartsWith("pose: rx: \"0\" has no unit"), HasSubstr("deg, rad")));
  EXPECT_THAT(messageOf([] { parsePose("0 deg, 0 deg, 0 deg, 0 deg, 0 mm, 0 mm"); }), StartsWith("pose: x: "));
  EXPECT_THAT(messageOf([] { parsePose("0 deg, 0 mm"); }),
              AllOf(HasSubstr("has 2 values"), HasSubstr("rx, ry, rz, x, y, z")));
}

TEST(CommandLine, Grid) {
  EXPECT_EQ(parseGrid("50x40"), std::make_pair(50, 40));
  EXPECT_EQ(parseGrid(" 50 x 40 "), std::make_pair(50, 40));
  EXPECT_EQ(parseGrid("50,40"), std::make_pair(50, 40));
  for (const char* text : {"50", "50x", "x50", "0x5", "-1x5", "5x4001", "5x5x5", "5.5x5", "", "99999999999x1"}) {
    EXPECT_THAT(messageOf([text] { parseGrid(text, "--grid"); }), AllOf(StartsWith("--grid: "), HasSubstr("30x30")))
        << text;
  }
  ReadOptions options;
  options.gridOverride = {7, 9};
  const Scene scene = parse(kSphere, options);
  EXPECT_EQ(scene.contacts[0].definition.compartments[0].nx, 7);
  EXPECT_EQ(scene.contacts[0].definition.compartments[0].nz, 9);
}

TEST(ElementKeywords, AreNotTakenTwice) {
  for (const char* taken : {"springs", "loads", "genu"}) {
    EXPECT_THROW(registerElementReader(taken, nullptr), std::invalid_argument) << taken;
  }
}

}  // namespace
}  // namespace genu::scene
