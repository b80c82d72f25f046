#include "genu/report/Gnuplot.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "genu/io/Files.h"

namespace genu::report {
namespace fs = std::filesystem;

namespace {

/** Starts `gnuplot script` in `folder` with its messages in `log`. Returns 0 or an errno value. */
int start(const fs::path& folder, const std::string& script, const std::string& log, pid_t& child) {
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  std::string program = "gnuplot", argument = script;
  std::array<char*, 3> argv = {program.data(), argument.data(), nullptr};
  const int error = posix_spawnp(&child, "gnuplot", &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  return error;
}

std::string firstLines(const fs::path& file) {
  std::string text = io::readFile(file);
  if (text.size() > 300) text.resize(300);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

}  // namespace

DrawResult runGnuplot(const fs::path& folder, const std::vector<std::string>& scripts) {
  struct Job {
    std::string script;
    pid_t child;
  };
  DrawResult result;
  std::vector<Job> jobs;
  for (const auto& script : scripts) {
    pid_t child = -1;
    const int error = start(folder, script, script + ".log", child);
    if (error != 0) {
      result.problem = error == ENOENT
                           ? "gnuplot is not installed (Debian: gnuplot-nox); the scripts and data for it are "
                             "in plots/"
                           : std::string("gnuplot could not be started: ") + std::strerror(error);
      break;
    }
    jobs.push_back({script, child});
  }
  for (const auto& job : jobs) {
    int status = 0;
    while (waitpid(job.child, &status, 0) < 0 && errno == EINTR) {
    }
    const fs::path log = folder / (job.script + ".log");
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
      result.drawn.push_back(job.script);
    } else {
      result.problem = "gnuplot failed on plots/" + job.script + ": " + firstLines(log);
    }
    std::error_code ignored;
    fs::remove(log, ignored);
  }
  std::error_code ignored;
  for (const auto& script : scripts) fs::remove(folder / (script + ".log"), ignored);
  return result;
}

}  // namespace genu::report
