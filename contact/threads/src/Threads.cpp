#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "genu/contact/genu_contact_threads.h"

struct genu_threads {
  explicit genu_threads(int count) : arena(count) { arena.initialize(); }
  tbb::task_arena arena;
};

namespace {

void run(void* user, int count, void (*task)(void*, int), void* context) {
  static_cast<genu_threads*>(user)->arena.execute(
      [&] { tbb::parallel_for(0, count, [&](int i) { task(context, i); }, tbb::simple_partitioner()); });
}

}  // namespace

genu_threads* genu_threads_create(int num_threads) {
  if (num_threads < 0 || num_threads > 1024) return nullptr;
  try {
    return new genu_threads(num_threads == 0 ? tbb::task_arena::automatic : num_threads);
  } catch (...) {
    return nullptr;
  }
}

void genu_threads_destroy(genu_threads* threads) { delete threads; }

genu_task_runner genu_threads_runner(genu_threads* threads) {
  genu_task_runner runner{};
  if (threads != nullptr) {
    runner.run = run;
    runner.user = threads;
    runner.num_threads = threads->arena.max_concurrency();
  }
  return runner;
}
