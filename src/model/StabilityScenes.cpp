#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <utility>

#include "genu/io/Files.h"
#include "genu/model/OdeIntegrator.h"
#include "genu/model/Stability.h"
#include "genu/scene/SceneFile.h"

namespace genu::model {

namespace {

namespace fs = std::filesystem;
using Scale = StabilityAxis::Scale;

constexpr double kPi = contact::kPi;
constexpr double kBodyWeight_N = 700;

/** Replaces every {key} of a text. */
std::string fill(std::string text, const std::vector<std::pair<std::string, std::string>>& values) {
  for (const auto& [key, value] : values) {
    const std::string token = "<" + key + ">";
    for (size_t at = text.find(token); at != std::string::npos; at = text.find(token, at + value.size())) text.replace(at, token.size(), value);
  }
  return text;
}

std::string number(double value) { return fmt::format("{:.15g}", value); }

/** Scenes as users write them, so that what refuses a value is what would refuse theirs. Every one names its own files in the folder. */
class Workshop {
 public:
  explicit Workshop(fs::path folder) : folder_(std::move(folder)) {}

  scene::Scene parse(const std::string& yaml) const { return scene::parseScene(yaml, folder_ / "scene.yaml"); }

  /** A body on a floating joint above ground; its inertia grows with its mass. */
  std::string writeFloating(double mass_kg, double centerY_m) const {
    return write(fmt::format("floating_{:.6g}_{:.3g}.urdf", mass_kg, centerY_m),
                 fmt::format("<robot name='knee'>\n<link name='tibia'/>\n<link name='femur'><inertial><origin xyz='0 {} 0'/><mass value='{}'/>"
                             "<inertia ixx='{}' ixy='0' ixz='0' iyy='{}' iyz='0' izz='{}'/></inertial></link>\n"
                             "<joint name='knee' type='floating'><parent link='tibia'/><child link='femur'/></joint>\n</robot>\n",
                             number(centerY_m), number(mass_kg), number(mass_kg * 6.7e-3), number(mass_kg * 3.3e-3), number(mass_kg * 6.7e-3)));
  }
  /** base slides along y over ground, ball slides along y over base. */
  std::string writeChain(double base_kg, double ball_kg) const {
    const auto link = [](const char* name, double mass) {
      return fmt::format("<link name='{}'><inertial><mass value='{}'/><inertia ixx='{}' ixy='0' ixz='0' iyy='{}' iyz='0' izz='{}'/></inertial></link>\n", name,
                         number(mass), number(mass * 4e-4), number(mass * 4e-4), number(mass * 4e-4));
    };
    const auto joint = [](const char* name, const char* parent, const char* child) {
      return fmt::format("<joint name='{}' type='prismatic'><parent link='{}'/><child link='{}'/><axis xyz='0 1 0'/><limit effort='1' velocity='1'/></joint>\n", name,
                         parent, child);
    };
    return write(fmt::format("chain_{:.6g}_{:.6g}.urdf", base_kg, ball_kg), "<robot name='chain'>\n<link name='ground'/>\n" + link("base", base_kg) +
                                                                               link("ball", ball_kg) + joint("lift", "ground", "base") +
                                                                               joint("hop", "base", "ball") + "</robot>\n");
  }
  /** Columns time_s and value. */
  std::string writeTable(const std::string& name, const std::vector<std::pair<double, double>>& rows) const {
    std::string text = "time_s,value\n";
    for (const auto& [t, value] : rows) text += fmt::format("{:.12g},{:.15g}\n", t, value);
    return write(name, text);
  }
  /** The same of a function of time. */
  template <class Function>
  std::string writeFunction(const std::string& name, double duration_s, int rows, Function&& function) const {
    std::vector<std::pair<double, double>> table;
    for (int i = 0; i < rows; ++i) table.emplace_back(duration_s * i / (rows - 1), function(duration_s * i / (rows - 1)));
    return writeTable(name, table);
  }

 private:
  std::string write(const std::string& name, const std::string& text) const {
    io::writeFileAtomically(folder_ / name, text);
    return (folder_ / name).string();
  }
  fs::path folder_;
};

std::string table(const std::string& file, const std::string& unit) { return fmt::format("{{table: {}, column: value, unit: {}, time: {{column: time_s, unit: s}}}}", file, unit); }
std::string newtons(double force) { return number(force) + " N"; }

// -- the knee -----------------------------------------------------------------------------------------------------

/** Two toroidal condyles (30 mm sagittal, 20 mm coronal) 44 mm apart in two dishes (60 mm, 35 mm); height, medial-lateral translation and varus
 are free. The energy-consistent force, so that the balance shows errors of everything else. */
struct Knee {
  std::string material = "{E: 463 MPa, nu: 0.46}", thickness = "8 mm", strain = "small", correction = "energy", pose = "";
  std::string load = "-1500 N", moment = "0 N m";
  std::string rz = "-20 deg", ry = "2 deg", x = "1 mm", y = "free", z = "free", rx = "free";
  std::string gravity = "none";
  std::string more;
  double mass_kg = 3;
  double duration_s = 0.1, interval_s = 2.5e-4;
  std::string integrator = "cpodes", accuracy = "1e-4", extra;
  bool gait = false, settle = true;
};

scene::Scene makeKnee(const Workshop& shop, const Knee& knee) {
  const std::string at = ", pose: \"0 deg, 0 deg, 0 deg, 0 mm, 0 mm, <side>22 mm\"";
  std::string surfaces;
  for (const char* side : {"", "-"}) {
    const std::string name = *side == '-' ? "lateral" : "medial";
    surfaces += "  dish_" + name + ": {dish: {y0: 8 mm, Rs: 60 mm, Rf: 35 mm}, extent: 25 mm" + fill(at, {{"side", side}}) + "}\n";
    surfaces += "  condyle_" + name + ": {torus: {Rs: 30 mm, Rf: 20 mm}" + fill(at, {{"side", side}}) + "}\n";
  }
  return shop.parse(fill(R"(genu: 1
surfaces:
<surfaces>materials: {layer: <material>}
contact:
  knee:
    fixed: {thickness: <thickness>}
    moving: {}
    material: layer
    strain: <strain>
    correction: <correction>
    compartments:
      medial: {rectangle: "-12 mm, 14 mm, 13 mm, 31 mm", grid: 14x14, fixed: dish_medial, moving: condyle_medial}
      lateral: {rectangle: "-12 mm, 14 mm, -31 mm, -13 mm", grid: 14x14, fixed: dish_lateral, moving: condyle_lateral}
model:
  urdf: <urdf>
  joint: knee
  gravity: <gravity>
  coordinates:
    rz: {prescribed: <rz>}
    ry: {prescribed: <ry>}
    x: {prescribed: <x>}
    y: <y>
    z: <z>
    rx: <rx>
loads:
  axial: {body: femur, frame: tibia, force: [0 N, <load>, 0 N], point: {at: "0 mm, 0 mm, 9 mm"}}
  varus: {body: femur, frame: tibia, moment: [<moment>, 0 N m, 0 N m]}
<more>analysis:
  static: {}
<gait>)",
                         {{"gait", knee.gait ? fmt::format("  gait: {{duration: {} s, output_interval: {} s, accuracy: {}, integrator: {}, settle_first: {}{}}}\n", number(knee.duration_s),
                                                           number(knee.interval_s), knee.accuracy, knee.integrator, knee.settle, knee.extra)
                                             : ""},
                          {"surfaces", surfaces},
                          {"urdf", shop.writeFloating(knee.mass_kg, 0.05)},
                          {"material", knee.material},
                          {"thickness", knee.thickness},
                          {"strain", knee.strain},
                          {"correction", knee.correction},
                          {"gravity", knee.gravity},
                          {"rz", knee.rz},
                          {"ry", knee.ry},
                          {"x", knee.x},
                          {"y", knee.y},
                          {"z", knee.z},
                          {"rx", knee.rx},
                          {"load", knee.load},
                          {"moment", knee.moment},
                          {"more", knee.more}}));
}

/** A tenth of a second of walking: the load rises from 0.8 to 3 body weights and falls, 10 degrees of flexion. */
Knee makeWalking(const Workshop& shop, double bodyWeights = 3) {
  Knee knee;
  knee.gait = true;
  knee.load = table(shop.writeFunction(fmt::format("load_{:.9g}.csv", bodyWeights), 0.1, 41,
                                       [&](double t) { return -kBodyWeight_N * bodyWeights * (0.27 + 0.73 * std::pow(std::sin(kPi * t / 0.1), 2)); }),
                    "N");
  knee.rz = table(shop.writeFunction("flexion.csv", 0.1, 41, [](double t) { return -20 - 10 * std::pow(std::sin(kPi * t / 0.2), 2); }), "deg");
  return knee;
}

// -- the ball -----------------------------------------------------------------------------------------------------

/** A ball of 30 mm on a flat layer of 6 mm. */
struct Ball {
  std::string fixed = "{plane: {y0: 6 mm}, extent: 200 mm}", moving = "{sphere: {R: 30 mm}}";
  std::string material = "{E: 463 MPa, nu: 0.46}", thickness = "6 mm", strain = "small", correction = "energy";
  std::string rectangle = "-10 mm, 10 mm, -10 mm, 10 mm";
  int cells = 20;
  std::string rx = "{prescribed: 0 deg}", ry = "{prescribed: 0 deg}", rz = "{prescribed: 0 deg}", x = "{prescribed: 0 mm}", y = "free", z = "{prescribed: 0 mm}";
  std::string force = "[0 N, -1000 N, 0 N]", point = "0 mm, 0 mm, 0 mm", moment = "[0 N m, 0 N m, 0 N m]";
  std::string gravity = "none", more;
  double mass_kg = 3;
  double duration_s = 0.1, interval_s = 2.5e-4;
  std::string integrator = "cpodes", accuracy = "1e-4", extra;
  bool gait = false, settle = true;
};

scene::Scene makeBall(const Workshop& shop, const Ball& ball) {
  return shop.parse(fill(R"(genu: 1
surfaces: {layer: <fixed>, ball: <moving>}
materials: {layer: <material>}
contact:
  ball:
    fixed: {surface: layer, thickness: <thickness>}
    moving: {surface: ball}
    material: layer
    strain: <strain>
    correction: <correction>
    compartments: {all: {rectangle: "<rectangle>", grid: <cells>x<cells>}}
model:
  urdf: <urdf>
  joint: knee
  gravity: <gravity>
  coordinates: {rx: <rx>, ry: <ry>, rz: <rz>, x: <x>, y: <y>, z: <z>}
loads:
  press: {body: femur, frame: tibia, force: <force>, point: {at: "<point>"}}
  turn: {body: femur, frame: tibia, moment: <moment>}
<more>analysis:
  static: {}
<gait>)",
                         {{"gait", ball.gait ? fmt::format("  gait: {{duration: {} s, output_interval: {} s, accuracy: {}, integrator: {}, settle_first: {}{}}}\n", number(ball.duration_s),
                                                           number(ball.interval_s), ball.accuracy, ball.integrator, ball.settle, ball.extra)
                                             : ""},
                          {"fixed", ball.fixed},
                          {"moving", ball.moving},
                          {"material", ball.material},
                          {"thickness", ball.thickness},
                          {"strain", ball.strain},
                          {"correction", ball.correction},
                          {"rectangle", ball.rectangle},
                          {"cells", std::to_string(ball.cells)},
                          {"urdf", shop.writeFloating(ball.mass_kg, 0)},
                          {"gravity", ball.gravity},
                          {"rx", ball.rx},
                          {"ry", ball.ry},
                          {"rz", ball.rz},
                          {"x", ball.x},
                          {"y", ball.y},
                          {"z", ball.z},
                          {"force", ball.force},
                          {"point", ball.point},
                          {"moment", ball.moment},
                          {"more", ball.more}}));
}

Ball makeDrop(double height_m) {
  Ball ball;
  ball.gait = true;
  ball.settle = false;
  ball.gravity = "\"0 m/s^2, -9.81 m/s^2, 0 m/s^2\"";
  ball.force = "[0 N, 0 N, 0 N]";
  ball.y = fmt::format("{{free: {{start: {} mm}}}}", number(36 + 1e3 * height_m));
  // The first touch after the fall, then two flights of twice its time.
  ball.duration_s = 5 * std::sqrt(2 * height_m / 9.81) + 0.01;
  ball.interval_s = ball.duration_s / 400;
  return ball;
}

Knee makeKneeDrop(double height_m) {
  Knee knee;
  knee.gait = true;
  knee.settle = false;
  knee.gravity = "\"0 m/s^2, -9.81 m/s^2, 0 m/s^2\"";
  knee.load = "0 N";
  knee.rz = "0 deg";
  knee.ry = "0 deg";
  knee.x = "0 mm";
  knee.y = fmt::format("{{free: {{start: {} mm}}}}", number(38 + 1e3 * height_m));
  knee.rx = "{free: {start: 0.2 deg}}";
  knee.duration_s = 3 * std::sqrt(2 * height_m / 9.81) + 0.01;
  knee.interval_s = knee.duration_s / 400;
  return knee;
}

// -- other scenes -------------------------------------------------------------------------------------------------

/** A ball of a mass on a layer that a body of another mass carries, which hangs in a spring. */
scene::Scene makeChain(const Workshop& shop, double base_kg, double ball_kg) {
  const std::string load = shop.writeFunction("chain_load.csv", 0.1, 41, [](double t) { return -200 + 100 * std::cos(2 * kPi * t / 0.1); });
  return shop.parse(fill(R"(genu: 1
surfaces: {layer: {plane: {y0: 6 mm}, extent: 100 mm}, ball: {sphere: {R: 30 mm}}}
materials: {layer: {E: 463 MPa, nu: 0.46}}
contact:
  pair:
    fixed: {body: base, surface: layer, thickness: 6 mm}
    moving: {body: ball, surface: ball}
    material: layer
    correction: energy
    compartments: {all: {rectangle: "-5 mm, 5 mm, -5 mm, 5 mm", grid: 20x20}}
model:
  urdf: <urdf>
  joints: {lift: {translation: {free: {start: 0 mm}}}, hop: {translation: {free: {start: 35.98 mm}}}}
springs:
  hanger: {stiffness: 100 N/mm, rest: {length: 100 mm}, acts: both, path: [{body: ground, at: "0 mm, -100 mm, 0 mm"}, {body: base, at: "0 mm, 0 mm, 0 mm"}]}
loads:
  press: {body: ball, frame: ground, force: [0 N, <load>, 0 N]}
analysis:
  static: {}
  gait: {duration: 0.1 s, output_interval: 0.25 ms}
)",
                         {{"urdf", shop.writeChain(base_kg, ball_kg)}, {"load", table(load, "N")}}));
}

/** The ball above its layer, pulled up by a muscle whose excitation jumps within `rise_s`. */
scene::Scene makeMuscle(const Workshop& shop, double rise_s, const std::string& tendon) {
  // Half a wave, and rows that grow apart on both sides of it: the spline through them hardly overshoots.
  std::vector<std::pair<double, double>> rows;
  constexpr double kStart_s = 0.01, kEnd_s = 0.1;
  constexpr int kRows = 20;
  std::vector<double> before;
  for (double gap = rise_s / kRows; gap < kStart_s; gap *= 1.5) before.push_back(kStart_s - gap);
  rows.emplace_back(0, 0.05);
  for (auto t = before.rbegin(); t != before.rend(); ++t) rows.emplace_back(*t, 0.05);
  for (int i = 0; i <= kRows; ++i) rows.emplace_back(kStart_s + rise_s * i / kRows, 0.05 + 0.95 * std::pow(std::sin(0.5 * kPi * i / kRows), 2));
  for (double gap = rise_s / kRows; kStart_s + rise_s + gap < kEnd_s; gap *= 1.5) rows.emplace_back(kStart_s + rise_s + gap, 1);
  rows.emplace_back(kEnd_s + rise_s, 1);
  const std::string file = shop.writeTable(fmt::format("excitation_{:.9g}.csv", rise_s), rows);
  Ball ball;
  ball.gait = true;
  ball.force = "[0 N, -50 N, 0 N]";
  ball.more = fmt::format(
      "muscles:\n  lifter: {{max_force: 300 N, fibre_length: 120 mm, tendon_length: 110 mm, tendon: {}, pennation: 12 deg, excitation: {}, "
      "path: [{{body: tibia, at: \"0 mm, 270 mm, 0 mm\"}}, {{body: femur, at: \"0 mm, 0 mm, 0 mm\"}}]}}\n",
      tendon, table(file, "1"));
  return makeBall(shop, ball);
}

/** A ligament, a spring over a wrap and two muscles on a knee that is let go above its contact; stiffnesses and strengths times `factor`. */
scene::Scene makeAllElements(const Workshop& shop, double factor) {
  Knee knee = makeKneeDrop(1e-3);
  knee.duration_s = 0.05;
  knee.interval_s = 1.25e-4;
  knee.more = fill(R"(poses: {start: {knee: "0 deg, 0 deg, 0 deg, 0 mm, 39 mm, 0 mm"}}
wraps: {ball: {body: tibia, sphere: {R: 15 mm}, pose: "0 deg, 0 deg, 0 deg, -30 mm, -10 mm, 0 mm"}}
ligaments:
  medial: {stiffness: <k> N, slack: {strain: 3 %, pose: start}, path: [{body: femur, at: "0 mm, 0 mm, 45 mm"}, {body: tibia, at: "0 mm, -40 mm, 40 mm"}]}
  lateral: {stiffness: <k> N, slack: {strain: -2 %, pose: start}, path: [{body: femur, at: "0 mm, 0 mm, -45 mm"}, {body: tibia, at: "0 mm, -40 mm, -40 mm"}]}
springs:
  strap: {stiffness: <s> N/mm, rest: {force: 5 N, pose: start}, path: [{body: femur, at: "-45 mm, 0 mm, 0 mm"}, {wrap: ball}, {body: tibia, at: "-30 mm, -60 mm, 5 mm"}]}
muscles:
  rigid: {max_force: <f> N, fibre_length: 90 mm, tendon_length: 120 mm, excitation: 0.3, path: [{body: tibia, at: "10 mm, -170 mm, 10 mm"}, {body: femur, at: "10 mm, 0 mm, 10 mm"}]}
  compliant: {max_force: <f> N, fibre_length: 90 mm, tendon_length: 120 mm, tendon: compliant, excitation: 0.3, path: [{body: tibia, at: "10 mm, -170 mm, -10 mm"}, {body: femur, at: "10 mm, 0 mm, -10 mm"}]}
)",
                   {{"k", number(3000 * factor)}, {"s", number(20 * factor)}, {"f", number(300 * factor)}});
  return makeKnee(shop, knee);
}

std::vector<double> decades(double from, double to, int perDecade) {
  std::vector<double> values;
  const int count = static_cast<int>(std::lround(std::log10(to / from) * perDecade));
  for (int i = 0; i <= count; ++i) values.push_back(std::stod(fmt::format("{:.2g}", from * std::pow(10, static_cast<double>(i) / perDecade))));
  return values;
}

}  // namespace

std::vector<BuiltInScene> listBuiltInScenes(const fs::path& folder) {
  const Workshop shop(folder);
  Knee walking = makeWalking(shop), atRest;
  walking.correction = atRest.correction = "midsurface";  // the paper's, which both rules have
  Knee largeStrain = walking, powerLaw = walking;
  largeStrain.strain = "large";
  powerLaw.material = "{law: power-law, eps0: 0.0597, p0: 18.4 MPa, n: 3, nu: 0.46}";
  atRest.load = newtons(-kBodyWeight_N);
  return {{"knee-walking", makeKnee(shop, walking)},
          {"knee-walking-large-strain", makeKnee(shop, largeStrain)},
          {"knee-walking-power-law", makeKnee(shop, powerLaw)},
          {"knee-static", makeKnee(shop, atRest)}};
}

std::vector<StabilityAxis> listBuiltInAxes(const fs::path& folder, bool full) {
  const Workshop shop(folder);
  std::vector<StabilityAxis> axes;
  const auto add = [&](std::string name, std::string scene, std::string unit, Scale scale, std::vector<double> values, std::function<scene::Scene(double)> make,
                       std::function<scene::Scene(double)> reference = {}) {
    axes.push_back({std::move(name), std::move(scene), std::move(unit), scale, std::move(values), std::move(make), std::move(reference), 25000});
  };
  const auto pick = [&](std::vector<double> quick, std::vector<double> all) { return full ? std::move(all) : std::move(quick); };
  /** One axis of the walking knee, and one of the same knee at rest. */
  const auto addKnee = [&](const std::string& name, const std::string& unit, Scale scale, const std::vector<double>& values, const std::function<void(Knee&, double)>& change) {
    add(name, "knee, static", unit, scale, values, [=](double v) {
      Knee knee;
      change(knee, v);
      return makeKnee(shop, knee);
    });
    add(name, "knee, walking", unit, scale, values, [=](double v) {
      Knee knee = makeWalking(shop);
      change(knee, v);
      return makeKnee(shop, knee);
    });
  };

  addKnee("modulus", "MPa", Scale::logarithmic, pick({1, 10, 100, 1000, 1e4, 2e5}, {1, 2, 5, 10, 30, 100, 300, 1000, 3000, 1e4, 3e4, 1e5, 2e5}),
          [](Knee& knee, double E) { knee.material = "{E: " + number(E) + " MPa, nu: 0.46}"; });
  addKnee("Poisson's ratio", "", Scale::toHalf, pick({0, 0.46, 0.499, 0.4999, 0.5}, {0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.49999, 0.499999, 0.5}),
          [](Knee& knee, double nu) { knee.material = "{E: 463 MPa, nu: " + number(nu) + "}"; });
  addKnee("layer", "mm", Scale::logarithmic, pick({0.05, 0.5, 5, 20}, {0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 100}),
          [](Knee& knee, double h) { knee.thickness = number(h) + " mm"; });
  addKnee("exponent of the power law", "", Scale::logarithmic, pick({1, 3, 20}, {1, 1.5, 2, 3, 5, 10, 20, 50}),
          [](Knee& knee, double n) { knee.material = "{law: power-law, eps0: 0.0597, p0: 18.4 MPa, n: " + number(n) + ", nu: 0.46}"; });
  add("load", "knee, static", "body weights", Scale::logarithmic, pick({0, 0.01, 1, 50}, {0, 1e-6, 1e-4, 0.01, 0.1, 1, 3, 10, 50, 200, 1000}), [=](double v) {
    Knee knee;
    knee.load = newtons(-kBodyWeight_N * v);
    return makeKnee(shop, knee);
  });
  add("load", "knee, walking", "body weights", Scale::logarithmic, pick({0.01, 1, 10, 50}, {1e-4, 0.01, 0.1, 1, 3, 10, 20, 50, 100, 200}),
      [=](double v) { return makeKnee(shop, makeWalking(shop, v)); });
  add("step of the load within 1 ms", "knee, let go", "body weights", Scale::logarithmic, pick({0.1, 3, 50}, {0.01, 0.1, 1, 3, 10, 50}), [=](double v) {
    Knee knee;
    knee.gait = true;
    knee.duration_s = 0.05;
    knee.load = table(shop.writeFunction(fmt::format("step_{:.9g}.csv", v), 0.05, 501,
                                         [&](double t) { return -350 - kBodyWeight_N * v * std::pow(std::sin(0.5 * kPi * std::min(1.0, std::max(0.0, (t - 0.01) / 1e-3))), 2); }),
                      "N");
    return makeKnee(shop, knee);
  });
  add("impulse within 1 ms", "knee, hit", "N s", Scale::logarithmic, pick({0.1, 1, 10}, {0.01, 0.1, 0.3, 1, 3, 10, 30}), [=](double v) {
    Knee knee;
    knee.gait = true;
    knee.duration_s = 0.05;
    // The area of sin^2 over 1 ms is 0.5 ms.
    knee.load = table(shop.writeFunction(fmt::format("impulse_{:.9g}.csv", v), 0.05, 501,
                                         [&](double t) { return -350 - v / 0.5e-3 * (t > 0.01 && t < 0.011 ? std::pow(std::sin(kPi * (t - 0.01) / 1e-3), 2) : 0.0); }),
                      "N");
    return makeKnee(shop, knee);
  });
  add("mass", "knee, walking", "kg", Scale::logarithmic, pick({1e-3, 0.1, 10, 500}, {1e-6, 1e-3, 0.01, 0.1, 1, 10, 100, 500, 1e4}), [=](double v) {
    Knee knee = makeWalking(shop);
    knee.mass_kg = v;
    return makeKnee(shop, knee);
  });
  add("ratio of masses", "ball on a carried layer", "", Scale::logarithmic, pick({1e-6, 1, 1e6}, decades(1e-6, 1e6, 1)),
      [=](double v) { return makeChain(shop, std::sqrt(v), 1 / std::sqrt(v)); });
  add("drop", "ball", "mm", Scale::logarithmic, pick({0.1, 1, 50}, {0.001, 0.01, 0.1, 1, 5, 10, 50, 100, 500}), [=](double v) { return makeBall(shop, makeDrop(1e-3 * v)); });
  add("drop", "knee, tilted by 0.2 deg", "mm", Scale::logarithmic, pick({0.1, 1, 50}, {0.001, 0.01, 0.1, 1, 5, 10, 50, 100}),
      [=](double v) { return makeKnee(shop, makeKneeDrop(1e-3 * v)); });
  const auto pulse = [=](double t) { return t > 0.01 && t < 0.015 ? std::pow(std::sin(kPi * (t - 0.01) / 5e-3), 2) : 0.0; };
  add("lift-off of both sides", "knee, pulled for 5 ms", "N", Scale::logarithmic, pick({100, 1000, 10000}, {100, 300, 1000, 3000, 10000, 30000}), [=](double v) {
    Knee knee;
    knee.gait = true;
    knee.load = table(shop.writeFunction(fmt::format("lift_{:.9g}.csv", v), 0.1, 401, [&](double t) { return -300 + v * pulse(t); }), "N");
    return makeKnee(shop, knee);
  });
  add("lift-off of one side", "knee, turned for 5 ms", "N m", Scale::logarithmic, pick({3, 30, 300}, {3, 10, 30, 100, 300, 1000}), [=](double v) {
    Knee knee;
    knee.gait = true;
    knee.load = "-300 N";
    knee.moment = table(shop.writeFunction(fmt::format("turn_{:.9g}.csv", v), 0.1, 401, [&](double t) { return v * pulse(t); }), "N m");
    return makeKnee(shop, knee);
  });
  add("load beside the middle", "knee, static", "mm", Scale::linear, pick({0, 20, 40}, {0, 5, 10, 15, 20, 22, 24, 26, 30, 40}), [=](double v) {
    Knee knee;
    knee.load = "-1000 N";
    scene::Scene scene = makeKnee(shop, knee);
    scene.loads[0].point_m[2] = 1e-3 * v;
    return scene;
  });
  // The layer ends at 10 mm; the ball is led over its edge.
  add("contact beside the edge", "ball, static", "mm", Scale::linear, pick({0, 8, 12, 20}, {0, 2, 4, 6, 8, 9, 10, 11, 12, 15, 20}), [=](double v) {
    Ball ball;
    ball.fixed = "{plane: {y0: 6 mm}, extent: 10 mm}";
    ball.x = "{prescribed: " + number(v) + " mm}";
    return makeBall(shop, ball);
  });
  const auto makeRectangle = [=](double half_mm, int cells) {
    Ball ball;
    ball.rectangle = fmt::format("-{0} mm, {0} mm, -{0} mm, {0} mm", number(half_mm));
    ball.cells = cells;
    return makeBall(shop, ball);
  };
  add("half of the rectangle's side", "ball, static", "mm", Scale::logarithmic, pick({0.5, 2, 10}, {0.2, 0.5, 1, 1.5, 2, 3, 5, 10, 20, 30}), [=](double v) { return makeRectangle(v, 20); },
      [=](double) { return makeRectangle(10, 80); });
  add("penetration over thickness", "ball pressed in, small strain", "", Scale::linear, pick({0.1, 0.9, 1.1}, {0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.94, 0.96, 0.99, 1, 1.1, 1.5}), [=](double v) {
    Ball ball;
    ball.rectangle = "-25 mm, 25 mm, -25 mm, 25 mm";
    ball.cells = 30;
    ball.y = "{prescribed: " + number(36 - 6 * v) + " mm}";
    ball.z = "free";
    ball.force = "[0 N, 0 N, 0 N]";
    return makeBall(shop, ball);
  });
  add("penetration over thickness", "ball pressed in, large strain", "", Scale::linear, pick({0.1, 0.9, 1.1}, {0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.94, 0.96, 0.99, 1, 1.1, 1.5}), [=](double v) {
    Ball ball;
    ball.strain = "large";
    ball.rectangle = "-25 mm, 25 mm, -25 mm, 25 mm";
    ball.cells = 30;
    ball.y = "{prescribed: " + number(36 - 6 * v) + " mm}";
    ball.z = "free";
    ball.force = "[0 N, 0 N, 0 N]";
    return makeBall(shop, ball);
  });
  add("radius of the dish over the ball's, less 1", "ball in a dish, static", "", Scale::logarithmic, pick({1e-4, 0.01, 1}, decades(1e-6, 100, 1)), [=](double v) {
    Ball ball;
    ball.fixed = fmt::format("{{dish: {{y0: 6 mm, Rs: {0} mm, Rf: {0} mm}}, extent: 25 mm}}", number(30 * (1 + v)));
    ball.z = "free";
    return makeBall(shop, ball);
  });
  add("radius of a nearly flat body", "on a flat layer, static", "m", Scale::logarithmic, pick({0.1, 10, 1e4}, decades(0.1, 1e8, 1)), [=](double v) {
    Ball ball;
    ball.moving = fmt::format("{{paraboloid: {{y0: 0 mm, Rx: {0} m, Rz: {0} m}}, extent: 50 mm}}", number(v));
    ball.rx = "free";
    ball.point = "0 mm, 0 mm, 1 mm";
    return makeBall(shop, ball);
  });

  const auto reference = [=](double) {
    Knee knee = makeWalking(shop);
    knee.integrator = "generalized-alpha";
    knee.extra = ", step: 0.01 ms";
    return makeKnee(shop, knee);
  };
  for (const OdeIntegratorKind& kind : listOdeIntegrators()) {
    const bool slow = kind.name == "arkode-dirk" || kind.name == "cvode-adams" || kind.name == "implicit-euler";
    if (slow && !full) continue;
    const bool fixed = kind.step == OdeIntegratorKind::Step::fixed;
    add(fixed ? "step" : "accuracy", "knee, walking, " + kind.name, fixed ? "ms" : "", Scale::logarithmic,
        fixed ? pick({0.1, 1, 10, 100}, {0.001, 0.01, 0.1, 0.5, 1, 2, 5, 10, 30, 100, 1000})
              : pick({1e-8, 1e-6, 1e-4, 1e-3, 1e-2}, {1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2, 1}),
        [=](double v) {
          Knee knee = makeWalking(shop);
          knee.integrator = kind.name;
          if (fixed) {
            knee.extra = ", step: " + number(v) + " ms";
          } else {
            knee.accuracy = number(v);
          }
          return makeKnee(shop, knee);
        },
        reference);
  }
  // The same where everything happens within a millisecond.
  add("accuracy", "ball dropped from 1 mm, cpodes", "", Scale::logarithmic, pick({1e-8, 1e-6, 1e-4, 1e-3}, {1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3}), [=](double v) {
    Ball ball = makeDrop(1e-3);
    ball.accuracy = number(v);
    return makeBall(shop, ball);
  });
  add("angle from gimbal lock", "ball that turns about x", "deg", Scale::logarithmic, pick({1e-6, 1e-3, 1, 90}, {0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 0.01, 0.1, 1, 10, 90}), [=](double v) {
    Ball ball;
    ball.gait = true;
    ball.settle = false;
    ball.duration_s = 0.05;
    ball.ry = "{prescribed: " + number(90 - v) + " deg}";
    ball.rx = ball.rz = "free";
    ball.y = "{prescribed: 35.9 mm}";
    ball.moment = "[0.5 N m, 0.2 N m, 0 N m]";
    return makeBall(shop, ball);
  });
  add("swing through gimbal lock", "ball led by ry", "deg", Scale::logarithmic, pick({0.01, 1, 30}, {1e-4, 0.01, 0.1, 1, 10, 30}), [=](double v) {
    Ball ball;
    ball.gait = true;
    ball.settle = false;
    ball.duration_s = 0.05;
    ball.y = "{prescribed: 35.9 mm}";
    ball.moment = "[0.5 N m, 0 N m, 0 N m]";
    ball.ry = "{prescribed: " + table(shop.writeFunction(fmt::format("swing_{:.9g}.csv", v), 0.05, 41, [&](double t) { return 90 - v * std::cos(kPi * t / 0.05); }), "deg") + "}";
    ball.rx = ball.rz = "free";
    return makeBall(shop, ball);
  });
  const auto makeLigament = [=](double strain, bool gait) {
    Ball ball;
    ball.gait = gait;
    ball.settle = false;
    ball.duration_s = 0.05;
    ball.y = "{free: {start: 36.5 mm}}";
    ball.gravity = "\"0 m/s^2, -9.81 m/s^2, 0 m/s^2\"";
    ball.force = "[0 N, 0 N, 0 N]";
    ball.more = fmt::format(
        "poses: {{start: {{knee: \"0 deg, 0 deg, 0 deg, 0 mm, 36.5 mm, 0 mm\"}}}}\nligaments:\n  band: {{stiffness: 4000 N, slack: {{strain: {} %, pose: start}}, "
        "path: [{{body: tibia, at: \"0 mm, -20 mm, 0 mm\"}}, {{body: femur, at: \"0 mm, 0 mm, 0 mm\"}}]}}\n",
        number(strain));
    return makeBall(shop, ball);
  };
  add("strain of a ligament at the start", "ball, static", "%", Scale::linear, pick({-50, 0, 50, 99}, {-100, -99, -50, -10, 0, 3, 10, 30, 50, 80, 99, 100}),
      [=](double v) { return makeLigament(v, false); });
  add("strain of a ligament at the start", "ball, let go", "%", Scale::linear, pick({-50, 0, 50, 99}, {-100, -99, -50, -10, 0, 3, 10, 30, 50, 80, 99, 100}),
      [=](double v) { return makeLigament(v, true); });
  for (const char* tendon : {"rigid", "compliant"}) {
    add("rise of an excitation from 0.05 to 1", fmt::format("ball pulled by a muscle, {} tendon", tendon), "ms", Scale::logarithmic, pick({0.01, 1, 50}, {0.001, 0.01, 0.1, 1, 10, 50}),
        [=](double v) { return makeMuscle(shop, 1e-3 * v, tendon); });
  }
  add("stiffness and strength of all elements", "knee with ligaments, spring, muscles", "times", Scale::logarithmic, pick({0.1, 1, 100}, {1e-3, 0.01, 0.1, 1, 10, 100, 1000}),
      [=](double v) { return makeAllElements(shop, v); });
  return axes;
}

std::vector<DriftCase> listDriftCases(const fs::path& folder, bool full) {
  const Workshop shop(folder);
  std::vector<DriftCase> cases;
  // The best there is for motion without stiffness and damping.
  const auto kinds = listOdeIntegrators();
  const bool adams = std::any_of(kinds.begin(), kinds.end(), [](const OdeIntegratorKind& kind) { return kind.name == "cvode-adams"; });
  for (const char* correction : {"energy", "midsurface"}) {
    // A soft layer, so that minutes are thousands of vibrations and not millions; the ball never leaves it and rocks across the dish.
    Ball ball;
    ball.gait = true;
    ball.settle = false;
    ball.gravity = "\"0 m/s^2, -9.81 m/s^2, 0 m/s^2\"";
    ball.force = "[0 N, 0 N, 0 N]";
    ball.fixed = "{dish: {y0: 6 mm, Rs: 60 mm, Rf: 60 mm}, extent: 25 mm}";
    ball.material = "{E: 1 MPa, nu: 0.46}";
    ball.cells = 12;
    ball.y = "{free: {start: 36.15 mm}}";
    ball.z = "{free: {start: 3 mm}}";
    ball.correction = correction;
    ball.integrator = adams ? "cvode-adams" : "cpodes";
    ball.extra = adams ? "" : ", max_order: 5";
    ball.extra += ", max_steps: 100000000";
    ball.accuracy = "1e-9";
    ball.duration_s = full ? 600 : 3;
    ball.interval_s = ball.duration_s / 600;
    cases.push_back({fmt::format("ball in a dish, correction: {}", correction), makeBall(shop, ball)});
  }
  return cases;
}

std::vector<StabilityAxis> listSceneAxes(const scene::Scene& scene, const fs::path& folder, bool full) {
  if (!scene.model) throw InputError(scene.file.string() + ": verify needs a model: without one nothing is run");
  if (scene.contacts.empty()) throw InputError(scene.file.string() + ": verify needs contact: there is no layer to vary");
  std::vector<StabilityAxis> axes;
  const auto add = [&](std::string name, std::string unit, Scale scale, std::vector<double> values, std::function<void(scene::Scene&, double)> change) {
    axes.push_back({std::move(name), scene.gait ? "gait" : "static", std::move(unit), scale, std::move(values),
                    [scene, change](double v) {
                      scene::Scene changed = scene;
                      if (changed.staticAnalysis) changed.staticAnalysis->search.reset();  // one equilibrium each
                      if (changed.gait) {
                        // Vibrations that lie between frames would be missing in the work, and what the sums miss would not be seen.
                        changed.gait->outputInterval_s = std::min(changed.gait->outputInterval_s, changed.gait->duration_s / 1000);
                        changed.gait->errorEstimate = false;  // measured against a reference
                      }
                      change(changed, v);
                      return changed;
                    }});
  };
  const auto pick = [&](std::vector<double> quick, std::vector<double> all) { return full ? std::move(all) : std::move(quick); };
  const auto forMaterials = [](scene::Scene& changed, const std::function<void(contact::Material&)>& change) {
    for (scene::ContactSpec& contact : changed.contacts) {
      change(contact.definition.material);
      if (contact.definition.movingMaterial) change(*contact.definition.movingMaterial);
      contact.definition.material.validate();
    }
  };
  const auto& first = scene.contacts.front().definition;
  add("modulus", "times", Scale::logarithmic, pick({1e-2, 1, 1e2}, {1e-3, 1e-2, 0.1, 0.3, 1, 3, 10, 100, 1e3}), [=](scene::Scene& s, double v) {
    forMaterials(s, [v](contact::Material& m) {
      m.E_Pa *= v;
      m.p0_Pa *= v;
    });
  });
  add("Poisson's ratio", "", Scale::toHalf, pick({0, 0.499, 0.5}, {0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.5}),
      [=](scene::Scene& s, double v) { forMaterials(s, [v](contact::Material& m) { m.nu = v; }); });
  const auto hasConstant = [](const contact::Thickness& t) { return std::holds_alternative<contact::ConstantThickness>(t.source); };
  if (hasConstant(first.fixedThickness) || hasConstant(first.movingThickness)) {
    add("layer", "times", Scale::logarithmic, pick({0.01, 1, 10}, {1e-3, 0.01, 0.03, 0.1, 0.3, 1, 3, 10}), [](scene::Scene& s, double v) {
      for (scene::ContactSpec& contact : s.contacts) {
        for (contact::Thickness* t : {&contact.definition.fixedThickness, &contact.definition.movingThickness}) {
          if (auto* constant = std::get_if<contact::ConstantThickness>(&t->source)) constant->h_m *= v;
        }
      }
    });
  }
  if (first.material.law != contact::MaterialLaw::linear) {
    add("exponent of the power law", "", Scale::logarithmic, pick({1, 5, 20}, {1, 2, 3, 5, 10, 20}), [=](scene::Scene& s, double v) {
      forMaterials(s, [v](contact::Material& m) { m.n = v; });
    });
  }
  if (!scene.loads.empty() || !scene.generalizedLoads.empty()) {
    add("load", "times", Scale::logarithmic, pick({0.1, 1, 10}, {0, 0.01, 0.1, 0.3, 1, 3, 10, 30}), [](scene::Scene& s, double v) {
      const auto scale = [v](scene::TimeFunction& f) {
        if (auto* constant = std::get_if<double>(&f)) {
          *constant *= v;
        } else {
          for (double& y : std::get<scene::TimeSeries>(f).value) y *= v;
        }
      };
      for (scene::LoadSpec& load : s.loads) {
        for (auto& f : load.force_N) scale(f);
        for (auto& f : load.moment_Nm) scale(f);
      }
      for (scene::GeneralizedLoadSpec& load : s.generalizedLoads) scale(load.value);
    });
  }
  if (!scene.gait) return axes;
  const std::string urdf = io::readFile(scene.model->urdf);
  add("mass", "times", Scale::logarithmic, pick({1e-2, 1, 1e2}, {1e-3, 1e-2, 0.1, 1, 10, 100, 1e3}), [urdf, folder](scene::Scene& s, double v) {
    // Masses and inertias alike, in a copy of the file.
    static const std::regex kAttribute("(<mass\\s+value|\\bi[xyz][xyz])(\\s*=\\s*)([\"'])([^\"']*)[\"']");
    std::string text;
    auto at = urdf.cbegin();
    for (std::sregex_iterator it(urdf.begin(), urdf.end(), kAttribute), end; it != end; ++it) {
      text.append(at, (*it)[0].first);
      text += (*it)[1].str() + (*it)[2].str() + (*it)[3].str() + number(v * std::stod((*it)[4].str())) + (*it)[3].str();
      at = (*it)[0].second;
    }
    text.append(at, urdf.cend());
    s.model->urdf = folder / fmt::format("mass_{:.9g}.urdf", v);
    io::writeFileAtomically(s.model->urdf, text);
  });
  add("accuracy", "", Scale::logarithmic, pick({1e-6, 1e-4, 1e-3}, {1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3}), [](scene::Scene& s, double v) {
    s.gait->accuracy = v;
    if (s.gait->step_s > 0) {  // of a fixed step: the scene's integrator has no accuracy
      s.gait->integrator = "cpodes";
      s.gait->step_s = 0;
      s.gait->maxOrder = 0;
    }
  });
  const double own = scene.gait->duration_s;
  add("step", "ms", Scale::logarithmic, pick({1e3 * 1e-3 * own, 1e3 * 1e-2 * own, 1e3 * 0.1 * own}, {1e3 * 1e-4 * own, 1e3 * 1e-3 * own, 1e3 * 3e-3 * own, 1e3 * 1e-2 * own, 1e3 * 0.1 * own, 1e3 * own}),
      [](scene::Scene& s, double v) {
        s.gait->integrator = "generalized-alpha";
        s.gait->maxOrder = 0;
        s.gait->step_s = 1e-3 * v;
      });
  return axes;
}

}  // namespace genu::model
