#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <pugixml.hpp>

#include "Program.h"
#include "genu/io/Table.h"

namespace genu::app::testing {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kPose = "0 deg, 0 deg, 0 deg, 0 mm, 35.8 mm, 0 mm";

class Contact : public ProgramTest {
 protected:
  Contact() { write("ball.yaml", kBall); }
};

TEST_F(Contact, JsonHasThePromisedKeysAndTheClosedForm) {
  const Outcome outcome = run({"contact", "ball.yaml", "--pose", kPose, "--json"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result.at("status"), "ok");
  EXPECT_TRUE(result.at("status_text").is_string());
  for (const auto& load : {result.at("compartments").at("all"), result.at("total")}) {
    for (const char* key : {"force_on_moving_N", "moment_on_moving_about_fixed_origin_Nm", "center_of_pressure_m"}) {
      EXPECT_EQ(load.at(key).size(), 3u) << key;
    }
    for (const char* key :
         {"scalar_force_N", "peak_pressure_Pa", "mean_pressure_Pa", "area_m2", "active_elements", "energy_J"}) {
      EXPECT_TRUE(load.at(key).is_number()) << key;
    }
  }
  // Fy = (pi K D^2 / h) (R - 2D/3) = 1338.989824 N; whole cells of a 50 x 50 grid are off by 1.5e-4.
  EXPECT_NEAR(result.at("total").at("force_on_moving_N").at(1).get<double>() / 1338.989824, 1, 3e-4);
}

TEST_F(Contact, WithoutContactEverythingIsExactlyZero) {
  const Outcome outcome = run({"contact", "ball.yaml", "--pose", "0 deg, 0 deg, 0 deg, 0 mm, 40 mm, 0 mm", "--json"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  const json total = json::parse(outcome.out).at("total");
  for (const auto& item : total.items()) {
    for (const auto& value : item.value().is_array() ? item.value() : json::array({item.value()})) {
      EXPECT_EQ(value.get<double>(), 0.0) << item.key();
    }
  }
}

TEST_F(Contact, FullPenetrationHasNoNumbersAndExitCode3) {
  const Outcome outcome =
      run({"contact", "ball.yaml", "--pose", "0 deg, 0 deg, 0 deg, 0 mm, 28 mm, 0 mm", "--json", "--field", "f.vtp"});
  EXPECT_EQ(outcome.exitCode, 3);
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result.size(), 2u);
  EXPECT_EQ(result.at("status"), "full_penetration");
  EXPECT_THAT(outcome.err, HasSubstr("full penetration"));
  EXPECT_THAT(listFolder(), ElementsAre("ball.yaml"));
}

TEST_F(Contact, ExtrapolationIsAWarningWithNumbers) {
  // 5.85 mm into 6 mm: beyond 95 %, not through. The grid is the middle, where the depth hardly changes.
  write("ball.yaml", replaced(kBall, "-5 mm, 5 mm, -5 mm, 5 mm", "-0.5 mm, 0.5 mm, -0.5 mm, 0.5 mm"));
  const Outcome outcome =
      run({"contact", "ball.yaml", "--pose", "0 deg, 0 deg, 0 deg, 0 mm, 30.15 mm, 0 mm", "--json"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out).at("status"), "extrapolated");
  EXPECT_GT(json::parse(outcome.out).at("total").at("peak_pressure_Pa").get<double>(), 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning"));
}

TEST_F(Contact, FieldFilesHoldEveryElement) {
  ASSERT_EQ(run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x7", "--field", "f.vtp", "-q"}).exitCode, 0);
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file((folder_ / "f.vtp").c_str()));
  EXPECT_EQ(document.child("VTKFile").child("PolyData").child("Piece").attribute("NumberOfPolys").as_int(), 84);
  ASSERT_EQ(run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x7", "--field", "f.csv", "-q"}).exitCode, 0);
  std::ifstream in(folder_ / "f.csv");
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), 85);
  EXPECT_THAT(listFolder(), ElementsAre("ball.yaml", "f.csv", "f.vtp"));
}

TEST_F(Contact, TableHasUnits) {
  // A first angle below zero must not be taken for an option.
  const Outcome outcome = run({"contact", "ball.yaml", "--pose", "-5 deg, 0 deg, 0 deg, 0 mm, 35.8 mm, 0 mm"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  for (const char* part : {"status: ok", "MPa", "mm^2", "N m", "all"}) EXPECT_THAT(outcome.out, HasSubstr(part));
}

TEST_F(Contact, ErrorIsEstimatedOnRequestAndAdaptiveGridsMeetIt) {
  const Outcome plain = run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x12", "--json"});
  EXPECT_FALSE(json::parse(plain.out).at("total").contains("error_estimate"));
  const Outcome estimated = run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x12", "--json", "--error"});
  ASSERT_EQ(estimated.exitCode, 0) << estimated.err;
  const json total = json::parse(estimated.out).at("total");
  const double exact = 1338.989824;  // closed form of this scene, docs/theory.md
  const double force = total.at("force_on_moving_N").at(1), error = total.at("error_estimate").at("force_N");
  EXPECT_LE(std::abs(force - exact), error);
  const Outcome adaptive = run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x12", "--json", "--adaptive", "1e-6", "--field", "f.csv"});
  ASSERT_EQ(adaptive.exitCode, 0) << adaptive.err;
  const json better = json::parse(adaptive.out);
  EXPECT_LE(better.at("total").at("error_estimate").at("force_N").get<double>(), 1e-6 * exact);
  EXPECT_NEAR(better.at("total").at("force_on_moving_N").at(1).get<double>() / exact, 1, 1e-6);
  std::ifstream in(folder_ / "f.csv");
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(in), {}, '\n'), better.at("grid").at("all").at("elements").get<int>() + 1);
  EXPECT_GT(better.at("grid").at("all").at("elements").get<int>(), 144);
  EXPECT_THAT(run({"contact", "ball.yaml", "--pose", kPose, "--grid", "12x12", "--adaptive", "1e-6"}).out, HasSubstr("by level"));
  const Outcome wrong = run({"contact", "ball.yaml", "--pose", kPose, "--adaptive", "3"});
  EXPECT_EQ(wrong.exitCode, 2);
  EXPECT_THAT(wrong.err, HasSubstr("allowed: 1e-12 to 1"));
}

TEST_F(Contact, SeveralPairsAreToldApart) {
  write("two.yaml", std::string(kBall) + R"(  second:
    fixed: {surface: layer, thickness: 6 mm}
    moving: {surface: ball}
    material: polyethylene
    compartments: {all: {rectangle: "-5 mm, 5 mm, -5 mm, 5 mm", grid: 50x50}}
)");
  const Outcome outcome = run({"contact", "two.yaml", "--pose", kPose, "--json", "--field", "f.csv"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  const json result = json::parse(outcome.out);
  const double one = result.at("compartments").at("knee.all").at("scalar_force_N");
  EXPECT_DOUBLE_EQ(result.at("compartments").at("second.all").at("scalar_force_N").get<double>(), one);
  EXPECT_DOUBLE_EQ(result.at("total").at("scalar_force_N").get<double>(), 2 * one);
  EXPECT_THAT(listFolder(), ElementsAre("ball.yaml", "f_knee.csv", "f_second.csv", "two.yaml"));
}

class Runs : public ProgramTest {
 protected:
  Runs() {
    write("knee.yaml", kKnee);
    write("knee.urdf", kUrdf);
    write("gait.csv", kTable);
  }
  json summary(const std::string& folder) const {
    std::ifstream in(folder_ / folder / "summary.json");
    return json::parse(in);
  }
};

TEST_F(Runs, GaitThenReplayOnAnotherGrid) {
  const Outcome gait = run({"gait", "knee.yaml", "--output", "out", "--no-plots"});
  ASSERT_EQ(gait.exitCode, 0) << gait.err;
  EXPECT_THAT(gait.out, HasSubstr("At maximum load, t = 0.1 s"));
  EXPECT_THAT(gait.out, HasSubstr("Results: out"));
  const json s = summary("out");
  EXPECT_EQ(s.at("complete"), true);
  EXPECT_GT(s.at("steps").at("steps_taken").get<int>(), 0);
  EXPECT_TRUE(s.at("versions").contains("simbody"));
  EXPECT_EQ(s.at("inputs_sha256").size(), 3u);
  EXPECT_EQ(io::readTable(folder_ / "out/motion.sto").numRows(), 21);

  // The replay needs the results folder alone.
  for (const char* file : {"knee.yaml", "knee.urdf", "gait.csv"}) fs::remove(folder_ / file);
  const Outcome replay = run({"replay", "out", "--grid", "20x20", "--output", "same", "--no-plots", "--no-maps"});
  ASSERT_EQ(replay.exitCode, 0) << replay.err;
  const auto force = [&](const char* folder) {
    return summary(folder).at("at_maximum_load").at("contact").at("total").at("scalar_force_N").get<double>();
  };
  // The same grid gives the same contact; the pose went through degrees and back (1e-16 rad, 1e-17 m over 0.1 mm
  // depth).
  EXPECT_NEAR(force("same") / force("out"), 1, 1e-9);
  ASSERT_EQ(run({"replay", "out/", "--grid", "40x40", "--no-plots", "--no-maps"}).exitCode, 0);
  EXPECT_EQ(summary("out-replay-40x40").at("grid").at("medial").at("nx"), 40);
  EXPECT_GT(summary("same").at("at_maximum_load").at("contact").at("total").at("error_estimate").at("force_N").get<double>(), 0);
  // About 48 active elements per compartment: whole cells are off by a few per cent.
  EXPECT_NEAR(force("out-replay-40x40") / force("out"), 1, 0.05);
  EXPECT_THAT(listFolder(), ElementsAre("out", "out-replay-40x40", "same"));
}

TEST_F(Runs, StaticBalancesTheLoad) {
  const Outcome outcome = run({"static", "knee.yaml", "--output", "out"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  const json s = summary("out");
  const auto& total = s.at("at_static_pose").at("contact").at("total");
  // 300 N at t = 0; the residual allowed is 1e-6 N.
  EXPECT_NEAR(total.at("force_on_moving_N").at(1).get<double>(), 300, 1e-5);
  EXPECT_LT(s.at("details").at("static").at("residual_N").get<double>(), 1e-6);
  EXPECT_TRUE(fs::exists(folder_ / "out/maps/knee_0000.vtp"));
}

TEST_F(Runs, InterruptedRunLeavesWhatItHasMarkedIncomplete) {
  // Tight accuracy makes it last; a per cent figure means integration has begun.
  write("slow.yaml", replaced(replaced(kKnee, "duration: 0.2 s, output_interval: 10 ms",
                                       "duration: 0.2 s, output_interval: 0.1 ms, accuracy: 1e-12"),
                              "grid: 20x20", "grid: 60x60"));
  const Outcome outcome =
      run({"gait", "slow.yaml", "--output", "out", "--progress", "--no-plots", "--no-maps"}, " %, ");
  ASSERT_EQ(outcome.exitCode, 130) << outcome.err << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("INCOMPLETE"));
  EXPECT_THAT(outcome.err, HasSubstr(" left"));
  const json s = summary("out");
  EXPECT_EQ(s.at("complete"), false);
  EXPECT_EQ(s.at("status"), "interrupted");
  const int rows = io::readTable(folder_ / "out/motion.sto").numRows();
  EXPECT_GT(rows, 0);
  EXPECT_LT(rows, 2001);
  EXPECT_THAT(listFolder(), ElementsAre("gait.csv", "knee.urdf", "knee.yaml", "out", "slow.yaml"));
  EXPECT_EQ(run({"replay", "out", "--output", "again", "--no-plots", "--no-maps"}).exitCode, 0);
}

TEST_F(Runs, CheckRunsNothing) {
  const Outcome outcome = run({"check", "knee.yaml"});
  EXPECT_EQ(outcome.exitCode, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("no errors"));
  EXPECT_THAT(outcome.out, HasSubstr("gait"));
  EXPECT_THAT(listFolder(), ElementsAre("gait.csv", "knee.urdf", "knee.yaml"));
}

TEST_F(Runs, ExplainNamesWhatIsThereAndWhatIsNot) {
  const Outcome outcome = run({"explain", "knee.yaml"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  for (const char* part :
       {"femur", "rx free", "rz prescribed", "gait.csv", "medial: 20 x 20", "height above the plane",
        "linear, E = 463 MPa", "Left out", "root finding", "thickness map", "gravity: zero", "series"}) {
    EXPECT_THAT(outcome.out, HasSubstr(part));
  }
  EXPECT_THAT(outcome.out, ::testing::Not(HasSubstr("damping of the coordinates: none")));
}

TEST_F(Runs, ReplayDoesNotOverwriteWhatItReplays) {
  ASSERT_EQ(run({"gait", "knee.yaml", "--output", "out", "--no-plots", "--no-maps"}).exitCode, 0);
  const Outcome outcome = run({"replay", "out", "--output", "./out/"});
  EXPECT_EQ(outcome.exitCode, 2);
  EXPECT_THAT(outcome.err, HasSubstr("choose another folder"));
}

class CommandLine : public ProgramTest {};

TEST_F(CommandLine, VersionAndHelpAreOnStdoutWithExitCode0) {
  EXPECT_THAT(run({"--version"}).out, HasSubstr("genu "));
  const Outcome help = run({"--help"});
  EXPECT_EQ(help.exitCode, 0);
  EXPECT_THAT(help.out, HasSubstr("130"));
  for (const char* command : {"static", "gait", "replay", "contact", "fit", "check", "explain"}) {
    const Outcome outcome = run({command, "--help"});
    EXPECT_EQ(outcome.exitCode, 0) << command;
    EXPECT_THAT(outcome.out, HasSubstr("xample")) << command;
    EXPECT_THAT(help.out, HasSubstr(command));
  }
}

TEST_F(CommandLine, MistakesAreBadInput) {
  EXPECT_EQ(run({}).exitCode, 2);
  EXPECT_EQ(run({"contact"}).exitCode, 2);
  EXPECT_EQ(run({"gait", "a.yaml", "--frobnicate"}).exitCode, 2);
  const Outcome typo = run({"gatt"});
  EXPECT_EQ(typo.exitCode, 2);
  EXPECT_THAT(typo.err, HasSubstr("did you mean \"gait\""));
  write("ball.yaml", kBall);
  const auto contact = [&](std::vector<std::string> rest) {
    rest.insert(rest.begin(), {"contact", "ball.yaml"});
    return run(rest);
  };
  EXPECT_THAT(contact({"--pose", "1, 2, 3, 4, 5, 6"}).err, HasSubstr("has no unit"));
  EXPECT_EQ(contact({"--pose", kPose, "--grid", "0x5"}).exitCode, 2);
  EXPECT_THAT(contact({"--pose", kPose, "--field", "f.txt"}).err, HasSubstr(".vtp, .csv"));
  EXPECT_THAT(contact({"--pose", kPose, "--field", "no/f.csv"}).err, HasSubstr("no folder \"no\""));
  EXPECT_THAT(contact({"--pose", kPose, "--data", "nowhere"}).err, HasSubstr("nowhere"));
  EXPECT_THAT(run({"replay", "nothing"}).err, HasSubstr("no such results folder"));
  EXPECT_THAT(listFolder(), ElementsAre("ball.yaml"));
}

}  // namespace
}  // namespace genu::app::testing
