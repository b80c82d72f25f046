#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "KneeFixtures.h"
#include "genu/model/UrdfModel.h"

namespace genu::model {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::kDegree;
using testing_support::kneeUrdf;
using testing_support::TemporaryFile;

scene::ModelSpec modelOf(const std::filesystem::path& urdf, const std::string& joint = "knee") {
  scene::ModelSpec model;
  model.urdf = urdf;
  model.joint = joint;
  return model;
}

std::string errorOf(const std::string& text, const std::string& joint = "knee") {
  const TemporaryFile file("model.urdf", text);
  try {
    readUrdf(modelOf(file.path(), joint));
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(file.path().string()));
    return error.what();
  }
  return "no InputError";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// A tibia with a welded insert, a femur with a welded component: frames must compose over the fixed joints.
std::string implantUrdf() {
  return R"(<robot name="knee">
  <link name="tibia"/>
  <link name="insert"/>
  <link name="femur"><inertial><origin xyz="0.1 0.2 0.3" rpy="0 0 1.5707963267948966"/><mass value="3"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
  <link name="component"/>
  <joint name="seat" type="fixed"><parent link="tibia"/><child link="insert"/><origin xyz="0 0.01 0"/></joint>
  <joint name="knee" type="floating"><parent link="tibia"/><child link="femur"/>
    <origin xyz="0 0.03 0" rpy="0 0 0.5"/></joint>
  <joint name="cement" type="fixed"><parent link="femur"/><child link="component"/>
    <origin xyz="0 -0.02 0" rpy="0.1 0 0"/></joint>
</robot>)";
}

TEST(UrdfModel, ReadsTreeMassesAndFrames) {
  const TemporaryFile file("model.urdf", implantUrdf());
  const UrdfModel model = readUrdf(modelOf(file.path()));
  ASSERT_EQ(model.links.size(), 4u);
  EXPECT_EQ(model.links[0].name, "tibia");
  EXPECT_FALSE(model.links[0].joint);
  EXPECT_EQ(model.links[static_cast<size_t>(model.floatingParent())].name, "tibia");
  const UrdfLink& femur = model.links[static_cast<size_t>(model.floatingChild)];
  EXPECT_EQ(femur.name, "femur");
  EXPECT_DOUBLE_EQ(femur.inertia->mass_kg, 3);
  EXPECT_TRUE(femur.inertia->center_m.isApprox(contact::Vec3(0.1, 0.2, 0.3)));
  // A quarter turn about z exchanges the x and y moments.
  EXPECT_NEAR(femur.inertia->inertia_kgM2(0, 0), 0.02, 1e-15);
  EXPECT_NEAR(femur.inertia->inertia_kgM2(1, 1), 0.01, 1e-15);
  EXPECT_NEAR(femur.inertia->inertia_kgM2(2, 2), 0.025, 1e-15);
}

TEST(UrdfModel, EmptyNamesMeanTheJointsFrames) {
  const TemporaryFile file("model.urdf", implantUrdf());
  const UrdfModel model = readUrdf(modelOf(file.path()));
  const contact::JointCoordinates q = {0.1, -0.2, 0.3, 0.01, 0.04, -0.02};
  const contact::Pose X = findContactFrames(model, {}).calcPose(q);
  EXPECT_TRUE(X.R.isApprox(contact::calcPose(q).R, 1e-15));
  EXPECT_TRUE(X.p.isApprox(contact::calcPose(q).p, 1e-15));
}

TEST(UrdfModel, NamedLinksComposeOverFixedJoints) {
  const TemporaryFile file("model.urdf", implantUrdf());
  const UrdfModel model = readUrdf(modelOf(file.path()));
  scene::ContactSpec contact;
  contact.fixedBody = "insert";
  contact.movingBody = "component";
  const contact::JointCoordinates q = {0.1, -0.2, 0.3, 0.01, 0.04, -0.02};
  const contact::Pose X = findContactFrames(model, contact).calcPose(q);
  // By hand: insert <- tibia <- F <- M = femur <- component.
  contact::Pose X_TI, X_TF, X_FeC;
  X_TI.p = {0, 0.01, 0};
  X_TF.p = {0, 0.03, 0};
  X_TF.R = Eigen::AngleAxisd(0.5, contact::Vec3::UnitZ()).toRotationMatrix();
  X_FeC.p = {0, -0.02, 0};
  X_FeC.R = Eigen::AngleAxisd(0.1, contact::Vec3::UnitX()).toRotationMatrix();
  const contact::Pose expected = X_TI.inverse() * X_TF * contact::calcPose(q) * X_FeC;
  EXPECT_TRUE(X.R.isApprox(expected.R, 1e-14));
  EXPECT_LT((X.p - expected.p).norm(), 1e-16);
}

TEST(UrdfModel, ContactOnOneSideOfTheJointIsAnError) {
  const TemporaryFile file("model.urdf", implantUrdf());
  const UrdfModel model = readUrdf(modelOf(file.path()));
  scene::ContactSpec contact;
  contact.name = "medial";
  contact.fixedBody = "femur";
  contact.movingBody = "component";
  try {
    findContactFrames(model, contact);
    FAIL() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("contact 'medial'"), HasSubstr("'femur' and 'component' never move against each other")));
  }
  contact.movingBody = "patella";
  try {
    findContactFrames(model, contact);
    FAIL() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("contact 'medial', moving body"), HasSubstr("unknown link \"patella\"; known: tibia, femur, component, insert")));
  }
}

TEST(UrdfModel, MissingFile) {
  try {
    readUrdf(modelOf("/nowhere/knee.urdf"));
    FAIL() << "no InputError";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("/nowhere/knee.urdf"), HasSubstr("cannot be read")));
  }
}

TEST(UrdfModel, MalformedXmlNamesTheLine) {
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "</inertial>", "</inertia>")),
              AllOf(HasSubstr("malformed XML"), HasSubstr(".urdf:9:")));
}

TEST(UrdfModel, NotARobot) { EXPECT_THAT(errorOf("<model/>"), HasSubstr("not a valid URDF")); }

TEST(UrdfModel, JointToMissingLink) {
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "child link='femur'", "child link='femr'")),
              AllOf(HasSubstr("not a valid URDF"), HasSubstr("femr")));
}

TEST(UrdfModel, UnknownJointType) {
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "'floating'", "'flying'")), HasSubstr("flying"));
}

TEST(UrdfModel, SceneJointMissingOrNotFloating) {
  EXPECT_THAT(errorOf(kneeUrdf(), "hip"), HasSubstr("unknown joint \"hip\"; known: knee"));
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "'floating'", "'fixed'")),
              AllOf(HasSubstr("joint 'knee'"), HasSubstr("must be 'floating'"), HasSubstr(".urdf:11:")));
}

TEST(UrdfModel, OtherJointTypesAreRefused) {
  const std::string extra =
      replaced(implantUrdf(), "name=\"cement\" type=\"fixed\"", "name=\"cement\" type=\"continuous\"");
  EXPECT_THAT(errorOf(extra), AllOf(HasSubstr("joint 'cement'"), HasSubstr("'continuous' is not supported")));
}

TEST(UrdfModel, MassMustBePositive) {
  EXPECT_THAT(errorOf(kneeUrdf(0)), AllOf(HasSubstr("link 'femur'"), HasSubstr("mass is 0 kg"), HasSubstr(".urdf:4:")));
  EXPECT_THAT(errorOf(kneeUrdf(-3)), HasSubstr("mass is -3 kg"));
}

TEST(UrdfModel, InertiaMustBePhysical) {
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "iyy='0.01'", "iyy='0.09'")),
              AllOf(HasSubstr("link 'femur'"), HasSubstr("principal moments")));
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "iyy='0.01'", "iyy='-0.01'")), HasSubstr("principal moments"));
}

TEST(UrdfModel, LoopIsNotATree) {
  EXPECT_THAT(errorOf(replaced(kneeUrdf(), "child link='femur'", "child link='tibia'")),
              AllOf(HasSubstr("1 of its 2 links"), HasSubstr("loop")));
}

TEST(UrdfModel, MovingLinkNeedsMass) {
  std::string text = implantUrdf();
  const size_t begin = text.find("<inertial>"), end = text.find("</inertial>") + 11;
  EXPECT_THAT(errorOf(text.erase(begin, end - begin)), AllOf(HasSubstr("link 'femur'"), HasSubstr("<inertial>")));
}

}  // namespace
}  // namespace genu::model
