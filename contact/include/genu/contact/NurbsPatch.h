#pragma once

#include <string>
#include <vector>

#include "genu/contact/Types.h"

namespace genu::contact {

/** Definition of one untrimmed tensor-product NURBS patch (Piegl & Tiller, The NURBS Book, 1997, eq. 4.11):

     S(u,v) = sum_ij N_i,p(u) N_j,q(v) w_ij P_ij / sum_ij N_i,p(u) N_j,q(v) w_ij

 degreeU, degreeV   1..5
 knotsU, knotsV     non-decreasing, numU + degreeU + 1 and numV + degreeV + 1 values, any scale; the domain is
                    [knots[p], knots[n]]; inner multiplicity at most the degree (a continuous surface)
 points             P_ij at [i * numV + j], [m]
 weights            same order, > 0; empty means all 1 (polynomial patch)
 flipNormal         the outward normal is S_u x S_v; true turns it around

 A direction is closed (it wraps) when the first and last rows of points and weights coincide. An edge that
 shrinks to one point (a pole) is allowed. */
struct NurbsPatchData {
  int degreeU = 3, degreeV = 3;
  int numU = 0, numV = 0;
  std::vector<double> knotsU, knotsV;
  std::vector<Vec3> points;
  std::vector<double> weights;
  bool flipNormal = false;

  bool isRational() const { return !weights.empty(); }
  /** @throws std::invalid_argument naming the offending quantity, its value and what is allowed. */
  void validate() const;
};

/** Position and derivatives at one (u, v). Derivatives are with respect to u and v of the definition. */
struct SurfaceDerivatives {
  Vec3 S, Su, Sv, Suu, Suv, Svv;
};

/** One patch, converted at construction to a power basis per knot span (centred and scaled to [-1, 1], homogeneous
 coordinates when rational) so that an evaluation with two derivatives costs tens of nanoseconds. Immutable,
 thread-safe. The conversion is exact up to rounding: coefficients come from the B-spline's own derivatives at the
 span's centre. At a knot of reduced continuity the span above is used. */
class NurbsPatch {
 public:
  /** @throws std::invalid_argument, see NurbsPatchData::validate */
  explicit NurbsPatch(NurbsPatchData data);

  const NurbsPatchData& data() const { return data_; }
  double uMin() const { return uMin_; }
  double uMax() const { return uMax_; }
  double vMin() const { return vMin_; }
  double vMax() const { return vMax_; }
  bool isClosedU() const { return closedU_; }
  bool isClosedV() const { return closedV_; }
  int numSpansU() const { return static_cast<int>(breaksU_.size()) - 1; }
  int numSpansV() const { return static_cast<int>(breaksV_.size()) - 1; }
  /** Distinct knots inside the domain, ends included. */
  const std::vector<double>& breaksU() const { return breaksU_; }
  const std::vector<double>& breaksV() const { return breaksV_; }

  /** u, v inside the domain (outside they are clamped, or wrapped in a closed direction). */
  SurfaceDerivatives evaluate(double u, double v) const;
  Vec3 calcPoint(double u, double v) const;
  /** Unit outward normal; at a pole, where S_u or S_v vanishes, the limit along the other direction. */
  Vec3 calcNormal(double u, double v) const;
  /** Textbook evaluation from the basis functions (Piegl & Tiller A2.3, A4.4): slow, for tests. */
  SurfaceDerivatives evaluateByBasisFunctions(double u, double v) const;

  /** The same patch seen from another frame: every point becomes X_AB.apply(point). */
  NurbsPatch transformed(const Pose& X_AB) const;
  /** The same patch with its normals turned around. */
  NurbsPatch flipped() const;

  // -- read by the distance kernels (detail/PatchKernel.h) --
  struct Span {
    double center, invHalfWidth;
  };
  /** Coefficients of span (i, j): [(degreeU+1) * (degreeV+1)][4], (x, y, z, w), power of u outer, v inner. */
  const double* spanCoefficients(int i, int j) const {
    return coefficients_.data() + (static_cast<size_t>(i) * numSpansV() + j) * spanStride_;
  }
  const Span& spanU(int i) const { return spansU_[i]; }
  const Span& spanV(int j) const { return spansV_[j]; }
  int findSpanU(double u) const { return findSpan(breaksU_, u); }
  int findSpanV(double v) const { return findSpan(breaksV_, v); }
  double normalSign() const { return data_.flipNormal ? -1.0 : 1.0; }

 private:
  static int findSpan(const std::vector<double>& breaks, double t);

  NurbsPatchData data_;
  double uMin_, uMax_, vMin_, vMax_;
  bool closedU_ = false, closedV_ = false;
  std::vector<double> breaksU_, breaksV_;
  std::vector<Span> spansU_, spansV_;
  std::vector<double> coefficients_;
  size_t spanStride_ = 0;
};

}  // namespace genu::contact
