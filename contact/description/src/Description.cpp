#include <cmath>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "genu/contact/genu_contact_description.h"

namespace {

using Json = nlohmann::json;
using Keys = std::vector<const char*>;

/** What the C interface refused: the text is already in genu_last_error(). */
struct Refused {
  genu_status status;
  std::string where;
};

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw std::invalid_argument((where.empty() ? "description" : where) + ": " + what);
}

std::string join(const Keys& words) {
  std::string out;
  for (const char* word : words) out += (out.empty() ? "" : ", ") + std::string(word);
  return out;
}

/** A value as a message shows it: cut where it is long. */
std::string show(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

[[noreturn]] void refuse(const Json& value, const std::string& where, const std::string& allowed) {
  fail(where, show(value) + " is not allowed; allowed: " + allowed);
}

std::string at(const std::string& where, const std::string& key) { return where.empty() ? key : where + "." + key; }
std::string at(const std::string& where, size_t index) { return where + "[" + std::to_string(index) + "]"; }

void requireObject(const Json& value, const std::string& where, const Keys& allowed) {
  if (!value.is_object()) refuse(value, where, "an object with the keys " + join(allowed));
  for (const auto& item : value.items()) {
    bool known = false;
    for (const char* key : allowed) known = known || item.key() == key;
    if (!known) fail(at(where, item.key()), "unknown key; allowed: " + join(allowed));
  }
}

const Json& get(const Json& object, const std::string& where, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) fail(at(where, key), "missing");
  return *found;
}

double toNumber(const Json& value, const std::string& where) {
  if (!value.is_number()) refuse(value, where, "a number");
  const double number = value.get<double>();
  if (!std::isfinite(number)) refuse(value, where, "a finite number");
  return number;
}

/** A radius: "infinity" is a trough or a plane. */
double toRadius(const Json& value, const std::string& where) {
  if (value == "infinity") return std::numeric_limits<double>::infinity();
  if (!value.is_number()) refuse(value, where, "a number or \"infinity\"");
  return toNumber(value, where);
}

int toInteger(const Json& value, const std::string& where, int low, int high) {
  if (!value.is_number_integer() || value.get<double>() < low || value.get<double>() > high) {
    refuse(value, where, "a whole number, " + std::to_string(low) + " to " + std::to_string(high));
  }
  return value.get<int>();
}

bool toBool(const Json& value, const std::string& where) {
  if (!value.is_boolean()) refuse(value, where, "true, false");
  return value.get<bool>();
}

std::string toText(const Json& value, const std::string& where) {
  if (!value.is_string()) refuse(value, where, "a text");
  return value.get<std::string>();
}

const Json& toList(const Json& value, const std::string& where, size_t size, const char* what) {
  if (!value.is_array() || (size != 0 && value.size() != size) || value.empty()) refuse(value, where, what);
  return value;
}

/** The position of a word among the allowed ones, which are in the order of the C enumeration. */
int toChoice(const Json& value, const std::string& where, const Keys& words) {
  for (size_t k = 0; k < words.size(); ++k) {
    if (value == words[k]) return static_cast<int>(k);
  }
  refuse(value, where, join(words));
}

double numberOr(const Json& object, const std::string& where, const char* key, double fallback) {
  const auto found = object.find(key);
  return found == object.end() ? fallback : toNumber(*found, at(where, key));
}
int choiceOr(const Json& object, const std::string& where, const char* key, const Keys& words) {
  const auto found = object.find(key);
  return found == object.end() ? 0 : toChoice(*found, at(where, key), words);
}

std::vector<double> toNumbers(const Json& value, const std::string& where) {
  toList(value, where, 0, "a list of numbers");
  std::vector<double> out;
  for (size_t k = 0; k < value.size(); ++k) out.push_back(toNumber(value[k], at(where, k)));
  return out;
}

void check(genu_status status, const std::string& where) {
  if (status != GENU_OK) throw Refused{status, where};
}

struct DestroySurface {
  void operator()(genu_surface* surface) const { genu_surface_destroy(surface); }
};
using Surface = std::unique_ptr<genu_surface, DestroySurface>;

/** Numbers of one patch; `c` points into the vectors. */
struct Patch {
  std::vector<double> knotsU, knotsV, points, weights;
  genu_nurbs_patch c = {};
};

/** Rows of u, each with one entry per v: their numbers go to `out`. */
template <class Append>
std::pair<int, int> readGrid(const Json& rows, const std::string& where, const char* what, Append append) {
  toList(rows, where, 0, what);
  const size_t columns = toList(rows[0], at(where, 0), 0, what).size();
  for (size_t i = 0; i < rows.size(); ++i) {
    toList(rows[i], at(where, i), 0, what);
    if (rows[i].size() != columns) {
      fail(at(where, i), "has " + std::to_string(rows[i].size()) + " entries; allowed: " + std::to_string(columns) +
                             ", as in the first row");
    }
    for (size_t j = 0; j < columns; ++j) append(rows[i][j], at(at(where, i), j));
  }
  return {static_cast<int>(rows.size()), static_cast<int>(columns)};
}

void readPatch(const Json& json, const std::string& where, Patch& patch) {
  requireObject(json, where, {"degree", "knots_u", "knots_v", "points", "weights", "flip_normal"});
  const Json& degree = toList(get(json, where, "degree"), at(where, "degree"), 2, "[degree u, degree v]");
  patch.c.degree_u = toInteger(degree[0], at(at(where, "degree"), 0), 1, 5);
  patch.c.degree_v = toInteger(degree[1], at(at(where, "degree"), 1), 1, 5);
  patch.knotsU = toNumbers(get(json, where, "knots_u"), at(where, "knots_u"));
  patch.knotsV = toNumbers(get(json, where, "knots_v"), at(where, "knots_v"));
  const std::string pointsAt = at(where, "points");
  const auto [numU, numV] = readGrid(
      get(json, where, "points"), pointsAt, "rows of points [x, y, z]", [&](const Json& point, const std::string& here) {
        toList(point, here, 3, "a point [x, y, z]");
        for (size_t k = 0; k < 3; ++k) patch.points.push_back(toNumber(point[k], at(here, k)));
      });
  if (json.contains("weights")) {
    const auto size =
        readGrid(json["weights"], at(where, "weights"), "rows of numbers",
                 [&](const Json& w, const std::string& here) { patch.weights.push_back(toNumber(w, here)); });
    if (size != std::make_pair(numU, numV)) fail(at(where, "weights"), "must have as many rows and entries as points");
  }
  patch.c.num_u = numU;
  patch.c.num_v = numV;
  patch.c.num_knots_u = static_cast<int>(patch.knotsU.size());
  patch.c.num_knots_v = static_cast<int>(patch.knotsV.size());
  patch.c.flip_normal = json.contains("flip_normal") && toBool(json["flip_normal"], at(where, "flip_normal"));
  patch.c.knots_u = patch.knotsU.data();
  patch.c.knots_v = patch.knotsV.data();
  patch.c.points = patch.points.data();
  patch.c.weights = patch.weights.empty() ? nullptr : patch.weights.data();
}

genu_solid readSolid(const Json& json, const std::string& where) {
  return static_cast<genu_solid>(toChoice(get(json, where, "solid"), at(where, "solid"), {"below", "above", "inside"}));
}

Surface makeSurface(const Json& json, const std::string& where) {
  const Keys kinds = {"nurbs", "plane", "dish", "paraboloid", "sphere", "cylinder", "ellipsoid", "torus"};
  Keys allowed = kinds;
  allowed.push_back("placement");
  allowed.push_back("flip");
  requireObject(json, where, allowed);
  std::string kind;
  for (const char* candidate : kinds) {
    if (!json.contains(candidate)) continue;
    if (!kind.empty()) fail(where, "has two kinds, " + kind + " and " + candidate + "; allowed: one of " + join(kinds));
    kind = candidate;
  }
  if (kind.empty()) fail(where, "has no kind; allowed: one of " + join(kinds));
  const Json& j = json[kind];
  const std::string here = at(where, kind);
  const auto number = [&](const char* key) { return toNumber(get(j, here, key), at(here, key)); };
  const auto radius = [&](const char* key) { return toRadius(get(j, here, key), at(here, key)); };
  genu_surface* made = nullptr;
  if (kind == "nurbs") {
    toList(j, here, 0, "a list of patches");
    std::vector<Patch> patches(j.size());
    std::vector<genu_nurbs_patch> plain;
    for (size_t k = 0; k < j.size(); ++k) {
      readPatch(j[k], at(here, k), patches[k]);
      plain.push_back(patches[k].c);
    }
    check(genu_surface_create_nurbs(plain.data(), static_cast<int>(plain.size()), &made), here);
  } else if (kind == "plane") {
    requireObject(j, here, {"y0", "slope_x", "slope_z", "solid", "half_extent"});
    check(genu_surface_create_plane(number("y0"), numberOr(j, here, "slope_x", 0), numberOr(j, here, "slope_z", 0),
                                    readSolid(j, here), number("half_extent"), &made), here);
  } else if (kind == "dish") {
    requireObject(j, here, {"y0", "radius_sagittal", "radius_frontal", "solid", "half_extent"});
    check(genu_surface_create_dish(number("y0"), radius("radius_sagittal"), radius("radius_frontal"), readSolid(j, here),
                                   number("half_extent"), &made), here);
  } else if (kind == "paraboloid") {
    requireObject(j, here, {"y0", "radius_x", "radius_z", "solid", "half_extent"});
    check(genu_surface_create_paraboloid(number("y0"), radius("radius_x"), radius("radius_z"), readSolid(j, here),
                                         number("half_extent"), &made), here);
  } else if (kind == "sphere") {
    requireObject(j, here, {"radius"});
    check(genu_surface_create_sphere(number("radius"), &made), here);
  } else if (kind == "cylinder") {
    requireObject(j, here, {"radius", "length"});
    check(genu_surface_create_cylinder(number("radius"), number("length"), &made), here);
  } else if (kind == "ellipsoid") {
    requireObject(j, here, {"a", "b", "c"});
    check(genu_surface_create_ellipsoid(number("a"), number("b"), number("c"), &made), here);
  } else {
    requireObject(j, here, {"radius_sagittal", "radius_frontal"});
    check(genu_surface_create_torus(number("radius_sagittal"), number("radius_frontal"), &made), here);
  }
  Surface surface(made);
  if (json.contains("flip") && toBool(json["flip"], at(where, "flip"))) {
    genu_surface* flipped = nullptr;
    check(genu_surface_create_flipped(surface.get(), &flipped), at(where, "flip"));
    surface.reset(flipped);
  }
  if (json.contains("placement")) {
    const std::string placementAt = at(where, "placement");
    const std::vector<double> q = toNumbers(
        toList(json["placement"], placementAt, 6, "[rx, ry, rz, x, y, z] in rad and m"), placementAt);
    genu_surface* placed = nullptr;
    check(genu_surface_create_placed(surface.get(), q.data(), &placed), placementAt);
    surface.reset(placed);
  }
  return surface;
}

/** The surfaces of a description, by name. */
class Surfaces {
 public:
  explicit Surfaces(const Json& json) {
    if (!json.is_object() || json.empty()) refuse(json, "surfaces", "an object of named surfaces");
    for (const auto& item : json.items()) made_[item.key()] = makeSurface(item.value(), at("surfaces", item.key()));
  }
  const genu_surface* find(const Json& name, const std::string& where) const {
    const auto found = name.is_string() ? made_.find(name.get<std::string>()) : made_.end();
    if (found == made_.end()) {
      Keys names;
      for (const auto& item : made_) names.push_back(item.first.c_str());
      refuse(name, where, join(names));
    }
    return found->second.get();
  }

 private:
  std::map<std::string, Surface> made_;
};

void readVector(const Json& json, const std::string& where, double out[3]) {
  const std::vector<double> v = toNumbers(toList(json, where, 3, "three numbers"), where);
  for (size_t k = 0; k < 3; ++k) out[k] = v[k];
}
/** A direction: zeros mean the default in the C interface, so they are refused here. */
void readDirection(const Json& json, const std::string& where, double out[3]) {
  readVector(json, where, out);
  if (out[0] == 0 && out[1] == 0 && out[2] == 0) refuse(json, where, "three numbers, not all 0");
}
void readRange(const Json& json, const std::string& where, double& low, double& high, const char* unit) {
  const Json& ends = toList(json, where, 2, ("[from, to] in " + std::string(unit)).c_str());
  low = toNumber(ends[0], at(where, 0));
  high = toNumber(ends[1], at(where, 1));
  if (!(low < high)) refuse(ends, where, "[from, to] with from < to");
}

/** The element surface of a compartment; true where it is round, so that the compartment needs no x and z. */
bool readElementSurface(const Json& c, const std::string& where, bool onMoving, genu_element_surface& out) {
  out = {};
  const bool cylinder = c.contains("cylinder"), sphere = c.contains("sphere");
  if (cylinder && sphere) fail(where, "has two element surfaces, cylinder and sphere; allowed: one");
  if (!cylinder && !sphere) {
    const bool down = c.contains("facing") ? toChoice(c["facing"], at(where, "facing"), {"up", "down"}) == 1 : onMoving;
    out.kind = down ? GENU_ELEMENTS_PLANE_DOWN : GENU_ELEMENTS_PLANE_UP;
    return false;
  }
  for (const char* key : {"x", "z", "facing"}) {
    if (c.contains(key)) fail(at(where, key), std::string("belongs to a plane; the element surface is a ") + (cylinder ? "cylinder" : "sphere"));
  }
  const std::string here = at(where, cylinder ? "cylinder" : "sphere");
  const Json& j = c[cylinder ? "cylinder" : "sphere"];
  requireObject(j, here, {"center", "axis", "zero", "facing", "angle", cylinder ? "axial" : "elevation", "limit_radius"});
  const bool inward = toChoice(get(j, here, "facing"), at(here, "facing"), {"outward", "inward"}) == 1;
  out.kind = cylinder ? (inward ? GENU_ELEMENTS_CYLINDER_INWARD : GENU_ELEMENTS_CYLINDER_OUTWARD)
                      : (inward ? GENU_ELEMENTS_SPHERE_INWARD : GENU_ELEMENTS_SPHERE_OUTWARD);
  if (j.contains("center")) readVector(j["center"], at(here, "center"), out.center);
  if (j.contains("axis")) readDirection(j["axis"], at(here, "axis"), out.axis);
  if (j.contains("zero")) readDirection(j["zero"], at(here, "zero"), out.zero);
  readRange(get(j, here, "angle"), at(here, "angle"), out.angle[0], out.angle[1], "rad");
  if (cylinder) {
    readRange(get(j, here, "axial"), at(here, "axial"), out.axial[0], out.axial[1], "m");
  } else {
    readRange(get(j, here, "elevation"), at(here, "elevation"), out.elevation[0], out.elevation[1], "rad");
  }
  if (j.contains("limit_radius")) {
    out.limit_radius = toNumber(j["limit_radius"], at(here, "limit_radius"));
    if (!(out.limit_radius > 0)) refuse(j["limit_radius"], at(here, "limit_radius"), "> 0 [m]");
  }
  return true;
}

genu_thickness readThickness(const Json& description, const char* key, const Surfaces& surfaces, genu_round_back& round) {
  genu_thickness out = {};
  round = {};
  if (!description.contains(key)) return out;
  const Json& j = description[key];
  const std::string where = key;
  const Keys kinds = {"constant", "above_plane", "back_closest", "back_normal", "radial"};
  Keys allowed = kinds;
  for (const char* more : {"min", "max", "missing", "map_samples"}) allowed.push_back(more);
  requireObject(j, where, allowed);
  int count = 0;
  for (size_t k = 0; k < kinds.size(); ++k) {
    if (!j.contains(kinds[k])) continue;
    ++count;
    out.kind = static_cast<genu_thickness_kind>(k + 1);
    if (k < 2) {
      out.value = toNumber(j[kinds[k]], at(where, kinds[k]));
    } else if (k == 4) {
      const Json& back = j[kinds[k]];
      const std::string here = at(where, kinds[k]);
      requireObject(back, here, {"radius", "center", "axis"});
      out.value = toNumber(get(back, here, "radius"), at(here, "radius"));
      if (back.contains("center")) readVector(back["center"], at(here, "center"), round.center);
      if (back.contains("axis")) readDirection(back["axis"], at(here, "axis"), round.axis);
    } else {
      out.back = surfaces.find(j[kinds[k]], at(where, kinds[k]));
    }
  }
  if (count != 1) fail(where, "has " + std::to_string(count) + " kinds; allowed: one of " + join(kinds));
  for (const auto& [name, target] : {std::make_pair("min", &out.min), {"max", &out.max}, {"missing", &out.missing}}) {
    if (!j.contains(name)) continue;
    *target = toNumber(j[name], at(where, name));
    if (!(*target > 0)) refuse(j[name], at(where, name), "> 0 [m]");
  }
  if (j.contains("map_samples")) {
    const std::string here = at(where, "map_samples");
    const Json& samples = toList(j["map_samples"], here, 2, "[samples along u, along v]");
    out.map_samples_u = toInteger(samples[0], at(here, 0), 2, 4096);
    out.map_samples_v = toInteger(samples[1], at(here, 1), 2, 4096);
  }
  return out;
}

genu_material readMaterial(const Json& j, const std::string& where) {
  const Keys laws = {"linear", "power_law", "power_law_consistent"};
  if (!j.is_object()) refuse(j, where, "an object with the key law");
  genu_material out = {};
  out.law = static_cast<genu_law>(choiceOr(j, where, "law", laws));
  const auto number = [&](const char* key) { return toNumber(get(j, where, key), at(where, key)); };
  if (out.law == GENU_LINEAR) {
    requireObject(j, where, {"law", "youngs_modulus", "poisson_ratio"});
    out.youngs_modulus = number("youngs_modulus");
  } else {
    requireObject(j, where, {"law", "poisson_ratio", "eps0", "p0", "n"});
    out.eps0 = number("eps0");
    out.p0 = number("p0");
    out.n = number("n");
  }
  out.poisson_ratio = number("poisson_ratio");
  return out;
}

genu_status createFromJson(const char* text, genu_pair** out) {
  if (!text || !out) throw std::invalid_argument("description: text and out must not be NULL");
  Json j;
  try {
    j = Json::parse(text);
  } catch (const Json::exception& e) {  // syntax, or a number beyond what a double holds
    throw std::invalid_argument(std::string("description: not JSON: ") + e.what());
  }
  requireObject(j, "", {"genu_contact", "surfaces", "compartments", "element_plane_y", "fixed_thickness",
                        "moving_thickness", "material", "moving_material", "strain", "distance", "correction", "rule",
                        "tracking", "copy_tolerance", "grid_on", "damping"});
  toInteger(get(j, "", "genu_contact"), "genu_contact", 1, 1);  // version of the format
  const Surfaces surfaces(get(j, "", "surfaces"));

  const Json& list = toList(get(j, "", "compartments"), "compartments", 0, "a list of at least one compartment");
  std::deque<std::string> names;  // keeps their addresses
  std::vector<genu_compartment> compartments;
  std::vector<genu_element_surface> elements(list.size());
  const auto gridOn = static_cast<genu_grid_on>(choiceOr(j, "", "grid_on", {"fixed", "moving"}));
  for (size_t k = 0; k < list.size(); ++k) {
    const Json& c = list[k];
    const std::string where = at("compartments", k);
    requireObject(c, where, {"name", "x", "z", "facing", "cylinder", "sphere", "grid", "fixed", "moving"});
    genu_compartment made = {};
    if (c.contains("name")) made.name = names.emplace_back(toText(c["name"], at(where, "name"))).c_str();
    if (!readElementSurface(c, where, gridOn == GENU_GRID_ON_MOVING, elements[k])) {
      readRange(get(c, where, "x"), at(where, "x"), made.x0, made.x1, "m");
      readRange(get(c, where, "z"), at(where, "z"), made.z0, made.z1, "m");
    }
    const std::string gridAt = at(where, "grid");
    const Json& grid = toList(get(c, where, "grid"), gridAt, 2, "[elements along x, along z]");
    made.nx = toInteger(grid[0], at(gridAt, 0), 1, 4000);
    made.nz = toInteger(grid[1], at(gridAt, 1), 1, 4000);
    made.fixed = surfaces.find(get(c, where, "fixed"), at(where, "fixed"));
    made.moving = surfaces.find(get(c, where, "moving"), at(where, "moving"));
    compartments.push_back(made);
  }

  genu_round_back fixedBack, movingBack;
  genu_pair_options options;
  genu_pair_options_init(&options, sizeof options);
  options.compartments = compartments.data();
  options.num_compartments = static_cast<int>(compartments.size());
  options.use_element_plane = j.contains("element_plane_y");
  options.element_plane_y = numberOr(j, "", "element_plane_y", 0);
  options.fixed_thickness = readThickness(j, "fixed_thickness", surfaces, fixedBack);
  options.moving_thickness = readThickness(j, "moving_thickness", surfaces, movingBack);
  options.fixed_round_back = &fixedBack;
  options.moving_round_back = &movingBack;
  options.grid_on = gridOn;
  options.element_surfaces = elements.data();
  options.material = readMaterial(get(j, "", "material"), "material");
  genu_material second;
  if (j.contains("moving_material")) {
    second = readMaterial(j["moving_material"], "moving_material");
    options.moving_material = &second;
  }
  options.strain = static_cast<genu_strain>(choiceOr(j, "", "strain", {"small", "large"}));
  options.distance = static_cast<genu_distance>(choiceOr(j, "", "distance", {"minimum", "ray"}));
  options.correction = static_cast<genu_correction>(choiceOr(j, "", "correction", {"midsurface", "none", "energy"}));
  options.rule = static_cast<genu_rule>(choiceOr(j, "", "rule", {"smooth", "centre"}));
  options.tracking = static_cast<genu_tracking>(
      choiceOr(j, "", "tracking", {"lipschitz", "all", "breadth_first", "breadth_first_unguarded"}));
  options.copy_tolerance = numberOr(j, "", "copy_tolerance", 0);
  options.damping = numberOr(j, "", "damping", 0);
  check(genu_pair_create(&options, out), "");
  return GENU_OK;
}

}  // namespace

extern "C" genu_status genu_pair_create_from_json(const char* text, genu_pair** out) {
  try {
    const genu_status status = createFromJson(text, out);
    return genu_set_last_error(status, nullptr);
  } catch (const Refused& refused) {
    try {
      const std::string reason = (refused.where.empty() ? "" : refused.where + ": ") + std::string(genu_last_error());
      return genu_set_last_error(refused.status, reason.c_str());
    } catch (...) {
      return refused.status;  // without memory for the place, the reason alone stays
    }
  } catch (const std::bad_alloc&) {
    return genu_set_last_error(GENU_OUT_OF_MEMORY, "out of memory");
  } catch (const std::invalid_argument& e) {
    return genu_set_last_error(GENU_BAD_ARGUMENT, e.what());
  } catch (const std::exception& e) {
    return genu_set_last_error(GENU_INTERNAL_ERROR, e.what());
  } catch (...) {
    return genu_set_last_error(GENU_INTERNAL_ERROR, "unknown exception");
  }
}
