#include "genu/model/ForceElement.h"

#include <map>
#include <stdexcept>

#include "MakeForceElement.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {

namespace {

std::map<std::string, ForceElementMaker>& makers() {
  static std::map<std::string, ForceElementMaker> all = {{"ligaments", makeLigament}, {"springs", makeSpring}, {"muscles", makeMuscle}};
  return all;
}

}  // namespace

bool registerForceElement(const std::string& keyword, scene::ElementReader reader, ForceElementMaker maker) {
  scene::registerElementReader(keyword, std::move(reader));
  makers()[keyword] = std::move(maker);
  return true;
}

std::unique_ptr<ForceElement> makeForceElement(const std::shared_ptr<const scene::ElementDefinition>& definition, KneeSystem& knee) {
  const auto found = makers().find(definition->keyword);
  if (found == makers().end()) {
    throw InputError(knee.scene().where(definition->key()) + ": this program has no force element \"" + definition->keyword + "\"");
  }
  return found->second(definition, knee);
}

}  // namespace genu::model
