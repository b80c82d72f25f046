#include "genu/model/TimeCurve.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace genu::model {

namespace {

std::string rowText(const std::string& source, size_t row) {
  std::ostringstream text;
  text << source << ", data row " << row + 1 << ": ";
  return text.str();
}

/** Second derivatives of the not-a-knot spline at the points: the tridiagonal system of the inner points with the end
 values M0 = M1 + (h0/h1)(M1 - M2) and its mirror image eliminated. */
std::vector<double> solveSecondDerivatives(const std::vector<double>& t, const std::vector<double>& y) {
  const size_t n = t.size();
  std::vector<double> m(n, 0.0);
  if (n == 2) return m;
  std::vector<double> h(n - 1), slope(n - 1);
  for (size_t i = 0; i + 1 < n; ++i) {
    h[i] = t[i + 1] - t[i];
    slope[i] = (y[i + 1] - y[i]) / h[i];
  }
  if (n == 3) {
    std::fill(m.begin(), m.end(), 2 * (slope[1] - slope[0]) / (h[0] + h[1]));
    return m;
  }
  std::vector<double> lower(n, 0.0), diagonal(n, 0.0), upper(n, 0.0), right(n, 0.0);
  for (size_t i = 1; i + 1 < n; ++i) {
    lower[i] = h[i - 1];
    diagonal[i] = 2 * (h[i - 1] + h[i]);
    upper[i] = h[i];
    right[i] = 6 * (slope[i] - slope[i - 1]);
  }
  const double a = h[0] / h[1], b = h[n - 2] / h[n - 3];
  diagonal[1] += h[0] * (1 + a);
  upper[1] -= h[0] * a;
  diagonal[n - 2] += h[n - 2] * (1 + b);
  lower[n - 2] -= h[n - 2] * b;
  for (size_t i = 2; i + 1 < n; ++i) {
    const double factor = lower[i] / diagonal[i - 1];
    diagonal[i] -= factor * upper[i - 1];
    right[i] -= factor * right[i - 1];
  }
  m[n - 2] = right[n - 2] / diagonal[n - 2];
  for (size_t i = n - 3; i >= 1; --i) m[i] = (right[i] - upper[i] * m[i + 1]) / diagonal[i];
  m[0] = (1 + a) * m[1] - a * m[2];
  m[n - 1] = (1 + b) * m[n - 2] - b * m[n - 3];
  return m;
}

}  // namespace

TimeCurve::TimeCurve(const scene::TimeFunction& function) {
  if (const double* constant = std::get_if<double>(&function)) {
    constant_ = *constant;
    if (!std::isfinite(constant_)) throw InputError("a constant in the scene is not a finite number");
    return;
  }
  const scene::TimeSeries& series = std::get<scene::TimeSeries>(function);
  source_ = series.source.empty() ? "table" : series.source;
  if (series.time_s.size() != series.value.size()) {
    throw InputError(source_ + ": " + std::to_string(series.time_s.size()) + " times but " +
                     std::to_string(series.value.size()) + " values");
  }
  if (series.time_s.size() < 2) {
    throw InputError(source_ + ": has " + std::to_string(series.time_s.size()) +
                     " row(s); a curve over time needs at least 2 (give a constant instead)");
  }
  for (size_t i = 0; i < series.time_s.size(); ++i) {
    if (!std::isfinite(series.time_s[i]) || !std::isfinite(series.value[i])) {
      throw InputError(rowText(source_, i) + "time or value is not a finite number");
    }
    if (i > 0 && !(series.time_s[i] > series.time_s[i - 1])) {
      std::ostringstream text;
      text << rowText(source_, i) << "time " << series.time_s[i] << " s does not increase (previous "
           << series.time_s[i - 1] << " s)";
      throw InputError(text.str());
    }
  }
  time_ = series.time_s;
  value_ = series.value;
  interpolation_ = series.interpolation;
  if (interpolation_ == scene::Interpolation::spline) second_ = solveSecondDerivatives(time_, value_);
}

std::vector<double> TimeCurve::listBreaks() const {
  std::vector<double> breaks;
  if (interpolation_ == scene::Interpolation::spline) {
    for (size_t i = 1; i + 1 < time_.size(); ++i) {
      const double before = (second_[i] - second_[i - 1]) / (time_[i] - time_[i - 1]), after = (second_[i + 1] - second_[i]) / (time_[i + 1] - time_[i]);
      if (std::abs(after - before) > 1e-9 * (std::abs(after) + std::abs(before))) breaks.push_back(time_[i]);
    }
    return breaks;
  }
  const bool jumps = interpolation_ == scene::Interpolation::step;
  for (size_t i = 1; i + 1 < time_.size() || (jumps && i < time_.size()); ++i) {
    const double before = value_[i] - value_[i - 1];
    if (jumps) {
      if (before != 0) breaks.push_back(time_[i]);
      continue;
    }
    const double left = before / (time_[i] - time_[i - 1]), right = (value_[i + 1] - value_[i]) / (time_[i + 1] - time_[i]);
    if (std::abs(right - left) > 1e-9 * (std::abs(left) + std::abs(right))) breaks.push_back(time_[i]);
  }
  return breaks;
}

double TimeCurve::calcDerivative(double t, int order) const {
  if (isConstant()) return order == 0 ? constant_ : 0.0;
  if (interpolation_ == scene::Interpolation::step) {
    if (order > 0) return 0.0;
    const auto next = std::upper_bound(time_.begin() + 1, time_.end(), t);
    return value_[static_cast<size_t>(next - time_.begin()) - 1];
  }
  const auto upper = std::upper_bound(time_.begin() + 1, time_.end() - 1, t);
  const size_t i = static_cast<size_t>(upper - time_.begin()) - 1;
  const double h = time_[i + 1] - time_[i], s = t - time_[i];
  if (interpolation_ == scene::Interpolation::linear) {
    const double slope = (value_[i + 1] - value_[i]) / h;
    return order == 0 ? value_[i] + s * slope : order == 1 ? slope : 0.0;
  }
  const double m0 = second_[i], third = (second_[i + 1] - m0) / h;
  const double slope = (value_[i + 1] - value_[i]) / h - h * (2 * m0 + second_[i + 1]) / 6;
  switch (order) {
    case 0:
      return value_[i] + s * (slope + s * (m0 / 2 + s * third / 6));
    case 1:
      return slope + s * (m0 + s * third / 2);
    case 2:
      return m0 + s * third;
    default:
      return order == 3 ? third : 0.0;
  }
}

TimeCurve::Overshoot TimeCurve::findOvershoot() const {
  Overshoot worst;
  if (isConstant() || interpolation_ != scene::Interpolation::spline) return worst;
  const auto [low, high] = std::minmax_element(value_.begin(), value_.end());
  const double range = *high - *low;
  for (size_t i = 0; range > 0 && i + 1 < time_.size(); ++i) {
    const double h = time_[i + 1] - time_[i], m0 = second_[i], third = (second_[i + 1] - m0) / h;
    const double slope = calcDerivative(time_[i], 1);
    // Extremes within the interval: slope + m0 s + third s^2 / 2 = 0, by the form that does not cancel.
    const double discriminant = m0 * m0 - 2 * third * slope;
    if (discriminant < 0) continue;
    const double q = -(m0 + std::copysign(std::sqrt(discriminant), m0));
    for (const double s : {q / third, 2 * slope / q}) {
      if (!(s > 0 && s < h)) continue;
      const double t = time_[i] + s, y = calcValue(t), share = std::max(y - *high, *low - y) / range;
      if (share > worst.share) worst = {share, t, y};
    }
  }
  return worst;
}

void TimeCurve::checkCovers(double t0, double t1, const std::string& use) const {
  if (isConstant()) return;
  // A table written with rounded times may end short of the run by its last digit.
  const double slack = 1e-9 * std::max(1.0, std::abs(t1));
  if (time_.front() <= t0 + slack && time_.back() >= t1 - slack) return;
  std::ostringstream text;
  text << source_ << " (" << use << "): the table covers " << time_.front() << " s to " << time_.back()
       << " s, but the run needs " << t0 << " s to " << t1 << " s; extend the table or shorten the run";
  throw InputError(text.str());
}

}  // namespace genu::model
