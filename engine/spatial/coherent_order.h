#pragma once
// Spatially coherent sample order: neighbours in space are neighbours in memory (§6: "exploiting coherence").

#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

/// The Morton order of the points: result[new index] = old index. Ties (equal keys) are ordered by exact
/// position, then by old index, so exact duplicates are adjacent and the order is unique.
/// Shapes:      N points in, a permutation of 0..N-1 out
/// Cost:        O(N) radix sort by the upper half of 63-bit keys, and of the rest where halves are equal;
///              parallel; 16 bytes a sample while it runs
/// Determinism: bitwise equal for any thread count
std::vector<std::uint32_t> coherent_order(const Points& points);

}  // namespace pointwright
