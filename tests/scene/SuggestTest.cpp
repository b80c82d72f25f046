#include "TestFiles.h"
#include "genu/io/Suggest.h"

namespace genu::io {
namespace {

TEST(Suggest, DistanceCountsEdits) {
  EXPECT_EQ(calcEditDistance("", ""), 0);
  EXPECT_EQ(calcEditDistance("thickness", "thickness"), 0);
  EXPECT_EQ(calcEditDistance("thickness", "Thickness"), 0);
  EXPECT_EQ(calcEditDistance("thicknes", "thickness"), 1);
  EXPECT_EQ(calcEditDistance("tihckness", "thickness"), 1);
  EXPECT_EQ(calcEditDistance("kitten", "sitting"), 3);
  EXPECT_EQ(calcEditDistance("", "abc"), 3);
}

TEST(Suggest, NearestOnlyWhenNear) {
  const std::vector<std::string> keys = {"fixed", "moving", "material", "strain"};
  EXPECT_EQ(findNearest("matrial", keys), "material");
  EXPECT_EQ(findNearest("movin", keys), "moving");
  EXPECT_EQ(findNearest("zzzzzz", keys), "");
  EXPECT_EQ(findNearest("ab", {"cd"}), "");
  EXPECT_EQ(findNearest("Fixed", keys), "fixed");
}

TEST(Suggest, MessageNamesNearestAndAll) {
  EXPECT_EQ(describeUnknown("link", "tibbia", {"femur", "tibia"}),
            "unknown link \"tibbia\" (did you mean \"tibia\"?); known: femur, tibia");
  EXPECT_EQ(describeUnknown("link", "xyz", {}), "unknown link \"xyz\"; known: none");
}

}  // namespace
}  // namespace genu::io
