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

enum class JointType { fixed, floating };

struct UrdfJoint {
  std::string name;
  JointType type = JointType::fixed;
  int parent = -1;     ///< link index
  contact::Pose X_PF;  ///< joint frame in the parent link: `origin` of the joint; the child link's frame is M
};

struct UrdfLink {
  std::string name;
  std::optional<LinkInertia> inertia;  ///< absent: no <inertial>
  std::optional<UrdfJoint> joint;      ///< to the parent; absent for the root
};

/** A tree of links read from a URDF file, the root first and every parent before its children.

 Supported: `fixed` joints, and one `floating` joint, the six coordinates of contact::JointCoordinates. Geometry
 (visual, collision), limits and dynamics tags are not used: contact surfaces, damping and loads are given by the scene.
 Mass properties are needed for the floating joint's child; other links may omit <inertial>. Where it is given it must
 be physical: mass > 0, principal moments > 0 that satisfy the triangle inequality I1 + I2 >= I3 (tolerance 1e-6 I3).

 Format: http://wiki.ros.org/urdf/XML, read by urdfdom. */
struct UrdfModel {
  std::filesystem::path file;
  std::vector<UrdfLink> links;
  int floatingChild = -1;  ///< link index of the floating joint's child

  const UrdfJoint& floatingJoint() const { return *links[static_cast<size_t>(floatingChild)].joint; }
  int floatingParent() const { return floatingJoint().parent; }
  /** Index of a link; -1 when there is none of this name. */
  int findLink(const std::string& name) const;
};

/** The frame a scene means when it names a link: F (the joint's frame) for the floating joint's parent link, the link
 frame for all others, so that coordinates, contact pairs and load points of the joint share F and M. */
struct LinkFrame {
  int link = -1;
  contact::Pose X_LinkFrame;    ///< the frame in its link
  bool moves = false;           ///< on the moving side of the floating joint
  contact::Pose X_AnchorFrame;  ///< in F, or in M when it moves: constant, only fixed joints lie between
};

/** @param use names where the link is asked for, for the message
    @throws InputError when the file has no such link; lists the links */
LinkFrame findFrame(const UrdfModel& model, const std::string& linkName, const std::string& use);

/** The two frames of a contact pair; empty names mean F and M.
    @throws InputError when a link does not exist or both are on the same side of the joint */
struct ContactFrames {
  LinkFrame fixed, moving;
  /** Pose of the pair's moving frame in its fixed frame at joint coordinates q. */
  contact::Pose calcPose(const contact::JointCoordinates& q) const;
};
ContactFrames findContactFrames(const UrdfModel& model, const scene::ContactSpec& contact);

/** Reads `file`; `floatingJoint` is the joint the scene names.
    @throws InputError naming the file and where possible line, link, value: file missing or unreadable, malformed XML,
    not one tree, unknown or unsupported joint type, no such joint or not `floating`, mass not positive, inertia not
    physical, a number that is not finite */
UrdfModel readUrdf(const std::filesystem::path& file, const std::string& floatingJoint);

}  // namespace genu::model
