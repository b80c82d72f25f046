#pragma once

#include <string>
#include <vector>

#include "genu/scene/Scene.h"

namespace genu::model {

/** A smooth function of time: a constant, or the interpolating cubic spline through a table.

 Table (t_i, y_i): piecewise cubic, twice continuously differentiable, S(t_i) = y_i, not-a-knot at both ends (the
 first two and the last two intervals share one cubic), so cubic data are reproduced exactly and the error is
 O(dt^4) up to the ends. Two points give a straight line, three a parabola. Nothing is made periodic. A spline can
 overshoot near a jump: give enough points there. Outside the table the end cubic continues; checkCovers() rejects
 runs that would use it.
 Units: those of the values, over seconds.
 Source: de Boor, A Practical Guide to Splines, 2001, ch. IV. */
class TimeCurve {
 public:
  /** @throws InputError when the table has fewer than two points, unequal columns, a value that is not finite or times
   that do not increase; the message names the table's source and the row */
  explicit TimeCurve(const scene::TimeFunction& function);

  bool isConstant() const { return time_.empty(); }
  double calcValue(double t_s) const { return calcDerivative(t_s, 0); }
  /** order 0, 1, 2 or 3; at a kink or jump, of what follows */
  double calcDerivative(double t_s, int order) const;
  scene::Interpolation interpolation() const { return interpolation_; }
  /** Times at which the curve jumps (step), has a kink (linear) or its third derivative jumps (spline). */
  std::vector<double> listBreaks() const;

  /** @throws InputError when the table does not reach from t0 to t1; `use` names what the table is for */
  void checkCovers(double t0_s, double t1_s, const std::string& use) const;

  /** How far the curve leaves the range of the table's values, as a share of that range, and where; 0 for a constant. */
  struct Overshoot {
    double share = 0, time_s = 0, value = 0;
  };
  Overshoot findOvershoot() const;
  const std::string& source() const { return source_; }

 private:
  std::vector<double> time_, value_, second_;  // second derivatives at the points
  scene::Interpolation interpolation_ = scene::Interpolation::spline;
  double constant_ = 0;
  std::string source_;
};

}  // namespace genu::model
