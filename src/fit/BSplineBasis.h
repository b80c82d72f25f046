#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace genu::fit {

/** Cubic B-spline basis over clamped knots: the rows of the least-squares system. Surfaces themselves are evaluated by
 contact::NurbsPatch. */
class CubicBasis {
 public:
  struct Row {
    int first = 0;  ///< index of the first of four functions that are not zero
    std::array<double, 4> N{}, dN{}, ddN{};
  };

  CubicBasis(double min, double max, int numFunctions);  ///< uniform spans

  int numFunctions() const { return static_cast<int>(knots_.size()) - 4; }
  double min() const { return knots_.front(); }
  double max() const { return knots_.back(); }
  const std::vector<double>& knots() const { return knots_; }
  std::vector<double> breaks() const { return {knots_.begin() + 3, knots_.end() - 3}; }
  int findSpan(double t) const;  ///< 0 .. numFunctions - 4; simple inner knots only
  void insertKnot(double t);
  Row calc(double t) const;

 private:
  std::vector<double> knots_;
};

}  // namespace genu::fit
