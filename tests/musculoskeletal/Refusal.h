#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace genu::musculoskeletal {

/** What a refused call says. */
inline std::string message(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

}  // namespace genu::musculoskeletal
