#include "KneeAnatomy.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "genu/scene/Errors.h"

namespace genu::make_models {

namespace {

constexpr SourceFrame kFemur = SourceFrame::femur, kTibia = SourceFrame::tibia, kPatella = SourceFrame::patella,
                      kPelvis = SourceFrame::pelvis, kThigh = SourceFrame::thigh, kShank = SourceFrame::shank,
                      kCalcaneus = SourceFrame::calcaneus;

/** Half a turn about y: (x, y, z) to (-x, y, -z). */
Vec3 turn(const Vec3& p) { return {-p.x(), p.y(), -p.z()}; }

// Between the source's frames [mm], as the source's model has them: Lenhart et al. 2015, Ann Biomed Eng 43:2675, file
// models/knee_healthy/lenhart2015/lenhart2015.osim of opensim-jam-org/jam-resources.
const Vec3 kDistalFemurInThigh(-5.55, -374.18, -1.17);  // femur_distal_r in femur_r
const Vec3 kShankInTibia(6, 0, 0);                      // tibia_r in tibia_proximal_r
// The tibial link's origin lies 35 below the femoral one when the links coincide (NaturalKnee.cpp). There the plateaus
// are given in tibia_proximal_r (y = -20.5 and -20.9) and raised by 35, the condyles in femur_distal_r; so are these
// points.
constexpr double kTibialOrigin = 35;

// Hip in the pelvis and ankle in the shank were not read for this leg. Generic leg: (-56.28, -78.49, 77.26), read in a
// public OpenSim program's hip joint, and (-10, -400, 0), recalled, unverified; that both are the figures of
// Rajagopal2016.osim (opensim-org/opensim-models) is recalled too. Scale: the source's muscle points are those of that
// model times 1.196 in x and z and 1.060 in y on the pelvis (biceps -104, -119.1, 58.6 to -124.4, -126.3, 70.1; rectus
// alike), and 1.0083 is the source's scale of the talus and of its points on shank and foot.
const Vec3 kHipInPelvis(-56.28 * 1.196, -78.49 * 1.060, 77.26 * 1.196);
const Vec3 kAnkleInShank(-10 * 1.0083, -400 * 1.0083, 0);
// calcn_r in talus_r, whose origin is the ankle (fmoissenet/MSK_Delp_U_Ankle, Main_Set_Geometry_Delp.m).
const Vec3 kCalcaneusInTalus(-48.77 * 1.0083, -41.95 * 1.0083, 7.92 * 1.0083);

}  // namespace

const char* const kPatellaLinks = R"(  <link name="patella">
    <inertial>
      <mass value="0.0862"/>
      <inertia ixx="2.87e-6" ixy="0" ixz="0" iyy="1.311e-5" iyz="0" izz="1.311e-5"/>
    </inertial>
  </link>
  <joint name="patellofemoral" type="floating">
    <parent link="femur"/>
    <child link="patella"/>
  </joint>
  <link name="patella_contact"/>
  <joint name="patellar_face" type="fixed">
    <origin rpy="0 0 -1.57079632679489662"/>
    <parent link="patella"/>
    <child link="patella_contact"/>
  </joint>
)";

LinkPoint toLink(SourceFrame frame, const Vec3& p) {
  switch (frame) {
    case SourceFrame::femur:
      return {"femur", turn(p)};
    case SourceFrame::tibia:
      return {"tibia", turn(p) + Vec3(0, kTibialOrigin, 0)};
    case SourceFrame::shank:
      return toLink(SourceFrame::tibia, p + kShankInTibia);
    case SourceFrame::patella:
      return {"patella", turn(p)};
    case SourceFrame::pelvis:
      return {"pelvis", turn(p)};
    case SourceFrame::thigh:
      return {"thigh", turn(p)};
    case SourceFrame::calcaneus:
      return {"foot", turn(p + kCalcaneusInTalus)};
  }
  throw std::logic_error("unknown frame");
}

Vec3 hipInPelvis() { return turn(kHipInPelvis); }
Vec3 kneeInThigh() { return turn(kDistalFemurInThigh); }
Vec3 ankleInTibia() { return toLink(SourceFrame::shank, kAnkleInShank).p; }

/** Force per unit strain [N], slack length [mm], ends. Lenhart et al. 2015, file as above. Where the source wraps a
 fibre and it makes no difference (deep MCL: never touches; posteromedial capsule and patellar tendon: less than 0.15 mm
 up to 46 degrees), the fibre is straight. */
const std::vector<Fibre>& naturalLigaments() {
  static const std::vector<Fibre> fibres = {
      {"MCLd1", 500, 30.75, kFemur, {-1.75, -0.46, -37.27}, kTibia, {-0.22, -31.85, -31.38}, nullptr},
      {"MCLd2", 500, 32.678, kFemur, {2.89, -0.67, -38.03}, kTibia, {4.95, -31.26, -31.38}, nullptr},
      {"MCLd3", 500, 37.121, kFemur, {3.88, 3.68, -39.03}, kTibia, {5.42, -32.63, -31.47}, nullptr},
      {"MCLd4", 500, 33.244, kFemur, {0.96, 1.44, -38.24}, kTibia, {2.61, -32.41, -31.43}, nullptr},
      {"MCLd5", 500, 37.28, kFemur, {-1.08, 4.69, -38.67}, kTibia, {-0.09, -33.39, -31.42}, nullptr},
      {"MCLs1", 500, 72.32, kFemur, {5.37, 8.34, -40.65}, kTibia, {14.32, -61.13, -15.47}, "medial_tibia"},
      {"MCLs2", 500, 89.798, kFemur, {5.63, 15.28, -40.59}, kTibia, {19.23, -71.44, -10.94}, "medial_tibia"},
      {"MCLs3", 500, 71.357, kFemur, {-0.41, 16.54, -38.88}, kTibia, {1.18, -55.47, -21.54}, "medial_tibia"},
      {"MCLs4", 500, 82.269, kFemur, {-1.15, 8.09, -39.48}, kTibia, {6.52, -74.83, -17.34}, "medial_tibia"},
      {"MCLs5", 500, 78.138, kFemur, {2.5, 11.53, -40.62}, kTibia, {11.92, -65.76, -16.44}, "medial_tibia"},
      {"MCLs6", 500, 74.109, kFemur, {0.92, 13.42, -40.27}, kTibia, {7.17, -60.75, -19.48}, "medial_tibia"},
      {"ACLpl1", 820, 25.109, kFemur, {-3.84, -0.03, 7.08}, kTibia, {10.14, -20.48, -0.36}, nullptr},
      {"ACLpl2", 820, 22.99, kFemur, {-3.86, -3.05, 7.24}, kTibia, {10.07, -21.32, 3.92}, nullptr},
      {"ACLpl3", 820, 27.93, kFemur, {-1.26, -0.61, 5.78}, kTibia, {14.12, -21.79, 1.43}, nullptr},
      {"ACLpl4", 820, 25.343, kFemur, {-0.5, -4.84, 6.19}, kTibia, {14.31, -21.46, 4.84}, nullptr},
      {"ACLpl5", 820, 24.461, kFemur, {-1.53, -2.19, 6.27}, kTibia, {12.2, -21.3, 1.71}, nullptr},
      {"ACLpl6", 820, 25.107, kFemur, {-2.74, -3.17, 6.8}, kTibia, {12.53, -21.98, 4.33}, nullptr},
      {"ACLam1", 820, 34.171, kFemur, {1.17, 3.19, 2.62}, kTibia, {16.44, -20.67, -5.22}, nullptr},
      {"ACLam2", 820, 29.949, kFemur, {-1.17, 1.06, 5.21}, kTibia, {14.97, -21.64, -0.57}, nullptr},
      {"ACLam3", 820, 30.236, kFemur, {-0.94, 3.7, 4.17}, kTibia, {11.94, -19.62, -3.85}, nullptr},
      {"ACLam4", 820, 34.583, kFemur, {0.85, 1.03, 4.05}, kTibia, {18.52, -22.16, -1.85}, nullptr},
      {"ACLam5", 820, 33.822, kFemur, {0.56, 2.55, 3.56}, kTibia, {16.13, -20.93, -3.68}, nullptr},
      {"ACLam6", 820, 33.588, kFemur, {-0.57, 1.72, 4.61}, kTibia, {16.39, -21.74, -1.35}, nullptr},
      {"PCLal1", 900, 34.199, kFemur, {1.06, -2.65, -10.71}, kTibia, {-14.05, -31.39, 2.94}, nullptr},
      {"PCLal2", 900, 31.248, kFemur, {7.11, -4.73, -4.65}, kTibia, {-10.1, -25.66, 2.88}, nullptr},
      {"PCLal3", 900, 32.549, kFemur, {4.66, -0.89, -7.04}, kTibia, {-12.05, -28.14, 3.05}, nullptr},
      {"PCLal4", 900, 33.442, kFemur, {4.81, -4.53, -8.15}, kTibia, {-12.7, -30.79, -2.26}, nullptr},
      {"PCLal5", 900, 33.392, kFemur, {5.02, -3.43, -7.55}, kTibia, {-12.41, -29.81, 0.9}, nullptr},
      {"PCLpm1", 300, 34.338, kFemur, {4.55, -5.5, -9.03}, kTibia, {-13.92, -31.77, -3.33}, nullptr},
      {"PCLpm2", 300, 35.726, kFemur, {2.21, -8.27, -10.65}, kTibia, {-17.05, -32.78, -6.6}, nullptr},
      {"PCLpm3", 300, 30.601, kFemur, {1.81, -6.16, -10.73}, kTibia, {-13.23, -29.62, -6.7}, nullptr},
      {"PCLpm4", 300, 39.651, kFemur, {6.51, -7.85, -8.05}, kTibia, {-16.26, -33.44, -1.43}, nullptr},
      {"PCLpm5", 300, 35.097, kFemur, {4.88, -7.82, -9.73}, kTibia, {-14.78, -32.05, -4.79}, nullptr},
      {"LCL1", 600, 49.165, kFemur, {-2.17, 2.08, 35.47}, kTibia, {-13.22, -48.27, 43.16}, nullptr},
      {"LCL2", 600, 55.705, kFemur, {-2.19, 6.04, 35.64}, kTibia, {-14.84, -50.77, 45.56}, nullptr},
      {"LCL3", 600, 53.297, kFemur, {-0.38, 3.98, 36.52}, kTibia, {-11.88, -50.6, 45.43}, nullptr},
      {"LCL4", 600, 58.164, kFemur, {-0.03, 6.56, 36.49}, kTibia, {-11.71, -53.18, 46.3}, nullptr},
      {"PT1", 3000, 46.792, kPatella, {2.39, -9.58, 14.86}, kTibia, {32.81, -46.61, 19.98}, nullptr},
      {"PT2", 3000, 49.533, kPatella, {3.45, -11.5, -11.93}, kTibia, {33.65, -49.79, 4.69}, nullptr},
      {"PT3", 3000, 51.879, kPatella, {6.17, -8.74, 3.41}, kTibia, {37.04, -50.07, 14.58}, nullptr},
      {"PT4", 3000, 40.649, kPatella, {2.83, -16.42, 3.23}, kTibia, {34.7, -46.15, 13.01}, nullptr},
      {"PT5", 3000, 45.941, kPatella, {3.27, -12.49, 10.45}, kTibia, {35.09, -48.11, 17.91}, nullptr},
      {"PT6", 3000, 46.737, kPatella, {5.83, -12.7, -3.79}, kTibia, {35.95, -48.37, 9.96}, nullptr},
      {"lPFL1", 150, 34.137, kFemur, {20, 10, 35.46}, kPatella, {-1.55, 10.82, 18.58}, nullptr},
      {"lPFL2", 150, 36.589, kFemur, {23, 0.5, 34.4}, kPatella, {-0.11, -8.67, 17.22}, nullptr},
      {"lPFL3", 150, 33.732, kFemur, {17.6, 5.51, 36.01}, kPatella, {-3.09, 2.46, 21.37}, nullptr},
      {"lPFL4", 150, 32.924, kFemur, {25, 7.03, 33.88}, kPatella, {0.92, 4.01, 21.07}, nullptr},
      {"lPFL5", 150, 32.924, kFemur, {19, 8, 35.59}, kPatella, {-2.57, 6.07, 21.19}, nullptr},
      {"lPFL6", 150, 33.155, kFemur, {19, 3, 35.54}, kPatella, {-2.45, -4.66, 20.62}, nullptr},
      {"lPFL7", 150, 33.461, kFemur, {23, 9.5, 34}, kPatella, {-0.87, 7.91, 20.64}, nullptr},
      {"lPFL8", 150, 33.612, kFemur, {23.5, 4.25, 35}, kPatella, {-0.06, -0.81, 21.54}, nullptr},
      {"mPFL1", 150, 47.176, kFemur, {14.82, 14.85, -37.85}, kPatella, {0.22, 7.77, -18.84}, nullptr},
      {"mPFL2", 150, 48.889, kFemur, {14.18, 5.65, -39.55}, kPatella, {1.09, -9.67, -16.38}, nullptr},
      {"mPFL3", 150, 47.977, kFemur, {11.38, 10.33, -40.16}, kPatella, {0.31, -1.1, -20.73}, nullptr},
      {"mPFL4", 150, 45.442, kFemur, {18.92, 10.48, -36.69}, kPatella, {3.24, -0.05, -20.66}, nullptr},
      {"mPFL5", 150, 45.825, kFemur, {15.38, 12.48, -38.37}, kPatella, {0.88, 2.79, -20.66}, nullptr},
      {"mPFL6", 150, 46.603, kFemur, {14.48, 8.54, -39.29}, kPatella, {1.62, -4.53, -20.05}, nullptr},
      {"MCLp1", 500, 29.244, kFemur, {-8.06, -7.13, -34.76}, kTibia, {-16.95, -34.75, -24.72}, nullptr},
      {"MCLp2", 500, 29.917, kFemur, {-5.6, -6.34, -35.42}, kTibia, {-15.4, -34.93, -26.84}, nullptr},
      {"MCLp3", 500, 29.652, kFemur, {-7.29, -9.72, -34.16}, kTibia, {-15.14, -37.34, -24.75}, nullptr},
      {"MCLp4", 500, 30.533, kFemur, {-4.61, -9.59, -34.79}, kTibia, {-12.93, -37.19, -26.77}, nullptr},
      {"MCLp5", 500, 29.098, kFemur, {-6.31, -8.37, -34.79}, kTibia, {-15.2, -36.15, -25.69}, nullptr},
      {"PFL1", 440, 43.779, kFemur, {-1.75, -1.13, 34.83}, kTibia, {-23.71, -39.49, 36.08}, nullptr},
      {"PFL2", 440, 44.234, kFemur, {-0.94, -6.44, 33.95}, kTibia, {-21.43, -39.53, 34.62}, nullptr},
      {"PFL3", 440, 49.131, kFemur, {4.35, -2.72, 36.77}, kTibia, {-23.29, -41.48, 38.86}, nullptr},
      {"PFL4", 440, 49.641, kFemur, {3.5, -7.15, 34.52}, kTibia, {-21.26, -41.67, 38.73}, nullptr},
      {"PFL5", 440, 47.079, kFemur, {1.7, -4.85, 34.44}, kTibia, {-22.38, -39.63, 36.73}, nullptr},
      {"pCAP1", 500, 52.959, kFemur, {-9.65, 16.9, -24.01}, kTibia, {-19.17, -33.17, -17.39}, "condyles"},
      {"pCAP2", 500, 54.557, kFemur, {-9.84, 16.58, 24.11}, kTibia, {-17.48, -35.69, 21.41}, "condyles"},
      {"pCAP3", 500, 69.108, kFemur, {-9.65, 16.9, -23.01}, kTibia, {-17.48, -35.69, 20.41}, "condyles"},
      {"pCAP4", 500, 65.043, kFemur, {-9.84, 16.58, 23.11}, kTibia, {-19.18, -33.16, -16.39}, "condyles"},
      {"pCAP5", 500, 52.91, kFemur, {-9.65, 16.9, -20.01}, kTibia, {-19.21, -33.15, -13.4}, "condyles"},
      {"pCAP6", 500, 54.606, kFemur, {-9.84, 16.58, 20.11}, kTibia, {-17.45, -35.7, 17.41}, "condyles"},
      {"pCAP7", 500, 52.862, kFemur, {-9.65, 16.9, -16.01}, kTibia, {-19.24, -33.14, -9.4}, "condyles"},
      {"pCAP8", 500, 54.657, kFemur, {-9.84, 16.58, 16.11}, kTibia, {-17.42, -35.72, 13.41}, "condyles"}};
  return fibres;
}

/** File as above. */
const Wrap& findWrap(const std::string& name) {
  static const std::vector<Wrap> wraps = {
      // Med_Lig_r, Capsule_r
      {"medial_tibia", kTibia, {1, -34.6, -18.7}, {-0.10491, -0.03491, 0.18161}, {30, 18, 12}, false},
      {"condyles", kFemur, {-4, -3, 0}, {-0.02991, 0.02, 0.33161}, {18, 0, 0}, false},
      // KnExt_at_fem_r, KnExt_vasint_at_fem_r, Gastroc_at_Condyles_r, GR_at_condyles_r
      {"knee_extensors", kThigh, {9.25, -367.31, 0}, {0, 0, 0}, {25.91, 0, 0}, true},
      {"vastus_intermedius", kThigh, {9.25, -367.31, 0}, {0, 0, 0}, {24.06, 0, 0}, true},
      {"gastrocnemius", kThigh, {9.25, -377.03, 0.28}, {0.05899, -0.08727, 0.02321}, {27.76, 23.13, 138.78}, false},
      {"gracilis", kShank, {0, 0, 0}, {0, 0, -0.18326}, {36.3, 64.02, 53.74}, false},
  };
  for (const Wrap& wrap : wraps) {
    if (name == wrap.name) return wrap;
  }
  throw std::logic_error("unknown wrap " + name);
}

/** Largest isometric force [N], optimal fibre and slack tendon lengths [mm], pennation at the optimal length [deg]:
 Arnold et al. 2010 scaled to the knee of Lenhart et al. 2015, file as above. */
const std::vector<MuscleRow>& kneeMuscles() {
  static const std::vector<MuscleRow> muscles = {
      {"bflh", 705.2, 90.22, 297.66, 11.58, {{kPelvis, {-124.4, -126.3, 70.1}}, {kShank, {-32, -42.9, 33.6}}}, nullptr},
      {"bfsh", 631.6, 103.83, 97.9, 12.33, {{kThigh, {4.6, -195.3, 21.7}}, {kShank, {-30.3, -42.2, 32.1}}}, nullptr},
      {"gaslat",
       606.4,
       58.95,
       369.97,
       12.04,
       {{kThigh, {-2.8, -352.9, 25.6}}, {kCalcaneus, {4.4, 31.3, -5.3}}},
       "gastrocnemius"},
      {"gasmed",
       1308,
       51.06,
       389.48,
       9.88,
       {{kThigh, {7.4, -350.5, -19.2}}, {kCalcaneus, {4.4, 31.3, -5.3}}},
       "gastrocnemius"},
      {"grac",
       137.3,
       211.27,
       156.74,
       8.16,
       {{kPelvis, {-56.6, -137.1, 29.4}}, {kShank, {-18.6, -47.9, -29.9}}, {kShank, {1.8, -70.2, -15.9}}},
       "gracilis"},
      {"recfem",
       848.8,
       70.97,
       340.53,
       13.93,
       {{kPelvis, {-28.7, -41.1, 111.6}}, {kPatella, {-0.1, 15, 1.1}}, {kPatella, {3.5, 12.6, 0.8}}},
       "knee_extensors"},
      {"sart",
       113.5,
       386.52,
       105.5,
       1.33,
       {{kPelvis, {-23.3, -16.5, 126.3}},
        {kThigh, {-2.8, -330.1, -39}},
        {kShank, {-25.3, -40.4, -36.8}},
        {kShank, {-16, -60.4, -26.6}},
        {kShank, {13.7, -81.7, -2.6}}},
       nullptr},
      {"semimem",
       1162.7,
       63.68,
       348.87,
       15.09,
       {{kPelvis, {-118, -120.9, 73.4}}, {kShank, {-29.2, -42, -19.8}}},
       nullptr},
      {"semiten",
       301.9,
       179.49,
       227.85,
       12.86,
       {{kPelvis, {-124.1, -132.9, 61.6}}, {kShank, {-31.5, -51.2, -23.1}}, {kShank, {1.9, -77.9, -11.8}}},
       nullptr},
      {"tfl",
       155,
       90.71,
       429.7,
       3,
       {{kPelvis, {-37.2, 22.7, 148.4}}, {kThigh, {27.2, -92.1, 55.2}}, {kShank, {10.9, -41.3, 34.9}}},
       nullptr},
      {"vasint",
       1024.2,
       91.1,
       111.56,
       4.54,
       {{kThigh, {26.8, -178, 28.7}}, {kThigh, {31, -192.8, 26.4}}, {kPatella, {-3.8, 18.1, -0.4}}},
       "vastus_intermedius"},
      {"vaslat",
       2255.4,
       91.52,
       131.02,
       18.38,
       {{kThigh, {4.4, -171.5, 32.3}}, {kThigh, {24.9, -239.7, 37.8}}, {kPatella, {1.7, 15.1, 11.8}}},
       "knee_extensors"},
      {"vasmed",
       1443.7,
       89.01,
       116.42,
       29.61,
       {{kThigh, {13, -194.2, 17.4}}, {kThigh, {32.9, -256.2, 0.8}}, {kPatella, {-0.4, 15.7, -9.3}}},
       "knee_extensors"}};
  return muscles;
}

std::string writeNumber(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  std::string result = text;
  if (result.find_first_not_of("-0.") == std::string::npos && result.front() == '-') result.erase(0, 1);
  return result;
}

std::string writePoint(const Vec3& p) {
  return '"' + writeNumber(p.x(), 2) + " mm, " + writeNumber(p.y(), 2) + " mm, " + writeNumber(p.z(), 2) + " mm\"";
}

std::string writePathPoint(SourceFrame frame, const Vec3& p) {
  const LinkPoint point = toLink(frame, p);
  return "{body: " + point.link + ", at: " + writePoint(point.p) + "}";
}

std::string writeWrap(const Wrap& wrap) {
  const LinkPoint center = toLink(wrap.frame, wrap.center);
  // With T the half turn, T Rx(a) Ry(b) Rz(c) T = Rx(-a) Ry(b) Rz(-c); the shapes are symmetric under T.
  const Vec3 angles = wrap.angles_rad.cwiseProduct(Vec3(-1, 1, -1)) / kDegree;
  std::ostringstream out;
  out << "  " << wrap.name << ": {body: " << center.link << ", ";
  if (wrap.radii_mm.y() > 0) {
    out << "ellipsoid: {a: " << writeNumber(wrap.radii_mm.x(), 2) << " mm, b: " << writeNumber(wrap.radii_mm.y(), 2)
        << " mm, c: " << writeNumber(wrap.radii_mm.z(), 2) << " mm}";
  } else {
    out << "cylinder: {R: " << writeNumber(wrap.radii_mm.x(), 2) << " mm}";
  }
  out << ", pose: \"" << writeNumber(angles.x(), 3) << " deg, " << writeNumber(angles.y(), 3) << " deg, "
      << writeNumber(angles.z(), 3) << " deg, " << writePoint(center.p).substr(1);
  if (wrap.anterior) out << ", side: \"-1, 0, 0\"";
  out << "}\n";
  return out.str();
}

std::string writeNaturalLigaments(const std::string& comment) {
  std::ostringstream out;
  out << "ligaments:\n" << comment;
  for (const Fibre& fibre : naturalLigaments()) {
    out << "  " << fibre.name << ": {stiffness: " << writeNumber(fibre.stiffness_N, 0)
        << " N, slack: {length: " << writeNumber(fibre.slack_mm, 3) << " mm}, path: ["
        << writePathPoint(fibre.originFrame, fibre.origin) << ", ";
    if (fibre.wrap) out << "{wrap: " << fibre.wrap << "}, ";
    out << writePathPoint(fibre.insertionFrame, fibre.insertion) << "]}\n";
  }
  return out.str();
}

std::string writeVector_m(const Vec3& p) {
  return writeNumber(p.x() / 1000, 5) + " " + writeNumber(p.y() / 1000, 5) + " " + writeNumber(p.z() / 1000, 5);
}

void writeText(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.close();
  if (!out) throw InputError(file.string() + ": cannot be written");
}

}  // namespace genu::make_models
