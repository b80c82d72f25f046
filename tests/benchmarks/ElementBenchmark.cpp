// Cost of the force elements, error beside time.
//   build/release/bin/element_benchmark [--benchmark_filter=...]
// law/...      a law or a wrapping surface alone.
// force/...    what one element adds to an evaluation of the accelerations (SimTK::Stage::Acceleration): kCopies of it on
//              two bodies minus the same bodies without, both timed in turns, over kCopies. with_us and without_us are the
//              two whole evaluations, least_ns is their difference: all of the shortest repeats; "Time" is the mean.
// contact/...  the contact force in the same measure, for scale.
// Time is processor time. Counters that end in _err are errors; against what, stands beside each case.
//   element_benchmark --count none|ligament|two_ligaments|spring|muscle|wrapped|second_contact
// evaluates the artificial knee with these elements, or with its contact twice as if a patella touched too, kCounted times, for
// scripts/count_instructions.
//   element_benchmark --write-scenes FOLDER
// writes the scenes of force/..., each with one copy, for scripts/compare_peers.

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "../model/TemporaryFile.h"
#include "genu/model/KneeSystem.h"
#include "genu/musculoskeletal/LigamentLaw.h"
#include "genu/musculoskeletal/Muscle.h"
#include "genu/musculoskeletal/SpringLaw.h"
#include "genu/musculoskeletal/WrapSurface.h"
#include "genu/scene/SceneFile.h"

namespace {

using namespace genu;
using namespace genu::musculoskeletal;
using contact::Mat3;

constexpr double kPi = 3.14159265358979323846;
constexpr int kInputs = 1024;  // different inputs that a timed loop goes through
constexpr int kCopies = 50;
constexpr int kCounted = 20;

std::mt19937 makeRandom() { return std::mt19937(7); }

/** Runs `f(i)` for input after input. */
template <class F>
void overInputs(benchmark::State& state, const F& f) {
  int i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(f(i));
    i = i + 1 == kInputs ? 0 : i + 1;
  }
}

std::vector<double> makeUniform(double low, double high, unsigned seed = 7) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(low, high);
  std::vector<double> all(kInputs);
  for (double& x : all) x = u(random);
  return all;
}

/** By a central difference of fourth order. */
template <class F>
double differentiate(const F& f, double x, double h) {
  return (8 * (f(x + h) - f(x - h)) - (f(x + 2 * h) - f(x - 2 * h))) / (12 * h);
}

// ---- Laws. Errors: the tension against the differentiated energy, over the largest tension.

void ligamentLaw(benchmark::State& state, double low, double high, double dampingTime_s) {
  LigamentLaw law;
  law.stiffness_N = 2000;
  law.slackLength_m = 0.05;
  law.dampingTime_s = dampingTime_s;
  const auto strain = makeUniform(low, high), rate = makeUniform(-0.05, 0.05, 8);
  overInputs(state, [&](int i) {
    return calcResponse(law, law.slackLength_m * (1 + strain[static_cast<size_t>(i)]), rate[static_cast<size_t>(i)])
        .tension_N;
  });
  double error = 0, largest = 1e-300;
  for (const double e : strain) {
    // Not across the two joints of the curve, where a derivative jumps.
    const double L = law.slackLength_m * (1 + e), h = 1e-5, T = calcResponse(law, L).tension_N;
    if (std::min(std::abs(e), std::abs(e - 2 * law.toeStrain)) * law.slackLength_m < 2 * h) continue;
    error = std::max(error, std::abs(differentiate([&](double x) { return calcResponse(law, x).energy_J; }, L, h) - T));
    largest = std::max(largest, T);
  }
  state.counters["energy_err"] = error / largest;
}
BENCHMARK_CAPTURE(ligamentLaw, slack, -0.1, 0, 0)->Name("law/ligament/slack");
BENCHMARK_CAPTURE(ligamentLaw, toe, 0, 0.06, 0)->Name("law/ligament/toe");
BENCHMARK_CAPTURE(ligamentLaw, linear, 0.06, 0.15, 0)->Name("law/ligament/linear");
BENCHMARK_CAPTURE(ligamentLaw, damped, -0.05, 0.15, 0.01)->Name("law/ligament/any_strain_damped");

void springLaw(benchmark::State& state) {
  SpringLaw law;
  law.stiffness_NPerM = 1e5;
  law.restLength_m = 0.05;
  law.damping_NSPerM = 10;
  const auto length = makeUniform(0.045, 0.06), rate = makeUniform(-0.05, 0.05, 8);
  overInputs(state, [&](int i) {
    return calcResponse(law, length[static_cast<size_t>(i)], rate[static_cast<size_t>(i)]).tension_N;
  });
  double error = 0;
  for (const double L : length) {
    const double h = 1e-6;
    if (std::abs(L - law.restLength_m) < h) continue;  // the kink
    const double slope = (calcResponse(law, L + h, 0).energy_J - calcResponse(law, L - h, 0).energy_J) / (2 * h);
    error = std::max(error, std::abs(slope - calcResponse(law, L, 0).tension_N));
  }
  state.counters["energy_err"] = error / (law.stiffness_NPerM * 0.01);
}
BENCHMARK(springLaw)->Name("law/spring");

Muscle makeMuscle() {
  Muscle m;
  m.maxIsometricForce_N = 1000;
  m.optimalFibreLength_m = 0.08;
  m.tendonSlackLength_m = 0.2;
  m.pennationAtOptimal_rad = 12 * kPi / 180;
  return m;
}

/** Error: the derivative of the tension by length against its central difference, over the largest derivative. */
void rigidTendon(benchmark::State& state) {
  const Muscle m = makeMuscle();
  const auto length = makeUniform(0.245, 0.31), rate = makeUniform(-0.3, 0.3, 8), activation = makeUniform(0.01, 1, 9);
  const auto at = [&](int i, double dL) {
    const auto k = static_cast<size_t>(i);
    return calcRigidTendon(m, activation[k], length[k] + dL, rate[k]);
  };
  overInputs(state, [&](int i) { return at(i, 0).tension_N; });
  double error = 0, largest = 0;
  for (int i = 0; i < kInputs; ++i) {
    const double h = 1e-7, slope = at(i, 0).dTdL_NPerM;
    if (!(at(i, -h).tension_N > 0) || !(at(i, h).tension_N > 0)) continue;  // cut off
    error = std::max(error, std::abs((at(i, h).tension_N - at(i, -h).tension_N) / (2 * h) - slope));
    largest = std::max(largest, std::abs(slope));
  }
  state.counters["slope_err"] = error / largest;
}
BENCHMARK(rigidTendon)->Name("law/muscle_rigid_tendon");

/** Error: balance of fibre and tendon at the fibre velocity that is returned, over the largest force. */
void compliantTendon(benchmark::State& state) {
  const Muscle m = makeMuscle();
  const auto fibre = makeUniform(0.05, 0.11), strain = makeUniform(0.001, 0.06, 8), activation = makeUniform(0, 1, 9);
  const auto lengthOf = [&](size_t k) {
    const double height = m.optimalFibreLength_m * std::sin(m.pennationAtOptimal_rad);
    return std::sqrt(fibre[k] * fibre[k] - height * height) + m.tendonSlackLength_m * (1 + strain[k]);
  };
  std::vector<double> length;
  for (size_t k = 0; k < kInputs; ++k) length.push_back(lengthOf(k));
  overInputs(state, [&](int i) {
    const auto k = static_cast<size_t>(i);
    return calcCompliantTendon(m, activation[k], fibre[k], length[k]).fibreVelocity_MPerS;
  });
  double worst = 0;
  for (size_t k = 0; k < kInputs; ++k) {
    const MuscleResponse r = calcCompliantTendon(m, activation[k], fibre[k], length[k]);
    const double l = fibre[k] / m.optimalFibreLength_m,
                 v = r.fibreVelocity_MPerS / m.optimalFibreLength_m / m.maxContractionVelocity_perS;
    const double f = activation[k] * m.curves.calcActive(l).value * m.curves.calcVelocity(v).value +
                     m.curves.calcPassive(l).value + m.fibreDamping * v;
    worst = std::max(worst, std::abs(f * r.cosPennation - r.tension_N / m.maxIsometricForce_N));
  }
  state.counters["balance_err"] = worst;
}
BENCHMARK(compliantTendon)->Name("law/muscle_compliant_tendon");

/** Not part of an evaluation: the start of a run. Error: residual over the largest force. */
void fibreEquilibrium(benchmark::State& state) {
  const Muscle m = makeMuscle();
  const auto length = makeUniform(0.26, 0.31), activation = makeUniform(0.01, 1, 9);
  overInputs(state, [&](int i) {
    return findFibreEquilibrium(m, activation[static_cast<size_t>(i)], length[static_cast<size_t>(i)]).fibreLength_m;
  });
  double worst = 0;
  for (size_t k = 0; k < kInputs; ++k) {
    worst = std::max(worst, std::abs(findFibreEquilibrium(m, activation[k], length[k]).residual));
  }
  state.counters["balance_err"] = worst;
}
BENCHMARK(fibreEquilibrium)->Name("law/muscle_fibre_at_rest");

// ---- Wraps. Pairs of points are made from their tangents, so that the length is known.

struct Ends {
  Vec3 P, Q;
  double length_m = 0;
};

/** Tangent points at -w/2 and w/2 about z on a circle of radius R; with `rise`, a helix that climbs by it in all. */
Ends makeRoundEnds(double R, double w, double before, double after, double rise) {
  const auto e = [](double a) { return Vec3(std::cos(a), std::sin(a), 0); };
  const auto t = [](double a) { return Vec3(-std::sin(a), std::cos(a), 0); };
  const double flat = before + R * w + after;
  return {R * e(-w / 2) - before * t(-w / 2), R * e(w / 2) + after * t(w / 2) + Vec3(0, 0, rise),
          std::hypot(flat, rise)};
}

/** In the plane of half axes a (x) and b (y): arc of the ellipse from eccentric angle -w/2 to w/2 about `middle`, by
 Simpson's rule. */
Ends makeEllipseEnds(double a, double b, double middle, double w, double before, double after) {
  const auto x = [&](double u) { return Vec3(a * std::cos(u), b * std::sin(u), 0); };
  const auto dx = [&](double u) { return Vec3(-a * std::sin(u), b * std::cos(u), 0); };
  constexpr int n = 2000;
  double arc = 0;
  for (int i = 0; i <= n; ++i)
    arc += dx(middle + w * (static_cast<double>(i) / n - 0.5)).norm() * (i == 0 || i == n ? 1 : i % 2 == 1 ? 4 : 2);
  arc *= w / n / 3;
  const double u0 = middle - w / 2, u1 = middle + w / 2;
  return {x(u0) - before * dx(u0).normalized(), x(u1) + after * dx(u1).normalized(), before + arc + after};
}

/** Errors: the length, over itself, against what the pair was made with, unless a way shorter by more than 1e-9 was
 found: `other_%` are those; the gradient by Q against the differentiated length. An ellipsoid's pairs are made in its
 planes of symmetry and then moved off them by up to 0.5 mm along each axis for the gradient and the time. */
void wrap(benchmark::State& state, const WrapSurface& surface) {
  auto random = makeRandom();
  std::uniform_real_distribution<double> u(0, 1);
  const Vec3 axes = surface.halfAxes_m;
  std::vector<Ends> ends;
  while (ends.size() < kInputs) {
    // Less than half a turn in all, so that no way round the other side is shorter.
    const double w = 0.3 + 1.2 * u(random), R = axes.minCoeff(), before = R * (0.3 + 0.5 * u(random)),
                 after = R * (0.3 + 0.5 * u(random));
    Ends e;
    switch (surface.shape) {
      case WrapSurface::Shape::sphere: {
        e = makeRoundEnds(R, w, before, after, 0);
        const Mat3 turn =
            Eigen::Quaterniond(u(random), u(random), u(random), u(random)).normalized().toRotationMatrix();
        e.P = turn * e.P;
        e.Q = turn * e.Q;
        break;
      }
      case WrapSurface::Shape::cylinder:
        e = makeRoundEnds(R, w, before, after, 0.1 * (u(random) - 0.5));
        break;
      case WrapSurface::Shape::ellipsoid: {
        const auto k = static_cast<int>(3 * u(random)) % 3;  // the plane at right angles to axis k
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const Ends flat = makeEllipseEnds(axes[i], axes[j], 2 * kPi * u(random), w, before, after);
        e.P = e.Q = Vec3::Zero();
        e.P[i] = flat.P.x();
        e.P[j] = flat.P.y();
        e.Q[i] = flat.Q.x();
        e.Q[j] = flat.Q.y();
        e.length_m = flat.length_m;
        break;
      }
    }
    ends.push_back(e);
  }
  double lengthError = 0;
  int other = 0;
  for (const Ends& e : ends) {
    const double d = wrapSegment(surface, e.P, e.Q).length_m / e.length_m - 1;
    if (d < -1e-9)
      ++other;
    else
      lengthError = std::max(lengthError, std::abs(d));
  }
  if (surface.shape == WrapSurface::Shape::ellipsoid) {
    for (Ends& e : ends) {
      for (Vec3* end : {&e.P, &e.Q}) {
        *end += 0.001 * Vec3(u(random) - 0.5, u(random) - 0.5, u(random) - 0.5);
        if (end->cwiseQuotient(axes).squaredNorm() < 1.1) *end *= 1.1;  // stays outside
      }
    }
  }
  int wrapped = 0;
  double gradientError = 0;
  for (const Ends& e : ends) {
    const WrappedSegment s = wrapSegment(surface, e.P, e.Q);
    if (s.status != WrappedSegment::Status::wrapped) continue;
    ++wrapped;
    // Near lift-off and where two ways are equally long the length is not smooth.
    if (s.arcLength_m < 0.1 * axes.minCoeff()) continue;
    for (int k = 0; k < 3; ++k) {
      const double h = 3e-6;
      const auto at = [&](double x) {
        Vec3 Q = e.Q;
        Q[k] = x;
        return wrapSegment(surface, e.P, Q);
      };
      if ((at(e.Q[k] + 2 * h).directionQ - at(e.Q[k] - 2 * h).directionQ).norm() > 0.01)
        continue;  // jumps to the other way
      const double slope = differentiate([&](double x) { return at(x).length_m; }, e.Q[k], h);
      gradientError = std::max(gradientError, std::abs(slope - s.directionQ[k]));
    }
  }
  overInputs(state, [&](int i) {
    return wrapSegment(surface, ends[static_cast<size_t>(i)].P, ends[static_cast<size_t>(i)].Q).length_m;
  });
  state.counters["length_err"] = lengthError;
  state.counters["gradient_err"] = gradientError;
  state.counters["wrapped_%"] = 100.0 * wrapped / kInputs;
  state.counters["other_%"] = 100.0 * other / kInputs;
}
BENCHMARK_CAPTURE(wrap, sphere, WrapSurface::makeSphere(0.03))->Name("law/wrap_sphere");
BENCHMARK_CAPTURE(wrap, cylinder, WrapSurface::makeCylinder(0.025))->Name("law/wrap_cylinder");
BENCHMARK_CAPTURE(wrap, cylinder_side, WrapSurface::makeCylinder(0.025, Vec3(1, 0, 0)))->Name("law/wrap_cylinder_side");
BENCHMARK_CAPTURE(wrap, ellipsoid, WrapSurface::makeEllipsoid(0.030, 0.018, 0.012))->Name("law/wrap_ellipsoid");
BENCHMARK_CAPTURE(wrap, ellipsoid_long, WrapSurface::makeEllipsoid(0.028, 0.023, 0.139))
    ->Name("law/wrap_ellipsoid_long");

// ---- As forces of a model.

using genu::model::testing_support::TemporaryFile;

// The shank turns about z of the thigh, which turns about z of the pelvis.
const char* const kUrdf = R"(<robot name='leg'><link name='pelvis'/>
<link name='thigh'><inertial><origin xyz='0 -0.2 0'/><mass value='8'/><inertia ixx='0.1' ixy='0' ixz='0' iyy='0.02' iyz='0' izz='0.1'/></inertial></link>
<link name='shank'><inertial><origin xyz='0 -0.15 0'/><mass value='4'/><inertia ixx='0.06' ixy='0' ixz='0' iyy='0.01' iyz='0' izz='0.06'/></inertial></link>
<joint name='hip' type='continuous'><parent link='pelvis'/><child link='thigh'/><axis xyz='0 0 1'/></joint>
<joint name='knee' type='floating'><parent link='thigh'/><child link='shank'/><origin xyz='0 -0.4 0'/></joint>
</robot>)";

const char* const kModel = R"(
  joints:
    hip: {angle: free}
    knee: {rz: free, rx: free, ry: free, x: free, y: free, z: free}
poses: {zero: {hip: 0 deg, knee: "0 deg, 0 deg, 20 deg, 0 mm, 0 mm, 0 mm"}}
wraps:
  cylinder: {body: thigh, cylinder: {R: 25 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, -400 mm, 0 mm", side: "-1, 0, 0"}
  ball: {body: thigh, sphere: {R: 25 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, -400 mm, 0 mm"}
  egg: {body: thigh, ellipsoid: {a: 25 mm, b: 30 mm, c: 45 mm}, pose: "5 deg, 4 deg, 3 deg, 0 mm, -400 mm, 0 mm"}
)";

const char* const kStraight =
    R"([{body: thigh, at: "-30 mm, -300 mm, 5 mm"}, {body: shank, at: "-35 mm, -60 mm, 8 mm"}])";
const char* const kVia =
    R"([{body: pelvis, at: "-20 mm, 20 mm, 5 mm"}, {body: thigh, at: "-40 mm, -300 mm, 5 mm"}, {body: shank, at: "-35 mm, -60 mm, 8 mm"}, {body: shank, at: "-30 mm, -90 mm, 8 mm"}])";
const char* const kMoving =
    R"([{body: thigh, at: "-30 mm, -300 mm, 5 mm"}, {body: shank, moving: {coordinate: knee.rz, at: [[-60 deg, -30 mm, -50 mm, 0 mm], [0 deg, -45 mm, -60 mm, 3 mm], [60 deg, -50 mm, -52 mm, 8 mm]]}}])";
std::string makeWrapped(const std::string& surface) {
  return R"([{body: thigh, at: "-30 mm, -250 mm, 5 mm"}, {wrap: )" + surface +
         R"(}, {body: shank, at: "-30 mm, -80 mm, 8 mm"}])";
}

/** With a slack length such that it is strained by a few percent. */
std::string makeLigament(const std::string& path, const std::string& slackLength, const std::string& rest = "") {
  return "ligaments.{stiffness: 2000 N, slack: {length: " + slackLength + "}" + rest + ", path: " + path + "}";
}
std::string makeSpring(const std::string& path) {
  return "springs.{stiffness: 20 N/mm, rest: {force: 50 N, pose: zero}, damping: 5 N s/m, path: " + path + "}";
}
/** With slack lengths such that the fibre is near its optimal length. */
std::string makeMuscleText(const std::string& path, bool compliant, const std::string& tendonLength) {
  return "muscles.{max_force: 800 N, fibre_length: 80 mm, tendon_length: " + tendonLength +
         ", pennation: 12 deg, excitation: 0.3, tendon: " + (compliant ? "compliant" : "rigid") + ", path: " + path +
         "}";
}

/** A scene with `copies` of an element; `element` is its section, a dot and its value, or empty. */
std::string makeScene(const std::filesystem::path& urdf, const std::string& element, int copies) {
  std::string text = "genu: 1\nmodel:\n  urdf: " + urdf.string() + kModel;
  if (element.empty() || copies == 0) return text;
  const size_t dot = element.find('.');
  text += element.substr(0, dot) + ":\n";
  for (int i = 0; i < copies; ++i) text += "  e" + std::to_string(i) + ": " + element.substr(dot + 1) + "\n";
  return text;
}

class Model {
 public:
  /** `add` may add `copies` of a force of Simbody's. */
  Model(const std::string& element, int copies, const std::function<void(model::KneeSystem&, int)>& add) {
    const TemporaryFile urdf("element_benchmark.urdf", kUrdf);
    knee_ = std::make_unique<model::KneeSystem>(
        scene::parseScene(makeScene(urdf.path(), element, copies), "element_benchmark.yaml"));
    if (add) add(*knee_, copies);
    start();
  }
  explicit Model(const scene::Scene& scene) : knee_(std::make_unique<model::KneeSystem>(scene)) { start(); }

  model::KneeSystem& knee() { return *knee_; }
  SimTK::State& state() { return state_; }

  /** Pose i of a slow motion about `middle`, with rates. */
  void place(int i, const std::vector<double>& middle, double reach = 1) {
    const double t = 0.01 * i;
    for (int k = 0; k < knee_->numCoordinates(); ++k) {
      const double phase = (1.3 + 0.2 * k) * t;
      const double size = reach * (knee_->coordinates()[static_cast<size_t>(k)].isAngle ? 0.01 : 0.0005);
      state_.updQ()[knee_->stateIndex(k)] = middle[static_cast<size_t>(k)] + size * std::sin(phase);
      state_.updU()[knee_->stateIndex(k)] = size * std::cos(phase);
    }
  }
  void evaluate() { knee_->system().realize(state_, SimTK::Stage::Acceleration); }

  /** Generalized forces of everything but inertia. */
  SimTK::Vector calcGeneralizedForces() {
    knee_->system().realize(state_, SimTK::Stage::Dynamics);
    SimTK::Vector byBodies;
    knee_->matter().multiplyBySystemJacobianTranspose(
        state_, knee_->system().getRigidBodyForces(state_, SimTK::Stage::Dynamics), byBodies);
    return byBodies + knee_->system().getMobilityForces(state_, SimTK::Stage::Dynamics);
  }

 private:
  void start() {
    state_ = knee_->system().realizeTopology();
    knee_->system().realizeModel(state_);
  }

  std::unique_ptr<model::KneeSystem> knee_;
  SimTK::State state_;
};

double readThreadTime_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

const std::vector<double> kMiddle = {0.05, 0.02, 0.03, 0.35, 0.002, 0.001, 0.001};  // hip; knee rx, ry, rz, x, y, z

/** Generalized forces of one element against -T dL/dq, by central differences of the length in elements.sto, over the
 largest. */
double calcForceError(const std::string& element) {
  Model one(element, 1, {}), none("", 0, {});
  const auto quantity = [&](const std::string& name) {
    const auto columns = one.knee().listElementColumns();
    one.knee().system().realize(one.state(), SimTK::Stage::Dynamics);
    const auto values = one.knee().calcElementOutputs(one.state());
    for (size_t i = 0; i < columns.size(); ++i) {
      if (columns[i].quantity == name) return values[i];
    }
    return std::nan("");
  };
  double error = 0, largest = 0;
  for (int i = 0; i < 600; i += 60) {
    one.place(i, kMiddle);
    one.knee().settleElements(one.state());
    none.place(i, kMiddle);
    const SimTK::Vector f = one.calcGeneralizedForces() - none.calcGeneralizedForces();
    const double tension = quantity("force");
    for (int k = 0; k < f.size(); ++k) {
      const double q = one.state().getQ()[k], h = 1e-6;
      one.state().updQ()[k] = q + h;
      const double more = quantity("length");
      one.state().updQ()[k] = q - h;
      const double less = quantity("length");
      one.state().updQ()[k] = q;
      error = std::max(error, std::abs(f[k] + tension * (more - less) / (2 * h)));
      largest = std::max(largest, std::abs(f[k]));
    }
  }
  return error / largest;
}

/** Times kCopies of an element against none. */
void timeForce(benchmark::State& state, const std::string& element,
               const std::function<void(model::KneeSystem&, int)>& add, const std::function<double()>& calcError) {
  Model with(element, kCopies, add), without("", 0, {});
  with.place(0, kMiddle);
  with.knee().settleElements(with.state());
  constexpr int kEvaluations = 50;
  const auto run = [&](Model& m) {  // the same poses every time, a whole cycle of the motion
    const double t0 = readThreadTime_s();
    for (int k = 0; k < kEvaluations; ++k) {
      m.place(12 * k, kMiddle);
      m.evaluate();
    }
    return (readThreadTime_s() - t0) / kEvaluations;
  };
  double leastWith = run(with), leastWithout = run(without);
  for (auto _ : state) {
    const double a = run(with), b = run(without);
    leastWith = std::min(leastWith, a);
    leastWithout = std::min(leastWithout, b);
    state.SetIterationTime(std::max(0.0, a - b) / kCopies);
  }
  state.counters["with_us"] = 1e6 * leastWith;
  state.counters["without_us"] = 1e6 * leastWithout;
  state.counters["least_ns"] = 1e9 * (leastWith - leastWithout) / kCopies;
  state.counters["force_err"] = calcError();
}

void element(benchmark::State& state, const std::string& text) {
  timeForce(state, text, {}, [&] { return calcForceError(text); });
}
/** The elements that are timed, by name. */
std::vector<std::pair<std::string, std::string>> listElements() {
  return {
      {"ligament_straight", makeLigament(kStraight, "163 mm")},
      {"ligament_straight_damped", makeLigament(kStraight, "163 mm", ", damping: 10 ms")},
      {"ligament_via_points", makeLigament(kVia, "502 mm")},
      {"ligament_moving_point", makeLigament(kMoving, "163 mm")},
      {"ligament_cylinder", makeLigament(makeWrapped("cylinder"), "229 mm")},
      {"ligament_sphere", makeLigament(makeWrapped("ball"), "229 mm")},
      {"ligament_ellipsoid", makeLigament(makeWrapped("egg"), "229 mm")},
      {"spring", makeSpring(kStraight)},
      {"muscle_rigid_straight", makeMuscleText(kStraight, false, "85 mm")},
      {"muscle_rigid_cylinder", makeMuscleText(makeWrapped("cylinder"), false, "160 mm")},
      {"muscle_rigid_ellipsoid", makeMuscleText(makeWrapped("egg"), false, "165 mm")},
      {"muscle_compliant_straight", makeMuscleText(kStraight, true, "85 mm")},
      {"muscle_compliant_cylinder", makeMuscleText(makeWrapped("cylinder"), true, "160 mm")},
      {"muscle_compliant_ellipsoid", makeMuscleText(makeWrapped("egg"), true, "165 mm")},
  };
}

/** A coordinate has at most one stop in a scene, so that the copies are Simbody's forces as KneeSystem adds them.
 Error: against k x. */
void softStop(benchmark::State& state) {
  const double stiffness = 1000, upper = 0.2;
  const auto add = [&](model::KneeSystem& knee, int copies) {
    for (int i = 0; i < copies; ++i) {
      SimTK::Force::MobilityLinearStop(knee.forces(), knee.bodyOfCoordinate(3),
                                       SimTK::MobilizerQIndex(knee.axisOfCoordinate(3)), stiffness, 0, -1, upper);
    }
  };
  timeForce(state, "", add, [&] {
    Model one("", 1, add), none("", 0, {});
    one.place(0, kMiddle);
    none.place(0, kMiddle);
    const SimTK::Vector f = one.calcGeneralizedForces() - none.calcGeneralizedForces();
    const int k = one.knee().stateIndex(3);
    const double exact = -stiffness * (one.state().getQ()[k] - upper);
    return std::abs(f[k] / exact - 1);
  });
}
BENCHMARK(softStop)->Name("force/soft_stop")->UseManualTime()->Iterations(100);

/** A force in the axes of the pelvis on a point of the shank. Error: power of its generalized forces against F times
 the point's velocity. */
void externalLoad(benchmark::State& state) {
  const std::string text =
      "loads.{body: shank, frame: pelvis, force: \"10 N, 200 N, -5 N\", point: {at: \"30 mm, -250 mm, 10 mm\"}}";
  timeForce(state, text, {}, [&] {
    Model one(text, 1, {}), none("", 0, {});
    one.place(0, kMiddle);
    none.place(0, kMiddle);
    const SimTK::Vector f = one.calcGeneralizedForces() - none.calcGeneralizedForces();
    const SimTK::Vec3 v =
        one.knee().body("shank").findStationVelocityInGround(one.state(), SimTK::Vec3(0.03, -0.25, 0.01));
    const double exact = SimTK::Vec3(10, 200, -5).elementwiseMultiply(v).sum();
    return std::abs((~f * one.state().getU()) / exact - 1);
  });
}
BENCHMARK(externalLoad)->Name("force/external_load")->UseManualTime()->Iterations(100);

scene::Scene readArtificialKnee(int n, const std::string& rest = "") {
  const auto file = std::filesystem::path(GENU_SOURCE_DIR) / "models/artificial_knee/static.yaml";
  std::ifstream stream(file);
  const std::string text((std::istreambuf_iterator<char>(stream)), {});
  scene::ReadOptions options;
  options.requireModel = true;
  if (n > 0) options.gridOverride = std::pair{n, n};
  return scene::parseScene(text + rest, file, options);
}

/** The artificial knee in its static pose, over the motion of the elements above, a tenth as far. Error: generalized
 forces against a 100 x 100 grid, over the largest force (moments over 25 mm). */
void contactForce(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  scene::Scene scene = readArtificialKnee(n);
  Model with(scene), fine(readArtificialKnee(100));
  auto withoutContact = scene;
  withoutContact.contacts.clear();
  Model without(withoutContact);
  const scene::Coordinates q = model::runStatic(fine.knee(), readArtificialKnee(100)).q;
  const std::vector<double> middle(q.begin(), q.end());
  for (Model* m : {&with, &without, &fine}) m->place(0, middle, 0.02);
  double least[2] = {1, 1};
  for (auto _ : state) {
    double times[2];
    Model* const both[2] = {&with, &without};
    for (int m = 0; m < 2; ++m) {
      const double t0 = readThreadTime_s();
      for (int k = 0; k < 10; ++k) {
        both[m]->place(60 * k, middle, 0.02);
        both[m]->evaluate();
      }
      times[m] = (readThreadTime_s() - t0) / 10;
      least[m] = std::min(least[m], times[m]);
    }
    state.SetIterationTime(std::max(0.0, times[0] - times[1]));
  }
  double error = 0, largest = 0;
  for (int k = 0; k < 200; k += 40) {
    with.place(k, middle, 0.02);
    fine.place(k, middle, 0.02);
    without.place(k, middle, 0.02);
    const SimTK::Vector load = without.calcGeneralizedForces();
    const SimTK::Vector f = with.calcGeneralizedForces() - load, reference = fine.calcGeneralizedForces() - load;
    for (int j = 0; j < f.size(); ++j) {
      const double arm = with.knee().coordinates()[static_cast<size_t>(j)].isAngle ? model::kAngleLength_m : 1;
      error = std::max(error, std::abs(f[j] - reference[j]) / arm);
      largest = std::max(largest, std::abs(reference[j]) / arm);
    }
  }
  state.counters["with_us"] = 1e6 * least[0];
  state.counters["without_us"] = 1e6 * least[1];
  state.counters["least_ns"] = 1e9 * (least[0] - least[1]);
  state.counters["force_err"] = error / largest;
}
BENCHMARK(contactForce)->Name("contact/artificial_knee")->Arg(30)->Arg(50)->UseManualTime()->Iterations(50);

}  // namespace

/** What valgrind counts; a C name, so that it can be asked for by name. */
extern "C" [[gnu::noinline]] void genuCountedEvaluations(void* modelPointer, const double* middle, int n, int first) {
  auto& m = *static_cast<Model*>(modelPointer);
  const std::vector<double> q(middle, middle + m.knee().numCoordinates());
  for (int i = 0; i < n; ++i) {
    m.place(first + i, q, 0.02);
    m.evaluate();
  }
}

namespace {

int writeScenes(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "leg.urdf") << kUrdf;
  for (const auto& [name, text] : listElements())
    std::ofstream(folder / (name + ".yaml")) << makeScene("leg.urdf", text, 1);
  return 0;
}

int count(const std::string& what) {
  const std::string ends =
      R"([{body: insert, at: "0 mm, 10 mm, 40 mm"}, {body: femoral_component, at: "0 mm, 10 mm, 40 mm"}])";
  const std::string over =
      R"([{body: insert, at: "-30 mm, 0 mm, 0 mm"}, {wrap: ball}, {body: femoral_component, at: "-30 mm, 40 mm, 0 mm"}])";
  const std::string ligament = "{stiffness: 2000 N, slack: {length: 20 mm}, path: " + ends + "}\n";
  std::string rest = "\n";
  if (what == "ligament" || what == "two_ligaments") rest += "ligaments:\n  a: " + ligament;
  if (what == "two_ligaments") rest += "  b: " + ligament;
  if (what == "spring") rest += "springs: {a: {stiffness: 20 N/mm, rest: {length: 20 mm}, path: " + ends + "}}\n";
  if (what == "muscle")
    rest +=
        "muscles: {a: {max_force: 500 N, fibre_length: 20 mm, tendon_length: 10 mm, excitation: 0.3, path: " + ends +
        "}}\n";
  if (what == "wrapped") {
    rest +=
        "wraps: {ball: {body: insert, ellipsoid: {a: 10 mm, b: 15 mm, c: 12 mm}, pose: \"0 deg, 0 deg, 0 deg, -30 mm, "
        "25 mm, 3 mm\"}}\n";
    rest += "ligaments: {a: {stiffness: 2000 N, slack: {length: 20 mm}, path: " + over + "}}\n";
  }
  const bool twice = what == "second_contact";
  if (what != "none" && !twice && rest == "\n") {
    std::cerr << "error: --count " << what << "; allowed: none, ligament, two_ligaments, spring, muscle, wrapped, second_contact\n";
    return 2;
  }
  scene::Scene scene = readArtificialKnee(0, rest);
  if (twice) {
    scene.contacts.push_back(scene.contacts.front());
    scene.contacts.back().name = "second";
  }
  Model m(scene);
  const std::vector<double> middle = {8.6e-4, 0,       -0.2618,
                                      -0.005, 0.04353, 0};  // near the static pose: 204 active elements
  genuCountedEvaluations(&m, middle.data(), 0, 0);          // none: makes the name known before counting starts
  m.place(0, middle, 0.02);
  m.knee().settleElements(m.state());
  m.evaluate();
  genuCountedEvaluations(&m, middle.data(), kCounted, 1);
  std::cout << what << ": " << kCounted << " evaluations\n";
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::strcmp(argv[1], "--count") == 0) return count(argv[2]);
  if (argc == 3 && std::strcmp(argv[1], "--write-scenes") == 0) return writeScenes(argv[2]);
  for (const auto& [name, text] : listElements()) {
    benchmark::RegisterBenchmark(("force/" + name).c_str(), element, text)->UseManualTime()->Iterations(100);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
