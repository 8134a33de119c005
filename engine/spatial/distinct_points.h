#pragma once
// The places that samples stand at, each once.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// Points without the exact duplicates that stand next to each other in the order: a pile of them would make
/// every search near it visit them all. Refers to the points, which must outlive it; without duplicates it
/// holds nothing else.
/// Cost:        O(N), parallel
/// Determinism: bitwise equal for any thread count
class DistinctPoints {
 public:
  explicit DistinctPoints(const Points& points);
  DistinctPoints(const DistinctPoints&) = delete;
  DistinctPoints& operator=(const DistinctPoints&) = delete;

  /// One point a place, in the old order.
  [[nodiscard]] const Points& points() const { return first_.empty() ? all_ : kept_; }
  /// The first of the points at place d; those at d are [first(d), first(d + 1)). Pre: d <= points().size()
  [[nodiscard]] std::uint32_t first(std::size_t d) const {
    return first_.empty() ? static_cast<std::uint32_t>(d) : first_[d];
  }

 private:
  const Points& all_;
  Points kept_;
  std::vector<std::uint32_t> first_;  // empty: every point is distinct
};

}  // namespace pointwright
