#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "Commands.h"
#include "genu/contact/ContactPair.h"
#include "genu/contact/ContactSurface.h"
#include "genu/io/Suggest.h"
#include "genu/io/Units.h"
#include "genu/model/Analysis.h"
#include "genu/model/KneeSystem.h"
#include "genu/model/OdeIntegrator.h"
#include "genu/model/UrdfModel.h"
#include "genu/report/ContactReport.h"

namespace genu::app {
namespace fs = std::filesystem;
using scene::kCoordinateNames;
using scene::Scene;

namespace {

struct Built {
  Scene scene;
  std::vector<std::shared_ptr<const contact::ContactPair>> pairs;
};

/** Everything a run builds before it starts, so that whatever a run would refuse is refused here. */
Built build(const fs::path& file, const CommonOptions& common) {
  Built built;
  built.scene = scene::readScene(file, makeReadOptions(common, {}, false));
  built.pairs = scene::makeContactPairs(built.scene);
  return built;
}

std::string describe(const scene::TimeFunction& function, const std::string& unit) {
  if (const auto* value = std::get_if<double>(&function)) return io::formatQuantity(*value, unit);
  const auto& series = std::get<scene::TimeSeries>(function);
  const auto [low, high] = std::minmax_element(series.value.begin(), series.value.end());
  return fmt::format("table {}: {} to {}, {:g} to {:g} s, {} rows", series.source, io::formatQuantity(*low, unit),
                     io::formatQuantity(*high, unit), series.time_s.front(), series.time_s.back(),
                     series.time_s.size());
}

std::string describe(const contact::Thickness& thickness) {
  std::string text = std::visit(
      [](const auto& source) -> std::string {
        using T = std::decay_t<decltype(source)>;
        if constexpr (std::is_same_v<T, contact::RigidBody>) {
          return "none: rigid";
        } else if constexpr (std::is_same_v<T, contact::ConstantThickness>) {
          return "constant, " + io::formatQuantity(source.h_m, "mm");
        } else if constexpr (std::is_same_v<T, contact::HeightAbovePlane>) {
          return "height above the plane y = " + io::formatQuantity(source.planeY_m, "mm");
        } else if constexpr (std::is_same_v<T, contact::RadialThickness>) {
          return std::string("distance to a ") + (source.axis ? "cylinder" : "sphere") + " of radius " +
                 io::formatQuantity(source.radius_m, "mm");
        } else {
          return source.direction == contact::BackDirection::normal ? "back surface along the normal"
                                                                    : "back surface, closest point";
        }
      },
      thickness.source);
  if (thickness.min_m) text += ", at least " + io::formatQuantity(*thickness.min_m, "mm");
  if (thickness.max_m) text += ", at most " + io::formatQuantity(*thickness.max_m, "mm");
  if (thickness.missing_m) text += ", " + io::formatQuantity(*thickness.missing_m, "mm") + " where the back is missed";
  return text;
}

std::string describe(const contact::Material& m) {
  if (m.law == contact::MaterialLaw::linear)
    return fmt::format("linear, E = {}, nu = {:g}", io::formatQuantity(m.E_Pa, "MPa"), m.nu);
  return fmt::format("{}, eps0 = {:g}, p0 = {}, n = {:g}, nu = {:g}",
                     m.law == contact::MaterialLaw::powerLaw ? "power-law" : "power-law-consistent", m.eps0,
                     io::formatQuantity(m.p0_Pa, "MPa"), m.n, m.nu);
}

const char* describe(contact::Tracking tracking) {
  switch (tracking) {
    case contact::Tracking::all:
      return "every element at every evaluation";
    case contact::Tracking::lipschitz:
      return "elements that cannot touch yet are skipped (exact)";
    case contact::Tracking::breadthFirst:
      return "breadth-first search from the last active set, then the rest checked (exact)";
    case contact::Tracking::breadthFirstUnguarded:
      return "breadth-first search only: can miss a new, separate region";
  }
  return "";
}

const char* describe(contact::Correction correction) {
  switch (correction) {
    case contact::Correction::midsurface:
      return "midsurface (the force is not the gradient of an energy)";
    case contact::Correction::none:
      return "none";
    case contact::Correction::energy:
      return "energy (midsurface distance, force from the gradient of the energy)";
  }
  return "";
}

std::string describe(const musculoskeletal::WrapSurface& surface) {
  using Shape = musculoskeletal::WrapSurface::Shape;
  const auto& a = surface.halfAxes_m;
  if (surface.shape == Shape::sphere) return fmt::format("sphere R {:g} mm", a.x() * 1e3);
  if (surface.shape == Shape::ellipsoid) return fmt::format("ellipsoid {:g}, {:g}, {:g} mm", a.x() * 1e3, a.y() * 1e3, a.z() * 1e3);
  return fmt::format("cylinder R {:g} mm{}", a.x() * 1e3, surface.side ? ", passed on one side" : "");
}

bool isRigid(const contact::Thickness& t) { return std::holds_alternative<contact::RigidBody>(t.source); }
bool hasBack(const contact::Thickness& t) { return std::holds_alternative<contact::BackSurface>(t.source); }
bool needsMap(const contact::Thickness& t) {
  return std::holds_alternative<contact::BackSurface>(t.source) || std::holds_alternative<contact::RadialThickness>(t.source);
}

void explainModel(const Scene& scene) {
  if (!scene.model) return;
  const scene::ModelSpec& model = *scene.model;
  const model::UrdfModel urdf = model::readUrdf(model);
  fmt::print("\nModel: {}\n", model.urdf.string());
  for (size_t i = 0; i < urdf.links.size(); ++i) {
    const auto& link = urdf.links[i];
    const char* role = static_cast<int>(i) == urdf.floatingChild      ? ", moving body M"
                       : static_cast<int>(i) == urdf.floatingParent() ? ", fixed body F"
                                                                      : "";
    const std::string mass = link.inertia ? io::formatQuantity(link.inertia->mass_kg, "kg") : "no mass given";
    std::string joint = "welded to ground";
    if (link.joint) {
      constexpr std::array<const char*, 4> kTypes = {"fixed", "six coordinates", "one rotation", "one translation"};
      joint = fmt::format("joint {}: {}", link.joint->name, kTypes[static_cast<size_t>(link.joint->type)]);
      if (!model.joints.empty()) joint += " on " + urdf.links[static_cast<size_t>(link.joint->parent)].name;
    }
    fmt::print("  link {:<20} {}, {}{}\n", link.name, mass, joint, role);
  }
  const std::vector<scene::CoordinateInfo> coordinates = scene.coordinates();
  size_t width = 2;
  for (const auto& c : coordinates) width = std::max(width, c.name.size());
  fmt::print(model.joints.empty() ? "Coordinates of joint {}:\n" : "Coordinates:\n", model.joint);
  for (size_t i = 0; i < coordinates.size(); ++i) {
    const scene::CoordinateInfo& c = coordinates[i];
    const std::string unit = c.unit();
    if (const auto* prescribed = std::get_if<scene::PrescribedCoordinate>(&model.coordinates[i])) {
      fmt::print("  {:<{}} prescribed, {}\n", c.name, width, describe(prescribed->motion, unit));
      continue;
    }
    const auto& free = std::get<scene::FreeCoordinate>(model.coordinates[i]);
    const std::string start = free.start              ? "starts at " + io::formatQuantity(*free.start, unit)
                              : c.shortName == "y" ? std::string("starts where the surfaces touch")
                                                      : "starts at 0 " + unit;
    const std::string damping = free.damping > 0 ? fmt::format(", damping {:g} {}", free.damping, c.isAngle ? "N m s/rad" : "N s/m") : "";
    const std::string limits = free.limits ? ", stops at " + io::formatQuantity(free.limits->lower, unit) + " and " +
                                                 io::formatQuantity(free.limits->upper, unit)
                                           : "";
    fmt::print("  {:<{}} free, {}{}{}\n", c.name, width, start, damping, limits);
  }
  const auto& g = model.gravity_mPerS2;
  if (g[0] != 0 || g[1] != 0 || g[2] != 0) fmt::print("Gravity: {:g}, {:g}, {:g} m/s^2 in the axes of the root link\n", g[0], g[1], g[2]);
  if (!scene.loads.empty() || !scene.generalizedLoads.empty()) fmt::print("Loads:\n");
  for (const auto& load : scene.loads) {
    const auto at = [&load](size_t axis) { return describe(load.point_m[axis], "mm"); };
    fmt::print("  {}: on {}, axes of {}, at ({}, {}, {}) in {}\n", load.name, load.body, load.frame, at(0), at(1), at(2),
               load.pointBody.empty() ? load.body : load.pointBody);
    const auto print = [](const scene::TimeFunction& value, const char* name, const char* unit) {
      const auto* constant = std::get_if<double>(&value);
      if (constant == nullptr || *constant != 0) fmt::print("    {}: {}\n", name, describe(value, unit));
    };
    constexpr std::array<const char*, 3> kForces = {"x", "y", "z"}, kMoments = {"moment x", "moment y", "moment z"};
    for (size_t axis = 0; axis < 3; ++axis) print(load.force_N[axis], kForces[axis], "N");
    for (size_t axis = 0; axis < 3; ++axis) print(load.moment_Nm[axis], kMoments[axis], "N m");
  }
  for (const auto& load : scene.generalizedLoads) {
    const scene::CoordinateInfo& c = coordinates[static_cast<size_t>(load.coordinate)];
    fmt::print("  {}: on coordinate {}, {}\n", load.name, c.name, describe(load.value, c.isAngle ? "N m" : "N"));
  }
  if (!scene.wraps.empty()) fmt::print("wraps:\n");
  for (const auto& wrap : scene.wraps) {
    const musculoskeletal::WrapSurface& surface = wrap.surface;
    fmt::print("  {}: {} of {}\n", wrap.name, describe(surface), wrap.body);
  }
  std::string keyword;
  for (const auto& element : scene.elements) {
    if (element->keyword != keyword) {
      keyword = element->keyword;
      fmt::print("{}:\n", keyword);
    }
    fmt::print("  {}: {}\n", element->name, element->describe());
  }
}

std::string describeExtent(const contact::CompartmentDefinition& c) {
  constexpr double kDegree = contact::kPi / 180;
  if (const auto* plane = std::get_if<contact::ElementPlane>(&c.elementSurface)) {
    return fmt::format("x {:g} to {:g} mm, z {:g} to {:g} mm{}", c.x0_m * 1e3, c.x1_m * 1e3, c.z0_m * 1e3, c.z1_m * 1e3,
                       plane->facing == contact::PlaneFacing::down ? ", facing down" : "");
  }
  const auto facing = [](contact::RoundFacing f) { return f == contact::RoundFacing::inward ? "inward" : "outward"; };
  if (const auto* cylinder = std::get_if<contact::ElementCylinder>(&c.elementSurface)) {
    return fmt::format("a cylinder facing {}, {:g} to {:g} deg, {:g} to {:g} mm along its axis", facing(cylinder->facing),
                       cylinder->angle0_rad / kDegree, cylinder->angle1_rad / kDegree, cylinder->axial0_m * 1e3, cylinder->axial1_m * 1e3);
  }
  const auto& sphere = std::get<contact::ElementSphere>(c.elementSurface);
  return fmt::format("a sphere facing {}, {:g} to {:g} deg, elevation {:g} to {:g} deg", facing(sphere.facing), sphere.angle0_rad / kDegree,
                     sphere.angle1_rad / kDegree, sphere.elevation0_rad / kDegree, sphere.elevation1_rad / kDegree);
}

void explainContact(const contact::ContactPair& pair, const scene::ContactSpec& spec) {
  const contact::ContactPairDefinition& d = pair.definition();
  fmt::print("\nContact {}: {} on {}\n", spec.name, spec.movingBody.empty() ? "moving body M" : spec.movingBody,
             spec.fixedBody.empty() ? "fixed body F" : spec.fixedBody);
  for (size_t c = 0; c < d.compartments.size(); ++c) {
    const auto& compartment = d.compartments[c];
    const auto& grid = pair.gridReports()[c];
    fmt::print("  {}: {} x {} cells over {}{}\n", compartment.name, compartment.nx, compartment.nz, describeExtent(compartment),
               d.gridOn == contact::GridOn::moving ? ", on the moving body" : "");
    fmt::print("    {} elements, {:.1f} mm^2", grid.elements, grid.surfaceArea_m2 * 1e6);
    if (grid.missedSurface > 0) fmt::print("; {} cells miss the surface", grid.missedSurface);
    if (grid.belowPlane > 0) fmt::print("; {} below the element plane", grid.belowPlane);
    if (grid.missedBack > 0) fmt::print("; {} miss the back surface", grid.missedBack);
    if (grid.clamped > 0) fmt::print("; {} with clamped thickness", grid.clamped);
    fmt::print("\n");
    const bool onFixed = d.gridOn == contact::GridOn::fixed;
    if (!isRigid(onFixed ? d.fixedThickness : d.movingThickness)) {
      fmt::print("    {} layer {:.3f} to {:.3f} mm, mean {:.3f} mm\n", onFixed ? "fixed" : "moving", grid.minThickness_m * 1e3,
                 grid.maxThickness_m * 1e3, grid.meanThickness_m * 1e3);
    }
  }
  fmt::print("  fixed layer:  {}\n  moving layer: {}\n", describe(d.fixedThickness), describe(d.movingThickness));
  for (const auto& map : pair.thicknessMapReports()) {
    fmt::print("  thickness map: {} samples, {} missed, {} clamped, {:.3f} to {:.3f} mm\n", map.samples, map.missed,
               map.clamped, map.min_m * 1e3, map.max_m * 1e3);
  }
  fmt::print("  material: {}\n", describe(d.material));
  if (d.movingMaterial) fmt::print("  material of the moving layer: {}, in series\n", describe(*d.movingMaterial));
  fmt::print("  strain: {}\n  distance: {}\n  correction: {}\n", d.strain == contact::StrainMeasure::small ? "small" : "large",
             d.distance == contact::DistanceMethod::ray ? "ray along the element's normal" : "minimum", describe(d.correction));
  fmt::print("  rule: {}\n", d.rule == contact::ContactRule::smooth ? "smooth (pressure integrated over the part of each cell that touches)"
                                                                      : "centre (whole cells, by their centre)");
  if (d.damping_sPerM > 0) fmt::print("  damping: {}, in dynamic analyses\n", io::formatQuantity(d.damping_sPerM, "s/m"));
  fmt::print("  tracking: {}\n", describe(d.tracking));
  if (d.copyTolerance >= 0)
    fmt::print("  a stored result is copied when no coordinate moved by more than {:g}\n", d.copyTolerance);
}

void explainAnalyses(const Scene& scene) {
  if (!scene.model) {
    fmt::print("\nAnalyses: `genu contact` only (no model)\n");
    return;
  }
  const scene::StaticSpec s = scene.staticAnalysis.value_or(scene::StaticSpec{});
  const char* method = s.method == scene::StaticSpec::Method::newton          ? "Newton, after it implicit Euler and Newton again where it does not converge"
                       : s.method == scene::StaticSpec::Method::implicitEuler ? "implicit Euler with damping"
                       : s.method == scene::StaticSpec::Method::kinsol        ? "KINSOL, after it implicit Euler and Newton where it does not converge"
                                                                              : "Newton and implicit Euler, compared";
  fmt::print("\nAnalyses:\n  static{}: {}, at t = {:g} s\n", scene.staticAnalysis ? "" : " (defaults)", method,
             s.time_s);
  if (s.search) {
    fmt::print("    search: {} starts, up to {} and {} away\n", s.search->starts, io::formatQuantity(s.search->translation_m, "mm"),
               io::formatQuantity(s.search->angle_rad, "deg"));
  }
  if (scene.gait) {
    const scene::GaitSpec& g = *scene.gait;
    const auto [kind, constraints] = model::chooseGaitMethod(scene);
    const std::string steps = kind->step == model::OdeIntegratorKind::Step::fixed || g.step_s > 0
                                  ? "fixed steps" + (g.step_s > 0 ? " of " + io::formatQuantity(g.step_s, "s") : std::string())
                                  : fmt::format("accuracy {:g}", g.accuracy);
    fmt::print("  gait: {:g} s, output every {:g} s, integrator {} ({}), {}{}{}\n", g.duration_s, g.outputInterval_s, kind->name, kind->library, steps,
               g.maxOrder > 0 ? fmt::format(", order {} at most", g.maxOrder) : "", g.settleFirst ? ", settled first" : "");
    const bool prescribed = std::any_of(scene.model->coordinates.begin(), scene.model->coordinates.end(),
                                        [](const auto& c) { return std::holds_alternative<scene::PrescribedCoordinate>(c); });
    if (prescribed) fmt::print("    prescribed coordinates: {}\n", constraints ? "unknowns with constraints" : "eliminated");
  }
  if (scene.series) fmt::print("  series: static equilibria over {:g} s, every {:g} s\n", scene.series->duration_s, scene.series->outputInterval_s);
}

void explainEvaluation() {
  fmt::print("\nEvaluation:\n  instruction set in use: {}\n  threads: {}\n", contact::activeInstructionSet(),
             hasThreads() ? "1; --threads N of contact, replay, static, series and gait uses more (smooth rule)" : "1; this build has no more");
  fmt::print("  error estimate: replay gives one with every load, contact with --error; none in static and gait\n");
}

bool hasOwnStates(const Built& built) {
  model::KneeSystem knee(built.scene, built.pairs);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  return std::any_of(knee.elements().begin(), knee.elements().end(), [&state](const auto& element) { return !element->states(state).empty(); });
}

/** Of solvers and integrators. */
void listMethodsLeftOut(const Built& built, bool prescribed, std::vector<std::string>& left) {
  const Scene& scene = built.scene;
  using Kind = model::OdeIntegratorKind;
  const scene::StaticSpec statics = scene.staticAnalysis.value_or(scene::StaticSpec{});
  using Method = scene::StaticSpec::Method;
  if (statics.method == Method::newton) left.emplace_back("implicit Euler in statics: only where Newton's method does not converge");
  if (statics.method == Method::implicitEuler) left.emplace_back("Newton's method in statics: the method is implicit-euler");
  if (statics.method != Method::both) left.emplace_back("comparison of two static methods: the method is not both");
  if (!statics.search) left.emplace_back("search for further equilibria: no static.search");
  if (!scene.series) left.emplace_back("series of equilibria: no series analysis");
  std::optional<model::GaitMethod> gait;
  if (scene.gait) gait = model::chooseGaitMethod(scene);
  const auto kinds = model::listOdeIntegrators();
  const auto isOfSundials = [](const Kind& kind) { return kind.library.find("SUNDIALS") != std::string::npos; };
  const bool integrates = gait && isOfSundials(*gait->kind), solves = statics.method == Method::kinsol;
  if (std::none_of(kinds.begin(), kinds.end(), isOfSundials)) {
    left.emplace_back("SUNDIALS with KINSOL: this build has none");
  } else {
    if (!integrates) {
      left.push_back("SUNDIALS' integrators: loaded, none called; " +
                     (gait ? "the integrator " + gait->kind->name + " is " + gait->kind->library + "'s" : std::string("no gait analysis")));
    } else {
      left.push_back("the rest of SUNDIALS' integrators: loaded, not called; only " + gait->kind->library + " is");
    }
    if (!solves) left.emplace_back("KINSOL: static.method is not kinsol");
  }
  if (!gait) {
    left.emplace_back("time integration, integrators, step control: no gait analysis");
    return;
  }
  if (!scene.gait->settleFirst) left.emplace_back("static analysis before the gait: settle_first is false");
  if (prescribed && !gait->constraints) {
    left.emplace_back("projection onto constraints: prescribed coordinates are eliminated");
    if (!hasOwnStates(built)) left.emplace_back("multipliers of constraints while integrating: prescribed coordinates are eliminated, no element has a state");
  }
  if (prescribed && gait->constraints) left.emplace_back("elimination of prescribed coordinates: they are unknowns with constraints");
  if (gait->constraints && gait->kind->library == "SUNDIALS IDA") left.emplace_back("projection onto the constraints: IDA solves them; outputs alone are projected");
  if (gait->kind->step == Kind::Step::fixed || scene.gait->step_s > 0) {
    left.emplace_back("error estimate of a step, step control: the step is fixed, halved only where it does not converge or is absurd");
  }
  const bool linear = std::all_of(scene.contacts.begin(), scene.contacts.end(), [](const auto& pair) { return pair.definition.rule == contact::ContactRule::smooth; });
  switch (gait->kind->equations) {
    case Kind::Equations::none:
      left.push_back("Jacobian, Newton's method in steps: " + gait->kind->name + " has neither");
      break;
    case Kind::Equations::differenced:
      left.push_back("Jacobian with the contact's stiffness: " + gait->kind->name + " takes differences");
      break;
    case Kind::Equations::exact:
      if (!linear) left.emplace_back("Jacobian with the contact's stiffness: the rule is centre; the integrator takes differences");
      break;
  }
  if (scene.contacts.empty()) left.emplace_back("limit of a step's motion, warning of impacts: no contact");
}

void explainLeftOut(const Built& built) {
  const Scene& scene = built.scene;
  std::vector<std::string> left;
  const auto all = [&](auto&& test) {
    return !scene.contacts.empty() && std::all_of(scene.contacts.begin(), scene.contacts.end(),
                                                  [&](const auto& pair) { return test(pair.definition); });
  };
  if (scene.contacts.empty()) left.emplace_back("contact: none given");
  using Definition = contact::ContactPairDefinition;
  if (all([](const Definition& d) { return !needsMap(d.gridOn == contact::GridOn::fixed ? d.movingThickness : d.fixedThickness); })) {
    left.emplace_back("thickness map of the body without elements: its layer comes from no back surface");
  }
  if (all([](const Definition& d) { return !hasBack(d.movingThickness) && !hasBack(d.fixedThickness); })) {
    left.emplace_back("back surfaces: no layer is measured to one");
  }
  for (const bool moving : {false, true}) {
    if (all([moving](const Definition& d) { return isRigid(moving ? d.movingThickness : d.fixedThickness); })) {
      left.emplace_back(fmt::format("thickness of the {} body: it is rigid", moving ? "moving" : "fixed"));
    }
  }
  if (all([](const Definition& d) { return isRigid(d.movingThickness) || isRigid(d.fixedThickness); })) {
    left.emplace_back("sum of two layers: one body is rigid");
  }
  if (all([](const Definition& d) { return !d.movingMaterial; })) left.emplace_back("layers in series: one material");
  if (all([](const Definition& d) { return d.material.law == contact::MaterialLaw::linear && !d.movingMaterial; })) {
    left.emplace_back("root finding for the pressure: the law is linear");
  } else if (all([](const Definition& d) { return d.rule == contact::ContactRule::smooth && !d.movingMaterial; })) {
    left.emplace_back("root finding for the pressure while running: the law is tabulated once");
  }
  if (all([](const Definition& d) {
        return d.rule == contact::ContactRule::centre || d.movingMaterial ||
               (d.material.law == contact::MaterialLaw::linear && d.strain == contact::StrainMeasure::small);
      })) {
    left.emplace_back("table of the pressure law: the law is linear, in series, or the rule is centre");
  }
  if (all([](const Definition& d) { return d.damping_sPerM == 0; })) left.emplace_back("damping of the contact: none given");
  if (all([](const Definition& d) { return d.correction != contact::Correction::energy; })) {
    left.emplace_back("gradient of the energy: no contact has correction: energy");
  }
  if (all([](const Definition& d) { return d.distance == contact::DistanceMethod::minimum; })) {
    left.emplace_back("ray firing: the distance is the minimum distance");
  }
  if (all([](const Definition& d) { return d.correction == contact::Correction::none; })) {
    left.emplace_back("midsurface correction: switched off");
  }
  if (all([](const Definition& d) {
        return d.tracking == contact::Tracking::lipschitz || d.tracking == contact::Tracking::all;
      })) {
    left.emplace_back("breadth-first search: the tracking method does not use it");
  }
  if (all([](const Definition& d) { return d.copyTolerance < 0; }))
    left.emplace_back("copying of stored results: switched off");
  if (all([](const Definition& d) { return d.rule == contact::ContactRule::centre; })) {
    left.emplace_back("integration over parts of cells, contact stiffness: the rule counts whole cells");
  }
  const auto isLinear = [](const contact::Material& m) { return m.law == contact::MaterialLaw::linear; };
  if (all([&](const Definition& d) { return isLinear(d.material) && (!d.movingMaterial || isLinear(*d.movingMaterial)); })) {
    left.emplace_back("power law: the law is linear");
  }
  if (all([](const Definition& d) { return d.strain == contact::StrainMeasure::small; })) left.emplace_back("logarithmic strain: the strain is small");
  if (all([](const Definition& d) { return d.gridOn == contact::GridOn::fixed; })) left.emplace_back("grid on the moving body: the fixed body carries it");
  if (all([](const Definition& d) {
        return std::all_of(d.compartments.begin(), d.compartments.end(), [](const auto& c) { return std::holds_alternative<contact::ElementPlane>(c.elementSurface); });
      })) {
    left.emplace_back("round element surfaces: every grid is over a plane");
  }
  if (std::none_of(scene.surfaces.begin(), scene.surfaces.end(), [](const auto& surface) { return surface.kind == "nurbs" && !surface.usedBy.empty(); })) {
    left.emplace_back("surface files: every surface in use is written in the scene");
  }
  if (!scene.contacts.empty()) left.emplace_back("estimates of the grid's error: static, gait and series give none; replay and contact --error do, at some four times the cost");
  if (scene.contacts.size() == 1) left.emplace_back("further contacts (a patella's, for example): one is given");
  left.emplace_back("contact energy and fields of single elements: computed for outputs only, not while integrating");
  if (all([](const Definition& d) { return d.rule == contact::ContactRule::smooth; })) {
    left.emplace_back(scene.model ? "contact stiffness: computed for Newton's method and Jacobians only, not with forces"
                                  : "contact stiffness: nothing here seeks equilibrium or integrates");
  }
  left.emplace_back(hasThreads() ? "threads: the caller's alone, unless --threads asks for more" : "threads: this build has none but the caller's");
  if (!scene.model) {
    left.emplace_back("bodies, joint, loads and time integration: the scene has no model");
  } else {
    const auto& m = *scene.model;
    if (std::all_of(m.gravity_mPerS2.begin(), m.gravity_mPerS2.end(), [](double g) { return g == 0; })) {
      left.emplace_back("gravity: zero");
    }
    bool damped = false, prescribed = false, limited = false;
    for (const auto& coordinate : m.coordinates) {
      const auto* free = std::get_if<scene::FreeCoordinate>(&coordinate);
      damped = damped || (free != nullptr && free->damping > 0);
      limited = limited || (free != nullptr && free->limits);
      prescribed = prescribed || free == nullptr;
    }
    if (!damped) left.emplace_back("damping of the coordinates: none given");
    if (!limited) left.emplace_back("stops of the coordinates: no limits given");
    if (!prescribed) left.emplace_back("constraints: no coordinate is prescribed");
    if (scene.loads.empty()) left.emplace_back("loads at points: none given");
    if (scene.generalizedLoads.empty()) left.emplace_back("loads on coordinates: none given");
    for (const std::string& keyword : scene::listElementKeywords()) {
      if (std::none_of(scene.elements.begin(), scene.elements.end(), [&](const auto& e) { return e->keyword == keyword; })) {
        left.push_back(keyword + ": none given; no force, no state and no cache entry of them exists");
      }
    }
    if (scene.wraps.empty()) left.emplace_back("wrapping: no path has a wrap");
    listMethodsLeftOut(built, prescribed, left);
  }
  if (!scene.output.maps) left.emplace_back("pressure maps: switched off");
  if (!scene.output.plots) left.emplace_back("plots: switched off");
  for (const auto& name : scene.unused) left.push_back(name + ": defined, used by nothing");
  fmt::print("\nLeft out, because nothing here needs it:\n");
  for (const auto& line : left) fmt::print("  {}\n", line);
}

}  // namespace

int runCheckCommand(const fs::path& file, const CommonOptions& common) {
  installInterruptHandler(true);
  ProgressMeter meter("check", common.console);
  const Built built = build(file, common);
  const Scene& scene = built.scene;
  if (scene.model) {
    model::checkAnalyses(model::KneeSystem(scene, built.pairs), scene);
  }
  meter.finish();
  size_t row = 0;
  const auto names = report::listCompartmentNames(scene);
  for (const auto& pair : built.pairs) {
    for (const auto& grid : pair->gridReports()) {
      const std::string& name = names[row++];
      const int lost = grid.missedSurface + grid.belowPlane + grid.downwardOnly + grid.missedBack;
      if (grid.downwardOnly > 0) {
        spdlog::warn("{}: {} of {} cells meet the surface only from behind", name, grid.downwardOnly, grid.cells);
      }
      if (2 * lost > grid.cells) {
        spdlog::warn("{}: only {} of {} cells became elements ({} miss the surface, {} miss the back surface)", name,
                     grid.elements, grid.cells, grid.missedSurface, grid.missedBack);
      }
    }
  }
  for (const auto& name : scene.unused) spdlog::warn("{}: defined, used by nothing", scene.where(name));
  std::string analyses = "contact";
  if (scene.contacts.empty()) analyses = "";
  if (scene.model) analyses += std::string(analyses.empty() ? "" : ", ") + (scene.gait ? "static, gait" : "static");
  if (scene.series) analyses += ", series";
  warnAbout(scene);
  fmt::print("{}: no errors; ready for: {}\n", file.string(), analyses);
  return kOk;
}

int runExplainCommand(const fs::path& file, const CommonOptions& common) {
  installInterruptHandler(true);
  ProgressMeter meter("explain", common.console);
  const Built built = build(file, common);
  meter.finish();
  fmt::print("Scene: {} ({})\n", built.scene.name, file.string());
  explainModel(built.scene);
  if (!built.scene.surfaces.empty()) fmt::print("\nSurfaces:\n");
  for (const auto& surface : built.scene.surfaces) {
    if (surface.usedBy.empty()) continue;
    fmt::print("  {}: {}, {} patch{}, {} control points; {}\n", surface.name, surface.kind, surface.patches,
               surface.patches == 1 ? "" : "es", surface.controlPoints, io::joinNames(surface.usedBy));
  }
  for (size_t p = 0; p < built.pairs.size(); ++p) explainContact(*built.pairs[p], built.scene.contacts[p]);
  explainAnalyses(built.scene);
  explainEvaluation();
  explainLeftOut(built);
  warnAbout(built.scene);
  return kOk;
}

}  // namespace genu::app
