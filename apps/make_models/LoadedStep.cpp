#include "LoadedStep.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace genu::make_models {

namespace {

/** Flexion [deg], -4 to 62 % of the cycle: mean of healthy knees in gait, Gray et al. 2019, doi 10.1002/jor.24226, supplement. At 0 the
 mean of 0 and 100 %, which differ by 0.5. */
const std::vector<double>& flexion_deg() {
  static const std::vector<double> values = {
      -2.037, -1.752, -0.953, 0.161, 1.635, 3.069, 4.225, 5.328, 6.423, 7.557, 8.742, 9.943, 11.093, 12.117,
      12.957, 13.578, 13.973, 14.149, 14.123, 13.92, 13.57, 13.109, 12.569, 11.98, 11.363, 10.724, 10.059,
      9.355, 8.607, 7.825, 7.033, 6.261, 5.532, 4.854, 4.226, 3.641, 3.097, 2.602, 2.17, 1.81, 1.521, 1.294,
      1.126, 1.025, 1.015, 1.123, 1.376, 1.789, 2.368, 3.11, 4.019, 5.111, 6.414, 7.959, 9.779, 11.902, 14.356,
      17.169, 20.369, 23.971, 27.959, 32.257, 36.723, 41.169, 45.407, 49.303, 52.802};
  return values;
}

/** Vertical ground reaction over body weight, 0 to 63 % of the cycle: a man of 70 kg, DM_ngait_og1_grf.sto of opensim-jam-org/jam-resources,
 7.5 ms moving average. */
const std::vector<double>& verticalForce_BW() {
  static const std::vector<double> values = {
      0.0303, 0.116, 0.1765, 0.2481, 0.3958, 0.5892, 0.8088, 0.9465, 0.9026, 0.8012, 0.7978, 0.8443, 0.9273,
      1.0, 1.0485, 1.0854, 1.101, 1.0944, 1.0834, 1.0669, 1.0445, 1.0235, 0.9997, 0.9757, 0.9485, 0.9214,
      0.9003, 0.8786, 0.8565, 0.8383, 0.8225, 0.8179, 0.8119, 0.8045, 0.8074, 0.8086, 0.8124, 0.8259, 0.8343,
      0.8447, 0.857, 0.8702, 0.8753, 0.8752, 0.8701, 0.8581, 0.8448, 0.8365, 0.821, 0.8015, 0.7776, 0.7423,
      0.6942, 0.6313, 0.5564, 0.474, 0.3761, 0.2836, 0.1992, 0.1361, 0.0909, 0.0713, 0.047, 0.0};
  return values;
}
// His foot leaves the ground at 62.9 %; here at 60 %, a usual stance, since the posture is another subject's: assumed.
constexpr double kLoadStretch = 62.9 / kStanceEnd;

struct Knot {
  double percent, value;
};

/** Inclination of the shank [deg], + where the ankle is in front of the knee: pelvic tilt + hip flexion - knee flexion of the woman of 62 kg
 whose knee it is, cluster/open_science_grid/examples/muscle_coordination/shared/overground_17_ik.mot of
 opensim-jam-org/jam-resources, read at some 40 instants, smoothed by eye and rounded. Heel contact is put at 0.2425 s of that file and the cycle
 at 1.096 s, where her knee's first peak, minimum and 45 degrees of flexion fall on those of flexion_deg(). */
const std::vector<Knot> kShank_deg = {{-4, 28.5}, {0, 25.5}, {4, 18.3},   {8, 10.6},   {12, 5},   {16, 1.2},  {20, -0.8}, {25, -2.6},
                                      {30, -4.8}, {35, -8},  {40, -12.8}, {45, -19.3}, {50, -29}, {55, -41.5}, {60, -52},  {62, -55.5}};
/** Dorsiflexion [deg], same file. */
const std::vector<Knot> kAnkle_deg = {{-4, -2.6}, {0, -4.5}, {4, -8}, {8, -10.8}, {12, -10.2}, {16, -8.5}, {20, -6.2}, {25, -5},
                                      {30, -3.7}, {35, 0},   {40, 4.6}, {45, 6.7}, {50, 7.3},  {55, 5},    {60, -6.4}, {62, -10}};
/** Center of pressure [mm] before the ankle, in the foot: assumed. Under the heel until the foot is flat, then from below the ankle to the
 ball, and on to the toes. */
const std::vector<Knot> kCenterOfPressure_mm = {{-4, -45}, {4, -45}, {8, -40},  {12, 0},   {16, 35}, {20, 55},
                                                {30, 85},  {40, 110}, {50, 130}, {60, 155}, {62, 158}};

/** Moment [N m] that the muscles which track flexion give to a knee that is nearly straight, at full excitation of the strongest of them;
 found with this scene. */
constexpr double kFlexorMoment_Nm = 50, kExtensorMoment_Nm = 186;
/** Per cent of the cycle by which excitations run ahead of the moment: 22 ms. */
constexpr size_t kLead = 2;
constexpr double kRest = 0.01;

/** Cubic spline through the knots at every per cent from -4 to the last: level at the start, without curvature at the end. */
std::vector<double> sampleSpline(const std::vector<Knot>& knots) {
  const size_t n = knots.size();
  std::vector<double> h(n - 1), diagonal(n), right(n), m(n);
  for (size_t i = 0; i + 1 < n; ++i) h[i] = knots[i + 1].percent - knots[i].percent;
  const auto slope = [&](size_t i) { return (knots[i + 1].value - knots[i].value) / h[i]; };
  diagonal[0] = 2 * h[0];
  right[0] = 6 * slope(0);
  for (size_t i = 1; i + 1 < n; ++i) {
    const double factor = h[i - 1] / diagonal[i - 1];
    diagonal[i] = 2 * (h[i - 1] + h[i]) - factor * h[i - 1];
    right[i] = 6 * (slope(i) - slope(i - 1)) - factor * right[i - 1];
  }
  m[n - 1] = 0;
  for (size_t i = n - 1; i-- > 0;) m[i] = (right[i] - h[i] * m[i + 1]) / diagonal[i];
  std::vector<double> values;
  for (size_t k = 0; k < flexion_deg().size(); ++k) {
    const double p = static_cast<double>(k) - kBeforeStance;
    size_t i = 0;
    while (i + 2 < n && knots[i + 1].percent <= p) ++i;
    const double t = p - knots[i].percent, u = h[i] - t;
    values.push_back((m[i] * u * u * u + m[i + 1] * t * t * t) / (6 * h[i]) + (knots[i].value / h[i] - m[i] * h[i] / 6) * u +
                     (knots[i + 1].value / h[i] - m[i + 1] * h[i] / 6) * t);
  }
  return values;
}

std::vector<double> sampleLine(const std::vector<Knot>& knots) {
  std::vector<double> values;
  for (size_t k = 0; k < flexion_deg().size(); ++k) {
    const double p = static_cast<double>(k) - kBeforeStance;
    size_t i = 0;
    while (i + 2 < knots.size() && knots[i + 1].percent <= p) ++i;
    const Knot &a = knots[i], &b = knots[i + 1];
    values.push_back(a.value + (b.value - a.value) * (p - a.percent) / (b.percent - a.percent));
  }
  return values;
}

/** Each value takes half of its neighbours' mean; the ends stay. */
void smooth(std::vector<double>& values, int passes) {
  for (int pass = 0; pass < passes; ++pass) {
    const std::vector<double> old = values;
    for (size_t i = 1; i + 1 < old.size(); ++i) values[i] = (old[i - 1] + 2 * old[i] + old[i + 1]) / 4;
  }
}

double calcVerticalForce_BW(int percent) {
  const double p = percent * kLoadStretch;
  if (percent < 0 || p >= 63) return 0;
  const auto i = static_cast<size_t>(p);
  const auto& v = verticalForce_BW();
  return v[i] + (v[i + 1] - v[i]) * (p - static_cast<double>(i));
}

Vec2 turn(double angle, const Vec2& p) {
  return {p.x() * std::cos(angle) - p.y() * std::sin(angle), p.x() * std::sin(angle) + p.y() * std::cos(angle)};
}
double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

struct StepMotion {
  std::vector<double> hip_deg, ankle_deg, vertical_BW, centerOfPressure_mm;
};

/** Moment [N m] of the muscles, + extending, that moves shank and foot as planar rigid bodies: knee a hinge, hip fixed in space. */
std::vector<double> calcExtensionMoment(const PlanarLeg& leg, const StepMotion& motion) {
  struct Pose {
    Vec2 knee, shank, foot, load;
    double shankAngle, footAngle;
  };
  const size_t n = motion.hip_deg.size();
  std::vector<Pose> poses;
  for (size_t i = 0; i < n; ++i) {
    const double thigh = motion.hip_deg[i] * kDegree, shank = thigh - flexion_deg()[i] * kDegree,
                 foot = shank + motion.ankle_deg[i] * kDegree;
    const Vec2 knee = turn(thigh, {0, -leg.thigh_m}), ankle = knee + turn(shank, leg.ankle);
    poses.push_back({knee, knee + turn(shank, leg.shank.center), ankle + turn(foot, leg.foot.center),
                     ankle + turn(foot, Vec2(motion.centerOfPressure_mm[i], kSole_mm) / 1000), shank, foot});
  }
  const double dt = kStepCycle_s / 100;
  std::vector<double> moment;
  for (size_t i = 0; i < n; ++i) {
    const size_t k = std::clamp<size_t>(i, 1, n - 2);
    const Pose &before = poses[k - 1], &now = poses[k], &after = poses[k + 1], &here = poses[i];
    const double moving = i == 0 ? 0 : 1 / (dt * dt);  // the run begins at rest
    double sum = cross(here.load - here.knee, {0, motion.vertical_BW[i] * kBodyWeight_N});
    const auto add = [&](const PlanarLeg::Segment& segment, Vec2 Pose::* center, double Pose::* angle) {
      const Vec2 acceleration = moving * (after.*center - 2 * (now.*center) + before.*center);
      sum -= cross(here.*center - here.knee, segment.mass_kg * (acceleration + Vec2(0, 9.81))) +
             segment.inertia_kgm2 * moving * (after.*angle - 2 * (now.*angle) + before.*angle);
    };
    add(leg.shank, &Pose::shank, &Pose::shankAngle);
    add(leg.foot, &Pose::foot, &Pose::footAngle);
    moment.push_back(-sum);
  }
  return moment;
}

}  // namespace

std::string makeStepTable(const PlanarLeg& leg) {
  StepMotion motion;
  // The thigh follows from the shank, so that the foot stands as it did. Few knots, so that it accelerates smoothly.
  const std::vector<double> shank = sampleSpline(kShank_deg);
  std::vector<Knot> thigh;
  for (const Knot& knot : kShank_deg) {
    const auto i = static_cast<size_t>(knot.percent + kBeforeStance);
    thigh.push_back({knot.percent, shank[i] + flexion_deg()[i]});
  }
  motion.hip_deg = sampleSpline(thigh);
  motion.ankle_deg = sampleSpline(kAnkle_deg);
  motion.centerOfPressure_mm = sampleLine(kCenterOfPressure_mm);
  smooth(motion.centerOfPressure_mm, 2);
  const size_t n = flexion_deg().size();
  for (size_t i = 0; i < n; ++i) motion.vertical_BW.push_back(calcVerticalForce_BW(static_cast<int>(i) - kBeforeStance));
  std::vector<double> moment = calcExtensionMoment(leg, motion);
  smooth(moment, 2);

  std::ostringstream out;
  out << "percent_cycle,hip.angle_deg,ankle.angle_deg,tibiofemoral.rz_deg,vertical_BW,cop_mm,extensors,flexors\n";
  for (size_t i = 0; i < n; ++i) {
    const double ahead = moment[std::min(i + kLead, n - 1)];
    out << i << ',' << writeNumber(motion.hip_deg[i], 2) << ',' << writeNumber(motion.ankle_deg[i], 2) << ','
        << writeNumber(flexion_deg()[i], 3) << ',' << writeNumber(motion.vertical_BW[i], 4) << ','
        << writeNumber(-motion.centerOfPressure_mm[i], 1) << ',' << writeNumber(kRest + std::max(ahead, 0.0) / kExtensorMoment_Nm, 4) << ','
        << writeNumber(kRest + std::max(-ahead, 0.0) / kFlexorMoment_Nm, 4) << '\n';
  }
  return out.str();
}

}  // namespace genu::make_models
