#pragma once

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace genu::musculoskeletal {

/** @throws std::invalid_argument for a value that is not finite, or where `holds` is false */
inline void require(bool holds, const char* what, double value, const char* unit, const char* allowed) {
  if (holds && std::isfinite(value)) return;
  std::ostringstream out;
  out.precision(10);
  out << what << " = " << value << (*unit != '\0' ? " " : "") << unit << " is not allowed; allowed: " << allowed;
  throw std::invalid_argument(out.str());
}

}  // namespace genu::musculoskeletal
