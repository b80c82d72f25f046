#include "genu/fit/SurfaceFit.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "BSplineBasis.h"
#include "genu/contact/ContactSurface.h"
#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace {

using contact::Mat3;
using contact::NurbsPatch;
using contact::NurbsPatchData;

size_t index(int i) { return static_cast<size_t>(i); }

/** One condition of the least squares: (S(u, v) - target)^T M (S(u, v) - target) times weight. */
struct Condition {
  double u, v, weight;
  Vec3 target;
  Mat3 metric;
};

struct Sample {
  Vec3 point;
  double weight;  // share of the region's area
  double u, v;
  Vec3 normal = Vec3::UnitY();  // of the patch at the foot
  double deviation = 0;
  bool onEdge = false;
};

constexpr double kTangentialWeight = 0.02;  // tau: keeps the parameters in place, does not hold the shape back
constexpr double kFallAwayWeight = 0.01;
constexpr int kCoverageCells = 48;
constexpr int kWeightingSteps = 25;

/** Tensor-product cubic spline surface and the normal equations over its control points. */
struct Spline {
  CubicBasis u, v;
  std::vector<Vec3> points;

  int numU() const { return u.numFunctions(); }
  int numV() const { return v.numFunctions(); }

  NurbsPatchData toData() const {
    NurbsPatchData data;
    data.numU = numU();
    data.numV = numV();
    data.knotsU = u.knots();
    data.knotsV = v.knots();
    data.points = points;
    return data;
  }

  void solve(const std::vector<Condition>& conditions, double fairing);

 private:
  // Lower-triangle 3x3 blocks of the normal matrix: control point a = (i, j) with b = (i + di, j + dj), di 0..3, dj
  // -3..3.
  static constexpr int kBlocks = 28;
  static int block(int di, int dj) { return di * 7 + dj + 3; }
};

void Spline::solve(const std::vector<Condition>& conditions, double fairing) {
  const int n = numU() * numV();
  std::vector<Mat3> blocks(index(n * kBlocks), Mat3::Zero());
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(3 * n, 1);
  for (const Condition& c : conditions) {
    const auto ru = u.calc(c.u), rv = v.calc(c.v);
    const Vec3 pull = c.weight * (c.metric * c.target);
    const Mat3 metric = c.weight * c.metric;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const int a = (ru.first + i) * numV() + rv.first + j;
        const double Na = ru.N[index(i)] * rv.N[index(j)];
        rhs.block<3, 1>(3 * a, 0) += Na * pull;
        for (int k = i; k < 4; ++k) {
          for (int l = k == i ? j : 0; l < 4; ++l) {
            blocks[index(a * kBlocks + block(k - i, l - j))] += Na * ru.N[index(k)] * rv.N[index(l)] * metric;
          }
        }
      }
    }
  }
  // Thin-plate energy by Gauss-Legendre with four points per span and direction: exact for these polynomials.
  static constexpr std::array<double, 4> nodes = {-0.861136311594053, -0.339981043584856, 0.339981043584856,
                                                  0.861136311594053};
  static constexpr std::array<double, 4> weights = {0.347854845137454, 0.652145154862546, 0.652145154862546,
                                                    0.347854845137454};
  const auto breaksU = u.breaks(), breaksV = v.breaks();
  std::vector<std::pair<CubicBasis::Row, double>> rowsU, rowsV;
  const auto collect = [&](const CubicBasis& basis, const std::vector<double>& breaks, auto& rows) {
    for (size_t s = 0; s + 1 < breaks.size(); ++s) {
      const double half = (breaks[s + 1] - breaks[s]) / 2, middle = (breaks[s + 1] + breaks[s]) / 2;
      for (size_t g = 0; g < 4; ++g) rows.emplace_back(basis.calc(middle + half * nodes[g]), half * weights[g]);
    }
  };
  collect(u, breaksU, rowsU);
  collect(v, breaksV, rowsV);
  for (const auto& [ru, wu] : rowsU) {
    for (const auto& [rv, wv] : rowsV) {
      for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
          const int a = (ru.first + i) * numV() + rv.first + j;
          const double uu = ru.ddN[index(i)] * rv.N[index(j)], uv = ru.dN[index(i)] * rv.dN[index(j)],
                       vv = ru.N[index(i)] * rv.ddN[index(j)];
          for (int k = i; k < 4; ++k) {
            for (int l = k == i ? j : 0; l < 4; ++l) {
              const double energy = uu * ru.ddN[index(k)] * rv.N[index(l)] +
                                    2 * uv * ru.dN[index(k)] * rv.dN[index(l)] + vv * ru.N[index(k)] * rv.ddN[index(l)];
              blocks[index(a * kBlocks + block(k - i, l - j))].diagonal().array() += fairing * wu * wv * energy;
            }
          }
        }
      }
    }
  }
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(index(n) * kBlocks * 9);
  for (int i = 0; i < numU(); ++i) {
    for (int j = 0; j < numV(); ++j) {
      const int a = i * numV() + j;
      for (int di = 0; di < 4 && i + di < numU(); ++di) {
        for (int dj = di == 0 ? 0 : -3; dj <= 3; ++dj) {
          if (j + dj < 0 || j + dj >= numV()) continue;
          const int b = (i + di) * numV() + j + dj;
          const Mat3& m = blocks[index(a * kBlocks + block(di, dj))];
          for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
              if (3 * b + r >= 3 * a + c) triplets.emplace_back(3 * b + r, 3 * a + c, m(r, c));
            }
          }
        }
      }
    }
  }
  Eigen::SparseMatrix<double> matrix(3 * n, 3 * n);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  const Eigen::VectorXd x = solver.solve(rhs.col(0));
  if (solver.info() != Eigen::Success || !x.allFinite()) {
    throw ComputationError(
        "surface fit: the least-squares system is singular; give more fairing or fewer control points");
  }
  points.resize(index(n));
  for (int a = 0; a < n; ++a) points[index(a)] = x.segment<3>(3 * a);
}

class Fitter {
 public:
  Fitter(const TriangleMesh& region, const SurfaceFitOptions& options, const scene::Progress& progress)
      : region_(region), options_(options), progress_(progress), distance_(region), spline_(makeSpline()) {}

  SurfaceFitResult run();

 private:
  Spline makeSpline();
  void measure(const Spline& spline, std::vector<Sample>& samples) const;
  void solve(Spline& spline, const std::vector<Sample>& samples, double tangential) const;
  void updateFallAway();
  void converge(int iterations);
  bool refine();
  void reduceMaximum();
  double calcRms(const std::vector<Sample>& samples) const;
  double calcMean() const;
  double calcMax() const;

  const TriangleMesh& region_;
  const SurfaceFitOptions& options_;
  const scene::Progress& progress_;
  MeshDistance distance_;
  std::vector<Sample> samples_;
  std::vector<Condition> fallAway_;
  double area_ = 0, medianEdge_ = 0, sign_ = 1;
  double uncoveredShare_ = 0;
  Spline spline_;
};

Spline Fitter::makeSpline() {
  const std::vector<double> areas = calcVertexAreas(region_);
  area_ = std::accumulate(areas.begin(), areas.end(), 0.0);
  medianEdge_ = calcMedianEdge(region_);
  Eigen::AlignedBox2d box;
  samples_.reserve(region_.vertices.size());
  for (size_t i = 0; i < region_.vertices.size(); ++i) {
    const Vec2 uv = options_.parametrization.calc(region_.vertices[i]);
    samples_.push_back({region_.vertices[i], areas[i] / area_, uv.x(), uv.y()});
    box.extend(uv);
  }
  double turned = 0, total = 0;
  for (const auto& t : region_.triangles) {
    const auto uv = [&](size_t k) { return Vec2(samples_[index(t[k])].u, samples_[index(t[k])].v); };
    const Vec2 a = uv(1) - uv(0), b = uv(2) - uv(0);
    const double signedArea = a.x() * b.y() - a.y() * b.x();
    turned += signedArea;
    total += std::abs(signedArea);
  }
  sign_ = turned >= 0 ? 1 : -1;
  if (std::abs(turned) < 0.9 * total) {
    throw InputError("surface fit: the region folds over itself when laid out " +
                     std::string(options_.parametrization.shape == PatchShape::plateau
                                     ? "along x and z; choose a smaller box, or the condyle shape"
                                     : "by angle and z; choose a smaller box or another axis"));
  }
  return {CubicBasis(box.min().x(), box.max().x(), options_.minPointsU),
          CubicBasis(box.min().y(), box.max().y(), options_.minPointsV),
          {}};
}

void Fitter::measure(const Spline& spline, std::vector<Sample>& samples) const {
  const contact::ContactSurface surface({NurbsPatch(spline.toData())});
  for (Sample& s : samples) {
    const contact::ClosestPoint foot = surface.findLocalClosestPoint(s.point, {0, s.u, s.v});
    s.u = foot.at.u;
    s.v = foot.at.v;
    s.normal = sign_ * foot.normal_M;
    const Vec3 offset = s.point - foot.p_MB;
    s.onEdge = foot.status != contact::QueryStatus::converged;
    s.deviation = std::copysign(offset.norm(), offset.dot(s.normal));
  }
}

void Fitter::solve(Spline& spline, const std::vector<Sample>& samples, double tangential) const {
  std::vector<Condition> conditions = fallAway_;
  conditions.reserve(samples.size() + fallAway_.size());
  for (const Sample& s : samples) {
    Mat3 metric = Mat3::Identity();
    if (!s.onEdge) metric = tangential * Mat3::Identity() + (1 - tangential) * s.normal * s.normal.transpose();
    conditions.push_back({s.u, s.v, s.weight, s.point, metric});
  }
  spline.solve(conditions, options_.fairing * area_);
}

void Fitter::updateFallAway() {
  fallAway_.clear();
  const NurbsPatch patch(spline_.toData());
  double uncovered = 0, whole = 0;
  const double du = (patch.uMax() - patch.uMin()) / kCoverageCells, dv = (patch.vMax() - patch.vMin()) / kCoverageCells;
  for (int i = 0; i < kCoverageCells; ++i) {
    for (int j = 0; j < kCoverageCells; ++j) {
      const double u = patch.uMin() + (i + 0.5) * du, v = patch.vMin() + (j + 0.5) * dv;
      const auto s = patch.evaluate(u, v);
      const double cell = s.Su.cross(s.Sv).norm() * du * dv;
      whole += cell;
      const auto foot = distance_.findClosest(s.S);
      if (!foot.onBorder || foot.distance_m < 0.5 * medianEdge_) continue;
      uncovered += cell;
      // The patch's own tangent plane where the mesh ends: mesh normals are unreliable along a cut or chamfered border.
      const auto& corners = region_.triangles[index(foot.triangle)];
      double uB = 0, vB = 0;
      for (int k = 0; k < 3; ++k) {
        uB += foot.barycentric[k] * samples_[index(corners[index(k)])].u;
        vB += foot.barycentric[k] * samples_[index(corners[index(k)])].v;
      }
      const auto b = patch.evaluate(uB, vB);
      const Vec3 n = sign_ * b.Su.cross(b.Sv).normalized();
      // Distances in (u, v), which are lengths: those of the surface itself would feed back where it is loose.
      const double r = std::hypot(u - uB, v - vB);
      const auto limited = [](const Vec3& tangent) { return Vec3(tangent / std::max(1.0, tangent.norm())); };
      const Vec3 target =
          b.S + (u - uB) * limited(b.Su) + (v - vB) * limited(b.Sv) - r * r / (2 * options_.fallAwayRadius_m) * n;
      const Mat3 metric = kTangentialWeight * Mat3::Identity() + (1 - kTangentialWeight) * n * n.transpose();
      fallAway_.push_back({u, v, kFallAwayWeight * du * dv / area_, target, metric});
    }
  }
  uncoveredShare_ = whole > 0 ? uncovered / whole : 0;
}

double Fitter::calcRms(const std::vector<Sample>& samples) const {
  double sum = 0;
  for (const Sample& s : samples) sum += s.weight * s.deviation * s.deviation;
  return std::sqrt(sum);
}

double Fitter::calcMean() const {
  double sum = 0;
  for (const Sample& s : samples_) sum += std::abs(s.deviation);
  return sum / static_cast<double>(samples_.size());
}

double Fitter::calcMax() const {
  double max = 0;
  for (const Sample& s : samples_) max = std::max(max, std::abs(s.deviation));
  return max;
}

void Fitter::converge(int iterations) {
  double best = calcRms(samples_);
  for (int i = 0; i < iterations; ++i) {
    if (i % 4 == 0) updateFallAway();
    Spline trial = spline_;
    std::vector<Sample> samples = samples_;
    solve(trial, samples, kTangentialWeight);
    measure(trial, samples);
    const double rms = calcRms(samples);
    if (!(rms < best)) break;  // rim vertices can lose their foot: keep what was
    const double gain = (best - rms) / best;
    spline_ = std::move(trial);
    samples_ = std::move(samples);
    best = rms;
    if (gain < 1e-3) break;
  }
}

/** Presses the largest deviation under its tolerance, where the mean has room, by weighting each vertex up with its own
 deviation (Lawson 1961). Keeps the solution with the smallest excess over the tolerances. */
void Fitter::reduceMaximum() {
  const auto calcExcess = [&] {
    return std::max(calcMean() / options_.toleranceMean_m, calcMax() / options_.toleranceMax_m);
  };
  Spline best = spline_;
  std::vector<Sample> bestSamples = samples_;
  double least = calcExcess();
  for (int i = 0; i < kWeightingSteps && least > 1; ++i) {
    const double max = calcMax();
    double sum = 0;
    for (Sample& s : samples_) {
      s.weight *= 1 + std::pow(s.deviation / max, 2);
      sum += s.weight;
    }
    for (Sample& s : samples_) s.weight /= sum;
    solve(spline_, samples_, kTangentialWeight);
    measure(spline_, samples_);
    const double excess = calcExcess();
    if (excess < least) {
      least = excess;
      best = spline_;
      bestSamples = samples_;
    }
  }
  spline_ = std::move(best);
  samples_ = std::move(bestSamples);
}

/** Adds the knot line, out of the worst strips of both directions, that lowers the deviation most. Fourth powers:
 between the mean and the maximum, which both have a tolerance. */
bool Fitter::refine() {
  struct Candidate {
    bool alongU;
    double error, knot;
  };
  std::vector<Candidate> candidates;
  const auto collect = [&](bool alongU) {
    const CubicBasis& basis = alongU ? spline_.u : spline_.v;
    if (basis.numFunctions() >= (alongU ? options_.maxPointsU : options_.maxPointsV)) return;
    const auto breaks = basis.breaks();
    std::vector<std::vector<std::pair<double, double>>> strips(breaks.size() - 1);
    for (const Sample& s : samples_) {
      const double t = alongU ? s.u : s.v;
      strips[index(basis.findSpan(t))].emplace_back(t, s.weight * std::pow(s.deviation, 4));
    }
    std::vector<Candidate> found;
    for (size_t i = 0; i < strips.size(); ++i) {
      const double width = breaks[i + 1] - breaks[i];
      if (width < 4 * medianEdge_ || strips[i].size() < 8) continue;
      std::sort(strips[i].begin(), strips[i].end());
      double sum = 0, half = 0;
      for (const auto& [t, e] : strips[i]) sum += e;
      double knot = breaks[i] + width / 2;
      for (const auto& [t, e] : strips[i]) {
        half += e;
        if (half >= sum / 2) {
          knot = t;
          break;
        }
      }
      found.push_back({alongU, sum, std::clamp(knot, breaks[i] + 0.3 * width, breaks[i + 1] - 0.3 * width)});
    }
    std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) { return a.error > b.error; });
    if (found.size() > 3) found.resize(3);
    candidates.insert(candidates.end(), found.begin(), found.end());
  };
  collect(true);
  collect(false);
  if (candidates.empty()) return false;
  double best = std::numeric_limits<double>::infinity();
  Spline bestSpline = spline_;
  for (const Candidate& candidate : candidates) {
    Spline trial = spline_;
    (candidate.alongU ? trial.u : trial.v).insertKnot(candidate.knot);
    solve(trial, samples_, kTangentialWeight);
    // The feet have hardly moved: the normal offset at the old parameters tells the trials apart.
    const NurbsPatch patch(trial.toData());
    double quartic = 0;
    for (const Sample& s : samples_) {
      const auto d = patch.evaluate(s.u, s.v);
      const Vec3 offset = s.point - d.S;
      const double distance = s.onEdge ? offset.norm() : offset.dot(d.Su.cross(d.Sv).normalized());
      quartic += s.weight * std::pow(distance, 4);
    }
    if (quartic < best) {
      best = quartic;
      bestSpline = std::move(trial);
    }
  }
  spline_ = std::move(bestSpline);
  measure(spline_, samples_);
  return true;
}

SurfaceFitResult Fitter::run() {
  SurfaceFitResult result;
  solve(spline_, samples_, 1);
  measure(spline_, samples_);
  converge(4);
  const auto record = [&] {
    result.meanHistory_m.push_back(calcMean());
    result.maxHistory_m.push_back(calcMax());
    result.sizeHistory.push_back({spline_.numU(), spline_.numV()});
  };
  const auto met = [&] { return calcMean() <= options_.toleranceMean_m && calcMax() <= options_.toleranceMax_m; };
  record();
  const int most = std::max(1, options_.maxPointsU + options_.maxPointsV - options_.minPointsU - options_.minPointsV);
  for (int step = 0; !met(); ++step) {
    if (progress_ && !progress_(std::min(1.0, static_cast<double>(step) / most))) {
      result.stopped = true;
      break;
    }
    if (!refine()) break;
    converge(2);
    record();
  }
  converge(30);
  if (calcMean() <= options_.toleranceMean_m) reduceMaximum();
  record();
  result.toleranceMet = met();
  updateFallAway();
  result.uncoveredShare = uncoveredShare_;

  result.patch = spline_.toData();
  result.patch.flipNormal = sign_ < 0;
  const auto normalize = [](std::vector<double>& knots) {
    const double min = knots.front(), size = knots.back() - knots.front();
    for (double& k : knots) k = (k - min) / size;
  };
  normalize(result.patch.knotsU);
  normalize(result.patch.knotsV);
  for (const Sample& s : samples_) {
    result.deviation_m.push_back(s.deviation);
    result.uv.emplace_back((s.u - spline_.u.min()) / (spline_.u.max() - spline_.u.min()),
                           (s.v - spline_.v.min()) / (spline_.v.max() - spline_.v.min()));
    result.beyondEdge.push_back(s.onEdge ? 1 : 0);
  }
  return result;
}

}  // namespace

double Parametrization::calcAngle(const Vec3& point) const {
  return std::atan2(point.x() - axis_m.x(), -(point.y() - axis_m.y()));
}

Vec2 Parametrization::calc(const Vec3& point) const {
  if (shape == PatchShape::plateau) return {point.x(), point.z()};
  return {radius_m * calcAngle(point), point.z()};
}

Vec3 Parametrization::calcDirection(const Vec3& point) const {
  if (shape == PatchShape::plateau) return Vec3::UnitY();
  return Vec3(point.x() - axis_m.x(), point.y() - axis_m.y(), 0).normalized();
}

Parametrization fitCondyleAxis(const TriangleMesh& region) {
  // x^2 + y^2 = 2 cx x + 2 cy y + (R^2 - cx^2 - cy^2), about the mean for conditioning.
  const std::vector<double> areas = calcVertexAreas(region);
  Vec3 mean = Vec3::Zero();
  double sum = 0;
  for (size_t i = 0; i < areas.size(); ++i) {
    mean += areas[i] * region.vertices[i];
    sum += areas[i];
  }
  mean /= sum;
  contact::Mat3 A = contact::Mat3::Zero();
  Vec3 b = Vec3::Zero();
  for (size_t i = 0; i < areas.size(); ++i) {
    const Vec3 p = region.vertices[i] - mean;
    const Vec3 row(2 * p.x(), 2 * p.y(), 1);
    A += areas[i] * row * row.transpose();
    b += areas[i] * row * (p.x() * p.x() + p.y() * p.y());
  }
  const Vec3 solution = A.ldlt().solve(b);
  Parametrization result;
  result.shape = PatchShape::condyle;
  result.axis_m = Vec2(solution.x() + mean.x(), solution.y() + mean.y());
  result.radius_m = 0;
  for (size_t i = 0; i < areas.size(); ++i) {
    result.radius_m += areas[i] / sum * (Vec2(region.vertices[i].x(), region.vertices[i].y()) - result.axis_m).norm();
  }
  return result;
}

SurfaceFitResult fitSurface(const TriangleMesh& region, const SurfaceFitOptions& options,
                            const scene::Progress& progress) {
  const auto check = [](const char* name, int min, int max) {
    if (min < 4 || max < min) {
      throw InputError(std::string("surface fit: control points along ") + name + ": " + std::to_string(min) + " to " +
                       std::to_string(max) + "; allowed: at least 4 (bicubic), the cap not below the start");
    }
  };
  check("u", options.minPointsU, options.maxPointsU);
  check("v", options.minPointsV, options.maxPointsV);
  if (!(options.fairing > 0)) {
    throw InputError("surface fit: fairing " + io::formatNumber(options.fairing) + "; allowed: greater than 0");
  }
  if (region.numVertices() < 2 * options.minPointsU * options.minPointsV) {
    throw InputError("surface fit: the region has " + std::to_string(region.numVertices()) +
                     " vertices; needed: at least " + std::to_string(2 * options.minPointsU * options.minPointsV) +
                     " (twice the control points it starts with)");
  }
  return Fitter(region, options, progress).run();
}

DeviationStatistics calcStatistics(const std::vector<double>& deviation_m) {
  DeviationStatistics s;
  s.count = static_cast<int>(deviation_m.size());
  if (s.count == 0) return s;
  const double n = s.count;
  s.signedMin_m = *std::min_element(deviation_m.begin(), deviation_m.end());
  s.signedMax_m = *std::max_element(deviation_m.begin(), deviation_m.end());
  std::vector<double> absolute;
  double squares = 0;
  for (const double d : deviation_m) {
    absolute.push_back(std::abs(d));
    s.mean_m += std::abs(d) / n;
    s.signedMean_m += d / n;
    squares += d * d / n;
  }
  s.rms_m = std::sqrt(squares);
  s.sd_m = std::sqrt(std::max(0.0, squares - s.mean_m * s.mean_m));
  s.signedSd_m = std::sqrt(std::max(0.0, squares - s.signedMean_m * s.signedMean_m));
  std::sort(absolute.begin(), absolute.end());
  s.max_m = absolute.back();
  s.percentile95_m = absolute[static_cast<size_t>(0.95 * (n - 1))];
  return s;
}

}  // namespace genu::fit
