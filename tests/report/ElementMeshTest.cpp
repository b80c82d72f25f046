#include <gtest/gtest.h>

#include <cmath>

#include "ReportFixtures.h"
#include "genu/report/ElementMesh.h"
#include "genu/report/Vtk.h"

namespace genu::report {
namespace {

using contact::Vec3;
using testing::readArray;
using testing::TemporaryFolder;

struct Evaluated {
  std::shared_ptr<const contact::ContactPair> pair;
  std::vector<std::vector<contact::ElementField>> fields;
  contact::ContactResult result;
};

Evaluated evaluate(const std::string& yaml) {
  Evaluated e;
  e.pair = scene::makeContactPairs(scene::parseScene(yaml, "test.yaml")).front();
  contact::ContactWorkspace workspace(*e.pair);
  e.pair->evaluate(contact::JointCoordinates{0, 0, 0, 0, 0.0358, 0}, workspace, {true}, e.result);
  e.fields = e.pair->calcFields(workspace);
  return e;
}

TEST(ElementMesh, FileReadsBackWithTheEnginesNumbers) {
  const Evaluated e = evaluate(testing::kBallScene);
  const TemporaryFolder folder;
  writeVtp(folder / "field.vtp", makeElementMesh(e.pair->definition(), e.fields, Precision::full));
  EXPECT_EQ(folder.count(), 1u) << "temporary files must be gone";

  pugi::xml_document document;
  ASSERT_TRUE(document.load_file((folder / "field.vtp").c_str()));
  const auto piece = document.child("VTKFile").child("PolyData").child("Piece");
  EXPECT_EQ(piece.attribute("NumberOfPolys").as_int(), 400);
  EXPECT_EQ(piece.attribute("NumberOfPoints").as_int(), 2 * 21 * 11);
  const auto pressure = readArray<double>(document, "pressure_Pa");
  const auto area = readArray<double>(document, "area_m2");
  const auto elementForce = readArray<double>(document, "force_N");
  const auto share = readArray<double>(document, "contact_share");
  const auto active = readArray<std::uint8_t>(document, "contact");
  const auto compartment = readArray<std::uint8_t>(document, "compartment");
  ASSERT_EQ(pressure.size(), 400u);
  double force = 0, highest = 0, loadedArea = 0;
  int count = 0;
  for (size_t i = 0; i < pressure.size(); ++i) {
    force += elementForce[i];
    loadedArea += share[i] * area[i];
    highest = std::max(highest, pressure[i]);
    count += active[i];
    EXPECT_EQ(compartment[i], i < 200 ? 0 : 1);
  }
  // Same doubles, summed in another order: 400 roundings of 2^-53.
  EXPECT_NEAR(force / e.result.total.scalarForce_N, 1, 400 * 1.2e-16);
  EXPECT_NEAR(loadedArea / e.result.total.area_m2, 1, 400 * 1.2e-16);
  // The peak is a point value: no element's centre is above it, the nearest within half an element, (0.25 mm / 3.5 mm)^2 here.
  EXPECT_LE(highest, e.result.total.peakPressure_Pa);
  EXPECT_GT(highest, 0.95 * e.result.total.peakPressure_Pa);
  EXPECT_EQ(count, e.result.total.activeElements);
  const auto connectivity = readArray<std::int32_t>(document, "connectivity");
  const auto offsets = readArray<std::int32_t>(document, "offsets");
  EXPECT_EQ(connectivity.size(), 1600u);
  EXPECT_EQ(offsets.back(), 1600);
}

TEST(ElementMesh, CornersOfAnInclinedPlaneLieOnItAndFacesLookOutward) {
  const Evaluated e = evaluate(R"(genu: 1
surfaces: {layer: {plane: {y0: 6 mm, sx: 0.3, sz: -0.2}}, ball: {sphere: {R: 30 mm}}}
materials: {pe: {E: 463 MPa, nu: 0.46}}
contact:
  knee:
    fixed: {surface: layer, thickness: 6 mm}
    moving: {surface: ball}
    material: pe
    compartments: {all: {rectangle: "-5 mm, 5 mm, -5 mm, 5 mm", grid: 7x4}}
)");
  const VtkMesh mesh = makeElementMesh(e.pair->definition(), e.fields, Precision::single);
  ASSERT_EQ(mesh.numPoints(), 8u * 5u);
  const auto point = [&](size_t i) { return Vec3(mesh.points[3 * i], mesh.points[3 * i + 1], mesh.points[3 * i + 2]); };
  // Tangent planes of a plane are the plane; grid projection is good to 1e-13 m.
  for (size_t i = 0; i < mesh.numPoints(); ++i) {
    EXPECT_NEAR(point(i).y(), 0.006 + 0.3 * point(i).x() - 0.2 * point(i).z(), 1e-12);
  }
  for (size_t c = 0; c < mesh.numCells(); ++c) {
    const auto at = [&](size_t k) { return point(static_cast<size_t>(mesh.connectivity[4 * c + k])); };
    EXPECT_GT((at(1) - at(0)).cross(at(2) - at(0)).y(), 0);
  }
}

TEST(ElementMesh, CellsOfSeveralLevelsCoverTheRectangleOnce) {
  auto d = scene::makeContactPairs(scene::parseScene(testing::kBallScene, "test.yaml")).front()->definition();
  d.compartments[0].refined = {{0, 2, 3}, {1, 5, 6}, {0, 3, 3}};
  const contact::ContactPair pair(d);
  contact::ContactWorkspace workspace(pair);
  contact::ContactResult result;
  pair.evaluate(contact::JointCoordinates{0, 0, 0, 0, 0.0358, 0}, workspace, {}, result);
  const auto fields = pair.calcFields(workspace);
  const VtkMesh mesh = makeElementMesh(pair.definition(), fields, Precision::single, contact::Pose{});
  ASSERT_EQ(mesh.numCells(), 400u + 9u);
  // The layer is flat: projected and surface areas agree, cell by cell, and add up to both rectangles.
  double sum = 0, expected = 0;
  for (const auto& c : d.compartments) expected += (c.x1_m - c.x0_m) * (c.z1_m - c.z0_m);
  size_t cell = 0;
  for (const auto& compartment : fields) {
    for (const auto& e : compartment) {
      const auto at = [&](size_t k) {
        const auto i = static_cast<size_t>(mesh.connectivity[4 * cell + k]);
        return Vec3(mesh.points[3 * i], mesh.points[3 * i + 1], mesh.points[3 * i + 2]);
      };
      const double area = (at(1) - at(0)).cross(at(3) - at(0)).y();
      EXPECT_NEAR(area / e.area_m2, 1, 1e-9);
      const Vec3 middle = 0.25 * (at(0) + at(1) + at(2) + at(3));
      EXPECT_LT((middle - e.p_FA).norm(), 1e-9);
      sum += area;
      ++cell;
    }
  }
  EXPECT_NEAR(sum / expected, 1, 1e-9);
}

TEST(ElementMesh, RoundGridsAreJoinedAndFaceOutward) {
  // Corners on the radii of the grid, their distance the mean of tangent planes: on a sphere of radius R with cells of angle a the
  // planes lie R (1/cos(a/sqrt(2)) - 1) off, at most R a^2/4 = 0.12 mm here (40 deg in 20 cells).
  const std::string hip = R"(genu: 1
surfaces: {socket: {sphere: {R: 25 mm}, flip_normals: true}, head: {sphere: {R: 24 mm}}}
materials: {m: {E: 463 MPa, nu: 0.46}}
contact:
  hip:
    fixed: {surface: socket, thickness: 2 mm}
    moving: {surface: head}
    material: m
    grid_on: ON
    compartments: {all: {sphere: {facing: WAY, angle: "-180 deg, 180 deg", elevation: "-40 deg, 40 deg"}, grid: 90x20}}
)";
  const contact::Pose X = contact::calcPose({0.3, -0.2, 0.5, 0.0001, -0.0012, 0.0002});
  for (const bool moving : {false, true}) {
    std::string yaml = hip;
    yaml.replace(yaml.find("ON\n"), 2, moving ? "moving" : "fixed");
    yaml.replace(yaml.find("WAY"), 3, moving ? "outward" : "inward");
    const auto pair = scene::makeContactPairs(scene::parseScene(yaml, "test.yaml")).front();
    contact::ContactWorkspace workspace(*pair);
    contact::ContactResult result;
    pair->evaluate(X, workspace, {}, result);
    const auto fields = pair->calcFields(workspace);
    const VtkMesh mesh = makeElementMesh(pair->definition(), fields, Precision::full, X);
    EXPECT_EQ(mesh.numCells(), 90u * 20u);
    EXPECT_EQ(mesh.numPoints(), 90u * 21u);  // one row of corners at the seam
    const Vec3 center = moving ? X.p : Vec3(0, 0, 0);
    const double R = moving ? 0.024 : 0.025;
    const auto pointAt = [&](size_t i) { return Vec3(mesh.points[3 * i], mesh.points[3 * i + 1], mesh.points[3 * i + 2]); };
    for (size_t i = 0; i < mesh.numPoints(); ++i) EXPECT_NEAR((pointAt(i) - center).norm(), R, R * 0.0049 / 2);
    double area = 0;
    for (size_t e = 0; e < mesh.numCells(); ++e) {
      Vec3 p[4], middle = Vec3::Zero();
      for (size_t k = 0; k < 4; ++k) middle += 0.25 * (p[k] = pointAt(static_cast<size_t>(mesh.connectivity[4 * e + k])));
      const Vec3 n = 0.5 * (p[2] - p[0]).cross(p[3] - p[1]);
      area += n.norm();
      EXPECT_GT(n.normalized().dot(fields[0][e].normal_F), 0.99);
      EXPECT_LT((middle - fields[0][e].p_FA).norm(), R * 0.0049);
    }
    EXPECT_NEAR(area / pair->gridReports()[0].surfaceArea_m2, 1, 0.01);
  }
}

TEST(ElementMesh, TableHasOneLinePerElement) {
  const Evaluated e = evaluate(testing::kBallScene);
  const TemporaryFolder folder;
  writeElementCsv(folder / "field.csv", e.pair->definition(), e.fields);
  const std::string text = testing::read(folder / "field.csv");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 401);
  EXPECT_EQ(text.rfind("compartment,ix,iz,x_m", 0), 0u);
  EXPECT_EQ(folder.count(), 1u);
}

TEST(ElementMesh, TessellatedSphereLiesOnTheSphereWithItsNormals) {
  const contact::ContactSurface sphere(contact::makeSphere(0.03));
  const contact::Pose X = contact::calcPose({0.3, -0.2, 0.5, 0.01, 0.02, 0.03});
  const VtkMesh mesh = tessellate({&sphere}, X, 20);
  const auto& normals = std::get<std::vector<float>>(mesh.pointData.front().values);
  for (size_t i = 0; i < mesh.numPoints(); ++i) {
    const Vec3 r = Vec3(mesh.points[3 * i], mesh.points[3 * i + 1], mesh.points[3 * i + 2]) - X.p;
    EXPECT_NEAR(r.norm(), 0.03, 1e-14);
    const Vec3 n(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]);
    EXPECT_NEAR(n.dot(r) / 0.03, 1, 1e-6);  // stored in single precision
  }
  EXPECT_GE(mesh.numCells(), 2u * 20u * 20u);
}

TEST(Vtk, WrongArrayLengthIsRefused) {
  VtkMesh mesh;
  mesh.points = {0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1};
  mesh.connectivity = {0, 1, 2, 3};
  mesh.cellData.push_back({"pressure_Pa", 1, std::vector<double>{1, 2}});
  const TemporaryFolder folder;
  EXPECT_THROW(writeVtp(folder / "bad.vtp", mesh), std::invalid_argument);
  EXPECT_EQ(folder.count(), 0u);
}

TEST(Vtk, UnwritableFileIsAnInputErrorThatNamesIt) {
  const TemporaryFolder folder;
  try {
    writeVtp(folder / "missing" / "field.vtp", VtkMesh{});
    FAIL() << "nothing was thrown";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("field.vtp"), std::string::npos);
  }
}

TEST(Vtk, FilesOfOneTimeAreItsParts) {
  const TemporaryFolder folder;
  writePvd(folder / "a.pvd", {{0.0, "x.vtp"}, {0.0, "y.vtp"}, {0.1, "z.vtp"}});
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file((folder / "a.pvd").c_str()));
  std::vector<std::string> seen;
  for (const auto& node : document.child("VTKFile").child("Collection").children("DataSet")) {
    seen.push_back(std::string(node.attribute("timestep").value()) + "/" + node.attribute("part").value() + "/" +
                   node.attribute("file").value());
  }
  EXPECT_EQ(seen, (std::vector<std::string>{"0/0/x.vtp", "0/1/y.vtp", "0.1/0/z.vtp"}));
}

}  // namespace
}  // namespace genu::report
