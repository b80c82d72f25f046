#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "ModelFiles.h"

namespace genu::models_test {
namespace {

std::string readText(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/** The committed files are what the generator makes: scenes, tables and URDF files letter by letter, surfaces nearly
 so. Control points are rounded to 1e-9 mm; another compiler or mathematical library may round one of them the other
 way, so twice that is allowed. */
TEST(Generator, MakesTheCommittedFiles) {
  const TemporaryFolder output;
  ASSERT_EQ(runShell(std::string("\"") + GENU_MAKE_MODELS + "\" \"" + output.path().string() + "\" > /dev/null"), 0);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(output.path())) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const fs::path name = fs::relative(entry.path(), output.path());
    SCOPED_TRACE(name.string());
    ASSERT_TRUE(fs::exists(modelFolder() / name));
    if (name.extension() != ".json") {
      EXPECT_EQ(readText(entry.path()), readText(modelFolder() / name));
      continue;
    }
    const auto made = io::readNurbsFile(entry.path()), committed = io::readNurbsFile(modelFolder() / name);
    ASSERT_EQ(made.size(), committed.size());
    for (size_t i = 0; i < made.size(); ++i) {
      EXPECT_EQ(made[i].name, committed[i].name);
      const contact::NurbsPatchData &a = made[i].data, &b = committed[i].data;
      EXPECT_EQ(a.flipNormal, b.flipNormal);
      ASSERT_EQ(a.points.size(), b.points.size());
      ASSERT_EQ(a.knotsU.size(), b.knotsU.size());
      ASSERT_EQ(a.knotsV.size(), b.knotsV.size());
      for (size_t k = 0; k < a.points.size(); ++k) EXPECT_LE((a.points[k] - b.points[k]).norm(), 2e-12);
      for (size_t k = 0; k < a.knotsU.size(); ++k) EXPECT_NEAR(a.knotsU[k], b.knotsU[k], 1e-11);
      for (size_t k = 0; k < a.knotsV.size(); ++k) EXPECT_NEAR(a.knotsV[k], b.knotsV[k], 1e-11);
    }
  }
  EXPECT_EQ(files, 20);  // 8 with surfaces, 12 others
}

TEST(Generator, FailsWithAMessageWhereItCannotWrite) {
  EXPECT_EQ(runShell(std::string("\"") + GENU_MAKE_MODELS + "\" /proc/models > /dev/null 2>&1"), 3);
  EXPECT_NE(runShell(std::string("\"") + GENU_MAKE_MODELS + "\" > /dev/null 2>&1"), 0);
}

}  // namespace
}  // namespace genu::models_test
