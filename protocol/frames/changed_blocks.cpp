#include <algorithm>
#include <cstring>

#include "engine/core/parallel.h"
#include "protocol/frames/frame.h"

namespace pointwright::protocol {
namespace {

/// Whether `count` entries from `begin` are the same bytes; an empty column equals another empty one only.
template <typename T>
bool same(std::span<const T> a, std::span<const T> b, std::size_t begin, std::size_t count) {
  if (a.data() == b.data() && a.size() == b.size()) return true;
  if (a.empty() || b.empty()) return false;
  return std::memcmp(a.data() + begin, b.data() + begin, count * sizeof(T)) == 0;
}

bool same(const Points* a, const Points* b, std::size_t begin, std::size_t count) {
  if (a == b) return true;
  if (a == nullptr || b == nullptr) return false;
  const std::size_t bytes = count * sizeof(float);
  return std::memcmp(a->x() + begin, b->x() + begin, bytes) == 0 &&
         std::memcmp(a->y() + begin, b->y() + begin, bytes) == 0 &&
         std::memcmp(a->z() + begin, b->z() + begin, bytes) == 0;
}

bool same_samples(const FrameColumns& a, const FrameColumns& b, std::uint16_t attributes, std::size_t begin,
                  std::size_t count) {
  return same(a.position, b.position, begin, count) &&
         ((attributes & kFrameNormal) == 0 || same(a.normal, b.normal, begin, count)) &&
         ((attributes & kFrameT) == 0 || same(a.t, b.t, begin, count)) &&
         ((attributes & kFrameDetail) == 0 ||
          (same(a.detail, b.detail, begin, count) && same(a.stretch, b.stretch, begin, count))) &&
         ((attributes & kFrameColor) == 0 || same(a.color, b.color, begin, count)) &&
         ((attributes & kFrameMarks) == 0 || same(a.marks, b.marks, begin, count)) &&
         ((attributes & kFrameIds) == 0 || same(a.ids, b.ids, begin, count));
}

/// Whether any sample of the block differs, looking only into windows of kParallelBlock samples that do.
bool block_differs(const FrameColumns& before, const FrameColumns& after, std::uint16_t attributes,
                   const SampleRange& samples, const std::vector<std::uint8_t>& window_differs) {
  const std::size_t end = samples.begin + std::size_t{samples.count} * samples.stride;
  for (std::size_t sample = samples.begin; sample < end;) {
    const std::size_t window = sample / kParallelBlock;
    const std::size_t window_end = std::min(end, (window + 1) * kParallelBlock);
    if (window_differs[window] == 0) {
      sample += (window_end - sample + samples.stride - 1) / samples.stride * samples.stride;
      continue;
    }
    for (; sample < window_end; sample += samples.stride) {
      if (!same_samples(before, after, attributes, sample, 1)) return true;
    }
  }
  return false;
}

}  // namespace

std::vector<std::uint32_t> changed_blocks(const FrameLayout& layout, const FrameColumns& before,
                                          const FrameColumns& after, std::uint16_t attributes) {
  const std::size_t n = layout.sample_count();
  // Whole windows first: where nothing changed, that is one pass of memcmp; where everything did, every
  // window and every block stops at its first sample.
  std::vector<std::uint8_t> window_differs((n + kParallelBlock - 1) / kParallelBlock);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    window_differs[begin / kParallelBlock] =
        same_samples(before, after, attributes, begin, end - begin) ? 0 : 1;
  });
  std::vector<std::uint8_t> changed(layout.block_count());
  parallel_for(
      changed.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t block = begin; block < end; ++block) {
          const SampleRange samples = layout.block_samples(static_cast<std::uint32_t>(block));
          changed[block] = block_differs(before, after, attributes, samples, window_differs) ? 1 : 0;
        }
      },
      4);
  std::vector<std::uint32_t> blocks;
  for (std::uint32_t block = 0; block < layout.block_count(); ++block) {
    if (changed[block] != 0) blocks.push_back(block);
  }
  return blocks;
}

}  // namespace pointwright::protocol
