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
