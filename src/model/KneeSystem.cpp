#include "genu/model/KneeSystem.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "Conversions.h"
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

/** A force over time at a point of one body, with components in the axes of another. No reaction is applied; the
 potential energy is reported as 0 because a load that changes or follows a body has none. */
class PointLoad : public SimTK::Force::Custom::Implementation {
 public:
  MobilizedBody body, frame, pointBody;
  SimTK::Rotation R_BodyFrame;
  SimTK::Vec3 point_PointBody;
  std::array<Curve, 3> force;

  void calcForce(const State& state, Vector_<SpatialVec>& bodyForces, Vector_<SimTK::Vec3>&, Vector&) const override {
    const double t = state.getTime();
    const SimTK::Vec3 f(force[0]->calcValue(t), force[1]->calcValue(t), force[2]->calcValue(t));
    const SimTK::Vec3 f_G = frame.getBodyRotation(state) * (R_BodyFrame * f);
    const SimTK::Vec3 p_G = pointBody.findStationLocationInGround(state, point_PointBody);
    const SimTK::Vec3 arm_G = p_G - body.getBodyOriginLocation(state);
    bodyForces[body.getMobilizedBodyIndex()] += SpatialVec(arm_G % f_G, f_G);
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
    : matter_(system_),
      forces_(system_),
      contact_(system_),
      urdf_(readUrdf(requireModel(scene).urdf, requireModel(scene).joint)) {
  const scene::ModelSpec& model = *scene.model;
  const std::string file = scene.file.string();

  for (size_t i = 0; i < urdf_.links.size(); ++i) {
    const UrdfLink& link = urdf_.links[i];
    const SimTK::Body body = makeBody(link);
    if (!link.joint) {
      bodies_.push_back(MobilizedBody::Weld(matter_.updGround(), Transform(), body, Transform()));
      continue;
    }
    MobilizedBody& parent = bodies_[static_cast<size_t>(link.joint->parent)];
    const Transform X_PF = toSimTK(link.joint->X_PF);
    if (link.joint->type == JointType::floating) {
      joint_ = MobilizedBody::Bushing(parent, X_PF, body, Transform());
      bodies_.push_back(joint_);
    } else {
      bodies_.push_back(MobilizedBody::Weld(parent, X_PF, body, Transform()));
    }
  }

  for (int i = 0; i < 6; ++i) {
    const std::string name = scene::kCoordinateNames[static_cast<size_t>(i)];
    const scene::CoordinateSpec& spec = model.coordinates[static_cast<size_t>(i)];
    if (const auto* prescribed = std::get_if<scene::PrescribedCoordinate>(&spec)) {
      Curve curve = std::make_shared<const TimeCurve>(prescribed->motion);
      curves_.push_back({"prescribed coordinate '" + name + "'", curve});
      constraints_[static_cast<size_t>(i)] = SimTK::Constraint::PrescribedMotion(
          matter_, new MotionFunction(curve), joint_.getMobilizedBodyIndex(), SimTK::MobilizerQIndex(i));
      prescribed_[static_cast<size_t>(i)] = std::move(curve);
    } else {
      const double damping = std::get<scene::FreeCoordinate>(spec).damping;
      if (!(damping >= 0) || !std::isfinite(damping)) {
        throw InputError(file + ": damping of coordinate '" + name + "' is " + std::to_string(damping) +
                         "; it must be zero or positive");
      }
      if (damping > 0) SimTK::Force::MobilityLinearDamper(forces_, joint_, SimTK::MobilizerUIndex(i), damping);
    }
  }

  for (size_t i = 0; i < scene.contacts.size(); ++i) {
    const ContactFrames frames = findContactFrames(urdf_, scene.contacts[i]);
    contact_.addContactPair(
        scene.contacts[i].name, pairs.at(i),
        {bodies_[static_cast<size_t>(frames.fixed.link)].getMobilizedBodyIndex(), toSimTK(frames.fixed.X_LinkFrame),
         bodies_[static_cast<size_t>(frames.moving.link)].getMobilizedBodyIndex(), toSimTK(frames.moving.X_LinkFrame)});
  }

  for (const scene::LoadSpec& load : scene.loads) {
    const std::string where = file + ": load '" + load.name + "'";
    const LinkFrame body = findFrame(urdf_, load.body, where + ", body");
    const LinkFrame axes = findFrame(urdf_, load.frame, where + ", frame");
    const LinkFrame point = findFrame(urdf_, load.pointBody, where + ", point");
    auto* force = new PointLoad();
    SimTK::Force::Custom handle(forces_, force);  // owns it from here on
    force->body = bodies_[static_cast<size_t>(body.link)];
    force->frame = bodies_[static_cast<size_t>(axes.link)];
    force->pointBody = bodies_[static_cast<size_t>(point.link)];
    force->R_BodyFrame = toSimTK(axes.X_LinkFrame).R();
    force->point_PointBody =
        toSimTK(point.X_LinkFrame.apply(contact::Vec3(load.point_m[0], load.point_m[1], load.point_m[2])));
    for (size_t k = 0; k < 3; ++k) {
      force->force[k] = std::make_shared<const TimeCurve>(load.force_N[k]);
      curves_.push_back({"load '" + load.name + "'", force->force[k]});
    }
  }

  for (const scene::GeneralizedLoadSpec& load : scene.generalizedLoads) {
    if (load.coordinate < 0 || load.coordinate > 5) {
      throw InputError(file + ": load '" + load.name + "' acts on coordinate " + std::to_string(load.coordinate) +
                       "; allowed are 0 to 5");
    }
    if (isPrescribed(load.coordinate)) {
      throw InputError(file + ": load '" + load.name + "' acts on coordinate '" +
                       scene::kCoordinateNames[static_cast<size_t>(load.coordinate)] +
                       "', which is prescribed: the load would have no effect; make the coordinate free or remove " +
                       "the load");
    }
    Curve curve = std::make_shared<const TimeCurve>(load.value);
    curves_.push_back({"load '" + load.name + "'", curve});
    SimTK::Force::Custom(forces_, new MobilityLoad(joint_, load.coordinate, curve));
  }

  const SimTK::Vec3 gravity(model.gravity_mPerS2[0], model.gravity_mPerS2[1], model.gravity_mPerS2[2]);
  if (gravity.normSqr() > 0) SimTK::Force::Gravity(forces_, matter_, gravity);
}

SimTK::MobilizedBody& KneeSystem::body(const std::string& link) {
  return bodies_[static_cast<size_t>(findFrame(urdf_, link, "body").link)];
}

void KneeSystem::prescribe(State& state, double time_s, bool atRest) const {
  state.setTime(time_s);
  for (int i = 0; i < 6; ++i) {
    if (!isPrescribed(i)) continue;
    joint_.setOneQ(state, i, motion(i).calcValue(time_s));
    joint_.setOneU(state, i, atRest ? 0.0 : motion(i).calcDerivative(time_s, 1));
  }
}

void KneeSystem::checkTablesCover(double t0_s, double t1_s) const {
  for (const NamedCurve& entry : curves_) entry.curve->checkCovers(t0_s, t1_s, entry.use);
}

}  // namespace genu::model
