#pragma once
// The only place of the engine that starts threads. Loops are cut into fixed blocks, so what a block computes
// never depends on how many threads there are; reductions go over those blocks in order.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/core/execution_context.h"

namespace pointwright {

/// Samples per block of a parallel loop; a multiple of kSimdBlock.
inline constexpr std::size_t kParallelBlock = 2048;

/// Calls body(begin, end) for consecutive blocks of [0, count), concurrently; sequential for a single block.
/// Blocks start at multiples of `block`. Exceptions of the body reach the caller.
/// Cancels: before each block where a context is given (the caller checks is_cancelled() afterwards).
void parallel_for(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body,
                  std::size_t block = kParallelBlock, const ExecutionContext* context = nullptr);

/// Sum of partial(begin, end) over the blocks, added in block order: bitwise equal for any thread count.
template <typename T>
T parallel_sum(std::size_t count, T zero, const std::function<T(std::size_t, std::size_t)>& partial,
               std::size_t block = kParallelBlock) {
  std::vector<T> parts((count + block - 1) / block, zero);
  parallel_for(
      count, [&](std::size_t begin, std::size_t end) { parts[begin / block] = partial(begin, end); }, block);
  T sum = zero;
  for (const T& part : parts) sum = sum + part;
  return sum;
}

/// Stable sort of (key, value) pairs by key. Cost: O(N) passes of a radix sort. Deterministic.
void sort_by_key(std::vector<std::uint64_t>& keys, std::vector<std::uint32_t>& values);

/// Runs `work` with at most `threads` threads for every parallel loop inside; 0 means all of the machine's.
void with_threads(int threads, const std::function<void()>& work);

/// How many threads a parallel loop would use here.
int thread_count();

}  // namespace pointwright
