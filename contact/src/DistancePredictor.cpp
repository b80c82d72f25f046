#include "detail/DistancePredictor.h"

#include <algorithm>
#include <limits>

#include "detail/SurfaceSearch.h"

namespace genu::contact::detail {

DistancePredictor::DistancePredictor(const ContactSurface& surface) {
  // Feet are unique within `safe`, half of the smallest medial-ball radius at samples of the surface.
  safe_m_ = std::min(surface.safeDistanceInside_m(), surface.safeDistanceOutside_m());
  const auto& search = SurfaceAccess::search(surface);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < search.tables.size(); ++k) {
    const PatchTables& t = search.tables[k];
    Borders b = {-kInfinity, kInfinity, -kInfinity, kInfinity, false};
    const auto& links = search.links[k];
    if (!t.u.closed && links[0].patch < 0) b.u0 = t.u.lo;
    if (!t.u.closed && links[1].patch < 0) b.u1 = t.u.hi;
    if (!t.v.closed && links[2].patch < 0) b.v0 = t.v.lo;
    if (!t.v.closed && links[3].patch < 0) b.v1 = t.v.hi;
    b.open = b.u0 != -kInfinity || b.u1 != kInfinity || b.v0 != -kInfinity || b.v1 != kInfinity;
    borders_.push_back(b);
  }
}

void DistancePredictor::restrict(int patch, const std::array<double, 4>& uv) {
  Borders& b = borders_[static_cast<size_t>(patch)];
  b = {std::max(b.u0, uv[0]), std::min(b.u1, uv[1]), std::max(b.v0, uv[2]), std::min(b.v1, uv[3]), true};
}

}  // namespace genu::contact::detail
