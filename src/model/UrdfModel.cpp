#include "genu/model/UrdfModel.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <fstream>
#include <mutex>
#include <sstream>

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
  Reader(UrdfModel& model, const Places& places, const std::string& floatingJoint)
      : model_(model), places_(places), floatingJoint_(floatingJoint) {}

  void addSubtree(const urdf::Link& link, int parent) {
    const int index = addLink(link, parent);
    for (const auto& child : link.child_links) addSubtree(*child, index);
  }

 private:
  int addLink(const urdf::Link& link, int parent) {
    UrdfLink result;
    result.name = link.name;
    const std::string place = places_.place("link", link.name);
    if (link.inertial) result.inertia = toInertia(*link.inertial, place);
    const int index = static_cast<int>(model_.links.size());
    if (link.parent_joint) {
      const urdf::Joint& joint = *link.parent_joint;
      const std::string jointPlace = places_.place("joint", joint.name);
      const bool named = joint.name == floatingJoint_;
      if (named && joint.type != urdf::Joint::FLOATING) {
        throw InputError(jointPlace + "is '" + typeName(joint) +
                         "', but the scene's joint must be 'floating' (six coordinates)");
      }
      if (!named && joint.type != urdf::Joint::FIXED) {
        throw InputError(jointPlace + "type '" + typeName(joint) +
                         "' is not supported here; use 'fixed', or 'floating' for the joint the scene names ('" +
                         floatingJoint_ + "')");
      }
      UrdfJoint& own = result.joint.emplace();
      own.name = joint.name;
      own.type = named ? JointType::floating : JointType::fixed;
      own.parent = parent;
      own.X_PF = toPose(joint.parent_to_joint_origin_transform, jointPlace);
      if (named) {
        model_.floatingChild = index;
        if (!result.inertia) {
          throw InputError(place + "has no <inertial>; the moving link of joint '" + joint.name +
                           "' needs a mass [kg] and an inertia [kg m^2]");
        }
      }
    }
    model_.links.push_back(std::move(result));
    return index;
  }

  UrdfModel& model_;
  const Places& places_;
  const std::string& floatingJoint_;
};

}  // namespace

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
    std::string names;
    for (const UrdfLink& link : model.links) names += (names.empty() ? "'" : ", '") + link.name + "'";
    throw InputError(use + ": " + model.file.string() + " has no link '" + linkName + "'; its links are " + names);
  }
  const Pose X_ParentF = model.floatingJoint().X_PF;
  if (frame.link == model.floatingParent()) frame.X_LinkFrame = X_ParentF;

  // Up to the anchor: the root's own chain for the fixed side, the floating joint's child for the moving side.
  const auto rootPose = [&](int link, bool& moves) {
    Pose X;
    for (int i = link; model.links[static_cast<size_t>(i)].joint;) {
      if (i == model.floatingChild) {
        moves = true;
        break;
      }
      const UrdfJoint& joint = *model.links[static_cast<size_t>(i)].joint;
      X = joint.X_PF * X;
      i = joint.parent;
    }
    return X;
  };
  const Pose X_TopLink = rootPose(frame.link, frame.moves);
  frame.X_AnchorFrame = X_TopLink * frame.X_LinkFrame;
  if (!frame.moves) {
    bool parentMoves = false;
    const Pose X_RootF = rootPose(model.floatingParent(), parentMoves) * X_ParentF;
    frame.X_AnchorFrame = X_RootF.inverse() * frame.X_AnchorFrame;
  }
  return frame;
}

ContactFrames findContactFrames(const UrdfModel& model, const scene::ContactSpec& contact) {
  const auto nameOf = [&](const std::string& given, int standard) {
    return given.empty() ? model.links[static_cast<size_t>(standard)].name : given;
  };
  const std::string where = "contact '" + contact.name + "'";
  ContactFrames frames;
  frames.fixed = findFrame(model, nameOf(contact.fixedBody, model.floatingParent()), where + ", fixed body");
  frames.moving = findFrame(model, nameOf(contact.movingBody, model.floatingChild), where + ", moving body");
  if (frames.fixed.moves == frames.moving.moves) {
    throw InputError(where + ": its two bodies are both on the " + (frames.fixed.moves ? "moving" : "fixed") +
                     " side of joint '" + model.floatingJoint().name + "' and never move against each other");
  }
  return frames;
}

Pose ContactFrames::calcPose(const contact::JointCoordinates& q) const {
  const Pose X_FM = contact::calcPose(q);
  return fixed.X_AnchorFrame.inverse() * (fixed.moves ? X_FM.inverse() : X_FM) * moving.X_AnchorFrame;
}

UrdfModel readUrdf(const std::filesystem::path& file, const std::string& floatingJoint) {
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

  if (!parsed->getJoint(floatingJoint)) {
    std::string names;
    for (const auto& entry : parsed->joints_) names += (names.empty() ? "'" : ", '") + entry.first + "'";
    throw InputError(name + ": has no joint '" + floatingJoint + "'; its joints are " +
                     (names.empty() ? "none" : names));
  }
  UrdfModel model;
  model.file = file;
  Reader(model, places, floatingJoint).addSubtree(*parsed->getRoot(), -1);
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
