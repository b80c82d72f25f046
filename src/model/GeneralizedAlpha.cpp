#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "OdeIntegrators.h"

namespace genu::model {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/** Generalized-alpha method [Chung & Hulbert, J Appl Mech 60 (1993) 371] on u' = A(t, q, u) with q' = u, fixed step h:

   (1 - am) a1 + am a0 = (1 - af) A1 + af A0
   q1 = q0 + h u0 + h^2 ((1/2 - beta) a0 + beta a1),   u1 = u0 + h ((1 - gamma) a0 + gamma a1)

 a: an auxiliary acceleration, A0 and A1 the true ones at both ends; am = (2 rho - 1)/(rho + 1), af = rho/(rho + 1), gamma = 1/2 - am + af,
 beta = (1 - am + af)^2/4. Second order; rho in [0, 1] is what is left of a vibration much faster than h after one step. Solved for a1 by Newton
 iteration with the matrix (1 - am) I - (1 - af) (h gamma dA/du + h^2 beta dA/dq), kept while it converges. States z beyond coordinates and rates
 (activation, fibre lengths), z' = B: the method's form for first order [Jansen, Whiting & Hulbert, Comput Methods Appl Mech Eng 190
 (2000) 305] of the same rho,

   bm b1 + (1 - bm) b0 = bf B1 + (1 - bf) B0,   z1 = z0 + h ((1 - g) b0 + g b1)
   bm = (3 - rho)/(2 (1 + rho)), bf = 1/(1 + rho), g = 1/2 + bm - bf */
class GeneralizedAlpha : public OdeIntegrator {
 public:
  GeneralizedAlpha(OdeProblem& problem, double step_s) : problem_(problem), wanted_(step_s > 0 ? step_s : kStep_s) {}

  std::string name() const override { return "generalized-alpha"; }

  bool initialize(double t0, const std::vector<double>& y0, double stopTime) override {
    n_ = problem_.numCoordinates();
    size_ = problem_.size();
    if (n_ <= 0) {
      error_ = "generalized-alpha needs coordinates with their rates";
      return false;
    }
    time_ = previousTime_ = start_ = t0;
    divide(stopTime);
    y_ = Eigen::Map<const VectorXd>(y0.data(), size_);
    rate_.resize(size_);
    if (!evaluate(t0, y_, rate_)) {
      error_ = "the start is not a valid state";
      return false;
    }
    a_.resize(size_ - n_);
    a_ << rate_.segment(n_, n_), rate_.tail(size_ - 2 * n_);
    yPrevious_ = y_;
    ratePrevious_ = rate_;
    taken_ = accepted_ = 0;
    counts_ = {};
    longest_ = std::numeric_limits<double>::infinity();
    slopeStep_ = 0;
    haveMatrix_ = false;
    return true;
  }

  bool step() override {
    if (taken_ >= steps_) return false;
    yPrevious_ = y_;
    ratePrevious_ = rate_;
    const VectorXd aPrevious = a_;
    previousTime_ = time_;
    // A step that does not converge, or errs too much, is taken in halves; the length of the next one is not affected.
    if (!advance(previousTime_, start_ + h_ * static_cast<double>(taken_ + 1), 0)) {
      y_ = yPrevious_;
      rate_ = ratePrevious_;
      a_ = aPrevious;
      if (error_.empty()) error_ = "the step did not converge; shorten it (step)";
      return false;
    }
    ++taken_;
    time_ = start_ + h_ * static_cast<double>(taken_);
    return true;
  }

  double fixedStep_s() const override { return wanted_; }
  double time() const override { return time_; }
  int worstComponent() override { return worst_; }
  void limitStep(double longest) override { longest_ = longest; }

  bool continueTo(double stopTime) override {
    start_ = time_;
    divide(stopTime);
    taken_ = 0;
    return true;
  }

  bool interpolate(double t, std::vector<double>& y) override {
    // Of the order of the method and one more.
    const auto list = [](const VectorXd& v) { return std::vector<double>(v.data(), v.data() + v.size()); };
    interpolateCubic(t, previousTime_, list(yPrevious_), list(ratePrevious_), time_, list(y_), list(rate_), y);
    return true;
  }

  Statistics statistics() override {
    Statistics s = counts_;
    s.convergenceFailures = s.stepsAttempted - accepted_ - s.errorTestFailures;
    s.stepsTaken = accepted_;
    return s;
  }
  const std::string& errorText() const override { return error_; }

 private:
  static constexpr double kStep_s = 2e-3, kRho = 0.5;
  static constexpr double kAm = (2 * kRho - 1) / (kRho + 1), kAf = kRho / (kRho + 1), kGamma = 0.5 - kAm + kAf,
                          kBeta = 0.25 * (1 - kAm + kAf) * (1 - kAm + kAf), kBm = (3 - kRho) / (2 * (1 + kRho)), kBf = 1 / (1 + kRho),
                          kG = 0.5 + kBm - kBf;

  /** Equal steps from start_ to the stop time. */
  void divide(double stopTime) {
    steps_ = std::max(1L, static_cast<long>(std::ceil((stopTime - start_) / wanted_ - 1e-9)));
    h_ = (stopTime - start_) / static_cast<double>(steps_);
  }

  bool evaluate(double t, const VectorXd& y, VectorXd& rate) {
    ++counts_.evaluations;
    return problem_.evaluate(t, y.data(), rate.data()) == OdeProblem::Evaluation::ok;
  }

  bool calcJacobian(double t, const VectorXd& y, const VectorXd& rate) {
    ++counts_.jacobians;
    jacobian_.resize(size_, size_);
    if (problem_.hasJacobian()) return problem_.calcJacobian(t, y.data(), jacobian_.data()) == OdeProblem::Evaluation::ok;
    VectorXd shifted = y, rateShifted(size_);
    for (int j = 0; j < size_; ++j) {
      // The tolerance of a component is its natural small step.
      const double step = 1e-2 * problem_.absoluteTolerances()[static_cast<size_t>(j)];
      shifted[j] = y[j] + step;
      if (!evaluate(t, shifted, rateShifted)) return false;
      jacobian_.col(j) = (rateShifted - rate) / (shifted[j] - y[j]);
      shifted[j] = y[j];
    }
    return true;
  }

  /** From the state at t0 to t1. */
  bool advance(double t0, double t1, int depth) {
    const VectorXd y0 = y_, rate0 = rate_, a0 = a_;
    const bool tooLong = t1 - t0 > longest_ && depth < kMaxHalvings;
    if (!tooLong && solve(t0, t1, y0, rate0, a0)) return true;
    if (depth >= kMaxHalvings) return false;
    y_ = y0;
    rate_ = rate0;
    a_ = a0;
    const double middle = 0.5 * (t0 + t1);
    haveMatrix_ = false;
    const bool ok = advance(t0, middle, depth + 1) && advance(middle, t1, depth + 1);
    haveMatrix_ = false;
    return ok;
  }

  /** One step by Newton iteration on w = (a1, b1), from (a0, b0). */
  bool solve(double t0, double t1, const VectorXd& y0, const VectorXd& rate0, const VectorXd& a0) {
    ++counts_.stepsAttempted;
    const double h = t1 - t0;
    const int m = size_ - 2 * n_;
    const auto q0 = y0.head(n_), u0 = y0.segment(n_, n_);
    VectorXd w(n_ + m), y(size_), rate(size_), residual(n_ + m);
    // Continued along a straight line from the step before: on smooth motion one iteration is then enough.
    w = a0;
    if (slopeStep_ > 0) w += h / slopeStep_ * slope_;
    const auto place = [&] {
      y.head(n_) = q0 + h * u0 + h * h * ((0.5 - kBeta) * a0.head(n_) + kBeta * w.head(n_));
      y.segment(n_, n_) = u0 + h * ((1 - kGamma) * a0.head(n_) + kGamma * w.head(n_));
      y.tail(m) = y0.tail(m) + h * ((1 - kG) * a0.tail(m) + kG * w.tail(m));
    };
    const auto& tolerance = problem_.absoluteTolerances();
    // Error of the step over the tolerance [Zienkiewicz & Xie, Earthq Eng Struct Dyn 20 (1991) 871]: h^2 (1/6 - beta) (a1 - a0).
    const auto findError = [&] {
      double error = 0;
      for (int k = 0; k < n_; ++k) {
        const double share = h * h * std::abs((1.0 / 6 - kBeta) * (w[k] - a0[k])) / tolerance[static_cast<size_t>(k)];
        if (share > error) error = share, worst_ = k;
      }
      return error;
    };
    double last = 0;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      // An iterate far beyond what the step may err by is deep in a layer, where an evaluation takes twenty times as long, and hardly ever comes back.
      if (findError() > kHopeless * kMostError) {
        ++counts_.errorTestFailures;
        return false;
      }
      place();
      if (!evaluate(t1, y, rate)) return false;
      residual.head(n_) = (1 - kAm) * w.head(n_) + kAm * a0.head(n_) - (1 - kAf) * rate.segment(n_, n_) - kAf * rate0.segment(n_, n_);
      residual.tail(m) = kBm * w.tail(m) + (1 - kBm) * a0.tail(m) - kBf * rate.tail(m) - (1 - kBf) * rate0.tail(m);
      if (!haveMatrix_ || std::abs(h - matrixStep_) > 1e-9 * h) {
        if (!factor(t1, y, rate, h)) return false;
      }
      const VectorXd change = lu_.solve(-residual);
      if (!change.allFinite()) return false;
      w += change;
      // What the change moves, over what is allowed.
      moved_.resize(static_cast<size_t>(size_));
      for (int k = 0; k < n_; ++k) {
        moved_[static_cast<size_t>(k)] = h * h * kBeta * change[k];
        moved_[static_cast<size_t>(n_ + k)] = h * kGamma * change[k];
      }
      for (int k = 0; k < m; ++k) moved_[static_cast<size_t>(2 * n_ + k)] = h * kG * change[n_ + k];
      worst_ = findWorst(moved_.data(), tolerance);
      const double size = worst_ < 0 ? 0 : std::abs(moved_[static_cast<size_t>(worst_)]) / tolerance[static_cast<size_t>(worst_)];
      const double contraction = iteration > 0 && last > 0 ? size / last : 0.3;
      // What the next iteration would still change.
      if (size * contraction / std::max(1e-3, 1 - std::min(contraction, 0.999)) < kNewton && contraction < 1) {
        place();
        if (findError() > kMostError) {
          ++counts_.errorTestFailures;
          return false;
        }
        y_ = y;
        // The accelerations that the step's equation asks for: they differ from those of an evaluation by what Newton left.
        rate_.head(n_) = y.segment(n_, n_);
        rate_.segment(n_, n_) = ((1 - kAm) * w.head(n_) + kAm * a0.head(n_) - kAf * rate0.segment(n_, n_)) / (1 - kAf);
        rate_.tail(m) = (kBm * w.tail(m) + (1 - kBm) * a0.tail(m) - (1 - kBf) * rate0.tail(m)) / kBf;
        a_ = w;
        slope_ = w - a0;
        slopeStep_ = h;
        ++accepted_;
        if (contraction > 0.3) haveMatrix_ = false;
        return true;
      }
      if (iteration > 0 && contraction > 0.5) haveMatrix_ = false;
      last = size;
    }
    return false;
  }

  bool factor(double t, const VectorXd& y, const VectorXd& rate, double h) {
    if (!calcJacobian(t, y, rate)) return false;
    const int m = size_ - 2 * n_;
    MatrixXd matrix = MatrixXd::Zero(n_ + m, n_ + m);
    // d(y)/d(w): q moves by h^2 beta, u by h gamma, z by h gamma.
    MatrixXd moves = MatrixXd::Zero(size_, n_ + m);
    for (int k = 0; k < n_; ++k) moves(k, k) = h * h * kBeta, moves(n_ + k, k) = h * kGamma;
    for (int k = 0; k < m; ++k) moves(2 * n_ + k, n_ + k) = h * kG;
    const MatrixXd change = jacobian_ * moves;
    matrix.topRows(n_) = -(1 - kAf) * change.middleRows(n_, n_);
    matrix.bottomRows(m) = -kBf * change.bottomRows(m);
    for (int k = 0; k < n_; ++k) matrix(k, k) += 1 - kAm;
    for (int k = 0; k < m; ++k) matrix(n_ + k, n_ + k) += kBm;
    lu_.compute(matrix);
    matrixStep_ = h;
    haveMatrix_ = true;
    return true;
  }

  static constexpr int kMaxIterations = 12, kMaxHalvings = 12;
  static constexpr double kNewton = 0.2;  // of the tolerance
  /** Of the tolerance: 20 um and more at an accuracy of 1e-4. A fixed step is the user's choice; this only stops it from being absurd. */
  static constexpr double kMostError = 200, kHopeless = 25;

  OdeProblem& problem_;
  double wanted_, h_ = 0, start_ = 0, time_ = 0, previousTime_ = 0, matrixStep_ = 0;
  int n_ = 0, size_ = 0;
  long steps_ = 0, taken_ = 0, accepted_ = 0;
  double longest_ = std::numeric_limits<double>::infinity();
  bool haveMatrix_ = false;
  int worst_ = -1;
  std::vector<double> moved_;
  VectorXd y_, rate_, a_, yPrevious_, ratePrevious_, slope_;
  double slopeStep_ = 0;
  MatrixXd jacobian_;
  Eigen::PartialPivLU<MatrixXd> lu_;
  Statistics counts_;
  std::string error_;
};

}  // namespace

std::unique_ptr<OdeIntegrator> makeGeneralizedAlpha(OdeProblem& problem, const OdeSettings& settings) {
  return std::make_unique<GeneralizedAlpha>(problem, settings.step_s);
}

}  // namespace genu::model
