#include "genu/contact/ContactPair.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace genu::contact {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class... Args>
[[noreturn]] void fail(const Args&... args) {
  std::ostringstream out;
  out.precision(10);
  (out << ... << args);
  throw std::invalid_argument(out.str());
}

/** Thickness seen from one point of a contact surface; NaN where the back surface is missed. */
double measureThickness(const Thickness& thickness, const Vec3& point, const Vec3& normal, std::vector<LineHit>& hits) {
  struct Visitor {
    const Vec3& point;
    const Vec3& normal;
    std::vector<LineHit>& hits;
    double operator()(const RigidBody&) const { return 0; }
    double operator()(const ConstantThickness& t) const { return t.h_m; }
    double operator()(const HeightAbovePlane& t) const { return std::abs(point.y() - t.planeY_m); }
    double operator()(const BackSurface& t) const {
      if (t.direction == BackDirection::closest) {
        const ClosestPoint foot = t.surface->findClosestPoint(point);
        return foot.status == QueryStatus::converged && foot.distance_m > 0 ? foot.distance_m : kNaN;
      }
      t.surface->findLineHits(point, -normal, 0, t.surface->boundingBox().diagonal().norm(), hits);
      for (const LineHit& hit : hits) {
        // The back faces the same way as the layer's surface; a sheet that faces the other way is its far side.
        if (hit.t_m > 0 && hit.normal.dot(normal) > 0) return hit.t_m;
      }
      return kNaN;
    }
  };
  return std::visit(Visitor{point, normal, hits}, thickness.source);
}

/** Clamps; returns whether the value was changed. */
bool clampThickness(const Thickness& thickness, double& h) {
  const double before = h;
  if (thickness.min_m) h = std::max(h, *thickness.min_m);
  if (thickness.max_m) h = std::min(h, *thickness.max_m);
  return h != before;
}

void validateThickness(const char* body, const Thickness& t) {
  if (const auto* c = std::get_if<ConstantThickness>(&t.source)) {
    if (!(c->h_m > 0) || !std::isfinite(c->h_m)) {
      fail("thickness of the ", body, " body = ", c->h_m, " m is not allowed; allowed: > 0 m (or none for a rigid body)");
    }
  }
  if (const auto* b = std::get_if<BackSurface>(&t.source)) {
    if (!b->surface) fail("thickness of the ", body, " body: the back surface is missing");
  }
  if (t.min_m && !(*t.min_m > 0)) fail("thickness of the ", body, " body: min = ", *t.min_m, " m; allowed: > 0 m");
  if (t.max_m && !(*t.max_m > 0)) fail("thickness of the ", body, " body: max = ", *t.max_m, " m; allowed: > 0 m");
  if (t.min_m && t.max_m && *t.min_m > *t.max_m) {
    fail("thickness of the ", body, " body: min = ", *t.min_m, " m is larger than max = ", *t.max_m, " m");
  }
  if (t.missing_m && !(*t.missing_m > 0)) {
    fail("thickness of the ", body, " body: missing = ", *t.missing_m, " m; allowed: > 0 m");
  }
}

/** Layer of the moving body over (u, v) of each patch, sampled once, bilinear in between [BF2004 §2.2]. */
class ThicknessMap {
 public:
  ThicknessMap(const ContactSurface& surface, const Thickness& thickness, ThicknessMapReport& report) {
    std::vector<LineHit> hits;
    double sum = 0;
    report.min_m = std::numeric_limits<double>::infinity();
    for (int k = 0; k < surface.numPatches(); ++k) {
      const NurbsPatch& p = surface.patch(k);
      Map map;
      map.nu = thickness.mapSamplesU;
      map.nv = thickness.mapSamplesV;
      map.u0 = p.uMin();
      map.v0 = p.vMin();
      map.scaleU = (map.nu - 1) / (p.uMax() - p.uMin());
      map.scaleV = (map.nv - 1) / (p.vMax() - p.vMin());
      for (int i = 0; i < map.nu; ++i) {
        for (int j = 0; j < map.nv; ++j) {
          const double u = i + 1 == map.nu ? p.uMax() : map.u0 + i / map.scaleU;
          const double v = j + 1 == map.nv ? p.vMax() : map.v0 + j / map.scaleV;
          double h = measureThickness(thickness, p.calcPoint(u, v), p.calcNormal(u, v), hits);
          ++report.samples;
          if (std::isnan(h)) {
            ++report.missed;
            if (thickness.missing_m) h = *thickness.missing_m;
          } else if (clampThickness(thickness, h)) {
            ++report.clamped;
          }
          if (!std::isnan(h)) {
            report.min_m = std::min(report.min_m, h);
            report.max_m = std::max(report.max_m, h);
            sum += h;
          }
          map.h.push_back(h);
        }
      }
      maps_.push_back(std::move(map));
    }
    const int valid = thickness.missing_m ? report.samples : report.samples - report.missed;
    report.mean_m = valid > 0 ? sum / valid : 0;
    if (valid == 0) {
      fail("thickness of the moving body: the back surface is missed by all ", report.samples,
           " samples; check its frame, its normals and the direction (normal or closest)");
    }
  }

  /** NaN next to a missing sample. */
  double interpolate(const SurfaceParameter& at) const {
    const Map& m = maps_[static_cast<size_t>(at.patch)];
    const double s = (at.u - m.u0) * m.scaleU, t = (at.v - m.v0) * m.scaleV;
    const int i = std::min(std::max(static_cast<int>(s), 0), m.nu - 2);
    const int j = std::min(std::max(static_cast<int>(t), 0), m.nv - 2);
    const double a = s - i, b = t - j;
    const double* h = m.h.data() + static_cast<size_t>(i) * static_cast<size_t>(m.nv) + static_cast<size_t>(j);
    return (1 - a) * ((1 - b) * h[0] + b * h[1]) + a * ((1 - b) * h[m.nv] + b * h[m.nv + 1]);
  }

 private:
  struct Map {
    int nu, nv;
    double u0, v0, scaleU, scaleV;
    std::vector<double> h;
  };
  std::vector<Map> maps_;
};

/** How the moving body's layer is found for one foot. */
enum class MovingLayer { none, constant, plane, map };

struct Compartment {
  std::string name;
  int nx = 0, nz = 0;
  const ContactSurface* moving = nullptr;
  const ThicknessMap* map = nullptr;
  std::vector<int> cell;     // ix * nz + iz of each element
  std::vector<int> element;  // of each cell, -1 where there is none
  std::vector<Vec3> p_FA, normal_F;
  std::vector<double> area_m2, hF_m;
  std::vector<SurfaceParameter> parameter;  // on the fixed surface
  size_t size() const { return p_FA.size(); }
};

/** An element in contact during one evaluation. */
struct Active {
  int element = -1;
  double d_m = 0, h_m = 0, hM_m = 0, p_Pa = 0;
  Vec3 direction_F = Vec3::Zero();
};

struct CompartmentMemory {
  // Of the last query of each element:
  std::vector<SurfaceParameter> foot;  // patch -1: never queried
  std::vector<Vec3> p_MA;              // where it was
  std::vector<double> clearance_m;     // contact is impossible within this distance of p_MA
  std::vector<double> distance_m;      // signed
  std::vector<char> onBorder;          // foot on the moving surface's border
  std::vector<unsigned> visit;         // evaluation that tested it last (search modes)
  std::vector<int> queue;
  std::vector<Active> active;          // in element order
  std::vector<int> previous;           // elements active in the evaluation before
};

}  // namespace

const char* toString(EvaluationStatus status) {
  switch (status) {
    case EvaluationStatus::ok: return "ok";
    case EvaluationStatus::extrapolated: return "extrapolated";
    case EvaluationStatus::fullPenetration: return "full_penetration";
    case EvaluationStatus::notConverged: return "not_converged";
  }
  return "unknown";
}

struct ContactPair::Impl {
  ContactPairDefinition definition;
  std::vector<Compartment> compartments;
  std::vector<GridReport> gridReports;
  std::vector<ThicknessMapReport> mapReports;
  std::vector<std::unique_ptr<ThicknessMap>> maps;
  MovingLayer movingLayer = MovingLayer::none;
  double constantMoving_m = 0, planeMovingY_m = 0;
  std::variant<LinearLayer, PowerLawLayer, SeriesLayers> law;

  explicit Impl(ContactPairDefinition d)
      : definition(std::move(d)), law(makeLaw(definition)) {}

  static std::variant<LinearLayer, PowerLawLayer, SeriesLayers> makeLaw(const ContactPairDefinition& d) {
    if (d.movingMaterial && !(*d.movingMaterial == d.material)) return SeriesLayers(d.material, *d.movingMaterial, d.strain);
    if (d.material.law == MaterialLaw::linear) return LinearLayer(d.material, d.strain);
    return PowerLawLayer(d.material, d.strain);
  }

  void buildCompartment(const CompartmentDefinition& c);
  template <class Law>
  void evaluateCompartment(const Law& law, const Compartment& c, const Pose& X_FM, bool withEnergy,
                           CompartmentMemory& memory, unsigned stamp, NetLoad& load, int& queries) const;
};

struct ContactWorkspace::Impl {
  std::vector<CompartmentMemory> compartments;
  JointCoordinates storedQ{};
  ContactResult stored;
  bool hasStored = false, storedWithEnergy = false;
  Pose X_FM;
  unsigned stamp = 0;
};

ContactWorkspace::ContactWorkspace(const ContactPair& pair) : impl_(std::make_unique<Impl>()) {
  const auto& compartments = pair.impl_->compartments;
  impl_->compartments.resize(compartments.size());
  impl_->stored.compartments.resize(compartments.size());
  for (size_t k = 0; k < compartments.size(); ++k) {
    const size_t n = compartments[k].size();
    CompartmentMemory& m = impl_->compartments[k];
    m.foot.resize(n);
    m.p_MA.resize(n);
    m.clearance_m.resize(n);
    m.distance_m.resize(n);
    m.onBorder.resize(n);
    m.visit.resize(n);
    m.queue.reserve(n);
    m.active.reserve(n);
    m.previous.reserve(n);
  }
  reset();
}

ContactWorkspace::~ContactWorkspace() = default;
ContactWorkspace::ContactWorkspace(ContactWorkspace&&) noexcept = default;
ContactWorkspace& ContactWorkspace::operator=(ContactWorkspace&&) noexcept = default;

void ContactWorkspace::reset() {
  impl_->hasStored = false;
  impl_->stamp = 0;
  for (CompartmentMemory& m : impl_->compartments) {
    std::fill(m.foot.begin(), m.foot.end(), SurfaceParameter{});
    std::fill(m.clearance_m.begin(), m.clearance_m.end(), 0.0);
    std::fill(m.distance_m.begin(), m.distance_m.end(), 0.0);
    std::fill(m.onBorder.begin(), m.onBorder.end(), char{0});
    std::fill(m.visit.begin(), m.visit.end(), 0u);
    m.active.clear();
    m.previous.clear();
  }
}

void ContactPair::Impl::buildCompartment(const CompartmentDefinition& c) {
  if (!c.fixedSurface) fail("compartment ", c.name, ": the fixed surface is missing");
  if (!c.movingSurface) fail("compartment ", c.name, ": the moving surface is missing");
  if (!(c.x1_m > c.x0_m) || !(c.z1_m > c.z0_m)) {
    fail("compartment ", c.name, ": rectangle x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
         " m is empty; needed: x0 < x1 and z0 < z1");
  }
  if (c.nx < 1 || c.nz < 1 || c.nx > 10000 || c.nz > 10000) {
    fail("compartment ", c.name, ": grid ", c.nx, "x", c.nz, " is not allowed; allowed: 1 to 10000 each way");
  }
  Compartment out;
  GridReport report;
  out.name = report.name = c.name;
  out.nx = c.nx;
  out.nz = c.nz;
  out.moving = c.movingSurface.get();
  report.cells = c.nx * c.nz;
  out.element.assign(static_cast<size_t>(report.cells), -1);
  const double dx = (c.x1_m - c.x0_m) / c.nx, dz = (c.z1_m - c.z0_m) / c.nz;
  const Eigen::AlignedBox3d box = c.fixedSurface->boundingBox();
  const double margin = 1e-6 * box.diagonal().norm();
  const double bottom = box.min().y() - margin, top = box.max().y() + margin;
  std::vector<LineHit> hits;
  std::vector<LineHit> backHits;
  double sumThickness = 0;
  report.minThickness_m = std::numeric_limits<double>::infinity();
  for (int ix = 0; ix < c.nx; ++ix) {
    for (int iz = 0; iz < c.nz; ++iz) {
      const double x = c.x0_m + (ix + 0.5) * dx, z = c.z0_m + (iz + 0.5) * dz;
      c.fixedSurface->findLineHits(Vec3(x, bottom, z), Vec3::UnitY(), 0, top - bottom, hits);
      const LineHit* highest = nullptr;
      bool anyUp = false;
      for (const LineHit& hit : hits) {
        if (!(hit.normal.y() > 0)) continue;
        anyUp = true;
        if (definition.planeY_m && !(hit.point.y() > *definition.planeY_m)) continue;
        highest = &hit;  // hits are sorted upwards
      }
      if (highest == nullptr) {
        ++(hits.empty() ? report.missedSurface : anyUp ? report.belowPlane : report.downwardOnly);
        continue;
      }
      Vec3 point = highest->point;
      if (const auto* plane = std::get_if<HeightAbovePlane>(&definition.fixedThickness.source)) {
        if (!(point.y() > plane->planeY_m)) {
          fail("compartment ", c.name, ": the fixed surface lies at y = ", point.y(), " m (x = ", x, " m, z = ", z,
               " m), not above the plane y = ", plane->planeY_m, " m from which its thickness is measured: the thickness "
               "would be negative; lower the plane");
        }
      }
      double h = measureThickness(definition.fixedThickness, point, highest->normal, backHits);
      if (std::isnan(h)) {
        ++report.missedBack;
        if (!definition.fixedThickness.missing_m) continue;
        h = *definition.fixedThickness.missing_m;
      } else if (!std::holds_alternative<RigidBody>(definition.fixedThickness.source) &&
                 clampThickness(definition.fixedThickness, h)) {
        ++report.clamped;
      }
      const int cell = ix * c.nz + iz;
      out.element[static_cast<size_t>(cell)] = static_cast<int>(out.size());
      out.cell.push_back(cell);
      out.p_FA.push_back(point);
      out.normal_F.push_back(highest->normal);
      out.area_m2.push_back(dx * dz / highest->normal.y());
      out.hF_m.push_back(h);
      out.parameter.push_back(highest->at);
      report.surfaceArea_m2 += out.area_m2.back();
      report.minThickness_m = std::min(report.minThickness_m, h);
      report.maxThickness_m = std::max(report.maxThickness_m, h);
      sumThickness += h;
    }
  }
  report.elements = static_cast<int>(out.size());
  if (out.size() == 0) {
    const Vec3 lo = box.min(), hi = box.max();
    if (report.downwardOnly > 0 && report.belowPlane == 0) {
      fail("compartment ", c.name, ": all ", report.downwardOnly, " verticals that meet the fixed surface meet it from "
           "its inner side: its normals are inverted; flip them");
    }
    if (report.belowPlane > 0) {
      fail("compartment ", c.name, ": the fixed surface (y ", lo.y(), " .. ", hi.y(), " m) lies at or below the element plane y = ",
           *definition.planeY_m, " m; lower the plane");
    }
    if (report.missedBack > 0) {
      fail("compartment ", c.name, ": the back surface is missed from all ", report.missedBack,
           " elements; check its frame and normals");
    }
    fail("compartment ", c.name, ": no overlap between the grid, x ", c.x0_m, " .. ", c.x1_m, " m, z ", c.z0_m, " .. ", c.z1_m,
         " m, and the fixed surface, x ", lo.x(), " .. ", hi.x(), " m, z ", lo.z(), " .. ", hi.z(), " m");
  }
  report.meanThickness_m = sumThickness / static_cast<double>(out.size());
  compartments.push_back(std::move(out));
  gridReports.push_back(report);
}

template <class Law>
void ContactPair::Impl::evaluateCompartment(const Law& law_, const Compartment& c, const Pose& X_FM, bool withEnergy,
                                            CompartmentMemory& memory, unsigned stamp, NetLoad& load, int& queries) const {
  const Mat3 R_MF = X_FM.R.transpose();
  const Vec3 offset = R_MF * X_FM.p;
  const bool corrected = definition.correction == Correction::midsurface;
  memory.active.clear();
  const SurfaceParameter* neighbor = nullptr;  // the foot found last: a good first guess for a new element

  // Tests one element; returns whether it is in contact.
  const auto test = [&](int e, const Vec3& p_MA) {
    const size_t i = static_cast<size_t>(e);
    const SurfaceParameter* seed = memory.foot[i].patch >= 0 ? &memory.foot[i] : neighbor;
    const ClosestPoint foot = c.moving->findClosestPoint(p_MA, seed);
    ++queries;
    memory.foot[i] = foot.at;
    memory.p_MA[i] = p_MA;
    memory.distance_m[i] = foot.distance_m;
    memory.onBorder[i] = foot.status == QueryStatus::onBoundary;
    neighbor = &memory.foot[i];
    if (foot.status == QueryStatus::notConverged) {
      ++load.notConvergedQueries;
      memory.clearance_m[i] = 0;
      return false;
    }
    memory.clearance_m[i] = std::max(foot.distance_m, 0.0);
    if (!(foot.distance_m < 0)) return false;
    if (foot.status == QueryStatus::onBoundary) {
      ++load.boundaryElements;
      return false;
    }
    Active a;
    a.element = e;
    const Vec3 towardsM_F = X_FM.R * -foot.normal_M;
    const Vec3 sum = c.normal_F[i] + towardsM_F;
    const double length = sum.norm();  // 2 cos(theta/2)
    const double cosTheta = c.normal_F[i].dot(towardsM_F);
    double hM = 0;
    switch (movingLayer) {
      case MovingLayer::none: break;
      case MovingLayer::constant: hM = constantMoving_m; break;
      case MovingLayer::plane: {
        hM = std::abs(foot.p_MB.y() - planeMovingY_m);
        clampThickness(definition.movingThickness, hM);
        break;
      }
      case MovingLayer::map: hM = c.map->interpolate(foot.at); break;
    }
    if (std::isnan(hM)) {
      ++load.noThicknessElements;
      return false;
    }
    a.hM_m = hM;
    a.h_m = c.hF_m[i] + hM;
    if (corrected && cosTheta > 0) {
      a.d_m = -2 * foot.distance_m / length;
      a.direction_F = sum / length;
    } else {
      a.d_m = -foot.distance_m;
      a.direction_F = towardsM_F;
    }
    if (!(cosTheta > 0) || !(a.d_m < a.h_m)) ++load.fullPenetrationElements;
    memory.active.push_back(a);
    return true;
  };

  const int n = static_cast<int>(c.size());
  const auto locate = [&](int e) { return Vec3(R_MF * c.p_FA[static_cast<size_t>(e)] - offset); };
  const auto cannotTouch = [&](int e, const Vec3& p_MA) {
    const size_t i = static_cast<size_t>(e);
    return memory.clearance_m[i] * memory.clearance_m[i] > (p_MA - memory.p_MA[i]).squaredNorm();
  };

  const Tracking tracking = definition.tracking;
  if (tracking == Tracking::all) {
    for (int e = 0; e < n; ++e) test(e, locate(e));
  } else if (tracking == Tracking::lipschitz) {
    for (int e = 0; e < n; ++e) {
      const Vec3 p_MA = locate(e);
      if (!cannotTouch(e, p_MA)) test(e, p_MA);
    }
  } else {
    // Breadth-first from every element that was active, outward to a ring of inactive ones [BF2004 §2.2].
    for (const int start : memory.previous) {
      if (memory.visit[static_cast<size_t>(start)] == stamp) continue;
      memory.queue.clear();
      memory.queue.push_back(start);
      memory.visit[static_cast<size_t>(start)] = stamp;
      for (size_t head = 0; head < memory.queue.size(); ++head) {
        const int e = memory.queue[head];
        if (!test(e, locate(e))) continue;
        const int ix = c.cell[static_cast<size_t>(e)] / c.nz, iz = c.cell[static_cast<size_t>(e)] % c.nz;
        for (int jx = std::max(ix - 1, 0); jx <= std::min(ix + 1, c.nx - 1); ++jx) {
          for (int jz = std::max(iz - 1, 0); jz <= std::min(iz + 1, c.nz - 1); ++jz) {
            const int next = c.element[static_cast<size_t>(jx * c.nz + jz)];
            if (next < 0 || memory.visit[static_cast<size_t>(next)] == stamp) continue;
            memory.visit[static_cast<size_t>(next)] = stamp;
            memory.queue.push_back(next);
          }
        }
      }
    }
    if (tracking == Tracking::breadthFirst || memory.active.empty()) {
      const bool guarded = tracking == Tracking::breadthFirst;
      for (int e = 0; e < n; ++e) {
        if (memory.visit[static_cast<size_t>(e)] == stamp) continue;
        const Vec3 p_MA = locate(e);
        if (!guarded || !cannotTouch(e, p_MA)) test(e, p_MA);
      }
    }
    // Sums run in element order, so that the way of finding contact cannot change their rounding.
    std::sort(memory.active.begin(), memory.active.end(),
              [](const Active& a, const Active& b) { return a.element < b.element; });
    memory.previous.clear();
    for (const Active& a : memory.active) memory.previous.push_back(a.element);
  }

  Vec3 moment = Vec3::Zero(), force = Vec3::Zero(), weighted = Vec3::Zero();
  double scalar = 0, area = 0, energy = 0;
  for (Active& a : memory.active) {
    const size_t i = static_cast<size_t>(a.element);
    LayerResponse r;
    if constexpr (std::is_same_v<Law, SeriesLayers>) {
      r = law_.calcResponse(a.d_m, c.hF_m[i], a.hM_m);
    } else {
      r = withEnergy ? law_.template calcResponse<true>(a.d_m, a.h_m) : law_.template calcResponse<false>(a.d_m, a.h_m);
    }
    a.p_Pa = r.p_Pa;
    const double f = r.p_Pa * c.area_m2[i];
    const Vec3 fVector = f * a.direction_F;
    force += fVector;
    moment += c.p_FA[i].cross(fVector);
    weighted += f * c.p_FA[i];
    scalar += f;
    area += c.area_m2[i];
    energy += r.energy_JPerM2 * c.area_m2[i];
    load.extrapolatedElements += r.extrapolated;
    load.maxStrain = std::max(load.maxStrain, a.d_m / a.h_m);
    if (r.p_Pa > load.peakPressure_Pa) {
      load.peakPressure_Pa = r.p_Pa;
      load.peakPoint_F = c.p_FA[i];
    }
  }
  load.forceOnM_F = force;
  load.momentOnM_Fo_F = moment;
  load.scalarForce_N = scalar;
  load.area_m2 = area;
  load.energy_J = withEnergy ? energy : 0;
  load.activeElements = static_cast<int>(memory.active.size());
  load.meanPressure_Pa = area > 0 ? scalar / area : 0;
  load.centerOfPressure_F = scalar > 0 ? Vec3(weighted / scalar) : Vec3(Vec3::Zero());
}

ContactPair::ContactPair(ContactPairDefinition definition) {
  if (definition.compartments.empty()) fail("contact pair: has no compartment; at least one is needed");
  definition.material.validate();
  if (definition.movingMaterial) definition.movingMaterial->validate();
  validateThickness("fixed", definition.fixedThickness);
  validateThickness("moving", definition.movingThickness);
  const auto isRigid = [](const Thickness& t) { return std::holds_alternative<RigidBody>(t.source); };
  if (isRigid(definition.fixedThickness) && isRigid(definition.movingThickness)) {
    fail("contact pair: both bodies are rigid; at least one needs a layer thickness");
  }
  impl_ = std::make_unique<Impl>(std::move(definition));
  Impl& m = *impl_;
  for (const CompartmentDefinition& c : m.definition.compartments) m.buildCompartment(c);

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
        fail("thickness of the moving body: its surface, y ", low, " .. ", high, " m, crosses the plane y = ", plane->planeY_m,
             " m from which the thickness is measured; move the plane to one side of it");
      }
    }
  } else if (std::holds_alternative<BackSurface>(moving.source)) {
    m.movingLayer = MovingLayer::map;
    if (moving.mapSamplesU < 2 || moving.mapSamplesV < 2) {
      fail("thickness of the moving body: map of ", moving.mapSamplesU, "x", moving.mapSamplesV, " samples; needed: at least 2x2");
    }
    std::vector<const ContactSurface*> done;  // compartments that share a surface share its map
    for (Compartment& c : m.compartments) {
      const auto it = std::find(done.begin(), done.end(), c.moving);
      const size_t index = static_cast<size_t>(it - done.begin());
      if (it == done.end()) {
        done.push_back(c.moving);
        m.mapReports.emplace_back();
        m.maps.push_back(std::make_unique<ThicknessMap>(*c.moving, moving, m.mapReports.back()));
      }
      c.map = m.maps[index].get();
    }
  }
}

ContactPair::~ContactPair() = default;
ContactPair::ContactPair(ContactPair&&) noexcept = default;

const ContactPairDefinition& ContactPair::definition() const { return impl_->definition; }
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
    t.noThicknessElements += l.noThicknessElements;
    t.boundaryElements += l.boundaryElements;
  }
  t.meanPressure_Pa = t.area_m2 > 0 ? t.scalarForce_N / t.area_m2 : 0;
  if (t.scalarForce_N > 0) t.centerOfPressure_F = weighted / t.scalarForce_N;
  return t;
}

}  // namespace

void ContactPair::evaluate(const JointCoordinates& q, ContactWorkspace& workspace, const Options& options,
                           ContactResult& result) const {
  ContactWorkspace::Impl& w = *workspace.impl_;
  if (w.hasStored && (w.storedWithEnergy || !options.withEnergy)) {
    double change = 0;
    for (size_t k = 0; k < 6; ++k) change = std::max(change, std::abs(q[k] - w.storedQ[k]));
    const double tolerance = impl_->definition.copyTolerance;
    if (change <= (options.copyOnlySamePose ? std::min(tolerance, 0.0) : tolerance)) {
      result = w.stored;
      result.distanceQueries = 0;
      result.copied = true;
      return;
    }
  }
  w.hasStored = false;
  w.X_FM = calcPose(q);
  if (++w.stamp == 0) {  // wrapped around: forget old visits
    for (CompartmentMemory& m : w.compartments) std::fill(m.visit.begin(), m.visit.end(), 0u);
    w.stamp = 1;
  }
  ContactResult& r = w.stored;
  r.distanceQueries = 0;
  r.copied = false;
  std::visit(
      [&](const auto& law) {
        for (size_t k = 0; k < impl_->compartments.size(); ++k) {
          r.compartments[k] = NetLoad{};
          impl_->evaluateCompartment(law, impl_->compartments[k], w.X_FM, options.withEnergy, w.compartments[k], w.stamp,
                                     r.compartments[k], r.distanceQueries);
        }
      },
      impl_->law);
  r.total = sumLoads(r.compartments);
  r.status = r.total.notConvergedQueries > 0       ? EvaluationStatus::notConverged
             : r.total.fullPenetrationElements > 0 ? EvaluationStatus::fullPenetration
             : r.total.extrapolatedElements > 0    ? EvaluationStatus::extrapolated
                                                   : EvaluationStatus::ok;
  w.storedQ = q;
  w.storedWithEnergy = options.withEnergy;
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
  for (size_t k = 0; k < fields.size(); ++k) {
    const Compartment& c = impl_->compartments[k];
    const CompartmentMemory& m = w.compartments[k];
    fields[k].resize(c.size());
    for (size_t i = 0; i < c.size(); ++i) {
      ElementField& f = fields[k][i];
      f.ix = c.cell[i] / c.nz;
      f.iz = c.cell[i] % c.nz;
      f.p_FA = c.p_FA[i];
      f.normal_F = c.normal_F[i];
      f.area_m2 = c.area_m2[i];
      f.h_m = c.hF_m[i];
      const double moved = (w.X_FM.applyInverse(c.p_FA[i]) - m.p_MA[i]).norm();
      f.footOnBorder = m.onBorder[i] != 0;
      f.distance_m = moved == 0 ? m.distance_m[i] : m.distance_m[i] - moved;
    }
    for (const Active& a : m.active) {
      ElementField& f = fields[k][static_cast<size_t>(a.element)];
      f.d_m = a.d_m;
      f.h_m = a.h_m;
      f.p_Pa = a.p_Pa;
      f.forceDirection_F = a.direction_F;
      f.active = true;
    }
  }
  return fields;
}

double ContactPair::calcPower(const NetLoad& load, const SpatialVelocity& V, const Vec3& p_FMo) {
  const Vec3 velocityAtFo = V.v_FMo - V.w_FM.cross(p_FMo);  // of the point of M that is at Fo
  return load.forceOnM_F.dot(velocityAtFo) + load.momentOnM_Fo_F.dot(V.w_FM);
}

std::array<double, 4> findRectangle(const ContactSurface& surface) {
  Eigen::AlignedBox3d box;
  constexpr int kSamples = 200;
  for (int k = 0; k < surface.numPatches(); ++k) {
    const NurbsPatch& p = surface.patch(k);
    for (int i = 0; i <= kSamples; ++i) {
      for (int j = 0; j <= kSamples; ++j) {
        const double u = p.uMin() + (p.uMax() - p.uMin()) * i / kSamples, v = p.vMin() + (p.vMax() - p.vMin()) * j / kSamples;
        if (p.calcNormal(u, v).y() > 0) box.extend(p.calcPoint(u, v));
      }
    }
  }
  if (box.isEmpty()) fail("fixed surface: no part of it faces upwards (+y); its normals are inverted, or it stands upright");
  return {box.min().x(), box.max().x(), box.min().z(), box.max().z()};
}

}  // namespace genu::contact
