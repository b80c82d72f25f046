#pragma once

#include <functional>
#include <string>
#include <vector>

#include "SweptSurface.h"
#include "genu/contact/NurbsPatch.h"

namespace genu::make_models {

/** Clamped cubic knots; `breaks` has the distinct values, ends included; values in `doubled` are repeated, so that the
 second derivative may jump there. */
std::vector<double> makeKnots(const std::vector<double>& breaks, const std::vector<double>& doubled = {});

/** `count` equal steps from a to b, ends included. */
std::vector<double> divide(double a, double b, int count);

using SurfaceFunction = std::function<CanalPoint(double u, double v)>;

/** Bicubic patch, least squares in position through Gauss-like samples of every knot span (8 per span and direction);
 the tensor product lets the two directions be solved one after the other. Control points are rounded to 1e-9 mm. The
 normal is turned to the side of the function's. Points of the result are in m. */
contact::NurbsPatchData fitPatch(const std::vector<double>& knotsU, const std::vector<double>& knotsV,
                                 const SurfaceFunction& surface);

/** Distance from exact points, 5 per span and direction between the samples of the fit, to the patch. */
struct FitError {
  double max_mm = 0, rms_mm = 0;
};
FitError calcFitError(const contact::NurbsPatchData& patch, const SurfaceFunction& surface);

}  // namespace genu::make_models
