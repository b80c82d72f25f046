#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"
#include "genu/contact/ErrorEstimate.h"
#include "genu/contact/genu_contact.h"

namespace gc = genu::contact;

struct genu_surface {
  std::shared_ptr<const gc::ContactSurface> surface;
};
struct genu_pair {
  std::shared_ptr<const gc::ContactPair> pair;
};
namespace {
/** The caller's threads. */
class CallersRunner final : public gc::TaskRunner {
 public:
  genu_task_runner runner{};
  void run(int count, void (*task)(void* context, int index), void* context) const override {
    runner.run(runner.user, count, task, context);
  }
  int numThreads() const override { return runner.num_threads; }
};
}  // namespace

struct genu_workspace {
  std::shared_ptr<const gc::ContactPair> pair;  // kept alive: pair and workspace may be destroyed in any order
  gc::ContactWorkspace workspace;
  gc::ContactResult result;
  bool evaluated = false;
  CallersRunner runner{};
  std::unique_ptr<gc::ErrorEstimator> estimators[2] = {};  // by companion, made when first asked for
  gc::ContactErrorEstimate estimate = {};
};

namespace {

// A plain buffer: reporting "out of memory" must not allocate.
constexpr size_t kErrorSize = 1024;
thread_local char lastError[kErrorSize] = "";

genu_status fail(genu_status status, const char* text) noexcept {
  std::strncpy(lastError, text, kErrorSize - 1);
  lastError[kErrorSize - 1] = '\0';
  return status;
}

/** Runs `body`; turns exceptions into a status and keeps the reason. */
template <class Body>
genu_status guard(Body body) noexcept {
  try {
    lastError[0] = '\0';
    return body();
  } catch (const std::bad_alloc&) {
    return fail(GENU_OUT_OF_MEMORY, "out of memory");
  } catch (const std::length_error&) {
    return fail(GENU_OUT_OF_MEMORY, "a size is beyond what memory can hold");
  } catch (const std::invalid_argument& e) {
    return fail(GENU_BAD_ARGUMENT, e.what());
  } catch (const std::exception& e) {
    return fail(GENU_INTERNAL_ERROR, e.what());
  } catch (...) {
    return fail(GENU_INTERNAL_ERROR, "unknown exception");
  }
}

void require(bool ok, const char* message) {
  if (!ok) throw std::invalid_argument(message);
}
void require(bool ok, const std::string& message) {
  if (!ok) throw std::invalid_argument(message);
}

void requireFinite(const double* values, int count, const char* what) {
  for (int k = 0; k < count; ++k) {
    if (!std::isfinite(values[k])) {
      throw std::invalid_argument(std::string(what) + "[" + std::to_string(k) + "] is not a finite number");
    }
  }
}

/** A caller's struct of its own size as one of this library's. Fields the caller does not have are 0, the default; fields
 this library does not have must be 0. */
template <class Struct>
Struct readStruct(const Struct* from, const char* name) {
  Struct to{};
  const size_t size = from->struct_size;
  const auto refuse = [&](const char* why) {
    throw std::invalid_argument(std::string(name) + ": struct_size = " + std::to_string(size) + why);
  };
  if (size < sizeof(Struct::struct_size) || size > 65536) refuse(" must be the size of the struct: call its _init function");
  const unsigned char* bytes = reinterpret_cast<const unsigned char*>(from);
  for (size_t k = sizeof(Struct); k < size; ++k) {
    if (bytes[k] != 0) refuse(": a field is set that this older library does not know");
  }
  std::memcpy(&to, from, std::min(size, sizeof(Struct)));
  to.struct_size = sizeof(Struct);
  return to;
}

template <class Struct>
void initStruct(Struct* to, size_t size) {
  if (!to || size < sizeof(to->struct_size)) return;
  std::memset(static_cast<void*>(to), 0, size);
  to->struct_size = size;
}

genu_status makeSurface(std::vector<gc::NurbsPatch> patches, genu_surface** out) {
  auto made = std::make_unique<genu_surface>();
  made->surface = std::make_shared<const gc::ContactSurface>(std::move(patches));
  *out = made.release();
  return GENU_OK;
}

/** Checks `out`, makes the patches, makes the surface. */
template <class MakePatches>
genu_status createSurface(genu_surface** out, MakePatches makePatches) noexcept {
  return guard([&] {
    require(out != nullptr, "surface: out is NULL");
    return makeSurface(makePatches(), out);
  });
}

gc::Solid toSolid(genu_solid solid) {
  require(solid >= GENU_SOLID_BELOW && solid <= GENU_SOLID_INSIDE, "surface: unknown solid side");
  return solid == GENU_SOLID_ABOVE ? gc::Solid::above : solid == GENU_SOLID_INSIDE ? gc::Solid::inside : gc::Solid::below;
}

gc::NurbsPatch toPatch(const genu_nurbs_patch& p, int index) {
  const std::string where = "patches[" + std::to_string(index) + "]: ";
  require(p.knots_u && p.knots_v && p.points, where + "knots_u, knots_v and points must not be NULL");
  require(p.degree_u >= 1 && p.degree_v >= 1 && p.degree_u <= 5 && p.degree_v <= 5, where + "degrees must be 1 to 5");
  require(p.num_u > p.degree_u && p.num_v > p.degree_v, where + "num_u and num_v must be larger than the degrees");
  const auto requireKnots = [&](const char* direction, int knots, int points, int degree) {
    const long long needed = static_cast<long long>(points) + degree + 1;
    require(knots == needed, where + "num_knots_" + direction + " = " + std::to_string(knots) + " must be num_" + direction +
                                 " + degree_" + direction + " + 1 = " + std::to_string(needed));
  };
  requireKnots("u", p.num_knots_u, p.num_u, p.degree_u);
  requireKnots("v", p.num_knots_v, p.num_v, p.degree_v);
  gc::NurbsPatchData d;
  d.degreeU = p.degree_u;
  d.degreeV = p.degree_v;
  d.numU = p.num_u;
  d.numV = p.num_v;
  d.knotsU.assign(p.knots_u, p.knots_u + p.num_knots_u);
  d.knotsV.assign(p.knots_v, p.knots_v + p.num_knots_v);
  const size_t count = static_cast<size_t>(p.num_u) * static_cast<size_t>(p.num_v);
  d.points.reserve(count);
  for (size_t i = 0; i < count; ++i) d.points.emplace_back(p.points[3 * i], p.points[3 * i + 1], p.points[3 * i + 2]);
  if (p.weights) d.weights.assign(p.weights, p.weights + count);
  d.flipNormal = p.flip_normal != 0;
  try {
    return gc::NurbsPatch(std::move(d));
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(where + e.what());
  }
}

gc::Vec3 toVector(const double v[3]) { return {v[0], v[1], v[2]}; }
bool isZero(const double v[3]) { return v[0] == 0 && v[1] == 0 && v[2] == 0; }

template <class Round>
void readRound(const genu_element_surface& s, const std::string& where, gc::Vec3& center, Round& round) {
  requireFinite(s.center, 3, (where + "center").c_str());
  requireFinite(s.axis, 3, (where + "axis").c_str());
  requireFinite(s.zero, 3, (where + "zero").c_str());
  requireFinite(s.angle, 2, (where + "angle").c_str());
  requireFinite(&s.limit_radius, 1, (where + "limit_radius").c_str());
  center = toVector(s.center);
  if (!isZero(s.axis)) round.axis = toVector(s.axis);
  if (!isZero(s.zero)) round.zero = toVector(s.zero);
  round.angle0_rad = s.angle[0];
  round.angle1_rad = s.angle[1];
  if (s.limit_radius != 0) round.radius_m = s.limit_radius;
}

gc::ElementSurface toElementSurface(const genu_element_surface& s, int index) {
  const std::string where = "element_surfaces[" + std::to_string(index) + "]: ";
  switch (s.kind) {
    case GENU_ELEMENTS_PLANE_UP: return gc::ElementPlane{gc::PlaneFacing::up};
    case GENU_ELEMENTS_PLANE_DOWN: return gc::ElementPlane{gc::PlaneFacing::down};
    case GENU_ELEMENTS_CYLINDER_OUTWARD:
    case GENU_ELEMENTS_CYLINDER_INWARD: {
      gc::ElementCylinder out;
      readRound(s, where, out.point_m, out);
      requireFinite(s.axial, 2, (where + "axial").c_str());
      out.facing = s.kind == GENU_ELEMENTS_CYLINDER_INWARD ? gc::RoundFacing::inward : gc::RoundFacing::outward;
      out.axial0_m = s.axial[0];
      out.axial1_m = s.axial[1];
      return out;
    }
    case GENU_ELEMENTS_SPHERE_OUTWARD:
    case GENU_ELEMENTS_SPHERE_INWARD: {
      gc::ElementSphere out;
      readRound(s, where, out.center_m, out);
      requireFinite(s.elevation, 2, (where + "elevation").c_str());
      out.facing = s.kind == GENU_ELEMENTS_SPHERE_INWARD ? gc::RoundFacing::inward : gc::RoundFacing::outward;
      out.elevation0_rad = s.elevation[0];
      out.elevation1_rad = s.elevation[1];
      return out;
    }
  }
  throw std::invalid_argument(where + "unknown kind");
}

gc::RadialThickness toRadial(double radius, const genu_round_back* back, const std::string& name) {
  gc::RadialThickness out;
  out.radius_m = radius;
  if (!back) return out;
  requireFinite(back->center, 3, (name + ": center of the round back").c_str());
  requireFinite(back->axis, 3, (name + ": axis of the round back").c_str());
  out.center_m = toVector(back->center);
  if (!isZero(back->axis)) out.axis = toVector(back->axis);
  return out;
}

gc::Thickness toThickness(const genu_thickness& t, const genu_round_back* round, const std::string& name) {
  gc::Thickness out;
  switch (t.kind) {
    case GENU_THICKNESS_NONE: break;
    case GENU_THICKNESS_CONSTANT: out.source = gc::ConstantThickness{t.value}; break;
    case GENU_THICKNESS_ABOVE_PLANE: out.source = gc::HeightAbovePlane{t.value}; break;
    case GENU_THICKNESS_BACK_CLOSEST:
    case GENU_THICKNESS_BACK_NORMAL:
      require(t.back != nullptr, name + ": back surface is NULL");
      out.source = gc::BackSurface{t.back->surface, t.kind == GENU_THICKNESS_BACK_NORMAL ? gc::BackDirection::normal
                                                                                         : gc::BackDirection::closest};
      break;
    case GENU_THICKNESS_RADIAL: out.source = toRadial(t.value, round, name); break;
    default: throw std::invalid_argument(name + ": unknown kind");
  }
  for (const double v : {t.value, t.min, t.max, t.missing}) {
    require(std::isfinite(v), name + ": a value is not a finite number");
  }
  require(t.min >= 0 && t.max >= 0 && t.missing >= 0, name + ": min, max and missing must be >= 0 (0: none)");
  require(t.map_samples_u >= 0 && t.map_samples_v >= 0 && t.map_samples_u != 1 && t.map_samples_v != 1 &&
              t.map_samples_u <= 4096 && t.map_samples_v <= 4096,
          name + ": map_samples_u and map_samples_v must be 2 to 4096, or 0 for the default");
  if (t.min != 0) out.min_m = t.min;
  if (t.max != 0) out.max_m = t.max;
  if (t.missing != 0) out.missing_m = t.missing;
  if (t.map_samples_u != 0) out.mapSamplesU = t.map_samples_u;
  if (t.map_samples_v != 0) out.mapSamplesV = t.map_samples_v;
  return out;
}

gc::Material toMaterial(const genu_material& m) {
  gc::Material out;
  require(m.law >= GENU_LINEAR && m.law <= GENU_POWER_LAW_CONSISTENT, "material: unknown law");
  out.law = m.law == GENU_LINEAR      ? gc::MaterialLaw::linear
            : m.law == GENU_POWER_LAW ? gc::MaterialLaw::powerLaw
                                      : gc::MaterialLaw::powerLawConsistent;
  out.E_Pa = m.youngs_modulus;
  out.nu = m.poisson_ratio;
  out.eps0 = m.eps0;
  out.p0_Pa = m.p0;
  out.n = m.n;
  return out;
}

gc::CompartmentDefinition toCompartment(const genu_compartment& c, int index) {
  const std::string where = "compartments[" + std::to_string(index) + "]: ";
  require(c.fixed && c.moving, where + "fixed and moving surface must not be NULL");
  const double rectangle[] = {c.x0, c.x1, c.z0, c.z1};
  requireFinite(rectangle, 4, (where + "x0, x1, z0, z1").c_str());
  gc::CompartmentDefinition out;
  out.name = c.name ? c.name : "compartment " + std::to_string(index);
  out.x0_m = c.x0;
  out.x1_m = c.x1;
  out.z0_m = c.z0;
  out.z1_m = c.z1;
  out.nx = c.nx;
  out.nz = c.nz;
  out.fixedSurface = c.fixed->surface;
  out.movingSurface = c.moving->surface;
  return out;
}

gc::ContactPairDefinition toDefinition(const genu_pair_options& o) {
  require(o.compartments != nullptr && o.num_compartments > 0, "pair: at least one compartment is needed");
  require(o.strain == GENU_STRAIN_SMALL || o.strain == GENU_STRAIN_LARGE, "pair: unknown strain");
  require(o.distance == GENU_DISTANCE_MINIMUM || o.distance == GENU_DISTANCE_RAY, "pair: unknown distance");
  require(o.rule == GENU_RULE_SMOOTH || o.rule == GENU_RULE_CENTRE, "pair: unknown rule");
  require(std::isfinite(o.element_plane_y), "pair: element_plane_y is not a finite number");
  require(std::isfinite(o.copy_tolerance), "pair: copy_tolerance is not a finite number");
  require(std::isfinite(o.damping), "pair: damping is not a finite number");
  gc::ContactPairDefinition d;
  for (int k = 0; k < o.num_compartments; ++k) d.compartments.push_back(toCompartment(o.compartments[k], k));
  for (int k = 0; o.element_surfaces && k < o.num_compartments; ++k) {
    d.compartments[static_cast<size_t>(k)].elementSurface = toElementSurface(o.element_surfaces[k], k);
  }
  require(o.grid_on == GENU_GRID_ON_FIXED || o.grid_on == GENU_GRID_ON_MOVING, "pair: unknown grid_on");
  d.gridOn = o.grid_on == GENU_GRID_ON_MOVING ? gc::GridOn::moving : gc::GridOn::fixed;
  if (o.use_element_plane) d.planeY_m = o.element_plane_y;
  d.fixedThickness = toThickness(o.fixed_thickness, o.fixed_round_back, "fixed_thickness");
  d.movingThickness = toThickness(o.moving_thickness, o.moving_round_back, "moving_thickness");
  d.material = toMaterial(o.material);
  if (o.moving_material) d.movingMaterial = toMaterial(*o.moving_material);
  d.strain = o.strain == GENU_STRAIN_LARGE ? gc::StrainMeasure::large : gc::StrainMeasure::small;
  switch (o.correction) {
    case GENU_CORRECTION_MIDSURFACE: d.correction = gc::Correction::midsurface; break;
    case GENU_CORRECTION_NONE: d.correction = gc::Correction::none; break;
    case GENU_CORRECTION_ENERGY: d.correction = gc::Correction::energy; break;
    default: throw std::invalid_argument("pair: unknown correction");
  }
  d.distance = o.distance == GENU_DISTANCE_RAY ? gc::DistanceMethod::ray : gc::DistanceMethod::minimum;
  d.rule = o.rule == GENU_RULE_CENTRE ? gc::ContactRule::centre : gc::ContactRule::smooth;
  switch (o.tracking) {
    case GENU_TRACKING_LIPSCHITZ: d.tracking = gc::Tracking::lipschitz; break;
    case GENU_TRACKING_ALL: d.tracking = gc::Tracking::all; break;
    case GENU_TRACKING_BREADTH_FIRST: d.tracking = gc::Tracking::breadthFirst; break;
    case GENU_TRACKING_BREADTH_FIRST_UNGUARDED: d.tracking = gc::Tracking::breadthFirstUnguarded; break;
    default: throw std::invalid_argument("pair: unknown tracking");
  }
  d.copyTolerance = o.copy_tolerance;
  d.damping_sPerM = o.damping;
  return d;
}

bool hasCompartment(const genu_pair* pair, int compartment) {
  return pair && compartment >= 0 && compartment < pair->pair->numCompartments();
}

void requireCompartment(const genu_pair* pair, int compartment) {
  require(pair != nullptr, "pair is NULL");
  require(hasCompartment(pair, compartment), "compartment = " + std::to_string(compartment) + " must be 0 to " +
                                                 std::to_string(pair->pair->numCompartments() - 1));
}

void copyVector(const gc::Vec3& v, double out[3]) {
  for (int k = 0; k < 3; ++k) out[k] = v[k];
}

void copyLoad(const gc::NetLoad& l, genu_load& out) {
  copyVector(l.forceOnM_F, out.force_on_moving);
  copyVector(l.momentOnM_Fo_F, out.moment_on_moving_about_fixed_origin);
  copyVector(l.forceOnF_F(), out.force_on_fixed);
  copyVector(l.momentOnF_Fo_F(), out.moment_on_fixed_about_fixed_origin);
  out.scalar_force = l.scalarForce_N;
  out.peak_pressure = l.peakPressure_Pa;
  copyVector(l.peakPoint_F, out.peak_point);
  out.mean_pressure = l.meanPressure_Pa;
  out.area = l.area_m2;
  out.energy = l.energy_J;
  out.max_strain = l.maxStrain;
  copyVector(l.centerOfPressure_F, out.center_of_pressure);
  out.active_elements = l.activeElements;
  out.extrapolated_elements = l.extrapolatedElements;
  out.full_penetration_elements = l.fullPenetrationElements;
  out.not_converged_queries = l.notConvergedQueries;
  out.boundary_elements = l.boundaryElements;
  out.no_thickness_elements = l.noThicknessElements;
}

void copyElement(const gc::ElementField& e, genu_element& out) {
  out.ix = e.ix;
  out.iz = e.iz;
  copyVector(e.p_FA, out.point);
  copyVector(e.normal_F, out.normal);
  out.area = e.area_m2;
  out.contact_share = e.contactShare;
  out.force = e.force_N;
  out.distance = e.distance_m;
  out.penetration = e.d_m;
  out.thickness = e.h_m;
  out.pressure = e.p_Pa;
  copyVector(e.forceDirection_F, out.force_direction);
  out.active = e.active;
  out.foot_on_border = e.footOnBorder;
}

gc::JointCoordinates toCoordinates(const double values[6]) {
  gc::JointCoordinates q;
  std::copy(values, values + 6, q.begin());
  return q;
}

genu_status toStatus(gc::EvaluationStatus status) {
  switch (status) {
    case gc::EvaluationStatus::ok: return GENU_OK;
    case gc::EvaluationStatus::extrapolated: return GENU_EXTRAPOLATED;
    case gc::EvaluationStatus::fullPenetration: return GENU_FULL_PENETRATION;
    case gc::EvaluationStatus::notConverged: return GENU_NOT_CONVERGED;
  }
  throw std::logic_error("evaluate: unknown status");
}

}  // namespace

extern "C" {

const char* genu_version(void) { return GENU_VERSION; }

// ---- Errors ----

const char* genu_last_error(void) { return lastError; }

const char* genu_status_text(genu_status status) {
  switch (status) {
    case GENU_OK: return "ok";
    case GENU_EXTRAPOLATED: return "extrapolated";
    case GENU_FULL_PENETRATION: return "full_penetration";
    case GENU_NOT_CONVERGED: return "not_converged";
    case GENU_BAD_ARGUMENT: return "bad_argument";
    case GENU_OUT_OF_MEMORY: return "out_of_memory";
    case GENU_INTERNAL_ERROR: return "internal_error";
  }
  return "unknown";
}

genu_status genu_set_last_error(genu_status status, const char* text) { return fail(status, text ? text : ""); }

// ---- Surfaces ----

genu_status genu_surface_create_nurbs(const genu_nurbs_patch* patches, int num_patches, genu_surface** out) {
  return createSurface(out, [&] {
    require(patches != nullptr && num_patches > 0, "surface: at least one patch is needed");
    std::vector<gc::NurbsPatch> made;
    for (int k = 0; k < num_patches; ++k) made.push_back(toPatch(patches[k], k));
    return made;
  });
}

genu_status genu_surface_create_plane(double y0, double slope_x, double slope_z, genu_solid solid, double half_extent,
                                      genu_surface** out) {
  return createSurface(out, [&] { return gc::makePlane(y0, slope_x, slope_z, toSolid(solid), half_extent); });
}

genu_status genu_surface_create_dish(double y0, double radius_sagittal, double radius_frontal, genu_solid solid,
                                     double half_extent, genu_surface** out) {
  return createSurface(
      out, [&] { return gc::makeDish(y0, radius_sagittal, radius_frontal, toSolid(solid), half_extent); });
}

genu_status genu_surface_create_paraboloid(double y0, double radius_x, double radius_z, genu_solid solid,
                                           double half_extent, genu_surface** out) {
  return createSurface(out, [&] { return gc::makeParaboloid(y0, radius_x, radius_z, toSolid(solid), half_extent); });
}

genu_status genu_surface_create_sphere(double radius, genu_surface** out) {
  return createSurface(out, [&] { return gc::makeSphere(radius); });
}

genu_status genu_surface_create_cylinder(double radius, double length, genu_surface** out) {
  return createSurface(out, [&] { return gc::makeCylinder(radius, length); });
}

genu_status genu_surface_create_ellipsoid(double a, double b, double c, genu_surface** out) {
  return createSurface(out, [&] { return gc::makeEllipsoid(a, b, c); });
}

genu_status genu_surface_create_torus(double radius_sagittal, double radius_frontal, genu_surface** out) {
  return createSurface(out, [&] { return gc::makeTorus(radius_sagittal, radius_frontal); });
}

genu_status genu_surface_create_placed(const genu_surface* surface, const double placement[6], genu_surface** out) {
  return createSurface(out, [&] {
    require(surface && placement, "surface: surface and placement must not be NULL");
    requireFinite(placement, 6, "surface: placement");
    const gc::Pose pose = gc::calcPose(toCoordinates(placement));
    std::vector<gc::NurbsPatch> patches;
    for (int k = 0; k < surface->surface->numPatches(); ++k) patches.push_back(surface->surface->patch(k).transformed(pose));
    return patches;
  });
}

genu_status genu_surface_create_flipped(const genu_surface* surface, genu_surface** out) {
  return createSurface(out, [&] {
    require(surface != nullptr, "surface: surface must not be NULL");
    std::vector<gc::NurbsPatch> patches;
    for (int k = 0; k < surface->surface->numPatches(); ++k) patches.push_back(surface->surface->patch(k).flipped());
    return patches;
  });
}

void genu_surface_destroy(genu_surface* surface) { delete surface; }

int genu_surface_num_patches(const genu_surface* surface) { return surface ? surface->surface->numPatches() : 0; }

// ---- Contact pairs ----

void genu_pair_options_init(genu_pair_options* options, size_t size) { initStruct(options, size); }
void genu_evaluate_options_init(genu_evaluate_options* options, size_t size) { initStruct(options, size); }
void genu_result_init(genu_result* result, size_t size) { initStruct(result, size); }

genu_status genu_pair_create(const genu_pair_options* options, genu_pair** out) {
  return guard([&] {
    require(options && out, "pair: options and out must not be NULL");
    auto made = std::make_unique<genu_pair>();
    made->pair = std::make_shared<const gc::ContactPair>(toDefinition(readStruct(options, "genu_pair_options")));
    *out = made.release();
    return GENU_OK;
  });
}

void genu_pair_destroy(genu_pair* pair) { delete pair; }

int genu_pair_num_compartments(const genu_pair* pair) { return pair ? pair->pair->numCompartments() : 0; }

int genu_pair_num_elements(const genu_pair* pair) { return pair ? pair->pair->numElements() : 0; }

int genu_pair_num_compartment_elements(const genu_pair* pair, int compartment) {
  if (!hasCompartment(pair, compartment)) return 0;
  return pair->pair->gridReports()[static_cast<size_t>(compartment)].elements;
}

const char* genu_pair_compartment_name(const genu_pair* pair, int compartment) {
  if (!hasCompartment(pair, compartment)) return nullptr;
  return pair->pair->gridReports()[static_cast<size_t>(compartment)].name.c_str();
}

genu_status genu_pair_grid_report(const genu_pair* pair, int compartment, genu_grid_report* out) {
  return guard([&] {
    require(out != nullptr, "grid report: out is NULL");
    requireCompartment(pair, compartment);
    const gc::GridReport& r = pair->pair->gridReports()[static_cast<size_t>(compartment)];
    out->cells = r.cells;
    out->elements = r.elements;
    out->missed_surface = r.missedSurface;
    out->below_plane = r.belowPlane;
    out->downward_only = r.downwardOnly;
    out->missed_back = r.missedBack;
    out->clamped = r.clamped;
    out->min_thickness = r.minThickness_m;
    out->max_thickness = r.maxThickness_m;
    out->mean_thickness = r.meanThickness_m;
    out->surface_area = r.surfaceArea_m2;
    return GENU_OK;
  });
}

int genu_pair_num_maps(const genu_pair* pair) {
  return pair ? static_cast<int>(pair->pair->thicknessMapReports().size()) : 0;
}

genu_status genu_pair_map_report(const genu_pair* pair, int map, genu_map_report* out) {
  return guard([&] {
    require(pair && out, "map report: pair and out must not be NULL");
    require(map >= 0 && map < genu_pair_num_maps(pair), "map = " + std::to_string(map) + " must be below " +
                                                            std::to_string(genu_pair_num_maps(pair)));
    const gc::ThicknessMapReport& r = pair->pair->thicknessMapReports()[static_cast<size_t>(map)];
    out->samples = r.samples;
    out->missed = r.missed;
    out->clamped = r.clamped;
    out->min_thickness = r.min_m;
    out->max_thickness = r.max_m;
    out->mean_thickness = r.mean_m;
    return GENU_OK;
  });
}

// ---- Evaluation ----

genu_status genu_workspace_create(const genu_pair* pair, genu_workspace** out) {
  return guard([&] {
    require(pair && out, "workspace: pair and out must not be NULL");
    *out = new genu_workspace{pair->pair, gc::ContactWorkspace(*pair->pair), {}, false};
    return GENU_OK;
  });
}

void genu_workspace_reset(genu_workspace* workspace) {
  if (!workspace) return;
  workspace->workspace.reset();
  workspace->evaluated = false;
}

genu_status genu_workspace_set_task_runner(genu_workspace* workspace, const genu_task_runner* runner) {
  return guard([&] {
    require(workspace != nullptr, "task runner: workspace is NULL");
    require(runner == nullptr || runner->run != nullptr, "task runner: run is NULL");
    require(runner == nullptr || runner->num_threads >= 1, "task runner: num_threads is less than 1");
    workspace->runner.runner = runner != nullptr ? *runner : genu_task_runner{};
    workspace->workspace.setTaskRunner(runner != nullptr ? &workspace->runner : nullptr);
    return GENU_OK;
  });
}

void genu_workspace_destroy(genu_workspace* workspace) { delete workspace; }

genu_status genu_evaluate(const genu_pair* pair, genu_workspace* workspace, const double coordinates[6],
                          const double rates[6], const genu_evaluate_options* options, genu_result* result,
                          genu_load* compartments, int num_compartments) {
  return guard([&] {
    require(pair && workspace && coordinates && result,
            "evaluate: pair, workspace, coordinates and result must not be NULL");
    require(workspace->pair == pair->pair, "evaluate: the workspace belongs to another pair");
    requireFinite(coordinates, 6, "evaluate: coordinates");
    if (rates) requireFinite(rates, 6, "evaluate: rates");
    const int expected = pair->pair->numCompartments();
    if (compartments && num_compartments != expected) {
      throw std::invalid_argument("evaluate: num_compartments = " + std::to_string(num_compartments) + " must be " +
                                  std::to_string(expected));
    }
    genu_result made = readStruct(result, "genu_result");
    gc::ContactPair::Options o;
    if (options) {
      const genu_evaluate_options given = readStruct(options, "genu_evaluate_options");
      o.withEnergy = given.with_energy != 0;
      o.withStiffness = given.with_stiffness != 0;
      o.copyOnlySamePose = given.copy_only_same_pose != 0;
    }
    const gc::JointCoordinates q = toCoordinates(coordinates);
    gc::ContactResult& r = workspace->result;
    const gc::JointCoordinates qdot = rates ? toCoordinates(rates) : gc::JointCoordinates{};
    pair->pair->evaluate(q, qdot, workspace->workspace, o, r);
    workspace->evaluated = true;
    copyLoad(r.total, made.total);
    made.power = !rates ? 0
                        : gc::ContactPair::calcPower(r.total, gc::calcSpatialVelocity(q, qdot),
                                                     gc::Vec3(q[3], q[4], q[5]));
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 6; ++column) {
        made.stiffness[6 * row + column] = o.withStiffness ? r.stiffness(row, column) : 0;
        made.damping[6 * row + column] = o.withStiffness ? r.damping(row, column) : 0;
      }
    }
    made.distance_queries = r.distanceQueries;
    made.copied = r.copied;
    const size_t size = result->struct_size;
    std::memcpy(result, &made, std::min(size, sizeof made));
    result->struct_size = size;
    for (int k = 0; compartments && k < expected; ++k) copyLoad(r.compartments[static_cast<size_t>(k)], compartments[k]);
    // Rates and places whose products overflow.
    return std::isfinite(made.power) ? toStatus(r.status) : GENU_NOT_CONVERGED;
  });
}

genu_status genu_pair_fields(const genu_pair* pair, const genu_workspace* workspace, int compartment,
                             genu_element* elements, size_t capacity, size_t* count) {
  return guard([&] {
    require(pair && workspace, "fields: pair and workspace must not be NULL");
    require(workspace->pair == pair->pair, "fields: the workspace belongs to another pair");
    requireCompartment(pair, compartment);
    const size_t needed = static_cast<size_t>(genu_pair_num_compartment_elements(pair, compartment));
    if (elements) {
      require(workspace->evaluated, "fields: the workspace holds no evaluation");
      require(capacity >= needed,
              "fields: capacity = " + std::to_string(capacity) + " must be at least " + std::to_string(needed));
      const auto fields = pair->pair->calcFields(workspace->workspace);
      const std::vector<gc::ElementField>& own = fields[static_cast<size_t>(compartment)];
      if (own.size() != needed) throw std::logic_error("fields: number of elements");
      for (size_t k = 0; k < needed; ++k) copyElement(own[k], elements[k]);
    }
    if (count) *count = needed;
    return GENU_OK;
  });
}

// ---- Error estimate ----

void genu_error_estimate_init(genu_error_estimate* estimate, size_t size) { initStruct(estimate, size); }

genu_status genu_estimate_error(const genu_pair* pair, genu_workspace* workspace, genu_companion companion,
                                genu_error_estimate* estimate, genu_load_error* compartments, int num_compartments) {
  return guard([&] {
    require(pair && workspace && estimate, "error estimate: pair, workspace and estimate must not be NULL");
    require(workspace->pair == pair->pair, "error estimate: the workspace belongs to another pair");
    require(workspace->evaluated, "error estimate: the workspace holds no evaluation");
    require(companion == GENU_COMPANION_FINE || companion == GENU_COMPANION_COARSE, "error estimate: unknown companion");
    const int expected = pair->pair->numCompartments();
    if (compartments && num_compartments != expected) {
      throw std::invalid_argument("error estimate: num_compartments = " + std::to_string(num_compartments) + " must be " +
                                  std::to_string(expected));
    }
    genu_error_estimate made = readStruct(estimate, "genu_error_estimate");
    const bool isCoarse = companion == GENU_COMPANION_COARSE;
    std::unique_ptr<gc::ErrorEstimator>& estimator = workspace->estimators[isCoarse];
    if (!estimator) {
      estimator = std::make_unique<gc::ErrorEstimator>(*pair->pair, isCoarse ? gc::Companion::coarse : gc::Companion::fine);
    }
    gc::ContactErrorEstimate& e = workspace->estimate;
    estimator->evaluate(workspace->workspace, e);
    const auto copy = [](const gc::LoadError& from) {
      return genu_load_error{from.force_N, from.moment_Nm, from.peakPressure_Pa, from.meanPressure_Pa, from.area_m2};
    };
    made.total = copy(e.total);
    made.companion_elements = e.companionElements;
    const size_t size = estimate->struct_size;
    std::memcpy(estimate, &made, std::min(size, sizeof made));
    estimate->struct_size = size;
    for (int k = 0; compartments && k < expected; ++k) compartments[k] = copy(e.compartments[static_cast<size_t>(k)]);
    return toStatus(e.companionStatus);
  });
}

}  // extern "C"
