#pragma once

#include <vector>

#include "genu/contact/NurbsPatch.h"
#include "genu/fit/Mesh.h"
#include "genu/scene/Progress.h"

namespace genu::fit {

/** How a region is laid out on its parameter rectangle. */
enum class PatchShape {
  plateau,  ///< u along x, v along z: a surface seen from above (or below)
  condyle,  ///< u: angle about an axis parallel to z, 0 at -y and growing towards +x, times a radius; v along z
};

struct Parametrization {
  PatchShape shape = PatchShape::plateau;
  Vec2 axis_m = Vec2::Zero();  ///< condyle: x, y of the axis
  double radius_m = 1;         ///< condyle: mean distance of the region from the axis

  Vec2 calc(const Vec3& point) const;         ///< (u, v) [m]
  double calcAngle(const Vec3& point) const;  ///< condyle [rad]
  /** The direction away from the body the region belongs to if it is single-valued in (u, v): +-y or radial. */
  Vec3 calcDirection(const Vec3& point) const;
};

/** Circle through the region's x-y projection (area-weighted algebraic fit, Kasa 1976): centre and radius. */
Parametrization fitCondyleAxis(const TriangleMesh& region);

struct SurfaceFitOptions {
  Parametrization parametrization;
  double toleranceMax_m = 0.05e-3, toleranceMean_m = 0.005e-3;  ///< knots are added until both are met
  int maxPointsU = 20, maxPointsV = 15;                         ///< cap on control points
  int minPointsU = 6, minPointsV = 6;
  /** Weight of the thin-plate energy over the mean square deviation, in units of the region's area. */
  double fairing = 1e-9;
  /** Beyond the mesh the surface is asked to fall below the border's tangent plane by r^2 / (2 fallAwayRadius_m). */
  double fallAwayRadius_m = 15e-3;
};

struct SurfaceFitResult {
  contact::NurbsPatchData patch;                    ///< bicubic, knots in [0, 1], outward normal as in the mesh
  std::vector<double> deviation_m;                  ///< per vertex of the region, > 0 outside the patch's solid side
  std::vector<Vec2> uv;                             ///< per vertex, foot in [0, 1]^2
  std::vector<char> beyondEdge;                     ///< per vertex: the foot lies on the edge of the patch
  double uncoveredShare = 0;                        ///< share of the patch's area with no mesh below it
  std::vector<double> meanHistory_m, maxHistory_m;  ///< per knot configuration
  std::vector<std::array<int, 2>> sizeHistory;
  bool toleranceMet = false;
  bool stopped = false;  ///< by `progress`
};

/** One untrimmed bicubic B-spline patch through a region by least squares:

     minimise  sum_k w_k [ (n_k.(S(u_k,v_k) - P_k))^2 + tau |tangential part|^2 ]
               + fairing A integral(|S_uu|^2 + 2|S_uv|^2 + |S_vv|^2) du dv

 P_k vertices, w_k their share of the area A, n_k the patch normal at the foot (u_k, v_k) of P_k. The feet are found
 anew after every solution (parameter correction; tangent-distance minimisation, Wang, Pottmann & Liu 2006, ACM Trans.
 Graph. 25:214). A knot line is added through the strip with the largest sum of squares, where half of it lies, until
 the tolerances or the cap are reached; parameter corrections go on until the deviation no longer falls.
 The parameter rectangle is the bounding rectangle of the region; where no mesh lies below it the surface is
 extrapolated, falling away from the contact side.
 @throws InputError when the region has too few vertices to fix a patch or folds over itself in (u, v) */
SurfaceFitResult fitSurface(const TriangleMesh& region, const SurfaceFitOptions& options,
                            const scene::Progress& progress = {});

/** Table 2 of [BF2004] gives maximum, mean and standard deviation of |d|; the signed mean and sd show bias. */
struct DeviationStatistics {
  int count = 0;
  double max_m = 0, mean_m = 0, sd_m = 0, rms_m = 0, percentile95_m = 0;
  double signedMean_m = 0, signedSd_m = 0, signedMin_m = 0, signedMax_m = 0;
};
DeviationStatistics calcStatistics(const std::vector<double>& deviation_m);

}  // namespace genu::fit
