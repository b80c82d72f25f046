#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "ReportFixtures.h"
#include "genu/report/ContactReport.h"

namespace genu::report {
namespace {

using contact::ContactResult;
using contact::EvaluationStatus;
using contact::NetLoad;
using contact::Vec3;
using ::testing::HasSubstr;

scene::Scene makeScene(int pairs) {
  scene::Scene scene;
  for (int i = 0; i < pairs; ++i) {
    scene::ContactSpec spec;
    spec.name = "pair" + std::to_string(i);
    spec.definition.compartments.resize(2);
    spec.definition.compartments[0].name = "medial";
    spec.definition.compartments[1].name = "lateral";
    scene.contacts.push_back(spec);
  }
  return scene;
}

NetLoad makeLoad(double force, double area, const Vec3& at) {
  NetLoad load;
  load.forceOnM_F = {0, force, 0};
  load.momentOnM_Fo_F = at.cross(load.forceOnM_F);
  load.scalarForce_N = force;
  load.peakPressure_Pa = 2 * force / area;
  load.meanPressure_Pa = force / area;
  load.area_m2 = area;
  load.centerOfPressure_F = at;
  load.activeElements = 3;
  return load;
}

TEST(ContactReport, NamesCarryThePairOnlyWhereThereAreSeveral) {
  EXPECT_THAT(listCompartmentNames(makeScene(1)), ::testing::ElementsAre("medial", "lateral"));
  EXPECT_THAT(listCompartmentNames(makeScene(2)),
              ::testing::ElementsAre("pair0.medial", "pair0.lateral", "pair1.medial", "pair1.lateral"));
}

TEST(ContactReport, SumWeighsMeanPressureByAreaAndCenterByForce) {
  std::vector<ContactResult> results(2);
  results[0].total = makeLoad(100, 1e-5, {0, 0, 0.02});
  results[1].total = makeLoad(300, 2e-5, {0, 0, -0.02});
  const NetLoad sum = sumLoads(results);
  // Rounding of a few additions only.
  EXPECT_NEAR(sum.scalarForce_N, 400, 1e-12);
  EXPECT_NEAR(sum.meanPressure_Pa, 400 / 3e-5, 1e-6);
  EXPECT_NEAR(sum.centerOfPressure_F.z(), (100 * 0.02 - 300 * 0.02) / 400, 1e-16);
  EXPECT_NEAR(sum.momentOnM_Fo_F.x(), -(100 * 0.02 - 300 * 0.02), 1e-12);
  EXPECT_EQ(sum.peakPressure_Pa, std::max(results[0].total.peakPressure_Pa, results[1].total.peakPressure_Pa));
  EXPECT_EQ(sum.activeElements, 6);
}

TEST(ContactReport, NoContactIsExactlyZeroWithoutNegativeZeros) {
  const auto json = toJson(NetLoad{});
  for (const auto& item : json.items()) {
    if (item.value().is_array()) {
      for (const double value : item.value()) {
        EXPECT_EQ(value, 0.0) << item.key();
        EXPECT_FALSE(std::signbit(value)) << item.key();
      }
    } else {
      EXPECT_EQ(item.value().get<double>(), 0.0) << item.key();
    }
  }
}

TEST(ContactReport, JsonHasNumbersOnlyWhereTheyMeanSomething) {
  const scene::Scene scene = makeScene(1);
  std::vector<ContactResult> results(1);
  results[0].compartments = {makeLoad(100, 1e-5, {0, 0, 0.02}), NetLoad{}};
  results[0].total = makeLoad(100, 1e-5, {0, 0, 0.02});
  auto json = toJson(scene, results);
  EXPECT_EQ(json.at("status"), "ok");
  for (const char* key :
       {"force_on_moving_N", "moment_on_moving_about_fixed_origin_Nm", "scalar_force_N", "peak_pressure_Pa",
        "mean_pressure_Pa", "area_m2", "active_elements", "center_of_pressure_m", "energy_J"}) {
    EXPECT_TRUE(json.at("total").contains(key)) << key;
    EXPECT_TRUE(json.at("compartments").at("medial").contains(key)) << key;
  }
  for (const EvaluationStatus status : {EvaluationStatus::fullPenetration, EvaluationStatus::notConverged}) {
    results[0].status = status;
    results[0].compartments[0].fullPenetrationElements = results[0].compartments[0].notConvergedQueries = 4;
    json = toJson(scene, results);
    EXPECT_EQ(json.size(), 2u);
    EXPECT_EQ(json.at("status"), contact::toString(status));
    EXPECT_THAT(json.at("status_text").get<std::string>(), HasSubstr("4 "));
    EXPECT_THAT(json.at("status_text").get<std::string>(), HasSubstr("in medial"));
  }
  NetLoad& medial = results[0].compartments[0];
  medial.notConvergedQueries = 0;
  EXPECT_THAT(toJson(scene, results).at("status_text").get<std::string>(), HasSubstr("beyond the range of numbers"));
  medial.unresolvedCompartments = 1;
  EXPECT_THAT(toJson(scene, results).at("status_text").get<std::string>(), HasSubstr("pressures in medial sum up to less than nothing"));
}

TEST(ContactReport, TotalOfPairsOnDifferentBodiesHasNoVectors) {
  scene::Scene scene = makeScene(2);
  scene.contacts[1].fixedBody = "patella";
  std::vector<ContactResult> results(2);
  for (auto& result : results) {
    result.compartments.assign(2, makeLoad(50, 1e-5, {0, 0, 0}));
    result.total = makeLoad(100, 2e-5, {0, 0, 0});
  }
  const auto total = toJson(scene, results).at("total");
  EXPECT_FALSE(total.contains("force_on_moving_N"));
  EXPECT_FALSE(total.contains("center_of_pressure_m"));
  EXPECT_EQ(total.at("scalar_force_N"), 200);
}

contact::ContactErrorEstimate makeEstimate(double scale) {
  contact::ContactErrorEstimate e;
  e.total = {scale, 2 * scale, 3 * scale, 4 * scale, 5 * scale};
  e.compartments.assign(2, e.total);
  return e;
}

TEST(ContactReport, ErrorsOfPairsAddAndThePeakKeepsItsOwn) {
  std::vector<ContactResult> results(2);
  results[0].total = makeLoad(100, 1e-5, {0, 0, 0.02});  // 20 MPa
  results[1].total = makeLoad(300, 2e-5, {0, 0, 0});     // 30 MPa: the peak
  const contact::LoadError sum = sumErrors(results, {makeEstimate(1), makeEstimate(10)});
  EXPECT_EQ(sum.force_N, 11);
  EXPECT_EQ(sum.moment_Nm, 22);
  EXPECT_EQ(sum.peakPressure_Pa, 30);
  EXPECT_NEAR(sum.meanPressure_Pa, (4 * 1e-5 + 40 * 2e-5) / 3e-5, 1e-12);
  EXPECT_EQ(sum.area_m2, 55);
}

TEST(ContactReport, ErrorsAreInJsonAndTableOnlyWhenEstimated) {
  const scene::Scene scene = makeScene(1);
  std::vector<ContactResult> results(1);
  results[0].compartments.assign(2, makeLoad(50, 1e-5, {0, 0, 0.02}));
  results[0].total = makeLoad(100, 2e-5, {0, 0, 0});
  EXPECT_FALSE(toJson(scene, results).at("total").contains("error_estimate"));
  EXPECT_THAT(formatTable(scene, results), ::testing::Not(HasSubstr("estimated")));
  const auto json = toJson(scene, results, {makeEstimate(0.125)});
  for (const auto& load : {json.at("total"), json.at("compartments").at("lateral")}) {
    EXPECT_EQ(load.at("error_estimate").at("force_N"), 0.125);
    EXPECT_EQ(load.at("error_estimate").at("moment_Nm"), 0.25);
    EXPECT_EQ(load.at("error_estimate").at("area_m2"), 0.625);
  }
  const std::string table = formatTable(scene, results, {makeEstimate(0.125)});
  for (const char* part : {"estimated errors of the grid", "0.12", "0.25"}) EXPECT_THAT(table, HasSubstr(part));
}

TEST(ContactReport, UnresolvedElementsAreToldWhereTheyCarryMoreThanATenth) {
  std::vector<contact::ElementField> fields(3);
  EXPECT_EQ(calcUnresolvedShare(fields), 0);
  fields[0].force_N = 30;
  fields[1].force_N = 70;
  EXPECT_EQ(calcUnresolvedShare(fields), 0);
  fields[0].unresolved = true;
  EXPECT_DOUBLE_EQ(calcUnresolvedShare(fields), 0.3);
  EXPECT_TRUE(describeUnresolved("lateral", 0.1).empty());
  const std::string text = describeUnresolved("lateral", 0.3);
  EXPECT_NE(text.find("lateral: up to 30 %"), std::string::npos) << text;
  EXPECT_NE(text.find("finer grid"), std::string::npos) << text;
}

TEST(ContactReport, TableShowsUnitsAndTotal) {
  const scene::Scene scene = makeScene(1);
  std::vector<ContactResult> results(1);
  results[0].compartments.assign(2, makeLoad(50, 1e-5, {0, 0, 0.02}));
  results[0].total = makeLoad(100, 2e-5, {0, 0, 0});
  const std::string table = formatTable(scene, results);
  for (const char* part : {"medial", "lateral", "total", "MPa", "mm^2", "N m", "50"})
    EXPECT_THAT(table, HasSubstr(part));
}

}  // namespace
}  // namespace genu::report
