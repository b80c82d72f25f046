#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <tuple>

#include "Program.h"
#include "genu/io/Files.h"
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

TEST_F(Runs, GaitWithAnErrorEstimate) {
  const Outcome gait = run({"gait", "knee.yaml", "--output", "out", "--no-plots", "--no-maps", "--error-estimate"});
  ASSERT_EQ(gait.exitCode, 0) << gait.err;
  EXPECT_THAT(gait.out, HasSubstr("Estimated errors of the integration, from a second run, accuracy: 1e-05 ("));
  EXPECT_THAT(gait.out, HasSubstr("medial, peak pressure"));
  const json estimate = summary("out").at("details").at("error_estimate");
  EXPECT_EQ(estimate.at("complete"), true);
  EXPECT_GT(estimate.at("second_run_cpu_time_s").get<double>(), 0);
  EXPECT_GT(estimate.at("compartments").at("medial").at("force").at("N").get<double>(), 0);
  EXPECT_GT(estimate.at("coordinates").at("y").at("m").get<double>(), 0);
  EXPECT_FALSE(estimate.at("coordinates").contains("rz")) << "prescribed";
  EXPECT_GE(estimate.at("pose_m").get<double>(), estimate.at("coordinates").at("y").at("m").get<double>());
  ASSERT_EQ(run({"gait", "knee.yaml", "--output", "plain", "--no-plots", "--no-maps"}).exitCode, 0);
  EXPECT_FALSE(summary("plain").at("details").contains("error_estimate"));
}

// Let fall from 5 mm: an impact that the accuracy is too loose for. What is said is in the summary too.
TEST_F(Runs, WarningsOfARunAreKept) {
  std::string drop = replaced(kKnee, "    y: free\n", "    y: {free: {start: 43 mm}}\n");
  drop = replaced(drop, "{duration: 0.2 s, output_interval: 10 ms}", "{duration: 0.05 s, output_interval: 1 ms, settle_first: false}");
  write("drop.yaml", drop);
  const Outcome gait = run({"gait", "drop.yaml", "--output", "out", "--no-plots", "--no-maps"});
  ASSERT_EQ(gait.exitCode, 0) << gait.err;
  EXPECT_THAT(gait.err, HasSubstr("contact begins with"));
  EXPECT_THAT(summary("out").at("warnings").dump(), HasSubstr("contact begins with"));
  EXPECT_GT(summary("out").at("details").at("error_prediction").at("pose_m").get<double>(), 0);
}

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

TEST_F(Runs, VerifyRecommendsASettingAndRunsItAgain) {
  write("knee.yaml", replaced(kKnee, "  gait: {duration: 0.2 s, output_interval: 10 ms}\n", "  static: {method: newton}\n"));
  write("knee.urdf", kUrdf);
  write("gait.csv", kTable);
  const Outcome bad = run({"verify", "knee.yaml", "--pose-error", "1"});
  EXPECT_EQ(bad.exitCode, 2);
  EXPECT_THAT(bad.err, HasSubstr("--pose-error: \"1\" has no unit"));
  const Outcome outcome = run({"verify", "knee.yaml", "--output", "out", "--pose-error", "0.1 mm", "--no-plots"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Cheapest within 0.1 mm and 5 N: grid x"));
  const json s = summary("out");
  EXPECT_EQ(s.at("rows").size(), 9u);
  EXPECT_LE(s.at("recommended").at("pose_error_mm").get<double>(), 0.1);
  EXPECT_LE(s.at("recommended").at("force_error_N").get<double>(), 5);
  const std::string csv = io::readFile(folder_ / "out/verification.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 10);
  for (const std::string file : s.at("files")) EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / file)) << file;
}

// Pressed 5.85 mm into 6 mm at half time only: the warning names that time, although the run ends without contact. So does the one that the rectangle holds only the
// middle of the contact.
TEST_F(Runs, ExtrapolationIsAWarningAtAnyTime) {
  write("y.csv", "time,y\n0,35.9\n0.05,32\n0.1,30.15\n0.15,32\n0.2,36.1\n");
  write("ball.yaml", replaced(kBall, "-5 mm, 5 mm, -5 mm, 5 mm", "-0.5 mm, 0.5 mm, -0.5 mm, 0.5 mm") +
                         "model:\n  urdf: knee.urdf\n  joint: knee\n  coordinates: {rx: {prescribed: 0 deg}, ry: {prescribed: 0 deg}, rz: {prescribed: 0 deg}, "
                         "x: {prescribed: 0 mm}, y: {prescribed: {table: y.csv, column: y, unit: mm}}, z: {prescribed: 0 mm}}\n"
                         "analysis: {gait: {duration: 0.2 s, output_interval: 10 ms}}\n");
  const Outcome outcome = run({"gait", "ball.yaml", "--output", "out", "--no-plots", "--no-maps"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("at t = 0.1 s: 2500 elements"));
  EXPECT_THAT(outcome.err, HasSubstr("95 %"));
  EXPECT_THAT(outcome.err, HasSubstr("rectangle: at t = 0.1 s contact goes on beyond the rectangle"));
}

TEST_F(Runs, VerifyFindsWhereASceneStopsBeingRight) {
  write("knee.yaml", replaced(kKnee, "  gait: {duration: 0.2 s, output_interval: 10 ms}\n", "  static: {method: newton}\n"));
  write("knee.urdf", kUrdf);
  write("gait.csv", kTable);
  EXPECT_EQ(run({"verify", "--grid", "5x5"}).exitCode, 2);
  EXPECT_THAT(run({"verify", "--grid", "5x5"}).err, HasSubstr("--grid: the built-in scenes"));
  const Outcome bad = run({"verify", "knee.yaml", "--stability", "--force-error", "1 N"});
  EXPECT_EQ(bad.exitCode, 2);
  EXPECT_THAT(bad.err, HasSubstr("--force-error: with --stability"));
  EXPECT_THAT(run({"verify", "--stability", "--grid", "5x5"}).err, HasSubstr("--grid: the built-in scenes"));
  const Outcome outcome = run({"verify", "knee.yaml", "--stability", "--output", "out", "--no-plots"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  const json s = summary("out");
  EXPECT_EQ(s.at("analysis"), "verify --stability");
  ASSERT_EQ(s.at("rows").size(), 3u);
  int cells = 0, refused = 0;
  for (const auto& row : s.at("rows")) {
    for (const auto& cell : row.at("cells")) {
      ++cells;
      if (cell.at("outcome") != "refused") continue;
      ++refused;
      EXPECT_THAT(cell.at("message").get<std::string>(), HasSubstr("0.5"));
    }
  }
  EXPECT_EQ(refused, 1);  // Poisson's ratio of a half
  const std::string csv = io::readFile(folder_ / "out/stability.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), cells + 1);
  EXPECT_THAT(io::readFile(folder_ / "out/stability.md"), HasSubstr("| Axis | Scene |"));
  for (const std::string file : s.at("files")) EXPECT_TRUE(fs::is_regular_file(folder_ / "out" / file)) << file;
}

TEST_F(Runs, VerifyBringsScenesAlong) {
  const Outcome outcome = run({"verify", "--output", "out", "--no-plots"});
  ASSERT_EQ(outcome.exitCode, 0) << outcome.err;
  for (const std::string name : {"knee-walking", "knee-walking-large-strain", "knee-walking-power-law", "knee-static"}) {
    const json s = summary("out/" + name);
    EXPECT_TRUE(s.at("complete").get<bool>()) << name;
    EXPECT_EQ(s.at("scene"), name);
    EXPECT_TRUE(s.contains("recommended")) << name;
    // The row of the other law is compared with a reference of that law: the same integrator and grid err by as much.
    const auto row = std::find_if(s.at("rows").begin(), s.at("rows").end(), [](const json& r) { return r.at("group") == "law"; });
    ASSERT_NE(row, s.at("rows").end()) << name;
    EXPECT_LT(row->at("force_error_N").get<double>(), 3 * s.at("rows").at(0).at("force_error_N").get<double>() + 1) << name;
  }
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

// Combinations that only the start of a run could refuse: the same function is asked, so the message is the same, with place, value and what is allowed.
TEST_F(Runs, CheckRefusesWhatTheRunRefuses) {
  const std::string gait = "  gait: {duration: 0.2 s, output_interval: 10 ms}\n";
  const auto withGait = [&](const std::string& more) { return replaced(kKnee, gait, "  gait: {duration: 0.2 s, output_interval: 10 ms, " + more + "}\n"); };
  for (const auto& [scene, command, parts] : std::vector<std::tuple<std::string, std::string, std::vector<std::string>>>{
           {withGait("integrator: generalized-alpha, prescribed: constraints"), "gait", {"wrong.yaml:34: analysis.gait.prescribed", "allowed: auto, eliminated"}},
           {withGait("integrator: semi-explicit-euler, prescribed: eliminated"), "gait", {"wrong.yaml:34: analysis.gait.prescribed", "allowed: auto, constraints"}},
           {withGait("integrator: generalized-alpha, max_order: 3"), "gait", {"wrong.yaml:34: analysis.gait.max_order", "max_order 3; allowed: none"}},
           {withGait("integrator: cpodes, max_order: 6"), "gait", {"wrong.yaml:34: analysis.gait.max_order", "allowed: 1 to 5"}},
           {withGait("integrator: cpodes, step: 1 ms"), "gait", {"wrong.yaml:34: analysis.gait.step: is 0.001 s", "generalized-alpha"}},
           {withGait("integrator: rk4"), "gait", {"wrong.yaml:34: analysis.gait.integrator", "\"rk4\"", "known: cpodes"}},
           {withGait("integrator: runge-kutta-merson, tolerances: {angle: 0.01 deg}"), "gait", {"wrong.yaml:34: analysis.gait.tolerances.angle", "would be ignored"}},
           {replaced(kKnee, gait, "  static: {search: {angle: 200 deg}}\n"), "static", {"wrong.yaml:34: analysis.static.search.angle", "at most 180 deg"}},
           {replaced(replaced(replaced(kKnee, gait, "  static: {search: {starts: 3}}\n"), "    y: free\n", "    y: {prescribed: 37.9 mm}\n"),
                     "    z: {free: {damping: 50 N s/m}}\n", "    z: {prescribed: 0 mm}\n    rx: {prescribed: 0 deg}\n"),
            "static", {"wrong.yaml:35: analysis.static.search", "no coordinate is free"}}}) {
    write("wrong.yaml", scene);
    const Outcome check = run({"check", "wrong.yaml"}), ran = run({command, "wrong.yaml", "--output", "out"});
    EXPECT_EQ(check.exitCode, 2) << check.out << check.err;
    EXPECT_EQ(ran.exitCode, 2) << ran.err;
    EXPECT_THAT(ran.err, ::testing::EndsWith(check.err));  // it may have warned before
    for (const std::string& part : parts) EXPECT_THAT(check.err, HasSubstr(part));
    const Outcome explained = run({"explain", "wrong.yaml"});
    if (command == "gait") {
      EXPECT_EQ(explained.err, check.err);
    }
  }
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

TEST_F(Runs, ExplainTellsHowContactIsEvaluated) {
  write("damped.yaml", replaced(kKnee, "    material: polyethylene\n", "    material: polyethylene\n    damping: 0.5 s/m\n"));
  write("energy.yaml", replaced(kKnee, "    material: polyethylene\n", "    material: polyethylene\n    correction: energy\n"));
  const Outcome plain = run({"explain", "knee.yaml"}), damped = run({"explain", "damped.yaml"}), energy = run({"explain", "energy.yaml"});
  for (const char* part : {"rule: smooth", "distance: minimum", "correction: midsurface", "instruction set in use: ", "threads: 1", "error estimate: ",
                           "table of the pressure law: ", "damping of the contact: none", "gradient of the energy: "}) {
    EXPECT_THAT(plain.out, HasSubstr(part));
  }
  EXPECT_THAT(damped.out, HasSubstr("damping: 0.5 s/m"));
  EXPECT_THAT(damped.out, ::testing::Not(HasSubstr("damping of the contact: none")));
  EXPECT_THAT(energy.out, HasSubstr("correction: energy"));
  EXPECT_THAT(energy.out, ::testing::Not(HasSubstr("gradient of the energy: no")));
}

// The same for solvers and integrators.
TEST_F(Runs, ExplainNamesMethodsLeftOut) {
  const std::string gait = "  gait: {duration: 0.2 s, output_interval: 10 ms}\n";
  const auto leftOut = [&](const std::string& analyses) {
    write("methods.yaml", replaced(kKnee, gait, analyses));
    const Outcome outcome = run({"explain", "methods.yaml"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.err;
    return outcome.out.substr(std::min(outcome.out.find("Left out"), outcome.out.size()));
  };
  const auto withGait = [&](const std::string& more) { return leftOut("  gait: {duration: 0.2 s, " + more + "}\n"); };
  using ::testing::Not;
  const std::string standard = leftOut(gait);
  for (const char* part : {"SUNDIALS", "KINSOL", "search for further equilibria: ", "series of equilibria: ", "projection onto constraints: ",
                           "multipliers of constraints while integrating: ", "implicit Euler in statics: ", "comparison of two static methods: ",
                           "stops of the coordinates: ", "round element surfaces: ", "surface files: ", "estimates of the grid's error: "}) {
    EXPECT_THAT(standard, HasSubstr(part));
  }
  for (const char* part : {"static analysis before the gait", "error estimate of a step", "elimination of prescribed", "Jacobian, Newton", "time integration"}) {
    EXPECT_THAT(standard, Not(HasSubstr(part)));
  }
  const std::string constrained = withGait("integrator: cpodes, prescribed: constraints");
  EXPECT_THAT(constrained, HasSubstr("elimination of prescribed coordinates: "));
  EXPECT_THAT(constrained, Not(HasSubstr("projection onto constraints: ")));
  EXPECT_THAT(constrained, Not(HasSubstr("multipliers of constraints")));
  EXPECT_THAT(constrained, HasSubstr("cpodes takes differences"));
  EXPECT_THAT(withGait("integrator: generalized-alpha, settle_first: false"),
              ::testing::AllOf(HasSubstr("static analysis before the gait: "), HasSubstr("error estimate of a step, step control: the step is fixed")));
  EXPECT_THAT(withGait("integrator: runge-kutta-merson"), HasSubstr("Jacobian, Newton's method in steps: runge-kutta-merson has neither"));
  EXPECT_THAT(leftOut("  static: {method: both, search: {starts: 5}}\n  series: {duration: 0.2 s}\n"),
              ::testing::AllOf(HasSubstr("time integration, integrators, step control: "), Not(HasSubstr("search for further")), Not(HasSubstr("series of")),
                               Not(HasSubstr("comparison of two")), Not(HasSubstr("implicit Euler in statics"))));
  if (standard.find("this build has none") != std::string::npos) return;
  EXPECT_THAT(standard, HasSubstr("the rest of SUNDIALS' integrators: loaded, not called; only SUNDIALS CVODE is"));
  EXPECT_THAT(constrained, HasSubstr("SUNDIALS' integrators: loaded, none called; the integrator cpodes is Simbody CPODES's"));
  EXPECT_THAT(leftOut("  static: {method: kinsol}\n"), Not(HasSubstr("KINSOL: ")));
}

// Every optional part is named while it is out, and no longer when it is in.
TEST_F(Runs, ExplainNamesEveryPartLeftOut) {
  const auto leftOut = [&](const std::string& scene) {
    write("part.yaml", scene);
    const Outcome outcome = run({"explain", "part.yaml"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.err;
    return outcome.out.substr(std::min(outcome.out.find("Left out"), outcome.out.size()));
  };
  const std::string material = "    material: polyethylene\n";
  const auto withContact = [&](const std::string& lines) { return replaced(kKnee, material, material + lines); };
  const std::string minimal = leftOut(kKnee);
  for (const char* part :
       {"back surfaces: ", "thickness of the moving body: it is rigid", "power law: ", "root finding for the pressure: ", "logarithmic strain: ",
        "contact stiffness: ", "damping of the contact: ", "contact energy and fields of single elements: ", "gradient of the energy: ",
        "threads: ", "ligaments: none given", "springs: none given", "muscles: none given", "wrapping: ", "further contacts (a patella's"}) {
    EXPECT_THAT(minimal, HasSubstr(part));
  }
  EXPECT_THAT(minimal, ::testing::Not(HasSubstr("thickness of the fixed body")));
  EXPECT_THAT(leftOut(withContact("    strain: large\n")), ::testing::Not(HasSubstr("logarithmic strain: ")));
  EXPECT_THAT(leftOut(withContact("    damping: 0.5 s/m\n")), ::testing::Not(HasSubstr("damping of the contact: ")));
  EXPECT_THAT(leftOut(withContact("    correction: energy\n")), ::testing::Not(HasSubstr("gradient of the energy: ")));
  const std::string centre = leftOut(withContact("    rule: centre\n"));
  EXPECT_THAT(centre, HasSubstr("contact stiffness: the rule counts whole cells"));
  const std::string ligament = leftOut(
      std::string(kKnee) +
      "ligaments: {a: {stiffness: 2000 N, slack: {length: 50 mm}, path: [{body: tibia, at: \"0 mm, 0 mm, 0 mm\"}, {body: femur, at: \"0 mm, 10 mm, 0 mm\"}]}}\n");
  EXPECT_THAT(ligament, ::testing::Not(HasSubstr("ligaments: none given")));
  EXPECT_THAT(ligament, HasSubstr("muscles: none given"));
}

TEST_F(Runs, DampingActsInGaitAndNotInStatic) {
  write("damped.yaml", replaced(kKnee, "    material: polyethylene\n", "    material: polyethylene\n    damping: 20 s/m\n"));
  const auto finalForce = [&](const char* command, const char* scene, const char* folder) {
    const Outcome outcome = run({command, scene, "--output", folder, "--no-plots", "--no-maps"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.err;
    const io::Table table = io::readTable(folder_ / folder / "motion.sto");
    const int column = table.findColumn("y_m") >= 0 ? table.findColumn("y_m") : table.findColumn("y");
    return table.data.at(static_cast<size_t>(column));
  };
  EXPECT_EQ(finalForce("static", "knee.yaml", "s0"), finalForce("static", "damped.yaml", "s1"));
  const auto plain = finalForce("gait", "knee.yaml", "g0"), damped = finalForce("gait", "damped.yaml", "g1");
  ASSERT_EQ(plain.size(), damped.size());
  EXPECT_NE(plain, damped);
  // The motion follows the load so slowly, 0.1 mm in 0.05 s, that the factor 1 + c v = 1.04 moves y by 2 % of 0.2 mm.
  for (size_t i = 0; i < plain.size(); ++i) EXPECT_NEAR(plain[i], damped[i], 4e-6) << i;
}

TEST_F(Runs, ThreadsChangeNoNumber) {
  write("fine.yaml", replaced(replaced(kKnee, "grid: 20x20", "grid: 80x80"), "grid: 20x20", "grid: 80x80"));
  const auto readAll = [&](const std::string& file) {
    std::ifstream in(folder_ / file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const Outcome one = run({"gait", "fine.yaml", "--output", "one", "--no-plots", "--no-maps"});
  ASSERT_EQ(one.exitCode, 0) << one.err;
  const Outcome two = run({"gait", "fine.yaml", "--output", "two", "--no-plots", "--no-maps", "--threads", "2"});
#ifdef GENU_WITH_CONTACT_THREADS
  ASSERT_EQ(two.exitCode, 0) << two.err;
  EXPECT_GT(readAll("one/contact.sto").size(), 1000u);
  EXPECT_EQ(readAll("one/contact.sto"), readAll("two/contact.sto"));
  EXPECT_EQ(readAll("one/motion.sto"), readAll("two/motion.sto"));
  ASSERT_EQ(run({"replay", "one", "--output", "r1", "--no-plots", "--no-maps"}).exitCode, 0);
  ASSERT_EQ(run({"replay", "one", "--output", "r0", "--no-plots", "--no-maps", "--threads", "0"}).exitCode, 0);
  EXPECT_EQ(readAll("r1/contact.sto"), readAll("r0/contact.sto"));
#else
  EXPECT_EQ(two.exitCode, 2);
  EXPECT_THAT(two.err, HasSubstr("GENU_WITH_CONTACT_THREADS"));
#endif
  const Outcome bad = run({"gait", "fine.yaml", "--output", "bad", "--threads", "-1"});
  EXPECT_EQ(bad.exitCode, 2);
  EXPECT_THAT(bad.err, HasSubstr("--threads -1: allowed: 1 to 1024"));
  EXPECT_FALSE(fs::exists(folder_ / "bad"));
}

/** A ring lies in a trough and touches it on two opposite sides; it is tilted at first so that only one of them touches. */
constexpr const char* kRing = R"(genu: 1
surfaces:
  trough: {dish: {y0: 6 mm, Rs: 40 mm, Rf: .inf}, extent: 20 mm}
  ring: {torus: {Rs: 10 mm, Rf: 3 mm}, pose: "90 deg, 0 deg, 0 deg, 0 mm, 0 mm, 0 mm"}
materials:
  polyethylene: {E: 463 MPa, nu: 0.46}
contact:
  knee:
    fixed: {surface: trough, thickness: 6 mm}
    moving: {surface: ring}
    material: polyethylene
    tracking: breadth-first-unguarded
    compartments: {all: {rectangle: "-12 mm, 12 mm, -12 mm, 12 mm", grid: 60x60}}
model:
  urdf: knee.urdf
  joint: knee
  coordinates:
    rx: {prescribed: 0 deg}
    ry: {prescribed: 0 deg}
    rz: {prescribed: {table: tilt.csv, column: rz, unit: deg}}
    x: {prescribed: 0 mm}
    y: {prescribed: 9.57 mm}
    z: {prescribed: 0 mm}
analysis:
  gait: {duration: 0.2 s, output_interval: 10 ms}
)";

TEST_F(Runs, TheUnguardedSearchWarnsAndMissesContact) {
  write("tilt.csv", "time,rz\n0,2\n0.1,1\n0.2,0\n");
  write("search.yaml", kRing);
  write("exact.yaml", replaced(kRing, "breadth-first-unguarded", "lipschitz"));
  const auto countWarnings = [](const std::string& text) {
    size_t count = 0;
    for (size_t at = text.find("can miss a new"); at != std::string::npos; at = text.find("can miss a new", at + 1)) ++count;
    return count;
  };
  const Outcome search = run({"gait", "search.yaml", "--output", "search", "--no-plots", "--no-maps"});
  ASSERT_EQ(search.exitCode, 0) << search.err;
  const Outcome exact = run({"gait", "exact.yaml", "--output", "exact", "--no-plots", "--no-maps"});
  ASSERT_EQ(exact.exitCode, 0) << exact.err;
  EXPECT_EQ(countWarnings(search.err), 1u) << search.err;
  EXPECT_EQ(countWarnings(exact.err), 0u);
  EXPECT_THAT(search.err, HasSubstr("the load may be wrong by all of it; lipschitz is exact and faster"));
  ASSERT_EQ(summary("search").at("warnings").size(), 1u);
  EXPECT_THAT(summary("search").at("warnings").at(0).get<std::string>(), HasSubstr("contact.knee.tracking: breadth-first-unguarded"));
  EXPECT_FALSE(summary("exact").contains("warnings"));
  const auto forces = [&](const char* folder) {
    const io::Table table = io::readTable(folder_ / folder / "contact.sto");
    return table.data.at(static_cast<size_t>(table.findColumn("total.force_y_N")));
  };
  const auto found = forces("search"), all = forces("exact");
  ASSERT_EQ(found.size(), all.size());
  EXPECT_GT(all.front(), 10);
  EXPECT_NEAR(found.front() / all.front(), 1, 1e-12);  // the first evaluation looks everywhere
  // Level, both sides carry the same; the search knows one of them.
  EXPECT_NEAR(found.back() / all.back(), 0.5, 0.01);
  std::printf("unguarded search: %.1f N of %.1f N\n", found.back(), all.back());
  EXPECT_EQ(countWarnings(run({"check", "search.yaml"}).err), 1u);
  EXPECT_EQ(countWarnings(run({"explain", "search.yaml"}).err), 1u);
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
