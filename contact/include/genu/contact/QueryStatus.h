#pragma once

#include <cstdint>

namespace genu::contact {

/** How a closest-point query ended. */
enum class QueryStatus : std::uint8_t {
  converged,     ///< foot inside the surface: the distance is along the surface normal
  onBoundary,    ///< foot on the open border: the surface has no material beyond it, there is no contact
  notConverged,  ///< the residual stayed above the tolerance; the distance is an upper bound
};

/** How a ray query ended. */
enum class HitStatus : std::uint8_t {
  hit,           ///< the residual is below the tolerance
  missed,        ///< no entering crossing next to the origin, neither ahead nor behind
  notConverged,  ///< bad input, or Newton failed where a crossing may be (the ray grazes)
};

}  // namespace genu::contact
