#include <cmath>
#include <limits>

#include "TestFiles.h"
#include "genu/contact/Types.h"
#include "genu/io/Units.h"

namespace genu::io {
namespace {

using test::messageOf;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

// Expected values are the doubles nearest to the decimal value in SI, so equality is exact unless pi is involved.
TEST(Units, ReadsCommonQuantities) {
  EXPECT_EQ(parseQuantity("463 MPa", Dimension::pressure, "k"), 463e6);
  EXPECT_EQ(parseQuantity("8 mm", Dimension::length, "k"), 0.008);
  EXPECT_EQ(parseQuantity("8mm", Dimension::length, "k"), 0.008);
  EXPECT_EQ(parseQuantity("  35.8   mm ", Dimension::length, "k"), 0.0358);
  EXPECT_EQ(parseQuantity("1000 N", Dimension::force, "k"), 1000);
  EXPECT_EQ(parseQuantity("1 kN", Dimension::force, "k"), 1000);
  EXPECT_EQ(parseQuantity("2 N m", Dimension::moment, "k"), 2);
  EXPECT_EQ(parseQuantity("2 N*m", Dimension::moment, "k"), 2);
  EXPECT_EQ(parseQuantity("2 N\u00b7m", Dimension::moment, "k"), 2);
  EXPECT_EQ(parseQuantity("2 Nm", Dimension::moment, "k"), 2);
  EXPECT_EQ(parseQuantity("2000 N mm", Dimension::moment, "k"), 2);
  EXPECT_EQ(parseQuantity("9.81 m/s^2", Dimension::acceleration, "k"), 9.81);
  EXPECT_EQ(parseQuantity("9.81 m/s\u00b2", Dimension::acceleration, "k"), 9.81);
  EXPECT_EQ(parseQuantity("9.81 m s^-2", Dimension::acceleration, "k"), 9.81);
  EXPECT_EQ(parseQuantity("1 s", Dimension::time, "k"), 1);
  EXPECT_EQ(parseQuantity("10 ms", Dimension::time, "k"), 0.01);
  EXPECT_EQ(parseQuantity("-0.3 N s/mm", Dimension::damping, "k"), -300);
  EXPECT_EQ(parseQuantity("70 kg", Dimension::mass, "k"), 70);
  EXPECT_EQ(parseQuantity("0.3 t", Dimension::mass, "k"), 300);
  EXPECT_EQ(parseQuantity("0.46", Dimension::dimensionless, "k"), 0.46);
  EXPECT_EQ(parseQuantity("46 %", Dimension::dimensionless, "k"), 0.46);
  EXPECT_EQ(parseQuantity("+1e-4", Dimension::dimensionless, "k"), 1e-4);
  EXPECT_EQ(parseQuantity("5 mm/s", Dimension::speed, "k"), 0.005);
  EXPECT_EQ(parseQuantity("0.2 N m s/rad", Dimension::angularDamping, "k"), 0.2);
  EXPECT_EQ(parseQuantity("0.2 N m s", Dimension::angularDamping, "k"), 0.2);
  EXPECT_EQ(parseQuantity("0 mm", Dimension::length, "k"), 0);
  EXPECT_EQ(parseQuantity("0.5 s/m", Dimension::inverseSpeed, "k"), 0.5);
  EXPECT_EQ(parseQuantity("2 s/mm", Dimension::inverseSpeed, "k"), 2000);
  // Two roundings: of pi/180 and of the product.
  EXPECT_NEAR(parseQuantity("30 deg", Dimension::angle, "k"), contact::kPi / 6, 2e-16);
  EXPECT_NEAR(parseQuantity("463 N/mm^2", Dimension::pressure, "k"), 463e6, 463e6 * 4e-16);
}

TEST(Units, BareNumberNamesPlaceAndUnits) {
  const std::string message =
      messageOf([] { parseQuantity("463", Dimension::pressure, "scene.yaml:4: materials.insert.E"); });
  EXPECT_THAT(message, StartsWith("scene.yaml:4: materials.insert.E: \"463\" has no unit"));
  EXPECT_THAT(message, AllOf(HasSubstr("pressure"), HasSubstr("MPa, kPa, Pa, GPa"), HasSubstr("463 MPa")));
  // Zero is no exception: "0" of what would be left to the reader.
  EXPECT_THAT(messageOf([] { parseQuantity("0", Dimension::length, "k"); }), HasSubstr("has no unit"));
}

TEST(Units, WrongDimensionIsNamed) {
  EXPECT_THAT(messageOf([] { parseQuantity("8 mm", Dimension::angle, "k"); }),
              AllOf(HasSubstr("\"8 mm\" is a length"), HasSubstr("an angle is needed"), HasSubstr("deg, rad")));
  EXPECT_THAT(messageOf([] { parseQuantity("1 N s^2", Dimension::force, "k"); }), HasSubstr("m^1 kg^1"));
  EXPECT_THAT(messageOf([] { parseQuantity("0.46 mm", Dimension::dimensionless, "k"); }),
              AllOf(HasSubstr("is a length"), HasSubstr("without a unit")));
}

TEST(Units, UnknownUnitOffersTheNearest) {
  EXPECT_THAT(messageOf([] { parseQuantity("463 Mpa", Dimension::pressure, "k"); }),
              AllOf(HasSubstr("unknown unit \"Mpa\""), HasSubstr("did you mean \"MPa\"")));
  EXPECT_THAT(messageOf([] { parseQuantity("8 furlong", Dimension::length, "k"); }),
              HasSubstr("unknown unit \"furlong\""));
}

TEST(Units, RefusesWhatReadersDisagreeOn) {
  EXPECT_THAT(messageOf([] { parseQuantity("1 N/mm s", Dimension::damping, "k"); }), HasSubstr("ambiguous"));
  EXPECT_THAT(messageOf([] { parseQuantity("1 N/", Dimension::force, "k"); }), HasSubstr("ends with an operator"));
  EXPECT_THAT(messageOf([] { parseQuantity("1 m^99", Dimension::length, "k"); }), HasSubstr("power"));
  EXPECT_THAT(messageOf([] { parseQuantity("1,5 mm", Dimension::length, "k"); }), HasSubstr("unknown unit \",5\""));
}

TEST(Units, RefusesWhatIsNoFiniteNumber) {
  for (const char* text : {"nan mm", "NaN", ".nan", "-nan mm"}) {
    EXPECT_THAT(messageOf([text] { parseQuantity(text, Dimension::length, "k"); }), HasSubstr("is not a number"))
        << text;
  }
  for (const char* text : {"inf mm", "-inf", "Infinity m", ".inf"}) {
    EXPECT_THAT(messageOf([text] { parseQuantity(text, Dimension::length, "k"); }), HasSubstr("is infinite")) << text;
  }
  for (const char* text : {"1e999 mm", "1e308 GPa"}) {
    const Dimension dimension = text[4] == '8' ? Dimension::pressure : Dimension::length;
    EXPECT_THAT(messageOf([&] { parseQuantity(text, dimension, "k"); }), HasSubstr("beyond what a number can hold"))
        << text;
  }
  for (const char* text : {"mm", "--1 mm", "+-1 mm", "x"}) {
    EXPECT_THAT(messageOf([text] { parseQuantity(text, Dimension::length, "k"); }),
                HasSubstr("does not begin with a number"))
        << text;
  }
  EXPECT_THAT(messageOf([] { parseQuantity("", Dimension::length, "k"); }), HasSubstr("a value is missing"));
}

TEST(Units, InfinityWhereItHasAMeaning) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(parseQuantityOrInfinity("inf", Dimension::length, "k"), infinity);
  EXPECT_EQ(parseQuantityOrInfinity(".inf", Dimension::length, "k"), infinity);
  EXPECT_EQ(parseQuantityOrInfinity("-inf mm", Dimension::length, "k"), -infinity);
  EXPECT_EQ(parseQuantityOrInfinity("30 mm", Dimension::length, "k"), 0.03);
  EXPECT_THAT(messageOf([] { parseQuantityOrInfinity("inf deg", Dimension::length, "k"); }), HasSubstr("is an angle"));
  EXPECT_THAT(messageOf([] { parseQuantityOrInfinity("30", Dimension::length, "k"); }), HasSubstr("has no unit"));
}

TEST(Units, ScaledColumns) {
  EXPECT_EQ(parseScaledUnit("-1", "N", Dimension::force, "k"), -1);
  EXPECT_EQ(parseScaledUnit("686 N", "1", Dimension::force, "k"), 686);
  EXPECT_EQ(parseScaledUnit("-0.686 kN", "1", Dimension::force, "k"), -686);
  EXPECT_THAT(messageOf([] { parseScaledUnit("686 N", "N", Dimension::force, "k"); }), HasSubstr("a force is needed"));
  EXPECT_EQ(parseUnit("deg", Dimension::angle, "k"), contact::kPi / 180);
  EXPECT_THAT(messageOf([] { parseUnit("mm", Dimension::angle, "k"); }), HasSubstr("is the unit of a length"));
}

TEST(Units, FormatsAndReadsBack) {
  EXPECT_EQ(formatQuantity(463e6, "MPa"), "463 MPa");
  EXPECT_EQ(formatQuantity(0.0358, "mm"), "35.8 mm");
  EXPECT_THROW(formatQuantity(1, "furlong"), std::invalid_argument);
  for (const double value : {0.1, 1e-300, -2.5, 1.0 / 3, 6.02214076e23})
    EXPECT_EQ(parseNumber(formatNumber(value), "k"), value);
  EXPECT_THAT(messageOf([] { parseNumber("1 mm", "k"); }), HasSubstr("not a plain number"));
}

TEST(Units, SplitsLists) {
  EXPECT_THAT(splitList("0 deg, 1 mm ,, 3"), testing::ElementsAre("0 deg", "1 mm", "", "3"));
  EXPECT_THAT(splitList(""), testing::ElementsAre(""));
}

}  // namespace
}  // namespace genu::io
