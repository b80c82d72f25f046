#include <cmath>
#include <stdexcept>

#include "KneeAnatomy.h"
#include "Models.h"
#include "PatchList.h"

namespace genu::make_models {

namespace {

// Dimensions [mm] measured on the knee of one healthy adult woman (tibia 72 wide); meshes of clnsmith/wisco_opensim,
// opensim-jam-org/jam-resources (lenhart2015) and clnsmith/opensim-jam; Lenhart et al. 2015, Ann Biomed Eng 43:2675.
// There x is anterior and z lateral with the origin at the femoral reference point femur_distal_r; here both are turned
// round, and the tibial origin lies kTibialOrigin below the femoral one, so that y = 0 is a plane under the plateaus.
constexpr double kTibialOrigin = 35;

struct Condyle {
  double side;                           // +1 medial, -1 lateral
  double z0, sectionRadius, halfWidth;   // coronal arc
  std::vector<SagittalCurve::Arc> arcs;  // normal angles as in SagittalCurve
  size_t placedArc;
  Vec2 placedCenter;
  double distalThickness, posteriorThickness;  // largest, of the mean / max pairs 2.16 / 3.38 and so on
};

// The posterior arc was fitted up to 110 degrees; it goes on to 140 (assumed), so that contact at 120 degrees of flexion on a
// sloping plateau stays on the patch.
constexpr double kStart = -45 * kDegree, kEnd = 140 * kDegree;
constexpr double kBlend = 8 * kDegree;  // bone has no arcs that end at a line: radii change over 16 degrees

const Condyle& medialCondyle() {
  // Distal 31.8 (fitted from -20 to 25 degrees) about a center 5.7 anterior, 8.8 superior; posterior 20.4 (40 to 110)
  // about one 1.9 posterior, 0.6 superior. Arcs that meet tangentially do so on the line through both centers, at 42.8
  // degrees; the centers are 11.2 apart, the radii differ by 11.4.
  static const Condyle condyle{+1, 20.5, 16.5, 11.5, {{31.8, 42.8 * kDegree}, {20.4, kEnd}}, 1, {1.9, 0.6}, 3.38, 2.74};
  return condyle;
}

const Condyle& lateralCondyle() {
  // Flat distally (75 from -20 to 25 degrees, a poor fit there), 24.0 from 15 to 60, posterior 20.8 about a center
  // 2.5 posterior, 1.3 superior. The flat arc ends at 0 (assumed; the windows allow 0 to 15): ending at 13 it would be
  // 43 long and the condyle 1.3 lower in front. Anterior of -20 degrees: 40, assumed.
  static const Condyle condyle{
      -1, -24.0,      17.0, 11.5, {{40, -20 * kDegree}, {75, 0}, {24.0, 50 * kDegree}, {20.8, kEnd}},
      3,  {2.5, 1.3}, 3.04, 3.17};
  return condyle;
}

struct Plateau {
  double side;
  double z0;                         // of the coronal arc: under the condyle
  double zMin, zMax, xMin, xMax;     // articular extent
  double sagittalCurvature;          // [1/mm] > 0: concave
  double coronalRadius;              // concave
  double slope;                      // posterior down
  double thickness, thickX, thickZ;  // largest, and where
  double height;                     // at the thickest point, from the femoral origin
};

// Medial: coronal 22 concave, sagittal 190 (almost flat), slope 6.7 degrees, 39.7 x 28.0; thickness 1.19 mean, 2.55
// max, thickest at x = -3, z = 11. Lateral: sagittal 36 convex, coronal 36 concave, slope 5.3 degrees, 32.1 x 31.3;
// thickness 2.02 mean, 4.24 max, thickest at x = 6, z = -18. Heights were measured at the thickest points. That the
// troughs lie under the condyles is assumed.
constexpr Plateau kMedialPlateau{+1, 20.5,          6.5,  34.5, -19.85, 19.85, 1.0 / 190,
                                 22, 6.7 * kDegree, 2.55, -3,   11,     -20.5};
constexpr Plateau kLateralPlateau{-1, -24,           -37.3, -6.0, -16.05, 16.05, -1.0 / 36,
                                  36, 5.3 * kDegree, 4.24,  6,    -18,    -20.9};
/** Layers thin towards the rim: t = t_max exp(-k s^2), s = 1 at the rim of a layer that is thickest in its middle. k gives
 the published means: 0.64 t_max over a condyle; 0.47 and 0.48 t_max over an elliptic plateau, medial and lateral. */
constexpr double kFemoralFalloff = 1.7, kMedialFalloff = 1.03, kLateralFalloff = 1.39;

SagittalCurve makeCurve(const Condyle& condyle) {
  SagittalCurve curve(kStart, condyle.arcs, kBlend);
  curve.placeArc(condyle.placedArc, condyle.placedCenter);
  return curve;
}

/** Knots at the ends and the middle of every blend, the longest spans between them halved until there are 21. */
std::vector<double> divideCurve(const Condyle& condyle, double start, double end) {
  std::vector<double> breaks = {start};
  for (size_t i = 0; i + 1 < condyle.arcs.size(); ++i) {
    for (const double offset : {-kBlend, 0.0, kBlend}) breaks.push_back(condyle.arcs[i].end_rad + offset);
  }
  breaks.push_back(end);
  while (breaks.size() < 22) {
    size_t longest = 0;
    for (size_t i = 0; i + 1 < breaks.size(); ++i) {
      if (breaks[i + 1] - breaks[i] > breaks[longest + 1] - breaks[longest] + 1e-9) longest = i;
    }
    const auto at = breaks.begin() + static_cast<std::ptrdiff_t>(longest);
    breaks.insert(at + 1, 0.5 * (*at + *(at + 1)));
  }
  return breaks;
}

double calcFemoralThickness(const Condyle& condyle, double phi, double psi) {
  const double halfAngle = std::asin(condyle.halfWidth / condyle.sectionRadius);
  // Distal values were taken up to about 25 degrees, posterior ones from 40 on.
  const double s = std::min(1.0, std::max(0.0, (phi - 25 * kDegree) / (15 * kDegree)));
  const double top =
      condyle.distalThickness + s * s * (3 - 2 * s) * (condyle.posteriorThickness - condyle.distalThickness);
  return top * std::exp(-kFemoralFalloff * std::pow(psi / halfAngle, 2));
}

/** u along x, v along z, both [mm] of arc; the bottom of the trough passes through the origin. */
CanalPoint calcTroughPoint(const Plateau& plateau, double u, double v) {
  const double kappa = plateau.sagittalCurvature;
  const Vec2 P(std::sin(kappa * u) / kappa, (1 - std::cos(kappa * u)) / kappa);
  const Vec2 n(-std::sin(kappa * u), std::cos(kappa * u));
  // A trough: the circle's center lies above. With radius -r and psi = -v/r the point is at z0 + r sin(v/r).
  CanalPoint point = calcCanalPoint(P, n, -plateau.coronalRadius, plateau.z0, -v / plateau.coronalRadius);
  const Eigen::AngleAxisd down(-plateau.slope, Vec3::UnitZ());
  point.S = down * point.S;
  point.N = down * point.N;
  return point;
}

/** Height of the trough at x, z. */
double calcTroughHeight(const Plateau& plateau, double x, double z) {
  const double r = plateau.coronalRadius;
  double u = x, v = r * std::asin((z - plateau.z0) / r);
  for (int i = 0; i < 50; ++i) {  // v shifts x by less than a tenth of itself: contracts
    const Vec3 S = calcTroughPoint(plateau, u, v).S;
    if (std::abs(S.x() - x) < 1e-13) return S.y();
    u += x - S.x();
  }
  throw std::logic_error("no point of the plateau there");
}

CanalPoint calcPlateauPoint(const Plateau& plateau, double u, double v) {
  CanalPoint point = calcTroughPoint(plateau, u, v);
  point.S.y() += kTibialOrigin + plateau.height - calcTroughHeight(plateau, plateau.thickX, plateau.thickZ);
  return point;
}

double calcTibialThickness(const Plateau& plateau, const Vec3& S) {
  const double a = 0.5 * (plateau.xMax - plateau.xMin), b = 0.5 * (plateau.zMax - plateau.zMin);
  const double s2 = std::pow((S.x() - plateau.thickX) / a, 2) + std::pow((S.z() - plateau.thickZ) / b, 2);
  return plateau.thickness * std::exp(-(plateau.side > 0 ? kMedialFalloff : kLateralFalloff) * s2);
}

}  // namespace

Vec2 lowestCondylePoint(Side side, double flexion_rad) {
  return makeCurve(side == Side::medial ? medialCondyle() : lateralCondyle()).calcPoint(flexion_rad);
}

double plateauHeight(Side side, double x, double z) {
  const Plateau& plateau = side == Side::medial ? kMedialPlateau : kLateralPlateau;
  return kTibialOrigin + plateau.height + calcTroughHeight(plateau, x, z) - calcTroughHeight(plateau, plateau.thickX, plateau.thickZ);
}

void makeNaturalKnee(const std::filesystem::path& folder, std::ostream& report) {
  // Bone patches reach this far beyond the cartilage, so that normals at its rim still meet them.
  constexpr double kMarginAngle = 3 * kDegree, kMarginLength = 1;
  PatchList femurCartilage("femur_cartilage.json", report), femurBone("femur_bone.json", report);
  for (const Condyle* condyle : {&medialCondyle(), &lateralCondyle()}) {
    const std::string name = condyle->side > 0 ? "medial" : "lateral";
    const double halfAngle = std::asin(condyle->halfWidth / condyle->sectionRadius);
    const auto cartilage = [&, curve = makeCurve(*condyle)](double phi, double psi) {
      return calcCanalPoint(curve.calcPoint(phi), SagittalCurve::calcNormal(phi), condyle->sectionRadius, condyle->z0,
                            psi);
    };
    const auto bone = [&](double phi, double psi) {
      CanalPoint point = cartilage(phi, psi);
      point.S -= calcFemoralThickness(*condyle, phi, psi) * point.N;
      return point;
    };
    femurCartilage.add(name, makeKnots(divideCurve(*condyle, kStart, kEnd)),
                       makeKnots(divide(-halfAngle, halfAngle, 8)), cartilage);
    femurBone.add(name, makeKnots(divideCurve(*condyle, kStart - kMarginAngle, kEnd + kMarginAngle)),
                  makeKnots(divide(-halfAngle - kMarginAngle, halfAngle + kMarginAngle, 12)), bone);
  }
  femurCartilage.write(folder, "Femoral cartilage of the natural knee; generated by genu_make_models, see README.md");
  femurBone.write(folder, "Femoral subchondral bone of the natural knee; generated by genu_make_models, see README.md");

  PatchList tibiaCartilage("tibia_cartilage.json", report), tibiaBone("tibia_bone.json", report);
  for (const Plateau* plateau : {&kMedialPlateau, &kLateralPlateau}) {
    const std::string name = plateau->side > 0 ? "medial" : "lateral";
    const double r = plateau->coronalRadius;
    const double v0 = r * std::asin((plateau->zMin - plateau->z0) / r),
                 v1 = r * std::asin((plateau->zMax - plateau->z0) / r);
    const auto cartilage = [&](double v, double u) { return calcPlateauPoint(*plateau, u, v); };
    const auto bone = [&](double v, double u) {
      CanalPoint point = cartilage(v, u);
      point.S -= calcTibialThickness(*plateau, point.S) * point.N;
      return point;
    };
    tibiaCartilage.add(name, makeKnots(divide(v0, v1, 8)), makeKnots(divide(plateau->xMin, plateau->xMax, 10)),
                       cartilage);
    tibiaBone.add(name, makeKnots(divide(v0 - kMarginLength, v1 + kMarginLength, 12)),
                  makeKnots(divide(plateau->xMin - kMarginLength, plateau->xMax + kMarginLength, 12)), bone);
  }
  tibiaCartilage.write(folder, "Tibial cartilage of the natural knee; generated by genu_make_models, see README.md");
  tibiaBone.write(folder, "Tibial subchondral bone of the natural knee; generated by genu_make_models, see README.md");
}

}  // namespace genu::make_models
