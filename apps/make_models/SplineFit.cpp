#include "SplineFit.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/Splines>

#include "genu/contact/ContactSurface.h"

namespace genu::make_models {

namespace {

constexpr int kDegreeOfPatch = 3;

/** Chebyshev points of every span. */
std::vector<double> makeSamples(const std::vector<double>& knots, int perSpan) {
  std::vector<double> samples;
  for (size_t i = 0; i + 1 < knots.size(); ++i) {
    const double a = knots[i], b = knots[i + 1];
    for (int k = 0; b > a && k < perSpan; ++k) {
      samples.push_back(0.5 * (a + b) - 0.5 * (b - a) * std::cos((k + 0.5) * contact::kPi / perSpan));
    }
  }
  return samples;
}

Eigen::MatrixXd makeBasis(const std::vector<double>& knots, const std::vector<double>& samples) {
  using Spline = Eigen::Spline<double, 1>;
  const Spline::KnotVectorType knotVector =
      Eigen::Map<const Spline::KnotVectorType>(knots.data(), static_cast<Eigen::Index>(knots.size()));
  const auto numFunctions = static_cast<Eigen::Index>(knots.size()) - kDegreeOfPatch - 1;
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(samples.size()), numFunctions);
  for (size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Index span = Spline::Span(samples[i], kDegreeOfPatch, knotVector);
    basis.block(static_cast<Eigen::Index>(i), span - kDegreeOfPatch, 1, kDegreeOfPatch + 1) =
        Spline::BasisFunctions(samples[i], kDegreeOfPatch, knotVector).matrix();
  }
  return basis;
}

}  // namespace

std::vector<double> makeKnots(const std::vector<double>& breaks, const std::vector<double>& doubled) {
  std::vector<double> knots(kDegreeOfPatch, breaks.front());
  for (const double value : breaks) {
    knots.push_back(value);
    if (std::find(doubled.begin(), doubled.end(), value) != doubled.end()) knots.push_back(value);
  }
  knots.insert(knots.end(), kDegreeOfPatch, breaks.back());
  return knots;
}

std::vector<double> divide(double a, double b, int count) {
  std::vector<double> values;
  for (int i = 0; i <= count; ++i) values.push_back(i == count ? b : a + (b - a) * i / count);
  return values;
}

contact::NurbsPatchData fitPatch(const std::vector<double>& knotsU, const std::vector<double>& knotsV,
                                 const SurfaceFunction& surface) {
  const std::vector<double> samplesU = makeSamples(knotsU, 8), samplesV = makeSamples(knotsV, 8);
  const Eigen::HouseholderQR<Eigen::MatrixXd> solveU(makeBasis(knotsU, samplesU)), solveV(makeBasis(knotsV, samplesV));
  contact::NurbsPatchData patch;
  patch.knotsU = knotsU;
  patch.knotsV = knotsV;
  patch.numU = static_cast<int>(knotsU.size()) - kDegreeOfPatch - 1;
  patch.numV = static_cast<int>(knotsV.size()) - kDegreeOfPatch - 1;
  patch.points.resize(static_cast<size_t>(patch.numU) * static_cast<size_t>(patch.numV));
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::MatrixXd values(samplesU.size(), samplesV.size());
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      for (Eigen::Index j = 0; j < values.cols(); ++j) {
        values(i, j) = surface(samplesU[static_cast<size_t>(i)], samplesV[static_cast<size_t>(j)]).S[axis];
      }
    }
    const Eigen::MatrixXd alongU = solveU.solve(values);
    const Eigen::MatrixXd control_mm = solveV.solve(alongU.transpose()).transpose();
    for (int i = 0; i < patch.numU; ++i) {
      for (int j = 0; j < patch.numV; ++j) {
        const double rounded_mm = std::round(control_mm(i, j) * 1e9) / 1e9;
        patch.points[static_cast<size_t>(i * patch.numV + j)][axis] = rounded_mm / 1000;
      }
    }
  }
  const double u = 0.5 * (knotsU.front() + knotsU.back()), v = 0.5 * (knotsV.front() + knotsV.back());
  patch.flipNormal = contact::NurbsPatch(patch).calcNormal(u, v).dot(surface(u, v).N) < 0;
  return patch;
}

FitError calcFitError(const contact::NurbsPatchData& data, const SurfaceFunction& surface) {
  const contact::NurbsPatch patch(data);
  const contact::ContactSurface query({patch});
  const std::vector<double> samplesU = makeSamples(data.knotsU, 5), samplesV = makeSamples(data.knotsV, 5);
  FitError error;
  double sum = 0;
  for (const double u : samplesU) {
    for (const double v : samplesV) {
      const contact::ClosestPoint foot = query.findLocalClosestPoint(surface(u, v).S / 1000, {0, u, v});
      const double distance_mm = std::abs(foot.distance_m) * 1000;
      error.max_mm = std::max(error.max_mm, distance_mm);
      sum += distance_mm * distance_mm;
    }
  }
  error.rms_mm = std::sqrt(sum / static_cast<double>(samplesU.size() * samplesV.size()));
  return error;
}

}  // namespace genu::make_models
