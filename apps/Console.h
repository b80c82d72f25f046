#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "genu/scene/Progress.h"

namespace genu::app {

/** Exit codes of the program; docs/program.md. */
enum ExitCode : int {
  kOk = 0,
  kInternalError = 1,
  kBadInput = 2,
  kComputationFailed = 3,
  kInterrupted = 130,  ///< 128 + SIGINT, as a shell reports it
};

struct ConsoleOptions {
  bool quiet = false, verbose = false, progress = false;
};

/** Messages go to stderr as "level: text", so stdout holds results only. */
void setUpLog(const ConsoleOptions& options);

/** Ctrl-C (SIGINT) and SIGTERM. The first one asks the computation to stop and hand back what it has; the second ends
 the program at once. In a command that has nothing to hand back (stopAtOnce) the first one ends it. */
void installInterruptHandler(bool stopAtOnce);
bool wasInterrupted();

/** While one exists a signal is only remembered: files are being written that must not be left half done. */
class HoldExit {
 public:
  HoldExit();
  ~HoldExit();
  HoldExit(const HoldExit&) = delete;
  HoldExit& operator=(const HoldExit&) = delete;
};

/** A line on stderr with what is being done, the share done and the time left, from the second second on. Shown on a
 terminal, or as plain lines with --progress. */
class ProgressMeter {
 public:
  ProgressMeter(std::string what, const ConsoleOptions& options);
  ~ProgressMeter();
  ProgressMeter(const ProgressMeter&) = delete;
  ProgressMeter& operator=(const ProgressMeter&) = delete;

  /** Also asks to stop after an interruption. */
  scene::Progress callback();
  /** Ends the line. */
  void finish();

 private:
  void run();

  std::string what_;
  bool shown_, terminal_;
  std::atomic<double> fraction_{-1};
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable wake_;
  bool done_ = false, written_ = false;
  std::thread thread_;
};

}  // namespace genu::app
