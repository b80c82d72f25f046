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
#include "genu/scene/Elements.h"
#include "genu/scene/Errors.h"
#include "genu/scene/TimeFunction.h"

namespace genu::scene {

/** A scene file, parsed and checked, in SI. Keys and defaults: docs/scene.md. This struct knows nothing of Simbody. */

/** The six coordinates in the order of contact::JointCoordinates. */
inline constexpr std::array<const char*, 6> kCoordinateNames = {"rx", "ry", "rz", "x", "y", "z"};

struct PrescribedCoordinate {
  TimeFunction motion;  ///< rad or m
};
/** A soft stop: no force inside [lower, upper], k (1 + d v) s beyond, s the overshoot, v its rate (Simbody's
 Force::MobilityLinearStop); never pulls. */
struct CoordinateLimits {
  double lower = 0, upper = 0;  ///< rad or m
  double stiffness = 0;         ///< N m/rad or N/m
  double dissipation = 0;       ///< s/rad or s/m
};
struct FreeCoordinate {
  std::optional<double> start;  ///< rad or m; absent: found by closing the gap (y of a floating joint) or 0
  double damping = 0;           ///< viscous, N s/m or N m s/rad, acts in dynamic analyses
  std::optional<CoordinateLimits> limits = {};
};
using CoordinateSpec = std::variant<PrescribedCoordinate, FreeCoordinate>;

/** A joint of the URDF that moves. Floating: the six coordinates of contact::JointCoordinates; rotation (revolute, continuous): `angle`;
 translation (prismatic): `translation`. */
struct JointSpec {
  enum class Kind { floating, rotation, translation };
  std::string name;
  Kind kind = Kind::floating;
  std::string place = {};  ///< "scene.yaml:8: model.joints.knee", for messages; may be empty

  int numCoordinates() const { return kind == Kind::floating ? 6 : 1; }
};

struct ModelSpec {
  std::filesystem::path urdf;  ///< absolute
  /** The only joint, floating: its parent link is F, its child link M, and coordinates have no prefix. Empty when `joints` names them. */
  std::string joint;
  std::string jointPlace;  ///< as JointSpec::place
  std::vector<JointSpec> joints;
  std::array<double, 3> gravity_mPerS2 = {0, 0, 0};  ///< in ground
  std::vector<CoordinateSpec> coordinates = std::vector<CoordinateSpec>(6);  ///< of all joints, in their order
};

/** What one coordinate of a model is. */
struct CoordinateInfo {
  std::string name;       ///< "rx" of the only joint, "tibiofemoral.rx", "hip.angle"
  std::string shortName;  ///< without the joint
  std::string joint;
  int axis = 0;           ///< of a floating joint: 0 to 5, in the order of kCoordinateNames; otherwise 0
  bool isAngle = true;    ///< rad, otherwise m
  bool isFree = false;

  const char* unit() const { return isAngle ? "deg" : "mm"; }      ///< that people read
  double unitsPerSi() const;                                       ///< 180/pi or 1000
};
/** The coordinates of a model, in the order of ModelSpec::coordinates; of a scene without one, the six of a pose. */
std::vector<CoordinateInfo> listCoordinates(const ModelSpec& model);

/** A load on a body: a force at a point and a moment. */
struct LoadSpec {
  std::string name;
  std::string body;                     ///< link the load acts on; the reaction is not applied anywhere
  std::string frame;                    ///< link whose axes the components use
  std::array<TimeFunction, 3> force_N = {0.0, 0.0, 0.0};
  std::array<TimeFunction, 3> moment_Nm = {0.0, 0.0, 0.0};
  std::string pointBody;                ///< link whose frame the point is given in
  std::array<TimeFunction, 3> point_m = {0.0, 0.0, 0.0};

  bool hasMoment() const;               ///< not zero throughout
};

/** A load applied directly to a coordinate: generalized force. On a prescribed coordinate it is an error. */
struct GeneralizedLoadSpec {
  std::string name;
  int coordinate = 0;  ///< index in ModelSpec::coordinates
  TimeFunction value;  ///< N or N m
};

struct ContactSpec {
  std::string name;
  std::string fixedBody, movingBody;  ///< links; empty: the joint's parent and child
  contact::ContactPairDefinition definition;
};

struct StaticSpec {
  enum class Method { implicitEuler, newton, both, kinsol };
  Method method = Method::newton;
  double maxAcceleration_mPerS2 = 1e-3;  ///< implicit Euler stops below it (and rad/s^2 alike)
  double maxResidual_N = 1e-6;           ///< Newton: largest force residual (moments over 25 mm)
  double damping_NsPerM = 0;             ///< implicit Euler's numerical damping on each translation; 0: chosen
  double maxTime_s = 60;                 ///< implicit Euler: simulated time limit
  double time_s = 0;                     ///< tables are read at this time
  /** Search for more equilibria from starts spread around the first one, up to so far in every free coordinate. */
  struct Search {
    int starts = 30;
    double translation_m = 3e-3, angle_rad = 0.17;
    double maxWallTime_s = 600;  ///< the search ends beyond, with what it has
  };
  std::optional<Search> search;
};

struct GaitSpec {
  double duration_s = 1;
  double outputInterval_s = 0.01;
  double accuracy = 1e-4;       ///< sets all tolerances: times 1 mm and 10 m/s, angles at 25 mm
  /** Absolute tolerances of a step where they are not to follow from accuracy. */
  struct Tolerances {
    std::optional<double> translation_m, angle_rad, speed_mPerS, angularSpeed_radPerS;
  } tolerances;
  std::string integrator;       ///< empty: the program's standard, model::chooseIntegrator()
  int maxOrder = 0;             ///< of multistep methods; 0: the integrator's own
  double step_s = 0;            ///< of fixed-step methods; 0: the integrator's own
  /** Prescribed coordinates: no unknowns, or unknowns with a constraint each; automatic: as docs/integrators.md says. */
  enum class Prescribed { automatic, eliminated, constraints };
  Prescribed prescribed = Prescribed::automatic;
  long maxSteps = 1000000;      ///< the run fails beyond
  double maxWallTime_s = 3600;  ///< the run ends beyond, with what it has
  bool settleFirst = true;      ///< static analysis at t = 0 first
  bool errorEstimate = false;   ///< a second run tells what the integration errs by
};

/** Static equilibria at successive times, each from the one before (quasi-static motion). */
struct SeriesSpec {
  double duration_s = 1;
  double outputInterval_s = 0.01;
};

/** A pose by name: coordinates in the order of ModelSpec::coordinates. */
using NamedPoses = std::map<std::string, std::vector<double>>;

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
  std::optional<SeriesSpec> series;
  NamedPoses poses;
  std::vector<WrapDefinition> wraps;
  /** Force elements beside contact and loads (ligaments, muscles, ...), in the order of the file. */
  std::vector<std::shared_ptr<const ElementDefinition>> elements;
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

  /** listCoordinates(*model), or the six of a pose. */
  std::vector<CoordinateInfo> coordinates() const { return listCoordinates(model ? *model : ModelSpec()); }
};

}  // namespace genu::scene
