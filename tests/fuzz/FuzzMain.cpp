#include <cstddef>
#include <cstdint>

#include "Targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // GENU_FUZZ_TARGET is one of the functions of Targets.h, set by the build.
  genu::fuzz::GENU_FUZZ_TARGET(std::string(data, data + size));
  return 0;
}
