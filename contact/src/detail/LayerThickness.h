#pragma once

#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "genu/contact/ContactPair.h"

namespace genu::contact::detail {

template <class... Args>
[[noreturn]] void fail(const Args&... args) {
  std::ostringstream out;
  out.precision(10);
  (out << ... << args);
  throw std::invalid_argument(out.str());
}

/** Thickness seen from one point of a contact surface; NaN where the back surface is missed. */
double measureThickness(const Thickness& thickness, const Vec3& point, const Vec3& normal, std::vector<LineHit>& hits);

/** Clamps; returns whether the value was changed. */
bool clampThickness(const Thickness& thickness, double& h);

/** @throws std::invalid_argument naming the body, the value and what is allowed */
void validateThickness(const char* body, const Thickness& thickness);

/** Layer of the moving body over (u, v) of each patch, sampled once, bilinear in between [BF2004 §2.2]. */
class ThicknessMap {
 public:
  ThicknessMap(const char* body, const ContactSurface& surface, const Thickness& thickness, ThicknessMapReport& report);

  /** h and its slopes with respect to u and v; NaN next to a missing sample. */
  double interpolate(int patch, double u, double v, double& dhdu, double& dhdv) const {
    const Map& m = maps_[static_cast<size_t>(patch)];
    const double s = (u - m.u0) * m.scaleU, t = (v - m.v0) * m.scaleV;
    const int i = findPiece(u, m.u0, m.scaleU, m.nu), j = findPiece(v, m.v0, m.scaleV, m.nv);
    const double a = s - i, b = t - j;
    const double* h = m.h.data() + static_cast<size_t>(i) * static_cast<size_t>(m.nv) + static_cast<size_t>(j);
    const double low = (1 - b) * h[0] + b * h[1], high = (1 - b) * h[m.nv] + b * h[m.nv + 1];
    dhdu = (high - low) * m.scaleU;
    dhdv = ((1 - a) * (h[1] - h[0]) + a * (h[m.nv + 1] - h[m.nv])) * m.scaleV;
    return (1 - a) * low + a * high;
  }
  /** d2h/du dv, constant between samples. */
  double calcMixedSlope(int patch, double u, double v) const {
    const Map& m = maps_[static_cast<size_t>(patch)];
    const double* h = m.h.data() + static_cast<size_t>(findPiece(u, m.u0, m.scaleU, m.nu)) * static_cast<size_t>(m.nv) +
                      static_cast<size_t>(findPiece(v, m.v0, m.scaleV, m.nv));
    return ((h[m.nv + 1] - h[m.nv]) - (h[1] - h[0])) * m.scaleU * m.scaleV;
  }
  double interpolate(const SurfaceParameter& at) const {
    double dhdu, dhdv;
    return interpolate(at.patch, at.u, at.v, dhdu, dhdv);
  }
  bool hasHoles() const { return hasHoles_; }
  /** A rectangle u0, u1, v0, v1 of a patch without holes, as large as cutting each from its nearest side leaves it; empty
   (u0 > u1) where nothing is left. */
  std::array<double, 4> findFullRectangle(int patch) const;

 private:
  /** Number of the piece between samples that x lies in. */
  static int findPiece(double x, double from, double scale, int samples) {
    return std::min(std::max(static_cast<int>((x - from) * scale), 0), samples - 2);
  }
  struct Map {
    int nu, nv;
    double u0, v0, scaleU, scaleV;
    std::vector<double> h;
  };
  std::vector<Map> maps_;
  bool hasHoles_ = false;
};

}  // namespace genu::contact::detail
