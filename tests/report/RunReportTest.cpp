#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>

#include "ReportFixtures.h"
#include "genu/io/Table.h"
#include "genu/report/ContactReport.h"
#include "genu/report/Gnuplot.h"
#include "genu/report/RunReport.h"

namespace genu::report {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using testing::write;

bool hasGnuplot(const TemporaryFolder& folder) {
  write(folder / "probe/probe.gp", "print 1\n");
  const DrawResult result = runGnuplot(folder / "probe", {"probe.gp"});
  fs::remove_all(folder / "probe");
  return result.problem.empty();
}

class RunReportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    write(folder_ / "in/scene.yaml", testing::kBallScene);
    scene_ = scene::readScene(folder_ / "in/scene.yaml");
    trajectory_ = testing::makeTrajectory(scene_, 21);
    info_.analysis = "gait";
    info_.folder = folder_ / "out";
    info_.commandLine = {"genu", "gait"};
  }
  nlohmann::json summary() const { return nlohmann::json::parse(testing::read(folder_ / "out/summary.json")); }

  TemporaryFolder folder_;
  scene::Scene scene_;
  scene::Trajectory trajectory_;
  RunInfo info_;
};

TEST_F(RunReportTest, WritesEverythingItLists) {
  const bool plots = hasGnuplot(folder_);
  const RunOutput output = writeRun(scene_, trajectory_, info_);
  EXPECT_THAT(output.table, HasSubstr("t = 0.5 s"));
  const auto json = summary();
  for (const std::string file : json.at("files")) EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / file)) << file;
  for (const char* file : {"motion.sto", "contact.sto", "pressure.pvd", "maps/knee_0020.vtp", "surfaces/knee_fixed.vtp",
                           "scene/files/scene.yaml", "plots/motion.gp", "plots/pressure_map.gp"}) {
    EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / file)) << file;
  }
  if (!plots) GTEST_SKIP() << "gnuplot is not installed: plots not tested";
  for (const char* file : {"plots/motion.png", "plots/forces.png", "plots/pressures.png", "plots/pressure_map.png"}) {
    ASSERT_TRUE(fs::is_regular_file(folder_ / "out" / file)) << file << json.at("plots");
    EXPECT_EQ(testing::read(folder_ / "out" / file).substr(1, 3), "PNG");
  }
  EXPECT_TRUE(output.notes.empty());
}

// A single pose has no course over time: forces are bars, the strongest first, without those that carry nothing.
TEST_F(RunReportTest, ASinglePoseIsDrawnAsBars) {
  trajectory_.frames.resize(1);
  trajectory_.elementColumns = {{"muscles", "slack", "force", "N"},     {"muscles", "slack", "activation", ""}, {"muscles", "weak", "force", "N"},
                                {"muscles", "weak", "activation", ""},  {"muscles", "strong", "force", "N"},    {"muscles", "strong", "activation", ""},
                                {"ligaments", "fibre", "force", "N"}};
  trajectory_.frames[0].elements = {0, 0.02, 30, 0.1, 120, 0.5, 7.5};
  info_.analysis = "static";
  writeRun(scene_, trajectory_, info_);
  EXPECT_EQ(testing::read(folder_ / "out/plots/muscles.dat"),
            "# name value note\n\"strong\" 120 \"120 N, activation 0.5\"\n\"weak\" 30 \"30 N, activation 0.1\"\n");
  EXPECT_THAT(testing::read(folder_ / "out/plots/muscles.gp"), HasSubstr("'muscles force (N), 2 of 3'"));
  EXPECT_THAT(testing::read(folder_ / "out/plots/ligaments.dat"), HasSubstr("\"fibre\" 7.5 \"7.5 N\""));
  const auto names = listCompartmentNames(scene_);
  for (const std::string& name : names) EXPECT_THAT(testing::read(folder_ / "out/plots/forces.dat"), HasSubstr('"' + name + "\" "));
  if (!hasGnuplot(folder_)) GTEST_SKIP() << "gnuplot is not installed: pictures not tested";
  for (const char* file : {"forces", "muscles", "ligaments"}) {
    EXPECT_EQ(testing::read(folder_ / "out/plots" / (std::string(file) + ".png")).substr(1, 3), "PNG") << file;
  }
}

// 40 letters at 9.5 pixels beside panels of 764.
TEST_F(RunReportTest, KeysHaveRoomForLongNames) {
  info_.plots = true;
  trajectory_.elementColumns = {{"springs", std::string(40, 'n'), "force", "N"}};
  for (auto& frame : trajectory_.frames) frame.elements = {1};
  writeRun(scene_, trajectory_, info_);
  EXPECT_THAT(testing::read(folder_ / "out/plots/springs.gp"), HasSubstr("size 1350,430"));
  EXPECT_THAT(testing::read(folder_ / "out/plots/motion.gp"), HasSubstr("size 1100,"));
}

// A run of ligaments alone says nothing about contact, and when which of them pulled most.
TEST_F(RunReportTest, ElementsWithoutContact) {
  info_.plots = info_.maps = false;
  scene_.contacts.clear();
  trajectory_.elementColumns = {{"ligaments", "slack", "force", "N"}, {"ligaments", "taut", "force", "N"}, {"ligaments", "taut", "length", "m"}};
  for (size_t i = 0; i < trajectory_.frames.size(); ++i) {
    trajectory_.frames[i].contacts.clear();
    trajectory_.frames[i].elements = {0, i == 7 ? 12.5 : 3.0, 0.03};
  }
  writeRun(scene_, trajectory_, info_);
  const auto json = summary();
  for (const char* key : {"contact_status", "peaks"}) EXPECT_FALSE(json.contains(key)) << key;
  EXPECT_FALSE(json.at("at_maximum_load").contains("contact"));
  const auto& peaks = json.at("element_peaks").at("ligaments");
  EXPECT_EQ(peaks.at("taut").at("force_N").at("value").get<double>(), 12.5);
  EXPECT_EQ(peaks.at("taut").at("force_N").at("time_s").get<double>(), trajectory_.frames[7].time_s);
  EXPECT_EQ(peaks.at("slack").at("force_N").at("value").get<double>(), 0);
  EXPECT_EQ(peaks.size(), 2u);
}

TEST_F(RunReportTest, SummaryAgreesWithTheFrames) {
  info_.plots = info_.maps = false;
  writeRun(scene_, trajectory_, info_);
  const auto json = summary();
  EXPECT_EQ(json.at("complete"), true);
  // No load varies: maximum load is the largest contact force, at the middle.
  const auto& instant = json.at("at_maximum_load");
  EXPECT_DOUBLE_EQ(instant.at("time_s").get<double>(), 0.5);
  const auto& middle = trajectory_.frames[10].contacts[0];
  EXPECT_EQ(instant.at("contact").at("total").at("scalar_force_N").get<double>(), middle.total.scalarForce_N);
  EXPECT_EQ(json.at("peaks").at("medial").at("peak_pressure_Pa").at("value").get<double>(),
            middle.compartments[0].peakPressure_Pa);
  EXPECT_DOUBLE_EQ(json.at("peaks").at("total").at("scalar_force_N").at("time_s").get<double>(), 0.5);
  for (const char* key : {"genu", "eigen", "compiler", "build_type"})
    EXPECT_TRUE(json.at("versions").contains(key)) << key;
  EXPECT_EQ(json.at("inputs_sha256").at("scene.yaml").get<std::string>().size(), 64u);
  EXPECT_FALSE(fs::exists(folder_ / "out/maps"));
}

TEST_F(RunReportTest, TablesReadBack) {
  info_.plots = info_.maps = false;
  writeRun(scene_, trajectory_, info_);
  const io::Table motion = io::readTable(folder_ / "out/motion.sto");
  EXPECT_TRUE(motion.inDegrees);
  EXPECT_EQ(motion.numRows(), 21);
  EXPECT_NEAR(motion.data[static_cast<size_t>(motion.findColumn("rx"))][20], 0.2 * 180 / contact::kPi, 1e-12);
  const io::Table loads = io::readTable(folder_ / "out/contact.sto");
  const auto column = [&](const char* name) { return loads.data[static_cast<size_t>(loads.findColumn(name))]; };
  const auto& load = trajectory_.frames[10].contacts[0].compartments[1];
  EXPECT_EQ(column("lateral.force_y_N")[10], load.forceOnM_F.y());
  EXPECT_EQ(column("lateral.area_m2")[10], load.area_m2);
  EXPECT_EQ(column("total.active_elements")[10], trajectory_.frames[10].contacts[0].total.activeElements);
}

TEST_F(RunReportTest, ErrorEstimatesAreColumnsAndSummary) {
  info_.plots = info_.maps = false;
  for (size_t i = 0; i < trajectory_.frames.size(); ++i) {
    contact::ContactErrorEstimate e;
    const double force = i == 7 ? 9.0 : 0.5;
    e.compartments.assign(2, {force, 0.01, 1e4, 2e3, 1e-7});
    e.total = {2 * force, 0.02, 1e4, 2e3, 2e-7};
    trajectory_.frames[i].errors = {e};
  }
  const RunOutput output = writeRun(scene_, trajectory_, info_);
  EXPECT_THAT(output.table, HasSubstr("estimated errors"));
  const io::Table loads = io::readTable(folder_ / "out/contact.sto");
  EXPECT_EQ(loads.data[static_cast<size_t>(loads.getColumn("medial.force_error_N", ""))][7], 9);
  EXPECT_EQ(loads.data[static_cast<size_t>(loads.getColumn("total.area_error_m2", ""))][3], 2e-7);
  const auto json = summary();
  EXPECT_EQ(json.at("at_maximum_load").at("contact").at("total").at("error_estimate").at("force_N"), 1);
  EXPECT_EQ(json.at("largest_error_estimates").at("total").at("force_N").at("value"), 18);
  EXPECT_EQ(json.at("largest_error_estimates").at("total").at("force_N").at("time_s").get<double>(), trajectory_.frames[7].time_s);
}

TEST_F(RunReportTest, StoredRunComesBackFromTheFolderAlone) {
  info_.plots = info_.maps = false;
  info_.leftKnee = true;
  writeRun(scene_, trajectory_, info_);
  fs::remove_all(folder_ / "in");  // the results must not need the original
  const StoredRun run = readStoredRun(folder_ / "out");
  EXPECT_TRUE(run.complete && run.leftKnee);
  ASSERT_EQ(run.q.size(), 21u);
  const auto q = run.calcCoordinates(scene_.coordinates());
  for (size_t i = 0; i < 21; ++i) {
    // Radians to degrees and back: two roundings.
    for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(q[i][k], trajectory_.frames[i].q[k], 1e-15);
  }
  EXPECT_EQ(scene::readScene(run.sceneFile).name, "ball");
}

TEST_F(RunReportTest, FilesAboveTheSceneAndInTheDataFolderAreCopied) {
  write(folder_ / "in/shared/a.csv", "time,y\n0,1\n");
  write(folder_ / "in/scenes/scene.yaml", testing::kBallScene);
  write(folder_ / "data/b.csv", "time,y\n0,1\n");
  scene_.file = folder_ / "in/scenes/scene.yaml";
  scene_.inputHashes = {{"scene.yaml", ""}, {"../shared/a.csv", ""}, {"data:b.csv", ""}, {"/absolute.csv", ""}};
  info_.dataFolder = folder_ / "data";
  info_.plots = info_.maps = false;
  writeRun(scene_, trajectory_, info_);
  const auto stored = summary().at("scene");
  EXPECT_EQ(stored.at("copy"), "scene/files/scenes/scene.yaml");
  EXPECT_TRUE(fs::exists(folder_ / "out/scene/files/shared/a.csv"));
  EXPECT_TRUE(fs::exists(folder_ / "out/scene/data/b.csv"));
  EXPECT_EQ(stored.at("not_copied"), nlohmann::json::array({"/absolute.csv"}));
}

TEST_F(RunReportTest, AnInterruptedRunIsMarked) {
  trajectory_.complete = false;
  trajectory_.statusText = "interrupted at t = 0.3 s";
  info_.plots = info_.maps = false;
  writeRun(scene_, trajectory_, info_);
  EXPECT_EQ(summary().at("complete"), false);
  EXPECT_EQ(summary().at("status"), "interrupted");
  EXPECT_EQ(summary().at("status_text"), "interrupted at t = 0.3 s");
  EXPECT_FALSE(readStoredRun(folder_ / "out").complete);
}

TEST_F(RunReportTest, WithoutAFrameNothingIsWritten) {
  trajectory_.frames.clear();
  EXPECT_THROW(writeRun(scene_, trajectory_, info_), ComputationError);
  EXPECT_EQ(folder_.count(), 1u);
}

TEST_F(RunReportTest, MissingGnuplotIsANoteNotAFailure) {
  const std::string path = getenv("PATH");
  setenv("PATH", (folder_ / "nothing").c_str(), 1);
  const RunOutput output = writeRun(scene_, trajectory_, info_);
  setenv("PATH", path.c_str(), 1);
  ASSERT_EQ(output.notes.size(), 1u);
  EXPECT_THAT(output.notes[0], HasSubstr("gnuplot is not installed"));
  EXPECT_THAT(summary().at("plots").at("problem").get<std::string>(), HasSubstr("gnuplot is not installed"));
  EXPECT_TRUE(fs::exists(folder_ / "out/plots/forces.gp"));
}

TEST_F(RunReportTest, MaximumLoadFollowsTheAppliedLoadWhereItVaries) {
  scene::LoadSpec load;
  load.force_N = {0.0, scene::TimeSeries{{0, 0.2, 1}, {-100, -2000, -100}, "table"}, 0.0};
  scene_.loads = {load};
  EXPECT_EQ(findMaximumLoad(scene_, trajectory_), 4u);
}

TEST_F(RunReportTest, ReferenceIsComparedAndMirrored) {
  scene_.model.emplace();
  scene_.model->coordinates = {scene::FreeCoordinate{},       scene::PrescribedCoordinate{},
                               scene::PrescribedCoordinate{}, scene::PrescribedCoordinate{},
                               scene::FreeCoordinate{},       scene::FreeCoordinate{}};
  // rx runs from 0 to 0.2 rad; the reference is its mirror image plus 1 deg.
  write(folder_ / "ref.csv",
        "percent_cycle,rx_deg,z_med_mm\n0,1,0.5\n100," + std::to_string(1 - 0.2 * 180 / contact::kPi) + ",0.5\n");
  info_.reference = readReferenceMotion(folder_ / "ref.csv", 1.0);
  info_.plots = info_.maps = false;
  writeRun(scene_, trajectory_, info_);
  const auto rx = summary().at("motion").at("rx").at("reference");
  EXPECT_NEAR(rx.at("rms_mirrored").get<double>(), 1, 1e-5);  // six decimals in the table
  EXPECT_NEAR(rx.at("rms_mirrored_means_aligned").get<double>(), 0, 1e-5);
  EXPECT_GT(rx.at("rms").get<double>(), 5);
  EXPECT_NEAR(summary().at("motion").at("z").at("reference").at("rms").get<double>(), 0.5, 1e-12);
}

TEST(ReferenceMotion, SaysWhatIsMissing) {
  const TemporaryFolder folder;
  write(folder / "a.csv", "t,rx_deg\n0,1\n1,2\n");
  write(folder / "b.csv", "time,flexion\n0,1\n1,2\n");
  const auto message = [&](const char* name) -> std::string {
    try {
      readReferenceMotion(folder / name, 1);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(message("a.csv"), HasSubstr("percent_cycle"));
  EXPECT_THAT(message("b.csv"), HasSubstr("rx_deg"));
}

TEST(StoredRunTest, AFolderWithoutResultsIsAnInputError) {
  const TemporaryFolder folder;
  EXPECT_THROW(readStoredRun(folder / "nothing"), InputError);
  EXPECT_THROW(readStoredRun(folder.path()), InputError);
  write(folder / "summary.json", "{");
  EXPECT_THROW(readStoredRun(folder.path()), InputError);
  write(folder / "summary.json", R"({"format": "genu-results", "format_version": 1})");
  EXPECT_THROW(readStoredRun(folder.path()), InputError);
  write(folder / "summary.json", R"({"format": 3, "format_version": "x"})");
  EXPECT_THROW(readStoredRun(folder.path()), InputError);
}

TEST(Gnuplot, ABrokenScriptIsReportedWithItsMessage) {
  const TemporaryFolder folder;
  if (!hasGnuplot(folder)) GTEST_SKIP() << "gnuplot is not installed";
  write(folder / "bad.gp", "plot nonsense(\n");
  const DrawResult result = runGnuplot(folder.path(), {"bad.gp"});
  EXPECT_THAT(result.problem, HasSubstr("bad.gp"));
  EXPECT_TRUE(result.drawn.empty());
  EXPECT_EQ(folder.count(), 1u) << "logs are removed";
}

}  // namespace
}  // namespace genu::report
