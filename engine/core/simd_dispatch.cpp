#include "engine/core/simd_dispatch.h"

#include <algorithm>
#include <atomic>

namespace pointwright {
namespace {

SimdLevel detect() {
#if defined(__x86_64__)
  // Exactly the features that kernels.cmake compiles the variants with.
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2")) return SimdLevel::kBase;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512cd")) {
    return SimdLevel::kV4;
  }
  return SimdLevel::kV3;
#else
  return SimdLevel::kBase;
#endif
}

std::atomic<SimdLevel>& level_in_use() {
  static std::atomic<SimdLevel> level{best_simd_level()};
  return level;
}

}  // namespace

SimdLevel best_simd_level() {
  static const SimdLevel best = detect();
  return best;
}

SimdLevel simd_level() {
  return level_in_use().load(std::memory_order_relaxed);
}

void set_simd_level(SimdLevel level) {
  level_in_use().store(std::min(level, best_simd_level()), std::memory_order_relaxed);
}

}  // namespace pointwright
