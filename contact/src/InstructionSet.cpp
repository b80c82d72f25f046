#include <atomic>
#include <cstring>

#include "detail/Kernels.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact {

namespace {

const detail::Kernels* const kChoices[] = {
#ifdef GENU_X86_KERNELS
    &detail::avx512::kKernels,
    &detail::avx2::kKernels,
#endif
    &detail::baseline::kKernels,
};

bool isSupported(const detail::Kernels* choice) {
#ifdef GENU_X86_KERNELS
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (choice == &detail::avx2::kKernels) return avx2;
  if (choice == &detail::avx512::kKernels) {
    return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  }
#endif
  return choice == &detail::baseline::kKernels;
}

const detail::Kernels* choose(const char* name) {
  for (const detail::Kernels* choice : kChoices) {
    if (isSupported(choice) && (name == nullptr || std::strcmp(name, choice->name) == 0)) return choice;
  }
  return nullptr;
}

std::atomic<const detail::Kernels*>& active() {
  static std::atomic<const detail::Kernels*> choice{choose(nullptr)};
  return choice;
}

}  // namespace

const char* activeInstructionSet() { return detail::activeKernels().name; }

namespace detail {

const Kernels& activeKernels() { return *active().load(std::memory_order_relaxed); }

bool forceInstructionSet(const char* name) {
  const Kernels* choice = choose(name);
  if (choice != nullptr) active().store(choice, std::memory_order_relaxed);
  return choice != nullptr;
}

}  // namespace detail
}  // namespace genu::contact
