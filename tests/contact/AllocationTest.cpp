// The evaluation of a contact pair allocates nothing once its workspace and result exist.

#include <gtest/gtest.h>

#include <atomic>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"
#include "genu/contact/ErrorEstimate.h"

extern std::atomic<long> allocations;  // CountAllocations.cpp

namespace genu::contact {
namespace {

using namespace test;

void expectNoAllocation(Tracking tracking, ContactRule rule, DistanceMethod distance) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle());
  auto d = makeScene(share(makePlane(0.008, 0, 0, Solid::below, 0.05)), share(condyle), constantThickness(0.008), uhmwpePowerLaw(),
                     0.012, 30);
  d.movingThickness.source = BackSurface{share(makeSphere(0.02)), BackDirection::closest};
  d.movingThickness.missing_m = 0.002;
  d.tracking = tracking;
  d.rule = rule;
  d.distance = distance;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult result;
  const auto pose = [](int i) { return JointCoordinates{0.001 * i, 0, -0.01 * i, 0, 0.0405 - 0.0002 * (i % 7), 0}; };
  pair.evaluate(pose(0), workspace, {true}, result);  // sizes the result
  ErrorEstimator estimator(pair);
  ContactErrorEstimate estimate;
  estimator.evaluate(workspace, estimate);  // builds the companion grid
  const long before = allocations;
  int active = 0;
  for (int i = 1; i < 30; ++i) {
    pair.evaluate(pose(i), workspace, {i % 2 == 0}, result);
    estimator.evaluate(workspace, estimate);
    active += result.total.activeElements;
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(active, 0);
}

class Allocation : public testing::TestWithParam<Tracking> {};

TEST_P(Allocation, EvaluationAllocatesNothing) {
  const ContactPairDefinition defaults;
  expectNoAllocation(GetParam(), defaults.rule, defaults.distance);
}
TEST_P(Allocation, RayFiringAllocatesNothing) { expectNoAllocation(GetParam(), ContactRule::centre, DistanceMethod::ray); }
TEST_P(Allocation, NorWithTheGridOnTheMovingBody) {
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle());
  auto d = makeScene(share(makePlane(0.008, 0, 0, Solid::below, 0.05)), share(condyle), constantThickness(0.008), uhmwpePowerLaw(), 0.012, 30);
  d.movingThickness = constantThickness(0.002);
  d.movingMaterial = cartilage();
  d.strain = StrainMeasure::large;
  d.gridOn = GridOn::moving;
  d.tracking = GetParam();
  ElementCylinder cylinder;
  cylinder.angle0_rad = -0.6;
  cylinder.angle1_rad = 0.6;
  cylinder.axial0_m = -0.012;
  cylinder.axial1_m = 0.012;
  d.compartments[0].elementSurface = cylinder;
  const ContactPair pair(d);
  ContactWorkspace workspace(pair);
  ContactResult result;
  ContactPair::Options options;
  options.withStiffness = options.withEnergy = true;
  pair.evaluate(JointCoordinates{0, 0, 0, 0, 0.0405, 0}, workspace, options, result);
  const long before = allocations;
  int active = 0;
  for (int i = 1; i < 20; ++i) {
    pair.evaluate(JointCoordinates{0.001 * i, 0, -0.01 * i, 0, 0.0405 - 0.0002 * (i % 7), 0}, workspace, options, result);
    active += result.total.activeElements;
  }
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(active, 0);
}

INSTANTIATE_TEST_SUITE_P(Modes, Allocation, testing::Values(Tracking::all, Tracking::lipschitz, Tracking::breadthFirst));

}  // namespace
}  // namespace genu::contact
