#pragma once
// Results must be the same bytes on every instruction set and with any thread count.

#include "engine/core/parallel.h"
#include "engine/core/simd_dispatch.h"

namespace pointwright::test {

/// Runs `compute` with 1, 2 and 8 threads on every instruction set of this machine; calls `same(first,
/// other)` for each.
template <typename Compute, typename Same>
void for_all_machines(const Compute& compute, const Same& same) {
  const SimdLevel before = simd_level();
  set_simd_level(SimdLevel::kBase);
  decltype(compute()) first;
  with_threads(1, [&] { first = compute(); });
  for (const SimdLevel level : {SimdLevel::kBase, SimdLevel::kV3, SimdLevel::kV4}) {
    set_simd_level(level);
    for (const int threads : {1, 2, 8}) {
      decltype(compute()) other;
      with_threads(threads, [&] { other = compute(); });
      same(first, other);
    }
  }
  set_simd_level(before);
}

}  // namespace pointwright::test
