#include <cmath>

#include "KneeAnatomy.h"
#include "Models.h"
#include "PatchList.h"

namespace genu::make_models {

namespace {

// Both surfaces [mm] share one coronal section, so that they are congruent across: flanks of constant slope that meet
// in a rounded valley (trochlea) or ridge (patella).
//   Sulcus angle of the cartilage 146.1 (SD 5.5) degrees, lateral slope 20.2 (5.2): Shih et al. 2004, Knee Surg Sports
//   Traumatol Arthrosc 12:300 (abstract). The medial slope is the rest: 180 - 146.1 - 20.2 = 13.7.
constexpr double kLateralSlope = 20.2 * kDegree, kMedialSlope = 13.7 * kDegree;
constexpr double kValley = 5;  // sqrt(zeta^2 + 5^2) - 5 in place of |zeta|: assumed
// The flanks turn over into ridges: from 16 off the groove on a circle of 12, assumed. Ridges are then 20.4 lateral and
// 18.9 medial of the groove, next to the middles of the condyles (21.7 and 22.8), and 4.1 above it on average (bone of
// 87 healthy knees: 6.04, PMC5134791).
constexpr double kFlankEnd = 16, kRidgeRadius = 12, kTrochleaHalfWidth = 25;
// Superior: beyond the contact in extension, where the real surface runs on to the shaft. Distal: the real groove ends at
// the notch, near 20 degrees beyond the bottom, and the patella then rides on both condyles; here the groove goes on in
// their place (assumed), so that flexion above 90 degrees is possible, and no more than that.
constexpr double kSuperiorEnd = -135 * kDegree, kDistalEnd = 75 * kDegree;

// Articular face: 34.4 x 42.9 is the bone, its area 1343 mm^2 (natural knee's source); here a rectangle. From top to
// bottom it is convex, of a radius that was not found; 60 was chosen, of 35, 60 and straight, by its motion: the
// patella flexes 0.70 degrees per degree of knee flexion (worked out for 300 N of the quadriceps, 0 to 60 degrees);
// healthy knees in gait 0.71 (Gray et al. 2019, doi 10.1002/jor.24226).
constexpr double kPatellaHalfHeight = 15, kLateralFacet = 20, kMedialFacet = 17, kPatellaSagittalRadius = 60;

struct Section {
  double height, slope;
};

/** Height over the groove and slope at `zeta` medial of it. */
Section calcFlank(double zeta) {
  const double slope = std::tan(zeta > 0 ? kMedialSlope : kLateralSlope), root = std::hypot(zeta, kValley);
  return {slope * (root - kValley), slope * zeta / root};
}

Section calcTrochleaSection(double zeta) {
  Section section = calcFlank(zeta);
  const double beyond = std::max(0.0, std::abs(zeta) - kFlankEnd);
  section.height -= beyond * beyond / (2 * kRidgeRadius);
  section.slope -= std::copysign(beyond / kRidgeRadius, zeta);
  return section;
}

}  // namespace

const PatellofemoralDimensions& patellofemoralDimensions() {
  // The groove is circular about an axis along z: its radius is 23 (SD 4) mm (Iranpour et al. 2010, Clin Orthop Relat
  // Res 468:782; figure in J Bone Joint Surg Br 92-B Supp II 321). Center: that of the cylinder about which the knee
  // extensors run in the source of the ligaments, 14.8 anterior and 6.87 superior; 50 knees: 12.3 and 7.2 between
  // trochlea and condyle (doi 10.1002/ca.23395, abstract; read here as the distance of the centers). Patella: half of
  // the bone's 20.1 and the 4.0 of its thickest cartilage lie behind its origin (that the origin is in the middle of
  // the bone: assumed). In the source's reference pose the origin is (53.0, 5.0, 4.0) anterior, superior, lateral of
  // the femur's; this follows from the published strains and slack lengths of the 20 fibres of the patella, which leave
  // residuals of 0.01 mm. Its ridge is then at 38.95.
  // Radius 24, chosen within the published spread so that the groove (38.8) all but touches that ridge. The cartilage
  // of the natural knee's source, 68.9 deep, ends 45.6 anterior, 7 above this groove. The thickest point is 54 % of the
  // width from the lateral border (acemap 104926369), 1.7 medial of the middle; the groove is put where the ridge then
  // is, 4.0 - 1.7 lateral of the femur's origin.
  static const PatellofemoralDimensions dimensions{{-14.8, 6.87}, 24, -2.3, 20.1 / 2 + 4.0, 1.7};
  return dimensions;
}

void makePatellofemoralJoint(const std::filesystem::path& folder, std::ostream& report) {
  const PatellofemoralDimensions& d = patellofemoralDimensions();
  PatchList trochlea("trochlea.json", report), patella("patella.json", report);
  // Curvature jumps where the slopes change side and where the ridges begin.
  std::vector<double> across = divide(-kTrochleaHalfWidth, -kFlankEnd, 3);
  const auto append = [&](double a, double b, int count) {
    const std::vector<double> more = divide(a, b, count);
    across.insert(across.end(), more.begin() + 1, more.end());
  };
  append(-kFlankEnd, 0, 8);
  append(0, kFlankEnd, 8);
  append(kFlankEnd, kTrochleaHalfWidth, 3);
  trochlea.add("trochlea", makeKnots(divide(kSuperiorEnd, kDistalEnd, 21)),
               makeKnots(across, {-kFlankEnd, 0, kFlankEnd}), [&](double phi, double zeta) {
                 const Section section = calcTrochleaSection(zeta);
                 const Vec2 n = SagittalCurve::calcNormal(phi);
                 const Vec2 p = d.grooveCenter + (d.grooveRadius + section.height) * n;
                 return CanalPoint{{p.x(), p.y(), d.grooveZ + zeta}, Vec3(n.x(), n.y(), -section.slope).normalized()};
               });
  trochlea.write(folder, "Trochlea of the natural femur; generated by genu_make_models, see README.md");

  // In link patella_contact: x inferior, y posterior, z medial.
  across = divide(-kLateralFacet, 0, 9);
  append(0, kMedialFacet, 8);
  patella.add("patella", makeKnots(across, {0}), makeKnots(divide(-kPatellaHalfHeight, kPatellaHalfHeight, 4)),
              [&](double zeta, double x) {
                const Section section = calcFlank(zeta);
                const double drop = x * x / (2 * kPatellaSagittalRadius);
                return CanalPoint{{x, d.ridgeDepth - section.height - drop, d.ridgeZ + zeta},
                                  Vec3(x / kPatellaSagittalRadius, 1, section.slope).normalized()};
              });
  patella.write(folder, "Articular face of the patella; generated by genu_make_models, see README.md");
}

}  // namespace genu::make_models
