#include "SweptSurface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace genu::make_models {

namespace {

/** Gauss-Legendre with 8 points on [-1, 1] (Abramowitz & Stegun, table 25.4). */
constexpr std::array<double, 4> kNodes = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                          0.9602898564975363};
constexpr std::array<double, 4> kWeights = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                            0.1012285362903763};

}  // namespace

SagittalCurve::SagittalCurve(double start_rad, std::vector<Arc> arcs, double blend_rad)
    : start_(start_rad), arcs_(std::move(arcs)), blend_(blend_rad) {
  double previous = start_;
  for (const Arc& arc : arcs_) {
    if (!(arc.end_rad - previous > 2 * blend_)) throw std::invalid_argument("arc shorter than its blends");
    previous = arc.end_rad;
  }
  breaks_.push_back(start_);
  for (size_t i = 0; i + 1 < arcs_.size(); ++i) {
    breaks_.push_back(arcs_[i].end_rad - blend_);
    if (blend_ > 0) breaks_.push_back(arcs_[i].end_rad + blend_);
  }
  breaks_.push_back(end());
  points_.push_back(Vec2::Zero());
  for (size_t i = 0; i + 1 < breaks_.size(); ++i) {
    // calcPoint needs points_[i] only, so the table grows from itself.
    points_.push_back(calcPoint(breaks_[i + 1]));
  }
}

double SagittalCurve::calcRadius(double phi) const {
  double radius = arcs_.front().radius_mm;
  for (size_t i = 0; i + 1 < arcs_.size(); ++i) {
    double share = phi < arcs_[i].end_rad ? 0 : 1;
    if (blend_ > 0) {
      const double s = std::clamp((phi - arcs_[i].end_rad) / (2 * blend_) + 0.5, 0.0, 1.0);
      share = s * s * s * (10 + s * (6 * s - 15));
    }
    radius += share * (arcs_[i + 1].radius_mm - arcs_[i].radius_mm);
  }
  return radius;
}

Vec2 SagittalCurve::calcPoint(double phi) const {
  size_t i = 0;
  while (i + 1 < points_.size() && i + 2 < breaks_.size() && breaks_[i + 1] < phi) ++i;
  const double from = breaks_[i];
  // Panels of at most 5 degrees: the rule is then exact to rounding.
  const int panels = std::max(1, static_cast<int>(std::ceil(std::abs(phi - from) / (5 * kDegree))));
  const double half = (phi - from) / (2 * panels);
  Vec2 sum = Vec2::Zero();
  for (int k = 0; k < panels; ++k) {
    const double mid = from + (2 * k + 1) * half;
    for (size_t j = 0; j < kNodes.size(); ++j) {
      for (const double sign : {-1.0, 1.0}) {
        const double at = mid + sign * half * kNodes[j];
        sum += half * kWeights[j] * calcRadius(at) * Vec2(std::cos(at), std::sin(at));
      }
    }
  }
  return shift_ + (points_[i] + sum);
}

void SagittalCurve::placeArc(size_t index, const Vec2& center_mm) {
  shift_.setZero();
  const double begin = index == 0 ? start_ : arcs_[index - 1].end_rad;
  const double middle = 0.5 * (begin + arcs_[index].end_rad);
  shift_ = center_mm - (calcPoint(middle) - arcs_[index].radius_mm * calcNormal(middle));
}

CanalPoint calcCanalPoint(const Vec2& P, const Vec2& n, double r, double z0, double psi) {
  const double c = std::cos(psi), s = std::sin(psi);
  const Vec2 S = P - r * (1 - c) * n;
  return {{S.x(), S.y(), z0 + r * s}, {c * n.x(), c * n.y(), s}};
}

}  // namespace genu::make_models
