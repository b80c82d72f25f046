// Table 2 of [BF2004]: ray firing against minimum distance on one surface in 1, 12, 24, 48 and 96 patches, original and with
// fewer control points, error and residual beside the time, with Open CASCADE and Simbody's mesh in the same run.
//   build/release/bin/distance_table [--quick]
// Surface: femoral condyle as a canal surface, sagittal radius of the contour 38 mm falling to 21 mm over 2.6 rad, coronal radius
// 22 mm, interpolated by a bicubic B-spline of 15 x 20 control points. Queries: points from 0.5 mm inside to 1 mm outside, rays
// from them into the solid, up to about 15 degrees from the normal. "tracked": as the engine does it, with the first-order
// predictor and derivatives; "seeded": from the last (u, v) alone; both after motions of 0.01 mm. "cold": without memory. "tracked, a grid's": the nodes of a grid of
// 20 mm x 20 mm in their order, as an evaluation asks for them, many in one knot span; the others are scattered. Exit
// code 1 when an engine row has a failure, a residual above 1e-10 mm or an error above 1e-9 mm. Error: against
// findClosestPointCertified and findLineHits on every 20th query. Compare ratios: times depend on the machine.

#include "DistanceTable.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>

#include "contact/SplitPatch.h"
#include "contact/TestSurfaces.h"
#include "detail/TrackedFoot.h"
#include "detail/TrackedHit.h"
#include "genu/contact/ContactSurface.h"

namespace {

using namespace genu::contact;
using distance_table::Query;
using distance_table::Row;

// ---- Surface ----

/** Contour radius R(phi) = r0 - slope (phi - phi0); the centres of the coronal circles run on the curve with radius R - rc. */
Vec3 condyle(double phi, double psi) {
  constexpr double phi0 = -0.8, r0 = 0.038, slope = (0.038 - 0.021) / 2.6, rc = 0.022;
  const auto centre = [](double a) {  // integral of (R - rc) (cos, sin)
    const double constant = r0 - rc + slope * phi0;
    return Vec2(constant * std::sin(a) - slope * (a * std::sin(a) + std::cos(a)),
                -constant * std::cos(a) - slope * (-a * std::cos(a) + std::sin(a)));
  };
  const Vec2 m = centre(phi) + rc * std::cos(psi) * Vec2(std::sin(phi), -std::cos(phi));
  return Vec3(m.x(), m.y(), rc * std::sin(psi));
}

/** B-spline basis values of degree 3 (Piegl & Tiller A2.2), as one row of a collocation matrix. */
Eigen::RowVectorXd basis(const std::vector<double>& knots, int num, double x) {
  constexpr int p = 3;
  const int k = std::max(p, static_cast<int>(std::upper_bound(knots.begin() + p, knots.begin() + num, x) - knots.begin()) - 1);
  double N[p + 1] = {1}, left[p + 1], right[p + 1];
  for (int j = 1; j <= p; ++j) {
    left[j] = x - knots[static_cast<size_t>(k + 1 - j)];
    right[j] = knots[static_cast<size_t>(k + j)] - x;
    double saved = 0;
    for (int r = 0; r < j; ++r) {
      const double t = N[r] / (right[r + 1] + left[j - r]);
      N[r] = saved + right[r + 1] * t;
      saved = left[j - r] * t;
    }
    N[j] = saved;
  }
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(num);
  for (int j = 0; j <= p; ++j) row[k - p + j] = N[j];
  return row;
}

/** Least-squares bicubic fit of condyle() at samples per direction (samples = number of points: interpolation). Rational: the
 same with prescribed smooth weights, w S fitted in place of S. */
NurbsPatchData fit(int numU, int numV, bool rational, int oversampling) {
  NurbsPatchData d;
  d.numU = numU;
  d.numV = numV;
  d.knotsU = test::clampedKnots(numU, 3, -0.8, 1.8);
  d.knotsV = test::clampedKnots(numV, 3, -1.2, 1.2);
  const auto samples = [&](const std::vector<double>& knots, int num) {
    std::vector<double> at;
    for (int i = 0; i < num; ++i) {  // Greville abscissae, and points between them
      const auto greville = [&](int k) {
        const auto s = static_cast<size_t>(k);
        return (knots[s + 1] + knots[s + 2] + knots[s + 3]) / 3;
      };
      at.push_back(greville(i));
      for (int k = 1; k < oversampling && i + 1 < num; ++k)
        at.push_back(greville(i) + (greville(i + 1) - greville(i)) * k / oversampling);
    }
    return at;
  };
  const auto us = samples(d.knotsU, numU), vs = samples(d.knotsV, numV);
  const auto matrix = [](const std::vector<double>& knots, int num, const std::vector<double>& at) {
    Eigen::MatrixXd m(static_cast<Eigen::Index>(at.size()), num);
    for (size_t i = 0; i < at.size(); ++i) m.row(static_cast<Eigen::Index>(i)) = basis(knots, num, at[i]);
    return m;
  };
  const Eigen::MatrixXd BU = matrix(d.knotsU, numU, us), BV = matrix(d.knotsV, numV, vs);
  Eigen::MatrixXd W(numU, numV);
  for (int i = 0; i < numU; ++i) {
    for (int j = 0; j < numV; ++j) W(i, j) = rational ? 1 + 0.2 * std::sin(0.25 * i) * std::cos(0.2 * j) : 1;
  }
  const Eigen::MatrixXd w = BU * W * BV.transpose();
  d.points.assign(static_cast<size_t>(numU * numV), Vec3::Zero());
  const auto solverU = BU.colPivHouseholderQr(), solverV = BV.colPivHouseholderQr();
  for (int k = 0; k < 3; ++k) {
    Eigen::MatrixXd target(us.size(), vs.size());
    for (size_t i = 0; i < us.size(); ++i) {
      for (size_t j = 0; j < vs.size(); ++j) {
        const auto a = static_cast<Eigen::Index>(i), b = static_cast<Eigen::Index>(j);
        target(a, b) = w(a, b) * condyle(us[i], vs[j])[k];
      }
    }
    const Eigen::MatrixXd half = solverU.solve(target), wP = solverV.solve(half.transpose()).transpose();
    for (int i = 0; i < numU; ++i) {
      for (int j = 0; j < numV; ++j) d.points[static_cast<size_t>(i * numV + j)][k] = wP(i, j) / W(i, j);
    }
  }
  if (rational) {
    for (int i = 0; i < numU; ++i) {
      for (int j = 0; j < numV; ++j) d.weights.push_back(W(i, j));
    }
  }
  const NurbsPatch trial(d);
  d.flipNormal = trial.calcNormal(0, 0).y() > 0;  // outward is down at the distal point
  return d;
}

/** Largest distance of the patch at 200 x 200 places from the canal surface at the same parameters: an upper bound of the
 * deviation. */
double calcDeviation(const NurbsPatchData& d) {
  const NurbsPatch patch(d);
  double worst = 0;
  for (int i = 0; i <= 200; ++i) {
    for (int j = 0; j <= 200; ++j) {
      const double u = patch.uMin() + (patch.uMax() - patch.uMin()) * i / 200,
                   v = patch.vMin() + (patch.vMax() - patch.vMin()) * j / 200;
      worst = std::max(worst, (patch.calcPoint(u, v) - condyle(u, v)).norm());
    }
  }
  return worst;
}

std::vector<NurbsPatchData> split(const NurbsPatchData& whole, int piecesU, int piecesV) {
  std::vector<NurbsPatchData> parts;
  for (const NurbsPatchData& strip : test::splitU(whole, piecesU)) {
    for (const NurbsPatchData& part : test::splitU(test::swapped(strip), piecesV)) parts.push_back(test::swapped(part));
  }
  return parts;
}

[[maybe_unused]] std::vector<distance_table::Patch> toPlain(const std::vector<NurbsPatchData>& patches) {
  std::vector<distance_table::Patch> out;
  for (const NurbsPatchData& d : patches) {
    distance_table::Patch p{d.degreeU, d.degreeV, d.numU, d.numV, d.knotsU, d.knotsV, {}, d.weights};
    for (const Vec3& x : d.points) p.points.insert(p.points.end(), x.data(), x.data() + 3);
    out.push_back(p);
  }
  return out;
}

// ---- Queries ----

constexpr double kMotion = 1e-5;  // [m]

struct Queries {
  std::vector<Query> all;
  std::vector<double> here, there;  // each query point before and after its motion; rays keep their direction
  std::vector<double> n;
  std::vector<int> ids;
};

enum class Spread { scattered, grid };

Queries makeQueries(const NurbsPatchData& whole, int count, Spread spread = Spread::scattered) {
  const NurbsPatch patch(whole);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(-0.6, 1.6), v(-0.95, 0.95), depth(-0.0005, 0.001);
  std::normal_distribution<double> unit(0, 1);
  Queries q;
  const int side = static_cast<int>(std::sqrt(count));
  for (int i = 0; i < (spread == Spread::grid ? side * side : count); ++i) {
    double uu = u(random), vv = v(random);
    if (spread == Spread::grid) {  // 20 mm along radii of about 30 and 22 mm
      uu = 0.5 + 0.65 * ((i % side + 0.5) / side - 0.5);
      vv = 0.9 * ((i / side + 0.5) / side - 0.5);
    }
    const Vec3 normal = patch.calcNormal(uu, vv), before = patch.calcPoint(uu, vv) + depth(random) * normal;
    const Vec3 after = before + kMotion * Vec3(unit(random), unit(random), unit(random)).normalized();
    const Vec3 n = (-normal + 0.15 * Vec3(unit(random), unit(random), unit(random))).normalized();
    Query query{};
    query.u = uu;
    query.v = vv;
    for (Eigen::Index k = 0; k < 3; ++k) {
      query.Q[k] = after[k];
      query.n[k] = n[k];
    }
    q.all.push_back(query);
    q.here.insert(q.here.end(), before.data(), before.data() + 3);
    q.there.insert(q.there.end(), after.data(), after.data() + 3);
    q.n.insert(q.n.end(), n.data(), n.data() + 3);
    q.ids.push_back(i);
  }
  return q;
}

Vec3 at(const std::vector<double>& values, size_t i) { return Vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]); }

/** Slow, certain answers for every `stride`-th query. Returns how many closest points have no certificate. */
int check(const ContactSurface& surface, Queries& q, size_t stride) {
  int uncertified = 0;
  std::vector<LineHit> hits;
  for (size_t i = 0; i < q.all.size(); ++i) {
    Query& query = q.all[i];
    query.checked = i % stride == 0;
    if (!query.checked) continue;
    const Vec3 Q = at(q.there, i), n = at(q.n, i);
    const CertifiedClosestPoint certified = surface.findClosestPointCertified(Q, 1e-12);
    uncertified += !certified.certified;
    query.distance = std::abs(certified.foot.distance_m);
    surface.findLineHits(Q, n, -0.005, 0.005, hits);
    query.t = std::nan("");
    for (const LineHit& h : hits) {
      if (h.normal.dot(n) < 0 && !(std::abs(h.t_m) > std::abs(query.t))) query.t = h.t_m;
    }
  }
  return uncertified;
}

// ---- Engine ----

struct Answer {
  SurfaceParameter at;
  double distance;
  bool good;
};

/** Residual, error and failures of answers to the queries after their motion, computed anew from (u, v). */
void judge(const ContactSurface& surface, const Queries& q, bool ray, const std::vector<Answer>& answers, Row& row) {
  row.residual_m = 0;
  for (size_t i = 0; i < answers.size(); ++i) {
    const Answer& a = answers[i];
    if (!a.good) {
      ++row.failed;
      continue;
    }
    const auto d = surface.patch(a.at.patch).evaluate(a.at.u, a.at.v);
    const Vec3 r = d.S - at(q.there, i);
    const double residual =
        ray ? r.cross(at(q.n, i)).norm() : std::max(std::abs(r.dot(d.Su)) / d.Su.norm(), std::abs(r.dot(d.Sv)) / d.Sv.norm());
    row.residual_m = std::max(row.residual_m, residual);
    if (!q.all[i].checked) continue;
    row.error_m =
        std::max(row.error_m, ray ? std::abs(a.distance - q.all[i].t) : std::abs(std::abs(a.distance) - q.all[i].distance));
  }
}

std::vector<Row> measureEngine(const ContactSurface& surface, const Queries& scattered, const Queries& grid, bool quick) {
  const int count = static_cast<int>(scattered.all.size()), repeats = quick ? 5 : 101;
  std::vector<Row> rows;
  std::vector<Answer> answers(scattered.all.size());

  for (const bool ray : {false, true}) {
    const std::string name = ray ? "ray firing" : "minimum distance";
    const auto measureTracked = [&](const Queries& q, const char* text) {
      const int number = static_cast<int>(q.all.size());
      answers.resize(q.all.size());
      Row row;
      row.method = name + text;
      std::vector<detail::TrackedFoot> feet(q.all.size());
      std::vector<detail::TrackedHit> hits(q.all.size());
      for (size_t i = 0; i < q.all.size(); ++i) feet[i].patch = hits[i].patch = -1;
      const auto track = [&](const std::vector<double>& points) {
        if (ray) {
          detail::trackHits(surface, points.data(), q.n.data(), q.ids.data(), number, hits.data());
        } else {
          detail::trackFeet(surface, points.data(), q.ids.data(), number, feet.data());
        }
      };
      bool away = false;
      track(q.here);
      distance_table::measure(2 * repeats, number, row, [&] {
        away = !away;
        track(away ? q.there : q.here);
      });
      track(q.there);
      for (size_t i = 0; i < q.all.size(); ++i) {
        answers[i] =
            ray ? Answer{{hits[i].patch, hits[i].u, hits[i].v}, hits[i].t_m, hits[i].status == HitStatus::hit}
                : Answer{{feet[i].patch, feet[i].u, feet[i].v}, feet[i].distance_m, feet[i].status == QueryStatus::converged};
      }
      judge(surface, q, ray, answers, row);
      rows.push_back(row);
    };
    measureTracked(grid, ", tracked, a grid's");
    measureTracked(scattered, ", tracked");
    const Queries& q = scattered;
    answers.resize(q.all.size());
    std::vector<SurfaceParameter> seeds;
    for (size_t i = 0; i < q.all.size(); ++i) {
      const Vec3 Q = at(q.here, i);
      seeds.push_back(ray ? surface.findFirstHit(Q, at(q.n, i)).at : surface.findClosestPoint(Q).at);
    }
    for (const bool warm : {true, false}) {
      Row row;
      row.method = name + (warm ? ", seeded" : ", cold");
      double sum = 0;
      long iterations = 0;
      distance_table::measure(repeats, count, row, [&] {
        iterations = 0;
        for (size_t i = 0; i < q.all.size(); ++i) {
          const SurfaceParameter* seed = warm ? &seeds[i] : nullptr;
          if (ray) {
            const FirstHit hit = surface.findFirstHit(at(q.there, i), at(q.n, i), seed);
            answers[i] = {hit.at, hit.t_m, hit.status == HitStatus::hit};
            iterations += hit.iterations;
          } else {
            const ClosestPoint foot = surface.findClosestPoint(at(q.there, i), seed);
            answers[i] = {foot.at, foot.distance_m, foot.status == QueryStatus::converged};
            iterations += foot.iterations;
          }
          sum += answers[i].distance;
        }
      });
      if (!std::isfinite(sum)) ++row.failed;
      row.iterations = static_cast<double>(iterations) / count;
      judge(surface, q, ray, answers, row);
      rows.push_back(row);
    }
  }
  return rows;
}

// ---- Mesh ----

/** Triangles between points of equal (u, v) steps, at most `chord` from the surface at edge and face middles, closed behind by a
 * fan. */
[[maybe_unused]] void tessellate(const NurbsPatchData& data, double chord, std::vector<double>& vertices, std::vector<int>& faces,
                                 double& realChord) {
  const NurbsPatch patch(data);
  for (int nu = 8;; nu = nu * 5 / 4) {
    const int nv = nu;
    const auto place = [&](double i, double j) {
      return patch.calcPoint(patch.uMin() + (patch.uMax() - patch.uMin()) * i / nu,
                             patch.vMin() + (patch.vMax() - patch.vMin()) * j / nv);
    };
    realChord = 0;
    for (int i = 0; i < nu; ++i) {
      for (int j = 0; j < nv; ++j) {
        const Vec3 a = place(i, j), b = place(i + 1, j), c = place(i, j + 1), e = place(i + 1, j + 1);
        realChord =
            std::max({realChord, (0.5 * (b + c) - place(i + 0.5, j + 0.5)).norm(), (0.5 * (a + b) - place(i + 0.5, j)).norm(),
                      (0.5 * (a + c) - place(i, j + 0.5)).norm(), (0.5 * (e + b) - place(i + 1, j + 0.5)).norm()});
      }
    }
    if (realChord > chord) continue;
    vertices.clear();
    faces.clear();
    for (int i = 0; i <= nu; ++i) {
      for (int j = 0; j <= nv; ++j) {
        const Vec3 p = place(i, j);
        vertices.insert(vertices.end(), p.data(), p.data() + 3);
      }
    }
    const int apex = (nu + 1) * (nv + 1);
    const Vec3 behind = 0.25 * (place(0, 0) + place(nu, 0) + place(0, nv) + place(nu, nv));
    vertices.insert(vertices.end(), behind.data(), behind.data() + 3);
    const bool turned = data.flipNormal;
    const auto add = [&](int a, int b, int c) {
      faces.push_back(a);
      faces.push_back(turned ? c : b);
      faces.push_back(turned ? b : c);
    };
    const auto id = [&](int i, int j) { return i * (nv + 1) + j; };
    for (int i = 0; i < nu; ++i) {
      for (int j = 0; j < nv; ++j) {
        add(id(i, j), id(i + 1, j), id(i, j + 1));
        add(id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
      }
    }
    for (int i = 0; i < nu; ++i) {
      add(id(i + 1, 0), id(i, 0), apex);
      add(id(i, nv), id(i + 1, nv), apex);
    }
    for (int j = 0; j < nv; ++j) {
      add(id(0, j), id(0, j + 1), apex);
      add(id(nu, j + 1), id(nu, j), apex);
    }
    return;
  }
}

// ---- Table ----

void print(const std::string& surface, const Row& row) {
  const auto number = [](double value, const char* format) {
    char text[32] = "-";
    if (value >= 0) std::snprintf(text, sizeof text, format, value);
    return std::string(text);
  };
  std::printf("%-26s %-42s %6d %10.0f %10.0f %9s %9s %6s %6d\n", surface.c_str(), row.method.c_str(), row.queries, row.min_ns,
              row.median_ns, number(row.residual_m * (row.residual_m < 0 ? 1 : 1e3), "%.1e").c_str(),
              number(row.error_m * (row.error_m < 0 ? 1 : 1e3), "%.1e").c_str(), number(row.iterations, "%.2f").c_str(),
              row.failed);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  bool quick = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--quick") == 0) {
      quick = true;
    } else {
      std::fprintf(stderr, "usage: distance_table [--quick]\n");
      return 2;
    }
  }
  const int count = quick ? 200 : 1000;
  std::printf("instruction set: %s; %d queries, motion %.2f mm\n", activeInstructionSet(), count, kMotion * 1e3);
  struct Shape {
    const char* name;
    int numU, numV;
    bool rational;
    int oversampling;
  };
  const Shape shapes[] = {{"15x20", 15, 20, false, 1},
                          {"9x11", 9, 11, false, 3},
                          {"15x20 rational", 15, 20, true, 1},
                          {"9x11 rational", 9, 11, true, 3}};
  for (const Shape& s : shapes) {
    std::printf("%s: %s from the canal surface at most %.3f um\n", s.name,
                s.oversampling > 1 ? "least squares," : "interpolated,",
                calcDeviation(fit(s.numU, s.numV, s.rational, s.oversampling)) * 1e6);
  }
  std::printf("%-26s %-42s %6s %10s %10s %9s %9s %6s %6s\n", "surface", "method", "n", "min ns", "median ns", "resid mm",
              "error mm", "evals", "failed");
  int uncertified = 0;
  bool good = true;
  struct Pair {
    std::string surface;
    double minimum, ray;
  };
  std::vector<Pair> tracked;
  const int parts[][2] = {{1, 1}, {3, 4}, {4, 6}, {6, 8}, {8, 12}};
  for (const Shape& s : shapes) {
    const NurbsPatchData whole = fit(s.numU, s.numV, s.rational, s.oversampling);
    for (const auto& pieces : parts) {
      const std::vector<NurbsPatchData> patches = split(whole, pieces[0], pieces[1]);
      if (s.numU != 15 && patches.size() > 1) continue;  // the reduced surface: one patch, as in the paper
      const std::string name =
          std::string(s.name) + ", " + std::to_string(patches.size()) + (patches.size() == 1 ? " patch" : " patches");
      std::vector<NurbsPatch> made;
      for (const NurbsPatchData& d : patches) made.emplace_back(d);
      const ContactSurface surface(std::move(made));
      Queries queries = makeQueries(whole, count);
      Queries grid = makeQueries(whole, count, Spread::grid);
      uncertified += check(surface, queries, 20) + check(surface, grid, 20);
      const std::vector<Row> rows = measureEngine(surface, queries, grid, quick);
      for (const Row& row : rows) {
        print(name, row);
        // Away from tangency the error of AC is at most the residual times tan(theta), of both methods; AB's is far smaller.
        good = good && row.failed == 0 && row.residual_m <= 1e-13 * 1.05 && row.error_m <= 1e-12;
      }
      tracked.push_back({name, rows[1].min_ns, rows[5].min_ns});
#ifdef GENU_WITH_OCCT
      for (const Row& row : distance_table::measureOcct(toPlain(patches), queries.all, quick)) print(name, row);
#endif
      if (patches.size() > 1 || s.rational || s.numU != 15) continue;
#ifdef GENU_WITH_SIMBODY_MESH
      for (const double chord : {5e-5, 5e-6}) {
        std::vector<double> vertices;
        std::vector<int> faces;
        double realChord = 0;
        tessellate(whole, chord, vertices, faces, realChord);
        Row row = distance_table::measureMesh(vertices, faces, queries.all, quick);
        char text[64];
        std::snprintf(text, sizeof text, "mesh, chord %.4f mm", realChord * 1e3);
        print(text, row);
      }
#endif
    }
  }
#ifndef GENU_WITH_OCCT
  std::printf(
      "Open CASCADE: not built: not found or switched off (GENU_WITH_OCCT); scripts/install_dependencies --with-occt installs "
      "it\n");
#endif
#ifndef GENU_WITH_SIMBODY_MESH
  std::printf("Simbody TriangleMesh: not built: GENU_BUILD_MODEL is off\n");
#endif
  std::printf("closest points without a certificate: %d\n", uncertified);
  std::printf("tracked, in units of the minimum distance on %s:\n", tracked.front().surface.c_str());
  for (const Pair& p : tracked) {
    std::printf("  %-26s minimum distance %.2f, ray firing %.2f\n", p.surface.c_str(), p.minimum / tracked.front().minimum,
                p.ray / tracked.front().minimum);
  }
  if (!good) std::printf("FAILED: an engine row has a failure, a residual above 1e-10 mm or an error above 1e-9 mm\n");
  return good ? 0 : 1;
}
