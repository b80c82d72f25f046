#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ReportFixtures.h"
#include "genu/report/OutputFolder.h"

namespace genu::report {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using testing::write;

const char* kSummary = R"({"format": "genu-results", "files": ["maps/a.vtp", "../outside.txt", "/etc/passwd"]})";

TEST(OutputFolder, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  {
    OutputFolder out(folder / "results");
    write(out.file("maps/a.vtp"), "a");
  }
  EXPECT_EQ(folder.count(), 0u);
}

TEST(OutputFolder, CommitMakesTheFolderAndLeavesNothingElse) {
  const TemporaryFolder folder;
  {
    OutputFolder out(folder / "deep/results/");
    write(out.file("maps/a.vtp"), "a");
    write(out.file("summary.json"), kSummary);
    EXPECT_THAT(out.listFiles(), ::testing::ElementsAre("maps/a.vtp", "summary.json"));
    EXPECT_FALSE(fs::exists(folder / "deep/results"));
    out.commit();
  }
  EXPECT_TRUE(fs::exists(folder / "deep/results/maps/a.vtp"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "deep"), {}), 1);
}

TEST(OutputFolder, AnEarlierRunIsReplacedAndForeignFilesStay) {
  const TemporaryFolder folder;
  write(folder / "results/summary.json", kSummary);
  write(folder / "results/maps/a.vtp", "old");
  write(folder / "results/notes.txt", "mine");
  write(folder / "outside.txt", "outside");
  {
    OutputFolder out(folder / "results");
    write(out.file("maps/b.vtp"), "new");
    write(out.file("summary.json"), kSummary);
    out.commit();
  }
  EXPECT_FALSE(fs::exists(folder / "results/maps/a.vtp"));
  EXPECT_EQ(testing::read(folder / "results/maps/b.vtp"), "new");
  EXPECT_EQ(testing::read(folder / "results/notes.txt"), "mine");
  EXPECT_EQ(testing::read(folder / "outside.txt"), "outside") << "a path that leaves the folder is not believed";
  EXPECT_EQ(folder.count(), 2u);
}

TEST(OutputFolder, ForeignFilesWithOurNamesAreNotOverwritten) {
  const TemporaryFolder folder;
  write(folder / "results/motion.sto", "measured");
  try {
    OutputFolder::check(folder / "results");
    FAIL() << "nothing was thrown";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), HasSubstr("motion.sto"));
    EXPECT_THAT(e.what(), HasSubstr("choose another folder"));
  }
}

TEST(OutputFolder, AFileInTheWayIsAnInputError) {
  const TemporaryFolder folder;
  write(folder / "results", "a file");
  EXPECT_THROW(OutputFolder::check(folder / "results"), InputError);
  EXPECT_THROW(OutputFolder::check(folder / "results/deeper"), InputError);
  EXPECT_THROW(OutputFolder::check(""), InputError);
}

}  // namespace
}  // namespace genu::report
