#pragma once
// The flat k-nearest-neighbour graph of §2.1, blocked so that a kernel reads neighbour j of 16 consecutive
// samples as one vector.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"

namespace pointwright {

/// N x k neighbour indices. Neighbour j of sample i is `index(i, j)`; neighbours are ordered by distance,
/// then index. Where duplicates are adjacent (coherent_order leaves them so) they share one list, and no list
/// contains the sample itself or an exact duplicate of it.
struct NeighborGraph {
  std::size_t count = 0;             ///< N
  std::uint32_t k = 0;               ///< neighbours per sample: min(k asked for, distinct samples - 1)
  std::vector<std::uint32_t> lanes;  ///< [block][j][lane], kSimdBlock lanes; padding lanes point at sample 0
  std::size_t duplicate_count = 0;   ///< samples that stand exactly where the one before stands

  [[nodiscard]] std::uint32_t index(std::size_t i, std::uint32_t j) const {
    return lanes[(i / kSimdBlock * k + j) * kSimdBlock + i % kSimdBlock];
  }
  [[nodiscard]] std::uint32_t& index(std::size_t i, std::uint32_t j) {
    return lanes[(i / kSimdBlock * k + j) * kSimdBlock + i % kSimdBlock];
  }
  /// Row j of a block: kSimdBlock indices.
  [[nodiscard]] const std::uint32_t* row(std::size_t block, std::uint32_t j) const {
    return lanes.data() + (block * k + j) * kSimdBlock;
  }
};

/// The k nearest neighbours of every sample (Euclidean, §2.1).
/// Pre:         exact duplicates adjacent, as in coherent order, which is also what makes it fast. Duplicates
///              that stand apart count as samples of their own: they list each other, at distance 0
/// Cost:        O(N (k + log N)) time on surfaces; 4 k bytes a sample
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the result is then incomplete and must be dropped
NeighborGraph build_neighbor_graph(const Points& points, std::uint32_t k,
                                   const ExecutionContext* context = nullptr);

/// Local sample spacing h_i = r_k sqrt(pi / (k + 1/2)), r_k the distance to the k-th neighbour: the square
/// root of the area per sample on an evenly sampled surface. 0 where a sample has no neighbour.
/// Cost: O(N)
std::vector<float> local_spacing(const Points& points, const NeighborGraph& graph);

}  // namespace pointwright
