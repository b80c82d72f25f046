#include <gtest/gtest.h>

#include <cstdlib>

#include "SampleMeshes.h"
#include "genu/fit/Fit.h"

namespace genu::fit {
namespace {

/** One patch as scripts/fit_tka_dm or scripts/fit_natural_knee asks for it, and what is expected of it. */
struct Case {
  const char* name;
  const char* mesh;
  PatchShape shape;
  FileAxes axes;
  double z0_mm, z1_mm;               // region
  double angle0_deg, angle1_deg;     // condyle
  std::array<double, 4> contact_mm;  // x0, x1, z0, z1 of the contact box
  double mean_um, max_um;            // targets: implant over the region, cartilage over the contact box
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

constexpr double kOpen = 1e3;

class RealData : public testing::TestWithParam<Case> {};

TEST_P(RealData, MeetsItsTarget) {
  const Case& c = GetParam();
  const char* folder = std::getenv("GENU_DATA_DIR");
  if (folder == nullptr || !std::filesystem::exists(std::filesystem::path(folder) / c.mesh)) {
    GTEST_SKIP() << "GENU_DATA_DIR is not set to a folder that holds " << c.mesh;
  }
  const test::TemporaryFolder output;
  const bool implant = c.axes == FileAxes::paper;
  FitOptions o;
  o.mesh = std::filesystem::path(folder) / c.mesh;
  o.outputDir = output.path();
  o.name = "patch";
  o.picture = false;
  o.axes = c.axes;
  o.fit.parametrization.shape = c.shape;
  o.box.min[2] = c.z0_mm * 1e-3;
  o.box.max[2] = c.z1_mm * 1e-3;
  if (c.shape == PatchShape::condyle) {
    o.angles_rad = {c.angle0_deg * contact::kPi / 180, c.angle1_deg * contact::kPi / 180};
    if (implant) o.axis_m = Vec2(2.95e-3, -5.6e-3);
  } else if (implant) {
    o.box.min[0] = -20.5e-3;
    o.box.max[0] = 18.5e-3;
  }
  o.contactBox.min = {c.contact_mm[0] * 1e-3, {}, c.contact_mm[2] * 1e-3};
  o.contactBox.max = {c.contact_mm[1] * 1e-3, {}, c.contact_mm[3] * 1e-3};
  o.fit.toleranceMean_m = implant ? 4e-6 : 5e-6;
  o.fit.toleranceMax_m = implant ? 30e-6 : 200e-6;
  const FitReport report = runFit(o);

  EXPECT_EQ(report.file.unit, LengthUnit::m);
  EXPECT_LE(report.controlPoints[0], 20);
  EXPECT_LE(report.controlPoints[1], 15);
  ASSERT_TRUE(report.contact.has_value());
  const DeviationStatistics& judged = implant ? report.all : *report.contact;
  EXPECT_LE(judged.mean_m, c.mean_um * 1e-6);
  EXPECT_LE(judged.max_m, c.max_um * 1e-6);
  // No ripples between the vertices: facets themselves are off a smooth surface by up to some 40 um at tight rims.
  EXPECT_LE(report.between.mean_m, 15e-6);
  EXPECT_LE(report.uncoveredShare, 0.15);
  // The outward normal leaves the part: up on a plateau, down at the bottom of a condyle.
  double up = 0;
  const contact::NurbsPatch patch(report.result.patch);
  for (const double u : {0.3, 0.4, 0.5}) up += patch.calcNormal(u, 0.5).y();
  EXPECT_TRUE(c.shape == PatchShape::plateau ? up > 2 : up < -1) << up;
}

const auto condyle = PatchShape::condyle;
const auto plateau = PatchShape::plateau;
const char* const femoral = "tka_dm/femoral_component_contact.stl";
const char* const insert = "tka_dm/tibial_insert_contact.stl";
const char* const femurCartilage = "natural_knee/femur_cartilage.stl";
const char* const tibiaCartilage = "natural_knee/tibia_cartilage.stl";

INSTANTIATE_TEST_SUITE_P(
    Patches, RealData,
    testing::Values(
        Case{"femoral_medial", femoral, condyle, FileAxes::paper, 9.6, 36.7, -35, 102, {-2, kOpen, 11, 34}, 5, 50},
        Case{"femoral_lateral", femoral, condyle, FileAxes::paper, -36, -9.6, -35, 102, {-2, kOpen, -34, -11}, 5, 50},
        Case{"insert_medial", insert, plateau, FileAxes::paper, 6, 37, 0, 0, {-18, 15, 8, 35}, 5, 50},
        Case{"insert_lateral", insert, plateau, FileAxes::paper, -37, -6, 0, 0, {-18, 15, -35, -8}, 5, 50},
        Case{"femur_medial", femurCartilage, condyle, FileAxes::lateral, 6, kOpen, -50, 110, {-20, 15, 9, 27}, 30, 150},
        Case{"femur_lateral",
             femurCartilage,
             condyle,
             FileAxes::lateral,
             -kOpen,
             -6,
             -50,
             110,
             {-20, 15, -29, -9},
             30,
             150},
        Case{"tibia_medial", tibiaCartilage, plateau, FileAxes::lateral, 0, kOpen, 0, 0, {-15, 9, 7, 26}, 30, 150},
        Case{"tibia_lateral", tibiaCartilage, plateau, FileAxes::lateral, -kOpen, 0, 0, 0, {-11, 8, -29, -9}, 30, 150}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace genu::fit
