#pragma once

#include <stdexcept>
#include <string>

#include "genu/contact/TaskRunner.h"
#include "genu/contact/genu_contact_threads.h"

namespace genu::contact {

/** A pool of threads for ContactWorkspace::setTaskRunner. */
class Threads final : public TaskRunner {
 public:
  /** @param numThreads 1 to 1024, the caller's own included; 0: as many as the machine has.
   @throws std::invalid_argument when that is not allowed or no thread can be had */
  explicit Threads(int numThreads = 0) : threads_(genu_threads_create(numThreads)) {
    if (threads_ == nullptr) {
      throw std::invalid_argument("threads = " + std::to_string(numThreads) + " cannot be had; allowed: 1 to 1024, or 0 for all");
    }
    runner_ = genu_threads_runner(threads_);
  }
  ~Threads() override { genu_threads_destroy(threads_); }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

  void run(int count, void (*task)(void* context, int index), void* context) const override {
    runner_.run(runner_.user, count, task, context);
  }
  int numThreads() const override { return runner_.num_threads; }

 private:
  genu_threads* threads_;
  genu_task_runner runner_;
};

}  // namespace genu::contact
