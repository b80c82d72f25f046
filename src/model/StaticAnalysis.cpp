#include "StaticAnalysis.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <optional>
#include <sstream>

#include "Conversions.h"
#include "genu/model/EquilibriumSolver.h"

namespace genu::model {

using contact::EvaluationStatus;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/** Largest move of one iteration or step: small against the surfaces' radii, so that no step jumps through a layer. */
constexpr double kMaxMove_m = 0.5e-3;
/** Poses of two methods that differ by less are the same equilibrium. */
constexpr double kMethodAgreement_m = 1e-6;
constexpr int kAxisY = 4;

double infinityNorm(const VectorXd& v) { return v.size() ? v.cwiseAbs().maxCoeff() : 0.0; }

const char* const kNoContactAdvice =
    "check that the surfaces lie above each other in the fixed frame, that the grid covers them, the start pose and "
    "the direction of the loads";
const char* const kPenetrationAdvice =
    "the layer is too thin or too soft for the load, or the pose pushes one body through the other; check units of "
    "modulus, thickness and load, and the prescribed coordinates";

/** Minimum-norm solution of K x = r: a direction without stiffness is left alone. */
VectorXd solveStiffness(const MatrixXd& K, const VectorXd& r) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(K.rows(), K.cols());
  solver.setThreshold(1e-9);
  return solver.compute(K).solve(r);
}

/** What an iteration ended with. */
struct Outcome {
  bool converged = false, interrupted = false, sawFullPenetration = false, touched = false;
  int iterations = 0;
  std::string reason;
  std::string elementProblem;  ///< why a force element made the start invalid
  std::string method;          ///< of seek(): how it got there
  bool usedEuler = false;
};

/** Whether stiffnesses, lowest first, have one that drives away from the equilibrium. */
bool isUnstable(const VectorXd& stiffnesses) { return stiffnesses.size() > 0 && stiffnesses[0] < -1e-6 * stiffnesses.cwiseAbs().maxCoeff(); }

class Settling {
 public:
  Settling(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Scene& scene,
           const scene::StaticSpec& settings, const scene::Progress& progress, const scene::Coordinates* start)
      : scene_(scene), settings_(settings), progress_(progress), start_(start), dynamics_(knee, defaultState, settings.time_s) {}

  StaticResult run();

 private:
  using Method = scene::StaticSpec::Method;

  bool mayContinue(double fraction) {
    if (deadline_ && std::chrono::steady_clock::now() > *deadline_) return false;
    return !progress_ || progress_(std::clamp(done_ + share_ * fraction, 0.0, 1.0));
  }

  VectorXd findStart();
  /** A floating joint whose child is lowered along y, and the contact pairs across it. */
  struct Lowering {
    int link = -1;
    int y = -1;  ///< position in z
    std::vector<int> pairs;
  };
  std::vector<Lowering> findLowerings();
  void closeGap(VectorXd& z, const Lowering& lowering, std::optional<double> drop);
  double findGap(const VectorXd& z, const Lowering& lowering);
  std::optional<double> findDrop(const VectorXd& z, const Lowering& lowering);
  bool touches(const Lowering& lowering) const;
  /** Lowest and highest y of the fixed and moving surfaces' boxes in F. */
  struct Extent {
    double fixedMin = kInfinity, fixedMax = -kInfinity, movingMin = kInfinity, movingMax = -kInfinity;
  };
  Extent findExtent(const VectorXd& z, const Lowering& lowering);

  Outcome seek(VectorXd& z, VectorXd& r);
  Outcome iterateNewton(VectorXd& z, VectorXd& r);
  Outcome solveElsewhere(const EquilibriumSolver& solver, VectorXd& z, VectorXd& r);
  struct Known;
  void searchOthers(const VectorXd& z, StaticResult& result);
  Known makeKnown(const VectorXd& z);
  Outcome findPass(const VectorXd& from, const VectorXd& to, VectorXd& z);
  EvaluationStatus calcForce(const VectorXd& z, VectorXd& r);
  bool calcStiffness(const VectorXd& z, const VectorXd& r, MatrixXd& K);
  Outcome integrateImplicitEuler(VectorXd& z, VectorXd& r, double maxAcceleration);
  bool solveImplicitStep(const VectorXd& z0, const VectorXd& v0, double h, double damping, VectorXd& z1, VectorXd& v1,
                         int& iterations, bool& sawFullPenetration);
  void fillResult(const VectorXd& z, StaticResult& result);
  std::string where() const { return scene_.file.string() + ": static analysis: "; }

  const scene::Scene& scene_;
  const scene::StaticSpec& settings_;
  const scene::Progress& progress_;
  const scene::Coordinates* start_;
  ReducedDynamics dynamics_;
  double done_ = 0, share_ = 1;  ///< of the whole, before and in what runs now
  std::optional<std::chrono::steady_clock::time_point> deadline_;
  VectorXd held_;  ///< unit vector along which nothing moves; empty: none
};

/** Every floating joint with y free: contact pairs that only it moves, the fixed side towards the root. */
std::vector<Settling::Lowering> Settling::findLowerings() {
  const KneeSystem& knee = dynamics_.knee();
  std::vector<Lowering> result;
  for (size_t link = 0; link < knee.urdf().links.size(); ++link) {
    const auto& joint = knee.urdf().links[link].joint;
    if (!joint || joint->type != JointType::floating) continue;
    Lowering lowering;
    lowering.link = static_cast<int>(link);
    lowering.y = dynamics_.findFree(joint->firstCoordinate + kAxisY);
    if (lowering.y < 0) continue;
    for (size_t i = 0; i < scene_.contacts.size(); ++i) {
      const ContactFrames frames = findContactFrames(knee.urdf(), scene_.contacts[i]);
      int moving = 0;
      bool own = false;
      for (const ContactFrames::Step& step : frames.steps) {
        if (step.joint.type == JointType::fixed) continue;
        ++moving;
        own = own || (!step.up && step.joint.firstCoordinate == joint->firstCoordinate);
      }
      if (own && moving == 1) lowering.pairs.push_back(static_cast<int>(i));
    }
    if (!lowering.pairs.empty()) result.push_back(std::move(lowering));
  }
  return result;
}

Settling::Extent Settling::findExtent(const VectorXd& z, const Lowering& lowering) {
  const SimTK::State& state = dynamics_.setPose(z);
  const KneeSystem& knee = dynamics_.knee();
  const ArticularContactSubsystem& contact = knee.contact();
  const SimTK::MobilizedBody& child = knee.body(lowering.link);
  const SimTK::Transform X_GF = child.getParentMobilizedBody().getBodyTransform(state) * child.getInboardFrame(state);
  Extent extent;
  const auto include = [&](const Eigen::AlignedBox3d& box, const SimTK::Transform& X_GB, double& low, double& high) {
    for (int corner = 0; corner < 8; ++corner) {
      const contact::Vec3 p = box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
      const double y = (~X_GF * (X_GB * toSimTK(p)))[1];
      low = std::min(low, y);
      high = std::max(high, y);
    }
  };
  for (const int i : lowering.pairs) {
    const ArticularContactSubsystem::Attachment& at = contact.attachment(i);
    const SimTK::Transform X_GFixed = knee.matter().getMobilizedBody(at.fixed).getBodyTransform(state) * at.X_FixedF;
    const SimTK::Transform X_GMoving = knee.matter().getMobilizedBody(at.moving).getBodyTransform(state) * at.X_MovingM;
    for (const contact::CompartmentDefinition& part : contact.contactPair(i).definition().compartments) {
      include(part.fixedSurface->boundingBox(), X_GFixed, extent.fixedMin, extent.fixedMax);
      include(part.movingSurface->boundingBox(), X_GMoving, extent.movingMin, extent.movingMax);
    }
  }
  return extent;
}

/** Smallest element distance of the pairs. */
double Settling::findGap(const VectorXd& z, const Lowering& lowering) {
  const SimTK::State& state = dynamics_.setPose(z);
  double gap = kInfinity;
  for (const int i : lowering.pairs) {
    for (const auto& compartment : dynamics_.knee().contact().calcTrackedFields(state, i)) {
      // Behind an open border there is no material: only how far away it is counts.
      for (const contact::ElementField& element : compartment) {
        gap = std::min(gap, element.footOnBorder ? std::abs(element.distance_m) : element.distance_m);
      }
    }
  }
  return gap;
}

/** How far the child can be lowered along y until the first element's centre touches: along lines, which costs a tenth of a first evaluation far from
 contact, looking at every third element each way. Absent: one is in the other body already, none lies below it, or the elements are on the moving body. */
std::optional<double> Settling::findDrop(const VectorXd& z, const Lowering& lowering) {
  constexpr int kStride = 3;
  constexpr double kFarthest_m = 1;
  const SimTK::State& state = dynamics_.setPose(z);
  const KneeSystem& knee = dynamics_.knee();
  const SimTK::MobilizedBody& child = knee.body(lowering.link);
  const SimTK::UnitVec3 up_G = (child.getParentMobilizedBody().getBodyTransform(state) * child.getInboardFrame(state)).y();
  std::optional<double> least;
  std::vector<contact::LineHit> hits;
  for (const int i : lowering.pairs) {
    const contact::ContactPair& pair = knee.contact().contactPair(i);
    const auto& parts = pair.definition().compartments;
    if (pair.definition().gridOn != contact::GridOn::fixed) return std::nullopt;
    const ArticularContactSubsystem::Attachment& at = knee.contact().attachment(i);
    const SimTK::Rotation R_GM = knee.matter().getMobilizedBody(at.moving).getBodyRotation(state) * at.X_MovingM.R();
    const contact::Vec3 up_M = toEigen(~R_GM * SimTK::Vec3(up_G));
    const contact::Pose X_FM = knee.contact().calcPose(state, i);
    const auto fields = pair.calcFields(contact::ContactWorkspace(pair));  // the elements' places
    for (size_t k = 0; k < parts.size(); ++k) {
      for (const contact::ElementField& element : fields[k]) {
        if (element.ix % kStride != kStride / 2 || element.iz % kStride != kStride / 2) continue;
        parts[k].movingSurface->findLineHits(X_FM.applyInverse(element.p_FA), up_M, 0, least.value_or(kFarthest_m), hits);
        if (hits.empty()) continue;
        if (!(hits[0].normal.dot(up_M) < 0)) return std::nullopt;  // leaves the body there
        least = hits[0].t_m;
      }
    }
  }
  return least;
}

/** At the pose of the last evaluation. */
bool Settling::touches(const Lowering& lowering) const {
  return std::any_of(lowering.pairs.begin(), lowering.pairs.end(), [this](int pair) {
    return dynamics_.knee().contact().getResult(dynamics_.state(), pair).total.activeElements > 0;
  });
}

/** Lowers the moving body along y until it touches. A signed distance changes by at most the move, so moving by the
 smallest one never overshoots; the last move presses one element in by 1 um. Bodies that slide past each other close it slowly: then by the secant of the last two, which for
 convex bodies does not overshoot either (a chord of a convex function, prolonged, is below it), as long as that leaves a valid pose.
 `drop`: findDrop(), taken first. */
void Settling::closeGap(VectorXd& z, const Lowering& lowering, std::optional<double> drop) {
  constexpr double kTouch_m = 1e-6;
  const int y = lowering.y;
  const Extent extent = findExtent(z, lowering);
  const double lowest = z[y] - (extent.movingMax - extent.fixedMin);  // entirely below the fixed surface
  VectorXd start;
  if (drop) {
    z[y] -= *drop + kTouch_m;
    if (!ReducedDynamics::isValid(dynamics_.calcStaticForce(z, start))) {
      z[y] += *drop + kTouch_m;
    } else if (touches(lowering)) {
      return;
    }
  }
  if (dynamics_.calcStaticForce(z, start) == EvaluationStatus::fullPenetration && scene_.contacts.size() == 1) {
    throw InputError(where() +
                     "the moving surface encloses the fixed one although it lies above it: its normals are inverted; "
                     "flip them (flip_normals)");
  }
  constexpr double kMostRatio = 20;
  double lastGap = 0, lastMove = 0;
  while (z[y] > lowest) {
    if (!mayContinue(0)) return;
    const double gap = findGap(z, lowering);
    if (gap == kInfinity) break;
    const double least = std::max(gap, 0.0) + kTouch_m;
    const double ratio = lastGap > gap && gap > 0 ? std::clamp(lastMove / (lastGap - gap), 1.0, kMostRatio) : 1;
    lastMove = std::max(gap, 0.0) * ratio + kTouch_m;
    lastGap = gap;
    z[y] -= lastMove;
    VectorXd r;
    if (!ReducedDynamics::isValid(dynamics_.calcStaticForce(z, r)) && ratio > 1) {
      z[y] += lastMove - least;
      lastMove = least;
      dynamics_.calcStaticForce(z, r);
    }
    if (touches(lowering)) return;
  }
  throw ComputationError(where() +
                         "contact is never made: lowered from above, the moving body passes the fixed one "
                         "without touching an element; " +
                         kNoContactAdvice);
}

VectorXd Settling::findStart() {
  const KneeSystem& knee = dynamics_.knee();
  if (start_ != nullptr) return dynamics_.scaled(*start_);
  scene::Coordinates q(static_cast<size_t>(knee.numCoordinates()), 0.0);
  for (int i : dynamics_.freeCoordinates()) {
    q[static_cast<size_t>(i)] = std::get<scene::FreeCoordinate>(scene_.model->coordinates[static_cast<size_t>(i)]).start.value_or(0.0);
  }
  VectorXd z = dynamics_.scaled(q);
  if (knee.contact().numContactPairs() == 0) return z;
  const std::vector<Lowering> lowerings = findLowerings();
  bool lowered = false;
  for (const Lowering& lowering : lowerings) {
    const int y = dynamics_.freeCoordinates()[static_cast<size_t>(lowering.y)];
    if (std::get<scene::FreeCoordinate>(scene_.model->coordinates[static_cast<size_t>(y)]).start) continue;
    const Extent extent = findExtent(z, lowering);
    z[lowering.y] += extent.fixedMax - extent.movingMin;
    closeGap(z, lowering, findDrop(z, lowering));
    lowered = true;
  }

  // With one joint and nothing else to hold it, its child can be set down again.
  const bool simple = lowerings.size() == 1 && knee.elements().empty() && knee.urdf().floatingChild >= 0;
  constexpr double kFarApart_m = 0.5e-3;
  if (simple && !lowered && settings_.method != Method::implicitEuler) {
    const std::optional<double> drop = findDrop(z, lowerings[0]);
    if (drop.value_or(0) > kFarApart_m) {
      closeGap(z, lowerings[0], drop);
      return z;
    }
  }

  VectorXd r;
  const EvaluationStatus status = dynamics_.calcStaticForce(z, r);
  const bool invalid = !lowered && !ReducedDynamics::isValid(status);
  if (invalid && lowerings.empty()) {
    const std::string problem = knee.findElementProblem(dynamics_.state());
    throw ComputationError(where() + (problem.empty() ? std::string("full penetration at the start, and y is prescribed; ") + kPenetrationAdvice
                                                      : "at the start, " + problem));
  }
  if (!simple || lowered) return z;
  const bool separated = !invalid && !dynamics_.hasContact();
  if (invalid) {
    const Extent extent = findExtent(z, lowerings[0]);
    z[lowerings[0].y] += extent.fixedMax - extent.movingMin;
    closeGap(z, lowerings[0], findDrop(z, lowerings[0]));
  } else if (separated && settings_.method != Method::implicitEuler) {
    closeGap(z, lowerings[0], std::nullopt);
  }
  return z;
}

/** Pseudo-transient continuation [Kelley & Keyes, SIAM J. Numer. Anal. 35 (1998) 508]: lambda = 1/delta starts so that
 the first move is about 0.1 mm and follows the residual down to 0, where the step is Newton's. */
Outcome Settling::iterateNewton(VectorXd& z, VectorXd& r) {
  constexpr int kMaxIterations = 300, kMaxRejections = 40;
  constexpr double kFirstMove_m = 1e-4;
  Outcome outcome;
  const int n = dynamics_.numFree();
  if (!ReducedDynamics::isValid(calcForce(z, r))) {
    outcome.elementProblem = dynamics_.elementProblem();
    outcome.reason = "the start is not a valid pose";
    return outcome;
  }
  const double firstNorm = infinityNorm(r);
  double lambda = firstNorm / kFirstMove_m;
  int rejections = 0;
  MatrixXd K;
  while (true) {
    const double norm = infinityNorm(r);
    if (norm <= settings_.maxResidual_N) {
      outcome.converged = true;
      return outcome;
    }
    if (outcome.iterations >= kMaxIterations || rejections >= kMaxRejections) {
      outcome.reason = "the residual stayed at " + std::to_string(norm) + " N";
      return outcome;
    }
    if (!mayContinue(std::log(norm / firstNorm) / std::log(settings_.maxResidual_N / firstNorm))) {
      outcome.interrupted = true;
      return outcome;
    }
    if (!calcStiffness(z, r, K)) {
      outcome.reason = "no valid pose around the iterate";
      return outcome;
    }
    ++outcome.iterations;
    for (bool accepted = false; !accepted && rejections < kMaxRejections;) {
      VectorXd move = solveStiffness(K + lambda * MatrixXd::Identity(n, n), r);
      const double size = infinityNorm(move);
      if (!(size < kInfinity)) {
        outcome.reason = "the stiffness is singular";
        return outcome;
      }
      if (size > kMaxMove_m) move *= kMaxMove_m / size;
      VectorXd rNew;
      const VectorXd candidate = z + move;
      const EvaluationStatus status = calcForce(candidate, rNew);
      outcome.sawFullPenetration |= status == EvaluationStatus::fullPenetration;
      const double ratio = infinityNorm(rNew) / norm;
      if (!ReducedDynamics::isValid(status) || ratio > 10) {
        ++rejections;
        lambda = std::max(8 * lambda, norm / kMaxMove_m);
        continue;
      }
      accepted = true;
      outcome.touched |= dynamics_.hasContact();
      z = candidate;
      r = rNew;
      lambda *= std::clamp(0.7 * ratio, 0.02, 3.0);
      if (infinityNorm(r) < 1e-3 * firstNorm) lambda *= 0.1;
    }
  }
}

/** A method that was registered, on the same forces and stiffness. */
Outcome Settling::solveElsewhere(const EquilibriumSolver& solver, VectorXd& z, VectorXd& r) {
  class Problem : public EquilibriumProblem {
   public:
    Problem(Settling& settling, Outcome& outcome) : settling_(settling), outcome_(outcome) {}
    int size() const override { return settling_.dynamics_.numFree(); }
    bool calcForce(const double* z, double* r) noexcept override {
      try {
        VectorXd force;
        const EvaluationStatus status = settling_.dynamics_.calcStaticForce(Eigen::Map<const VectorXd>(z, size()), force);
        outcome_.sawFullPenetration |= status == EvaluationStatus::fullPenetration;
        if (!ReducedDynamics::isValid(status)) return false;
        outcome_.touched |= settling_.dynamics_.hasContact();
        Eigen::Map<VectorXd>(r, size()) = force;
        return force.allFinite();
      } catch (const std::exception&) {
        return false;
      }
    }
    bool calcStiffness(const double* z, const double* r, double* stiffness) noexcept override {
      try {
        MatrixXd K;
        VectorXd force = Eigen::Map<const VectorXd>(r, size());
        if (!settling_.dynamics_.calcStiffness(Eigen::Map<const VectorXd>(z, size()), force, K)) return false;
        Eigen::Map<MatrixXd>(stiffness, size(), size()) = K;
        return K.allFinite();
      } catch (const std::exception&) {
        return false;
      }
    }
    bool mayContinue() noexcept override {
      outcome_.interrupted = outcome_.interrupted || !settling_.mayContinue(0.5);
      return !outcome_.interrupted;
    }
    double maxResidual_N() const override { return settling_.settings_.maxResidual_N; }
    double maxMove_m() const override { return kMaxMove_m; }

   private:
    Settling& settling_;
    Outcome& outcome_;
  };
  Outcome outcome;
  Problem problem(*this, outcome);
  const EquilibriumOutcome end = solver(problem, z.data());
  outcome.converged = end.converged && ReducedDynamics::isValid(dynamics_.calcStaticForce(z, r)) && infinityNorm(r) <= settings_.maxResidual_N;
  outcome.iterations = end.iterations;
  outcome.reason = end.converged && !outcome.converged ? "it ended where the forces do not balance" : end.reason;
  return outcome;
}

/** Force on the free coordinates, without its part along held_; the stiffness there is likely to follow. */
EvaluationStatus Settling::calcForce(const VectorXd& z, VectorXd& r) {
  const EvaluationStatus status = dynamics_.calcStaticForce(z, r, true);
  if (held_.size() > 0) r -= held_.dot(r) * held_;
  return status;
}

/** Stiffness across held_, and as large a one along it. */
bool Settling::calcStiffness(const VectorXd& z, const VectorXd& r, MatrixXd& K) {
  if (!dynamics_.calcStiffness(z, r, K)) return false;
  if (held_.size() == 0) return true;
  const double size = K.cwiseAbs().maxCoeff();
  const MatrixXd across = MatrixXd::Identity(K.rows(), K.cols()) - held_ * held_.transpose();
  K = across * K * across + size * held_ * held_.transpose();
  return true;
}

/** An equilibrium: its stiffnesses along the principal directions, lowest first (empty: there is no stiffness at z), and the projector onto those directions that have one. */
struct Settling::Known {
  VectorXd z, stiffnesses;
  MatrixXd stiff;
  int starts = 0;
  /** The same, or, where a direction is indifferent, another of the same family. */
  bool isAt(const VectorXd& other) const { return infinityNorm(stiff * (other - z)) < 10 * kMethodAgreement_m; }
};

Settling::Known Settling::makeKnown(const VectorXd& z) {
  constexpr double kIndifferent = 1e-9;
  const int n = dynamics_.numFree();
  Known known = {z, {}, MatrixXd::Identity(n, n)};
  MatrixXd K;
  VectorXd r;
  if (n == 0 || !ReducedDynamics::isValid(dynamics_.calcStaticForce(z, r, true)) || !dynamics_.calcStiffness(z, r, K)) return known;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(0.5 * (K + K.transpose()));
  known.stiffnesses = solver.eigenvalues();
  for (int k = 0; k < n; ++k) {
    if (std::abs(known.stiffnesses[k]) > kIndifferent * known.stiffnesses.cwiseAbs().maxCoeff()) continue;
    known.stiff -= solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose();
  }
  return known;
}

/** The equilibrium between two stable ones from which the body falls to either (mountain pass): across the way between them all forces balance, and the force along it turns from
 pulling back to pulling on. Found by bisection, ended by Newton's method. */
Outcome Settling::findPass(const VectorXd& from, const VectorXd& to, VectorXd& z) {
  constexpr double kNear_m = 1e-6;  // Newton's first move of 0.1 mm is far longer: it is hardly damped
  VectorXd low = from, high = to, r;
  const VectorXd way = (to - from).normalized();
  while (way.dot(high - low) > kNear_m) {
    z = 0.5 * (low + high);
    held_ = way;
    Outcome outcome = iterateNewton(z, r);
    held_.resize(0);
    if (!outcome.converged) return outcome;
    dynamics_.calcStaticForce(z, r);
    (r.dot(way) < 0 ? low : high) = z;
  }
  return iterateNewton(z, r);
}

/** Seeks from starts spread evenly (Halton's sequence) around z, then between the stable equilibria; each once. */
void Settling::searchOthers(const VectorXd& z, StaticResult& result) {
  constexpr std::array<int, 12> kPrimes = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37};
  const scene::StaticSpec::Search& settings = *settings_.search;
  StaticResult::Search& found = result.search.emplace();
  std::vector<Known> known = {makeKnown(z)};
  deadline_ = std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(settings.maxWallTime_s));
  const auto add = [&](const VectorXd& candidate) -> Known& {
    for (Known& other : known) {
      if (other.isAt(candidate)) return other;
    }
    return known.emplace_back(makeKnown(candidate));
  };
  const auto stop = [&] {
    std::ostringstream text;
    text << "search.max_wall_time of " << settings.maxWallTime_s << " s is over";
    found.complete = false;
    found.stopped = std::chrono::steady_clock::now() > *deadline_ ? text.str() : "interrupted";
  };
  for (int i = 1; i <= settings.starts && found.complete; ++i) {
    done_ = share_ * i;
    VectorXd candidate = z, r;
    for (int k = 0; k < z.size(); ++k) {
      double part = 0, share = 1;
      for (int rest = i, base = kPrimes[static_cast<size_t>(k) % kPrimes.size()]; rest > 0; rest /= base) {
        share /= base;
        part += share * (rest % base);
      }
      const bool isAngle = dynamics_.knee().coordinates()[static_cast<size_t>(dynamics_.freeCoordinates()[static_cast<size_t>(k)])].isAngle;
      candidate[k] += (2 * part - 1) * (isAngle ? kAngleLength_m * settings.angle_rad : settings.translation_m);
    }
    // One body through the other: halfway back, until it is a pose.
    int halvings = 0;
    for (; halvings < 20 && !ReducedDynamics::isValid(dynamics_.calcStaticForce(candidate, r)); ++halvings) candidate = 0.5 * (candidate + z);
    if (!mayContinue(0)) {
      stop();
      break;
    }
    found.movedBack += halvings > 0 ? 1 : 0;
    const Outcome outcome = seek(candidate, r);
    if (outcome.interrupted) {
      stop();
      break;
    }
    ++found.starts;
    if (outcome.converged) {
      ++found.converged;
      found.afterEuler += outcome.usedEuler ? 1 : 0;
      ++add(candidate).starts;
    } else {
      found.failures.push_back("start " + std::to_string(i) + ": " + outcome.reason);
    }
  }
  // Along the shortest tree that joins the stable ones; what is stable and new in between is joined as well.
  std::vector<std::pair<size_t, size_t>> tried;
  for (bool going = found.complete; going;) {
    going = false;
    std::vector<size_t> in = {}, out;
    for (size_t i = 0; i < known.size(); ++i) {
      if (isUnstable(known[i].stiffnesses)) continue;
      (in.empty() ? in : out).push_back(i);
    }
    while (!out.empty() && !going) {
      std::pair<size_t, size_t> pair{in[0], out[0]};
      const auto distance = [&](size_t i, size_t j) { return (known[i].z - known[j].z).norm(); };
      for (const size_t i : in) {
        for (const size_t j : out) {
          if (distance(i, j) < distance(pair.first, pair.second)) pair = {i, j};
        }
      }
      in.push_back(pair.second);
      out.erase(std::find(out.begin(), out.end(), pair.second));
      if (std::find(tried.begin(), tried.end(), pair) != tried.end()) continue;
      tried.push_back(pair);
      const size_t before = known.size();
      VectorXd pass;
      const Outcome outcome = findPass(known[pair.first].z, known[pair.second].z, pass);
      if (outcome.interrupted) {
        stop();
        break;
      }
      if (outcome.converged) {
        add(pass);
      } else {
        found.failures.push_back("between two stable equilibria: " + outcome.reason);
      }
      going = known.size() > before && !isUnstable(known.back().stiffnesses);
    }
    going = going && found.complete;
  }
  deadline_.reset();
  found.backToFirst = known[0].starts;
  for (size_t i = 1; i < known.size(); ++i) {
    StaticResult::Equilibrium& other = found.others.emplace_back();
    other.q = dynamics_.coordinates(known[i].z);
    other.stiffness_NPerM.assign(known[i].stiffnesses.data(), known[i].stiffnesses.data() + known[i].stiffnesses.size());
    other.starts = known[i].starts;
    other.unstable = isUnstable(known[i].stiffnesses);
  }
}

/** Solves the step for z1: f(z1, v1) - M (v1 - v0)/h - bias - c v1 = 0 with v1 = (z1 - z0)/h, by Newton with a
 finite-difference Jacobian. */
bool Settling::solveImplicitStep(const VectorXd& z0, const VectorXd& v0, double h, double damping, VectorXd& z1,
                                 VectorXd& v1, int& iterations, bool& sawFullPenetration) {
  constexpr int kMaxIterations = 12;
  const int n = dynamics_.numFree();
  const auto residual = [&](const VectorXd& z, VectorXd& g) {
    const VectorXd v = (z - z0) / h;
    const EvaluationStatus status = dynamics_.calcDynamicResidual(z, v, (v - v0) / h, g);
    sawFullPenetration |= status == EvaluationStatus::fullPenetration;
    g -= damping * v;
    return ReducedDynamics::isValid(status);
  };
  z1 = z0;
  VectorXd g, gShifted;
  MatrixXd J(n, n);
  if (!residual(z1, g)) return false;
  for (iterations = 0; iterations < kMaxIterations; ++iterations) {
    VectorXd shifted = z1;
    for (int k = 0; k < n; ++k) {
      shifted[k] = z1[k] + ReducedDynamics::kDifference_m;
      if (!residual(shifted, gShifted)) return false;
      J.col(k) = (gShifted - g) / (shifted[k] - z1[k]);
      shifted[k] = z1[k];
    }
    VectorXd move = J.partialPivLu().solve(-g);
    const double size = infinityNorm(move);
    if (!(size < kInfinity)) return false;
    if (size > 2 * kMaxMove_m) move *= 2 * kMaxMove_m / size;
    bool accepted = false;
    for (int halving = 0; halving < 6 && !accepted; ++halving, move *= 0.5) {
      VectorXd candidate = z1 + move;
      if (!residual(candidate, gShifted)) continue;
      accepted = true;
      z1 = candidate;
      g = gShifted;
      if (infinityNorm(move) < 1e-12 || infinityNorm(g) < 0.1 * settings_.maxResidual_N) {
        v1 = (z1 - z0) / h;
        return true;
      }
    }
    if (!accepted) return false;
  }
  return false;
}

/** [BF2004 §3.1]: dynamic simulation with large damping. The acceleration that ends it is that of the body released at
 rest without the damping: near the end of a heavily damped motion the momentary one is small long before the forces
 balance. */
Outcome Settling::integrateImplicitEuler(VectorXd& z, VectorXd& r, double maxAcceleration) {
  constexpr double kFirstStep_s = 1e-3, kSmallestStep_s = 1e-10, kSpeed_mPerS = 0.1;
  constexpr int kMaxSteps = 2000;
  Outcome outcome;
  if (!ReducedDynamics::isValid(dynamics_.calcStaticForce(z, r))) {
    outcome.elementProblem = dynamics_.elementProblem();
    outcome.reason = "the start is not a valid pose";
    return outcome;
  }
  // Chosen so that the starting force alone moves the body at 0.1 m/s.
  const double damping =
      settings_.damping_NsPerM > 0 ? settings_.damping_NsPerM : std::max(infinityNorm(r), 1.0) / kSpeed_mPerS;
  const VectorXd start = z;
  VectorXd v = VectorXd::Zero(z.size()), z1, v1;
  double time = 0, h = kFirstStep_s;
  double firstAcceleration = 0;
  while (true) {
    if (!ReducedDynamics::isValid(dynamics_.calcStaticForce(z, r))) {
      outcome.reason = "an accepted pose is not valid";
      return outcome;
    }
    outcome.touched |= dynamics_.hasContact();
    const double acceleration = dynamics_.calcRestAcceleration(r);
    if (outcome.iterations == 0) firstAcceleration = std::max(acceleration, 2 * maxAcceleration);
    if (acceleration <= maxAcceleration) {
      outcome.converged = true;
      return outcome;
    }
    if (!mayContinue(std::log(acceleration / firstAcceleration) / std::log(maxAcceleration / firstAcceleration))) {
      outcome.interrupted = true;
      return outcome;
    }
    if (!dynamics_.hasContact() && infinityNorm(z - start) > 0.2) {
      outcome.reason = dynamics_.knee().contact().numContactPairs() > 0 ? "the bodies moved 200 mm without contact"
                                                                        : "the bodies moved 200 mm: nothing holds them";
      return outcome;
    }
    if (time > settings_.maxTime_s || outcome.iterations >= kMaxSteps || h < kSmallestStep_s) {
      std::ostringstream text;
      text << "after " << time << " s of simulated time the acceleration is " << acceleration;
      outcome.reason = text.str();
      return outcome;
    }
    int iterations = 0;
    if (!solveImplicitStep(z, v, h, damping, z1, v1, iterations, outcome.sawFullPenetration)) {
      h /= 4;
      continue;
    }
    const double move = infinityNorm(z1 - z);
    if (move > 2 * kMaxMove_m) {
      h *= std::max(0.25, kMaxMove_m / move);
      continue;
    }
    z = z1;
    v = v1;
    time += h;
    ++outcome.iterations;
    if (iterations <= 5) h *= 1.5;
  }
}

void Settling::fillResult(const VectorXd& z, StaticResult& result) {
  VectorXd r;
  dynamics_.calcStaticForce(z, r);
  const KneeSystem& knee = dynamics_.knee();
  result.q = dynamics_.coordinates(z);
  result.residual_N = infinityNorm(r);
  result.maxAcceleration = dynamics_.calcRestAcceleration(r);
  result.constraintForce = dynamics_.calcHoldingForces();
  for (int i : dynamics_.freeCoordinates()) result.constraintForce[static_cast<size_t>(i)] = 0;
  result.contacts.clear();
  for (int i = 0; i < knee.contact().numContactPairs(); ++i) {
    result.contacts.push_back(knee.contact().getResultWithEnergy(dynamics_.state(), i));
  }
  result.elementColumns = knee.listElementColumns();
  result.elements = knee.calcElementOutputs(dynamics_.state());
  result.paths = knee.calcElementPaths(dynamics_.state());
}

/** Newton's method or a registered one; where it does not converge, implicit Euler from the same start and Newton's method after it. */
Outcome Settling::seek(VectorXd& z, VectorXd& r) {
  const VectorXd start = z;
  const EquilibriumSolver* solver = settings_.method == Method::kinsol ? findEquilibriumSolver("kinsol") : nullptr;
  Outcome first = solver != nullptr ? solveElsewhere(*solver, z, r) : iterateNewton(z, r);
  first.method = solver != nullptr ? "kinsol" : "newton";
  if (first.converged || first.interrupted) return first;
  z = start;
  const Outcome coarse = integrateImplicitEuler(z, r, std::max(100 * settings_.maxAcceleration_mPerS2, 0.1));
  Outcome outcome = coarse.converged ? iterateNewton(z, r) : coarse;
  outcome.iterations = first.iterations + coarse.iterations + (coarse.converged ? outcome.iterations : 0);
  outcome.sawFullPenetration |= first.sawFullPenetration || coarse.sawFullPenetration;
  outcome.touched |= first.touched || coarse.touched;
  outcome.method = solver != nullptr ? "newton after implicit Euler (kinsol: " + first.reason + ")" : "newton after implicit Euler";
  outcome.usedEuler = true;
  return outcome;
}

StaticResult Settling::run() {
  StaticResult result;
  result.time_s = settings_.time_s;
  if (settings_.search) share_ = 1.0 / (1 + settings_.search->starts);
  const VectorXd start = findStart();
  VectorXd z = start, r;
  Outcome outcome;

  if (settings_.method == Method::implicitEuler) {
    result.method = "implicit Euler";
    outcome = integrateImplicitEuler(z, r, settings_.maxAcceleration_mPerS2);
    result.iterations = outcome.iterations;
  } else {
    outcome = seek(z, r);
    result.method = outcome.method;
    result.iterations = outcome.iterations;
    if (outcome.converged && settings_.method == Method::both) {
      VectorXd zEuler = start;
      const Outcome euler = integrateImplicitEuler(zEuler, r, settings_.maxAcceleration_mPerS2);
      result.iterations += euler.iterations;
      outcome.interrupted = euler.interrupted;
      if (euler.converged) {
        result.methodDifference_m = infinityNorm(zEuler - z);
        if (*result.methodDifference_m > kMethodAgreement_m) {
          std::ostringstream text;
          text << "newton and implicit Euler end " << *result.methodDifference_m * 1e3
               << " mm apart: there are several equilibria, or maxAcceleration is too large";
          outcome.converged = false;
          outcome.reason = text.str();
        }
      } else {
        outcome.converged = false;
        outcome.reason = "newton found an equilibrium, implicit Euler did not: " + euler.reason;
      }
    }
  }
  fillResult(z, result);
  const bool touching = dynamics_.hasContact();
  const ArticularContactSubsystem::Counters& counters = dynamics_.knee().contact().getCounters(dynamics_.state());
  result.contactEvaluations = counters.evaluations;
  result.distanceQueries = counters.distanceQueries;

  if (outcome.interrupted) {
    result.status = StaticResult::Status::interrupted;
    result.statusText = "interrupted";
    return result;
  }
  const bool hasPairs = dynamics_.knee().contact().numContactPairs() > 0;
  // Ligaments can hold bodies apart; without them separated bodies have nothing to rest on.
  if (hasPairs && !touching && dynamics_.knee().elements().empty()) {
    throw ComputationError(
        where() + (outcome.touched ? "contact is lost: the loads drive the bodies apart" : "contact is never made") +
        (outcome.reason.empty() ? std::string() : " (" + outcome.reason + ")") + "; " + kNoContactAdvice);
  }
  if (!outcome.converged && outcome.sawFullPenetration) {
    throw ComputationError(where() + "full penetration before the forces balance; " + kPenetrationAdvice);
  }
  if (outcome.converged) {
    result.status = StaticResult::Status::converged;
    result.statusText = hasPairs && !touching ? "converged without contact" : "converged";
    const VectorXd stiffness = makeKnown(z).stiffnesses;
    result.stiffness_NPerM.assign(stiffness.data(), stiffness.data() + stiffness.size());
    result.unstable = isUnstable(stiffness);
    if (result.unstable) {
      result.statusText += " to an unstable equilibrium: the least disturbance makes the body leave it";
    }
    if (settings_.search) {
      searchOthers(z, result);
      result.contactEvaluations = counters.evaluations;
      result.distanceQueries = counters.distanceQueries;
      const size_t others = result.search->others.size();
      if (others > 0) result.statusText += "; " + std::to_string(others) + (others == 1 ? " other equilibrium" : " other equilibria") + " found";
      if (!result.search->complete) {
        result.statusText += "; search ended after " + std::to_string(result.search->starts) + " of " + std::to_string(settings_.search->starts) + " starts: " + result.search->stopped;
      }
    }
    for (const contact::ContactResult& contact : result.contacts) {
      if (contact.status == EvaluationStatus::extrapolated) {
        result.statusText += "; some elements are beyond the range of the pressure law (d/h > 0.95)";
      }
    }
  } else {
    if (!outcome.elementProblem.empty()) {
      result.statusText = "no equilibrium found, the start is not a valid pose: " + outcome.elementProblem;
      return result;
    }
    result.statusText = "no equilibrium found: " + outcome.reason +
                        "; check that the loads press the bodies together and that every free coordinate is held by "
                        "contact or a spring, or try another start";
  }
  return result;
}

}  // namespace

scene::Coordinates calcEquilibriumRates(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Coordinates& q,
                                        double time_s) {
  // Moves of the order of the stiffness differences at gait speeds, far above the force's rounding.
  constexpr double kTimeStep_s = 1e-6;
  ReducedDynamics now(knee, defaultState, time_s), later(knee, defaultState, time_s + kTimeStep_s);
  const VectorXd z = now.scaled(q);
  VectorXd r0, r1;
  MatrixXd K;
  scene::Coordinates rates(q.size(), 0.0);
  if (now.numFree() == 0 || !ReducedDynamics::isValid(now.calcStaticForce(z, r0)) || !now.calcStiffness(z, r0, K) ||
      !ReducedDynamics::isValid(later.calcStaticForce(z, r1))) {
    return rates;
  }
  const scene::Coordinates values = now.coordinates(solveStiffness(K, (r1 - r0) / kTimeStep_s));
  for (int i : now.freeCoordinates()) rates[static_cast<size_t>(i)] = values[static_cast<size_t>(i)];
  return rates;
}

double cpuTime_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

StaticResult settle(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Scene& scene,
                    const scene::StaticSpec& settings, const scene::Progress& progress, const scene::Coordinates* start) {
  const auto wallStart = std::chrono::steady_clock::now();
  const double cpuStart = cpuTime_s();
  checkStaticMethod(scene, settings);
  knee.checkTablesCover(settings.time_s, settings.time_s);
  StaticResult result = Settling(knee, defaultState, scene, settings, progress, start).run();
  result.wallTime_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wallStart).count();
  result.cpuTime_s = cpuTime_s() - cpuStart;
  return result;
}

StaticResult runStatic(KneeSystem& knee, const scene::Scene& scene, const scene::Progress& progress) {
  const SimTK::State& state = knee.system().realizeTopology();
  SimTK::State modelState = state;
  knee.system().realizeModel(modelState);
  return settle(knee, modelState, scene, scene.staticAnalysis.value_or(scene::StaticSpec{}), progress);
}

StaticResult runStatic(const scene::Scene& scene, const scene::Progress& progress) {
  KneeSystem knee(scene);
  return runStatic(knee, scene, progress);
}

}  // namespace genu::model
