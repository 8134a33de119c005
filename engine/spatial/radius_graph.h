#pragma once
// Neighbourhoods of a fixed radius (§2.1 knows both: the k nearest, or all within a sphere).

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"

namespace pointwright {

/// How many neighbours a sample may have at most, whatever is asked for.
inline constexpr std::uint32_t kMaxRadiusNeighbors = 1024;

struct RadiusParams {
  /// A distance in model units, above 0; a neighbour at exactly this distance counts.
  float radius = 0.0F;
  /// Neighbours kept per sample, the nearest ones; 1 to kMaxRadiusNeighbors.
  std::uint32_t limit = 64;
  friend bool operator==(const RadiusParams&, const RadiusParams&) = default;
};

/// The neighbours of all samples within a radius, one list after the other, each ordered by distance, then
/// index. As in NeighborGraph, adjacent duplicates have equal lists, and no list contains the sample itself
/// or an exact duplicate of it.
struct RadiusGraph {
  std::vector<std::uint64_t> first;      ///< N + 1: the list of sample i is [first[i], first[i + 1])
  std::vector<std::uint32_t> neighbors;  ///< all the lists
  std::size_t duplicate_count = 0;       ///< samples that stand exactly where the one before stands
  std::size_t cut_count = 0;             ///< samples that had more neighbours than the limit

  [[nodiscard]] std::size_t count() const { return first.empty() ? 0 : first.size() - 1; }
  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t i) const {
    return std::span(neighbors).subspan(first[i], first[i + 1] - first[i]);
  }
};

/// Checks the ranges that RadiusParams states.
Result<void> validate(const RadiusParams& params);

/// All neighbours within a radius, up to a limit.
/// Paper:       §2.1
/// Pre:         exact duplicates adjacent, as in coherent order, which is also what makes it fast
/// Errors:      kInvalidArgument (radius, limit), kCancelled
/// Cost:        O(N m + N log N) time for m neighbours a sample, m at most the limit; 8 + 4 m bytes a sample,
///              twice that while it is built
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between blocks of samples
Result<RadiusGraph> build_radius_graph(const Points& points, const RadiusParams& params,
                                       const ExecutionContext* context = nullptr);

}  // namespace pointwright
