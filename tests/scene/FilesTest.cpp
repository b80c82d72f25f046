#include "TestFiles.h"
#include "genu/io/Files.h"

namespace genu::io {
namespace {

using test::messageOf;
using test::TemporaryFolder;
using testing::AllOf;
using testing::HasSubstr;

TEST(Files, Sha256OfKnownTexts) {
  // FIPS 180-2, appendix B.1, and the empty message.
  EXPECT_EQ(calcSha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(calcSha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Files, MissingFileAndFolderAreNamed) {
  const TemporaryFolder folder;
  EXPECT_THAT(messageOf([&] { readFile(folder.path() / "none.json", "scene.yaml:3: surfaces.femur.nurbs"); }),
              AllOf(HasSubstr("scene.yaml:3: surfaces.femur.nurbs: "), HasSubstr("none.json\" not found")));
  EXPECT_THAT(messageOf([&] { readFile(folder.path()); }), HasSubstr("is a folder"));
}

TEST(Files, WritesWholeFilesAndLeavesNothingElse) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "new" / "a.txt";
  writeFileAtomically(path, "first");
  writeFileAtomically(path, std::string("second\0", 7));
  EXPECT_EQ(readFile(path), std::string("second\0", 7));
  int entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path() / "new")) ++entries;
  EXPECT_EQ(entries, 1);
  // A target that cannot be replaced (a folder) leaves no temporary file behind.
  std::filesystem::create_directories(folder.path() / "new" / "sub" / "x");
  EXPECT_THROW(writeFileAtomically(folder.path() / "new" / "sub", "text"), ComputationError);
  entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path() / "new")) ++entries;
  EXPECT_EQ(entries, 2);
}

}  // namespace
}  // namespace genu::io
