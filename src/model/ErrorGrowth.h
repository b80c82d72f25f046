#pragma once

#include <Eigen/Dense>
#include <vector>

#include "KneeOde.h"

namespace genu::model {

/** Follows, while a run goes on, what the integration errs by: the errors that the integrator estimates of its steps, carried on by the motion's own Jacobian J = dy'/dy.

   (1 - h/2 J) e_n = (1 + h/2 J) e_(n-1) + (1 - h/2 J) a (a - h J)^-1 d_n

 e error of y after step n, d_n estimated error of step n alone. The true motion passes an error on by exp(h J), here the implicit midpoint rule, which keeps the size of
 an error that vibrates, whatever h, and makes of an error of a speed one of a path. The estimates of d_n are differences of the formulas, which know nothing of stiffness; an implicit step errs
 by a (a - h J)^-1 of them [Hairer & Wanner, Solving ODEs II, IV.8], a = 3/2 for BDF of second order, 1 for the first step of a part. What has been lost of a vibration has been lost in
 steps, and is counted in their d_n.
 The error of the forces is that of the generalized forces on the free coordinates, M (J e)_u with moments divided by kAngleLength_m, the largest of them.

 Linear: errors of the size of the motion itself are told by their order only. J is the integrator's where it makes them, otherwise an evaluation with the exact stiffness wherever the
 contact force has changed by a quarter, and every kMostSteps steps; of any integrator where a compartment has touched or left. */
class ErrorGrowth {
 public:
  explicit ErrorGrowth(KneeOde& ode);
  /** A part begins: its first step is of first order. What came before is kept. */
  void restart() { first_ = true; }
  /** After a step of length h to t, y. */
  void addStep(double t, double h, const std::vector<double>& y, const std::vector<double>& stepErrors);

  /** Largest error of a free coordinate so far, angles times kAngleLength_m. */
  double pose_m() const { return pose_m_; }
  /** Mean error of the forces over their mean, so far; 0 without contact. */
  double force() const { return forceSum_ > 0 ? errorSum_ / forceSum_ : 0; }

 private:
  /** False: there is none. */
  bool updateJacobian(double t, const std::vector<double>& y);

  static constexpr int kMostSteps = 25;
  KneeOde& ode_;
  Eigen::Index size_ = 0, n_ = 0;
  std::vector<int> free_;  // among the unknown coordinates
  Eigen::VectorXd scale_;  // of coordinates: 1 or kAngleLength_m
  Eigen::MatrixXd jacobian_, mass_;
  Eigen::VectorXd error_;
  std::vector<double> values_;
  double force_N_ = -1;
  int age_ = 0, touching_ = -1;
  bool first_ = true, supplied_ = false;  // supplied_: the integrator makes Jacobians
  double pose_m_ = 0, errorSum_ = 0, forceSum_ = 0;
};

}  // namespace genu::model
