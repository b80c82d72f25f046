#include <exception>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>

#include "genu/contact/AnalyticSurface.h"
#include "genu/contact/ContactPair.h"
#include "genu/contact/genu_contact.h"

namespace gc = genu::contact;

struct genu_surface {
  std::shared_ptr<const gc::ContactSurface> surface;
};
struct genu_pair {
  gc::ContactPair pair;
};
struct genu_workspace {
  const genu_pair* pair;
  gc::ContactWorkspace workspace;
  gc::ContactResult result;
};

namespace {

thread_local std::string lastError;

/** Runs `body`; turns exceptions into a status and keeps the reason. */
template <class Body>
genu_status guard(Body body) {
  try {
    lastError.clear();
    return body();
  } catch (const std::bad_alloc&) {
    lastError = "out of memory";
    return GENU_OUT_OF_MEMORY;
  } catch (const std::exception& e) {
    lastError = e.what();
    return GENU_BAD_ARGUMENT;
  }
}

void require(bool ok, const char* message) {
  if (!ok) throw std::invalid_argument(message);
}

genu_status makeSurface(std::vector<gc::NurbsPatch> patches, genu_surface** out) {
  *out = new genu_surface{std::make_shared<const gc::ContactSurface>(std::move(patches))};
  return GENU_OK;
}

gc::Solid toSolid(genu_solid solid) {
  require(solid >= GENU_SOLID_BELOW && solid <= GENU_SOLID_INSIDE, "surface: unknown solid side");
  return solid == GENU_SOLID_ABOVE ? gc::Solid::above : solid == GENU_SOLID_INSIDE ? gc::Solid::inside : gc::Solid::below;
}

gc::Thickness toThickness(const genu_thickness& t) {
  gc::Thickness out;
  switch (t.kind) {
    case GENU_THICKNESS_NONE: break;
    case GENU_THICKNESS_CONSTANT: out.source = gc::ConstantThickness{t.value}; break;
    case GENU_THICKNESS_ABOVE_PLANE: out.source = gc::HeightAbovePlane{t.value}; break;
    case GENU_THICKNESS_BACK_CLOSEST:
    case GENU_THICKNESS_BACK_NORMAL:
      require(t.back != nullptr, "thickness: back surface is NULL");
      out.source = gc::BackSurface{t.back->surface, t.kind == GENU_THICKNESS_BACK_NORMAL ? gc::BackDirection::normal
                                                                                         : gc::BackDirection::closest};
      break;
    default: throw std::invalid_argument("thickness: unknown kind");
  }
  if (t.min != 0) out.min_m = t.min;
  if (t.max != 0) out.max_m = t.max;
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
  out.mean_pressure = l.meanPressure_Pa;
  out.area = l.area_m2;
  out.energy = l.energy_J;
  copyVector(l.centerOfPressure_F, out.center_of_pressure);
  out.active_elements = l.activeElements;
  out.extrapolated_elements = l.extrapolatedElements;
  out.boundary_elements = l.boundaryElements;
  out.no_thickness_elements = l.noThicknessElements;
}

}  // namespace

extern "C" {

genu_status genu_surface_create_nurbs(int degree_u, int degree_v, int num_u, int num_v, const double* knots_u,
                                      const double* knots_v, const double* points, const double* weights,
                                      int flip_normal, genu_surface** out) {
  return guard([&] {
    require(knots_u && knots_v && points && out, "surface: knots, points and out must not be NULL");
    require(degree_u >= 1 && degree_v >= 1 && num_u >= 2 && num_v >= 2, "surface: degree must be >= 1, counts >= 2");
    gc::NurbsPatchData d;
    d.degreeU = degree_u;
    d.degreeV = degree_v;
    d.numU = num_u;
    d.numV = num_v;
    d.knotsU.assign(knots_u, knots_u + num_u + degree_u + 1);
    d.knotsV.assign(knots_v, knots_v + num_v + degree_v + 1);
    for (int i = 0; i < num_u * num_v; ++i) d.points.emplace_back(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
    if (weights) d.weights.assign(weights, weights + num_u * num_v);
    d.flipNormal = flip_normal != 0;
    std::vector<gc::NurbsPatch> patches;
    patches.emplace_back(std::move(d));
    return makeSurface(std::move(patches), out);
  });
}

genu_status genu_surface_create_plane(double y0, double slope_x, double slope_z, genu_solid solid, double half_extent,
                                      genu_surface** out) {
  return guard([&] {
    require(out, "surface: out is NULL");
    return makeSurface(gc::makePlane(y0, slope_x, slope_z, toSolid(solid), half_extent), out);
  });
}

genu_status genu_surface_create_sphere(double radius, genu_surface** out) {
  return guard([&] {
    require(out, "surface: out is NULL");
    return makeSurface(gc::makeSphere(radius), out);
  });
}

genu_status genu_surface_create_dish(double y0, double radius_sagittal, double radius_frontal, genu_solid solid,
                                     double half_extent, genu_surface** out) {
  return guard([&] {
    require(out, "surface: out is NULL");
    return makeSurface(gc::makeDish(y0, radius_sagittal, radius_frontal, toSolid(solid), half_extent), out);
  });
}

void genu_surface_destroy(genu_surface* surface) { delete surface; }

genu_status genu_pair_create(const genu_pair_options* options, genu_pair** out) {
  return guard([&] {
    require(options && out, "pair: options and out must not be NULL");
    require(options->compartments != nullptr && options->num_compartments > 0, "pair: at least one compartment is needed");
    gc::ContactPairDefinition d;
    for (int k = 0; k < options->num_compartments; ++k) {
      const genu_compartment& c = options->compartments[k];
      require(c.fixed && c.moving, "compartment: fixed and moving surface must not be NULL");
      gc::CompartmentDefinition def;
      def.name = c.name ? c.name : "compartment " + std::to_string(k);
      def.x0_m = c.x0;
      def.x1_m = c.x1;
      def.z0_m = c.z0;
      def.z1_m = c.z1;
      def.nx = c.nx;
      def.nz = c.nz;
      def.fixedSurface = c.fixed->surface;
      def.movingSurface = c.moving->surface;
      d.compartments.push_back(std::move(def));
    }
    if (options->use_element_plane) d.planeY_m = options->element_plane_y;
    d.fixedThickness = toThickness(options->fixed_thickness);
    d.movingThickness = toThickness(options->moving_thickness);
    d.material = toMaterial(options->material);
    d.strain = options->large_strain ? gc::StrainMeasure::large : gc::StrainMeasure::small;
    d.correction = options->no_correction ? gc::Correction::none : gc::Correction::midsurface;
    require(options->tracking >= 0 && options->tracking <= 2, "pair: tracking must be 0, 1 or 2");
    d.tracking = options->tracking == 1   ? gc::Tracking::all
                 : options->tracking == 2 ? gc::Tracking::breadthFirst
                                          : gc::Tracking::lipschitz;
    d.copyTolerance = options->copy_tolerance;
    *out = new genu_pair{gc::ContactPair(std::move(d))};
    return GENU_OK;
  });
}

void genu_pair_destroy(genu_pair* pair) { delete pair; }

int genu_pair_num_elements(const genu_pair* pair) { return pair ? pair->pair.numElements() : 0; }

genu_status genu_workspace_create(const genu_pair* pair, genu_workspace** out) {
  return guard([&] {
    require(pair && out, "workspace: pair and out must not be NULL");
    *out = new genu_workspace{pair, gc::ContactWorkspace(pair->pair), {}};
    return GENU_OK;
  });
}

void genu_workspace_destroy(genu_workspace* workspace) { delete workspace; }

genu_status genu_evaluate(const genu_pair* pair, genu_workspace* workspace, const double coordinates[6],
                          const double rates[6], int with_energy, genu_load* total, genu_load* compartments,
                          double* power) {
  return guard([&] {
    require(pair && workspace && coordinates && total, "evaluate: pair, workspace, coordinates and total must not be NULL");
    require(workspace->pair == pair, "evaluate: the workspace belongs to another pair");
    gc::JointCoordinates q, qdot{};
    for (size_t k = 0; k < 6; ++k) {
      q[k] = coordinates[k];
      require(q[k] - q[k] == 0, "evaluate: a coordinate is not finite");
      if (rates) qdot[k] = rates[k];
    }
    gc::ContactResult& r = workspace->result;
    pair->pair.evaluate(q, workspace->workspace, {with_energy != 0}, r);
    copyLoad(r.total, *total);
    if (compartments) {
      for (size_t k = 0; k < r.compartments.size(); ++k) copyLoad(r.compartments[k], compartments[k]);
    }
    if (power) {
      *power = rates ? gc::ContactPair::calcPower(r.total, gc::calcSpatialVelocity(q, qdot), gc::Vec3(q[3], q[4], q[5])) : 0;
    }
    switch (r.status) {
      case gc::EvaluationStatus::ok: return GENU_OK;
      case gc::EvaluationStatus::extrapolated: return GENU_EXTRAPOLATED;
      case gc::EvaluationStatus::fullPenetration: return GENU_FULL_PENETRATION;
      case gc::EvaluationStatus::notConverged: return GENU_NOT_CONVERGED;
    }
    return GENU_BAD_ARGUMENT;
  });
}

const char* genu_last_error(void) { return lastError.c_str(); }

const char* genu_status_text(genu_status status) {
  switch (status) {
    case GENU_OK: return "ok";
    case GENU_EXTRAPOLATED: return "extrapolated";
    case GENU_FULL_PENETRATION: return "full_penetration";
    case GENU_NOT_CONVERGED: return "not_converged";
    case GENU_BAD_ARGUMENT: return "bad_argument";
    case GENU_OUT_OF_MEMORY: return "out_of_memory";
  }
  return "unknown";
}

}  // extern "C"
