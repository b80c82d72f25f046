#include "genu/contact/ContactPair.h"

#include <algorithm>
#include <cmath>

#include "detail/ContactPairImpl.h"
#include "detail/GridOnMoving.h"

namespace genu::contact {

using namespace detail;

const char* toString(EvaluationStatus status) {
  switch (status) {
    case EvaluationStatus::ok: return "ok";
    case EvaluationStatus::extrapolated: return "extrapolated";
    case EvaluationStatus::fullPenetration: return "full_penetration";
    case EvaluationStatus::notConverged: return "not_converged";
  }
  return "unknown";
}

namespace {

std::variant<LinearLayer, PowerLawLayer, SeriesLayers> makeLaw(const ContactPairDefinition& d) {
  if (d.movingMaterial && !(*d.movingMaterial == d.material)) return SeriesLayers(d.material, *d.movingMaterial, d.strain);
  if (d.material.law == MaterialLaw::linear) return LinearLayer(d.material, d.strain);
  return PowerLawLayer(d.material, d.strain);
}

/** A table of the law, where the smooth rule gains from one and it is exact enough to pass for the law itself. */
std::unique_ptr<PressureTable> makeTable(const ContactPairDefinition& d) {
  const bool isSeries = d.movingMaterial && !(*d.movingMaterial == d.material);
  const bool isLinear = d.material.law == MaterialLaw::linear;
  if (d.rule != ContactRule::smooth || isSeries || (isLinear && d.strain == StrainMeasure::small)) return nullptr;
  // Below this strain the law is nearly linear; pieces of the table grow from there.
  const double scale = isLinear ? 0.05 : 0.01 * d.material.eps0 / (2 * d.material.confinementFactor());
  auto table = std::make_unique<PressureTable>(makePressureLaw(d.material, d.strain), scale);
  return table->relativeError() < 1e-9 ? std::move(table) : nullptr;
}

LawShape makeShape(const ContactPairDefinition& d) {
  LawShape shape = calcLawShape(d.material, d.strain);
  if (d.movingMaterial) {  // in series: the one that bends first
    const LawShape other = calcLawShape(*d.movingMaterial, d.strain);
    shape.atZero = std::min(shape.atZero, other.atZero);
    shape.atOne = std::min(shape.atOne, other.atOne);
  }
  return shape;
}

}  // namespace

ContactPair::Impl::Impl(ContactPairDefinition d)
    : detail::PairData{d.gridOn == GridOn::moving ? exchangeBodies(d) : d, makeLaw(d), nullptr}, given(std::move(d)) {
  law = makeLaw(definition);
  table = makeTable(definition);
  shape = makeShape(definition);
}

ContactWorkspace::ContactWorkspace(const ContactPair& pair) : impl_(std::make_unique<Impl>()) {
  const auto& compartments = pair.impl_->compartments;
  impl_->compartments.resize(compartments.size());
  impl_->stored.compartments.resize(compartments.size());
  for (size_t k = 0; k < compartments.size(); ++k) {
    const size_t n = compartments[k].size();
    CompartmentMemory& m = impl_->compartments[k];
    if (pair.impl_->definition.rule == ContactRule::smooth) {
      pair.impl_->sizeSmoothMemory(compartments[k], m);
    } else {
      m.foot.resize(n);
      if (pair.impl_->definition.distance == DistanceMethod::ray) m.hits.resize(n);
      m.p_MA.resize(n);
      m.clearance_m.resize(n);
      m.distance_m.resize(n);
      m.onBorder.resize(n);
      m.active.reserve(n);
    }
    m.visit.resize(n);
    m.queue.reserve(n);
    m.previous.reserve(n);
  }
  reset();
}

ContactWorkspace::~ContactWorkspace() = default;
ContactWorkspace::ContactWorkspace(ContactWorkspace&&) noexcept = default;
ContactWorkspace& ContactWorkspace::operator=(ContactWorkspace&&) noexcept = default;

void ContactWorkspace::setTaskRunner(const TaskRunner* runner) { impl_->runner = runner; }

void ContactWorkspace::reset() {
  impl_->hasStored = false;
  impl_->stamp = 0;
  for (CompartmentMemory& m : impl_->compartments) {
    std::fill(m.foot.begin(), m.foot.end(), SurfaceParameter{});
    std::fill(m.clearance_m.begin(), m.clearance_m.end(), 0.0);
    std::fill(m.distance_m.begin(), m.distance_m.end(), 0.0);
    std::fill(m.onBorder.begin(), m.onBorder.end(), char{0});
    std::fill(m.visit.begin(), m.visit.end(), 0u);
    m.peakFoot = TrackedFoot{};
    m.peakFoot.patch = -1;
    for (TrackedFoot& foot : m.feet) {
      foot = TrackedFoot{};
      foot.patch = -1;
    }
    for (TrackedHit& hit : m.hits) {
      hit = TrackedHit{};
      hit.patch = -1;
    }
    std::fill(m.nodeVisit.begin(), m.nodeVisit.end(), 0u);
    m.hasLast = false;
    m.active.clear();
    m.tasks.clear();
    m.previous.clear();
  }
}

ContactPair::ContactPair(ContactPairDefinition definition) : ContactPair(std::move(definition), nullptr) {}

ContactPair::ContactPair(ContactPairDefinition definition, const Impl* known) {
  if (definition.compartments.empty()) fail("contact pair: has no compartment; at least one is needed");
  definition.material.validate();
  if (definition.movingMaterial) definition.movingMaterial->validate();
  if (!(definition.damping_sPerM >= 0) || !std::isfinite(definition.damping_sPerM)) {
    fail("contact pair: damping = ", definition.damping_sPerM, " s/m is not allowed; allowed: 0 s/m or more");
  }
  if (definition.planeY_m && !std::isfinite(*definition.planeY_m)) {
    fail("contact pair: element plane y = ", *definition.planeY_m, " m is not allowed; allowed: a finite number");
  }
  if (definition.correction == Correction::energy) {
    if (definition.rule != ContactRule::smooth) {
      fail("contact pair: correction energy is the gradient of the smooth rule's energy; the centre rule has none, because its load jumps");
    }
    if (definition.distance == DistanceMethod::ray) {
      fail("contact pair: correction energy is not available with the distance by ray; use the minimum distance");
    }
    // The layer of the body without the grid is found anew at every pose.
    const Thickness& found = definition.gridOn == GridOn::fixed ? definition.movingThickness : definition.fixedThickness;
    const bool varies = !std::holds_alternative<ConstantThickness>(found.source) && !std::holds_alternative<RigidBody>(found.source);
    if (definition.movingMaterial && !(*definition.movingMaterial == definition.material) && varies) {
      fail("contact pair: correction energy is not available with two materials where the thickness of the layer without the grid "
           "varies; give it a constant thickness, or both layers the same material");
    }
    if (definition.damping_sPerM > 0) {
      fail("contact pair: correction energy with damping = ", definition.damping_sPerM, " s/m is not available; choose one of them");
    }
  }
  validateThickness("fixed", definition.fixedThickness);
  validateThickness("moving", definition.movingThickness);
  const auto isRigid = [](const Thickness& t) { return std::holds_alternative<RigidBody>(t.source); };
  if (isRigid(definition.fixedThickness) && isRigid(definition.movingThickness)) {
    fail("contact pair: both bodies are rigid; at least one needs a layer thickness");
  }
  impl_ = std::make_unique<Impl>(std::move(definition));
  Impl& m = *impl_;
  const char* other = m.given.gridOn == GridOn::fixed ? "moving" : "fixed";
  for (size_t k = 0; k < m.definition.compartments.size(); ++k) {
    m.buildCompartment(m.definition.compartments[k], known ? &known->compartments[k] : nullptr);
    Impl::packCompartment(m.compartments[k]);
  }

  const Thickness& moving = m.definition.movingThickness;
  if (const auto* constant = std::get_if<ConstantThickness>(&moving.source)) {
    m.movingLayer = MovingLayer::constant;
    m.constantMoving_m = constant->h_m;
  } else if (const auto* plane = std::get_if<HeightAbovePlane>(&moving.source)) {
    m.movingLayer = MovingLayer::plane;
    m.planeMovingY_m = plane->planeY_m;
    for (const CompartmentDefinition& c : m.definition.compartments) {
      const double low = c.movingSurface->boundingBox().min().y(), high = c.movingSurface->boundingBox().max().y();
      if (low <= plane->planeY_m && high >= plane->planeY_m) {
        fail("thickness of the ", other, " body: its surface, y ", low, " .. ", high, " m, crosses the plane y = ", plane->planeY_m,
             " m from which the thickness is measured; move the plane to one side of it");
      }
    }
  } else if (std::holds_alternative<BackSurface>(moving.source) || std::holds_alternative<RadialThickness>(moving.source)) {
    m.movingLayer = MovingLayer::map;
    constexpr int kMaxSamples = 4096;
    if (moving.mapSamplesU < 2 || moving.mapSamplesV < 2 || moving.mapSamplesU > kMaxSamples || moving.mapSamplesV > kMaxSamples) {
      fail("thickness of the ", other, " body: map of ", moving.mapSamplesU, "x", moving.mapSamplesV, " samples; allowed: 2 to 4096 each way");
    }
    if (known) {
      m.maps = known->maps;
      m.mapReports = known->mapReports;
    }
    std::vector<const ContactSurface*> done;  // compartments that share a surface share its map
    for (Compartment& c : m.compartments) {
      const auto it = std::find(done.begin(), done.end(), c.moving);
      const size_t index = static_cast<size_t>(it - done.begin());
      if (it == done.end()) {
        done.push_back(c.moving);
        if (!known) {
          m.mapReports.emplace_back();
          m.maps.push_back(std::make_shared<const ThicknessMap>(other, *c.moving, moving, m.mapReports.back()));
        }
      }
      c.map = m.maps[index].get();
      if (c.predictor && c.map->hasHoles()) {  // a foot that moves into a hole takes its node out of use
        for (int k = 0; k < c.moving->numPatches(); ++k) c.predictor->restrict(k, c.map->findFullRectangle(k));
      }
    }
  }
}

ContactPair::~ContactPair() = default;
ContactPair::ContactPair(ContactPair&&) noexcept = default;
ContactPair& ContactPair::operator=(ContactPair&&) noexcept = default;

ContactPair ContactPair::withRefinedCells(std::vector<std::vector<GridCell>> refined) const {
  if (refined.size() != impl_->compartments.size()) {
    fail("contact pair: refined cells for ", refined.size(), " compartments, but it has ", impl_->compartments.size());
  }
  ContactPairDefinition d = impl_->given;
  for (size_t k = 0; k < refined.size(); ++k) d.compartments[k].refined = std::move(refined[k]);
  return ContactPair(std::move(d), impl_.get());
}

const ContactPairDefinition& ContactPair::definition() const { return impl_->given; }
int ContactPair::numCompartments() const { return static_cast<int>(impl_->compartments.size()); }
int ContactPair::numElements() const {
  size_t n = 0;
  for (const Compartment& c : impl_->compartments) n += c.size();
  return static_cast<int>(n);
}
const std::vector<GridReport>& ContactPair::gridReports() const { return impl_->gridReports; }
const std::vector<ThicknessMapReport>& ContactPair::thicknessMapReports() const { return impl_->mapReports; }

namespace {

/** Sum of the compartments, in their order. */
NetLoad sumLoads(const std::vector<NetLoad>& loads) {
  NetLoad t;
  Vec3 weighted = Vec3::Zero();
  for (const NetLoad& l : loads) {
    t.forceOnM_F += l.forceOnM_F;
    t.momentOnM_Fo_F += l.momentOnM_Fo_F;
    t.scalarForce_N += l.scalarForce_N;
    t.area_m2 += l.area_m2;
    t.energy_J += l.energy_J;
    weighted += l.scalarForce_N * l.centerOfPressure_F;
    if (l.peakPressure_Pa > t.peakPressure_Pa) {
      t.peakPressure_Pa = l.peakPressure_Pa;
      t.peakPoint_F = l.peakPoint_F;
    }
    t.maxStrain = std::max(t.maxStrain, l.maxStrain);
    t.activeElements += l.activeElements;
    t.extrapolatedElements += l.extrapolatedElements;
    t.fullPenetrationElements += l.fullPenetrationElements;
    t.notConvergedQueries += l.notConvergedQueries;
    t.unresolvedCompartments += l.unresolvedCompartments;
    t.noThicknessElements += l.noThicknessElements;
    t.boundaryElements += l.boundaryElements;
  }
  t.meanPressure_Pa = t.area_m2 > 0 ? t.scalarForce_N / t.area_m2 : 0;
  if (t.scalarForce_N > 0) t.centerOfPressure_F = weighted / t.scalarForce_N;
  return t;
}

/** Columns: motion (v, w) of M at Fo that a unit rate of each coordinate makes. */
Matrix6 calcMotionOfCoordinates(const JointCoordinates& q) {
  Matrix6 motion;
  for (size_t k = 0; k < 6; ++k) {
    JointCoordinates rate{};
    rate[k] = 1;
    const SpatialVelocity V = calcSpatialVelocity(q, rate);
    motion.col(static_cast<Eigen::Index>(k)) << V.v_FMo - V.w_FM.cross(Vec3(q[3], q[4], q[5])), V.w_FM;
  }
  return motion;
}

/** d(v, w)/dq at constant qdot, (v, w) the motion of M at Fo: v = pdot - w x p, and w = x qdot0 + y(q0) qdot1 + z(q0, q1) qdot2 with the
 axes of the three rotations, of which y turns about x and z about x and y as their angles change. */
Matrix6 calcMotionChange(const JointCoordinates& q, const JointCoordinates& qdot) {
  const Vec3 x = Vec3::UnitX();
  const Eigen::AngleAxisd Rx(q[0], Vec3::UnitX()), Ry(q[1], Vec3::UnitY());
  const Vec3 y = Rx * Vec3::UnitY(), z = Rx * (Ry * Vec3::UnitZ());
  const Vec3 w = qdot[0] * x + qdot[1] * y + qdot[2] * z, p(q[3], q[4], q[5]);
  Matrix6 change = Matrix6::Zero();
  const Vec3 dw[2] = {x.cross(qdot[1] * y + qdot[2] * z), y.cross(qdot[2] * z)};
  for (Eigen::Index k = 0; k < 2; ++k) change.col(k) << -dw[k].cross(p), dw[k];
  for (Eigen::Index k = 0; k < 3; ++k) change.col(3 + k) << -w.cross(Vec3::Unit(k)), Vec3::Zero();
  return change;
}

}  // namespace

void ContactPair::evaluate(const JointCoordinates& q, ContactWorkspace& workspace, const Options& options,
                           ContactResult& result) const {
  evaluate(q, JointCoordinates{}, workspace, options, result);
}

void ContactPair::evaluate(const JointCoordinates& q, const JointCoordinates& qdot, ContactWorkspace& workspace, const Options& options,
                           ContactResult& result) const {
  ContactWorkspace::Impl& w = *workspace.impl_;
  const ContactPairDefinition& d = impl_->definition;
  const bool damped = d.damping_sPerM > 0;
  const auto isFinite = [](const JointCoordinates& values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  };
  if (!isFinite(q) || !isFinite(qdot)) {
    // A diverged integrator asks this. No pose, no load; the stored result stays as it was.
    result.compartments.assign(impl_->compartments.size(), NetLoad{});
    result.total = NetLoad{};
    result.total.notConvergedQueries = 1;
    result.stiffness.setZero();
    result.damping.setZero();
    result.status = EvaluationStatus::notConverged;
    result.distanceQueries = 0;
    result.copied = false;
    return;
  }
  const bool smooth = d.rule == ContactRule::smooth;
  if (options.withStiffness && !smooth) {
    fail("contact pair: the stiffness is the derivative of the smooth rule; the centre rule has none, because its load jumps");
  }
  if (w.hasStored && (w.storedWithEnergy || !options.withEnergy) && (w.storedWithStiffness || !options.withStiffness)) {
    double change = 0;
    for (size_t k = 0; k < 6; ++k) change = std::max(change, std::abs(q[k] - w.storedQ[k]));
    const double tolerance = d.copyTolerance;
    if (change <= (options.copyOnlySamePose ? std::min(tolerance, 0.0) : tolerance) && (!damped || qdot == w.storedRates)) {
      result = w.stored;
      result.distanceQueries = 0;
      result.copied = true;
      return;
    }
  }
  w.hasStored = false;
  w.X_FM = calcPose(q);
  const bool gridOnMoving = impl_->given.gridOn == GridOn::moving;
  w.X_evaluated = gridOnMoving ? w.X_FM.inverse() : w.X_FM;
  if (++w.stamp == 0) {  // wrapped around: forget old visits
    for (CompartmentMemory& m : w.compartments) {
      std::fill(m.visit.begin(), m.visit.end(), 0u);
      std::fill(m.nodeVisit.begin(), m.nodeVisit.end(), 0u);
      }
    w.stamp = 1;
  }
  ContactResult& r = w.stored;
  r.distanceQueries = 0;
  r.copied = false;
  for (NetLoad& load : r.compartments) load = NetLoad{};
  EvaluationTask task;
  task.X_FM = w.X_evaluated;
  Vec3 v_F = Vec3::Zero(), w_F = Vec3::Zero();  // motion of M at Fo
  if (damped) {
    const SpatialVelocity V = calcSpatialVelocity(q, qdot);
    w_F = V.w_FM;
    v_F = V.v_FMo - w_F.cross(w.X_FM.p);
    task.v_F = v_F;
    task.w_F = w_F;
    if (gridOnMoving) mapMotionToM(w.X_FM, task.v_F, task.w_F);
  }
  task.withEnergy = options.withEnergy;
  task.withStiffness = options.withStiffness;
  task.stamp = w.stamp;
  task.runner = w.runner;
  task.loads = r.compartments.data();
  task.queries = &r.distanceQueries;
  if (smooth) {
    impl_->evaluateSmooth(w.compartments, task);
  } else {
    for (size_t k = 0; k < impl_->compartments.size(); ++k) {
      std::visit(
          [&](const auto& law) {
            impl_->evaluateCentre(law, impl_->compartments[k], task, w.compartments[k], r.compartments[k], r.distanceQueries);
          },
          impl_->law);
    }
  }
  if (gridOnMoving) {
    for (NetLoad& load : r.compartments) mapLoadFromM(w.X_FM, load);
  }
  r.total = sumLoads(r.compartments);
  if (options.withStiffness || w.storedWithStiffness) {
    r.stiffness.setZero();
    r.damping.setZero();
  }
  if (options.withStiffness) {
    if (gridOnMoving) mapStiffnessFromM(w.X_FM, v_F, w_F, r.total.forceOnM_F, r.total.momentOnM_Fo_F, task.byMotion, task.byRate);
    const Matrix6 motion = calcMotionOfCoordinates(q);
    r.stiffness = task.byMotion * motion;
    if (damped) {
      r.stiffness += task.byRate * calcMotionChange(q, qdot);
      r.damping = task.byRate * motion;
    }
  }
  // Lengths or moduli whose products overflow.
  const bool overflow = !r.total.forceOnM_F.allFinite() || !r.total.momentOnM_Fo_F.allFinite() || !std::isfinite(r.total.scalarForce_N) ||
                        !std::isfinite(r.total.energy_J) || !std::isfinite(r.total.peakPressure_Pa) ||
                        (options.withStiffness && (!r.stiffness.allFinite() || !r.damping.allFinite()));
  const bool failed = r.total.notConvergedQueries > 0 || r.total.unresolvedCompartments > 0 || overflow;
  r.status = failed                                ? EvaluationStatus::notConverged
             : r.total.fullPenetrationElements > 0 ? EvaluationStatus::fullPenetration
             : r.total.extrapolatedElements > 0    ? EvaluationStatus::extrapolated
                                                   : EvaluationStatus::ok;
  w.storedQ = q;
  w.storedRates = qdot;
  w.storedWithEnergy = options.withEnergy;
  w.storedWithStiffness = options.withStiffness;
  w.hasStored = true;
  result = r;
}

void ContactPair::evaluate(const Pose& X_FM, ContactWorkspace& workspace, const Options& options, ContactResult& result) const {
  evaluate(calcCoordinates(X_FM), workspace, options, result);
}

ContactResult ContactPair::evaluate(const JointCoordinates& q) const {
  Options options;
  options.withEnergy = true;
  return evaluate(q, options);
}

ContactResult ContactPair::evaluate(const JointCoordinates& q, const Options& options) const {
  ContactWorkspace workspace(*this);
  ContactResult result;
  evaluate(q, workspace, options, result);
  return result;
}

std::vector<std::vector<ElementField>> ContactPair::calcFields(const ContactWorkspace& workspace) const {
  const ContactWorkspace::Impl& w = *workspace.impl_;
  std::vector<std::vector<ElementField>> fields(impl_->compartments.size());
  const bool smooth = impl_->definition.rule == ContactRule::smooth;
  std::vector<Active> active;
  for (size_t k = 0; k < fields.size(); ++k) {
    const Compartment& c = impl_->compartments[k];
    const CompartmentMemory& m = w.compartments[k];
    fields[k].resize(c.size());
    for (size_t i = 0; i < c.size(); ++i) {
      ElementField& f = fields[k][i];
      f.ix = c.cell[i].ix;
      f.iz = c.cell[i].iz;
      f.level = c.cell[i].level;
      f.p_FA = c.p_FA[i];
      f.normal_F = c.normal_F[i];
      f.area_m2 = c.area_m2[i];
      f.h_m = c.hF_m[i];
      const Vec3 queried = smooth ? Vec3(m.feet[i].Q[0], m.feet[i].Q[1], m.feet[i].Q[2]) : m.p_MA[i];
      const double moved = (w.X_evaluated.applyInverse(c.p_FA[i]) - queried).norm();
      f.footOnBorder = smooth ? m.feet[i].status == QueryStatus::onBoundary : m.onBorder[i] != 0;
      const double distance = smooth ? m.feet[i].distance_m : m.distance_m[i];
      f.distance_m = moved == 0 ? distance : distance - moved;
    }
    impl_->findActive(c, m, active);
    for (const Active& a : active) {
      ElementField& f = fields[k][static_cast<size_t>(a.element)];
      f.d_m = a.d_m;
      f.h_m = a.h_m;
      f.p_Pa = a.p_Pa;
      f.contactShare = a.share;
      f.force_N = a.force_N;
      f.forceDirection_F = a.direction_F;
      f.active = true;
    }
    if (smooth && w.hasStored) impl_->markUnresolved(c, m, w.stored.compartments[k], fields[k]);
    if (impl_->given.gridOn == GridOn::moving) {
      for (ElementField& f : fields[k]) mapFieldFromM(w.X_FM, f);
    }
  }
  return fields;
}

double ContactPair::calcPower(const NetLoad& load, const SpatialVelocity& V, const Vec3& p_FMo) {
  const Vec3 velocityAtFo = V.v_FMo - V.w_FM.cross(p_FMo);  // of the point of M that is at Fo
  return load.forceOnM_F.dot(velocityAtFo) + load.momentOnM_Fo_F.dot(V.w_FM);
}

std::array<double, 4> findRectangle(const ContactSurface& surface, PlaneFacing facing) {
  const double sign = facing == PlaneFacing::up ? 1 : -1;
  Eigen::AlignedBox3d box;
  constexpr int kSamples = 200;
  for (int k = 0; k < surface.numPatches(); ++k) {
    const NurbsPatch& p = surface.patch(k);
    for (int i = 0; i <= kSamples; ++i) {
      for (int j = 0; j <= kSamples; ++j) {
        const double u = p.uMin() + (p.uMax() - p.uMin()) * i / kSamples, v = p.vMin() + (p.vMax() - p.vMin()) * j / kSamples;
        if (sign * p.calcNormal(u, v).y() > 0) box.extend(p.calcPoint(u, v));
      }
    }
  }
  if (box.isEmpty()) {
    fail(facing == PlaneFacing::up ? "fixed surface: no part of it faces upwards (+y)" : "surface: no part of it faces downwards (-y)",
         "; its normals are inverted, or it stands upright");
  }
  return {box.min().x(), box.max().x(), box.min().z(), box.max().z()};
}

}  // namespace genu::contact
