#include "genu/model/UrdfModel.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <fstream>
#include <mutex>
#include <sstream>

#include "genu/io/Suggest.h"

namespace genu::model {

namespace {

using contact::Mat3;
using contact::Pose;
using contact::Vec3;

/** Collects what urdfdom logs, so that it ends up in the message instead of on the console. */
class LogCapture : public console_bridge::OutputHandler {
 public:
  LogCapture() { console_bridge::useOutputHandler(this); }
  ~LogCapture() override { console_bridge::restorePreviousOutputHandler(); }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR) return;
    if (!text_.empty()) text_ += "; ";
    text_ += text;
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/** Where elements stand in the file: urdfdom forgets it. */
class Places {
 public:
  Places(std::string file, const TiXmlDocument& document) : file_(std::move(file)), root_(document.RootElement()) {}

  std::string place(const char* tag, const std::string& name) const {
    for (const TiXmlElement* e = root_ ? root_->FirstChildElement(tag) : nullptr; e; e = e->NextSiblingElement(tag)) {
      const char* attribute = e->Attribute("name");
      if (attribute && name == attribute) {
        return file_ + ":" + std::to_string(e->Row()) + ": " + tag + " '" + name + "': ";
      }
    }
    return file_ + ": " + tag + " '" + name + "': ";
  }

 private:
  std::string file_;
  const TiXmlElement* root_;
};

const char* typeName(const urdf::Joint& joint) {
  switch (joint.type) {
    case urdf::Joint::REVOLUTE:
      return "revolute";
    case urdf::Joint::CONTINUOUS:
      return "continuous";
    case urdf::Joint::PRISMATIC:
      return "prismatic";
    case urdf::Joint::FLOATING:
      return "floating";
    case urdf::Joint::PLANAR:
      return "planar";
    case urdf::Joint::FIXED:
      return "fixed";
    default:
      return "unknown";
  }
}

Pose toPose(const urdf::Pose& pose, const std::string& place) {
  Eigen::Quaterniond rotation(pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z);
  Pose X;
  X.p = Vec3(pose.position.x, pose.position.y, pose.position.z);
  X.R = rotation.normalized().toRotationMatrix();
  if (!X.p.allFinite() || !X.R.allFinite()) throw InputError(place + "its origin has a value that is not finite");
  return X;
}

LinkInertia toInertia(const urdf::Inertial& inertial, const std::string& place) {
  LinkInertia result;
  result.mass_kg = inertial.mass;
  if (!(inertial.mass > 0) || !std::isfinite(inertial.mass)) {
    std::ostringstream text;
    text << place << "mass is " << inertial.mass << " kg; it must be positive";
    throw InputError(text.str());
  }
  const Pose X = toPose(inertial.origin, place);
  Mat3 inertia;
  inertia << inertial.ixx, inertial.ixy, inertial.ixz, inertial.ixy, inertial.iyy, inertial.iyz, inertial.ixz,
      inertial.iyz, inertial.izz;
  if (!inertia.allFinite()) throw InputError(place + "inertia has a value that is not finite");
  const Vec3 principal = Eigen::SelfAdjointEigenSolver<Mat3>(inertia, Eigen::EigenvaluesOnly).eigenvalues();
  if (!(principal[0] > 0) || principal[0] + principal[1] < principal[2] * (1 - 1e-6)) {
    std::ostringstream text;
    text << place << "inertia is not that of a body: its principal moments are " << principal[0] << ", " << principal[1]
         << ", " << principal[2]
         << " kg m^2; all must be positive and the two smaller ones together at least the largest";
    throw InputError(text.str());
  }
  result.center_m = X.p;
  result.inertia_kgM2 = X.R * inertia * X.R.transpose();
  return result;
}

class Reader {
 public:
  Reader(UrdfModel& model, const Places& places, const scene::ModelSpec& spec) : model_(model), places_(places), only_(spec.joint) {
    joints_ = spec.joints;
    if (joints_.empty()) joints_.push_back({spec.joint, scene::JointSpec::Kind::floating});
    int first = 0;
    for (const scene::JointSpec& joint : joints_) {
      firstCoordinates_.push_back(first);
      first += joint.numCoordinates();
    }
  }

  void addSubtree(const urdf::Link& link, int parent) {
    const int index = addLink(link, parent);
    for (const auto& child : link.child_links) addSubtree(*child, index);
  }

 private:
  static const char* describe(scene::JointSpec::Kind kind) {
    switch (kind) {
      case scene::JointSpec::Kind::floating:
        return "must be 'floating' (six coordinates)";
      case scene::JointSpec::Kind::rotation:
        return "must be 'revolute' or 'continuous' (coordinate angle)";
      default:
        return "must be 'prismatic' (coordinate translation)";
    }
  }
  static JointType typeOf(const urdf::Joint& joint) {
    switch (joint.type) {
      case urdf::Joint::FLOATING:
        return JointType::floating;
      case urdf::Joint::REVOLUTE:
      case urdf::Joint::CONTINUOUS:
        return JointType::rotation;
      case urdf::Joint::PRISMATIC:
        return JointType::translation;
      default:
        return JointType::fixed;
    }
  }
  static JointType typeOf(scene::JointSpec::Kind kind) {
    return kind == scene::JointSpec::Kind::floating   ? JointType::floating
           : kind == scene::JointSpec::Kind::rotation ? JointType::rotation
                                                      : JointType::translation;
  }

  UrdfJoint makeJoint(const urdf::Joint& joint, int parent) {
    const std::string place = places_.place("joint", joint.name);
    UrdfJoint own;
    own.name = joint.name;
    own.parent = parent;
    own.X_PF = toPose(joint.parent_to_joint_origin_transform, place);
    own.type = typeOf(joint);
    size_t index = 0;
    while (index < joints_.size() && joints_[index].name != joint.name) ++index;
    if (index == joints_.size()) {
      if (joint.type == urdf::Joint::FIXED) return own;
      const bool known = own.type != JointType::fixed;
      throw InputError(place + "type '" + typeName(joint) + "' is not supported here; " +
                       (!only_.empty() ? "use 'fixed', or 'floating' for the joint the scene names ('" + only_ + "')"
                        : known ? "the scene's model.joints must list it, as every joint that moves"
                                : "supported are fixed, floating, revolute, continuous and prismatic"));
    }
    const scene::JointSpec& spec = joints_[index];
    if (joint.type == urdf::Joint::FIXED || typeOf(spec.kind) != own.type) {
      throw InputError(place + "is '" + typeName(joint) + "', but the scene's joint " + describe(spec.kind));
    }
    own.firstCoordinate = firstCoordinates_[index];
    if (own.type != JointType::floating) {
      own.axis_F = Vec3(joint.axis.x, joint.axis.y, joint.axis.z);
      const double length = own.axis_F.norm();
      if (!(length > 1e-6) || !std::isfinite(length)) throw InputError(place + "its axis has no direction");
      own.axis_F /= length;
    }
    return own;
  }

  static bool moves(const urdf::Joint& joint) { return typeOf(joint) != JointType::fixed; }

  int addLink(const urdf::Link& link, int parent) {
    UrdfLink result;
    result.name = link.name;
    const std::string place = places_.place("link", link.name);
    if (link.inertial) result.inertia = toInertia(*link.inertial, place);
    const int index = static_cast<int>(model_.links.size());
    if (link.parent_joint) {
      result.joint = makeJoint(*link.parent_joint, parent);
      if (result.joint->type != JointType::fixed) {
        if (!only_.empty()) model_.floatingChild = index;
        bool carries = result.inertia.has_value();
        for (const auto& child : link.child_joints) carries = carries || moves(*child);
        if (!carries) {
          throw InputError(place + "has no <inertial>; the moving link of joint '" + result.joint->name +
                           "' needs a mass [kg] and an inertia [kg m^2]");
        }
      }
    }
    model_.links.push_back(std::move(result));
    return index;
  }

  UrdfModel& model_;
  const Places& places_;
  std::string only_;
  std::vector<scene::JointSpec> joints_;
  std::vector<int> firstCoordinates_;
};

}  // namespace

Pose UrdfJoint::calcPose(const double* q) const {
  Pose X;
  if (type == JointType::fixed) return X;
  const double* own = q + firstCoordinate;
  if (type == JointType::floating) {
    contact::JointCoordinates six{};
    for (size_t i = 0; i < 6; ++i) six[i] = own[i];
    return contact::calcPose(six);
  }
  if (type == JointType::rotation) {
    X.R = Eigen::AngleAxisd(*own, axis_F).toRotationMatrix();
  } else {
    X.p = *own * axis_F;
  }
  return X;
}

int UrdfModel::findLink(const std::string& name) const {
  for (size_t i = 0; i < links.size(); ++i) {
    if (links[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

LinkFrame findFrame(const UrdfModel& model, const std::string& linkName, const std::string& use) {
  LinkFrame frame;
  frame.link = model.findLink(linkName);
  if (frame.link < 0) {
    std::vector<std::string> names;
    for (const UrdfLink& link : model.links) names.push_back(link.name);
    throw InputError(use + ": " + model.file.string() + ": " + io::describeUnknown("link", linkName, names));
  }
  if (frame.link == model.floatingParent()) frame.X_LinkFrame = model.links[static_cast<size_t>(model.floatingChild)].joint->X_PF;
  return frame;
}

std::vector<Pose> calcLinkPoses(const UrdfModel& model, const double* q) {
  std::vector<Pose> poses;
  for (const UrdfLink& link : model.links) {
    if (!link.joint) {
      poses.emplace_back();
      continue;
    }
    poses.push_back(poses[static_cast<size_t>(link.joint->parent)] * link.joint->X_PF * link.joint->calcPose(q));
  }
  return poses;
}

ContactFrames findContactFrames(const UrdfModel& model, const scene::ContactSpec& contact) {
  const std::string where = "contact '" + contact.name + "'";
  int child = -1, numFloating = 0;
  for (size_t i = 0; i < model.links.size(); ++i) {
    if (!model.links[i].joint || model.links[i].joint->type != JointType::floating) continue;
    child = static_cast<int>(i);
    ++numFloating;
  }
  const auto nameOf = [&](const std::string& given, const char* side) {
    if (!given.empty()) return given;
    if (numFloating != 1) {
      throw InputError(where + ": the model has " + std::to_string(numFloating) + " floating joints; say which link the " + side +
                       " side is on (" + side + ": {body: ...})");
    }
    const int standard = side == std::string("moving") ? child : model.links[static_cast<size_t>(child)].joint->parent;
    return model.links[static_cast<size_t>(standard)].name;
  };
  ContactFrames frames;
  frames.fixed = findFrame(model, nameOf(contact.fixedBody, "fixed"), where + ", fixed body");
  frames.moving = findFrame(model, nameOf(contact.movingBody, "moving"), where + ", moving body");
  // Only named joint, with names left out, through `joints`: the frames are F and M all the same.
  if (contact.fixedBody.empty() && model.floatingChild < 0) {
    frames.fixed.X_LinkFrame = model.links[static_cast<size_t>(child)].joint->X_PF;
  }

  const auto chainOf = [&](int link) {  // links from the root's first child down to it
    std::vector<int> chain;
    for (int i = link; model.links[static_cast<size_t>(i)].joint; i = model.links[static_cast<size_t>(i)].joint->parent) {
      chain.insert(chain.begin(), i);
    }
    return chain;
  };
  std::vector<int> up = chainOf(frames.fixed.link), down = chainOf(frames.moving.link);
  size_t common = 0;
  while (common < up.size() && common < down.size() && up[common] == down[common]) ++common;
  bool moves = false;
  const auto add = [&](int link, bool isUp) {
    const UrdfJoint& joint = *model.links[static_cast<size_t>(link)].joint;
    moves = moves || joint.type != JointType::fixed;
    frames.steps.push_back({joint, isUp});
  };
  for (size_t i = up.size(); i > common; --i) add(up[i - 1], true);
  for (size_t i = common; i < down.size(); ++i) add(down[i], false);
  if (!moves) {
    throw InputError(where + ": its two bodies '" + model.links[static_cast<size_t>(frames.fixed.link)].name + "' and '" +
                     model.links[static_cast<size_t>(frames.moving.link)].name +
                     "' never move against each other: no joint that moves lies between them");
  }
  return frames;
}

Pose ContactFrames::calcPose(const double* q) const {
  Pose X = fixed.X_LinkFrame.inverse();
  for (const Step& step : steps) {
    const Pose X_PM = step.joint.X_PF * step.joint.calcPose(q);
    X = X * (step.up ? X_PM.inverse() : X_PM);
  }
  return X * moving.X_LinkFrame;
}

UrdfModel readUrdf(const scene::ModelSpec& spec) {
  const std::filesystem::path& file = spec.urdf;
  const std::string name = file.string();
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream buffer;
  if (!std::filesystem::is_regular_file(file) || !stream || !(buffer << stream.rdbuf())) {
    throw InputError(name + ": cannot be read (URDF of the model)");
  }
  const std::string text = buffer.str();

  TiXmlDocument document;
  document.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
  if (document.Error()) {
    throw InputError(name + ":" + std::to_string(document.ErrorRow()) + ":" + std::to_string(document.ErrorCol()) +
                     ": malformed XML: " + document.ErrorDesc());
  }
  const Places places(name, document);

  static std::mutex logMutex;  // console_bridge has one handler per process
  urdf::ModelInterfaceSharedPtr parsed;
  {
    const std::lock_guard<std::mutex> lock(logMutex);
    const LogCapture log;
    try {
      parsed = urdf::parseURDF(text);
    } catch (const std::exception& error) {
      throw InputError(name + ": not a valid URDF: " + error.what());
    }
    if (!parsed || !parsed->getRoot()) {
      throw InputError(name + ": not a valid URDF: " + (log.text().empty() ? "it has no root link" : log.text()));
    }
  }

  std::vector<scene::JointSpec> wanted = spec.joints;
  if (wanted.empty()) wanted.push_back({spec.joint, scene::JointSpec::Kind::floating, spec.jointPlace});
  for (const scene::JointSpec& joint : wanted) {
    if (parsed->getJoint(joint.name)) continue;
    std::vector<std::string> names;
    for (const auto& entry : parsed->joints_) names.push_back(entry.first);
    throw InputError((joint.place.empty() ? "" : joint.place + ": ") + name + ": " + io::describeUnknown("joint", joint.name, names));
  }
  UrdfModel model;
  model.file = file;
  Reader(model, places, spec).addSubtree(*parsed->getRoot(), -1);
  if (model.links.size() != parsed->links_.size()) {
    // Links of a loop own each other and would never be freed.
    for (const auto& entry : parsed->links_) entry.second->child_links.clear();
    throw InputError(name + ": not a valid URDF: only " + std::to_string(model.links.size()) + " of its " +
                     std::to_string(parsed->links_.size()) + " links hang on the root link '" +
                     parsed->getRoot()->name + "'; the joints form a loop");
  }
  return model;
}

}  // namespace genu::model
