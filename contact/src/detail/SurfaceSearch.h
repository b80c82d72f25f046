#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "FootKernel.h"
#include "RayKernel.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact {

namespace detail {

/** Parameters, kept inside the domain; a closed direction wraps. */
struct Domain {
  double lo, hi;
  bool closed;
  double clampLo, clampHi;  // a hair inside a pole

  double fit(double t) const {
    if (closed) {
      if (t < lo || t > hi) {
        const double period = hi - lo;
        t -= period * std::floor((t - lo) / period);
      }
      return std::min(std::max(t, lo), hi);
    }
    return std::min(std::max(t, clampLo), clampHi);
  }
};

struct PatchInfo {
  Domain u, v;
  bool poleU0 = false, poleU1 = false, poleV0 = false, poleV1 = false;  // edges that shrink to a point
  std::vector<double> creasesU, creasesV;                               // knots across which the normal jumps, ascending
  double size = 0;
};

/** Where a patch goes on beyond one of its edges: another edge with the same points at proportional parameters. */
struct EdgeLink {
  int patch = -1;      // -1: open border
  int edge = 0;        // 0: u low, 1: u high, 2: v low, 3: v high
  bool reversed = false;
};

/** Start for a cold query: a surface point and the first-order change of its parameters. */
struct Seed {
  float S[3], du[3], dv[3];
  float u, v;
  int patch;
};

}  // namespace detail

struct ContactSurface::Search {
  Search() = default;
  Search(const Search&) = delete;  // the tables point into the patches and into edges' storage
  Search& operator=(const Search&) = delete;

  struct Leaf {
    int patch;
    double u0, u1, v0, v1;
    Vec3 center, normal;
    double low = 0, high = 0;  // the piece lies between these heights above the center, along its normal
    double reach = 0;  // ... and no farther from the line through the center along its normal
    double radius;  // half diagonal of the piece's box
    double spread;  // bound of |normal - normal at center| over the piece (sampled)

    /** No more than the piece's squared distance from Q: it lies in a cylinder about the line through its center. */
    double boundSquaredDistance(const Vec3& Q) const {
      const Vec3 r = Q - center;
      const double height = r.dot(normal), along = std::max({0.0, low - height, height - high});
      const double across = std::max(0.0, std::sqrt(std::max(0.0, r.squaredNorm() - height * height)) - reach);
      return along * along + across * across;
    }
  };
  struct Node {
    Eigen::AlignedBox3d box;
    int left = -1, right = -1;  // children, or
    int leaf = -1;
  };
  std::vector<detail::PatchInfo> info;
  std::vector<Leaf> leaves;
  std::vector<Node> nodes;


  int build(std::vector<int>& items, int begin, int end, const std::vector<Eigen::AlignedBox3d>& boxes);

  // Fast local solver.
  std::vector<std::vector<double>> spanStorage;
  std::vector<std::vector<unsigned short>> bucketStorage;
  std::vector<detail::PatchTables> tables;
  std::vector<std::array<detail::EdgeLink, 4>> links;
  double safeInside = 0, safeOutside = 0;

  // Cells of equal size around the surface; each near one holds the number of its nearest seed, the others -1.
  std::vector<detail::Seed> seeds;
  std::vector<std::int16_t> cells;
  Vec3 cellOrigin = Vec3::Zero();
  double invCell = 0;
  int numCells[3] = {0, 0, 0};

  void addTables(const NurbsPatch& patch);
  void linkEdges(const std::vector<NurbsPatch>& patches, double size);
  void fillCells(const std::vector<NurbsPatch>& patches, const Eigen::AlignedBox3d& box);

  /** Fast Newton from `at`, across connected edges; false: take the safeguarded solver. */
  bool solveFast(const double* Q, SurfaceParameter& at, detail::FootDerivatives derivatives, detail::TrackedFoot& foot,
                 detail::FootSearch& search) const;
  /** Where (u, v) lies beyond an edge of at.patch: moves to where the neighbour begins. False at an open border. */
  bool crossEdge(SurfaceParameter& at, double& u, double& v) const;
  /** Fast Newton for the ray A + t n from `at`, across connected edges; the hit counts only if it is the first by the rule of
   findFirstHit. */
  bool solveFastRay(const double* A, const double* n, SurfaceParameter& at, bool derivatives, detail::RayHit& hit,
                    int& iterations, bool& safe) const;
  /** Start near Q for a point near the surface; patch = -1 when there is none. */
  SurfaceParameter findSeed(const double* Q) const;
  bool isSafe(double distance_m) const { return distance_m < 0 ? -distance_m < safeInside : distance_m < safeOutside; }
};

namespace detail {

struct SurfaceAccess {
  using Search = ContactSurface::Search;
  static const auto& search(const ContactSurface& surface) { return *surface.search_; }
};

}  // namespace detail

}  // namespace genu::contact
