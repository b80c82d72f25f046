#pragma once

#include <stdexcept>

namespace genu {

/** Wrong input by the user: the message names file, line, key, value, unit and what is allowed. Exit code 2. */
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/** The computation failed or has no meaning (no convergence, full penetration, contact never made); the message says
 what to try. Exit code 3. */
class ComputationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace genu
