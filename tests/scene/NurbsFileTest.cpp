#include <nlohmann/json.hpp>
#include <stdexcept>

#include "TestFiles.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/io/NurbsFile.h"

namespace genu::io {
namespace {

using nlohmann::json;
using test::messageOf;
using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/** A bilinear 2 x 2 patch, 10 mm wide. */
json makeDocument() {
  return json::parse(R"({"format": "genu-nurbs", "version": 1, "length_unit": "mm", "comment": "c", "patches": [
    {"name": "medial", "degree": [1, 1], "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1],
     "points": [[[0, 0, 0], [10, 0, 0]], [[0, 0, 10], [10, 0, 10]]], "flip_normal": true}]})");
}

std::string messageFor(const json& document) {
  return messageOf([&] { parseNurbs(document.dump(), "f.json"); });
}

TEST(NurbsFile, Reads) {
  const auto patches = parseNurbs(makeDocument().dump(), "f.json");
  ASSERT_EQ(patches.size(), 1u);
  EXPECT_EQ(patches[0].name, "medial");
  const contact::NurbsPatchData& data = patches[0].data;
  EXPECT_EQ(data.numU, 2);
  EXPECT_EQ(data.numV, 2);
  EXPECT_EQ(data.points[3], contact::Vec3(0.01, 0, 0.01));
  EXPECT_TRUE(data.flipNormal);
  EXPECT_FALSE(data.isRational());
  json metres = makeDocument();
  metres["length_unit"] = "m";
  EXPECT_EQ(parseNurbs(metres.dump(), "f.json")[0].data.points[3], contact::Vec3(10, 0, 10));
}

TEST(NurbsFile, ErrorsNameThePointer) {
  const auto with = [](const std::string& pointer, const json& value) {
    json document = makeDocument();
    document[json::json_pointer(pointer)] = value;
    return messageFor(document);
  };
  EXPECT_THAT(with("/patches/0/knots_u/1", -1),
              AllOf(StartsWith("f.json: /patches/0/knots_u/1: is -1 after 0"), HasSubstr("must not decrease")));
  EXPECT_THAT(with("/patches/0/knots_v", json::array({0, 1})),
              AllOf(StartsWith("f.json: /patches/0/knots_v: has 2 knots"), HasSubstr("need 4")));
  EXPECT_THAT(with("/patches/0/knots_v", json::array({0, 0, 0, 0})),
              StartsWith("f.json: /patches/0: patch \"medial\""));
  EXPECT_THAT(with("/patches/0/points/1/0/2", "x"),
              AllOf(StartsWith("f.json: /patches/0/points/1/0/2: "), HasSubstr("a number is needed")));
  EXPECT_THAT(with("/patches/0/points/1/0/2", nullptr), AllOf(HasSubstr("null"), HasSubstr("a number is needed")));
  EXPECT_THAT(with("/patches/0/points/1", json::array({json::array({0, 0, 0})})),
              AllOf(StartsWith("f.json: /patches/0/points/1: has 1 points"), HasSubstr("row 0 has 2")));
  EXPECT_THAT(with("/patches/0/points/1/1", json::array({1, 2})),
              AllOf(StartsWith("f.json: /patches/0/points/1/1: "), HasSubstr("[x, y, z]")));
  EXPECT_THAT(with("/patches/0/degree", json::array({1, 6})),
              AllOf(StartsWith("f.json: /patches/0/degree/1: is 6"), HasSubstr("from 1 to 5")));
  EXPECT_THAT(with("/patches/0/degree", json::array({1.5, 1})), StartsWith("f.json: /patches/0/degree/0: is 1.5"));
  EXPECT_THAT(with("/patches/0/degree", json::array({3, 1})),
              AllOf(HasSubstr("/patches/0/points: has 2 rows"), HasSubstr("at least 4")));
  EXPECT_THAT(with("/patches/0/weights", json::array({json::array({1, 1}), json::array({1, 0})})),
              AllOf(StartsWith("f.json: /patches/0/weights/1/1: is 0"), HasSubstr("> 0")));
  EXPECT_THAT(with("/patches/0/knot_u", 1),
              AllOf(StartsWith("f.json: /patches/0: unknown key \"knot_u\""), HasSubstr("did you mean \"knots_u\"")));
  EXPECT_THAT(with("/length_unit", "inch"), AllOf(StartsWith("f.json: /length_unit: "), HasSubstr("mm, m")));
  EXPECT_THAT(with("/format", "other"), HasSubstr("genu-nurbs"));
  EXPECT_THAT(with("/version", 2), StartsWith("f.json: /version: is 2"));
  EXPECT_THAT(with("/patches", json::array()), HasSubstr("/patches: is empty"));
  EXPECT_THAT(with("/patches/1", makeDocument()["patches"][0]),
              AllOf(StartsWith("f.json: /patches/1/name: repeats"), HasSubstr("medial")));
  EXPECT_THAT(with("/patches/0/flip_normal", 1), HasSubstr("true, false"));
  json missing = makeDocument();
  missing["patches"][0].erase("knots_u");
  EXPECT_THAT(messageFor(missing), StartsWith("f.json: /patches/0: key \"knots_u\" is missing"));
}

TEST(NurbsFile, SyntaxErrorsNameTheLine) {
  EXPECT_THAT(messageOf([] { parseNurbs("{\n  \"format\": \n}", "f.json"); }),
              AllOf(StartsWith("f.json: not valid JSON"), HasSubstr("line 3")));
  EXPECT_THAT(messageOf([] { parseNurbs("[1]", "f.json"); }), AllOf(HasSubstr("(root)"), HasSubstr("an object")));
  EXPECT_THAT(messageOf([] { parseNurbs("{\"version\": 1e999}", "f.json"); }), HasSubstr("not valid JSON"));
  EXPECT_THAT(messageOf([] { parseNurbs("", "f.json"); }), HasSubstr("not valid JSON"));
}

TEST(NurbsFile, RoundTrip) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "s.json";
  std::vector<NamedPatch> patches;
  for (const contact::NurbsPatch& patch : contact::makeTorus(0.03, 0.011)) {
    patches.push_back({"torus \"" + std::to_string(patches.size()) + "\"", patch.data()});
  }
  patches[0].data.flipNormal = true;
  writeNurbsFile(path, patches, "a \"comment\"");
  const auto back = readNurbsFile(path);
  ASSERT_EQ(back.size(), patches.size());
  for (size_t n = 0; n < patches.size(); ++n) {
    const auto &a = patches[n].data, &b = back[n].data;
    EXPECT_EQ(back[n].name, patches[n].name);
    EXPECT_EQ(a.knotsU, b.knotsU);
    EXPECT_EQ(a.knotsV, b.knotsV);
    EXPECT_EQ(a.weights, b.weights);
    EXPECT_EQ(a.flipNormal, b.flipNormal);
    ASSERT_EQ(a.points.size(), b.points.size());
    // m to mm and back are two rounded operations: 2 ulp of 0.03 m at most.
    for (size_t i = 0; i < a.points.size(); ++i) EXPECT_LE((a.points[i] - b.points[i]).norm(), 1.5e-17);
  }
  // From the second reading on nothing changes any more.
  const auto again = folder.path() / "t.json";
  writeNurbsFile(again, back, "c");
  const auto third = readNurbsFile(again);
  for (size_t n = 0; n < back.size(); ++n) EXPECT_EQ(third[n].data.points, back[n].data.points);
  EXPECT_THROW(writeNurbsFile(path, {}, ""), std::invalid_argument);
}

}  // namespace
}  // namespace genu::io
