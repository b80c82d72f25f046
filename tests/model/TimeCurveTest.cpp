#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "genu/model/TimeCurve.h"

namespace genu::model {
namespace {

using ::testing::HasSubstr;

template <class F>
scene::TimeSeries sample(F f, double t0, double t1, int points) {
  scene::TimeSeries series;
  series.source = "motion.csv, column rz_deg";
  for (int i = 0; i < points; ++i) {
    const double t = t0 + (t1 - t0) * i / (points - 1);
    series.time_s.push_back(t);
    series.value.push_back(f(t));
  }
  return series;
}

template <class Function>
std::string inputErrorOf(Function f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}

TEST(TimeCurve, ConstantHasNoDerivatives) {
  const TimeCurve curve(0.3);
  EXPECT_TRUE(curve.isConstant());
  EXPECT_EQ(curve.calcValue(17), 0.3);
  EXPECT_EQ(curve.calcDerivative(17, 1), 0);
  EXPECT_EQ(curve.calcDerivative(17, 2), 0);
  EXPECT_NO_THROW(curve.checkCovers(-1e9, 1e9, "anything"));
}

// Not-a-knot ends reproduce a cubic exactly, on uneven points too; tolerance is rounding of values near 10.
TEST(TimeCurve, ReproducesCubicWithAllDerivatives) {
  const auto f = [](double t) { return 2 - 3 * t + 4 * t * t - 5 * t * t * t; };
  scene::TimeSeries series;
  for (double t : {0.0, 0.1, 0.35, 0.4, 0.8, 1.0}) {
    series.time_s.push_back(t);
    series.value.push_back(f(t));
  }
  const TimeCurve curve(series);
  for (double t : {0.0, 0.05, 0.1, 0.36, 0.77, 1.0, 1.01}) {
    EXPECT_NEAR(curve.calcValue(t), f(t), 1e-13);
    EXPECT_NEAR(curve.calcDerivative(t, 1), -3 + 8 * t - 15 * t * t, 1e-12);
    EXPECT_NEAR(curve.calcDerivative(t, 2), 8 - 30 * t, 1e-11);
    EXPECT_NEAR(curve.calcDerivative(t, 3), -30, 1e-10);
  }
}

TEST(TimeCurve, TwoPointsAreALineThreeAParabola) {
  const TimeCurve line(sample([](double t) { return 1 + 2 * t; }, 0, 1, 2));
  EXPECT_DOUBLE_EQ(line.calcValue(0.25), 1.5);
  EXPECT_DOUBLE_EQ(line.calcDerivative(0.25, 1), 2);
  const TimeCurve parabola(sample([](double t) { return t * t; }, 0, 1, 3));
  EXPECT_NEAR(parabola.calcValue(0.3), 0.09, 1e-15);
  EXPECT_NEAR(parabola.calcDerivative(0.9, 1), 1.8, 1e-14);
}

// Error O(dt^4) in the value and O(dt^2) in the second derivative up to both ends: halving dt must divide the largest
// error by 16 and 4; 15 % slack for the next term.
TEST(TimeCurve, ConvergesWithFourthOrderUpToTheEnds) {
  const auto largestError = [](int points, int order) {
    const TimeCurve curve(sample([](double t) { return std::sin(5 * t + 0.3); }, 0, 1, points));
    double error = 0;
    for (int i = 0; i <= 1000; ++i) {
      const double t = i / 1000.0;
      const double exact = order == 0 ? std::sin(5 * t + 0.3) : -25 * std::sin(5 * t + 0.3);
      error = std::max(error, std::abs(curve.calcDerivative(t, order) - exact));
    }
    return error;
  };
  EXPECT_GT(largestError(41, 0) / largestError(81, 0), 16 * 0.85);
  EXPECT_GT(largestError(41, 2) / largestError(81, 2), 4 * 0.85);
}

TEST(TimeCurve, IsTwiceContinuouslyDifferentiable) {
  const TimeCurve curve(sample([](double t) { return std::exp(std::sin(9 * t)); }, 0, 1, 12));
  for (int i = 1; i < 11; ++i) {
    const double t = i / 11.0, step = 1e-9;
    for (int order = 0; order <= 2; ++order) {
      // Jump across the knot minus what the next derivative explains.
      const double jump = curve.calcDerivative(t + step, order) - curve.calcDerivative(t - step, order);
      const double next = std::max(std::abs(curve.calcDerivative(t - step, order + 1)),
                                   std::abs(curve.calcDerivative(t + step, order + 1)));
      EXPECT_LT(std::abs(jump), 3 * step * next + 1e-11) << "knot " << i << ", derivative " << order;
    }
  }
}

// Against 20,000 samples, which miss an extreme by less than (h/2)^2 |S''| / 2 < 1e-6 here.
TEST(TimeCurve, FindsWhereItLeavesTheRangeOfItsTable) {
  EXPECT_EQ(TimeCurve{2.5}.findOvershoot().share, 0);
  EXPECT_LT(TimeCurve{sample([](double t) { return t; }, 0, 1, 7)}.findOvershoot().share, 1e-12);
  const auto step = [](double t) { return t < 0.5 ? -2.0 : 3.0; };
  const auto wave = [](double t) { return std::sin(11 * t); };
  for (const scene::TimeSeries& table : {sample(step, 0, 1, 8), sample(wave, 0, 1, 9), sample(wave, 0, 1, 3)}) {
    const TimeCurve curve(table);
    const auto [low, high] = std::minmax_element(table.value.begin(), table.value.end());
    double outside = 0;
    for (int i = 0; i <= 20000; ++i) {
      const double y = curve.calcValue(i / 20000.0);
      outside = std::max({outside, y - *high, *low - y});
    }
    const TimeCurve::Overshoot found = curve.findOvershoot();
    EXPECT_NEAR(found.share * (*high - *low), outside, 1e-6);
    if (found.share > 0) {
      EXPECT_EQ(curve.calcValue(found.time_s), found.value);
    }
  }
  EXPECT_GT(TimeCurve{sample(step, 0, 1, 8)}.findOvershoot().share, 0.1);
}

// Rows at 0, 1, 2 and 4 s; the slope changes at 1 and 2 s only.
TEST(TimeCurve, LinesAndStepsGoThroughTheirRows) {
  scene::TimeSeries series;
  series.time_s = {0, 1, 2, 4, 5};
  series.value = {0, 2, 1, 1, 1};
  series.interpolation = scene::Interpolation::linear;
  const TimeCurve line(series);
  EXPECT_DOUBLE_EQ(line.calcValue(0.25), 0.5);
  EXPECT_DOUBLE_EQ(line.calcValue(1), 2);
  EXPECT_DOUBLE_EQ(line.calcValue(1.5), 1.5);
  EXPECT_DOUBLE_EQ(line.calcDerivative(1, 1), -1);  // of what follows
  EXPECT_DOUBLE_EQ(line.calcDerivative(1.5, 2), 0);
  EXPECT_DOUBLE_EQ(line.calcValue(5), 1);
  EXPECT_EQ(line.listBreaks(), (std::vector<double>{1, 2}));
  EXPECT_EQ(line.findOvershoot().share, 0);
  series.interpolation = scene::Interpolation::step;
  const TimeCurve steps(series);
  EXPECT_EQ(steps.calcValue(0.999), 0);
  EXPECT_EQ(steps.calcValue(1), 2);
  EXPECT_EQ(steps.calcValue(std::nextafter(1.0, 0.0)), 0);
  EXPECT_EQ(steps.calcValue(3), 1);
  EXPECT_EQ(steps.calcValue(5), 1);
  EXPECT_EQ(steps.calcDerivative(1.5, 1), 0);
  EXPECT_EQ(steps.listBreaks(), (std::vector<double>{1, 2}));
  series.interpolation = scene::Interpolation::spline;
  // Not-a-knot: no break in the row beside an end.
  EXPECT_EQ(TimeCurve(series).listBreaks(), (std::vector<double>{2}));
  EXPECT_TRUE(TimeCurve(3.0).listBreaks().empty());
}

TEST(TimeCurve, RejectsBadTablesNamingSourceAndRow) {
  scene::TimeSeries series = sample([](double t) { return t; }, 0, 1, 5);
  series.value[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(inputErrorOf([&] { TimeCurve{series}; }),
              ::testing::AllOf(HasSubstr("motion.csv, column rz_deg"), HasSubstr("row 4"), HasSubstr("not a finite")));
  series.value[3] = 0;
  series.time_s[3] = series.time_s[2];
  EXPECT_THAT(inputErrorOf([&] { TimeCurve{series}; }), ::testing::AllOf(HasSubstr("row 4"), HasSubstr("increase")));
  series.time_s.resize(1);
  EXPECT_THAT(inputErrorOf([&] { TimeCurve{series}; }), HasSubstr("1 times but 5 values"));
  series.value.resize(1);
  EXPECT_THAT(inputErrorOf([&] { TimeCurve{series}; }), HasSubstr("at least 2"));
}

TEST(TimeCurve, RejectsTableThatEndsBeforeTheRun) {
  const TimeCurve curve(sample([](double t) { return t; }, 0, 0.9, 5));
  EXPECT_NO_THROW(curve.checkCovers(0, 0.9, "load"));
  EXPECT_THAT(inputErrorOf([&] { curve.checkCovers(0, 1, "load 'vertical'"); }),
              ::testing::AllOf(HasSubstr("rz_deg"), HasSubstr("load 'vertical'"), HasSubstr("0 s to 0.9 s"),
                               HasSubstr("0 s to 1 s")));
}

}  // namespace
}  // namespace genu::model
