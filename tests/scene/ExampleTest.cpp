#include "TestFiles.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/io/Files.h"
#include "genu/io/NurbsFile.h"
#include "genu/io/Table.h"
#include "genu/scene/SceneFile.h"

namespace genu::scene {
namespace {

using test::TemporaryFolder;

std::vector<std::string> readBlocks(const std::string& file, const std::string& language) {
  const std::string text = io::readFile(std::filesystem::path(GENU_SOURCE_DIR) / "docs" / file);
  std::vector<std::string> blocks;
  const std::string fence = "```" + language + "\n";
  for (size_t at = text.find(fence); at != std::string::npos; at = text.find(fence, at)) {
    at += fence.size();
    const size_t end = text.find("```", at);
    blocks.push_back(text.substr(at, end - at));
    at = end + 3;
  }
  return blocks;
}

/** Every complete scene of the schema document is read, beside files of the names it uses. */
TEST(Examples, ScenesOfTheDocumentAreRead) {
  const TemporaryFolder folder;
  folder.write("knee.urdf", "<robot name=\"knee\"/>");
  folder.write("gait.csv", "percent_cycle,rz,ry,x,load\n0,-5,0,1,0.3\n50,-20,3,4,3\n100,-5,0,1,0.3\n");
  std::vector<io::NamedPatch> patches;
  patches.push_back({"medial", contact::makePlane(0.006, 0, 0, contact::Solid::below, 0.05)[0].data()});
  patches.push_back({"lateral", contact::makePlane(0.006, 0, 0, contact::Solid::below, 0.05)[0].data()});
  for (const char* name : {"insert.json", "femur.json", "tibia_cartilage.json", "tibia_bone.json",
                           "femur_cartilage.json", "femur_bone.json"}) {
    io::writeNurbsFile(folder.path() / name, patches);
  }
  int scenes = 0;
  for (const std::string& block : readBlocks("scene.md", "yaml")) {
    if (block.rfind("genu: 1", 0) != 0) continue;
    ++scenes;
    SCOPED_TRACE(block);
    EXPECT_NO_THROW({
      const Scene scene = parseScene(block, folder.path() / "s.yaml");
      EXPECT_TRUE(scene.unused.empty());
    });
  }
  EXPECT_GE(scenes, 3);
}

TEST(Examples, TheHipOfTheDocumentCarriesItsClosedForm) {
  std::string hip;
  for (const std::string& block : readBlocks("scene.md", "yaml")) {
    if (block.find("name: hip") != std::string::npos) hip = block;
  }
  ASSERT_FALSE(hip.empty());
  const auto pair = makeContactPairs(parseScene(hip, "hip.yaml"))[0];
  const auto q = parsePose("0 deg, 0 deg, 0 deg, 0 mm, 1.1 mm, 0.6 mm");
  const auto r = pair->evaluate(q);
  ASSERT_EQ(r.status, contact::EvaluationStatus::ok);
  // Ball in a cup (theory.md, "Closed forms") with the linear law: p cos(theta/2) = K AB/h, and the component along the line of
  // centres of the bisector m is ((a + u).e)/(2 cos(theta/2)). Midpoint sum of 20000 pieces: 1e-8.
  const double R2 = 0.025, R1 = 0.024, h = 0.008, delta = std::hypot(q[4], q[5]);
  const double K = pair->definition().material.confinementFactor() * 463e6;
  double expected = 0;
  const double rim = std::acos((R2 * R2 + delta * delta - R1 * R1) / (2 * R2 * delta));
  constexpr int kPieces = 20000;
  for (int i = 0; i < kPieces; ++i) {
    const double psi = rim * (i + 0.5) / kPieces, r2 = std::hypot(R2 * std::cos(psi) - delta, R2 * std::sin(psi));
    const double cosTheta = (R2 - delta * std::cos(psi)) / r2;
    const double alongCenters = std::cos(psi) + (R2 * std::cos(psi) - delta) / r2;  // of -(n + u)
    expected += K / h * (R1 - r2) * alongCenters / (1 + cosTheta) * 2 * contact::kPi * R2 * R2 * std::sin(psi) * rim / kPieces;
  }
  const contact::Vec3 direction = contact::Vec3(0, q[4], q[5]) / delta;
  EXPECT_LT((r.total.forceOnM_F + expected * direction).norm() / expected, 1e-5) << r.total.forceOnM_F.transpose() << " | " << expected;
}

TEST(Examples, FilesOfTheDocumentAreRead) {
  int files = 0;
  for (const std::string& block : readBlocks("file_formats.md", "json")) {
    EXPECT_NO_THROW(io::parseNurbs(block, "example.json"));
    ++files;
  }
  for (const std::string& block : readBlocks("file_formats.md", "csv")) {
    EXPECT_NO_THROW(io::parseTable(block, "example.csv"));
    ++files;
  }
  for (const std::string& block : readBlocks("file_formats.md", "sto")) {
    EXPECT_NO_THROW(io::parseTable(block, "example.sto"));
    ++files;
  }
  EXPECT_EQ(files, 3);
}

}  // namespace
}  // namespace genu::scene
