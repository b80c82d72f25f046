#include <algorithm>
#include <cmath>

#include "detail/ContactPairImpl.h"

namespace genu::contact {

using namespace detail;

template <class Law>
void ContactPair::Impl::evaluateCentre(const Law& law_, const Compartment& c, const EvaluationTask& task, CompartmentMemory& memory,
                                       NetLoad& load, int& queries) const {
  const Pose& X_FM = task.X_FM;
  const bool withEnergy = task.withEnergy;
  const unsigned stamp = task.stamp;
  const Mat3 R_MF = X_FM.R.transpose();
  const Vec3 offset = R_MF * X_FM.p;
  const bool corrected = definition.correction == Correction::midsurface, byRay = definition.distance == DistanceMethod::ray;
  memory.active.clear();
  const SurfaceParameter* neighbor = nullptr;  // the foot found last: a good first guess for a new element

  // Tests one element; returns whether it is in contact.
  const auto test = [&](int e, const Vec3& p_MA) {
    const size_t i = static_cast<size_t>(e);
    const SurfaceParameter* seed = memory.foot[i].patch >= 0 ? &memory.foot[i] : neighbor;
    const ClosestPoint foot = c.moving->findClosestPoint(p_MA, seed);
    ++queries;
    memory.foot[i] = foot.at;
    memory.p_MA[i] = p_MA;
    memory.distance_m[i] = foot.distance_m;
    memory.onBorder[i] = foot.status == QueryStatus::onBoundary;
    neighbor = &memory.foot[i];
    if (foot.status == QueryStatus::notConverged) {
      ++load.notConvergedQueries;
      memory.clearance_m[i] = 0;
      return false;
    }
    memory.clearance_m[i] = std::max(foot.distance_m, 0.0);
    if (!(foot.distance_m < 0)) return false;
    // Where on the moving surface, how far along which direction: the closest point, or the first hit along n. Because
    // |AC| >= |AB| on the same side, elements with AB >= 0 need no ray.
    SurfaceParameter at = foot.at;
    Vec3 p_M = foot.p_MB, normal_M = foot.normal_M;
    double distance = foot.distance_m;
    if (byRay) {
      const Vec3 n_M = R_MF * c.normal_F[i];
      TrackedHit& hit = memory.hits[i];
      if (hit.patch < 0) {  // no hit to start from: start from the foot
        hit = TrackedHit{};
        hit.patch = at.patch;
        hit.u = at.u;
        hit.v = at.v;
      }
      trackHits(*c.moving, p_MA.data(), n_M.data(), &e, 1, memory.hits.data());
      ++queries;
      if (hit.status != HitStatus::hit) {  // missed: the ray leaves through the surface's open side
        ++(hit.status == HitStatus::missed ? load.boundaryElements : load.notConvergedQueries);
        memory.onBorder[i] = hit.status == HitStatus::missed;
        return false;
      }
      at = {hit.patch, hit.u, hit.v};
      p_M = Eigen::Map<const Vec3>(hit.p_MC);
      normal_M = Eigen::Map<const Vec3>(hit.normal);
      distance = memory.distance_m[i] = hit.t_m;
      memory.onBorder[i] = false;
      if (!(distance < 0)) return false;
    } else if (foot.status == QueryStatus::onBoundary) {
      ++load.boundaryElements;
      return false;
    }
    Active a;
    a.element = e;
    const Vec3 towardsM_F = X_FM.R * -normal_M;
    const Vec3 sum = c.normal_F[i] + towardsM_F;
    const double length = sum.norm();  // 2 cos(theta/2)
    const double cosTheta = c.normal_F[i].dot(towardsM_F);
    double hM = 0;
    switch (movingLayer) {
      case MovingLayer::none: break;
      case MovingLayer::constant: hM = constantMoving_m; break;
      case MovingLayer::plane: {
        hM = std::abs(p_M.y() - planeMovingY_m);
        clampThickness(definition.movingThickness, hM);
        break;
      }
      case MovingLayer::map: hM = c.map->interpolate(at); break;
    }
    if (std::isnan(hM)) {
      ++load.noThicknessElements;
      return false;
    }
    a.hM_m = hM;
    a.h_m = c.hF_m[i] + hM;
    if (corrected && cosTheta > 0) {
      a.d_m = -2 * distance * (byRay ? cosTheta : 1) / length;
      a.direction_F = sum / length;
    } else {
      a.d_m = -distance;
      a.direction_F = byRay ? c.normal_F[i] : towardsM_F;
    }
    if (!(cosTheta > 0) || !(a.d_m < a.h_m)) ++load.fullPenetrationElements;
    memory.active.push_back(a);
    return true;
  };

  const int n = static_cast<int>(c.size());
  const auto locate = [&](int e) { return Vec3(R_MF * c.p_FA[static_cast<size_t>(e)] - offset); };
  const auto cannotTouch = [&](int e, const Vec3& p_MA) {
    const size_t i = static_cast<size_t>(e);
    return memory.clearance_m[i] * memory.clearance_m[i] > (p_MA - memory.p_MA[i]).squaredNorm();
  };

  const Tracking tracking = definition.tracking;
  if (tracking == Tracking::all) {
    for (int e = 0; e < n; ++e) test(e, locate(e));
  } else if (tracking == Tracking::lipschitz) {
    for (int e = 0; e < n; ++e) {
      const Vec3 p_MA = locate(e);
      if (!cannotTouch(e, p_MA)) test(e, p_MA);
    }
  } else {
    // Breadth-first from every element that was active, outward to a ring of inactive ones [BF2004 §2.2].
    for (const int start : memory.previous) {
      if (memory.visit[static_cast<size_t>(start)] == stamp) continue;
      memory.queue.clear();
      memory.queue.push_back(start);
      memory.visit[static_cast<size_t>(start)] = stamp;
      for (size_t head = 0; head < memory.queue.size(); ++head) {
        const int e = memory.queue[head];
        if (!test(e, locate(e))) continue;
        const auto [level, ix, iz] = c.cell[static_cast<size_t>(e)];
        if (level > 0) continue;  // the guard below tests what is reached from finer cells only
        for (int jx = c.wraps ? ix - 1 : std::max(ix - 1, 0); jx <= (c.wraps ? ix + 1 : std::min(ix + 1, c.nx - 1)); ++jx) {
          for (int jz = std::max(iz - 1, 0); jz <= std::min(iz + 1, c.nz - 1); ++jz) {
            const int next = c.element[static_cast<size_t>((jx + c.nx) % c.nx * c.nz + jz)];
            if (next < 0 || memory.visit[static_cast<size_t>(next)] == stamp) continue;
            memory.visit[static_cast<size_t>(next)] = stamp;
            memory.queue.push_back(next);
          }
        }
      }
    }
    if (tracking == Tracking::breadthFirst || memory.active.empty()) {
      const bool guarded = tracking == Tracking::breadthFirst;
      for (int e = 0; e < n; ++e) {
        if (memory.visit[static_cast<size_t>(e)] == stamp) continue;
        const Vec3 p_MA = locate(e);
        if (!guarded || !cannotTouch(e, p_MA)) test(e, p_MA);
      }
    }
    // Sums run in element order, so that the way of finding contact cannot change their rounding.
    std::sort(memory.active.begin(), memory.active.end(),
              [](const Active& a, const Active& b) { return a.element < b.element; });
    memory.previous.clear();
    for (const Active& a : memory.active) memory.previous.push_back(a.element);
  }

  Vec3 moment = Vec3::Zero(), force = Vec3::Zero(), weighted = Vec3::Zero();
  double scalar = 0, area = 0, energy = 0;
  for (Active& a : memory.active) {
    const size_t i = static_cast<size_t>(a.element);
    LayerResponse r;
    if constexpr (std::is_same_v<Law, SeriesLayers>) {
      r = withEnergy ? law_.template calcResponse<true>(a.d_m, c.hF_m[i], a.hM_m) : law_.template calcResponse<false>(a.d_m, c.hF_m[i], a.hM_m);
    } else {
      r = withEnergy ? law_.template calcResponse<true>(a.d_m, a.h_m) : law_.template calcResponse<false>(a.d_m, a.h_m);
    }
    // Rate of approach: the velocity of M's point at A against the force on it.
    const double approach_mPerS = -a.direction_F.dot(task.v_F + task.w_F.cross(c.p_FA[i]));
    a.p_Pa = r.p_Pa * std::max(0.0, 1 + definition.damping_sPerM * approach_mPerS);
    const double f = a.force_N = a.p_Pa * c.area_m2[i];
    const Vec3 fVector = f * a.direction_F;
    force += fVector;
    moment += c.p_FA[i].cross(fVector);
    weighted += f * c.p_FA[i];
    scalar += f;
    area += c.area_m2[i];
    energy += r.energy_JPerM2 * c.area_m2[i];
    load.extrapolatedElements += r.extrapolated;
    load.maxStrain = std::max(load.maxStrain, a.d_m / a.h_m);
    if (a.p_Pa > load.peakPressure_Pa) {
      load.peakPressure_Pa = a.p_Pa;
      load.peakPoint_F = c.p_FA[i];
    }
  }
  load.forceOnM_F = force;
  load.momentOnM_Fo_F = moment;
  load.scalarForce_N = scalar;
  load.area_m2 = area;
  load.energy_J = withEnergy ? energy : 0;
  load.activeElements = static_cast<int>(memory.active.size());
  load.meanPressure_Pa = area > 0 ? scalar / area : 0;
  load.centerOfPressure_F = scalar > 0 ? Vec3(weighted / scalar) : Vec3(Vec3::Zero());
}

template void ContactPair::Impl::evaluateCentre(const LinearLayer&, const Compartment&, const EvaluationTask&, CompartmentMemory&, NetLoad&,
                                                int&) const;
template void ContactPair::Impl::evaluateCentre(const PowerLawLayer&, const Compartment&, const EvaluationTask&, CompartmentMemory&, NetLoad&,
                                                int&) const;
template void ContactPair::Impl::evaluateCentre(const SeriesLayers&, const Compartment&, const EvaluationTask&, CompartmentMemory&, NetLoad&,
                                                int&) const;

}  // namespace genu::contact
