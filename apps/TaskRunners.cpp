#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "Commands.h"
#ifdef GENU_WITH_CONTACT_THREADS
#include "genu/contact/Threads.h"
#endif

namespace genu::app {

std::unique_ptr<const contact::TaskRunner> makeTaskRunner(int threads) {
  if (threads < 0 || threads > 1024) {
    throw InputError(fmt::format("--threads {}: allowed: 1 to 1024, or 0 for all of the machine", threads));
  }
  if (threads == 1) return nullptr;
#ifdef GENU_WITH_CONTACT_THREADS
  return std::make_unique<const contact::Threads>(threads);
#else
  throw InputError(fmt::format("--threads {}: this build evaluates contact on one thread; allowed: 1 (CMake option "
                               "GENU_WITH_CONTACT_THREADS gives more)", threads));
#endif
}

bool hasThreads() {
#ifdef GENU_WITH_CONTACT_THREADS
  return true;
#else
  return false;
#endif
}

void warnAbout(const scene::Scene& scene) {
  for (const std::string& warning : scene::listWarnings(scene)) spdlog::warn("{}", warning);
}

}  // namespace genu::app
