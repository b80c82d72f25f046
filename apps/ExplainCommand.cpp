#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

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
  const char* method = s.method == scene::StaticSpec::Method::newton          ? "Newton"
                       : s.method == scene::StaticSpec::Method::implicitEuler ? "implicit Euler with damping"
                       : s.method == scene::StaticSpec::Method::kinsol        ? "KINSOL"
                                                                              : "Newton and implicit Euler, compared";
  fmt::print("\nAnalyses:\n  static{}: {}, at t = {:g} s\n", scene.staticAnalysis ? "" : " (defaults)", method,
             s.time_s);
  if (scene.gait) {
    fmt::print("  gait: {:g} s, output every {:g} s, integrator {}, accuracy {:g}{}\n", scene.gait->duration_s,
               scene.gait->outputInterval_s, model::chooseIntegrator(scene.gait->integrator), scene.gait->accuracy,
               scene.gait->settleFirst ? ", settled first" : "");
  }
  if (scene.series) fmt::print("  series: static equilibria over {:g} s, every {:g} s\n", scene.series->duration_s, scene.series->outputInterval_s);
}

void explainEvaluation() {
  fmt::print("\nEvaluation:\n  instruction set in use: {}\n  threads: {}\n", contact::activeInstructionSet(),
             hasThreads() ? "1; --threads N of contact, replay, static, series and gait uses more (smooth rule)" : "1; this build has no more");
  fmt::print("  error estimate: replay gives one with every load, contact with --error; none in static and gait\n");
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
    bool damped = false, prescribed = false;
    for (const auto& coordinate : m.coordinates) {
      const auto* free = std::get_if<scene::FreeCoordinate>(&coordinate);
      damped = damped || (free != nullptr && free->damping > 0);
      prescribed = prescribed || free == nullptr;
    }
    if (!damped) left.emplace_back("damping of the coordinates: none given");
    if (!prescribed) left.emplace_back("constraints: no coordinate is prescribed");
    if (scene.loads.empty()) left.emplace_back("loads at points: none given");
    if (scene.generalizedLoads.empty()) left.emplace_back("loads on coordinates: none given");
    for (const std::string& keyword : scene::listElementKeywords()) {
      if (std::none_of(scene.elements.begin(), scene.elements.end(), [&](const auto& e) { return e->keyword == keyword; })) {
        left.push_back(keyword + ": none given; no force, no state and no cache entry of them exists");
      }
    }
    if (scene.wraps.empty()) left.emplace_back("wrapping: no path has a wrap");
    if (!scene.gait) left.emplace_back("time integration: no gait analysis");
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
    const model::KneeSystem knee(scene, built.pairs);
    const double staticTime = scene.staticAnalysis ? scene.staticAnalysis->time_s : 0;
    if (scene.staticAnalysis) knee.checkTablesCover(staticTime, staticTime);
    if (scene.series) knee.checkTablesCover(0, scene.series->duration_s);
    if (scene.gait) {
      knee.checkTablesCover(0, scene.gait->duration_s);
      const std::string where = scene.where("analysis.gait.integrator");
      model::checkOdeSettings(model::findOdeIntegrator(model::chooseIntegrator(scene.gait->integrator), where), {scene.gait->maxOrder, scene.gait->step_s}, where);
    }
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
