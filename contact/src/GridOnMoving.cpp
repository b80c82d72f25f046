#include "detail/GridOnMoving.h"

#include <utility>

namespace genu::contact::detail {

ContactPairDefinition exchangeBodies(const ContactPairDefinition& definition) {
  ContactPairDefinition d = definition;
  for (CompartmentDefinition& c : d.compartments) std::swap(c.fixedSurface, c.movingSurface);
  d.fixedThickness = definition.movingThickness;
  d.movingThickness = definition.fixedThickness;
  if (d.movingMaterial) std::swap(d.material, *d.movingMaterial);
  return d;
}

// With f', m' the load on F, in M, about Mo, and R, p the pose of M in F:
//   f = -R f',   m_Fo = -R m' + p x f

void mapLoadFromM(const Pose& X_FM, NetLoad& load) {
  const Vec3 f = -(X_FM.R * load.forceOnM_F);
  load.momentOnM_Fo_F = -(X_FM.R * load.momentOnM_Fo_F) + X_FM.p.cross(f);
  load.forceOnM_F = f;
  if (load.peakPressure_Pa > 0) load.peakPoint_F = X_FM.apply(load.peakPoint_F);
  if (load.scalarForce_N > 0) load.centerOfPressure_F = X_FM.apply(load.centerOfPressure_F);
}

void mapMotionToM(const Pose& X_FM, Vec3& v, Vec3& w) {
  v = -(X_FM.R.transpose() * (v + w.cross(X_FM.p)));
  w = -(X_FM.R.transpose() * w);
}

void mapStiffnessFromM(const Pose& X_FM, const Vec3& v_F, const Vec3& w_F, const Vec3& force, const Vec3& moment, Matrix6& byMotion,
                       Matrix6& byRate) {
  // A small motion (v, w) of M at Fo, in F, moves F in M by v' = -R^T (v + w x p), w' = -R^T w at Mo. Then
  //   df = w x f - R df',   dm = w x (m - p x f) - R dm' + (v + w x p) x f + p x df
  // It also turns the rates V' = -R^T (V + W x p), W' = -R^T W:
  //   dV' = R^T (w x (V + W x p) - W x dp),   dW' = R^T (w x W),   dp = v + w x p
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  const Mat3 R_MF = X_FM.R.transpose();
  Matrix6 stiffness, damping;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const Vec3 v = k < 3 ? Vec3(Vec3::Unit(k)) : Vec3(Vec3::Zero());
    const Vec3 w = k < 3 ? Vec3(Vec3::Zero()) : Vec3(Vec3::Unit(k - 3));
    const Vec3 dp = v + w.cross(X_FM.p);
    Vector6 motion, turn;
    motion << -(R_MF * dp), -(R_MF * w);
    turn << R_MF * (w.cross(v_F + w_F.cross(X_FM.p)) - w_F.cross(dp)), R_MF * w.cross(w_F);
    const Vector6 change = byMotion * motion + byRate * turn, rate = byRate * motion;
    const Vec3 df = w.cross(force) - X_FM.R * change.head<3>();
    stiffness.col(k) << df, w.cross(moment - X_FM.p.cross(force)) - X_FM.R * change.tail<3>() + dp.cross(force) + X_FM.p.cross(df);
    const Vec3 dfByRate = -(X_FM.R * rate.head<3>());
    damping.col(k) << dfByRate, -(X_FM.R * rate.tail<3>()) + X_FM.p.cross(dfByRate);
  }
  byMotion = stiffness;
  byRate = damping;
}

void mapFieldFromM(const Pose& X_FM, ElementField& f) {
  f.p_FA = X_FM.apply(f.p_FA);
  f.normal_F = X_FM.R * f.normal_F;
  f.forceDirection_F = -(X_FM.R * f.forceDirection_F);
}

}  // namespace genu::contact::detail
