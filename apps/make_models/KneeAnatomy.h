#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "SweptSurface.h"

namespace genu::make_models {

/** Frames of the published points: x anterior, y superior, z lateral (right knee), mm. */
enum class SourceFrame {
  femur,     ///< femur_distal_r
  tibia,     ///< tibia_proximal_r
  patella,   ///< patella_r, in the middle of the bone
  pelvis,    ///< pelvis, between the anterior spines
  thigh,     ///< femur_r, hip centre
  shank,     ///< tibia_r
  calcaneus  ///< calcn_r
};

/** A link of the models and a point in it: x posterior, y superior, z medial, mm. */
struct LinkPoint {
  std::string link;
  Vec3 p;
};

/** Half a turn about y, and the offset between the source's origin and the link's. */
LinkPoint toLink(SourceFrame frame, const Vec3& p_source);

/** URDF of the patella on a link femur, and of the link of its articular face. */
extern const char* const kPatellaLinks;

struct Fibre {
  const char* name;
  double stiffness_N;  ///< per unit strain
  double slack_mm;
  SourceFrame originFrame;
  Vec3 origin;
  SourceFrame insertionFrame;
  Vec3 insertion;
  const char* wrap;  ///< or nullptr
};
const std::vector<Fibre>& naturalLigaments();

struct Wrap {
  const char* name;
  SourceFrame frame;
  Vec3 center, angles_rad;  ///< body-fixed x, y, z
  Vec3 radii_mm;            ///< cylinder: radius, 0, 0
  bool anterior;            ///< the path stays in front of the cylinder
};
const Wrap& findWrap(const std::string& name);

struct MuscleRow {
  const char* name;
  double force_N, fibre_mm, tendon_mm, pennation_deg;
  struct Point {
    SourceFrame frame;
    Vec3 p;
  };
  std::vector<Point> path;
  const char* wrap;  ///< before the last point, or nullptr
};
const std::vector<MuscleRow>& kneeMuscles();

/** Where the hip and ankle centres are. */
Vec3 hipInPelvis();   ///< link axes, from the pelvis's origin
Vec3 kneeInThigh();   ///< origin of link femur, from the hip centre
Vec3 ankleInTibia();  ///< from the origin of link tibia

/** Patellofemoral surfaces [mm]; see PatellofemoralJoint.cpp. */
struct PatellofemoralDimensions {
  Vec2 grooveCenter;             ///< x, y in link femur
  double grooveRadius, grooveZ;  ///< z of the groove
  double ridgeDepth, ridgeZ;     ///< patella's origin to its ridge
};
const PatellofemoralDimensions& patellofemoralDimensions();

/** The natural knee's tibiofemoral surfaces [mm], NaturalKnee.cpp. */
enum class Side { medial, lateral };
/** Crown of the condyle that is lowest at this flexion; x, y in link femur. */
Vec2 lowestCondylePoint(Side side, double flexion_rad);
/** Height of the plateau's cartilage, in link tibia. */
double plateauHeight(Side side, double x, double z);

// Pieces of scenes and URDF files.
std::string writeNumber(double value, int decimals);
std::string writePoint(const Vec3& p_mm);                       ///< `"1.00 mm, 2.00 mm, 3.00 mm"`
std::string writePathPoint(SourceFrame frame, const Vec3& p);   ///< `{body: femur, at: "..."}`
std::string writeWrap(const Wrap& wrap);                        ///< a line of `wraps`
std::string writeNaturalLigaments(const std::string& comment);  ///< key `ligaments`
/** Keys `poses` and `springs`: the menisci of the natural knee. Pose of the femur in the tibia in extension; poses of all
 other floating joints, as text. */
std::string writeMenisci(const Vec3& extensionRotation_deg, const Vec3& extension_mm, const std::string& otherJoints);
/** Keys `surfaces`, `materials` and `contact` of the natural knee; the folders of the geometry files, with a final
 * slash. */
std::string naturalKneeSurfaces(const std::string& naturalKnee, const std::string& patellofemoral);
std::string writeVector_m(const Vec3& p_mm);  ///< for URDF
/** @throws genu::InputError */
void writeText(const std::filesystem::path& file, const std::string& text);

}  // namespace genu::make_models
