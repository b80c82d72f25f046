// How smooth and how right the contact force is while the grid stays where it is and the bodies move.
//   build/release/bin/smoothness_table [--quick] [--csv FILE] [--plot FILE.png]
// Scene: one condyle (bicubic, 15 x 20 control points) on a dish, pressed to 1500 N; one sphere on a flat layer, whose force is
// known in closed form. Motions: 2 mm anterior-posterior slide in 1 um steps at constant height, and 1 mm approach from first
// touch. For every rule and grid, over 3 x 3 shifts of the grid by thirds of a cell:
//   bias        mean(F / F_ref - 1)
//   rms         rms(F - F_ref) / mean(F_ref)
//   roughness   rms residual of F to a Chebyshev fit of degree 22, over mean(F): what an integrator sees
//   K rough     the same for the stiffness dF/dy by central differences of 2 um, slide only
// F_ref: the closed form, or 240 x 240 elements with the smooth rule (its own error is (30/240)^4 of the 30 x 30 one).
// --plot draws (F - F_ref)/mean(F_ref) along the slide with gnuplot.

#include <Eigen/QR>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"

namespace {

using namespace genu::contact;
using namespace genu::contact::test;

constexpr int kDegree = 22;
constexpr double kHalf_m = 0.0155;  // contact stays inside the grid at 1 mm depth, shifted or not

using Series = std::vector<double>;

double mean(const Series& f) {
  double sum = 0;
  for (const double x : f) sum += x;
  return sum / static_cast<double>(f.size());
}

double rms(const Series& f) {
  double sum = 0;
  for (const double x : f) sum += x * x;
  return std::sqrt(sum / static_cast<double>(f.size()));
}

/** Least-squares Chebyshev fit; the basis is factored once per length. */
class ChebyshevFit {
 public:
  explicit ChebyshevFit(size_t count) : basis_(static_cast<Eigen::Index>(count), kDegree + 1) {
    for (Eigen::Index i = 0; i < basis_.rows(); ++i) {
      const double x = 2.0 * static_cast<double>(i) / static_cast<double>(basis_.rows() - 1) - 1;
      for (int k = 0; k <= kDegree; ++k) basis_(i, k) = std::cos(k * std::acos(x));
    }
    solver_.compute(basis_);
  }
  Series residual(const Series& f) const {
    const Eigen::Map<const Eigen::VectorXd> values(f.data(), static_cast<Eigen::Index>(f.size()));
    const Eigen::VectorXd r = values - basis_ * solver_.solve(values);
    return Series(r.data(), r.data() + r.size());
  }

 private:
  Eigen::MatrixXd basis_;
  Eigen::HouseholderQR<Eigen::MatrixXd> solver_;
};

struct Scene {
  std::string name;
  std::function<ContactPairDefinition(int n, double shiftX, double shiftZ)> make;
  JointCoordinates pose;  // at 1500 N
};

Series run(const ContactPair& pair, const JointCoordinates& start, size_t coordinate, double step, int count, double lift = 0) {
  ContactWorkspace workspace(pair);
  ContactResult r;
  Series f;
  for (int i = 0; i < count; ++i) {
    JointCoordinates q = start;
    q[coordinate] += step * i;
    q[4] += lift;
    pair.evaluate(q, workspace, {}, r);
    f.push_back(r.total.forceOnM_F.y());
  }
  return f;
}

Series difference(const Series& a, const Series& b, double scale) {
  Series d(a.size());
  for (size_t i = 0; i < a.size(); ++i) d[i] = (a[i] - b[i]) * scale;
  return d;
}

double findHeight(const ContactPair& pair, JointCoordinates q, double force) {
  double low = 0.025, high = 0.06;
  while (high - low > 1e-12) {
    q[4] = 0.5 * (low + high);
    (pair.evaluate(q, {}).total.forceOnM_F.y() > force ? low : high) = q[4];
  }
  return high;
}

}  // namespace

int main(int argc, char** argv) {
  bool quick = false;
  std::string csv, plot;
  for (int i = 1; i < argc; ++i) {
    const std::string a = argv[i];
    if (a == "--quick") {
      quick = true;
    } else if ((a == "--csv" || a == "--plot") && i + 1 < argc) {
      (a == "--csv" ? csv : plot) = argv[++i];
    } else {
      std::fprintf(stderr, "usage: smoothness_table [--quick] [--csv FILE] [--plot FILE.png]\n");
      return 2;
    }
  }
  const int slideSteps = quick ? 201 : 2001, approachSteps = quick ? 101 : 1001;
  const double slideStep = 2e-3 / (slideSteps - 1), approachStep = 1e-3 / (approachSteps - 1);

  const double R = 0.030, h = 0.008;
  const auto sphere = share(makeSphere(R));
  const auto plane = share(makePlane(h, 0, 0, Solid::below, 0.05));
  std::vector<NurbsPatch> patches;
  patches.emplace_back(makeCondyle(false, 0));
  const auto condyle = share(std::move(patches));
  const auto dish = share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.020));
  std::vector<Scene> scenes = {
      {"sphere on a flat layer",
       [&](int n, double x, double z) { return makeScene(plane, sphere, constantThickness(h), uhmwpe(), kHalf_m, n, x, z); },
       {0, 0, 0, -0.001, 0, 0}},
      {"condyle on a dish",
       [&](int n, double x, double z) { return makeScene(dish, condyle, aboveZero(), uhmwpe(), kHalf_m, n, x, z); },
       {0.01, 0.02, 0.2, -0.001, 0, 0.0002}}};

  std::ofstream table;
  if (!csv.empty()) table.open(csv);
  if (table) table << "scene,motion,rule,n,active,bias,rms,roughness,stiffness_roughness\n";
  std::vector<std::pair<std::string, Series>> curves;

  for (Scene& scene : scenes) {
    const ContactPair reference(scene.make(240, 0, 0));
    JointCoordinates middle = scene.pose;
    middle[3] = 0;
    scene.pose[4] = findHeight(reference, middle, 1500);
    JointCoordinates approach = middle;
    approach[4] = findHeight(reference, middle, 1e-3);  // first touch
    const bool closed = scene.name[0] == 's';
    const auto exact = [&](double D) {
      const double K = uhmwpe().confinementFactor() * uhmwpe().E_Pa;
      return D > 0 ? kPi * K * D * D / h * (R - 2 * D / 3) : 0.0;
    };
    Series slideRef, slideRefUp, slideRefDown, approachRef;
    if (closed) {
      for (int i = 0; i < slideSteps; ++i) slideRef.push_back(exact(h + R - scene.pose[4]));
      for (int i = 0; i < approachSteps; ++i) approachRef.push_back(exact(h + R - approach[4] + approachStep * i));
    } else {
      slideRef = run(reference, scene.pose, 3, slideStep, slideSteps);
      approachRef = run(reference, approach, 4, -approachStep, approachSteps);
    }
    const ChebyshevFit slideFit(static_cast<size_t>(slideSteps)), approachFit(static_cast<size_t>(approachSteps));
    std::printf("\n%s, 1500 N, 31 x 31 mm grid; reference: %s\n", scene.name.c_str(), closed ? "closed form" : "240 x 240, smooth rule");
    std::printf("%-8s %-9s %5s %7s %11s %11s %11s %11s\n", "motion", "rule", "n", "active", "bias", "rms", "roughness", "K rough");
    for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
      for (const int n : {15, 20, 30, 50}) {
        double bias[2] = {}, square[2] = {}, rough[2] = {}, roughK = 0;
        int active = 0, phases = 0;
        for (int px = 0; px < 3; ++px) {
          for (int pz = 0; pz < 3; ++pz, ++phases) {
            auto d = scene.make(n, 2 * kHalf_m / n * px / 3, 2 * kHalf_m / n * pz / 3);
            d.rule = rule;
            const ContactPair pair(d);
            active += pair.evaluate(scene.pose, {}).total.activeElements;
            const Series slide = run(pair, scene.pose, 3, slideStep, slideSteps);
            const Series down = run(pair, approach, 4, -approachStep, approachSteps);
            const double meanSlide = mean(slideRef), meanDown = mean(approachRef);
            const Series error = difference(slide, slideRef, 1 / meanSlide);
            bias[0] += mean(slide) / meanSlide - 1;
            bias[1] += mean(down) / meanDown - 1;
            square[0] += std::pow(rms(error), 2);
            square[1] += std::pow(rms(difference(down, approachRef, 1 / meanDown)), 2);
            rough[0] += std::pow(rms(slideFit.residual(slide)) / mean(slide), 2);
            rough[1] += std::pow(rms(approachFit.residual(down)) / mean(down), 2);
            const Series K = difference(run(pair, scene.pose, 3, slideStep, slideSteps, -1e-6),
                                        run(pair, scene.pose, 3, slideStep, slideSteps, 1e-6), 1 / 2e-6);
            roughK += std::pow(rms(slideFit.residual(K)) / mean(K), 2);
            if (phases == 0 && n == 30) curves.emplace_back(scene.name + (rule == ContactRule::smooth ? ", smooth" : ", centre"), error);
          }
        }
        for (int m = 0; m < 2; ++m) {
          const char* motion = m == 0 ? "slide" : "approach";
          const char* name = rule == ContactRule::smooth ? "smooth" : "centre";
          const double values[3] = {bias[m] / phases, std::sqrt(square[m] / phases), std::sqrt(rough[m] / phases)};
          std::printf("%-8s %-9s %5d %7d %+11.2e %11.2e %11.2e", motion, name, n, active / phases, values[0], values[1], values[2]);
          if (m == 0) {
            std::printf(" %11.2e\n", std::sqrt(roughK / phases));
          } else {
            std::printf("\n");
          }
          if (table) {
            table << scene.name << ',' << motion << ',' << name << ',' << n << ',' << active / phases << ',' << values[0] << ',' << values[1]
                  << ',' << values[2] << ',' << (m == 0 ? std::to_string(std::sqrt(roughK / phases)) : "") << '\n';
          }
        }
        std::fflush(stdout);
      }
    }
  }
  if (!plot.empty()) {
    FILE* gnuplot = popen("gnuplot", "w");
    if (gnuplot == nullptr) {
      std::fprintf(stderr, "error: gnuplot cannot be started; the curve is not drawn\n");
      return 1;
    }
    std::fprintf(gnuplot, "set terminal pngcairo size 1200,800\nset output '%s'\nset multiplot layout 2,1\n", plot.c_str());
    std::fprintf(gnuplot, "set xlabel 'anterior-posterior position (mm)'\nset ylabel '(F - F_{ref}) / mean F_{ref}'\nset format y '%%.0e'\nset key outside top\n");
    for (const char* rule : {"centre", "smooth"}) {
      std::string command = "plot ";
      for (const auto& curve : curves) {
        if (curve.first.find(rule) != std::string::npos) command += (command.size() > 5 ? ", '-'" : "'-'") + (" with lines title '" + curve.first + ", 30 x 30'");
      }
      std::fprintf(gnuplot, "%s\n", command.c_str());
      for (const auto& curve : curves) {
        if (curve.first.find(rule) == std::string::npos) continue;
        for (size_t i = 0; i < curve.second.size(); ++i) {
          std::fprintf(gnuplot, "%g %g\n", -1 + 1e3 * slideStep * static_cast<double>(i), curve.second[i]);
        }
        std::fprintf(gnuplot, "e\n");
      }
    }
    std::fprintf(gnuplot, "unset multiplot\n");
    if (pclose(gnuplot) != 0) {
      std::fprintf(stderr, "error: gnuplot failed; %s is not drawn\n", plot.c_str());
      return 1;
    }
  }
  return 0;
}
