#include "genu/contact/NurbsPatch.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "detail/PatchKernel.h"

namespace genu::contact {

namespace {

constexpr int kMaxDegree = 5;

[[noreturn]] void fail(const std::string& message) { throw std::invalid_argument("NURBS patch: " + message); }

template <class T>
std::string text(const T& value) {
  std::ostringstream out;
  out.precision(10);
  out << value;
  return out.str();
}

void checkKnots(const char* name, const std::vector<double>& knots, int degree, int num) {
  const size_t wanted = static_cast<size_t>(num + degree + 1);
  if (knots.size() != wanted) {
    fail(std::string(name) + " has " + text(knots.size()) + " values; needed: number of points + degree + 1 = " +
         text(wanted));
  }
  int multiplicity = 1;
  for (size_t i = 0; i < knots.size(); ++i) {
    if (!std::isfinite(knots[i])) fail(std::string(name) + "[" + text(i) + "] is not a finite number");
    if (i == 0) continue;
    if (knots[i] < knots[i - 1]) {
      fail(std::string(name) + " must not decrease: [" + text(i) + "] = " + text(knots[i]) + " follows " +
           text(knots[i - 1]));
    }
    multiplicity = knots[i] == knots[i - 1] ? multiplicity + 1 : 1;
    const bool inside = knots[i] > knots[static_cast<size_t>(degree)] && knots[i] < knots[static_cast<size_t>(num)];
    const int allowed = inside ? degree : degree + 1;
    if (multiplicity > allowed) {
      fail(std::string(name) + ": value " + text(knots[i]) + " occurs " + text(multiplicity) + " times; allowed: " +
           text(allowed) + (inside ? " (degree, inside the domain)" : " (degree + 1, at an end)"));
    }
  }
  if (!(knots[static_cast<size_t>(num)] > knots[static_cast<size_t>(degree)])) {
    fail(std::string(name) + ": the domain [knots[degree], knots[number of points]] is empty");
  }
}

std::vector<double> findBreaks(const std::vector<double>& knots, int degree, int num) {
  std::vector<double> breaks;
  for (int i = degree; i <= num; ++i) {
    const double k = knots[static_cast<size_t>(i)];
    if (breaks.empty() || k > breaks.back()) breaks.push_back(k);
  }
  return breaks;
}

/** Index of the knot span that holds t (Piegl & Tiller A2.1). */
int findKnotSpan(const std::vector<double>& knots, int degree, int num, double t) {
  if (t >= knots[static_cast<size_t>(num)]) {
    int i = num - 1;
    while (knots[static_cast<size_t>(i)] == knots[static_cast<size_t>(i + 1)]) --i;
    return i;
  }
  const auto begin = knots.begin() + degree;
  const auto it = std::upper_bound(begin, knots.begin() + num + 1, t);
  return std::max(degree, static_cast<int>(it - knots.begin()) - 1);
}

/** Nonzero basis functions and derivatives up to `order` (Piegl & Tiller A2.3): ders[k][j]. */
using BasisTable = std::array<std::array<double, kMaxDegree + 1>, kMaxDegree + 1>;
BasisTable calcBasis(const std::vector<double>& knots, int span, double t, int p, int order) {
  double ndu[kMaxDegree + 1][kMaxDegree + 1];
  double left[kMaxDegree + 1], right[kMaxDegree + 1];
  ndu[0][0] = 1;
  for (int j = 1; j <= p; ++j) {
    left[j] = t - knots[static_cast<size_t>(span + 1 - j)];
    right[j] = knots[static_cast<size_t>(span + j)] - t;
    double saved = 0;
    for (int r = 0; r < j; ++r) {
      ndu[j][r] = right[r + 1] + left[j - r];
      const double temp = ndu[r][j - 1] / ndu[j][r];
      ndu[r][j] = saved + right[r + 1] * temp;
      saved = left[j - r] * temp;
    }
    ndu[j][j] = saved;
  }
  BasisTable ders{};
  for (int j = 0; j <= p; ++j) ders[0][static_cast<size_t>(j)] = ndu[j][p];
  for (int r = 0; r <= p; ++r) {
    int s1 = 0, s2 = 1;
    double a[2][kMaxDegree + 1] = {};
    a[0][0] = 1;
    for (int k = 1; k <= std::min(order, p); ++k) {
      double d = 0;
      const int rk = r - k, pk = p - k;
      if (r >= k) {
        a[s2][0] = a[s1][0] / ndu[pk + 1][rk];
        d = a[s2][0] * ndu[rk][pk];
      }
      const int j1 = rk >= -1 ? 1 : -rk;
      const int j2 = r - 1 <= pk ? k - 1 : p - r;
      for (int j = j1; j <= j2; ++j) {
        a[s2][j] = (a[s1][j] - a[s1][j - 1]) / ndu[pk + 1][rk + j];
        d += a[s2][j] * ndu[rk + j][pk];
      }
      if (r <= pk) {
        a[s2][k] = -a[s1][k - 1] / ndu[pk + 1][r];
        d += a[s2][k] * ndu[r][pk];
      }
      ders[static_cast<size_t>(k)][static_cast<size_t>(r)] = d;
      std::swap(s1, s2);
    }
  }
  double factor = p;
  for (int k = 1; k <= std::min(order, p); ++k) {
    for (int j = 0; j <= p; ++j) ders[static_cast<size_t>(k)][static_cast<size_t>(j)] *= factor;
    factor *= p - k;
  }
  return ders;
}

using Homogeneous = Eigen::Vector4d;

/** Derivative (k, l) of the homogeneous surface at the point whose basis tables are given. */
Homogeneous sumHomogeneous(const NurbsPatchData& data, int spanU, int spanV, const std::array<double, kMaxDegree + 1>& nu,
                           const std::array<double, kMaxDegree + 1>& nv) {
  Homogeneous sum = Homogeneous::Zero();
  for (int i = 0; i <= data.degreeU; ++i) {
    for (int j = 0; j <= data.degreeV; ++j) {
      const size_t at = static_cast<size_t>(spanU - data.degreeU + i) * static_cast<size_t>(data.numV) +
                        static_cast<size_t>(spanV - data.degreeV + j);
      const double w = data.weights.empty() ? 1.0 : data.weights[at];
      Homogeneous point;
      point << w * data.points[at], w;
      sum += nu[static_cast<size_t>(i)] * nv[static_cast<size_t>(j)] * point;
    }
  }
  return sum;
}

bool rowsCoincide(const NurbsPatchData& data, bool alongU) {
  const int count = alongU ? data.numV : data.numU;
  const int last = (alongU ? data.numU : data.numV) - 1;
  double size = 0;
  for (const Vec3& p : data.points) size = std::max(size, (p - data.points[0]).norm());
  double spread = 0;
  for (int k = 0; k < count; ++k) {
    const size_t first = alongU ? static_cast<size_t>(k) : static_cast<size_t>(k) * static_cast<size_t>(data.numV);
    const size_t end = alongU ? static_cast<size_t>(last) * static_cast<size_t>(data.numV) + static_cast<size_t>(k)
                              : static_cast<size_t>(k) * static_cast<size_t>(data.numV) + static_cast<size_t>(last);
    if ((data.points[first] - data.points[end]).norm() > 1e-12 * size) return false;
    if (data.isRational() && std::abs(data.weights[first] - data.weights[end]) > 1e-12) return false;
    spread = std::max(spread, (data.points[first] - data.points[0]).norm());
  }
  return spread > 0;
}

/** Wrapping needs a tangent that is continuous across the seam, else the seam is a sharp border. */
bool tangentsAgree(const SurfaceDerivatives& a, const SurfaceDerivatives& b, bool alongU) {
  const Vec3 ta = alongU ? a.Su : a.Sv, tb = alongU ? b.Su : b.Sv;
  const double scale = std::max(ta.norm(), tb.norm());
  return scale == 0 || ta.cross(tb).norm() <= 1e-9 * scale * scale;
}

double wrapInto(double t, double lo, double hi) {
  if (t >= lo && t <= hi) return t;
  const double period = hi - lo;
  t -= period * std::floor((t - lo) / period);
  return std::min(std::max(t, lo), hi);
}

}  // namespace

void NurbsPatchData::validate() const {
  if (degreeU < 1 || degreeU > kMaxDegree) fail("degree in u is " + text(degreeU) + "; allowed: 1 to 5");
  if (degreeV < 1 || degreeV > kMaxDegree) fail("degree in v is " + text(degreeV) + "; allowed: 1 to 5");
  if (numU < degreeU + 1) fail("number of points in u is " + text(numU) + "; needed: at least degree + 1 = " + text(degreeU + 1));
  if (numV < degreeV + 1) fail("number of points in v is " + text(numV) + "; needed: at least degree + 1 = " + text(degreeV + 1));
  const size_t count = static_cast<size_t>(numU) * static_cast<size_t>(numV);
  if (points.size() != count) fail("has " + text(points.size()) + " points; needed: " + text(count));
  for (size_t i = 0; i < count; ++i) {
    if (!points[i].allFinite()) fail("point " + text(i) + " is not finite");
  }
  bool coincide = true;
  for (const Vec3& p : points) coincide = coincide && p == points[0];
  if (coincide) fail("all points coincide");
  if (!weights.empty()) {
    if (weights.size() != count) fail("has " + text(weights.size()) + " weights; needed: " + text(count) + " or none");
    for (size_t i = 0; i < count; ++i) {
      if (!(weights[i] > 0) || !std::isfinite(weights[i])) {
        fail("weight " + text(i) + " is " + text(weights[i]) + "; allowed: finite and > 0");
      }
    }
  }
  checkKnots("knots_u", knotsU, degreeU, numU);
  checkKnots("knots_v", knotsV, degreeV, numV);
}

NurbsPatch::NurbsPatch(NurbsPatchData data) : data_(std::move(data)) {
  data_.validate();
  breaksU_ = findBreaks(data_.knotsU, data_.degreeU, data_.numU);
  breaksV_ = findBreaks(data_.knotsV, data_.degreeV, data_.numV);
  uMin_ = breaksU_.front();
  uMax_ = breaksU_.back();
  vMin_ = breaksV_.front();
  vMax_ = breaksV_.back();

  const auto makeSpans = [](const std::vector<double>& breaks) {
    std::vector<Span> spans;
    for (size_t i = 0; i + 1 < breaks.size(); ++i) {
      spans.push_back({0.5 * (breaks[i] + breaks[i + 1]), 2.0 / (breaks[i + 1] - breaks[i])});
    }
    return spans;
  };
  spansU_ = makeSpans(breaksU_);
  spansV_ = makeSpans(breaksV_);

  const int pu = data_.degreeU, pv = data_.degreeV;
  spanStride_ = static_cast<size_t>((pu + 1) * (pv + 1) * 4);
  coefficients_.resize(spanStride_ * spansU_.size() * spansV_.size());
  double* out = coefficients_.data();
  for (const Span& su : spansU_) {
    const int spanU = findKnotSpan(data_.knotsU, pu, data_.numU, su.center);
    const BasisTable nu = calcBasis(data_.knotsU, spanU, su.center, pu, pu);
    for (const Span& sv : spansV_) {
      const int spanV = findKnotSpan(data_.knotsV, pv, data_.numV, sv.center);
      const BasisTable nv = calcBasis(data_.knotsV, spanV, sv.center, pv, pv);
      double fu = 1;  // halfWidth^a / a!
      for (int a = 0; a <= pu; ++a) {
        double fv = 1;
        for (int b = 0; b <= pv; ++b) {
          const Homogeneous h =
              fu * fv * sumHomogeneous(data_, spanU, spanV, nu[static_cast<size_t>(a)], nv[static_cast<size_t>(b)]);
          for (int k = 0; k < 4; ++k) *out++ = h[k];
          fv /= sv.invHalfWidth * (b + 1);
        }
        fu /= su.invHalfWidth * (a + 1);
      }
    }
  }

  if (rowsCoincide(data_, true)) {
    const double v = 0.5 * (vMin_ + vMax_);
    closedU_ = tangentsAgree(evaluate(uMin_, v), evaluate(uMax_, v), true);
  }
  if (rowsCoincide(data_, false)) {
    const double u = 0.5 * (uMin_ + uMax_);
    closedV_ = tangentsAgree(evaluate(u, vMin_), evaluate(u, vMax_), false);
  }
}

int NurbsPatch::findSpan(const std::vector<double>& breaks, double t) {
  int i = 0;
  const int last = static_cast<int>(breaks.size()) - 2;
  // A linear walk beats a binary search for the dozen spans of a condyle; the branch count is bounded for larger ones.
  if (last > 24) {
    const auto it = std::upper_bound(breaks.begin() + 1, breaks.end() - 1, t);
    return static_cast<int>(it - breaks.begin()) - 1;
  }
  while (i < last && t >= breaks[static_cast<size_t>(i) + 1]) ++i;
  return i;
}

SurfaceDerivatives NurbsPatch::evaluate(double u, double v) const {
  u = closedU_ ? wrapInto(u, uMin_, uMax_) : std::min(std::max(u, uMin_), uMax_);
  v = closedV_ ? wrapInto(v, vMin_, vMax_) : std::min(std::max(v, vMin_), vMax_);
  SurfaceDerivatives d;
  detail::evaluatePatch(*this, u, v, d);
  return d;
}

Vec3 NurbsPatch::calcPoint(double u, double v) const { return evaluate(u, v).S; }

Vec3 NurbsPatch::calcNormal(double u, double v) const {
  const SurfaceDerivatives d = evaluate(u, v);
  Vec3 n = d.Su.cross(d.Sv);
  const double scale = std::max(d.Su.squaredNorm(), d.Sv.squaredNorm());
  if (n.norm() <= 1e-9 * scale) {
    // A pole: the shrunken tangent grows like its mixed derivative on the way into the patch.
    const bool uShrinks = d.Su.squaredNorm() < d.Sv.squaredNorm();
    const double inward = uShrinks ? (v < 0.5 * (vMin_ + vMax_) ? 1.0 : -1.0) : (u < 0.5 * (uMin_ + uMax_) ? 1.0 : -1.0);
    n = uShrinks ? Vec3(inward * d.Suv.cross(d.Sv)) : Vec3(inward * d.Su.cross(d.Suv));
  }
  return normalSign() * n.normalized();
}

SurfaceDerivatives NurbsPatch::evaluateByBasisFunctions(double u, double v) const {
  u = std::min(std::max(u, uMin_), uMax_);
  v = std::min(std::max(v, vMin_), vMax_);
  const int spanU = findKnotSpan(data_.knotsU, data_.degreeU, data_.numU, u);
  const int spanV = findKnotSpan(data_.knotsV, data_.degreeV, data_.numV, v);
  const BasisTable nu = calcBasis(data_.knotsU, spanU, u, data_.degreeU, 2);
  const BasisTable nv = calcBasis(data_.knotsV, spanV, v, data_.degreeV, 2);
  const auto A = [&](size_t k, size_t l) { return sumHomogeneous(data_, spanU, spanV, nu[k], nv[l]); };
  const Homogeneous a00 = A(0, 0), a10 = A(1, 0), a01 = A(0, 1), a20 = A(2, 0), a11 = A(1, 1), a02 = A(0, 2);
  const double w = a00[3];
  SurfaceDerivatives d;
  d.S = a00.head<3>() / w;
  d.Su = (a10.head<3>() - a10[3] * d.S) / w;
  d.Sv = (a01.head<3>() - a01[3] * d.S) / w;
  d.Suu = (a20.head<3>() - 2 * a10[3] * d.Su - a20[3] * d.S) / w;
  d.Suv = (a11.head<3>() - a10[3] * d.Sv - a01[3] * d.Su - a11[3] * d.S) / w;
  d.Svv = (a02.head<3>() - 2 * a01[3] * d.Sv - a02[3] * d.S) / w;
  return d;
}

NurbsPatch NurbsPatch::transformed(const Pose& X_AB) const {
  NurbsPatchData data = data_;
  for (Vec3& p : data.points) p = X_AB.apply(p);
  return NurbsPatch(std::move(data));
}

NurbsPatch NurbsPatch::flipped() const {
  NurbsPatchData data = data_;
  data.flipNormal = !data.flipNormal;
  return NurbsPatch(std::move(data));
}

}  // namespace genu::contact
