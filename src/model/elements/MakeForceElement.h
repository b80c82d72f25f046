#pragma once

#include <memory>

#include "genu/model/ForceElement.h"

namespace genu::model {

/** Through the maker that was registered for the definition's keyword. */
std::unique_ptr<ForceElement> makeForceElement(const std::shared_ptr<const scene::ElementDefinition>& definition, KneeSystem& knee);

std::unique_ptr<ForceElement> makeLigament(std::shared_ptr<const scene::ElementDefinition> definition, KneeSystem& knee);
std::unique_ptr<ForceElement> makeSpring(std::shared_ptr<const scene::ElementDefinition> definition, KneeSystem& knee);
std::unique_ptr<ForceElement> makeMuscle(std::shared_ptr<const scene::ElementDefinition> definition, KneeSystem& knee);

}  // namespace genu::model
