#include "Console.h"

#include <fmt/format.h>
#include <signal.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <utility>

namespace genu::app {

namespace {

volatile sig_atomic_t gInterrupts = 0;
volatile sig_atomic_t gStopAtOnce = 0;
volatile sig_atomic_t gHold = 0;

void say(const char* text, size_t size) {
  // Only async-signal-safe calls here; a message that cannot be written is lost.
  if (write(STDERR_FILENO, text, size) < 0) return;
}

extern "C" void handleSignal(int) {
  static const char kStopping[] = "\ninterrupted: stopping; once more to end at once\n";
  static const char kEnded[] = "\ninterrupted\n";
  gInterrupts = gInterrupts + 1;
  if (gHold != 0) return;
  if (gStopAtOnce != 0 || gInterrupts > 1) {
    say(kEnded, sizeof(kEnded) - 1);
    _exit(kInterrupted);
  }
  say(kStopping, sizeof(kStopping) - 1);
}

std::string formatDuration(double seconds) {
  const long s = std::lround(seconds);
  if (s < 90) return fmt::format("{} s", s);
  if (s < 5400) return fmt::format("{} min {:02} s", s / 60, s % 60);
  return fmt::format("{} h {:02} min", s / 3600, s % 3600 / 60);
}

}  // namespace

void setUpLog(const ConsoleOptions& options) {
  auto logger = spdlog::stderr_color_mt("genu");
  logger->set_pattern("%^%l%$: %v");
  logger->set_level(options.quiet ? spdlog::level::err : options.verbose ? spdlog::level::debug : spdlog::level::info);
  spdlog::set_default_logger(logger);
}

void installInterruptHandler(bool stopAtOnce) {
  gStopAtOnce = stopAtOnce ? 1 : 0;
  struct sigaction action {};
  action.sa_handler = handleSignal;
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

bool wasInterrupted() { return gInterrupts > 0; }

HoldExit::HoldExit() { gHold = 1; }
HoldExit::~HoldExit() { gHold = 0; }

ProgressMeter::ProgressMeter(std::string what, const ConsoleOptions& options)
    : what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0) {
  shown_ = !options.quiet && (terminal_ || options.progress);
  if (!shown_) return;
  thread_ = std::thread([this] { run(); });
}

ProgressMeter::~ProgressMeter() { finish(); }

scene::Progress ProgressMeter::callback() {
  return [this](double fraction) {
    fraction_.store(fraction, std::memory_order_relaxed);
    return !wasInterrupted();
  };
}

void ProgressMeter::finish() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ = true;
  }
  wake_.notify_one();
  thread_.join();
  if (written_ && terminal_) fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
}

void ProgressMeter::run() {
  using namespace std::chrono_literals;
  std::unique_lock<std::mutex> lock(mutex_);
  auto wait = 2000ms;
  while (!wake_.wait_for(lock, wait, [this] { return done_; })) {
    wait = terminal_ ? 250ms : 2000ms;
    const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    const double fraction = fraction_.load(std::memory_order_relaxed);
    std::string line = what_;
    if (fraction > 0 && fraction <= 1) {
      line += fmt::format(": {:.0f} %, {} left", 100 * fraction, formatDuration(elapsed * (1 - fraction) / fraction));
    } else {
      line += fmt::format(": {}", formatDuration(elapsed));
    }
    fmt::print(stderr, terminal_ ? "\r\033[K{}" : "{}\n", line);
    std::fflush(stderr);
    written_ = true;
  }
}

}  // namespace genu::app
