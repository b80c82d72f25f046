#include <array>
#include <cmath>

#include "Models.h"
#include "PatchList.h"

namespace genu::make_models {

namespace {

// Dimensions [mm]. A proposal between two measured cruciate-retaining implants, not one of them:
//   DM       component of the Grand Challenge subject DM, opensim-jam-org/jam-resources,
//   models/knee_tka/grand_challenge
//            (Fregly et al. 2012, J Orthop Res 30:503): sagittal 38.8 / 27.3 / 17.9, insert sagittal 57.4,
//            thickness 6.0, coronal flat on flat
//   CAMS     clnsmith/opensim-jam, opensim-jam-release/models/cams: sagittal 45.6 / 37.0 / 18.8 / 17.0, coronal 36.9 on
//            37.3, condyle spacing 47.6, thickness 6.1
// Femoral component: tangent arcs in the sagittal plane, one coronal radius.
constexpr double kAnteriorRadius = 46, kDistalRadius = 38, kPosteriorRadius = 25, kFarPosteriorRadius = 18;
constexpr double kStart = -60 * kDegree;        // anterior enough for a contact 20 degrees before full extension
constexpr double kDistalStart = -40 * kDegree;  // normal angle: 0 distal, 90 degrees posterior
constexpr double kDistalEnd = 10 * kDegree, kPosteriorEnd = 72 * kDegree;
constexpr double kEnd = 115 * kDegree;
constexpr double kCoronalRadius = 33;
constexpr double kCondyleCenter = 24;     // |z|; spacing 48
constexpr double kCondyleHalfWidth = 13;  // component 74 wide (DM 75.0, CAMS 70.0)
// Origin: x at the middle of the component, 66 deep (DM 66.4, CAMS 65.1; the anterior flange is not modelled), so
// that the most posterior point lies at x = 33; y in the bone box, 35 above the distal condyles (DM 35.1).
constexpr double kDepth = 66, kDistalHeight = 35;

// Insert: dishes, bottom plane y = 0.
constexpr double kDishSagittalRadius = 58, kDishCoronalRadius = 37, kMinThickness = 7;
constexpr double kDishHalfDepth = 24, kDishHalfWidth = 15;  // insert 48 deep, 78 wide (DM 52.8, 79.5; CAMS 45.7, 65.8)

SagittalCurve makeFemoralCurve() {
  SagittalCurve curve(kStart,
                      {{kAnteriorRadius, kDistalStart},
                       {kDistalRadius, kDistalEnd},
                       {kPosteriorRadius, kPosteriorEnd},
                       {kFarPosteriorRadius, kEnd}},
                      0);
  // The far-posterior arc holds the most posterior point (normal angle 90 degrees).
  curve.placeArc(1, Vec2::Zero());
  const double posterior = curve.calcPoint(90 * kDegree).x();
  curve.placeArc(1, {kDepth / 2 - posterior, kDistalRadius - kDistalHeight});
  return curve;
}

/** u is path length [mm] along the surface at half the sagitta of the section; each arc has a few equal spans and the
 arcs meet at double knots, where the curvature jumps. Off that line the speed |S_u| of the exact surface jumps by up to
 3 % at the transitions, which a C1 patch can only follow by moving points along the surface: that is no error of shape.
 */
class FemoralParameter {
 public:
  explicit FemoralParameter(const SagittalCurve& curve) {
    const double sagitta =
        kCoronalRadius - std::sqrt(kCoronalRadius * kCoronalRadius - kCondyleHalfWidth * kCondyleHalfWidth);
    constexpr std::array<int, 4> kSpans = {2, 4, 5, 3};
    double u = 0, phi = curve.start();
    for (size_t i = 0; i < curve.arcs().size(); ++i) {
      const SagittalCurve::Arc& arc = curve.arcs()[i];
      if (i > 0) doubled_.push_back(u);
      const double step = (arc.end_rad - phi) / kSpans[i], length = (arc.radius_mm - sagitta / 2) * step;
      const double begin = u, beginAngle = phi;
      for (int k = 0; k < kSpans[i]; ++k) {
        breaks_.push_back(begin + k * length);
        angles_.push_back(beginAngle + k * step);
      }
      u = begin + kSpans[i] * length;
      phi = arc.end_rad;
    }
    breaks_.push_back(u);
    angles_.push_back(phi);
  }
  std::vector<double> makeKnots() const { return make_models::makeKnots(breaks_, doubled_); }
  double calcAngle(double u) const {
    size_t i = 0;
    while (i + 2 < breaks_.size() && breaks_[i + 1] < u) ++i;
    return angles_[i] + (u - breaks_[i]) / (breaks_[i + 1] - breaks_[i]) * (angles_[i + 1] - angles_[i]);
  }

 private:
  std::vector<double> breaks_, angles_, doubled_;
};

}  // namespace

void makeArtificialKnee(const std::filesystem::path& folder, std::ostream& report) {
  const SagittalCurve curve = makeFemoralCurve();
  const double halfAngle = std::asin(kCondyleHalfWidth / kCoronalRadius);
  const FemoralParameter parameter(curve);
  PatchList femur("femur.json", report), insert("insert.json", report);
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "medial" : "lateral";
    const double z0 = side * kCondyleCenter;
    // 20 x 15 control points [BF2004 §3.2].
    femur.add(name, parameter.makeKnots(),
              makeKnots(divide(-kCoronalRadius * halfAngle, kCoronalRadius * halfAngle, 12)), [&](double u, double v) {
                const double phi = parameter.calcAngle(u);
                return calcCanalPoint(curve.calcPoint(phi), SagittalCurve::calcNormal(phi), kCoronalRadius, z0,
                                      v / kCoronalRadius);
              });
    // Bottom of a torus about z: y = 7 + 58 - sqrt((58 - 37 + sqrt(37^2 - (z - z0)^2))^2 - x^2).
    insert.add(name, makeKnots(divide(z0 - kDishHalfWidth, z0 + kDishHalfWidth, 10)),
               makeKnots(divide(-kDishHalfDepth, kDishHalfDepth, 10)), [&](double z, double x) {
                 const double zeta = z - z0;
                 const double section = std::sqrt(kDishCoronalRadius * kDishCoronalRadius - zeta * zeta);
                 const double rho = kDishSagittalRadius - kDishCoronalRadius + section;
                 const double depth = std::sqrt(rho * rho - x * x);
                 // Gradient of y in x and z.
                 const double yx = x / depth, yz = rho * zeta / (depth * section);
                 return CanalPoint{{x, kMinThickness + kDishSagittalRadius - depth, z}, Vec3(-yx, 1, -yz).normalized()};
               });
  }
  femur.write(folder, "Femoral component of the artificial knee; generated by genu_make_models, see README.md");
  insert.write(folder, "Tibial insert of the artificial knee; generated by genu_make_models, see README.md");
}

}  // namespace genu::make_models
