#pragma once

// What the parts of the distance table exchange: plain data, because they are compiled with different options.

#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

namespace distance_table {

/** One patch, [m]; points x, y, z at [3 (i numV + j)]; weights empty: polynomial. */
struct Patch {
  int degreeU, degreeV, numU, numV;
  std::vector<double> knotsU, knotsV, points, weights;
};

/** A query point near the surface and a ray from it, with the answers of the slow, certain methods on the surface. */
struct Query {
  double Q[3], n[3];   // [m]; n: unit, into the solid
  double u, v;         // of the closest point before the query moved
  double distance, t;  // |AB|, AC [m]; only where checked
  bool checked;
};

struct Row {
  std::string method;
  int queries = 0;
  double min_ns = 0, median_ns = 0;
  double residual_m = -1;  // largest component of B - Q along the tangents, or of C across the ray; negative: not known
  double error_m = -1;     // largest error of the distance over the checked queries
  double iterations = -1;  // mean evaluations of the surface
  int failed = 0;
};

/** Times repeats of run(), which makes `count` queries: least and median time of one [ns]. */
template <class Run>
void measure(int repeats, int count, Row& row, const Run& run) {
  std::vector<double> times;
  for (int k = 0; k < repeats; ++k) {
    const auto start = std::chrono::steady_clock::now();
    run();
    const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - start;
    times.push_back(spent.count() / count);
  }
  std::sort(times.begin(), times.end());
  row.queries = count;
  row.min_ns = times.front();
  row.median_ns = times[times.size() / 2];
}

/** Open CASCADE on the same patches. */
std::vector<Row> measureOcct(const std::vector<Patch>& patches, const std::vector<Query>& queries, bool quick);

/** Simbody's triangle mesh. vertices: x, y, z [m]; faces: three indices; closed. */
Row measureMesh(const std::vector<double>& vertices, const std::vector<int>& faces, const std::vector<Query>& queries,
                bool quick);

}  // namespace distance_table
