#include "genu/model/KneeSystem.h"

#include <cmath>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "Conversions.h"
#include "elements/MakeForceElement.h"
#include "genu/scene/SceneFile.h"

namespace genu::model {

namespace {

using SimTK::MobilizedBody;
using SimTK::Real;
using SimTK::SpatialVec;
using SimTK::State;
using SimTK::Transform;
using SimTK::Vector;
using SimTK::Vector_;

using Curve = std::shared_ptr<const TimeCurve>;

/** TimeCurve as Simbody's constraints want it. */
class MotionFunction : public SimTK::Function {
 public:
  explicit MotionFunction(Curve curve) : curve_(std::move(curve)) {}
  Real calcValue(const Vector& t) const override { return curve_->calcValue(t[0]); }
  Real calcDerivative(const SimTK::Array_<int>& components, const Vector& t) const override {
    return curve_->calcDerivative(t[0], static_cast<int>(components.size()));
  }
  int getArgumentSize() const override { return 1; }
  int getMaxDerivativeOrder() const override { return 3; }
  MotionFunction* clone() const override { return new MotionFunction(*this); }

 private:
  Curve curve_;
};

/** A force over time at a point and a moment over time, both on one body, with components in the axes of another. No reaction is applied;
 the potential energy is reported as 0 because a load that changes or follows a body has none. */
class BodyLoad : public SimTK::Force::Custom::Implementation {
 public:
  MobilizedBody body, frame, pointBody;
  SimTK::Rotation R_BodyFrame;
  Transform X_PointBodyFrame;
  std::array<Curve, 3> force, moment, point;
  bool hasMoment = false;

  void calcForce(const State& state, Vector_<SpatialVec>& bodyForces, Vector_<SimTK::Vec3>&, Vector&) const override {
    const double t = state.getTime();
    const auto read = [t](const std::array<Curve, 3>& c) { return SimTK::Vec3(c[0]->calcValue(t), c[1]->calcValue(t), c[2]->calcValue(t)); };
    const SimTK::Rotation& R_GB = frame.getBodyRotation(state);
    const SimTK::Vec3 f_G = R_GB * (R_BodyFrame * read(force));
    const SimTK::Vec3 p_G = pointBody.findStationLocationInGround(state, X_PointBodyFrame * read(point));
    const SimTK::Vec3 arm_G = p_G - body.getBodyOriginLocation(state);
    SpatialVec load(arm_G % f_G, f_G);
    if (hasMoment) load[0] += R_GB * (R_BodyFrame * read(moment));
    bodyForces[body.getMobilizedBodyIndex()] += load;
  }
  Real calcPotentialEnergy(const State&) const override { return 0; }
};

/** A generalized force over time on one coordinate. */
class MobilityLoad : public SimTK::Force::Custom::Implementation {
 public:
  MobilityLoad(MobilizedBody body, int coordinate, Curve value)
      : body_(std::move(body)), coordinate_(coordinate), value_(std::move(value)) {}
  void calcForce(const State& state, Vector_<SpatialVec>&, Vector_<SimTK::Vec3>&, Vector& mobility) const override {
    body_.applyOneMobilityForce(state, coordinate_, value_->calcValue(state.getTime()), mobility);
  }
  Real calcPotentialEnergy(const State&) const override { return 0; }

 private:
  MobilizedBody body_;
  int coordinate_;
  Curve value_;
};

SimTK::Body makeBody(const UrdfLink& link) {
  if (!link.inertia) return SimTK::Body::Massless();
  const LinkInertia& own = *link.inertia;
  const contact::Mat3& I = own.inertia_kgM2;
  const SimTK::Inertia central(SimTK::Vec3(I(0, 0), I(1, 1), I(2, 2)), SimTK::Vec3(I(0, 1), I(0, 2), I(1, 2)));
  const SimTK::Vec3 center = toSimTK(own.center_m);
  return SimTK::Body::Rigid(
      SimTK::MassProperties(own.mass_kg, center, central.shiftFromMassCenter(-center, own.mass_kg)));
}

const scene::ModelSpec& requireModel(const scene::Scene& scene) {
  if (!scene.model) {
    throw InputError(scene.file.string() + ": a static or gait analysis needs a 'model' section (URDF, joint, " +
                     "coordinates)");
  }
  return *scene.model;
}

}  // namespace

KneeSystem::KneeSystem(const scene::Scene& scene) : KneeSystem(scene, scene::makeContactPairs(scene)) {}

KneeSystem::KneeSystem(const scene::Scene& scene, const std::vector<std::shared_ptr<const contact::ContactPair>>& pairs)
    : scene_(scene), matter_(system_), forces_(system_), contact_(system_), urdf_(readUrdf(requireModel(scene))) {
  addBodies();
  addCoordinates();
  addContacts(pairs);
  addLoads();
  const auto& g = scene_.model->gravity_mPerS2;
  const SimTK::Vec3 gravity(g[0], g[1], g[2]);
  if (gravity.normSqr() > 0) SimTK::Force::Gravity(forces_, matter_, gravity);
  addElements();
}

KneeSystem::~KneeSystem() = default;

void KneeSystem::addBodies() {
  coordinates_ = scene::listCoordinates(*scene_.model);
  if (scene_.model->coordinates.size() != coordinates_.size()) {
    throw InputError(scene_.file.string() + ": the model has " + std::to_string(coordinates_.size()) + " coordinates, but " +
                     std::to_string(scene_.model->coordinates.size()) + " are described");
  }
  stateIndex_.assign(coordinates_.size(), -1);
  linkOfCoordinate_.assign(coordinates_.size(), -1);
  int next = 0;
  for (size_t i = 0; i < urdf_.links.size(); ++i) {
    const UrdfLink& link = urdf_.links[i];
    const SimTK::Body body = makeBody(link);
    if (!link.joint) {
      bodies_.push_back(MobilizedBody::Weld(matter_.updGround(), Transform(), body, Transform()));
      continue;
    }
    const UrdfJoint& joint = *link.joint;
    MobilizedBody& parent = bodies_[static_cast<size_t>(joint.parent)];
    const Transform X_PF = toSimTK(joint.X_PF);
    const auto aligned = [&joint](SimTK::CoordinateAxis axis) {
      return Transform(SimTK::Rotation(SimTK::UnitVec3(toSimTK(joint.axis_F)), axis));
    };
    switch (joint.type) {
      case JointType::floating: {
        MobilizedBody::Bushing bushing(parent, X_PF, body, Transform());
        if (!joint_) joint_ = bushing;
        bodies_.push_back(bushing);
        break;
      }
      case JointType::rotation: {
        const Transform X = aligned(SimTK::ZAxis);
        bodies_.push_back(MobilizedBody::Pin(parent, X_PF * X, body, X));
        break;
      }
      case JointType::translation: {
        const Transform X = aligned(SimTK::XAxis);
        bodies_.push_back(MobilizedBody::Slider(parent, X_PF * X, body, X));
        break;
      }
      default:
        bodies_.push_back(MobilizedBody::Weld(parent, X_PF, body, Transform()));
    }
    // Bodies get their coordinates in the order in which they are made, and u = dq/dt for these joints.
    for (int k = 0; joint.firstCoordinate >= 0 && k < (joint.type == JointType::floating ? 6 : 1); ++k) {
      const auto index = static_cast<size_t>(joint.firstCoordinate + k);
      stateIndex_[index] = next++;
      linkOfCoordinate_[index] = static_cast<int>(i);
    }
  }
}

void KneeSystem::addCoordinates() {
  const std::string file = scene_.file.string();
  const int n = numCoordinates();
  prescribed_.resize(static_cast<size_t>(n));
  constraints_.resize(static_cast<size_t>(n));
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<size_t>(i);
    const std::string& name = coordinates_[k].name;
    const MobilizedBody& body = bodyOfCoordinate(i);
    const scene::CoordinateSpec& spec = scene_.model->coordinates[k];
    if (const auto* motion = std::get_if<scene::PrescribedCoordinate>(&spec)) {
      prescribed_[k] = addCurve(motion->motion, "prescribed coordinate '" + name + "'");
      if (prescribed_[k]->interpolation() != scene::Interpolation::spline) {
        throw InputError(file + ": prescribed coordinate '" + name + "' (" + prescribed_[k]->source() +
                         "): interpolation linear or step; allowed: spline, because its acceleration is needed");
      }
      constraints_[k] = SimTK::Constraint::PrescribedMotion(matter_, new MotionFunction(prescribed_[k]), body.getMobilizedBodyIndex(),
                                                            SimTK::MobilizerQIndex(axisOfCoordinate(i)));
      continue;
    }
    const auto& free = std::get<scene::FreeCoordinate>(spec);
    if (!(free.damping >= 0) || !std::isfinite(free.damping)) {
      throw InputError(file + ": damping of coordinate '" + name + "' is " + std::to_string(free.damping) +
                       "; it must be zero or positive");
    }
    const SimTK::MobilizerUIndex u(axisOfCoordinate(i));
    if (free.damping > 0) SimTK::Force::MobilityLinearDamper(forces_, body, u, free.damping);
    if (free.limits) {
      const scene::CoordinateLimits& limits = *free.limits;
      SimTK::Force::MobilityLinearStop(forces_, body, SimTK::MobilizerQIndex(axisOfCoordinate(i)), limits.stiffness, limits.dissipation,
                                       limits.lower, limits.upper);
    }
  }
}

void KneeSystem::addContacts(const std::vector<std::shared_ptr<const contact::ContactPair>>& pairs) {
  for (size_t i = 0; i < scene_.contacts.size(); ++i) {
    const ContactFrames frames = findContactFrames(urdf_, scene_.contacts[i]);
    contact_.addContactPair(
        scene_.contacts[i].name, pairs.at(i),
        {body(frames.fixed.link).getMobilizedBodyIndex(), toSimTK(frames.fixed.X_LinkFrame),
         body(frames.moving.link).getMobilizedBodyIndex(), toSimTK(frames.moving.X_LinkFrame)});
  }
}

void KneeSystem::addLoads() {
  const std::string file = scene_.file.string();
  for (const scene::LoadSpec& load : scene_.loads) {
    const std::string where = "loads." + load.name;
    const std::string use = "load '" + load.name + "'";
    const LinkFrame bodyFrame = findFrame(urdf_, load.body, scene_.where(where + ".body"));
    const LinkFrame axes = findFrame(urdf_, load.frame, scene_.where(where + ".frame"));
    const LinkFrame point = findFrame(urdf_, load.pointBody.empty() ? load.body : load.pointBody, scene_.where(where + ".point.body"));
    auto* force = new BodyLoad();
    SimTK::Force::Custom handle(forces_, force);  // owns it from here on
    force->body = body(bodyFrame.link);
    force->frame = body(axes.link);
    force->pointBody = body(point.link);
    force->R_BodyFrame = toSimTK(axes.X_LinkFrame).R();
    force->X_PointBodyFrame = toSimTK(point.X_LinkFrame);
    force->hasMoment = load.hasMoment();
    for (size_t k = 0; k < 3; ++k) {
      force->force[k] = addCurve(load.force_N[k], use);
      force->moment[k] = addCurve(load.moment_Nm[k], use);
      force->point[k] = addCurve(load.point_m[k], use);
    }
  }

  for (const scene::GeneralizedLoadSpec& load : scene_.generalizedLoads) {
    if (load.coordinate < 0 || load.coordinate >= numCoordinates()) {
      throw InputError(file + ": load '" + load.name + "' acts on coordinate " + std::to_string(load.coordinate) +
                       "; allowed are 0 to " + std::to_string(numCoordinates() - 1));
    }
    if (isPrescribed(load.coordinate)) {
      throw InputError(file + ": load '" + load.name + "' acts on coordinate '" +
                       coordinates_[static_cast<size_t>(load.coordinate)].name +
                       "', which is prescribed: the load would have no effect; make the coordinate free or remove " +
                       "the load");
    }
    SimTK::Force::Custom(forces_, new MobilityLoad(bodyOfCoordinate(load.coordinate), axisOfCoordinate(load.coordinate),
                                                   addCurve(load.value, "load '" + load.name + "'")));
  }
}

void KneeSystem::addElements() {
  for (const auto& definition : scene_.elements) elements_.push_back(makeForceElement(definition, *this));
}

const SimTK::MobilizedBody::Bushing& KneeSystem::joint() const {
  if (!joint_) throw std::logic_error("the model has no floating joint");
  return *joint_;
}

SimTK::MobilizedBody& KneeSystem::body(const std::string& link) {
  return bodies_[static_cast<size_t>(findFrame(urdf_, link, "body").link)];
}

const SimTK::MobilizedBody& KneeSystem::bodyOfCoordinate(int coordinate) const {
  return body(linkOfCoordinate_[static_cast<size_t>(coordinate)]);
}

std::vector<scene::ElementColumn> KneeSystem::listElementColumns() const {
  std::vector<scene::ElementColumn> columns;
  for (const auto& element : elements_) {
    for (scene::ElementColumn column : element->outputs()) {
      column.keyword = element->definition().keyword;
      column.element = element->definition().name;
      columns.push_back(std::move(column));
    }
  }
  return columns;
}

std::vector<double> KneeSystem::calcElementOutputs(const State& state) const {
  std::vector<double> values;
  for (const auto& element : elements_) {
    const size_t first = values.size();
    values.resize(first + element->outputs().size());
    if (values.size() > first) element->calcOutputs(state, &values[first]);
  }
  return values;
}

std::vector<scene::ElementPath> KneeSystem::calcElementPaths(const State& state) const {
  std::vector<scene::ElementPath> paths;
  for (const auto& element : elements_) {
    std::vector<contact::Vec3> points = element->calcPath(state);
    if (!points.empty()) paths.push_back({element->definition().keyword, element->definition().name, std::move(points)});
  }
  return paths;
}

std::string KneeSystem::findElementProblem(const State& state) const {
  for (const auto& element : elements_) {
    const std::string problem = element->findProblem(state);
    if (!problem.empty()) return element->definition().key() + ": " + problem;
  }
  return {};
}

void KneeSystem::settleElements(State& state) const {
  if (elements_.empty()) return;
  system_.realize(state, SimTK::Stage::Position);
  for (const auto& element : elements_) element->settle(state);
}

void KneeSystem::prescribe(State& state, double time_s, bool atRest) const {
  state.setTime(time_s);
  for (int i = 0; i < numCoordinates(); ++i) {
    if (!isPrescribed(i)) continue;
    state.updQ()[stateIndex(i)] = motion(i).calcValue(time_s);
    state.updU()[stateIndex(i)] = atRest ? 0.0 : motion(i).calcDerivative(time_s, 1);
  }
}

scene::Coordinates KneeSystem::readCoordinates(const State& state) const {
  scene::Coordinates q(coordinates_.size());
  for (size_t i = 0; i < q.size(); ++i) q[i] = state.getQ()[stateIndex_[i]];
  return q;
}

std::shared_ptr<const TimeCurve> KneeSystem::addCurve(const scene::TimeFunction& function, const std::string& use) {
  auto curve = std::make_shared<const TimeCurve>(function);
  curves_.push_back({use, curve});
  return curve;
}

void KneeSystem::checkTablesCover(double t0_s, double t1_s) const {
  for (const NamedCurve& entry : curves_) entry.curve->checkCovers(t0_s, t1_s, scene_.file.string() + ": " + entry.use);
}

std::vector<KneeSystem::InputBreak> KneeSystem::listInputBreaks() const {
  std::map<double, bool> breaks;
  for (const NamedCurve& entry : curves_) {
    for (const double t : entry.curve->listBreaks()) breaks[t] |= entry.curve->interpolation() == scene::Interpolation::step;
  }
  std::vector<InputBreak> list;
  for (const auto& [t, jump] : breaks) list.push_back({t, jump});
  return list;
}

std::vector<std::string> KneeSystem::listTables() const {
  std::vector<std::string> tables;
  for (const NamedCurve& entry : curves_) {
    if (!entry.curve->isConstant()) tables.push_back(entry.curve->source() + " (" + entry.use + ")");
  }
  return tables;
}

std::vector<std::string> KneeSystem::listTableWarnings() const {
  constexpr double kTolerated = 0.02;
  std::map<std::string, std::pair<const NamedCurve*, int>> bySource;
  for (const NamedCurve& entry : curves_) {
    if (entry.curve->findOvershoot().share <= kTolerated) continue;
    auto& [first, count] = bySource[entry.curve->source()];
    if (count++ == 0) first = &entry;
  }
  std::vector<std::string> warnings;
  for (const auto& [source, found] : bySource) {
    const TimeCurve::Overshoot overshoot = found.first->curve->findOvershoot();
    std::ostringstream text;
    text.precision(3);
    text << source << " (" << found.first->use;
    if (found.second > 1) text << " and " << found.second - 1 << " more";
    text << "): the curve through the rows leaves the range of their values by " << 100 * overshoot.share << " % of it, to "
         << overshoot.value << " (SI) at t = " << overshoot.time_s << " s; give it more rows there";
    warnings.push_back(text.str());
  }
  return warnings;
}

}  // namespace genu::model
