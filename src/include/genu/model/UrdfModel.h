#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "genu/contact/Types.h"
#include "genu/scene/Scene.h"

namespace genu::model {

/** Mass properties of a link: mass [kg], center of mass from the link's origin in link axes [m], inertia about the
 center of mass in link axes [kg m^2]. */
struct LinkInertia {
  double mass_kg = 0;
  contact::Vec3 center_m = contact::Vec3::Zero();
  contact::Mat3 inertia_kgM2 = contact::Mat3::Zero();
};

enum class JointType { fixed, floating, rotation, translation };

struct UrdfJoint {
  std::string name;
  JointType type = JointType::fixed;
  int parent = -1;     ///< link index
  contact::Pose X_PF;  ///< joint frame in the parent link: `origin` of the joint; the child link's frame is M
  contact::Vec3 axis_F = contact::Vec3::UnitX();  ///< of a rotation or translation, unit length
  int firstCoordinate = -1;  ///< in the scene's coordinates; -1: fixed

  /** X_FM: R = Rx Ry Rz then p of a floating joint, a turn or shift along the axis of a simple one.
   @param q the scene's coordinates */
  contact::Pose calcPose(const double* q) const;
};

struct UrdfLink {
  std::string name;
  std::optional<LinkInertia> inertia;  ///< absent: no <inertial>
  std::optional<UrdfJoint> joint;      ///< to the parent; absent for the root
};

/** A tree of links read from a URDF file, the root first and every parent before its children.

 Supported: `fixed`, `floating` (the six coordinates of contact::JointCoordinates), `revolute`, `continuous` and
 `prismatic` joints; all but the fixed ones are listed in the scene. Geometry (visual, collision), limits and dynamics
 tags are not used: contact surfaces, stops, damping and loads are given by the scene.
 Mass properties are needed for the child of a moving joint, unless the next joint down the tree moves too (a universal joint
 through links without mass); other links may omit <inertial>. Where it is given it must be physical: mass > 0, principal moments > 0
 that satisfy the triangle inequality I1 + I2 >= I3 (tolerance 1e-6 I3).

 Format: http://wiki.ros.org/urdf/XML, read by urdfdom. */
struct UrdfModel {
  std::filesystem::path file;
  std::vector<UrdfLink> links;
  /** Link index of the child of the only joint, where the scene has one (ModelSpec::joint); otherwise -1. */
  int floatingChild = -1;

  int floatingParent() const { return floatingChild < 0 ? -1 : links[static_cast<size_t>(floatingChild)].joint->parent; }
  /** Index of a link; -1 when there is none of this name. */
  int findLink(const std::string& name) const;
};

/** The frame a scene means when it names a link: the link's, but F (the joint's frame) for the parent link of a scene's only
 joint, so that its coordinates, contact pairs and load points share F and M. */
struct LinkFrame {
  int link = -1;
  contact::Pose X_LinkFrame;    ///< the frame in its link
};

/** @param use names where the link is asked for, for the message
    @throws InputError when the file has no such link; lists the links */
LinkFrame findFrame(const UrdfModel& model, const std::string& linkName, const std::string& use);

/** Pose of every link's frame in the root's, at the scene's coordinates q. */
std::vector<contact::Pose> calcLinkPoses(const UrdfModel& model, const double* q);

/** The two frames of a contact pair. Empty names mean F and M of the only floating joint.
    @throws InputError when a link does not exist, no name is given and there are several floating joints or none, or no moving joint
    lies between the two */
struct ContactFrames {
  LinkFrame fixed, moving;
  /** Pose of the pair's moving frame in its fixed frame at the scene's coordinates q. */
  contact::Pose calcPose(const double* q) const;
  contact::Pose calcPose(const std::vector<double>& q) const { return calcPose(q.data()); }
  contact::Pose calcPose(const contact::JointCoordinates& q) const { return calcPose(q.data()); }

  /** From the fixed frame to the moving one: joints to go up (towards the root, inverted), then down. */
  struct Step {
    UrdfJoint joint;
    bool up = false;
  };
  std::vector<Step> steps;
};
ContactFrames findContactFrames(const UrdfModel& model, const scene::ContactSpec& contact);

/** Reads the URDF of a model.
    @throws InputError naming the file and where possible line, link, value: file missing or unreadable, malformed XML,
    not one tree, unknown or unsupported joint type, a joint of the scene that is missing or of another type, a moving joint that the
    scene does not list, mass not positive, inertia not physical, a number that is not finite */
UrdfModel readUrdf(const scene::ModelSpec& model);

}  // namespace genu::model
