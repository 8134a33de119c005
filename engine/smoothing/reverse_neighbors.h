#pragma once
// Who lists a sample: the neighbour relation transposed, laid out for gathering.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Samples whose lists stand side by side, so that their sums run through them together.
inline constexpr std::size_t kReverseLanes = 8;

/// Compressed rows, sliced: kReverseLanes consecutive samples share as many rows as the longest of their
/// lists has entries, but at most 2 k; entries beyond that follow in ordinary compressed rows, so that a
/// sample that everyone lists costs its slice no more than that.
struct ReverseNeighbors {
  std::vector<std::uint32_t> slice_first;  ///< slices + 1: where a slice starts, in rows
  std::vector<std::uint32_t> rows;         ///< [row][lane]: listers in ascending order, then `nothing`
  std::vector<std::uint32_t> rest_sample;  ///< the samples with more listers than their slice has rows
  std::vector<std::uint32_t> rest_first;   ///< their number + 1: where they start in `rest`
  std::vector<std::uint32_t> rest;
  std::uint32_t nothing = 0;  ///< padding: the entry after the last padded sample (Packed::nothing)

  [[nodiscard]] bool empty() const { return slice_first.empty(); }
};

/// Shapes:      of N samples with k neighbours each: N k entries, about a third more with the padding
/// Cost:        O(N k); 4 bytes an entry
/// Determinism: bitwise equal for any thread count
ReverseNeighbors reverse_neighbors(const NeighborGraph& graph);

}  // namespace pointwright
