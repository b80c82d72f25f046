// What every option of the contact engine costs, against the first row of its table, error beside time.
//   build/release/bin/engine_table [--quick] [--table laws|modes|grids|active|patches|pairs|threads|instructions|implant]
// Scene: KneeScene.h, 2 x 30 x 30 elements, about 300 active, smooth rule, unless a row says otherwise; poses wander by 0.01 mm an
// evaluation. Times are of one evaluation: minimum and median of 20 repeats of 50 evaluations (--quick: 5 of 20), processor time of
// the thread (threads: by the clock on the wall). The repeats of a table's rows take turns, so that other work on the machine meets
// all of them. Force error: root mean square of |F - F_ref| over 12 poses, over that of |F_ref|; F_ref is the same law on 240 x 240
// elements with the smooth rule.

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "benchmarks/KneeScene.h"
#include "contact/SplitPatch.h"
#include "detail/Kernels.h"
#include "genu/contact/ErrorEstimate.h"
#ifdef GENU_WITH_THREADS
#include "genu/contact/Threads.h"
#endif
#ifdef GENU_WITH_MODEL
#include "genu/model/Analysis.h"
#include "genu/scene/SceneFile.h"
#endif

namespace {

using namespace genu::contact;
using namespace genu::contact::test;

int repeats = 20, evaluations = 50;

struct Row {
  std::string name;
  ContactPairDefinition definition;
  std::string law;          // rows of one law and middle share their reference
  JointCoordinates middle;  // of the path
  ContactPair::Options options = {};
  bool cold = false, moving = false;
  std::optional<Companion> companion = {};
  int pairs = 1;
  double reach = 1;  // of the path
  const TaskRunner* threads = nullptr;
  bool wallTime = false;
  const char* instructions = nullptr;
  // Measured.
  double min_us = 0, median_us = 0, active = 0, queries = 0, force_N = 0, error = -1;
  std::vector<NetLoad> loads = {};  // at the poses of the error
};

/** Rates of the path run through at 1000 poses a second, some 10 mm/s. */
JointCoordinates rates(int i, const Row& row) {
  const JointCoordinates a = wander(i - 1, row.middle, row.reach), b = wander(i + 1, row.middle, row.reach);
  JointCoordinates rate{};
  for (size_t k = 0; k < 6; ++k) rate[k] = (b[k] - a[k]) / 2e-3;
  return rate;
}

double readClock(bool wall) {
  timespec t{};
  clock_gettime(wall ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

class Runner {
 public:
  explicit Runner(const Row& row) : row_(row) {
    for (int k = 0; k < row.pairs; ++k) {
      pairs_.emplace_back(row.definition);
      workspaces_.emplace_back(pairs_.back());
      workspaces_.back().setTaskRunner(row.threads);
    }
    if (row.companion) estimator_.emplace(pairs_.front(), *row.companion);
  }
  const ContactResult& evaluate(int i) {
    for (size_t k = 0; k < pairs_.size(); ++k) {
      if (row_.cold) workspaces_[k].reset();
      const JointCoordinates q = wander(i, row_.middle, row_.reach);
      if (row_.moving) {
        pairs_[k].evaluate(q, rates(i, row_), workspaces_[k], row_.options, result_);
      } else {
        pairs_[k].evaluate(q, workspaces_[k], row_.options, result_);
      }
    }
    if (estimator_) estimator_->evaluate(workspaces_.front(), estimate_);
    return result_;
  }
  /** Time of one evaluation [s], over the next stretch of the path. */
  double time(Row& row) {
    genu::contact::detail::forceInstructionSet(row_.instructions);
    evaluate(next_++);
    const double start = readClock(row.wallTime);
    for (int k = 0; k < evaluations; ++k) {
      const ContactResult& r = evaluate(next_++);
      row.active += r.total.activeElements;
      row.queries += r.distanceQueries;
      row.force_N += r.total.scalarForce_N;
    }
    const double seconds = readClock(row.wallTime) - start;
    genu::contact::detail::forceInstructionSet(nullptr);
    return seconds / evaluations;
  }

 private:
  const Row& row_;
  std::vector<ContactPair> pairs_;
  std::vector<ContactWorkspace> workspaces_;
  std::optional<ErrorEstimator> estimator_;
  ContactResult result_;
  ContactErrorEstimate estimate_;
  int next_ = 0;
};

std::vector<NetLoad> calcLoads(Row row) {
  row.companion.reset();
  row.pairs = 1;
  genu::contact::detail::forceInstructionSet(row.instructions);
  Runner runner(row);
  std::vector<NetLoad> loads;
  for (int k = 0; k < 12; ++k) loads.push_back(runner.evaluate(97 * k).total);
  genu::contact::detail::forceInstructionSet(nullptr);
  return loads;
}

double calcError(const Row& row) {
  static std::map<std::pair<std::string, JointCoordinates>, std::vector<NetLoad>> references;
  std::vector<NetLoad>& reference = references[{row.law, row.middle}];
  if (reference.empty()) {
    Row fine = row;
    for (CompartmentDefinition& c : fine.definition.compartments) c.nx = c.nz = 240;
    fine.definition.rule = ContactRule::smooth;
    fine.definition.tracking = Tracking::lipschitz;
    fine.options = {};
    fine.cold = false;
    fine.instructions = nullptr;
    fine.threads = nullptr;
    reference = calcLoads(fine);
  }
  double error = 0, scale = 0;
  for (size_t k = 0; k < reference.size(); ++k) {
    error += (row.loads[k].forceOnM_F - reference[k].forceOnM_F).squaredNorm();
    scale += reference[k].forceOnM_F.squaredNorm();
  }
  return scale > 0 ? std::sqrt(error / scale) : -1;
}

void measure(std::vector<Row>& rows) {
  std::vector<Runner> runners;
  runners.reserve(rows.size());
  for (const Row& row : rows) runners.emplace_back(row);
  std::vector<std::vector<double>> times(rows.size());
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (size_t k = 0; k < rows.size(); ++k) times[k].push_back(1e6 * runners[k].time(rows[k]));
  }
  const double count = repeats * evaluations;
  for (size_t k = 0; k < rows.size(); ++k) {
    std::sort(times[k].begin(), times[k].end());
    Row& row = rows[k];
    row.min_us = times[k].front();
    row.median_us = 0.5 * (times[k][(times[k].size() - 1) / 2] + times[k][times[k].size() / 2]);
    row.active /= count;
    row.queries /= count;
    row.force_N /= count;
    row.loads = calcLoads(row);
    row.error = calcError(row);
  }
}

double loadAverage() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : -1;
}

void printHeader(const char* title) {
  std::printf("\n### %s\n\nLoad average %.2f before.\n\n", title, loadAverage());
  std::fflush(stdout);
}

void print(const char* title, std::vector<Row>& rows) {
  printHeader(title);
  measure(rows);
  std::printf("| %-54s | %8s | %7s | %7s | %9s | %9s | %5s | %11s |\n", "", "elements", "active", "queries", "min us", "median us", "ratio",
              "force error");
  std::printf("|---|---:|---:|---:|---:|---:|---:|---:|\n");
  for (const Row& row : rows) {
    int elements = 0;
    for (const CompartmentDefinition& c : row.definition.compartments) elements += c.nx * c.nz * row.pairs;
    char error[32] = "-";
    if (row.error >= 0) std::snprintf(error, sizeof error, "%.2g %%", 100 * row.error);
    std::printf("| %-54s | %8d | %7.0f | %7.0f | %9.1f | %9.1f | %5.2f | %11s |\n", row.name.c_str(), elements, row.active, row.queries,
                row.min_us, row.median_us, row.min_us / rows[0].min_us, error);
  }
  std::fflush(stdout);
}

/** Prints the exponent e of cost = constant * size^e by least squares over the rows. */
void printExponent(const char* what, const std::vector<Row>& rows, const std::function<double(const Row&)>& size) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(rows.size());
  for (const Row& row : rows) {
    const double a = std::log(size(row)), b = std::log(row.min_us);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
  }
  const double e = (n * xy - x * y) / (n * xx - x * x);
  std::printf("\nCost grows with the number of %s to the power %.2f.\n", what, e);
}

Material powerLaw(double n) {
  Material m = uhmwpePowerLaw();
  m.n = n;
  return m;
}

JointCoordinates atHeight(double y) { return {0, 0, 0.2, 0, y, 0}; }

JointCoordinates findMiddle(const ContactPairDefinition& d, int active = 300) { return atHeight(findHeight(ContactPair(d), active)); }

ContactPairDefinition knee(int n = 30, Material material = uhmwpe(), StrainMeasure strain = StrainMeasure::small) {
  return makeKnee(n, true, std::move(material), strain);
}

void laws() {
  struct Law {
    std::string name;
    ContactPairDefinition definition;
  };
  std::vector<Law> all = {{"linear", knee()},
                          {"logarithmic", knee(30, uhmwpe(), StrainMeasure::large)},
                          {"power law, n = 3", knee(30, powerLaw(3))},
                          {"power law, n = 3.7", knee(30, powerLaw(3.7))},
                          {"natural knee: two layers, map, logarithmic", knee()},
                          {"two materials in series", knee()},
                          {"energy form, linear", knee()},
                          {"damped, linear", knee()}};
  makeNatural(all[4].definition);
  all[5].definition.movingThickness = constantThickness(0.003);
  all[5].definition.movingMaterial = cartilage();
  all[6].definition.correction = Correction::energy;
  all[7].definition.damping_sPerM = 1;
  std::vector<Row> rows;
  for (const Law& law : all) {
    const JointCoordinates middle = findMiddle(law.definition);
    for (const bool stiffness : {false, true}) {
      Row row{law.name + (stiffness ? " + stiffness" : ""), law.definition, law.name, middle};
      row.options.withStiffness = stiffness;
      row.moving = law.definition.damping_sPerM > 0;
      rows.push_back(row);
    }
  }
  Row flat{"linear, flat layers", makeKnee(30, false, uhmwpe(), StrainMeasure::small), "flat", {}};
  flat.middle = findMiddle(flat.definition);
  rows.push_back(flat);
  print("Laws", rows);
}

void modes() {
  const JointCoordinates middle = findMiddle(knee());
  const auto make = [&](const char* name) { return Row{name, knee(), "linear", middle}; };
  std::vector<Row> rows(11, make("linear, Lipschitz tracking"));
  rows[1].name = "with energy";
  rows[1].options.withEnergy = true;
  rows[2].name = "centre rule";
  rows[2].definition.rule = ContactRule::centre;
  rows[3].name = "centre rule, ray firing (another distance)";
  rows[3].definition.rule = ContactRule::centre;
  rows[3].definition.distance = DistanceMethod::ray;
  rows[4].name = "tracking: breadth first";
  rows[4].definition.tracking = Tracking::breadthFirst;
  rows[5].name = "tracking: breadth first, unguarded";
  rows[5].definition.tracking = Tracking::breadthFirstUnguarded;
  rows[6].name = "tracking: every element";
  rows[6].definition.tracking = Tracking::all;
  rows[7].name = "out of contact by 5 mm";
  rows[7].middle[4] += 0.005;
  rows[8].name = "cold";
  rows[8].cold = true;
  rows[9].name = "with error estimate, fine";
  rows[9].companion = Companion::fine;
  rows[10].name = "with error estimate, coarse";
  rows[10].companion = Companion::coarse;
  print("Modes", rows);
}

void grids() {
  const JointCoordinates middle = findMiddle(knee());
  std::vector<Row> rows;
  for (const int n : {20, 30, 50, 70, 100, 140, 200}) {
    rows.push_back({"2 x " + std::to_string(n) + " x " + std::to_string(n), knee(n), "linear", middle});
  }
  print("Grids, the same contact area", rows);
  printExponent("elements", rows, [](const Row& row) { return static_cast<double>(row.definition.compartments[0].nx * row.definition.compartments[0].nz); });
}

void active() {
  std::vector<Row> rows;
  for (const int n : {100, 200, 300, 450, 600}) rows.push_back({"about " + std::to_string(n) + " active", knee(), "linear", findMiddle(knee(), n)});
  print("Active elements, 2 x 30 x 30", rows);
  printExponent("active elements", rows, [](const Row& row) { return row.active; });
}

void patches() {
  const JointCoordinates middle = findMiddle(knee());
  std::vector<Row> rows;
  for (const int count : {1, 2, 4, 8, 16, 32, 64, 96}) {
    Row row{std::to_string(count) + (count == 1 ? " patch" : " patches"), knee(), "linear", middle};
    for (CompartmentDefinition& c : row.definition.compartments) {
      const Pose X{Mat3::Identity(), Vec3(0, 0, 0.5 * (c.z0_m + c.z1_m))};
      std::vector<NurbsPatch> parts;
      for (const NurbsPatchData& part : splitU(makeCondyle(false, 0), count)) parts.push_back(NurbsPatch(part).transformed(X));
      c.movingSurface = share(std::move(parts));
    }
    rows.push_back(row);
  }
  print("Patches of each moving surface, the same shape", rows);
}

void pairs() {
  const JointCoordinates middle = findMiddle(knee());
  std::vector<Row> rows;
  for (const int count : {1, 2, 4, 8}) {
    rows.push_back({std::to_string(count) + (count == 1 ? " pair" : " pairs"), knee(), "linear", middle});
    rows.back().pairs = count;
  }
  print("Pairs in turn (elements: of all, active and queries: of one)", rows);
  printExponent("pairs", rows, [](const Row& row) { return static_cast<double>(row.pairs); });
}

bool bitwiseEqual(const Row& a, const Row& b) {
  for (size_t k = 0; k < a.loads.size(); ++k) {
    const NetLoad &x = a.loads[k], &y = b.loads[k];
    if (std::memcmp(x.forceOnM_F.data(), y.forceOnM_F.data(), 3 * sizeof(double)) != 0 ||
        std::memcmp(x.momentOnM_Fo_F.data(), y.momentOnM_Fo_F.data(), 3 * sizeof(double)) != 0 || x.peakPressure_Pa != y.peakPressure_Pa ||
        x.area_m2 != y.area_m2) {
      return false;
    }
  }
  return true;
}

void threads() {
#ifdef GENU_WITH_THREADS
  printHeader("Threads");
  const Threads two(2);
  const JointCoordinates middle = findMiddle(knee());
  std::printf("| elements     | stiffness | 1 thread us (median) | 2 threads us (median) | speed-up | bitwise equal | load average |\n");
  std::printf("|---|---|---:|---:|---:|---|---:|\n");
  for (const bool stiffness : {false, true}) {
    for (const int n : {20, 30, 50, 100, 200}) {
      std::vector<Row> rows(2, Row{"", knee(n), "linear", middle});
      for (Row& row : rows) {
        row.options.withStiffness = stiffness;
        row.wallTime = true;
      }
      rows[1].threads = &two;
      measure(rows);
      std::printf("| 2 x %3d x %-3d | %-9s | %9.1f (%8.1f) | %10.1f (%8.1f) | %8.2f | %-13s | %12.2f |\n", n, n, stiffness ? "yes" : "no",
                  rows[0].min_us, rows[0].median_us, rows[1].min_us, rows[1].median_us, rows[0].min_us / rows[1].min_us,
                  bitwiseEqual(rows[0], rows[1]) ? "yes" : "NO", loadAverage());
      std::fflush(stdout);
    }
  }
#else
  std::printf("\n### Threads\n\nSkipped: the library of threads is not built (GENU_WITH_CONTACT_THREADS).\n");
#endif
}

void instructions() {
  const JointCoordinates middle = findMiddle(knee());
  std::vector<Row> rows;
  for (const bool stiffness : {false, true}) {
    for (const char* name : {"baseline", "avx2", "avx512"}) {
      if (!genu::contact::detail::forceInstructionSet(name)) {
        if (!stiffness) std::printf("\nThis processor has no %s: left out.\n", name);
        continue;
      }
      rows.push_back({std::string(name) + (stiffness ? " + stiffness" : ""), knee(), "linear", middle});
      rows.back().options.withStiffness = stiffness;
      rows.back().instructions = name;
    }
  }
  genu::contact::detail::forceInstructionSet(nullptr);
  print("Instruction sets", rows);
}

#ifdef GENU_WITH_MODEL
/** Forces of the single elements on coarse grids against those of fine ones, over the poses of a gait cycle; what of the errors is on the
 elements that are marked as not resolved. */
void printElements(const ContactPairDefinition& definition, const std::vector<JointCoordinates>& poses) {
  std::printf("\n| Grid | Element forces %% | Net force %% | Marked, of the force %% | Of the squared error %% | Element forces, the others %% |\n");
  std::printf("|---|---|---|---|---|---|\n");
  for (const ContactRule rule : {ContactRule::smooth, ContactRule::centre}) {
    for (const int n : {12, 16, 24, 30, 50}) {
      const int times = static_cast<int>(std::lround(192.0 / n));
      ContactPairDefinition d = definition;
      for (CompartmentDefinition& c : d.compartments) c.nx = c.nz = n * times;
      d.rule = ContactRule::smooth;
      const ContactPair fine(d);
      for (CompartmentDefinition& c : d.compartments) c.nx = c.nz = n;
      d.rule = rule;
      const ContactPair pair(d);
      ContactWorkspace workspace(pair), fineWorkspace(fine);
      ContactResult result, fineResult;
      struct Sums {
        double error = 0, exact = 0, netError = 0, netExact = 0, marked = 0, force = 0, markedError = 0;
      };
      std::vector<Sums> sums(d.compartments.size());
      for (const JointCoordinates& q : poses) {
        pair.evaluate(q, workspace, {}, result);
        fine.evaluate(q, fineWorkspace, {}, fineResult);
        const auto fields = pair.calcFields(workspace), fineFields = fine.calcFields(fineWorkspace);
        for (size_t k = 0; k < sums.size(); ++k) {
          std::map<std::pair<int, int>, double> exact_N;
          for (const ElementField& f : fineFields[k]) exact_N[{f.ix / times, f.iz / times}] += f.force_N;
          Sums& s = sums[k];
          for (const ElementField& f : fields[k]) {
            const double error = std::pow(f.force_N - exact_N[{f.ix, f.iz}], 2);
            s.error += error;
            s.force += f.force_N;
            if (!f.unresolved) continue;
            s.marked += f.force_N;
            s.markedError += error;
          }
          for (const auto& item : exact_N) s.exact += item.second * item.second;
          s.netError += (result.compartments[k].forceOnM_F - fineResult.compartments[k].forceOnM_F).squaredNorm();
          s.netExact += fineResult.compartments[k].forceOnM_F.squaredNorm();
        }
      }
      const auto list = [&](auto value) {
        std::string text;
        for (const Sums& s : sums) {
          char number[32];
          std::snprintf(number, sizeof number, "%s%.2g", text.empty() ? "" : " / ", 100 * value(s));
          text += number;
        }
        return text;
      };
      std::printf("| %s, %d x %d | %s | %s |", rule == ContactRule::smooth ? "smooth" : "centre", n, n,
                  list([](const Sums& s) { return std::sqrt(s.error / s.exact); }).c_str(),
                  list([](const Sums& s) { return std::sqrt(s.netError / s.netExact); }).c_str());
      if (rule == ContactRule::centre) {
        std::printf(" | | |\n");
        continue;
      }
      std::printf(" %s | %s | %s |\n", list([](const Sums& s) { return s.marked / s.force; }).c_str(),
                  list([](const Sums& s) { return s.markedError / s.error; }).c_str(),
                  list([](const Sums& s) { return std::sqrt((s.error - s.markedError) / s.exact); }).c_str());
    }
  }
  std::printf("\nRoot mean square over that of the force, of each compartment, %zu poses, against 180 to 200 elements each way.\n", poses.size());
}
#endif

void implant() {
  const char* const title = "\n### Implant DM, a measured total knee replacement\n\n";
#ifdef GENU_WITH_MODEL
  namespace fs = std::filesystem;
  const fs::path source = GENU_SOURCE_DIR;
  const char* data = std::getenv("GENU_DATA_DIR");
  if (data == nullptr || !fs::is_directory(fs::path(data) / "tka_dm")) {
    std::printf("%sSkipped: GENU_DATA_DIR does not name a folder that holds tka_dm/ (models/tka_dm/README.md says where it is from).\n", title);
    return;
  }
  if (!fs::exists(source / "build/results/tka_dm/surfaces/femur_medial.json")) {
    std::printf("%sSkipped: the surfaces are not fitted; scripts/fit_tka_dm build/results/tka_dm/surfaces\n", title);
    return;
  }
  // The pose of the gait cycle in which the implant carries 1500 N, or nearest to it.
  genu::scene::ReadOptions options;
  options.requireModel = true;
  options.gridOverride = std::pair{30, 30};
  const auto scene = genu::scene::readScene(source / "models/tka_dm/gait.yaml", options);
  const auto gait = genu::model::runGait(scene);
  const auto distance = [](const auto& frame) { return std::abs(frame.contacts[0].total.scalarForce_N - 1500); };
  const auto frame = std::min_element(gait.frames.begin(), gait.frames.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
  if (frame == gait.frames.end()) {
    std::printf("%sSkipped: the gait cycle gave no frame: %s\n", title, gait.statusText.c_str());
    return;
  }
  std::vector<Row> rows(3, Row{"linear", scene.contacts[0].definition, "implant", genu::scene::takeSix(frame->q)});
  for (Row& row : rows) row.reach = 0.1;  // the implant is stiff and not round: 1 mm ahead it may not touch
  rows[1].name = "linear + stiffness";
  rows[1].options.withStiffness = true;
  rows[2].name = "centre rule";
  rows[2].definition.rule = ContactRule::centre;
  for (const int n : {60, 120}) {
    rows.push_back(rows[0]);
    rows.back().name = "linear, 2 x " + std::to_string(n) + " x " + std::to_string(n);
    for (CompartmentDefinition& c : rows.back().definition.compartments) c.nx = c.nz = n;
  }
  print("Implant DM, a measured total knee replacement", rows);
  std::printf("\nForce %.0f N on average over the path.\n", rows[0].force_N);
  std::vector<JointCoordinates> poses;
  for (size_t i = 0; i < gait.frames.size(); i += 4) poses.push_back(genu::scene::takeSix(gait.frames[i].q));
  printElements(scene.contacts[0].definition, poses);
#else
  std::printf("%sSkipped: built without the model layer (GENU_BUILD_MODEL).\n", title);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  const std::pair<const char*, void (*)()> tables[] = {{"laws", laws},       {"modes", modes}, {"grids", grids},     {"active", active},
                                                       {"patches", patches}, {"pairs", pairs}, {"threads", threads}, {"instructions", instructions},
                                                       {"implant", implant}};
  std::string only;
  bool known = true;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--quick") == 0) {
      repeats = 5;
      evaluations = 20;
    } else if (std::strcmp(argv[i], "--table") == 0 && i + 1 < argc) {
      only = argv[++i];
      known = std::any_of(std::begin(tables), std::end(tables), [&](const auto& t) { return only == t.first; });
    } else {
      known = false;
    }
  }
  if (!known) {
    std::fprintf(stderr, "usage: engine_table [--quick] [--table laws|modes|grids|active|patches|pairs|threads|instructions|implant]\n");
    return 2;
  }
  std::printf("Instruction set %s; minimum and median of %d repeats of %d evaluations.\n", activeInstructionSet(), repeats, evaluations);
  try {
    for (const auto& table : tables) {
      if (only.empty() || only == table.first) table.second();
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "error: %s\n", e.what());
    return 1;
  }
  return 0;
}
