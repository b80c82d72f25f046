#pragma once

#include <functional>

namespace genu::scene {

/** Called by long computations, often and cheaply: `fraction` in [0, 1]. Returning false asks the computation to stop
 and to hand back what it has. An empty function means: never stop, say nothing. */
using Progress = std::function<bool(double fraction)>;

}  // namespace genu::scene
