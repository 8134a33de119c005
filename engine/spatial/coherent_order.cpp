#include "engine/spatial/coherent_order.h"

#include <algorithm>
#include <array>
#include <span>
#include <tuple>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/spatial/morton_code.h"

namespace pointwright {
namespace {

Box3f parallel_bounds(const Points& points) {
  struct Bounds {
    Box3f box;
    Bounds operator+(const Bounds& other) const {
      return {{.min = box.min.cwiseMin(other.box.min), .max = box.max.cwiseMax(other.box.max)}};
    }
  };
  const auto partial = [&](std::size_t begin, std::size_t end) {
    Bounds bounds;
    for (std::size_t i = begin; i < end; ++i) bounds.box.extend(points[i]);
    return bounds;
  };
  return parallel_sum<Bounds>(points.size(), Bounds{}, partial).box;
}

constexpr std::size_t kPart = std::size_t{1} << 16;  // samples that one thread counts and moves at a time

// Sorts by the upper half of each word, stably: three passes, each part of the input counting its own digits.
void sort_by_upper_half(std::vector<std::uint64_t>& words) {
  constexpr std::size_t kDigitBits = 11;
  constexpr std::size_t kBuckets = std::size_t{1} << kDigitBits;
  std::vector<std::uint64_t> buffer(words.size());
  std::vector<std::array<std::uint32_t, kBuckets>> offsets((words.size() + kPart - 1) / kPart);
  for (std::size_t shift = 32; shift < 64; shift += kDigitBits) {
    const auto digit = [shift](std::uint64_t word) {
      return static_cast<std::size_t>((word >> shift) & (kBuckets - 1));
    };
    const auto count = [&](std::size_t begin, std::size_t end) {
      auto& histogram = offsets[begin / kPart];
      histogram.fill(0);
      for (std::size_t i = begin; i < end; ++i) ++histogram[digit(words[i])];
    };
    const auto move = [&](std::size_t begin, std::size_t end) {
      auto& cursor = offsets[begin / kPart];
      for (std::size_t i = begin; i < end; ++i) buffer[cursor[digit(words[i])]++] = words[i];
    };
    parallel_for(words.size(), count, kPart);
    std::uint32_t running = 0;
    for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
      for (auto& histogram : offsets) running += std::exchange(histogram[bucket], running);
    }
    parallel_for(words.size(), move, kPart);
    words.swap(buffer);
  }
}

std::uint32_t upper_half(std::uint64_t word) {
  return static_cast<std::uint32_t>(word >> 32);
}

// Orders the samples of `run`, whose keys agree in their upper halves, by key, position and old index.
void settle(const Points& points, const MortonCode& code, std::span<const std::uint64_t> run,
            std::uint32_t* order) {
  constexpr std::size_t kFew = 64;
  const std::size_t count = run.size();
  const auto by_position = [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple(points.x()[a], points.y()[a], points.z()[a], a) <
           std::tuple(points.x()[b], points.y()[b], points.z()[b], b);
  };
  if (count <= kFew) {
    std::array<std::pair<std::uint64_t, std::uint32_t>, kFew> keyed;
    for (std::size_t i = 0; i < count; ++i) {
      const auto sample = static_cast<std::uint32_t>(run[i]);
      keyed[i] = {code.of(points[sample]), sample};
    }
    std::sort(keyed.begin(), keyed.begin() + static_cast<std::ptrdiff_t>(count),
              [&](const auto& a, const auto& b) {
                return a.first != b.first ? a.first < b.first : by_position(a.second, b.second);
              });
    for (std::size_t i = 0; i < count; ++i) order[i] = keyed[i].second;
    return;
  }
  // A cloud that is crowded into a few places of its box.
  std::vector<std::uint64_t> keys(count);
  std::vector<std::uint32_t> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i] = static_cast<std::uint32_t>(run[i]);
    keys[i] = code.of(points[samples[i]]);
  }
  sort_by_key(keys, samples);
  for (std::size_t from = 0; from < count;) {
    std::size_t to = from + 1;
    while (to < count && keys[to] == keys[from]) ++to;
    if (to - from > 1) {
      std::sort(samples.begin() + static_cast<std::ptrdiff_t>(from),
                samples.begin() + static_cast<std::ptrdiff_t>(to), by_position);
    }
    from = to;
  }
  std::copy(samples.begin(), samples.end(), order);
}

}  // namespace

std::vector<std::uint32_t> coherent_order(const Points& points) {
  const std::size_t n = points.size();
  std::vector<std::uint32_t> order(n);
  const MortonCode code(parallel_bounds(points));
  // The upper half of the key and the sample in one word: half of the key tells nearly all samples apart.
  std::vector<std::uint64_t> words(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) words[i] = (code.of(points[i]) >> 31 << 32) | i;
  });
  sort_by_upper_half(words);
  // A run of equal halves belongs to the part that it begins in.
  const auto settle_part = [&](std::size_t begin, std::size_t end) {
    while (begin < end && begin > 0 && upper_half(words[begin]) == upper_half(words[begin - 1])) ++begin;
    while (begin < end) {
      std::size_t to = begin + 1;
      while (to < n && upper_half(words[to]) == upper_half(words[begin])) ++to;
      if (to - begin == 1) {
        order[begin] = static_cast<std::uint32_t>(words[begin]);
      } else {
        settle(points, code, std::span(words).subspan(begin, to - begin), order.data() + begin);
      }
      begin = to;
    }
  };
  parallel_for(n, settle_part, kPart);
  return order;
}

}  // namespace pointwright
