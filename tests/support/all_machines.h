#pragma once
// Results must be the same bytes on every instruction set and with any thread count.

#include <optional>

#include "engine/core/parallel.h"
#include "engine/core/simd_dispatch.h"

namespace pointwright::test {

/// Runs `work` on every instruction set of this machine.
template <typename Work>
void on_every_instruction_set(const Work& work) {
  const SimdLevel before = simd_level();
  for (const SimdLevel level : {SimdLevel::kBase, SimdLevel::kV3, SimdLevel::kV4}) {
    set_simd_level(level);
    work();
  }
  set_simd_level(before);
}

/// Runs `compute` with 1, 2 and 8 threads on every instruction set of this machine; calls `same(first,
/// other)` for each.
template <typename Compute, typename Same>
void for_all_machines(const Compute& compute, const Same& same) {
  std::optional<decltype(compute())> first;
  on_every_instruction_set([&] {
    for (const int threads : {1, 2, 8}) {
      with_threads(threads, [&] {
        auto other = compute();
        if (!first) first = other;
        same(*first, other);
      });
    }
  });
}

}  // namespace pointwright::test
