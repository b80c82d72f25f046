#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/scene/Errors.h"

namespace genu::scene {

/** A scene file, parsed and checked, in SI. Keys and defaults: docs/scene.md. This struct knows nothing of Simbody. */

/** The six coordinates in the order of contact::JointCoordinates. */
inline constexpr std::array<const char*, 6> kCoordinateNames = {"rx", "ry", "rz", "x", "y", "z"};

/** A column of a table over time: values in SI at increasing times [s]. */
struct TimeSeries {
  std::vector<double> time_s;
  std::vector<double> value;
  std::string source;  ///< "file.csv, column rz_deg", for messages
};

/** A value over time: constant or through a table. */
using TimeFunction = std::variant<double, TimeSeries>;

struct PrescribedCoordinate {
  TimeFunction motion;  ///< rad or m
};
struct FreeCoordinate {
  std::optional<double> start;  ///< rad or m; absent: found by closing the gap (y) or 0
  double damping = 0;           ///< viscous, N s/m or N m s/rad, acts in dynamic analyses
};
using CoordinateSpec = std::variant<PrescribedCoordinate, FreeCoordinate>;

struct ModelSpec {
  std::filesystem::path urdf;  ///< absolute
  std::string joint;           ///< the floating joint: parent link F, child link M
  std::array<double, 3> gravity_mPerS2 = {0, 0, 0};  ///< in ground
  std::array<CoordinateSpec, 6> coordinates;
};

/** A force at a point. */
struct LoadSpec {
  std::string name;
  std::string body;                     ///< link the force acts on; the reaction is not applied anywhere
  std::string frame;                    ///< link whose axes the components use
  std::array<TimeFunction, 3> force_N;
  std::string pointBody;                ///< link the point is fixed in
  std::array<double, 3> point_m = {0, 0, 0};
};

/** A load applied directly to a coordinate: generalized force. On a prescribed coordinate it is an error. */
struct GeneralizedLoadSpec {
  std::string name;
  int coordinate = 0;
  TimeFunction value;  ///< N or N m
};

struct ContactSpec {
  std::string name;
  std::string fixedBody, movingBody;  ///< links; empty: the joint's parent and child
  contact::ContactPairDefinition definition;
};

struct StaticSpec {
  enum class Method { implicitEuler, newton, both };
  Method method = Method::newton;
  double maxAcceleration_mPerS2 = 1e-3;  ///< implicit Euler stops below it (and rad/s^2 alike)
  double maxResidual_N = 1e-6;           ///< Newton: largest force residual (moments over 25 mm)
  double damping_NsPerM = 0;             ///< implicit Euler's numerical damping on each translation; 0: chosen
  double maxTime_s = 60;                 ///< implicit Euler: simulated time limit
  double time_s = 0;                     ///< tables are read at this time
};

struct GaitSpec {
  double duration_s = 1;
  double outputInterval_s = 0.01;
  double accuracy = 1e-4;       ///< CPodes accuracy
  std::string integrator = "cpodes";
  bool settleFirst = true;      ///< static analysis at t = 0 first
};

struct OutputSpec {
  bool maps = true;    ///< pressure maps (.vtp)
  bool plots = true;
};

/** A surface a scene defines, for reports. */
struct SurfaceSummary {
  std::string name;
  std::string kind;            ///< nurbs, plane, dish, paraboloid, sphere, cylinder, ellipsoid, torus
  std::filesystem::path file;  ///< absolute; nurbs only
  int patches = 0;             ///< 0 when nothing uses the surface
  int controlPoints = 0;
  std::vector<std::string> usedBy;  ///< "contact.tibiofemoral.medial, fixed"; empty: left out
};

struct Scene {
  std::filesystem::path file;
  std::string name;
  std::optional<ModelSpec> model;                      ///< absent: only `genu contact`
  std::vector<ContactSpec> contacts;
  std::vector<LoadSpec> loads;
  std::vector<GeneralizedLoadSpec> generalizedLoads;
  std::optional<StaticSpec> staticAnalysis;
  std::optional<GaitSpec> gait;
  OutputSpec output;
  double cycle_s = 1;  ///< tables over percent of a cycle span it
  std::vector<SurfaceSummary> surfaces;
  std::vector<std::string> unused;  ///< key paths of definitions that nothing uses: "materials.soft"
  /** SHA-256 of every file read (the scene itself included): path as written -> hexadecimal digest. */
  std::map<std::string, std::string> inputHashes;
  std::map<std::string, int> keyLines;  ///< line of every key: "loads.axial.body" -> 31

  /** "scene.yaml:31: loads.axial.body", to begin a message with; a key the file does not have takes the line of its
   nearest parent. */
  std::string where(const std::string& keyPath) const;
};

}  // namespace genu::scene
