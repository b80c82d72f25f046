#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "SampleMeshes.h"
#include "genu/fit/FitCommand.h"
#include "genu/io/NurbsFile.h"
#include "genu/scene/Scene.h"

namespace genu::fit {
namespace {

using test::messageOf;
using testing::HasSubstr;

double dish(double x, double z) { return 6 + (x * x + z * z) / 120; }  // [mm]

FitOptions parse(std::vector<std::string> arguments) {
  CLI::App app;
  FitOptions options;
  addFitOptions(app, options);
  std::reverse(arguments.begin(), arguments.end());  // CLI11 takes them from the back
  app.parse(arguments);
  return options;
}

class Fit : public testing::Test {
 protected:
  Fit() {
    TriangleMesh two = test::makeSheet(18, 10, 36, 20, dish);
    const TriangleMesh smaller = test::makeSheet(16, 9, 32, 18, dish);
    for (Vec3& p : two.vertices) p.z() += 20;
    test::writeText(folder / "one.obj", test::toObj(two, 1));
    const int offset = two.numVertices();
    for (const Vec3& p : smaller.vertices) two.vertices.push_back(p - Vec3(0, 0, 20));
    for (const auto& t : smaller.triangles) two.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    test::writeText(folder / "two.obj", test::toObj(two, 1));
  }
  FitReport run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"-o", (folder / "out").string(), "--no-picture"});
    return runFit(parse(arguments));
  }
  std::string mesh(const std::string& name) { return (folder / name).string(); }
  test::TemporaryFolder folder;
};

TEST_F(Fit, WritesPatchAndReport) {
  const FitReport report =
      run({mesh("one.obj"), "--name", "plate", "--contact-box", "-8 mm, 8 mm, *, *, *, *", "--vtp"});
  const auto patches = io::readNurbsFile(folder / "out/plate.json");
  ASSERT_EQ(patches.size(), 1u);
  EXPECT_EQ(patches[0].name, "plate");
  const contact::NurbsPatch patch(patches[0].data);
  const Vec3 p = patch.calcPoint(0.5, 0.5);
  EXPECT_NEAR(p.y(), 6e-3 + (p.x() * p.x() + std::pow(p.z() - 0.02, 2)) / 0.12, 5e-6);  // the mean tolerance
  EXPECT_TRUE(std::filesystem::exists(folder / "out/plate_fit.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/plate.vtp"));
  ASSERT_TRUE(report.contact.has_value());
  EXPECT_LT(report.contact->count, report.all.count);
  const std::string text = formatReport(report);
  EXPECT_THAT(text, HasSubstr("unit mm (guessed)"));
  EXPECT_THAT(text, HasSubstr("control points"));
  EXPECT_THAT(text, HasSubstr("contact box"));
}

TEST_F(Fit, TransformOfOneRunCanBeUsedInAnother) {
  const FitReport first = run({mesh("one.obj"), "--frame", "bbox", "--axes", "z-lateral"});
  EXPECT_NEAR(first.meshBox.min().y(), 0, 1e-9);
  EXPECT_NEAR(first.meshBox.center().z(), 0, 1e-9);
  const FitReport second = run({mesh("one.obj"), "--transform", formatPose(first.X_PM)});
  // Angles are rounded once: 1e-16 rad on 40 mm.
  EXPECT_LT((second.meshBox.min() - first.meshBox.min()).norm(), 1e-15);
  EXPECT_LT((second.meshBox.max() - first.meshBox.max()).norm(), 1e-15);
  EXPECT_LT((second.result.patch.points[7] - first.result.patch.points[7]).norm(), 1e-8);
}

TEST_F(Fit, ChoosesOneOfTwoPieces) {
  EXPECT_THAT(messageOf<InputError>([&] { run({mesh("two.obj")}); }), HasSubstr("--component or --box"));
  EXPECT_GT(run({mesh("two.obj"), "--component", "0"}).regionBox.min().z(), 0);
  EXPECT_LT(run({mesh("two.obj"), "--component", "1"}).regionBox.max().z(), 0);
  EXPECT_LT(run({mesh("two.obj"), "--box", "*, *, *, *, *, 0 mm"}).regionBox.max().z(), 0);
  EXPECT_THAT(messageOf<InputError>([&] { run({mesh("two.obj"), "--component", "2"}); }), HasSubstr("allowed: 0 to 1"));
}

TEST_F(Fit, SaysWhereTheMeshIsWhenTheBoxMissesIt) {
  const std::string said = messageOf<InputError>([&] { run({mesh("one.obj"), "--box", "50 mm, *, *, *, *, *"}); });
  EXPECT_THAT(said, HasSubstr("selects no triangle"));
  EXPECT_THAT(said, HasSubstr("x -18.00 .. 18.00"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out/one.json"));
  EXPECT_THAT(messageOf<InputError>([&] {
                run({mesh("one.obj"), "--contact-box", "50 mm, *, *, *, *, *"});
              }),
              HasSubstr("contact box holds no vertex"));
}

TEST_F(Fit, FlipTurnsTheNormals) {
  const FitReport report = run({mesh("one.obj"), "--flip"});
  EXPECT_LT(contact::NurbsPatch(report.result.patch).calcNormal(0.5, 0.5).y(), 0);
}

TEST_F(Fit, MessagesNameOptionValueAndWhatIsAllowed) {
  const auto message = [&](std::vector<std::string> more) {
    more.insert(more.begin(), mesh("one.obj"));
    return messageOf<InputError>([&] { run(more); });
  };
  EXPECT_THAT(message({"--box", "1, 2, 3, 4, 5, 6"}), HasSubstr("--box"));
  EXPECT_THAT(message({"--box", "1 mm, 2 mm"}), HasSubstr("has 2 values"));
  EXPECT_THAT(message({"--box", "2 mm, 1 mm, *, *, *, *"}), HasSubstr("lower one"));
  EXPECT_THAT(message({"--unit", "inch"}), HasSubstr("allowed: m, mm"));
  EXPECT_THAT(message({"--frame", "box"}), HasSubstr("allowed: file, bbox, landmarks"));
  EXPECT_THAT(message({"--transform", "1 mm, 0 rad, 0 rad, 0 m, 0 m, 0 m"}), HasSubstr("--transform"));
  EXPECT_THAT(message({"--max-points", "3x20"}), HasSubstr("4 to 200"));
  EXPECT_THAT(message({"--angles", "0 deg, 10 deg"}), HasSubstr("--shape condyle"));
  EXPECT_THAT(message({"--name", "a/b"}), HasSubstr("name \"a/b\""));
  EXPECT_THAT(message({"--fall-away", "-1 mm"}), HasSubstr("--fall-away"));
  EXPECT_THAT(message({"--transform", "0 rad, 0 rad, 0 rad, 0 m, 0 m, 0 m", "--frame", "bbox"}),
              HasSubstr("one of them"));
  EXPECT_THAT(message({"--frame", "landmarks", "--medial", "0 mm, 0 mm, 9 mm"}),
              HasSubstr("landmark lateral is missing"));
}

}  // namespace
}  // namespace genu::fit
