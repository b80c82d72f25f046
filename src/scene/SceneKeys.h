#pragma once

#include <string>
#include <vector>

namespace genu::scene {

/** Keys of a scene file that are not sections of force elements. */
inline const std::vector<std::string>& listOwnSceneKeys() {
  static const std::vector<std::string> keys = {"genu",  "name",  "surfaces", "materials", "contact", "model",
                                                "poses", "wraps", "loads",    "analysis",  "output"};
  return keys;
}

}  // namespace genu::scene
