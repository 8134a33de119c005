#include "engine/core/parallel.h"

#include <algorithm>
#include <array>

#include "engine/core/worker_threads.h"

namespace pointwright {

void parallel_for(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body,
                  std::size_t block, const ExecutionContext* context) {
  if (count == 0) return;
  const std::size_t blocks = (count + block - 1) / block;
  const auto run = [&](std::size_t b) {
    if (context != nullptr && context->is_cancelled()) return;
    body(b * block, std::min(count, (b + 1) * block));
  };
  if (blocks == 1) {
    run(0);
    return;
  }
  share_work(blocks, run);
}

void sort_by_key(std::vector<std::uint64_t>& keys, std::vector<std::uint32_t>& values) {
  constexpr std::size_t kDigitBits = 11;
  constexpr std::size_t kBuckets = std::size_t{1} << kDigitBits;
  const std::size_t n = keys.size();
  if (n < 2) return;
  std::vector<std::uint64_t> key_buffer(n);
  std::vector<std::uint32_t> value_buffer(n);
  // Each part counts its own digits; part order then bucket order makes every pass stable, whoever runs it.
  constexpr std::size_t kPart = std::size_t{1} << 16;
  const std::size_t parts = (n + kPart - 1) / kPart;
  std::vector<std::array<std::uint32_t, kBuckets>> offsets(parts);
  std::uint64_t varying = 0;
  for (const std::uint64_t key : keys) varying |= key ^ keys[0];
  for (std::size_t shift = 0; shift < 64; shift += kDigitBits) {
    if (((varying >> shift) & (kBuckets - 1)) == 0) continue;  // the digit is the same everywhere
    const auto digit = [shift](std::uint64_t key) {
      return static_cast<std::size_t>((key >> shift) & (kBuckets - 1));
    };
    parallel_for(
        n,
        [&](std::size_t begin, std::size_t end) {
          auto& histogram = offsets[begin / kPart];
          histogram.fill(0);
          for (std::size_t i = begin; i < end; ++i) ++histogram[digit(keys[i])];
        },
        kPart);
    std::uint32_t running = 0;
    for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
      for (auto& histogram : offsets) {
        const std::uint32_t here = histogram[bucket];
        histogram[bucket] = running;
        running += here;
      }
    }
    parallel_for(
        n,
        [&](std::size_t begin, std::size_t end) {
          auto& cursor = offsets[begin / kPart];
          for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t slot = cursor[digit(keys[i])]++;
            key_buffer[slot] = keys[i];
            value_buffer[slot] = values[i];
          }
        },
        kPart);
    keys.swap(key_buffer);
    values.swap(value_buffer);
  }
}

}  // namespace pointwright
