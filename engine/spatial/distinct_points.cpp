#include "engine/spatial/distinct_points.h"

#include "engine/core/parallel.h"

namespace pointwright {

DistinctPoints::DistinctPoints(const Points& points) : all_(points) {
  const std::size_t n = points.size();
  const auto starts_place = [&](std::size_t i) { return i == 0 || points[i] != points[i - 1]; };
  std::vector<std::uint32_t> offset((n + kParallelBlock - 1) / kParallelBlock + 1, 0);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    std::uint32_t count = 0;
    for (std::size_t i = begin; i < end; ++i) count += starts_place(i) ? 1U : 0U;
    offset[begin / kParallelBlock + 1] = count;
  });
  for (std::size_t b = 1; b < offset.size(); ++b) offset[b] += offset[b - 1];
  if (offset.back() == n) return;
  kept_.resize(offset.back());
  first_.resize(offset.back() + 1U);
  first_.back() = static_cast<std::uint32_t>(n);
  parallel_for(n, [&](std::size_t begin, std::size_t end) {
    std::uint32_t slot = offset[begin / kParallelBlock];
    for (std::size_t i = begin; i < end; ++i) {
      if (!starts_place(i)) continue;
      kept_.set(slot, points[i]);
      first_[slot++] = static_cast<std::uint32_t>(i);
    }
  });
}

}  // namespace pointwright
