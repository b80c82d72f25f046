// Every case of bad input ends with the documented exit code, a message that names file, place, value and what is
// allowed, and leaves no file behind.
#include <gmock/gmock.h>

#include "Program.h"

namespace genu::app::testing {
namespace {

using ::testing::HasSubstr;

/** A flat 60 mm square patch at y = 6 mm whose normal is +y, or -y with `flip`. */
std::string makePatch(const std::string& knots, bool flip) {
  return R"({"format": "genu-nurbs", "version": 1, "length_unit": "mm", "patches": [{"name": "layer", "degree": [1, 1],
  "knots_u": )" +
         knots + R"(, "knots_v": [0, 0, 1, 1], "flip_normal": )" + (flip ? "true" : "false") + R"(,
  "points": [[[-30, 6, -30], [30, 6, -30]], [[-30, 6, 30], [30, 6, 30]]]}]})";
}

struct Case {
  std::string name;
  std::vector<std::string> arguments;  ///< of the program
  std::string scene;                   ///< text of scene.yaml
  int exitCode;
  std::vector<std::string> message;                             ///< all of these are in it
  std::vector<std::pair<std::string, std::string>> files = {};  ///< besides knee.urdf and gait.csv
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

std::vector<Case> makeCases() {
  const std::vector<std::string> gait = {"gait", "scene.yaml", "--output", "out"};
  const std::vector<std::string> statics = {"static", "scene.yaml", "--output", "out"};
  const std::vector<std::string> contact = {"contact", "scene.yaml", "--pose",
                                            "0 deg, 0 deg, 0 deg, 0 mm, 35.8 mm, 0 mm", "--json"};
  const std::string knee = kKnee, ball = kBall;
  const std::string nurbs = replaced(ball, "{plane: {y0: 6 mm}}", "{nurbs: layer.json}");
  const std::string yFree = "    y: free\n";
  return {
      {"MissingScene", {"gait", "nowhere.yaml", "--output", "out"}, knee, 2, {"nowhere.yaml"}},
      {"MissingSurface", contact, nurbs, 2, {"scene.yaml:3", "layer.json"}},
      {"MissingTable", gait, replaced(knee, "gait.csv", "walk.csv"), 2, {"scene.yaml", "rz", "walk.csv"}},
      {"MissingUrdf", gait, replaced(knee, "knee.urdf", "hip.urdf"), 2, {"hip.urdf"}},
      {"MalformedYaml", gait, replaced(knee, "materials:", "materials: [}"), 2, {"scene.yaml:8"}},
      {"UnknownKey",
       gait,
       replaced(knee, "material: polyethylene", "materail: polyethylene"),
       2,
       {"scene.yaml", "materail", "did you mean \"material\""}},
      {"WrongUnit", gait, replaced(knee, "463 MPa", "463 mm"), 2, {"scene.yaml:9", "E", "463 mm", "MPa"}},
      {"NoUnit", gait, replaced(knee, "463 MPa", "463"), 2, {"scene.yaml:9", "E", "463", "MPa"}},
      {"NuOneHalf", gait, replaced(knee, "nu: 0.46", "nu: 0.5"), 2, {"scene.yaml:9", "nu", "0.5"}},
      {"NegativeThickness",
       contact,
       replaced(ball, "thickness: 6 mm", "thickness: -6 mm"),
       2,
       {"scene.yaml:9", "thickness", "-6 mm", "> 0"}},
      {"InvertedNormals",
       contact,
       nurbs,
       2,
       {"scene.yaml", "normal"},
       {{"layer.json", makePatch("[0, 0, 1, 1]", true)}}},
      {"KnotsNotMonotone",
       contact,
       nurbs,
       2,
       {"layer.json", "knots"},
       {{"layer.json", makePatch("[0, 0.5, 0.2, 1]", false)}}},
      {"LoadOnPrescribedCoordinate",
       gait,
       replaced(knee, "analysis:", "  twist: {coordinate: ry, value: 1 N m}\nanalysis:"),
       2,
       {"scene.yaml", "twist", "ry", "prescribed"}},
      {"TableEndsTooEarly",
       gait,
       replaced(knee, "duration: 0.2 s", "duration: 0.5 s"),
       2,
       {"scene.yaml", "gait.csv", "0.2", "0.5"}},
      {"NanInTable", gait, knee, 2, {"gait.csv", "3", "nan"}, {{"gait.csv", replaced(kTable, "-5,800", "-5,nan")}}},
      {"NoOverlap",
       contact,
       replaced(ball, "-5 mm, 5 mm, -5 mm, 5 mm", "-5 mm, 5 mm, 905 mm, 915 mm"),
       2,
       {"scene.yaml", "all"},
       {}},
      {"ContactNeverMadeStatic", statics, replaced(knee, yFree, "    y: {prescribed: 60 mm}\n"), 3, {"contact"}},
      {"ContactNeverMadeGait", gait, replaced(knee, yFree, "    y: {prescribed: 60 mm}\n"), 3, {"contact"}},
      {"FullPenetrationStatic", statics, replaced(knee, yFree, "    y: {prescribed: 20 mm}\n"), 3, {"penetration"}},
      {"FullPenetrationGait", gait, replaced(knee, yFree, "    y: {prescribed: 20 mm}\n"), 3, {"penetration"}},
      {"NoModel", gait, ball, 2, {"scene.yaml", "model"}},
      {"MeshInMillimetresSaidToBeMetres",
       {"fit", "mesh.stl", "--unit", "m", "--output", "out"},
       ball,
       2,
       {"mesh.stl", "mm"},
       {{"mesh.stl", R"(solid square
facet normal 0 1 0
outer loop
vertex -30 0 -30
vertex -30 0 30
vertex 30 0 30
endloop
endfacet
facet normal 0 1 0
outer loop
vertex -30 0 -30
vertex 30 0 30
vertex 30 0 -30
endloop
endfacet
endsolid square
)"}}},
  };
}

class BadInput : public ProgramTest, public ::testing::WithParamInterface<Case> {};

TEST_P(BadInput, IsExplainedAndLeavesNothing) {
  const Case& c = GetParam();
  write("knee.urdf", kUrdf);
  write("gait.csv", kTable);
  write("scene.yaml", c.scene);
  for (const auto& [name, text] : c.files) write(name, text);
  // A plane reaches as far as the scene does, so it must end for the grid to miss it.
  if (c.name == "NoOverlap") write("scene.yaml", replaced(c.scene, "y0: 6 mm}}", "y0: 6 mm}, extent: 30 mm}"));
  const auto before = listFolder();
  const Outcome outcome = run(c.arguments);
  EXPECT_EQ(outcome.exitCode, c.exitCode) << outcome.err;
  for (const auto& part : c.message) EXPECT_THAT(outcome.err, HasSubstr(part));
  // Warnings about the scene may come before, one to a line.
  std::string rest = outcome.err;
  while (rest.rfind("warning: ", 0) == 0) rest.erase(0, rest.find('\n') + 1);
  EXPECT_THAT(rest, ::testing::StartsWith("error: "));
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(listFolder(), before) << "nothing may be left behind";
}

INSTANTIATE_TEST_SUITE_P(Program, BadInput, ::testing::ValuesIn(makeCases()),
                         [](const auto& testCase) { return testCase.param.name; });

}  // namespace
}  // namespace genu::app::testing
