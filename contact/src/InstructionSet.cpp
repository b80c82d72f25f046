#include <atomic>
#include <cstring>

#include "detail/CellKernel.h"
#include "detail/FootKernel.h"
#include "genu/contact/ContactSurface.h"

namespace genu::contact {

namespace {

struct Choice {
  const char* name;
  detail::SolveFoot solve;
  const detail::CellKernels* cells;
};

constexpr Choice kChoices[] = {
#ifdef GENU_X86_KERNELS
    {"avx512", detail::avx512::solveFoot, &detail::avx512::kCellKernels},
    {"avx2", detail::avx2::solveFoot, &detail::avx2::kCellKernels},
#endif
    {"baseline", detail::baseline::solveFoot, &detail::baseline::kCellKernels},
};

bool isSupported(const Choice& choice) {
#ifdef GENU_X86_KERNELS
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (choice.solve == detail::avx2::solveFoot) return avx2;
  if (choice.solve == detail::avx512::solveFoot) {
    return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  }
#endif
  return choice.solve == detail::baseline::solveFoot;
}

const Choice* choose(const char* name) {
  for (const Choice& choice : kChoices) {
    if ((name == nullptr || std::strcmp(name, choice.name) == 0) && isSupported(choice)) return &choice;
  }
  return nullptr;
}

std::atomic<const Choice*>& active() {
  static std::atomic<const Choice*> choice{choose(nullptr)};
  return choice;
}

}  // namespace

const char* activeInstructionSet() { return active().load(std::memory_order_relaxed)->name; }

namespace detail {

SolveFoot activeSolveFoot() { return active().load(std::memory_order_relaxed)->solve; }

const CellKernels& activeCellKernels() { return *active().load(std::memory_order_relaxed)->cells; }

bool forceInstructionSet(const char* name) {
  const Choice* choice = choose(name);
  if (choice != nullptr) active().store(choice, std::memory_order_relaxed);
  return choice != nullptr;
}

}  // namespace detail
}  // namespace genu::contact
