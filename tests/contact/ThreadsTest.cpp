// Threads change the time of an evaluation, never a bit of its results.

#include "genu/contact/Threads.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "contact/Scenes.h"
#include "contact/TestSurfaces.h"
#include "detail/Kernels.h"

namespace genu::contact {
namespace {

using namespace test;
using testing::HasSubstr;

/** Two condyles over a dish, a compartment each: x < 0 and x > 0. */
ContactPairDefinition makeTwoCompartments(Material material, StrainMeasure strain, int n = 100) {
  const auto dish = share(makeDish(0.008, 0.060, 0.035, Solid::below, 0.03));
  auto d = makeScene(dish, share(makeSphere(0.028)), aboveZero(), material, 0.012, n, -0.006, 0);
  d.compartments[0].name = "one";
  d.compartments[0].x1_m = 0;
  d.compartments.push_back(d.compartments[0]);
  d.compartments[1].name = "two";
  d.compartments[1].x0_m = 0;
  d.compartments[1].x1_m = 0.012;
  std::vector<NurbsPatch> condyle;
  condyle.emplace_back(makeCondyle(false, 0));
  d.compartments[1].movingSurface = shareIn(condyle, Pose{Mat3::Identity(), Vec3(0, -0.0005, 0)});
  d.strain = strain;
  d.copyTolerance = -1;
  return d;
}

/** Height at which contact begins, rotations zero. */
double findTouch(const ContactPair& pair) {
  double low = 0.02, high = 0.08;
  while (high - low > 1e-8) {
    const double y = 0.5 * (low + high);
    (pair.evaluate(JointCoordinates{0, 0, 0, 0, y, 0}, {}).total.activeElements > 0 ? low : high) = y;
  }
  return high;
}

struct Step {
  JointCoordinates q, qdot;
};

/** A random walk within 0.4 mm of depth, with a jump of all coordinates every seventh step, out of contact at times. */
std::vector<Step> makeWalk(double touch, int steps, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Step> walk;
  JointCoordinates q{0, 0, 0, 0, touch - 2e-4, 0};
  for (int i = 0; i < steps; ++i) {
    const double by = i % 7 == 6 ? 30 : 1;
    for (size_t k = 0; k < 6; ++k) q[k] += by * unit(random) * (k < 3 ? 1e-3 : 2e-5);
    for (size_t k = 0; k < 6; ++k) {
      const double middle = k == 4 ? touch - 2e-4 : 0, reach = k == 4 ? 3e-4 : k < 3 ? 0.05 : 1e-3;
      q[k] = std::clamp(q[k], middle - reach, middle + reach);
    }
    Step step{q, {}};
    for (size_t k = 0; k < 6; ++k) step.qdot[k] = unit(random) * (k < 3 ? 1 : 0.05);
    walk.push_back(step);
  }
  return walk;
}

/** Whether some compartment's peak was met between grid points, by a query of its own. */
bool isPeakBetween(const ContactPair& pair, const ContactWorkspace& workspace, const ContactResult& r) {
  const auto fields = pair.calcFields(workspace);
  for (size_t k = 0; k < fields.size(); ++k) {
    const NetLoad& load = r.compartments[k];
    if (load.peakPressure_Pa > 0 &&
        std::none_of(fields[k].begin(), fields[k].end(), [&](const ElementField& f) { return f.p_FA == load.peakPoint_F; })) {
      return true;
    }
  }
  return false;
}

/** Every number of a result and its fields, in a fixed order. */
void append(std::vector<double>& out, const NetLoad& l) {
  for (const Vec3* v : {&l.forceOnM_F, &l.momentOnM_Fo_F, &l.peakPoint_F, &l.centerOfPressure_F}) out.insert(out.end(), v->data(), v->data() + 3);
  out.insert(out.end(), {l.scalarForce_N, l.peakPressure_Pa, l.meanPressure_Pa, l.area_m2, l.energy_J, l.maxStrain});
  for (const int count : {l.activeElements, l.extrapolatedElements, l.fullPenetrationElements, l.notConvergedQueries, l.noThicknessElements,
                          l.boundaryElements}) {
    out.push_back(count);
  }
}
std::vector<double> listNumbers(const ContactPair& pair, const ContactWorkspace& workspace, const ContactResult& r) {
  std::vector<double> out{static_cast<double>(r.status), static_cast<double>(r.distanceQueries), r.copied ? 1.0 : 0.0};
  append(out, r.total);
  for (const NetLoad& load : r.compartments) append(out, load);
  out.insert(out.end(), r.stiffness.data(), r.stiffness.data() + 36);
  out.insert(out.end(), r.damping.data(), r.damping.data() + 36);
  for (const auto& fields : pair.calcFields(workspace)) {
    for (const ElementField& f : fields) {
      for (const Vec3* v : {&f.p_FA, &f.normal_F, &f.forceDirection_F}) out.insert(out.end(), v->data(), v->data() + 3);
      out.insert(out.end(), {f.area_m2, f.contactShare, f.force_N, f.distance_m, f.d_m, f.h_m, f.p_Pa});
      for (const int value : {f.ix, f.iz, f.level, f.active ? 1 : 0, f.footOnBorder ? 1 : 0}) out.push_back(value);
    }
  }
  return out;
}

/** Numbers along the walk with one warm workspace. */
std::vector<std::vector<double>> run(const ContactPair& pair, const std::vector<Step>& walk, ContactPair::Options options,
                                     const TaskRunner* runner) {
  ContactWorkspace workspace(pair);
  workspace.setTaskRunner(runner);
  ContactResult r;
  std::vector<std::vector<double>> out;
  for (const Step& step : walk) {
    pair.evaluate(step.q, step.qdot, workspace, options, r);
    out.push_back(listNumbers(pair, workspace, r));
  }
  return out;
}

void expectSameBits(const std::vector<std::vector<double>>& actual, const std::vector<std::vector<double>>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (size_t i = 0; i < actual.size(); ++i) {
    ASSERT_EQ(actual[i].size(), expected[i].size());
    EXPECT_EQ(std::memcmp(actual[i].data(), expected[i].data(), actual[i].size() * sizeof(double)), 0) << "step " << i;
  }
}

/** Counts what it passes on. */
class CountingRunner final : public TaskRunner {
 public:
  explicit CountingRunner(const TaskRunner& inner) : inner_(inner) {}
  void run(int count, void (*task)(void*, int), void* context) const override {
    ++runs;
    largest = std::max(largest, count);
    inner_.run(count, task, context);
  }
  int numThreads() const override { return inner_.numThreads(); }
  mutable int runs = 0, largest = 0;

 private:
  const TaskRunner& inner_;
};

/** Last task first, on the calling thread: results must not depend on the order either. */
class BackwardRunner final : public TaskRunner {
 public:
  void run(int count, void (*task)(void*, int), void* context) const override {
    for (int i = count - 1; i >= 0; --i) task(context, i);
  }
  int numThreads() const override { return 2; }
};

/** Threads of the standard library, new ones for every run: unlike oneTBB's, ThreadSanitizer sees how they begin and end. */
class PlainThreads final : public TaskRunner {
 public:
  void run(int count, void (*task)(void*, int), void* context) const override {
    std::atomic<int> next{0};
    const auto work = [&] {
      for (int i = next++; i < count; i = next++) task(context, i);
    };
    std::thread one(work), two(work);
    work();
    one.join();
    two.join();
  }
  int numThreads() const override { return 3; }
};

struct Case {
  const char* name;
  Material material;
  StrainMeasure strain;
  Correction correction;
  double damping_sPerM;
  std::optional<Material> movingMaterial;
};
class ThreadsOnLaw : public testing::TestWithParam<Case> {
 protected:
  static ContactPair makePair() {
    const Case& c = GetParam();
    auto d = makeTwoCompartments(c.material, c.strain);
    d.correction = c.correction;
    d.damping_sPerM = c.damping_sPerM;
    if (c.movingMaterial) {
      d.movingMaterial = c.movingMaterial;
      d.movingThickness = constantThickness(0.003);
    }
    return ContactPair(d);
  }
};

TEST_P(ThreadsOnLaw, PlainThreadsGiveTheSame) {
  const ContactPair pair = makePair();
  const std::vector<Step> walk = makeWalk(findTouch(pair), 4, 12);
  ContactPair::Options options;
  options.withEnergy = options.withStiffness = true;
  const PlainThreads threads;
  const CountingRunner counting(threads);
  expectSameBits(run(pair, walk, options, &counting), run(pair, walk, options, nullptr));
  EXPECT_GT(counting.runs, 0);
}

TEST_P(ThreadsOnLaw, ResultsAreBitwiseEqual) {
  const ContactPair pair = makePair();
  const std::vector<Step> walk = makeWalk(findTouch(pair), 15, 11);
  ContactPair::Options options;
  options.withEnergy = options.withStiffness = true;
  const auto serial = run(pair, walk, options, nullptr);
  // Most of the walk presses: active elements of the total.
  EXPECT_GT(std::count_if(serial.begin(), serial.end(), [](const auto& numbers) { return numbers[3 + 12 + 6] > 100; }), 5);
  for (const int count : {1, 2, 3, 8}) {
    const Threads threads(count);
    EXPECT_EQ(threads.numThreads(), count);
    const CountingRunner counting(threads);
    SCOPED_TRACE(testing::Message() << count << " threads");
    expectSameBits(run(pair, walk, options, &counting), serial);
    // With more than one thread they are used: a cold evaluation of two grids of 100 x 100 at least.
    EXPECT_EQ(counting.runs > 0, count > 1);
    if (count > 1) {
      EXPECT_GT(counting.largest, 8);
    }
  }
  const BackwardRunner backward;
  expectSameBits(run(pair, walk, options, &backward), serial);
}

INSTANTIATE_TEST_SUITE_P(
    Laws, ThreadsOnLaw,
    testing::Values(Case{"linear", uhmwpe(), StrainMeasure::small, Correction::midsurface, 0, {}},
                    Case{"linear_large", uhmwpe(), StrainMeasure::large, Correction::midsurface, 0, {}},
                    Case{"power", uhmwpePowerLaw(), StrainMeasure::small, Correction::midsurface, 0, {}},
                    Case{"power_large", uhmwpePowerLaw(), StrainMeasure::large, Correction::midsurface, 0, {}},
                    Case{"power_consistent", uhmwpePowerLaw(MaterialLaw::powerLawConsistent), StrainMeasure::small, Correction::none, 0, {}},
                    Case{"in_series", uhmwpe(), StrainMeasure::small, Correction::midsurface, 0, uhmwpePowerLaw()},
                    Case{"damped", uhmwpe(), StrainMeasure::small, Correction::midsurface, 2, {}},
                    Case{"energy_form", uhmwpe(), StrainMeasure::small, Correction::energy, 0, {}}),
    [](const auto& item) { return std::string(item.param.name); });

TEST(Threads, ThePeakBetweenGridPointsIsBitwiseEqualOnEveryInstructionSet) {
  for (const DistanceMethod distance : {DistanceMethod::minimum, DistanceMethod::ray}) {
    auto d = makeTwoCompartments(uhmwpe(), StrainMeasure::small);
    d.distance = distance;
    const ContactPair pair(d);
    const std::vector<Step> walk = makeWalk(findTouch(pair), 8, 13);
    for (const char* name : {"baseline", "avx2", "avx512"}) {
      if (!detail::forceInstructionSet(name)) continue;
      SCOPED_TRACE(name);
      const auto serial = run(pair, walk, {}, nullptr);
      for (const int count : {2, 5}) {
        const Threads threads(count);
        const CountingRunner counting(threads);
        expectSameBits(run(pair, walk, {}, &counting), serial);
        EXPECT_GT(counting.runs, 0);
      }
      int between = 0;
      ContactWorkspace workspace(pair);
      ContactResult r;
      for (const Step& step : walk) {
        pair.evaluate(step.q, step.qdot, workspace, {}, r);
        between += isPeakBetween(pair, workspace, r);
      }
      EXPECT_GT(between, 4);
    }
    EXPECT_TRUE(detail::forceInstructionSet(nullptr));
  }
}

TEST(Threads, SmallEvaluationsStaySerial) {
  const ContactPair small(makeTwoCompartments(uhmwpe(), StrainMeasure::small, 12));
  const Threads threads(4);
  const CountingRunner counting(threads);
  const std::vector<Step> walk = makeWalk(findTouch(small), 10, 5);
  run(small, walk, {}, &counting);
  EXPECT_EQ(counting.runs, 0);
  // So does a large grid of which little is near the contact, once that is known.
  const ContactPair large(makeTwoCompartments(uhmwpe(), StrainMeasure::small));
  ContactWorkspace workspace(large);
  workspace.setTaskRunner(&counting);
  ContactResult r;
  JointCoordinates q{0, 0, 0, 0, findTouch(large) + 1e-5, 0};
  for (int i = 0; i < 4; ++i) {
    q[4] -= 1e-6;
    large.evaluate(q, workspace, {}, r);
    if (i != 1) {  // the second expects as much to do as the first
      EXPECT_EQ(counting.runs > 0, i == 0);
    }
    counting.runs = 0;
  }
  // And without a runner again nobody calls it.
  workspace.reset();
  workspace.setTaskRunner(nullptr);
  large.evaluate(q, workspace, {}, r);
  EXPECT_EQ(counting.runs, 0);
}

void expectManyUsersGetTheSame(const TaskRunner& threads) {
  // Each user has its own workspace, pose sequence and rates; all use the same pair, and half of them the same pool.
  auto d = makeTwoCompartments(uhmwpePowerLaw(), StrainMeasure::small, 60);
  d.damping_sPerM = 1;
  const ContactPair pair(d);
  const double touch = findTouch(pair);
  constexpr size_t kUsers = 6;
  ContactPair::Options options;
  options.withEnergy = options.withStiffness = true;
  std::vector<std::vector<Step>> walks;
  std::vector<std::vector<std::vector<double>>> serial, parallel(kUsers);
  for (size_t k = 0; k < kUsers; ++k) {
    walks.push_back(makeWalk(touch, 8, static_cast<unsigned>(k)));
    serial.push_back(run(pair, walks[k], options, nullptr));
  }
  std::atomic<size_t> ready{0};
  std::vector<std::thread> users;
  for (size_t k = 0; k < kUsers; ++k) {
    users.emplace_back([&, k] {
      ++ready;
      while (ready < kUsers) std::this_thread::yield();  // all at the same time
      parallel[k] = run(pair, walks[k], options, k % 2 == 0 ? &threads : nullptr);
    });
  }
  for (std::thread& user : users) user.join();
  for (size_t k = 0; k < kUsers; ++k) {
    SCOPED_TRACE(testing::Message() << "user " << k);
    expectSameBits(parallel[k], serial[k]);
  }
}

TEST(Threads, ManyUsersOfOnePair) { expectManyUsersGetTheSame(Threads(3)); }
TEST(Threads, ManyUsersWithPlainThreads) { expectManyUsersGetTheSame(PlainThreads()); }

TEST(Threads, EveryTaskRunsOnce) {
  const Threads threads(3);
  for (const int count : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> seen(static_cast<size_t>(count));
    threads.run(count, [](void* context, int i) { ++(*static_cast<std::vector<std::atomic<int>>*>(context))[static_cast<size_t>(i)]; }, &seen);
    for (const std::atomic<int>& n : seen) EXPECT_EQ(n, 1);
  }
  EXPECT_GE(Threads().numThreads(), 1);
}

TEST(Threads, FromC) {
  genu_surface *layer = nullptr, *ball = nullptr;
  ASSERT_EQ(genu_surface_create_plane(0.006, 0, 0, GENU_SOLID_BELOW, 0.1, &layer), GENU_OK);
  ASSERT_EQ(genu_surface_create_sphere(0.03, &ball), GENU_OK);
  const genu_compartment compartments[2] = {{"left", -0.005, 0, -0.005, 0.005, 50, 100, layer, ball},
                                            {"right", 0, 0.005, -0.005, 0.005, 50, 100, layer, ball}};
  genu_pair_options options;
  genu_pair_options_init(&options, sizeof options);
  options.compartments = compartments;
  options.num_compartments = 2;
  options.fixed_thickness.kind = GENU_THICKNESS_CONSTANT;
  options.fixed_thickness.value = 0.006;
  options.material.youngs_modulus = 463e6;
  options.material.poisson_ratio = 0.46;
  genu_pair* pair = nullptr;
  ASSERT_EQ(genu_pair_create(&options, &pair), GENU_OK) << genu_last_error();
  genu_threads* threads = genu_threads_create(2);
  ASSERT_NE(threads, nullptr);
  genu_task_runner runner = genu_threads_runner(threads);
  EXPECT_EQ(runner.num_threads, 2);

  genu_result results[2];
  genu_load loads[2][2];
  std::memset(results, 0, sizeof results);  // the bytes between fields too
  std::memset(loads, 0, sizeof loads);
  for (int k = 0; k < 2; ++k) {
    genu_result_init(&results[k], sizeof results[k]);
    genu_workspace* workspace = nullptr;
    ASSERT_EQ(genu_workspace_create(pair, &workspace), GENU_OK);
    if (k == 1) {
      ASSERT_EQ(genu_workspace_set_task_runner(workspace, &runner), GENU_OK);
    }
    genu_evaluate_options wanted;
    genu_evaluate_options_init(&wanted, sizeof wanted);
    wanted.with_energy = wanted.with_stiffness = 1;
    for (const double y : {0.0359, 0.0357, 0.0358}) {
      const double q[6] = {0, 0, 0, 0.0005, y, 0.0002};
      ASSERT_EQ(genu_evaluate(pair, workspace, q, nullptr, &wanted, &results[k], loads[k], 2), GENU_OK);
    }
    // NULL takes the threads away again; the pool may go then.
    EXPECT_EQ(genu_workspace_set_task_runner(workspace, nullptr), GENU_OK);
    genu_workspace_destroy(workspace);
  }
  EXPECT_GT(results[0].total.force_on_moving[1], 1000);
  EXPECT_EQ(std::memcmp(&results[0], &results[1], sizeof results[0]), 0);
  EXPECT_EQ(std::memcmp(loads[0], loads[1], sizeof loads[0]), 0);

  genu_workspace* workspace = nullptr;
  ASSERT_EQ(genu_workspace_create(pair, &workspace), GENU_OK);
  EXPECT_EQ(genu_workspace_set_task_runner(nullptr, &runner), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("workspace is NULL"));
  genu_task_runner bad = runner;
  bad.run = nullptr;
  EXPECT_EQ(genu_workspace_set_task_runner(workspace, &bad), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("run is NULL"));
  bad = runner;
  bad.num_threads = 0;
  EXPECT_EQ(genu_workspace_set_task_runner(workspace, &bad), GENU_BAD_ARGUMENT);
  EXPECT_THAT(genu_last_error(), HasSubstr("num_threads"));
  genu_workspace_destroy(workspace);
  genu_threads_destroy(threads);
  genu_pair_destroy(pair);
  genu_surface_destroy(layer);
  genu_surface_destroy(ball);
}

TEST(Threads, BadNumbersAreRefused) {
  EXPECT_EQ(genu_threads_create(-1), nullptr);
  EXPECT_EQ(genu_threads_create(1025), nullptr);
  genu_threads_destroy(nullptr);
  const genu_task_runner none = genu_threads_runner(nullptr);
  EXPECT_EQ(none.run, nullptr);
  for (const int count : {-1, 1025}) {
    try {
      Threads threads(count);
      ADD_FAILURE() << count;
    } catch (const std::invalid_argument& e) {
      EXPECT_THAT(e.what(), HasSubstr("threads = " + std::to_string(count)));
      EXPECT_THAT(e.what(), HasSubstr("1 to 1024"));
    }
  }
}

}  // namespace
}  // namespace genu::contact
