#pragma once

namespace genu::contact {

/** Runs independent tasks, possibly on several threads. The engine hands the same tasks, with the same contents, to any runner
 and adds their results in a fixed order: results are bitwise equal for any number of threads. One runner may serve several
 workspaces, also at the same time. Genu::contact_threads has one on oneTBB. */
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;
  /** Calls task(context, i) once for every i in [0, count) and returns when all are done. @pre task does not throw */
  virtual void run(int count, void (*task)(void* context, int index), void* context) const = 0;
  /** Threads that may work at a time, >= 1. */
  virtual int numThreads() const = 0;
};

}  // namespace genu::contact
