#include "QuietStart.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <optional>

#include "KneeOde.h"
#include "ReducedDynamics.h"
#include "StaticAnalysis.h"

namespace genu::model {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStep_s = 1e-3, kShortest_s = 2e-5, kMostCorrection_m = 1e-4, kSlow = 0.3;
constexpr int kPoses = 4;

/** Newton from the equilibrium of a little earlier; so exact that second differences over kShortest_s still have two digits of 1 m/s^2. */
std::optional<VectorXd> follow(const KneeSystem& knee, const SimTK::State& defaultState, double time_s, VectorXd z) {
  constexpr int kMaxIterations = 8;
  constexpr double kConverged_m = 1e-12;
  ReducedDynamics dynamics(knee, defaultState, time_s);
  VectorXd r;
  MatrixXd K;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (!ReducedDynamics::isValid(dynamics.calcStaticForce(z, r, true)) || !dynamics.calcStiffness(z, r, K)) return std::nullopt;
    const VectorXd move = K.partialPivLu().solve(r);
    if (!move.allFinite() || move.cwiseAbs().maxCoeff() > kMostCorrection_m) return std::nullopt;
    z += move;
    if (move.cwiseAbs().maxCoeff() < kConverged_m) return z;
  }
  return std::nullopt;
}

/** The correction c at a pose on the path; z: scaled to lengths. */
std::optional<VectorXd> findCorrection(KneeOde& ode, const ReducedDynamics& scale, double time_s, const VectorXd& z, const VectorXd& v, const VectorXd& a) {
  const int n = scale.numFree(), size = ode.size();
  std::vector<double> y = ode.start(scale.coordinates(z), scale.coordinateRates(v)), ydot(y.size());
  MatrixXd jacobian(size, size);
  const VectorXd perLength = scale.scales();
  if (ode.evaluate(time_s, y.data(), ydot.data()) != OdeProblem::Evaluation::ok || ode.calcJacobian(time_s, y.data(), jacobian.data()) != OdeProblem::Evaluation::ok) {
    return std::nullopt;
  }
  const VectorXd missing = a.cwiseProduct(perLength) - Eigen::Map<const VectorXd>(ydot.data() + n, n);
  const VectorXd c = jacobian.block(n, 0, n, n).partialPivLu().solve(missing).cwiseQuotient(perLength);
  if (!c.allFinite() || c.cwiseAbs().maxCoeff() > kMostCorrection_m) return std::nullopt;
  return c;
}

}  // namespace

QuietStart findQuietStart(const KneeSystem& knee, const SimTK::State& defaultState, const scene::Coordinates& q) {
  const QuietStart plain = {q, calcEquilibriumRates(knee, defaultState, q, 0)};
  // All poses lie before the first kink or jump of an input.
  double h = kStep_s;
  for (const KneeSystem::InputBreak& entry : knee.listInputBreaks()) {
    if (entry.time_s > 0) h = std::min(h, entry.time_s / kPoses);
  }
  if (h < kShortest_s) return plain;
  KneeOde ode(knee, defaultState, OdeTolerances::of(1e-4), KneeOde::Prescribed::eliminated);
  const ReducedDynamics now(knee, defaultState, 0);
  if (now.numFree() == 0 || !ode.hasJacobian()) return plain;
  std::array<VectorXd, kPoses> z;
  const VectorXd rate = now.scaled(plain.qdot);
  for (int k = 0; k < kPoses; ++k) {
    const VectorXd guess = k == 0 ? now.scaled(q) : VectorXd(z[static_cast<size_t>(k - 1)] + h * rate);
    const std::optional<VectorXd> found = follow(knee, defaultState, k * h, guess);
    if (!found) return plain;
    z[static_cast<size_t>(k)] = *found;
  }
  // Differences of second order (the first rate: third) at t = 0 and one step later.
  const VectorXd v0 = (-11 * z[0] + 18 * z[1] - 9 * z[2] + 2 * z[3]) / (6 * h), v1 = (z[2] - z[0]) / (2 * h);
  const VectorXd v2 = (z[3] - z[1]) / (2 * h);
  const VectorXd a0 = (2 * z[0] - 5 * z[1] + 4 * z[2] - z[3]) / (h * h), a1 = (z[0] - 2 * z[1] + z[2]) / (h * h), a2 = (z[1] - 2 * z[2] + z[3]) / (h * h);
  const std::optional<VectorXd> c0 = findCorrection(ode, now, 0, z[0], v0, a0), c1 = findCorrection(ode, now, h, z[1], v1, a1),
                                c2 = findCorrection(ode, now, 2 * h, z[2], v2, a2);
  if (!c0 || !c1 || !c2) return plain;
  // c'' is the next term of the same expansion: not small, the motion is not slow against its modes.
  const VectorXd next = (*c0 - 2 * *c1 + *c2) / (h * h);
  if (next.cwiseAbs().maxCoeff() > kSlow * a0.cwiseAbs().maxCoeff()) return plain;
  return {now.coordinates(z[0] + *c0), now.coordinateRates(v0 + (*c1 - *c0) / h)};
}

}  // namespace genu::model
