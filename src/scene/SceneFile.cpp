#include "genu/scene/SceneFile.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>
#include <stdexcept>
#include <tuple>

#include "SceneKeys.h"
#include "genu/scene/SceneNode.h"
#include "genu/contact/AnalyticSurface.h"
#include "genu/io/Files.h"
#include "genu/io/NurbsFile.h"
#include "genu/io/Suggest.h"
#include "genu/io/Table.h"
#include "genu/io/Units.h"

namespace genu::scene {

namespace {

namespace fs = std::filesystem;
using contact::ContactSurface;
using io::Dimension;

using SurfacePtr = std::shared_ptr<const ContactSurface>;

enum class Role { fixed, moving };

const std::vector<std::string> kSurfaceKinds = {"nurbs",  "plane",    "dish",      "paraboloid",
                                                "sphere", "cylinder", "ellipsoid", "torus"};
const std::vector<std::string> kCoordinates(kCoordinateNames.begin(), kCoordinateNames.end());
constexpr const char* kPoseText =
    "six values \"rx, ry, rz, x, y, z\" with units (\"0 deg, 0 deg, 0 deg, 0 mm, 0 mm, 0 mm\")";

/** Analytic height fields without an `extent` reach this many times as far as the scene does, and at least
 kSmallestHalfExtent_m: a surface that ends inside the scene would lose contact. */
constexpr double kExtentFactor = 4, kSmallestHalfExtent_m = 0.1;
constexpr double kMaxOutputs = 1e6;
/** Sizes beyond which a NURBS surface is no joint but a mistaken unit. */
constexpr double kSmallestSurface_m = 0.5e-3, kLargestSurface_m = 5;

Dimension dimensionOf(int coordinate) { return coordinate < 3 ? Dimension::angle : Dimension::length; }

bool isHeightField(const std::string& kind) { return kind == "plane" || kind == "dish" || kind == "paraboloid"; }

/** Names become file columns and JSON keys. */
void checkName(const SceneNode& node, const std::string& name) {
  const bool fine = std::all_of(name.begin(), name.end(),
                                [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
  if (!fine || name.size() > 60) {
    node.fail("the name \"" + name.substr(0, 60) +
              "\" is not allowed; use letters, digits, _ and -, at most 60 of them");
  }
}

std::pair<int, int> parseGridNode(const SceneNode& node) {
  if (node.isSequence()) {
    const auto counts = node.getList(2, "[nx, nz]");
    return {counts[0].getInteger(1, kMaxGridCells), counts[1].getInteger(1, kMaxGridCells)};
  }
  return parseGrid(node.getText("a grid like 30x30"), node.where());
}

contact::JointCoordinates parsePoseNode(const SceneNode& node) {
  const auto values = node.getList(6, kPoseText);
  contact::JointCoordinates q{};
  for (int i = 0; i < 6; ++i) q[static_cast<size_t>(i)] = values[static_cast<size_t>(i)].getQuantity(dimensionOf(i));
  return q;
}

/** The times at which tables are read. */
struct TimeSpan {
  double begin_s = 0, end_s = 0;
  std::string key = "analysis";  ///< the key to shorten, for messages
};

class SceneReader : private ElementContext {
 public:
  SceneReader(const std::string& yaml, const fs::path& file, const ReadOptions& options)
      : yaml_(yaml), options_(options), folder_(file.parent_path()) {
    scene_.file = file;
    document_.file = file.string();
  }

  Scene read() {
    const SceneNode root = SceneNode::parse(yaml_, document_);
    if (!root.isMap()) root.fail("the scene must be a mapping of keys; its first line must be \"genu: 1\"");
    scene_.inputHashes[scene_.file.filename().string()] = io::calcSha256(yaml_);
    // The version first: a file of another version would only raise errors about keys.
    root.get("genu", "\"genu: 1\" (the version of the scene format)").getInteger(1, 1);
    std::vector<std::string> allowed = listOwnSceneKeys();
    for (const std::string& keyword : listElementKeywords()) allowed.push_back(keyword);
    root.requireKeys(allowed);
    const auto name = root.find("name");
    scene_.name = name ? name->getText("a text") : scene_.file.stem().string();
    // A model may do without contact; then surfaces and materials have no use either.
    if (root.find("contact") || root.find("surfaces") || root.find("materials") || !root.find("model")) {
      readMaterials(root.get("materials", "\"materials: {insert: {E: 463 MPa, nu: 0.46}}\""));
      declareSurfaces(root.get("surfaces", "\"surfaces: {femur: {sphere: {R: 30 mm}}}\""));
      readContacts(
          root.get("contact", "\"contact: {knee: {fixed: ..., moving: ..., material: ..., compartments: ...}}\""));
    }
    if (const auto node = root.find("analysis")) readAnalysis(*node);
    if (const auto node = root.find("model")) {
      readModel(*node);
    } else if (options_.requireModel) {
      throw InputError(document_.file +
                       ": model: this key is missing; static and gait analyses need a model with urdf, "
                       "joint and coordinates (genu contact needs none)");
    }
    if (const auto node = root.find("poses")) readPoses(*node);
    if (const auto node = root.find("wraps")) readWraps(*node);
    if (const auto node = root.find("loads")) readLoads(*node);
    for (const auto& [key, node] : root.items()) {
      if (const ElementReader* reader = findElementReader(key)) readElements(key, node, *reader);
    }
    if (const auto node = root.find("output")) readOutput(*node);
    buildSurfaces();
    listUnused();
    scene_.keyLines = document_.keyLines;
    return std::move(scene_);
  }

 private:
  struct SurfaceDefinition {
    SceneNode node;
    std::string kind;
    size_t summary;  ///< index in scene_.surfaces
    bool used = false;
  };
  /** A surface somebody waits for. */
  struct SurfaceUse {
    std::string name, user;
    Role role;
    SurfacePtr* target;
  };
  struct CompartmentPlace {
    size_t contact, compartment;
    SceneNode node;  ///< of the rectangle
    bool automatic;
    std::string fixedName, movingName;
    bool gridOnMoving;
    const std::string& gridName() const { return gridOnMoving ? movingName : fixedName; }
  };

  // -- files ------------------------------------------------------------------------------------------------------

  /** Absolute path of a file the scene names; adds its hash. */
  fs::path resolveFile(const SceneNode& node, std::string* written = nullptr) {
    const std::string text = node.getText("a file name");
    std::string rest;
    fs::path resolved;
    if (text.rfind("data:", 0) == 0) {
      rest = text.substr(5);
    } else {
      for (const std::string variable : {"${GENU_DATA_DIR}", "${GENU_DATA}"}) {
        if (text.rfind(variable, 0) != 0) continue;
        rest = text.substr(variable.size());
        break;
      }
    }
    if (!rest.empty()) {
      fs::path dataDir = options_.dataDir;
      if (dataDir.empty()) {
        if (const char* environment = std::getenv("GENU_DATA_DIR")) dataDir = environment;
      }
      if (dataDir.empty()) {
        node.fail("\"" + text +
                  "\" is in the data folder, and no data folder is set; give --data DIR or set the "
                  "environment variable GENU_DATA_DIR");
      }
      resolved = dataDir / fs::path(rest).relative_path();
    } else {
      if (text.find("${") != std::string::npos) {
        node.fail("\"" + text + "\": only ${GENU_DATA} at the beginning of a path is replaced");
      }
      resolved = fs::path(text).is_absolute() ? fs::path(text) : folder_ / text;
    }
    resolved = fs::absolute(resolved).lexically_normal();
    if (scene_.inputHashes.count(text) == 0)
      scene_.inputHashes[text] = io::calcSha256(io::readFile(resolved, node.where()));
    if (written != nullptr) *written = text;
    return resolved;
  }

  // -- materials --------------------------------------------------------------------------------------------------

  void readMaterials(const SceneNode& node) {
    for (const auto& [name, definition] : node.items()) {
      checkName(definition, name);
      materials_.emplace(name, readMaterial(definition));
      materialNames_.push_back(name);
    }
    if (materials_.empty()) node.fail("no material is defined; at least one is needed");
  }

  contact::Material readMaterial(const SceneNode& node) {
    contact::Material material;
    const auto law = node.find("law");
    const size_t choice = law ? law->getChoice({"linear", "power-law", "power-law-consistent"}) : 0;
    constexpr std::array<contact::MaterialLaw, 3> laws = {contact::MaterialLaw::linear, contact::MaterialLaw::powerLaw,
                                                          contact::MaterialLaw::powerLawConsistent};
    material.law = laws[choice];
    if (choice == 0) {
      if (!law && node.find("eps0") && !node.find("E")) {
        node.fail("eps0, p0 and n belong to a power law; add \"law: power-law\"");
      }
      node.requireKeys({"law", "E", "nu"});
      material.E_Pa = node.get("E", "\"E: 463 MPa\"").getPositive(Dimension::pressure);
    } else {
      node.requireKeys({"law", "eps0", "p0", "n", "nu"});
      material.eps0 = node.get("eps0", "\"eps0: 0.0597\"").getPositive(Dimension::dimensionless);
      material.p0_Pa = node.get("p0", "\"p0: 18.4 MPa\"").getPositive(Dimension::pressure);
      const SceneNode n = node.get("n", "\"n: 3\"");
      material.n = n.getQuantity(Dimension::dimensionless);
      if (!(material.n >= 1)) n.fail("is " + io::formatNumber(material.n) + "; allowed: n >= 1");
    }
    const SceneNode nu = node.get("nu", "\"nu: 0.46\"");
    material.nu = nu.getQuantity(Dimension::dimensionless);
    if (!(material.nu >= 0 && material.nu < 0.5)) {
      nu.fail("is " + io::formatNumber(material.nu) +
              "; allowed: 0 <= nu < 0.5 (an incompressible bonded layer, nu = 0.5, is infinitely stiff)");
    }
    callEngine(node, [&material] { material.validate(); });
    return material;
  }

  contact::Material getMaterial(const SceneNode& node) {
    const std::string name = node.getText("the name of a material");
    const auto found = materials_.find(name);
    if (found == materials_.end()) node.fail(io::describeUnknown("material", name, materialNames_));
    usedMaterials_.insert(name);
    return found->second;
  }

  // -- surfaces ---------------------------------------------------------------------------------------------------

  void declareSurfaces(const SceneNode& node) {
    for (const auto& [name, definition] : node.items()) {
      checkName(definition, name);
      std::string kind;
      for (const auto& [key, value] : definition.items()) {
        if (std::find(kSurfaceKinds.begin(), kSurfaceKinds.end(), key) == kSurfaceKinds.end()) continue;
        if (!kind.empty()) value.fail("a surface is one thing: \"" + kind + "\" was given already");
        kind = key;
      }
      std::vector<std::string> allowed = kind.empty() ? kSurfaceKinds : std::vector<std::string>{kind};
      allowed.push_back("pose");
      if (kind == "nurbs") allowed.push_back("patches");
      if (!kind.empty() && !isHeightField(kind)) allowed.push_back("flip_normals");
      if (isHeightField(kind)) allowed.push_back("extent");
      definition.requireKeys(allowed);
      if (kind.empty()) definition.fail("no kind of surface is given; allowed: " + io::joinNames(kSurfaceKinds));
      scene_.surfaces.push_back({name, kind, {}, 0, 0, {}});
      surfaceNames_.push_back(name);
      surfaces_.emplace(name, SurfaceDefinition{definition, kind, scene_.surfaces.size() - 1});
      // Numbers are checked even when nothing uses the surface.
      if (kind != "nurbs") makeAnalytic(definition, kind, Role::fixed, 1.0);
      if (const auto pose = definition.find("pose")) parsePoseNode(*pose);
      if (const auto extent = definition.find("extent")) extent->getPositive(Dimension::length);
      if (const auto flip = definition.find("flip_normals")) flip->getBool();
    }
    if (surfaces_.empty()) node.fail("no surface is defined; at least two are needed");
  }

  /** Engine errors ("dish: Rf = -1 is not allowed ...") with the key's place. */
  template <class Function>
  static auto callEngine(const SceneNode& node, Function function) -> decltype(function()) {
    try {
      return function();
    } catch (const std::invalid_argument& error) {
      node.fail(error.what());
    }
  }

  std::vector<contact::NurbsPatch> makeAnalytic(const SceneNode& definition, const std::string& kind, Role role,
                                                double halfExtent_m) {
    const SceneNode node = definition.get(kind, kind);
    const contact::Solid side = role == Role::fixed ? contact::Solid::below : contact::Solid::above;
    const auto height = [&node] {
      const auto y0 = node.find("y0");
      return y0 ? y0->getQuantity(Dimension::length) : 0.0;
    };
    const auto slope = [&node](const char* key) {
      const auto value = node.find(key);
      return value ? value->getQuantity(Dimension::dimensionless) : 0.0;
    };
    const auto length = [&node](const char* key) {
      return node.get(key, "\"" + std::string(key) + ": 30 mm\"").getPositive(Dimension::length);
    };
    const auto radiusOrInfinity = [&node](const char* key, bool signAllowed) {
      const SceneNode value = node.get(key, "\"" + std::string(key) + ": 30 mm\" (or inf)");
      const double radius = value.getQuantityOrInfinity(Dimension::length);
      if (radius == 0)
        value.fail("is 0; allowed: " + std::string(signAllowed ? "not 0, either sign" : "> 0") + ", or inf");
      if (!signAllowed && radius < 0) value.fail("is negative; allowed: > 0, or inf");
      return radius;
    };
    return callEngine(node, [&] {
      if (kind == "plane") {
        node.requireKeys({"y0", "sx", "sz"});
        return contact::makePlane(height(), slope("sx"), slope("sz"), side, halfExtent_m);
      }
      if (kind == "dish") {
        node.requireKeys({"y0", "Rs", "Rf"});
        return contact::makeDish(height(), radiusOrInfinity("Rs", false), radiusOrInfinity("Rf", false), side,
                                 halfExtent_m);
      }
      if (kind == "paraboloid") {
        node.requireKeys({"y0", "Rx", "Rz"});
        return contact::makeParaboloid(height(), radiusOrInfinity("Rx", true), radiusOrInfinity("Rz", true), side,
                                       halfExtent_m);
      }
      if (kind == "sphere") {
        node.requireKeys({"R"});
        return contact::makeSphere(length("R"));
      }
      if (kind == "cylinder") {
        node.requireKeys({"R", "length"});
        return contact::makeCylinder(length("R"), length("length"));
      }
      if (kind == "ellipsoid") {
        node.requireKeys({"a", "b", "c"});
        return contact::makeEllipsoid(length("a"), length("b"), length("c"));
      }
      node.requireKeys({"Rs", "Rf"});
      const double Rs = length("Rs"), Rf = length("Rf");
      if (!(Rf < Rs)) node.get("Rf", "").fail("is " + io::formatQuantity(Rf, "mm") + "; allowed: 0 < Rf < Rs");
      return contact::makeTorus(Rs, Rf);
    });
  }

  std::vector<contact::NurbsPatch> readNurbs(const SceneNode& definition, const std::string& name) {
    const SceneNode node = definition.get("nurbs", "\"nurbs: femur.json\"");
    const fs::path file = resolveFile(node);
    scene_.surfaces[surfaces_.at(name).summary].file = file;
    std::vector<io::NamedPatch> named;
    try {
      named = io::readNurbsFile(file);
    } catch (const InputError& error) {
      node.fail(error.what());
    }
    if (const auto wanted = definition.find("patches")) {
      std::vector<std::string> known;
      for (const auto& patch : named) known.push_back(patch.name);
      std::vector<io::NamedPatch> chosen;
      std::set<std::string> seen;
      for (const SceneNode& element : wanted->getList("a list of patch names")) {
        const std::string patchName = element.getText("the name of a patch");
        const auto found = std::find(known.begin(), known.end(), patchName);
        if (found == known.end())
          element.fail(file.string() + " has no such patch: " + io::describeUnknown("patch", patchName, known));
        if (!seen.insert(patchName).second) element.fail("\"" + patchName + "\" is listed twice");
        chosen.push_back(named[static_cast<size_t>(found - known.begin())]);
      }
      if (chosen.empty()) wanted->fail("is empty; known: " + io::joinNames(known));
      named = std::move(chosen);
    }
    const auto flip = definition.find("flip_normals");
    const bool flipped = flip && flip->getBool();
    std::vector<contact::NurbsPatch> patches;
    for (io::NamedPatch& patch : named) {
      patch.data.flipNormal = patch.data.flipNormal != flipped;
      callEngine(node, [&] { patches.emplace_back(std::move(patch.data)); });
    }
    return patches;
  }

  SurfacePtr getSurface(const SurfaceUse& use) {
    SurfaceDefinition& definition = surfaces_.at(use.name);
    // Only a height field depends on the side it is used on.
    const Role role = isHeightField(definition.kind) ? use.role : Role::fixed;
    SurfacePtr& surface = built_[{use.name, role}];
    SurfaceSummary& summary = scene_.surfaces[definition.summary];
    summary.usedBy.push_back(use.user + (use.role == Role::fixed ? ", fixed" : ", moving"));
    if (surface) return surface;
    contact::Pose pose;
    const auto poseNode = definition.node.find("pose");
    if (poseNode) pose = contact::calcPose(parsePoseNode(*poseNode));
    std::vector<contact::NurbsPatch> patches;
    if (definition.kind == "nurbs") {
      patches = readNurbs(definition.node, use.name);
    } else {
      patches = makeAnalytic(definition.node, definition.kind, role, calcHalfExtent(definition, pose));
      const auto flip = definition.node.find("flip_normals");
      if (flip && flip->getBool()) {  // solid outside: a socket
        for (contact::NurbsPatch& patch : patches) patch = patch.flipped();
      }
    }
    if (poseNode) {
      for (contact::NurbsPatch& patch : patches) patch = patch.transformed(pose);
    }
    summary.patches = static_cast<int>(patches.size());
    summary.controlPoints = 0;
    for (const contact::NurbsPatch& patch : patches) summary.controlPoints += patch.data().numU * patch.data().numV;
    surface = callEngine(definition.node, [&] { return std::make_shared<const ContactSurface>(std::move(patches)); });
    if (definition.kind == "nurbs") {
      const double size_m = surface->boundingBox().diagonal().norm();
      if (size_m < kSmallestSurface_m || size_m > kLargestSurface_m) {
        definition.node.get("nurbs", "")
            .fail("the surface is " + io::formatQuantity(size_m, "mm", 3) +
                  " across (allowed: " + io::formatQuantity(kSmallestSurface_m, "mm") + " to " +
                  io::formatQuantity(kLargestSurface_m, "m") + "); is length_unit in the file right?");
      }
    }
    return surface;
  }

  double calcHalfExtent(const SurfaceDefinition& definition, const contact::Pose& pose) const {
    if (!isHeightField(definition.kind)) return 0;
    if (const auto extent = definition.node.find("extent")) return extent->getPositive(Dimension::length);
    const auto y0 = definition.node.get(definition.kind, "").find("y0");
    const double height_m = y0 ? std::abs(y0->getQuantity(Dimension::length)) : 0;
    return std::max(kSmallestHalfExtent_m, kExtentFactor * (reach_m_ + height_m + pose.p.norm()));
  }

  void buildSurfaces() {
    const auto widen = [this](const contact::CompartmentDefinition& c) {
      if (const auto* cylinder = std::get_if<contact::ElementCylinder>(&c.elementSurface)) {
        reach_m_ = std::max(reach_m_, cylinder->point_m.norm() + std::max(std::abs(cylinder->axial0_m), std::abs(cylinder->axial1_m)));
      } else if (const auto* sphere = std::get_if<contact::ElementSphere>(&c.elementSurface)) {
        reach_m_ = std::max(reach_m_, sphere->center_m.norm());
      } else {
        reach_m_ = std::max(reach_m_, std::hypot(std::max(std::abs(c.x0_m), std::abs(c.x1_m)),
                                                 std::max(std::abs(c.z0_m), std::abs(c.z1_m))));
      }
    };
    for (const CompartmentPlace& place : compartments_) {
      if (!place.automatic) widen(getCompartment(place));
    }
    // Rectangles found from surfaces come before height fields, whose extent depends on all rectangles.
    for (const CompartmentPlace& place : compartments_) {
      if (!place.automatic) continue;
      const SurfaceDefinition& definition = surfaces_.at(place.gridName());
      if (isHeightField(definition.kind) && !definition.node.find("extent")) {
        place.node.fail("\"auto\" needs a surface with an end; \"" + place.gridName() + "\" is a " + definition.kind +
                        " without one: give the " +
                        (isRound(getCompartment(place)) ? "ranges" : "rectangle \"x0, x1, z0, z1\"") +
                        ", or the surface an \"extent\"");
      }
      const SurfacePtr surface = getSurface({place.gridName(), place.node.path(), place.gridOnMoving ? Role::moving : Role::fixed, nullptr});
      scene_.surfaces[definition.summary].usedBy.pop_back();  // it is listed as the compartment's surface below
      contact::CompartmentDefinition& c = getCompartment(place);
      if (isRound(c)) {
        findRanges(place, *surface, c);
        widen(c);
        continue;
      }
      const contact::PlaneFacing facing = std::get<contact::ElementPlane>(c.elementSurface).facing;
      const std::array<double, 4> found = callEngine(place.node, [&] { return contact::findRectangle(*surface, facing); });
      std::tie(c.x0_m, c.x1_m, c.z0_m, c.z1_m) = std::tie(found[0], found[1], found[2], found[3]);
      if (!(c.x1_m > c.x0_m && c.z1_m > c.z0_m)) {
        place.node.fail("no part of surface \"" + place.gridName() + "\" faces " +
                        (facing == contact::PlaneFacing::up ? "up (+y)" : "down (-y)") + "; are its normals inverted?");
      }
      widen(c);
    }
    for (const SurfaceUse& use : uses_) {
      SurfacePtr surface = getSurface(use);
      *use.target = std::move(surface);
    }
    for (const BackUse& back : backs_) {
      contact::ContactPairDefinition& definition = scene_.contacts[back.contact].definition;
      contact::Thickness& thickness = back.role == Role::fixed ? definition.fixedThickness : definition.movingThickness;
      std::get<contact::BackSurface>(thickness.source).surface =
          getSurface({back.name, back.place.path() + " (back)", back.role, nullptr});
    }
    checkOverlaps();
  }

  contact::CompartmentDefinition& getCompartment(const CompartmentPlace& place) {
    return scene_.contacts[place.contact].definition.compartments[place.compartment];
  }

  static bool isRound(const contact::CompartmentDefinition& c) {
    return !std::holds_alternative<contact::ElementPlane>(c.elementSurface);
  }

  /** Ranges of a round element surface that the scene leaves to the contact surface (NaN); those it gives are kept. */
  void findRanges(const CompartmentPlace& place, const ContactSurface& surface, contact::CompartmentDefinition& c) {
    const contact::ElementSurface given = c.elementSurface;
    c.elementSurface = callEngine(place.node, [&] { return contact::findExtent(surface, given); });
    const auto keep = [](double from, double& to) {
      if (!std::isnan(from)) to = from;
    };
    if (const auto* cylinder = std::get_if<contact::ElementCylinder>(&given)) {
      auto& found = std::get<contact::ElementCylinder>(c.elementSurface);
      keep(cylinder->angle0_rad, found.angle0_rad), keep(cylinder->angle1_rad, found.angle1_rad);
      keep(cylinder->axial0_m, found.axial0_m), keep(cylinder->axial1_m, found.axial1_m);
    } else {
      const auto& sphere = std::get<contact::ElementSphere>(given);
      auto& found = std::get<contact::ElementSphere>(c.elementSurface);
      keep(sphere.angle0_rad, found.angle0_rad), keep(sphere.angle1_rad, found.angle1_rad);
      keep(sphere.elevation0_rad, found.elevation0_rad), keep(sphere.elevation1_rad, found.elevation1_rad);
    }
  }

  /** Two overlapping rectangles on the same surfaces would count their common contact twice. */
  void checkOverlaps() {
    for (size_t i = 0; i < compartments_.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        const CompartmentPlace &a = compartments_[j], &b = compartments_[i];
        if (a.contact != b.contact || a.fixedName != b.fixedName || a.movingName != b.movingName) continue;
        const contact::CompartmentDefinition &ca = getCompartment(a), &cb = getCompartment(b);
        // Grids on round surfaces may look from different places; only equal planes are compared.
        if (isRound(ca) || isRound(cb) || std::get<contact::ElementPlane>(ca.elementSurface).facing !=
                                              std::get<contact::ElementPlane>(cb.elementSurface).facing) {
          continue;
        }
        const double dx = std::min(ca.x1_m, cb.x1_m) - std::max(ca.x0_m, cb.x0_m);
        const double dz = std::min(ca.z1_m, cb.z1_m) - std::max(ca.z0_m, cb.z0_m);
        constexpr double kTouching_m = 1e-9;
        if (dx > kTouching_m && dz > kTouching_m) {
          b.node.fail("compartments \"" + ca.name + "\" and \"" + cb.name + "\" of the same surfaces overlap by " +
                      io::formatQuantity(dx, "mm") + " x " + io::formatQuantity(dz, "mm") +
                      "; their common contact would count twice");
        }
      }
    }
  }

  std::string getSurfaceName(const SceneNode& node) {
    const std::string name = node.getText("the name of a surface");
    const auto found = surfaces_.find(name);
    if (found == surfaces_.end()) node.fail(io::describeUnknown("surface", name, surfaceNames_));
    found->second.used = true;
    return name;
  }

  // -- contact ----------------------------------------------------------------------------------------------------

  struct BackUse {
    std::string name;
    size_t contact;
    Role role;
    SceneNode place;
  };
  struct Side {
    std::string surface;  ///< empty: every compartment names its own
    std::string body;
    contact::Thickness thickness;
  };

  void readContacts(const SceneNode& node) {
    const auto pairs = node.items();
    if (pairs.empty()) node.fail("no contact pair is defined; at least one is needed");
    // Sized first: uses_ keeps addresses inside.
    scene_.contacts.resize(pairs.size());
    for (size_t i = 0; i < pairs.size(); ++i) {
      checkName(pairs[i].second, pairs[i].first);
      scene_.contacts[i].name = pairs[i].first;
      readContact(pairs[i].second, i);
    }
  }

  void readContact(const SceneNode& node, size_t index) {
    node.requireKeys({"fixed", "moving", "material", "strain", "distance", "correction", "damping", "rule", "tracking", "copy_tolerance",
                      "element_plane", "grid_on", "compartments"});
    ContactSpec& spec = scene_.contacts[index];
    contact::ContactPairDefinition& definition = spec.definition;
    const SceneNode fixedNode = node.get("fixed", "\"fixed: {surface: insert, thickness: 6 mm}\"");
    const SceneNode movingNode = node.get("moving", "\"moving: {surface: femur}\"");
    const Side fixed = readSide(fixedNode, index, Role::fixed), moving = readSide(movingNode, index, Role::moving);
    spec.fixedBody = fixed.body;
    spec.movingBody = moving.body;
    definition.fixedThickness = fixed.thickness;
    definition.movingThickness = moving.thickness;
    const bool fixedLayer = !std::holds_alternative<contact::RigidBody>(fixed.thickness.source);
    const bool movingLayer = !std::holds_alternative<contact::RigidBody>(moving.thickness.source);
    if (!fixedLayer && !movingLayer) {
      node.fail("neither body has an elastic layer; give fixed or moving a thickness, for example \"thickness: 6 mm\"");
    }

    const SceneNode material = node.get("material", "\"material: insert\"");
    if (material.isMap()) {
      material.requireKeys({"fixed", "moving"});
      const auto materialFixed = material.find("fixed"), materialMoving = material.find("moving");
      const auto read = [&](bool layer, const std::optional<SceneNode>& side,
                            const char* name) -> std::optional<contact::Material> {
        if (layer && !side) material.fail(std::string(name) + " has an elastic layer and no material here");
        if (!side) return std::nullopt;
        return getMaterial(*side);
      };
      const auto a = read(fixedLayer, materialFixed, "fixed"), b = read(movingLayer, materialMoving, "moving");
      definition.material = fixedLayer ? *a : *b;
      if (fixedLayer && movingLayer && !(*a == *b)) definition.movingMaterial = *b;
    } else {
      definition.material = getMaterial(material);
    }

    if (const auto strain = node.find("strain")) {
      definition.strain =
          strain->getChoice({"small", "large"}) == 0 ? contact::StrainMeasure::small : contact::StrainMeasure::large;
    }
    if (const auto distance = node.find("distance")) {
      definition.distance = distance->getChoice({"minimum", "ray"}) == 0 ? contact::DistanceMethod::minimum
                                                                         : contact::DistanceMethod::ray;
    }
    if (const auto correction = node.find("correction")) {
      constexpr std::array<contact::Correction, 3> all = {contact::Correction::midsurface, contact::Correction::none,
                                                          contact::Correction::energy};
      definition.correction = all[correction->getChoice({"midsurface", "none", "energy"})];
    }
    if (const auto damping = node.find("damping")) definition.damping_sPerM = damping->getNonNegative(Dimension::inverseSpeed);
    if (const auto rule = node.find("rule")) {
      definition.rule = rule->getChoice({"smooth", "centre"}) == 0 ? contact::ContactRule::smooth : contact::ContactRule::centre;
    }
    if (const auto tracking = node.find("tracking")) {
      constexpr std::array<contact::Tracking, 4> all = {contact::Tracking::all, contact::Tracking::lipschitz,
                                                        contact::Tracking::breadthFirst,
                                                        contact::Tracking::breadthFirstUnguarded};
      definition.tracking = all[tracking->getChoice({"all", "lipschitz", "breadth-first", "breadth-first-unguarded"})];
    }
    if (definition.correction == contact::Correction::energy) {
      const SceneNode correction = node.get("correction", "");
      if (definition.rule == contact::ContactRule::centre) {
        correction.fail("is energy, the gradient of the smooth rule's energy; with rule: centre it is midsurface or none");
      }
      if (definition.damping_sPerM > 0) {
        correction.fail("is energy, which has no damping; remove the damping, or choose midsurface or none");
      }
    }
    if (const auto tolerance = node.find("copy_tolerance")) {
      const bool never = tolerance->isScalar() && tolerance->getText("a length or never") == "never";
      definition.copyTolerance = never ? -1 : tolerance->getNonNegative(Dimension::length);
    }
    if (const auto gridOn = node.find("grid_on")) {
      definition.gridOn = gridOn->getChoice({"fixed", "moving"}) == 0 ? contact::GridOn::fixed : contact::GridOn::moving;
    }
    if (const auto plane = node.find("element_plane")) definition.planeY_m = plane->getQuantity(Dimension::length);

    const SceneNode compartments = node.get("compartments", "\"compartments: {all: {rectangle: auto, grid: 30x30}}\"");
    const auto items = compartments.items();
    if (items.empty()) compartments.fail("no compartment is defined; at least one is needed");
    definition.compartments.resize(items.size());
    for (size_t i = 0; i < items.size(); ++i) {
      checkName(items[i].second, items[i].first);
      if (items[i].first == "total") items[i].second.fail("the name \"total\" is taken by the sum over compartments");
      definition.compartments[i].name = items[i].first;
      readCompartment(items[i].second, index, i, fixed, moving);
    }
  }

  Side readSide(const SceneNode& node, size_t contact, Role role) {
    node.requireKeys({"surface", "body", "thickness"});
    Side side;
    if (const auto surface = node.find("surface")) side.surface = getSurfaceName(*surface);
    if (const auto body = node.find("body")) side.body = body->getText("the name of a link");
    if (const auto thickness = node.find("thickness")) side.thickness = readThickness(*thickness, contact, role);
    return side;
  }

  contact::Thickness readThickness(const SceneNode& node, size_t contact, Role role) {
    contact::Thickness thickness;
    if (!node.isMap()) {
      if (node.getText("none, a length (\"6 mm\"), {height_above: 0 mm}, {back: surface} or {radial: {radius: 27 mm}}") == "none")
        return thickness;
      thickness.source = contact::ConstantThickness{node.getPositive(Dimension::length)};
      return thickness;
    }
    const std::vector<std::string> sources = {"constant", "height_above", "back", "radial"};
    std::optional<SceneNode> source;
    std::string kind;
    for (const auto& [key, value] : node.items()) {
      if (std::find(sources.begin(), sources.end(), key) == sources.end()) continue;
      if (source) value.fail("a thickness has one source: \"" + kind + "\" was given already");
      source = value;
      kind = key;
    }
    std::vector<std::string> allowed = kind.empty() ? sources : std::vector<std::string>{kind};
    allowed.insert(allowed.end(), {"min", "max", "map_samples"});
    if (kind.empty() || kind == "back") allowed.insert(allowed.end(), {"along"});
    if (kind.empty() || kind == "back" || kind == "radial") allowed.push_back("missing");
    node.requireKeys(allowed);
    if (!source) node.fail("says nothing about the layer; allowed: " + io::joinNames(sources));
    if (kind == "constant") {
      thickness.source = contact::ConstantThickness{source->getPositive(Dimension::length)};
    } else if (kind == "height_above") {
      thickness.source = contact::HeightAbovePlane{source->getQuantity(Dimension::length)};
    } else if (kind == "radial") {
      source->requireKeys({"radius", "center", "axis"});
      contact::RadialThickness radial;
      radial.radius_m = source->get("radius", "\"radius: 27 mm\"").getPositive(Dimension::length);
      if (const auto center = source->find("center")) radial.center_m = readPoint(*center);
      if (const auto axis = source->find("axis")) radial.axis = readDirection(*axis);
      thickness.source = radial;
    } else {
      contact::BackSurface back;
      if (const auto along = node.find("along")) {
        back.direction = along->getChoice({"normal", "closest"}) == 0 ? contact::BackDirection::normal
                                                                      : contact::BackDirection::closest;
      }
      thickness.source = back;
      backs_.push_back({getSurfaceName(*source), contact, role, *source});
    }
    const auto readPositive = [&node](const char* key, std::optional<double>& value) {
      if (const auto found = node.find(key)) value = found->getPositive(Dimension::length);
    };
    readPositive("min", thickness.min_m);
    readPositive("max", thickness.max_m);
    readPositive("missing", thickness.missing_m);
    if (thickness.min_m && thickness.max_m && *thickness.min_m > *thickness.max_m) {
      node.get("max", "").fail("is " + io::formatQuantity(*thickness.max_m, "mm") +
                               ", below min = " + io::formatQuantity(*thickness.min_m, "mm"));
    }
    if (const auto samples = node.find("map_samples")) {
      std::tie(thickness.mapSamplesU, thickness.mapSamplesV) = parseGridNode(*samples);
      if (thickness.mapSamplesU < 2 || thickness.mapSamplesV < 2) samples->fail("a map needs at least 2x2 samples");
    }
    return thickness;
  }

  contact::Vec3 readPoint(const SceneNode& node) override {
    const auto values = node.getList(3, "\"x, y, z\" with units");
    return {values[0].getQuantity(Dimension::length), values[1].getQuantity(Dimension::length), values[2].getQuantity(Dimension::length)};
  }

  /** "z", "-y" or three numbers. */
  contact::Vec3 readDirection(const SceneNode& node) {
    if (node.isScalar()) {
      const std::string text = node.getText("a direction: x, y, z, -x, -y, -z, or three numbers");
      const std::string axis = text.size() == 2 && text[0] == '-' ? text.substr(1) : text;
      if (axis == "x" || axis == "y" || axis == "z") {
        return (text == axis ? 1.0 : -1.0) * contact::Vec3::Unit(axis[0] - 'x');
      }
      if (text.find(',') == std::string::npos) {
        node.fail("\"" + text + "\" is no direction; allowed: x, y, z, -x, -y, -z, or three numbers \"0, 0.5, 1\"");
      }
    }
    const auto values = node.getList(3, "x, y, z, -x, -y, -z, or three numbers");
    contact::Vec3 direction;
    for (int k = 0; k < 3; ++k) direction[k] = values[static_cast<size_t>(k)].getQuantity(Dimension::dimensionless);
    if (!(direction.norm() > 0)) node.fail("is 0, 0, 0; a direction is needed");
    return direction;
  }

  /** "low, high", or auto (NaN). Returns whether it was given. */
  bool readRange(const SceneNode& node, const char* key, Dimension dimension, const char* example, double& low, double& high) {
    low = high = std::numeric_limits<double>::quiet_NaN();
    const auto range = node.find(key);
    if (!range || (range->isScalar() && range->getText("a range") == "auto")) return false;
    const auto values = range->getList(2, std::string("\"low, high\" with units (\"") + example + "\"), or auto,");
    low = values[0].getQuantity(dimension);
    high = values[1].getQuantity(dimension);
    if (!(low < high)) range->fail("the first value is not below the second; the order is low, high");
    return true;
  }

  /** Keys that cylinders and spheres share. Returns whether the angle was given. */
  template <class Round>
  bool readRound(const SceneNode& node, contact::Vec3& center, const char* centerKey, Round& round) {
    if (const auto at = node.find(centerKey)) center = readPoint(*at);
    if (const auto axis = node.find("axis")) round.axis = readDirection(*axis);
    if (const auto zero = node.find("zero")) round.zero = readDirection(*zero);
    round.facing = node.get("facing", "\"facing: inward\" (a socket) or \"facing: outward\" (a head, a condyle)")
                               .getChoice({"inward", "outward"}) == 0
                       ? contact::RoundFacing::inward
                       : contact::RoundFacing::outward;
    if (const auto limit = node.find("limit_radius")) round.radius_m = limit->getPositive(Dimension::length);
    const bool given = readRange(node, "angle", Dimension::angle, "-40 deg, 40 deg", round.angle0_rad, round.angle1_rad);
    constexpr double kFullTurn = 2 * contact::kPi, kSlack = 1e-9;
    if (given && round.angle1_rad - round.angle0_rad > kFullTurn + kSlack) {
      node.get("angle", "").fail("is more than a full turn; allowed: at most 360 deg");
    }
    return given;
  }

  /** Where a compartment's grid is laid out. Returns the node to blame and whether something is left to the surface. */
  std::pair<SceneNode, bool> readElementSurface(const SceneNode& node, bool gridOnMoving, contact::CompartmentDefinition& definition) {
    const std::vector<std::string> kinds = {"rectangle", "cylinder", "sphere"};
    std::vector<std::string> given;
    for (const auto& [key, value] : node.items()) {
      if (std::find(kinds.begin(), kinds.end(), key) != kinds.end()) given.push_back(key);
      if (given.size() > 1) value.fail("elements lie on one surface: \"" + given[0] + "\" was given already");
    }
    if (!given.empty() && given[0] != "rectangle") {
      if (const auto facing = node.find("facing")) {
        facing->fail("here it is for a rectangle; a " + given[0] + " has its own: \"" + given[0] + ": {facing: inward}\"");
      }
    }
    if (const auto place = node.find("cylinder")) {
      place->requireKeys({"point", "axis", "zero", "facing", "angle", "axial", "limit_radius"});
      contact::ElementCylinder cylinder;
      bool complete = readRound(*place, cylinder.point_m, "point", cylinder);
      complete &= readRange(*place, "axial", Dimension::length, "-10 mm, 10 mm", cylinder.axial0_m, cylinder.axial1_m);
      definition.elementSurface = cylinder;
      return {*place, !complete};
    }
    if (const auto place = node.find("sphere")) {
      place->requireKeys({"center", "axis", "zero", "facing", "angle", "elevation", "limit_radius"});
      contact::ElementSphere sphere;
      bool complete = readRound(*place, sphere.center_m, "center", sphere);
      const bool elevation =
          readRange(*place, "elevation", Dimension::angle, "-40 deg, 40 deg", sphere.elevation0_rad, sphere.elevation1_rad);
      if (elevation && !(sphere.elevation0_rad > -0.5 * contact::kPi && sphere.elevation1_rad < 0.5 * contact::kPi)) {
        place->get("elevation", "").fail("reaches a pole of the grid; allowed: between -90 deg and 90 deg (turn the axis away)");
      }
      definition.elementSurface = sphere;
      return {*place, !(complete && elevation)};
    }
    contact::ElementPlane plane;
    plane.facing = gridOnMoving ? contact::PlaneFacing::down : contact::PlaneFacing::up;
    if (const auto facing = node.find("facing")) {
      plane.facing = facing->getChoice({"up", "down"}) == 0 ? contact::PlaneFacing::up : contact::PlaneFacing::down;
    }
    definition.elementSurface = plane;
    const SceneNode rectangle = node.get("rectangle", "\"rectangle: -5 mm, 5 mm, -5 mm, 5 mm\" (x0, x1, z0, z1) or auto, or a "
                                                     "cylinder or sphere");
    const bool automatic = rectangle.isScalar() && rectangle.getText("a rectangle") == "auto";
    if (!automatic) {
      const auto values = rectangle.getList(4, "\"x0, x1, z0, z1\" with units, or auto,");
      definition.x0_m = values[0].getQuantity(Dimension::length);
      definition.x1_m = values[1].getQuantity(Dimension::length);
      definition.z0_m = values[2].getQuantity(Dimension::length);
      definition.z1_m = values[3].getQuantity(Dimension::length);
      const auto requireOrder = [&rectangle](const char* axis, double low, double high) {
        if (low < high) return;
        const std::string a(axis);
        rectangle.fail(a + "0 = " + io::formatQuantity(low, "mm") + " is not below " + a +
                       "1 = " + io::formatQuantity(high, "mm") + "; the order is x0, x1, z0, z1");
      };
      requireOrder("x", definition.x0_m, definition.x1_m);
      requireOrder("z", definition.z0_m, definition.z1_m);
    }
    return {rectangle, automatic};
  }

  void readCompartment(const SceneNode& node, size_t contact, size_t index, const Side& fixed, const Side& moving) {
    node.requireKeys({"rectangle", "facing", "cylinder", "sphere", "grid", "fixed", "moving"});
    contact::CompartmentDefinition& definition = scene_.contacts[contact].definition.compartments[index];
    const bool gridOnMoving = scene_.contacts[contact].definition.gridOn == contact::GridOn::moving;
    const auto [rectangle, automatic] = readElementSurface(node, gridOnMoving, definition);
    if (const auto grid = node.find("grid")) std::tie(definition.nx, definition.nz) = parseGridNode(*grid);
    if (options_.gridOverride) std::tie(definition.nx, definition.nz) = *options_.gridOverride;
    const auto use = [&](const char* key, const Side& side, Role role, SurfacePtr* target) {
      std::string surface = side.surface;
      if (const auto own = node.find(key)) surface = getSurfaceName(*own);
      if (surface.empty()) {
        node.fail(std::string("no ") + key + " surface; give contact." + scene_.contacts[contact].name + "." + key +
                  ".surface, or \"" + key + ": surface\" in the compartment");
      }
      uses_.push_back({surface, node.path(), role, target});
      return surface;
    };
    const std::string fixedName = use("fixed", fixed, Role::fixed, &definition.fixedSurface);
    const std::string movingName = use("moving", moving, Role::moving, &definition.movingSurface);
    compartments_.push_back({contact, index, rectangle, automatic, fixedName, movingName, gridOnMoving});
  }

  // -- functions of time ------------------------------------------------------------------------------------------

  TimeFunction readTimeFunction(const SceneNode& node, Dimension dimension) override {
    if (!node.isMap()) return node.getQuantity(dimension);
    node.requireKeys({"table", "column", "unit", "time", "scale", "offset", "interpolation"});
    const SceneNode tableNode = node.get("table", "\"table: gait.csv\"");
    const SceneNode columnNode = node.get("column", "\"column: rz\"");
    std::string written;
    const fs::path file = resolveFile(tableNode, &written);
    const std::string column = columnNode.getText("the name of a column");

    std::string timeColumn = "time";
    double timeUnit_s = 1;
    bool percent = false;
    const auto timeNode = node.find("time");
    if (timeNode && timeNode->isMap()) {
      timeNode->requireKeys({"column", "unit"});
      timeColumn = timeNode->get("column", "\"column: percent_cycle\"").getText("the name of a column");
      const SceneNode unit = timeNode->get("unit", "\"unit: percent\" (of analysis.cycle) or \"unit: s\"");
      const std::string text = unit.getText("percent, s or ms");
      percent = text == "percent" || text == "%";
      timeUnit_s =
          percent ? scene_.cycle_s / 100 : io::parseUnit(text, Dimension::time, unit.where() + " (or percent)");
    } else if (timeNode) {
      timeColumn = timeNode->getText("the name of a column");
    }

    const io::Table table = readCached(file, {timeColumn, column}, node);
    std::string unit;
    const bool isStorage = file.extension() != ".csv" && dimension == Dimension::angle;
    const auto unitNode = node.find("unit");
    if (unitNode) {
      unit = unitNode->getText("a unit");
      if (isStorage && dimension == Dimension::angle && (unit == "deg") != table.inDegrees) {
        unitNode->fail("is \"" + unit + "\", but " + written + " says inDegrees=" + (table.inDegrees ? "yes" : "no") +
                       "; leave the unit out or make them agree");
      }
    } else if (isStorage) {
      unit = table.inDegrees ? "deg" : "rad";
    } else {
      node.fail("unit: this key is missing; write the unit of column \"" + column + "\", one of " +
                io::acceptedUnits(dimension));
    }
    const auto scaleNode = node.find("scale");
    double factor = 0;
    if (scaleNode) {
      factor = io::parseScaledUnit(scaleNode->getText("a number"), unit, dimension, scaleNode->where());
    } else {
      factor = io::parseUnit(unit, dimension, unitNode ? unitNode->where() : node.where());
    }
    const auto offsetNode = node.find("offset");
    const double offset = offsetNode ? offsetNode->getQuantity(dimension) : 0.0;

    TimeSeries series;
    series.source = written + ", column " + column;
    if (const auto v = node.find("interpolation")) {
      constexpr std::array<Interpolation, 3> kinds = {Interpolation::spline, Interpolation::linear, Interpolation::step};
      series.interpolation = kinds[v->getChoice({"spline", "linear", "step"})];
    }
    const int rows = table.numRows();
    if (rows < 2) tableNode.fail(written + " has one row; a table over time needs at least two");
    for (int row = 0; row < rows; ++row) {
      const auto r = static_cast<size_t>(row);
      // Divided by 100 last, so that 100 % is the cycle to the last bit.
      series.time_s.push_back(percent ? table.data[0][r] * scene_.cycle_s / 100 : table.data[0][r] * timeUnit_s);
      series.value.push_back(factor * table.data[1][r] + offset);
      if (!std::isfinite(series.value.back()))
        tableNode.fail(series.source + ": a value is beyond what a number can hold");
    }
    checkCoverage(series, percent, tableNode);
    return series;
  }

  io::Table readCached(const fs::path& file, const std::vector<std::string>& columns, const SceneNode& node) {
    const auto key = std::make_pair(file.string(), columns);
    const auto found = tables_.find(key);
    if (found != tables_.end()) return found->second;
    const io::Table table = io::readTable(file, columns, node.where());
    try {
      io::requireIncreasing(table, 0);
    } catch (const InputError& error) {
      node.fail(error.what());
    }
    return tables_.emplace(key, table).first->second;
  }

  void checkCoverage(const TimeSeries& series, bool percent, const SceneNode& node) const {
    for (const TimeSpan& span : spans_) {
      const double slack_s = 1e-9 * std::max(std::abs(span.end_s), scene_.cycle_s);
      const auto show = [&](double time_s) {
        std::string text = io::formatQuantity(time_s, "s");
        if (percent) text += " (" + io::formatQuantity(time_s / scene_.cycle_s, "%") + " of the cycle)";
        return text;
      };
      if (series.time_s.front() > span.begin_s + slack_s) {
        node.fail(series.source + " begins at " + show(series.time_s.front()) + ", after the run does (" +
                  io::formatQuantity(span.begin_s, "s") + ")");
      }
      if (series.time_s.back() < span.end_s - slack_s) {
        node.fail(series.source + " ends at " + show(series.time_s.back()) + ", before the run does (" +
                  io::formatQuantity(span.end_s, "s") + ", " + span.key + "); extend the table or shorten the run");
      }
    }
  }

  // -- model ------------------------------------------------------------------------------------------------------

  void readModel(const SceneNode& node) {
    node.requireKeys({"urdf", "joint", "gravity", "coordinates", "joints"});
    ModelSpec& model = scene_.model.emplace();
    model.urdf = resolveFile(node.get("urdf", "\"urdf: knee.urdf\""));
    const auto gravity = node.find("gravity");
    if (gravity && !(gravity->isScalar() && gravity->getText("gravity") == "none")) {
      readGravity(*gravity, model);
    }
    if (const auto joints = node.find("joints")) {
      for (const char* key : {"joint", "coordinates"}) {
        if (const auto other = node.find(key)) other->fail("is for a model with one joint; \"joints\" (line " + std::to_string(joints->line()) + ") names all");
      }
      readJoints(*joints, model);
    } else {
      const SceneNode joint = node.get("joint", "\"joint: tibiofemoral\" (or \"joints\" for several)");
      model.joint = joint.getText("the name of a joint of the URDF");
      model.jointPlace = joint.where();
      model.coordinates.assign(6, FreeCoordinate{});
      const auto coordinates = node.find("coordinates");
      if (coordinates) {
        coordinates->requireKeys(kCoordinates);
        for (size_t i = 0; i < kCoordinates.size(); ++i) {
          if (const auto c = coordinates->find(kCoordinates[i])) model.coordinates[i] = readCoordinate(*c, dimensionOf(static_cast<int>(i)));
        }
      }
    }
    for (const CoordinateInfo& info : listCoordinates(model)) coordinateNames_.push_back(info.name);
  }

  void readJoints(const SceneNode& node, ModelSpec& model) {
    model.coordinates.clear();
    for (const auto& [name, joint] : node.items()) {
      checkName(joint, name);
      const auto angle = joint.find("angle"), translation = joint.find("translation");
      if (angle || translation) {
        joint.requireKeys({angle ? "angle" : "translation"});
        model.joints.push_back({name, angle ? JointSpec::Kind::rotation : JointSpec::Kind::translation, joint.where()});
        model.coordinates.push_back(readCoordinate(angle ? *angle : *translation, angle ? Dimension::angle : Dimension::length));
        continue;
      }
      joint.requireKeys(kCoordinates);
      model.joints.push_back({name, JointSpec::Kind::floating, joint.where()});
      for (size_t i = 0; i < kCoordinates.size(); ++i) {
        // No default: a coordinate forgotten among many would be a free one.
        model.coordinates.push_back(readCoordinate(joint.get(kCoordinates[i], "\"" + kCoordinates[i] + ": free\" or {prescribed: ...}; a revolute joint has \"angle\", a prismatic one \"translation\""),
                                                   dimensionOf(static_cast<int>(i))));
      }
    }
    if (model.joints.empty()) node.fail("names no joint; leave \"model\" out for a scene without motion");
  }

  void readGravity(const SceneNode& node, ModelSpec& model) const {
    // "0, -9.81, 0 m/s^2": one unit at the end serves all three; a unit on each is fine too.
    const auto values = node.getList(3, "none or \"0, -9.81, 0 m/s^2\"");
    const std::string last = values[2].getText("an acceleration");
    const size_t unitAt = last.find_first_not_of("0123456789+-.eE \t");
    const std::string unit = unitAt == std::string::npos ? std::string() : last.substr(unitAt);
    for (size_t i = 0; i < 3; ++i) {
      std::string text = values[i].getText("an acceleration");
      const bool bare = text.find_first_not_of("0123456789+-.eE \t") == std::string::npos;
      if (bare && !unit.empty()) text += " " + unit;
      model.gravity_mPerS2[i] = io::parseQuantity(text, Dimension::acceleration, values[i].where());
    }
  }

  CoordinateSpec readCoordinate(const SceneNode& node, Dimension dimension) {
    const bool isAngle = dimension == Dimension::angle;
    if (node.isScalar()) {
      const std::string text = node.getText("free, {free: ...} or {prescribed: ...}");
      if (text == "free") return FreeCoordinate{};
      node.fail("is \"" + text.substr(0, 60) +
                "\"; allowed: free, {free: {start: ..., damping: ...}}, {prescribed: value or table}" +
                (std::isdigit(static_cast<unsigned char>(text[0])) != 0 || text[0] == '-'
                     ? "; to hold it there write {prescribed: \"" + text.substr(0, 60) + "\"}"
                     : ""));
    }
    node.requireKeys({"free", "prescribed"});
    const auto freeNode = node.find("free"), prescribed = node.find("prescribed");
    if (freeNode.has_value() == prescribed.has_value()) node.fail("is to be either free or prescribed");
    if (prescribed) return PrescribedCoordinate{readTimeFunction(*prescribed, dimension)};
    freeNode->requireKeys({"start", "damping", "limits"});
    FreeCoordinate free;
    if (const auto start = freeNode->find("start")) free.start = start->getQuantity(dimension);
    if (const auto damping = freeNode->find("damping")) {
      free.damping = damping->getNonNegative(isAngle ? Dimension::angularDamping : Dimension::damping);
    }
    if (const auto limits = freeNode->find("limits")) {
      limits->requireKeys({"lower", "upper", "stiffness", "dissipation"});
      CoordinateLimits& result = free.limits.emplace();
      result.lower = limits->get("lower", isAngle ? "\"lower: -120 deg\"" : "\"lower: -10 mm\"").getQuantity(dimension);
      const SceneNode upper = limits->get("upper", isAngle ? "\"upper: 5 deg\"" : "\"upper: 10 mm\"");
      result.upper = upper.getQuantity(dimension);
      if (!(result.lower < result.upper)) upper.fail("is not above lower");
      result.stiffness = limits->get("stiffness", isAngle ? "\"stiffness: 10 N m/deg\"" : "\"stiffness: 100 N/mm\"")
                             .getPositive(isAngle ? Dimension::angularStiffness : Dimension::stiffness);
      if (const auto d = limits->find("dissipation")) {
        result.dissipation = d->getNonNegative(isAngle ? Dimension::inverseAngularSpeed : Dimension::inverseSpeed);
      }
    }
    return free;
  }

  // -- loads ------------------------------------------------------------------------------------------------------

  void readLoads(const SceneNode& node) {
    for (const auto& [name, load] : node.items()) {
      checkName(load, name);
      const bool generalized = load.find("coordinate").has_value();
      if (generalized) {
        readGeneralizedLoad(load, name);
      } else {
        readForce(load, name);
      }
    }
  }

  void readGeneralizedLoad(const SceneNode& node, const std::string& name) {
    node.requireKeys({"coordinate", "value"});
    GeneralizedLoadSpec load;
    load.name = name;
    const SceneNode coordinate = node.get("coordinate", "\"coordinate: rx\"");
    load.coordinate = readCoordinate(coordinate);
    const CoordinateInfo info = listCoordinates(*scene_.model)[static_cast<size_t>(load.coordinate)];
    if (!info.isFree) {
      const std::string key = (scene_.model->joints.empty() ? "model.coordinates." : "model.joints.") + info.name;
      coordinate.fail("\"" + info.name + "\" is prescribed (" + key + ", line " + std::to_string(document_.keyLines[key]) +
                      "): a load on it would have no effect; make the coordinate free or remove the load");
    }
    load.value = readTimeFunction(node.get("value", "\"value: 2 N m\""), info.isAngle ? Dimension::moment : Dimension::force);
    scene_.generalizedLoads.push_back(std::move(load));
  }

  void readForce(const SceneNode& node, const std::string& name) {
    node.requireKeys({"coordinate", "value", "body", "frame", "force", "moment", "point"});
    if (const auto value = node.find("value"))
      value->fail("belongs to a load on a coordinate; add \"coordinate: rx\", or use force");
    if (!scene_.model) node.fail("a load needs a model; add model: {urdf: ..., joint: ...}");
    LoadSpec load;
    load.name = name;
    load.body = node.get("body", "\"body: femur\" (the link the force acts on)").getText("the name of a link");
    load.frame =
        node.get("frame", "\"frame: tibia\" (the link whose axes the force is given in)").getText("the name of a link");
    const auto moment = node.find("moment");
    if (node.find("force") || !moment) {
      const auto components = node.get("force", "\"force: 0 N, -1000 N, 0 N\" (or \"moment: 0 N m, 5 N m, 0 N m\")")
                                  .getList(3, "three components \"fx, fy, fz\", each a force or a table,");
      for (size_t i = 0; i < 3; ++i) load.force_N[i] = readTimeFunction(components[i], Dimension::force);
    } else if (const auto point = node.find("point")) {
      point->fail("a moment alone acts at no point; remove it, or add a force");
    }
    if (moment) {
      const auto components = moment->getList(3, "three components \"mx, my, mz\", each a moment or a table,");
      for (size_t i = 0; i < 3; ++i) load.moment_Nm[i] = readTimeFunction(components[i], Dimension::moment);
    }
    load.pointBody = load.body;
    if (const auto point = node.find("point")) {
      point->requireKeys({"body", "at"});
      if (const auto body = point->find("body")) load.pointBody = body->getText("the name of a link");
      const auto at = point->get("at", "\"at: 0 mm, 0 mm, 9.6 mm\"").getList(3, "three lengths \"x, y, z\", each a length or a table,");
      for (size_t i = 0; i < 3; ++i) load.point_m[i] = readTimeFunction(at[i], Dimension::length);
    }
    scene_.loads.push_back(std::move(load));
  }

  // -- poses, wraps, force elements -------------------------------------------------------------------------------

  void readPoses(const SceneNode& node) {
    const ModelSpec& model = getModel(node);
    std::vector<JointSpec> joints = model.joints;
    if (joints.empty()) joints.push_back({model.joint, JointSpec::Kind::floating});
    std::vector<std::string> names;
    for (const JointSpec& joint : joints) names.push_back(joint.name);
    for (const auto& [name, pose] : node.items()) {
      checkName(pose, name);
      std::vector<double>& q = scene_.poses[name];
      pose.requireKeys(names);
      for (const JointSpec& joint : joints) {
        const bool floating = joint.kind == JointSpec::Kind::floating, rotation = joint.kind == JointSpec::Kind::rotation;
        const SceneNode value = pose.get(joint.name, floating ? std::string("\"") + joint.name + ": " + kPoseText + "\"" : rotation ? "an angle" : "a length");
        if (floating) {
          const contact::JointCoordinates six = parsePoseNode(value);
          q.insert(q.end(), six.begin(), six.end());
        } else {
          q.push_back(value.getQuantity(rotation ? Dimension::angle : Dimension::length));
        }
      }
    }
  }

  void readWraps(const SceneNode& node) {
    getModel(node);
    for (const auto& [name, wrap] : node.items()) {
      checkName(wrap, name);
      wrap.requireKeys({"body", "pose", "cylinder", "sphere", "ellipsoid", "side"});
      WrapDefinition result;
      result.name = name;
      result.body = wrap.get("body", "\"body: tibia\"").getText("the name of a link");
      if (const auto pose = wrap.find("pose")) result.X_BodyW = contact::calcPose(parsePoseNode(*pose));
      const auto cylinder = wrap.find("cylinder"), sphere = wrap.find("sphere"), ellipsoid = wrap.find("ellipsoid");
      if (int(cylinder.has_value()) + int(sphere.has_value()) + int(ellipsoid.has_value()) != 1) {
        wrap.fail("is one of cylinder: {R: ...}, sphere: {R: ...}, ellipsoid: {a: ..., b: ..., c: ...}");
      }
      std::optional<contact::Vec3> side;
      if (const auto direction = wrap.find("side")) {
        if (!cylinder) direction->fail("is for cylinders: a path can slip off a sphere or an ellipsoid to any side");
        side = readDirection(*direction);
      }
      const auto length = [](const SceneNode& shape, const char* key) {
        return shape.get(key, "\"" + std::string(key) + ": 20 mm\"").getPositive(Dimension::length);
      };
      const SceneNode& shape = cylinder ? *cylinder : sphere ? *sphere : *ellipsoid;
      callEngine(shape, [&] {
        if (ellipsoid) {
          shape.requireKeys({"a", "b", "c"});
          result.surface = musculoskeletal::WrapSurface::makeEllipsoid(length(shape, "a"), length(shape, "b"), length(shape, "c"));
          return;
        }
        shape.requireKeys({"R"});
        result.surface = cylinder ? musculoskeletal::WrapSurface::makeCylinder(length(shape, "R"), side)
                                  : musculoskeletal::WrapSurface::makeSphere(length(shape, "R"));
      });
      wrapNames_.push_back(name);
      scene_.wraps.push_back(std::move(result));
    }
  }

  void readElements(const std::string& keyword, const SceneNode& node, const ElementReader& reader) {
    getModel(node);
    for (const auto& [name, value] : node.items()) {
      checkName(value, name);
      for (const auto& other : scene_.elements) {  // names become columns of one table
        if (other->name == name) value.fail("the name is taken by " + other->key() + "; every force element has its own");
      }
      std::shared_ptr<ElementDefinition> element = reader(value, *this);
      if (!element) value.fail("the reader of \"" + keyword + "\" made nothing of it");
      element->keyword = keyword;
      element->name = name;
      scene_.elements.push_back(std::move(element));
    }
  }

  const ModelSpec& getModel(const SceneNode& node) override {
    if (!scene_.model) node.fail("needs a model; add model: {urdf: ..., joints: ...}");
    return *scene_.model;
  }

  int readCoordinate(const SceneNode& node) override {
    getModel(node);
    return static_cast<int>(node.getChoice(coordinateNames_));
  }

  std::string readPoseName(const SceneNode& node) override {
    const std::string name = node.getText("the name of a pose");
    if (scene_.poses.count(name) == 0) {
      std::vector<std::string> names;
      for (const auto& pose : scene_.poses) names.push_back(pose.first);
      node.fail(io::describeUnknown("pose", name, names) + (names.empty() ? "; define it: \"poses: {" + name + ": {JOINT: ...}}\"" : ""));
    }
    return name;
  }

  PathDefinition readPath(const SceneNode& node) override {
    PathDefinition path;
    int wrap = -1;
    std::optional<SceneNode> wrapNode;
    for (const SceneNode& item : node.getList("a list of points and wraps")) {
      if (item.find("wrap")) {
        item.requireKeys({"wrap"});
        const SceneNode name = item.get("wrap", "");
        if (path.points.empty()) name.fail("a path begins with a point");
        if (wrap >= 0) name.fail("between two points there is one wrap at most; put a point between them");
        const std::string text = name.getText("the name of a wrap");
        const auto found = std::find(wrapNames_.begin(), wrapNames_.end(), text);
        if (found == wrapNames_.end()) name.fail(io::describeUnknown("wrap", text, wrapNames_));
        wrap = static_cast<int>(found - wrapNames_.begin());
        usedWraps_.insert(text);
        wrapNode = name;
        continue;
      }
      if (!path.points.empty()) path.wraps.push_back(wrap);
      wrap = -1;
      path.points.push_back(readPathPoint(item));
    }
    if (wrap >= 0) wrapNode->fail("a path ends with a point");
    if (path.points.size() < 2) node.fail("has " + std::to_string(path.points.size()) + " point; two at least are needed");
    const std::string& body = path.points.front().body;
    const bool fixed = std::all_of(path.points.begin(), path.points.end(), [&](const PathPoint& p) { return p.body == body && p.coordinate < 0; }) &&
                       std::all_of(path.wraps.begin(), path.wraps.end(), [&](int w) { return w < 0 || scene_.wraps[static_cast<size_t>(w)].body == body; });
    if (fixed) node.fail("is on the link \"" + body + "\" alone: its length never changes; put one end on another link");
    return path;
  }

  PathPoint readPathPoint(const SceneNode& node) {
    node.requireKeys({"body", "at", "moving", "wrap"});
    PathPoint point;
    point.body = node.get("body", "\"body: femur\"").getText("the name of a link");
    const auto moving = node.find("moving");
    if (!moving) {
      point.point_m = readPoint(node.get("at", "\"at: 0 mm, 10 mm, 0 mm\""));
      return point;
    }
    if (const auto at = node.find("at")) at->fail("belongs to a point that does not move");
    moving->requireKeys({"coordinate", "at"});
    const SceneNode coordinate = moving->get("coordinate", "\"coordinate: tibiofemoral.rz\"");
    point.coordinate = readCoordinate(coordinate);
    const bool isAngle = listCoordinates(*scene_.model)[static_cast<size_t>(point.coordinate)].isAngle;
    const SceneNode table = moving->get("at", "\"at: [[0 deg, 1 mm, 2 mm, 3 mm], [90 deg, ...]]\"");
    for (const SceneNode& row : table.getList("a list of [coordinate, x, y, z]")) {
      const auto values = row.getList(4, "[coordinate, x, y, z] with units");
      const double q = values[0].getQuantity(isAngle ? Dimension::angle : Dimension::length);
      if (!point.q.empty() && !(q > point.q.back())) values[0].fail("is not above the row before");
      point.q.push_back(q);
      contact::Vec3 p;
      for (int k = 0; k < 3; ++k) p[k] = values[static_cast<size_t>(k) + 1].getQuantity(Dimension::length);
      point.p_m.push_back(p);
    }
    if (point.q.size() < 2) table.fail("has one row; two at least are needed");
    return point;
  }

  // -- analysis and output ----------------------------------------------------------------------------------------

  void readAnalysis(const SceneNode& node) {
    node.requireKeys({"cycle", "static", "gait", "series"});
    if (const auto cycle = node.find("cycle")) scene_.cycle_s = cycle->getPositive(Dimension::time);
    spans_.clear();
    if (const auto analysis = node.find("static")) {
      readStatic(*analysis);
      spans_.push_back({scene_.staticAnalysis->time_s, scene_.staticAnalysis->time_s, analysis->childPath("time")});
    }
    if (const auto analysis = node.find("gait")) {
      readGait(*analysis);
      spans_.push_back({0, scene_.gait->duration_s, analysis->childPath("duration")});
    }
    if (const auto analysis = node.find("series")) {
      readSeries(*analysis);
      spans_.push_back({0, scene_.series->duration_s, analysis->childPath("duration")});
    }
    if (spans_.empty()) spans_.push_back({});
  }

  void readSeries(const SceneNode& node) {
    node.requireKeys({"duration", "output_interval"});
    SeriesSpec& spec = scene_.series.emplace();
    spec.duration_s = scene_.cycle_s;
    if (const auto v = node.find("duration")) spec.duration_s = v->getPositive(Dimension::time);
    spec.outputInterval_s = std::min(scene_.cycle_s / 100, spec.duration_s);
    readOutputInterval(node, spec.duration_s, spec.outputInterval_s);
  }

  void readOutputInterval(const SceneNode& node, double duration_s, double& interval_s) {
    if (const auto v = node.find("output_interval")) {
      interval_s = v->getPositive(Dimension::time);
      if (interval_s > duration_s) {
        v->fail("is " + io::formatQuantity(interval_s, "s") + ", longer than the run (" + io::formatQuantity(duration_s, "s") + ")");
      }
    }
    if (duration_s / interval_s > kMaxOutputs) {
      node.fail("duration / output_interval = " + io::formatNumber(std::round(duration_s / interval_s)) +
                " output times; allowed: at most " + io::formatNumber(kMaxOutputs));
    }
  }

  void readStatic(const SceneNode& node) {
    node.requireKeys({"method", "max_acceleration", "max_residual", "damping", "max_time", "time", "search"});
    StaticSpec& spec = scene_.staticAnalysis.emplace();
    if (const auto method = node.find("method")) {
      constexpr std::array<StaticSpec::Method, 4> methods = {
          StaticSpec::Method::newton, StaticSpec::Method::implicitEuler, StaticSpec::Method::both, StaticSpec::Method::kinsol};
      spec.method = methods[method->getChoice({"newton", "implicit-euler", "both", "kinsol"})];
    }
    if (const auto v = node.find("search")) {
      v->requireKeys({"starts", "translation", "angle", "max_wall_time"});
      StaticSpec::Search& search = spec.search.emplace();
      if (const auto entry = v->find("starts")) search.starts = entry->getInteger(1, 10000);
      if (const auto entry = v->find("translation")) search.translation_m = entry->getPositive(Dimension::length);
      if (const auto entry = v->find("angle")) {
        search.angle_rad = entry->getPositive(Dimension::angle);
        if (search.angle_rad > contact::kPi) entry->fail("is " + io::formatQuantity(search.angle_rad, "deg") + "; allowed: > 0, at most 180 deg");
      }
      if (const auto entry = v->find("max_wall_time")) search.maxWallTime_s = entry->getPositive(Dimension::time);
    }
    if (const auto v = node.find("max_acceleration"))
      spec.maxAcceleration_mPerS2 = v->getPositive(Dimension::acceleration);
    if (const auto v = node.find("max_residual")) spec.maxResidual_N = v->getPositive(Dimension::force);
    if (const auto v = node.find("damping")) spec.damping_NsPerM = v->getNonNegative(Dimension::damping);
    if (const auto v = node.find("max_time")) spec.maxTime_s = v->getPositive(Dimension::time);
    if (const auto v = node.find("time")) spec.time_s = v->getNonNegative(Dimension::time);
  }

  void readGait(const SceneNode& node) {
    node.requireKeys({"duration", "output_interval", "accuracy", "integrator", "max_order", "step", "settle_first", "tolerances", "prescribed", "max_steps",
                      "max_wall_time", "error_estimate"});
    GaitSpec& spec = scene_.gait.emplace();
    spec.duration_s = scene_.cycle_s;
    if (const auto v = node.find("duration")) spec.duration_s = v->getPositive(Dimension::time);
    spec.outputInterval_s = std::min(scene_.cycle_s / 100, spec.duration_s);
    readOutputInterval(node, spec.duration_s, spec.outputInterval_s);
    if (const auto v = node.find("accuracy")) {
      spec.accuracy = v->getQuantity(Dimension::dimensionless);
      // Beyond, a step may err by so much speed that an undamped knee is thrown off its surfaces for good.
      if (!(spec.accuracy >= 1e-12 && spec.accuracy <= 1e-3)) {
        v->fail("is " + io::formatNumber(spec.accuracy) + "; allowed: 1e-12 to 0.001");
      }
    }
    if (const auto v = node.find("integrator")) {
      spec.integrator = v->getText("the name of an integrator");  // the model's layer knows them
    }
    if (const auto v = node.find("max_order")) spec.maxOrder = v->getInteger(1, 12);
    if (const auto v = node.find("step")) spec.step_s = v->getPositive(Dimension::time);
    if (const auto v = node.find("tolerances")) {
      v->requireKeys({"translation", "angle", "speed", "angular_speed"});
      // From those of the smallest accuracy to steps that may be wrong by more than any layer's indentation.
      const auto read = [&v](const char* key, Dimension dimension, double lowest, double highest, const char* unit, std::optional<double>& value) {
        if (const auto entry = v->find(key)) value = entry->getBetween(dimension, lowest, highest, unit);
      };
      read("translation", Dimension::length, 1e-15, 1e-3, "mm", spec.tolerances.translation_m);
      read("angle", Dimension::angle, 1e-14, 0.1, "rad", spec.tolerances.angle_rad);
      read("speed", Dimension::speed, 1e-11, 1, "mm/s", spec.tolerances.speed_mPerS);
      read("angular_speed", Dimension::angularSpeed, 1e-10, 100, "rad/s", spec.tolerances.angularSpeed_radPerS);
    }
    if (const auto v = node.find("prescribed")) {
      constexpr std::array<GaitSpec::Prescribed, 3> kinds = {GaitSpec::Prescribed::automatic, GaitSpec::Prescribed::eliminated,
                                                             GaitSpec::Prescribed::constraints};
      spec.prescribed = kinds[v->getChoice({"auto", "eliminated", "constraints"})];
    }
    if (const auto v = node.find("max_steps")) spec.maxSteps = v->getInteger(1, 1000000000);
    if (const auto v = node.find("max_wall_time")) spec.maxWallTime_s = v->getPositive(Dimension::time);
    if (const auto v = node.find("settle_first")) spec.settleFirst = v->getBool();
    if (const auto v = node.find("error_estimate")) spec.errorEstimate = v->getBool();
  }

  void readOutput(const SceneNode& node) {
    node.requireKeys({"maps", "plots"});
    if (const auto v = node.find("maps")) scene_.output.maps = v->getBool();
    if (const auto v = node.find("plots")) scene_.output.plots = v->getBool();
  }

  void listUnused() {
    for (const std::string& name : surfaceNames_) {
      if (!surfaces_.at(name).used) scene_.unused.push_back("surfaces." + name);
    }
    for (const std::string& name : materialNames_) {
      if (usedMaterials_.count(name) == 0) scene_.unused.push_back("materials." + name);
    }
    for (const std::string& name : wrapNames_) {
      if (usedWraps_.count(name) == 0) scene_.unused.push_back("wraps." + name);
    }
  }

  const std::string& yaml_;
  const ReadOptions& options_;
  fs::path folder_;
  Scene scene_;
  SceneDocument document_;
  std::map<std::string, contact::Material> materials_;
  std::vector<std::string> materialNames_, surfaceNames_, coordinateNames_, wrapNames_;
  std::set<std::string> usedMaterials_, usedWraps_;
  std::map<std::string, SurfaceDefinition> surfaces_;
  std::map<std::pair<std::string, Role>, SurfacePtr> built_;
  std::vector<SurfaceUse> uses_;
  std::vector<BackUse> backs_;
  std::vector<CompartmentPlace> compartments_;
  std::map<std::pair<std::string, std::vector<std::string>>, io::Table> tables_;
  std::vector<TimeSpan> spans_ = {TimeSpan{}};
  double reach_m_ = 0;
};

}  // namespace

Scene parseScene(const std::string& yaml, const fs::path& file, const ReadOptions& options) {
  return SceneReader(yaml, file, options).read();
}

Scene readScene(const fs::path& file, const ReadOptions& options) {
  const std::string text = io::readFile(file);
  return parseScene(text, file, options);
}

std::vector<std::shared_ptr<const contact::ContactPair>> makeContactPairs(const Scene& scene) {
  std::vector<std::shared_ptr<const contact::ContactPair>> pairs;
  for (const ContactSpec& spec : scene.contacts) {
    try {
      pairs.push_back(std::make_shared<const contact::ContactPair>(spec.definition));
    } catch (const std::invalid_argument& error) {
      throw InputError(scene.where("contact." + spec.name) + ": " + error.what());
    }
  }
  return pairs;
}

std::vector<std::string> listWarnings(const Scene& scene) {
  std::vector<std::string> warnings;
  for (const ContactSpec& spec : scene.contacts) {
    if (spec.definition.tracking != contact::Tracking::breadthFirstUnguarded) continue;
    warnings.push_back(scene.where("contact." + spec.name + ".tracking") +
                       ": breadth-first-unguarded can miss a new, separate contact region; the load may be wrong by all of it; "
                       "lipschitz is exact and faster");
  }
  return warnings;
}

contact::JointCoordinates parsePose(const std::string& text, const std::string& where) {
  const std::vector<std::string> parts = io::splitList(text);
  if (parts.size() != 6) {
    throw InputError(where + ": \"" + text.substr(0, 100) + "\" has " + std::to_string(parts.size()) +
                     (parts.size() == 1 ? " value, " : " values, ") + kPoseText + " are needed");
  }
  contact::JointCoordinates q{};
  for (size_t i = 0; i < 6; ++i) {
    q[i] = io::parseQuantity(parts[i], dimensionOf(static_cast<int>(i)), where + ": " + kCoordinateNames[i]);
  }
  return q;
}

std::pair<int, int> parseGrid(const std::string& text, const std::string& where) {
  const size_t separator = text.find_first_of("xX,");
  const auto readCount = [](std::string part) {
    part.erase(0, std::min(part.find_first_not_of(" \t"), part.size()));
    part.erase(part.find_last_not_of(" \t") + 1);
    int value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    return error == std::errc() && end == part.data() + part.size() && !part.empty() ? value : 0;
  };
  int nx = 0, nz = 0;
  if (separator != std::string::npos) {
    nx = readCount(text.substr(0, separator));
    nz = readCount(text.substr(separator + 1));
  }
  if (nx < 1 || nz < 1 || nx > kMaxGridCells || nz > kMaxGridCells) {
    throw InputError(where + ": \"" + text.substr(0, 60) + "\" is not a grid; allowed: NXxNZ like 30x30, each 1 to " +
                     std::to_string(kMaxGridCells));
  }
  return {nx, nz};
}

}  // namespace genu::scene
