#include "genu/scene/Elements.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "SceneKeys.h"
#include "genu/scene/Scene.h"

namespace genu::scene {

namespace {

using io::Dimension;
using io::formatNumber;
using io::formatQuantity;

/** Laws refuse with std::invalid_argument; the message gets the key's place. */
template <class Function>
auto callLaw(const SceneNode& node, Function function) -> decltype(function()) {
  try {
    return function();
  } catch (const std::invalid_argument& error) {
    node.fail(error.what());
  }
}

const char* const kTensionExample = "\"force: 20 N\", \"pose: extension\"";

/** {force: ..., pose: ...} */
LigamentDefinition::Tension readTension(const SceneNode& node, ElementContext& context) {
  return {node.get("force", kTensionExample).getNonNegative(Dimension::force),
          context.readPoseName(node.get("pose", kTensionExample))};
}

std::shared_ptr<ElementDefinition> readLigament(const SceneNode& node, ElementContext& context) {
  node.requireKeys({"path", "stiffness", "slack", "toe_strain", "damping"});
  auto result = std::make_shared<LigamentDefinition>();
  const SceneNode stiffness = node.get("stiffness", "\"stiffness: 5000 N\" (per unit strain) or \"stiffness: 150 N/mm\"");
  const std::string text = stiffness.getText("a force per unit strain (N) or a stiffness (N/mm)");
  result->perLength = text.find('/') != std::string::npos;
  result->stiffness = stiffness.getPositive(result->perLength ? Dimension::stiffness : Dimension::force);

  const SceneNode slack = node.get("slack", "\"slack: {length: 30 mm}\", {strain: 0.03, pose: NAME} or {force: 20 N, pose: NAME}");
  slack.requireKeys({"length", "strain", "force", "pose"});
  const auto length = slack.find("length"), strain = slack.find("strain"), force = slack.find("force");
  if (int(length.has_value()) + int(strain.has_value()) + int(force.has_value()) != 1) {
    slack.fail("is given by one of length, strain (with pose) and force (with pose)");
  }
  if (length) {
    if (const auto pose = slack.find("pose")) pose->fail("has no meaning beside length");
    result->slack = LigamentDefinition::Length{length->getPositive(Dimension::length)};
  } else if (strain) {
    const double value = strain->getQuantity(Dimension::dimensionless);
    if (!(value > -1 && value < 1)) strain->fail("is " + formatNumber(value) + "; allowed: -1 < strain < 1");
    result->slack = LigamentDefinition::Strain{value, context.readPoseName(slack.get("pose", "\"pose: extension\""))};
  } else {
    result->slack = readTension(slack, context);
  }
  if (const auto toe = node.find("toe_strain")) {
    result->toeStrain = toe->getQuantity(Dimension::dimensionless);
    if (!(result->toeStrain >= 0 && result->toeStrain < 1)) {
      toe->fail("is " + formatNumber(result->toeStrain) + "; allowed: 0 <= toe strain < 1 (half of OpenSim's transition strain)");
    }
  }
  if (const auto damping = node.find("damping")) result->dampingTime_s = damping->getNonNegative(Dimension::time);
  result->path = context.readPath(node.get("path", "\"path: [{body: femur, at: ...}, {body: tibia, at: ...}]\""));
  return result;
}

std::shared_ptr<ElementDefinition> readSpring(const SceneNode& node, ElementContext& context) {
  node.requireKeys({"path", "stiffness", "rest", "damping", "acts"});
  auto result = std::make_shared<SpringDefinition>();
  result->stiffness_NPerM = node.get("stiffness", "\"stiffness: 180 N/mm\"").getPositive(Dimension::stiffness);
  const SceneNode rest = node.get("rest", "\"rest: {length: 8 mm}\" or {force: 0 N, pose: NAME}");
  rest.requireKeys({"length", "force", "pose"});
  const auto length = rest.find("length");
  if (length.has_value() == rest.find("force").has_value()) rest.fail("is given by either length or force (with pose)");
  if (length) {
    result->restLength_m = length->getNonNegative(Dimension::length);
  } else {
    result->restFromTension = readTension(rest, context);
  }
  if (const auto damping = node.find("damping")) result->damping_NSPerM = damping->getNonNegative(Dimension::damping);
  if (const auto acts = node.find("acts")) result->tensionOnly = acts->getChoice({"tension", "both"}) == 0;
  result->path = context.readPath(node.get("path", "\"path: [{body: femur, at: ...}, {body: tibia, at: ...}]\""));
  return result;
}

TimeFunction readExcitation(const SceneNode& node, ElementContext& context) {
  TimeFunction excitation = context.readTimeFunction(node, Dimension::dimensionless);
  const auto check = [&](double value, const std::string& where) {
    if (!(value >= 0 && value <= 1)) node.fail("is " + formatNumber(value) + where + "; allowed: 0 to 1");
  };
  if (const auto* constant = std::get_if<double>(&excitation)) {
    check(*constant, "");
  } else {
    const TimeSeries& series = std::get<TimeSeries>(excitation);
    for (size_t i = 0; i < series.value.size(); ++i) {
      check(series.value[i], " at " + formatQuantity(series.time_s[i], "s") + " in " + series.source);
    }
  }
  return excitation;
}

TrackingController readTracking(const SceneNode& node, ElementContext& context) {
  node.requireKeys({"coordinate", "target", "gain", "rate_gain", "rest"});
  TrackingController controller;
  const SceneNode coordinate = node.get("coordinate", "\"coordinate: tibiofemoral.rz\"");
  controller.coordinate = context.readCoordinate(coordinate);
  const CoordinateInfo info = listCoordinates(context.getModel(coordinate))[static_cast<size_t>(controller.coordinate)];
  controller.target = context.readTimeFunction(node.get("target", "\"target: -30 deg\""), info.isAngle ? Dimension::angle : Dimension::length);
  controller.gain = node.get("gain", info.isAngle ? "\"gain: -0.05 1/deg\"" : "\"gain: 0.1 1/mm\"")
                        .getQuantity(info.isAngle ? Dimension::inverseAngle : Dimension::inverseLength);
  if (const auto gain = node.find("rate_gain")) {
    controller.rateGain = gain->getQuantity(info.isAngle ? Dimension::inverseAngularSpeed : Dimension::inverseSpeed);
  }
  if (const auto rest = node.find("rest")) controller.rest = readExcitation(*rest, context);
  return controller;
}

std::shared_ptr<ElementDefinition> readMuscle(const SceneNode& node, ElementContext& context) {
  node.requireKeys({"path", "max_force", "fibre_length", "tendon_length", "pennation", "max_velocity", "fibre_damping", "curves", "tendon",
                    "tendon_strain", "passive_strain", "activation", "excitation"});
  auto result = std::make_shared<MuscleDefinition>();
  musculoskeletal::Muscle& muscle = result->muscle;
  const auto curves = node.find("curves");
  if (curves && curves->getChoice({"de-groote", "millard"}) == 1) {
    muscle = musculoskeletal::withMillardParameters(muscle);
    result->activation = musculoskeletal::millardActivation();
  }
  muscle.maxIsometricForce_N = node.get("max_force", "\"max_force: 1000 N\"").getPositive(Dimension::force);
  muscle.optimalFibreLength_m = node.get("fibre_length", "\"fibre_length: 90 mm\" (optimal)").getPositive(Dimension::length);
  muscle.tendonSlackLength_m = node.get("tendon_length", "\"tendon_length: 120 mm\" (slack)").getPositive(Dimension::length);
  if (const auto v = node.find("pennation")) muscle.pennationAtOptimal_rad = v->getNonNegative(Dimension::angle);
  if (const auto v = node.find("max_velocity")) muscle.maxContractionVelocity_perS = v->getPositive(Dimension::frequency);
  if (const auto v = node.find("fibre_damping")) muscle.fibreDamping = v->getNonNegative(Dimension::dimensionless);
  if (const auto v = node.find("tendon_strain")) muscle.curves.tendonStrain = v->getPositive(Dimension::dimensionless);
  if (const auto v = node.find("passive_strain")) muscle.curves.passiveStrain = v->getPositive(Dimension::dimensionless);
  if (const auto v = node.find("tendon")) result->compliantTendon = v->getChoice({"rigid", "compliant"}) == 1;
  if (const auto activation = node.find("activation")) {
    activation->requireKeys({"rise", "fall", "steepness"});
    if (const auto v = activation->find("rise")) result->activation.activationTime_s = v->getPositive(Dimension::time);
    if (const auto v = activation->find("fall")) result->activation.deactivationTime_s = v->getPositive(Dimension::time);
    if (const auto v = activation->find("steepness")) result->activation.steepness = v->getQuantityOrInfinity(Dimension::dimensionless);
    callLaw(*activation, [&] { result->activation.validate(); });
  }
  callLaw(node, [&] { muscle.validate(result->compliantTendon); });
  const SceneNode excitation = node.get("excitation", "\"excitation: 0.1\", a table, or {track: {...}}");
  if (const auto track = excitation.isMap() ? excitation.find("track") : std::nullopt) {
    excitation.requireKeys({"track"});
    const TrackingController controller = readTracking(*track, context);
    result->coordinateName = listCoordinates(context.getModel(*track))[static_cast<size_t>(controller.coordinate)].name;
    result->excitation = controller;
  } else {
    result->excitation = readExcitation(excitation, context);
  }
  result->path = context.readPath(node.get("path", "\"path: [{body: femur, at: ...}, {body: tibia, at: ...}]\""));
  return result;
}

std::map<std::string, ElementReader>& readers() {
  static std::map<std::string, ElementReader> all = {{"ligaments", readLigament}, {"springs", readSpring}, {"muscles", readMuscle}};
  return all;
}

}  // namespace

std::string describePath(const PathDefinition& path) {
  const size_t via = path.points.size() - 2;
  const auto wraps = std::count_if(path.wraps.begin(), path.wraps.end(), [](int wrap) { return wrap >= 0; });
  const bool moving = std::any_of(path.points.begin(), path.points.end(), [](const PathPoint& p) { return p.coordinate >= 0; });
  std::string text = path.points.front().body + " to " + path.points.back().body;
  if (via > 0) text += ", " + std::to_string(via) + (via == 1 ? " point between" : " points between");
  if (moving) text += ", moving points";
  if (wraps > 0) text += ", " + std::to_string(wraps) + (wraps == 1 ? " wrap" : " wraps");
  return text;
}

std::string LigamentDefinition::describe() const {
  std::string text = describePath(path) + "; " + (perLength ? formatQuantity(stiffness, "N/mm") : formatQuantity(stiffness, "N") + " per strain");
  if (const auto* length = std::get_if<Length>(&slack)) text += ", slack length " + formatQuantity(length->length_m, "mm");
  if (const auto* strain = std::get_if<Strain>(&slack)) {
    text += ", strain " + formatQuantity(strain->strain, "%") + " in pose " + strain->pose;
  }
  if (const auto* tension = std::get_if<Tension>(&slack)) {
    text += ", " + formatQuantity(tension->tension_N, "N") + " in pose " + tension->pose;
  }
  if (toeStrain != LigamentDefinition{}.toeStrain) text += ", linear from a strain of " + formatQuantity(toeStrain, "%");
  return text + (dampingTime_s > 0 ? ", damping " + formatQuantity(dampingTime_s, "s") : "");
}

std::string SpringDefinition::describe() const {
  const std::string rest = restFromTension ? formatQuantity(restFromTension->tension_N, "N") + " in pose " + restFromTension->pose
                                           : "rest length " + formatQuantity(restLength_m, "mm");
  return describePath(path) + "; " + formatQuantity(stiffness_NPerM, "N/mm") + ", " + rest + (tensionOnly ? ", tension only" : ", pulls and pushes") +
         (damping_NSPerM > 0 ? ", damping " + formatQuantity(damping_NSPerM, "N s/m") : "");
}

std::string MuscleDefinition::describe() const {
  std::string text = describePath(path) + "; " + formatQuantity(muscle.maxIsometricForce_N, "N") + ", fibres " +
                     formatQuantity(muscle.optimalFibreLength_m, "mm") + " at " + formatQuantity(muscle.pennationAtOptimal_rad, "deg") + ", " +
                     (compliantTendon ? "compliant" : "rigid") + " tendon " +
                     formatQuantity(muscle.tendonSlackLength_m, "mm") + ", excitation ";
  if (std::holds_alternative<TrackingController>(excitation)) return text + "tracks coordinate " + coordinateName;
  const auto& function = std::get<TimeFunction>(excitation);
  const auto* constant = std::get_if<double>(&function);
  return text + (constant != nullptr ? formatNumber(*constant) : std::get<TimeSeries>(function).source);
}

void registerElementReader(const std::string& keyword, ElementReader reader) {
  const std::vector<std::string>& own = listOwnSceneKeys();
  if (std::find(own.begin(), own.end(), keyword) != own.end() || !readers().emplace(keyword, std::move(reader)).second) {
    throw std::invalid_argument("scene keyword \"" + keyword + "\" is taken");
  }
}

std::vector<std::string> listElementKeywords() {
  std::vector<std::string> names;
  for (const auto& entry : readers()) names.push_back(entry.first);
  return names;
}

const ElementReader* findElementReader(const std::string& keyword) {
  const auto found = readers().find(keyword);
  return found == readers().end() ? nullptr : &found->second;
}

}  // namespace genu::scene
