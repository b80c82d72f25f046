#pragma once

namespace genu::musculoskeletal {

struct CurvePoint {
  double value, slope;
};

/** Normalised curves of a Hill-type muscle, smooth and in closed form [De Groote, Kinney, Rao & Fregly 2016, Ann Biomed Eng 44:2922].

   active      f_l(l) = sum_i b1_i exp(-(l - b2_i)^2 / (2 (b3_i + b4_i l)^2)),  l fibre length over the optimal one
   passive     f_p(l) = (exp(k (l - 1)/e0) - q) / (exp(k) - q),  q = exp(k (0.2 - 1)/e0): 0 at l = 0.2, 1 at l = 1 + e0
   velocity    f_v(v) = d1 asinh(d2 v + d3) + d4,  v fibre velocity over the largest one, > 0 lengthening; 0 at -1, 1 at 0
   tendon      f_t(x) = c1 exp(kT (x - c2)) - c3,  x tendon length over its slack length, kT = ln((1 + c3)/c1)/(1 + eT - c2): 1 at x = 1 + eT

 with the constants of that paper as implemented in OpenSim's DeGrooteFregly2016Muscle. f_t(1) = 0 and, slack, down to -c3: negative by
 at most c3 = 0.2 (the paper's form, which keeps f_t invertible everywhere). f_p is below 0 by at most 1e-4 for 0 <= l < 0.2. f_v has no
 limits. Forces follow as f times the largest isometric force. */
struct MuscleCurves {
  double passiveStrain = 0.6;  ///< e0, at the largest isometric force
  double passiveShape = 4.0;   ///< k
  double tendonStrain = 0.049; ///< eT, at the largest isometric force

  /** @throws std::invalid_argument naming the quantity, its value and the allowed range */
  void validate() const;

  CurvePoint calcActive(double length) const;
  CurvePoint calcPassive(double length) const;
  CurvePoint calcVelocity(double velocity) const;
  CurvePoint calcTendon(double length) const;
  /** Closed forms. calcTendonLength: force > -0.2. */
  double calcTendonLength(double force) const;
  double calcVelocityOfForce(double force) const;
  /** Integrals from 1 (tendon) and from 0.2 (passive), in units of largest isometric force times slack or optimal length. */
  double calcTendonEnergy(double length) const;
  double calcPassiveEnergy(double length) const;
};

/** Smallest and largest fibre length over the optimal one at which the curves are read. */
inline constexpr double kShortestFibre = 0.2, kLongestFibre = 1.8;

}  // namespace genu::musculoskeletal
