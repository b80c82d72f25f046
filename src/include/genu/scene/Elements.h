#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "genu/contact/Types.h"
#include "genu/io/Units.h"
#include "genu/musculoskeletal/LigamentLaw.h"
#include "genu/musculoskeletal/Muscle.h"
#include "genu/musculoskeletal/WrapSurface.h"
#include "genu/scene/SceneNode.h"
#include "genu/scene/TimeFunction.h"

/** Force elements as a scene defines them: read and checked, in SI, without Simbody. An element is known by the keyword of its
 section (`ligaments`, `muscles`, `springs`, or one that a program adds, docs/extending.md). */

namespace genu::scene {

struct ModelSpec;

class ElementDefinition {
 public:
  virtual ~ElementDefinition() = default;

  std::string keyword;  ///< section of the scene, set by the reader of the scene
  std::string name;     ///< key in that section, set likewise
  std::string key() const { return keyword + "." + name; }

  /** One line for `genu explain`. */
  virtual std::string describe() const = 0;
};

/** A surface that paths may wrap over. */
struct WrapDefinition {
  std::string name;
  std::string body;          ///< link
  contact::Pose X_BodyW;     ///< the surface's frame in the link's
  musculoskeletal::WrapSurface surface;
};

/** A point fixed in a link, or moving in it with a coordinate of the model: natural cubic spline through p_m over q, straight beyond its
 ends. */
struct PathPoint {
  std::string body;
  contact::Vec3 point_m = contact::Vec3::Zero();
  int coordinate = -1;               ///< index in ModelSpec::coordinates; -1: fixed
  std::vector<double> q;             ///< rad or m, increasing
  std::vector<contact::Vec3> p_m;
};

/** A string from the first point to the last through those between, over at most one surface between two of them. */
struct PathDefinition {
  std::vector<PathPoint> points;
  std::vector<int> wraps;  ///< one per pair of neighbours: index in Scene::wraps, -1 for none
};

/** "femur to tibia, 1 point between, 1 wrap", for ElementDefinition::describe. */
std::string describePath(const PathDefinition& path);

struct LigamentDefinition : ElementDefinition {
  struct Length { double length_m; };
  struct Strain { double strain; std::string pose; };
  struct Tension { double tension_N; std::string pose; };

  PathDefinition path;
  double stiffness = 0;            ///< N per unit strain, or N/m
  bool perLength = false;          ///< `stiffness` is in N/m: times the slack length
  std::variant<Length, Strain, Tension> slack;
  double toeStrain = 0.03, dampingTime_s = 0;

  std::string describe() const override;
};

/** A linear spring along a path, for meniscal horns and hoops:

   f = k (L - L0) + c dL/dt,  cut off at 0 where it acts in tension only */
struct SpringDefinition : ElementDefinition {
  PathDefinition path;
  double stiffness_NPerM = 0, restLength_m = 0, damping_NSPerM = 0;
  bool tensionOnly = true;
  /** Rest length found from a tension in a named pose instead. */
  std::optional<LigamentDefinition::Tension> restFromTension;

  std::string describe() const override;
};

/** Excitation that follows a coordinate:

   e = e0(t) + Kp (q_target(t) - q) + Kd (dq_target/dt - dq/dt),  cut to [0, 1] */
struct TrackingController {
  int coordinate = 0;        ///< index in ModelSpec::coordinates
  TimeFunction target = 0.0;
  double gain = 0;           ///< 1/rad or 1/m, either sign
  double rateGain = 0;       ///< s/rad or s/m
  TimeFunction rest = 0.0;   ///< e0, a feed-forward where it varies; each value in [0, 1]
};

struct MuscleDefinition : ElementDefinition {
  PathDefinition path;
  musculoskeletal::Muscle muscle;
  bool compliantTendon = false;
  musculoskeletal::ActivationDynamics activation;
  std::variant<TimeFunction, TrackingController> excitation = TimeFunction(0.0);
  std::string coordinateName;  ///< that a controller tracks

  std::string describe() const override;
};

/** What the reader of an element may ask of the scene it stands in. */
class ElementContext {
 public:
  virtual ~ElementContext() = default;
  /** @throws InputError when the scene has none, at `node` */
  virtual const ModelSpec& getModel(const SceneNode& node) = 0;
  virtual PathDefinition readPath(const SceneNode& node) = 0;
  /** A quantity or a table over time. */
  virtual TimeFunction readTimeFunction(const SceneNode& node, io::Dimension dimension) = 0;
  /** Index of the coordinate that `node` names. */
  virtual int readCoordinate(const SceneNode& node) = 0;
  /** Name of a pose that the scene defines. */
  virtual std::string readPoseName(const SceneNode& node) = 0;
  virtual contact::Vec3 readPoint(const SceneNode& node) = 0;
};

/** Makes a definition from the value of `keyword.name`. @throws InputError through SceneNode::fail() */
using ElementReader = std::function<std::shared_ptr<ElementDefinition>(const SceneNode& node, ElementContext& context)>;

/** Makes `keyword` a section of scene files. Programs call model::registerForceElement, which does this too.
 @throws std::invalid_argument when the keyword is taken */
void registerElementReader(const std::string& keyword, ElementReader reader);
std::vector<std::string> listElementKeywords();
/** nullptr for an unknown keyword */
const ElementReader* findElementReader(const std::string& keyword);

}  // namespace genu::scene
