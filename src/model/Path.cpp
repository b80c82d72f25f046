#include "genu/model/Path.h"

#include <Eigen/Dense>
#include <algorithm>

#include "Conversions.h"
#include "genu/model/KneeSystem.h"

namespace genu::model {

namespace {

using contact::Pose;
using contact::Vec3;
using musculoskeletal::WrappedSegment;

/** Points closer than this coincide [m]. */
constexpr double kCoincident_m = 1e-12;

/** Second derivatives of the natural cubic spline through (q, p) at its points. */
std::vector<Vec3> makeNaturalSpline(const std::vector<double>& q, const std::vector<Vec3>& p) {
  const auto n = static_cast<int>(q.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(n, 3);
  for (int i = 1; i + 1 < n; ++i) {
    const auto k = static_cast<size_t>(i);
    const double before = q[k] - q[k - 1], after = q[k + 1] - q[k];
    A(i, i - 1) = before / 6;
    A(i, i) = (before + after) / 3;
    A(i, i + 1) = after / 6;
    b.row(i) = ((p[k + 1] - p[k]) / after - (p[k] - p[k - 1]) / before).transpose();
  }
  const Eigen::MatrixXd m = A.partialPivLu().solve(b);
  std::vector<Vec3> second;
  for (int i = 0; i < n; ++i) second.emplace_back(m.row(i).transpose());
  return second;
}

}  // namespace

void Path::Point::evaluate(double at, Vec3& p, Vec3& dp) const {
  const size_t n = q.size();
  const size_t i = std::clamp<size_t>(static_cast<size_t>(std::upper_bound(q.begin(), q.end(), at) - q.begin()), 1, n - 1) - 1;
  const double h = q[i + 1] - q[i];
  const double inside = std::clamp(at, q.front(), q.back());  // straight beyond the ends
  const double a = (q[i + 1] - inside) / h, b = (inside - q[i]) / h;
  dp = (p_m[i + 1] - p_m[i]) / h + h / 6 * ((3 * b * b - 1) * second[i + 1] - (3 * a * a - 1) * second[i]);
  p = a * p_m[i] + b * p_m[i + 1] + h * h / 6 * ((a * a * a - a) * second[i] + (b * b * b - b) * second[i + 1]) + (at - inside) * dp;
}

Path::Path(const scene::PathDefinition& definition, const scene::Scene& scene, const UrdfModel& urdf, const std::string& where) {
  for (size_t i = 0; i < definition.points.size(); ++i) {
    const scene::PathPoint& given = definition.points[i];
    const LinkFrame frame = findFrame(urdf, given.body, where + ", point " + std::to_string(i + 1));
    Point point;
    point.body = addLink(frame.link);
    point.point_m = frame.X_LinkFrame.apply(given.point_m);
    point.coordinate = given.coordinate;
    point.q = given.q;
    for (const Vec3& p : given.p_m) point.p_m.push_back(frame.X_LinkFrame.apply(p));
    if (point.coordinate >= 0) {
      point.second = makeNaturalSpline(point.q, point.p_m);
      moving_ = true;
    }
    points_.push_back(std::move(point));
  }
  for (const int wrap : definition.wraps) {
    wrapOf_.push_back(wrap < 0 ? -1 : static_cast<int>(wraps_.size()));
    if (wrap < 0) continue;
    const scene::WrapDefinition& given = scene.wraps[static_cast<size_t>(wrap)];
    const LinkFrame frame = findFrame(urdf, given.body, scene.where("wraps." + given.name + ".body"));
    wraps_.push_back({addLink(frame.link), frame.X_LinkFrame * given.X_BodyW, given.surface});
  }
}

int Path::addLink(int link) {
  const auto found = std::find(links_.begin(), links_.end(), link);
  if (found != links_.end()) return static_cast<int>(found - links_.begin());
  links_.push_back(link);
  return static_cast<int>(links_.size()) - 1;
}

template <class PoseOf>
void Path::calc(const PoseOf& poseOf, const double* q, Geometry& g) const {
  g.length_m = 0;
  g.numWrapped = g.numInside = g.numNotConverged = 0;
  g.unitLoads.resize(links_.size());
  for (size_t i = 0; i < links_.size(); ++i) g.unitLoads[i] = {links_[i], Vec3::Zero(), Vec3::Zero()};
  g.coordinateLoads.clear();

  const auto locate = [&](const Point& point, Vec3& p_G, Vec3& dp_G) {
    const Pose& X_GB = poseOf(links_[static_cast<size_t>(point.body)]);
    if (point.coordinate < 0) {
      p_G = X_GB.apply(point.point_m);
      dp_G.setZero();
      return;
    }
    Vec3 p, dp;
    point.evaluate(q[point.coordinate], p, dp);
    p_G = X_GB.apply(p);
    dp_G = X_GB.R * dp;
  };
  const auto pull = [&](int body, const Vec3& p_G, const Vec3& force_G) {
    BodyLoad& load = g.unitLoads[static_cast<size_t>(body)];
    load.force_G += force_G;
    load.moment_G += (p_G - poseOf(links_[static_cast<size_t>(body)]).p).cross(force_G);
  };
  const auto pullPoint = [&](const Point& point, const Vec3& p_G, const Vec3& dp_G, const Vec3& force_G) {
    pull(point.body, p_G, force_G);
    if (point.coordinate >= 0) g.coordinateLoads.push_back({point.coordinate, dp_G.dot(force_G)});
  };

  Vec3 P, dP, Q, dQ;
  locate(points_[0], P, dP);
  for (size_t i = 0; i + 1 < points_.size(); ++i, P = Q, dP = dQ) {
    locate(points_[i + 1], Q, dQ);
    Vec3 directionP, directionQ;
    if (wrapOf_[i] >= 0) {
      const Wrap& wrap = wraps_[static_cast<size_t>(wrapOf_[i])];
      const Pose X_GW = poseOf(links_[static_cast<size_t>(wrap.body)]) * wrap.X_BodyW;
      const Pose X_WG = X_GW.inverse();
      const WrappedSegment segment = musculoskeletal::wrapSegment(wrap.surface, X_WG.apply(P), X_WG.apply(Q));
      g.length_m += segment.length_m;
      g.numWrapped += segment.status == WrappedSegment::Status::wrapped ? 1 : 0;
      g.numInside += segment.status == WrappedSegment::Status::inside ? 1 : 0;
      g.numNotConverged += segment.status == WrappedSegment::Status::notConverged ? 1 : 0;
      if (segment.length_m < kCoincident_m) continue;
      directionP = X_GW.R * segment.directionP;
      directionQ = X_GW.R * segment.directionQ;
      if (segment.status == WrappedSegment::Status::wrapped) {  // the surface takes what the two ends leave
        pull(wrap.body, P, -directionP);
        pull(wrap.body, Q, directionQ);
      }
    } else {
      const Vec3 d = Q - P;
      const double length = d.norm();
      g.length_m += length;
      if (length < kCoincident_m) continue;
      directionP = directionQ = d / length;
    }
    pullPoint(points_[i], P, dP, directionP);
    pullPoint(points_[i + 1], Q, dQ, -directionQ);
  }
}

void Path::calcGeometry(const std::vector<Pose>& linkPoses, const double* q, Geometry& geometry) const {
  calc([&linkPoses](int link) -> const Pose& { return linkPoses[static_cast<size_t>(link)]; }, q, geometry);
}

double Path::calcLength_m(const UrdfModel& urdf, const double* q) const {
  Geometry geometry;
  calcGeometry(calcLinkPoses(urdf, q), q, geometry);
  return geometry.length_m;
}

std::vector<double> Path::readCoordinates(const KneeSystem& knee, const SimTK::State& state) const {
  return moving_ ? knee.readCoordinates(state) : std::vector<double>();
}

void Path::calcGeometry(const KneeSystem& knee, const SimTK::State& state, Geometry& geometry) const {
  const std::vector<double> q = readCoordinates(knee, state);
  calc([&](int link) { return toPose(knee.body(link).getBodyTransform(state)); }, q.data(), geometry);
}

double Path::calcRate_MPerS(const KneeSystem& knee, const SimTK::State& state, const Geometry& geometry) {
  double power = 0;
  for (const BodyLoad& load : geometry.unitLoads) {
    const SimTK::SpatialVec& V = knee.body(load.link).getBodyVelocity(state);
    power += ~toSimTK(load.moment_G) * V[0] + ~toSimTK(load.force_G) * V[1];
  }
  for (const CoordinateLoad& load : geometry.coordinateLoads) power += load.force * state.getU()[knee.stateIndex(load.coordinate)];
  return -power;
}

void Path::applyTension(const KneeSystem& knee, const SimTK::State& state, const Geometry& geometry, double tension_N,
                        SimTK::Vector_<SimTK::SpatialVec>& bodyForces, SimTK::Vector& mobilityForces) {
  if (tension_N == 0) return;
  for (const BodyLoad& load : geometry.unitLoads) {
    bodyForces[knee.body(load.link).getMobilizedBodyIndex()] +=
        SimTK::SpatialVec(tension_N * toSimTK(load.moment_G), tension_N * toSimTK(load.force_G));
  }
  for (const CoordinateLoad& load : geometry.coordinateLoads) {
    knee.bodyOfCoordinate(load.coordinate)
        .applyOneMobilityForce(state, knee.axisOfCoordinate(load.coordinate), tension_N * load.force, mobilityForces);
  }
}

std::vector<Vec3> Path::calcLine(const KneeSystem& knee, const SimTK::State& state, int arcPoints) const {
  const std::vector<double> q = readCoordinates(knee, state);
  const auto poseOf = [&](int body) { return toPose(knee.body(links_[static_cast<size_t>(body)]).getBodyTransform(state)); };
  std::vector<Vec3> corners, line;
  for (const Point& point : points_) {
    Vec3 p = point.point_m, dp;
    if (point.coordinate >= 0) point.evaluate(q[static_cast<size_t>(point.coordinate)], p, dp);
    corners.push_back(poseOf(point.body).apply(p));
  }
  line.push_back(corners.front());
  for (size_t i = 0; i + 1 < corners.size(); ++i) {
    if (wrapOf_[i] >= 0) {
      const Wrap& wrap = wraps_[static_cast<size_t>(wrapOf_[i])];
      const Pose X_GW = poseOf(wrap.body) * wrap.X_BodyW;
      const std::vector<Vec3> samples =
          musculoskeletal::sampleSegment(wrap.surface, X_GW.applyInverse(corners[i]), X_GW.applyInverse(corners[i + 1]), arcPoints);
      for (size_t k = 1; k + 1 < samples.size(); ++k) line.push_back(X_GW.apply(samples[k]));
    }
    line.push_back(corners[i + 1]);
  }
  return line;
}

}  // namespace genu::model
