#pragma once
// Weighted sample elimination: of a set of samples those that are most crowded go, one after the other.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"

namespace pointwright {

/// The samples that go before `wanted` are left, in no particular order. The weight of a sample is the sum
/// over its neighbours within r of (1 - d / r)^8; the sample of greatest weight goes, its neighbours' weights
/// fall by its share, and so on. Neighbours whose normals oppose, n_i . n_j < 0, are none. Weights only fall,
/// so a sample that no neighbour outweighs goes before all of its neighbours, whatever happens elsewhere:
/// rounds that take all such samples at once, until nothing heavier than what must go is left, are the
/// one-at-a-time order in parallel. r is 1.05 of the distance at which `wanted` samples in a hexagonal
/// pattern cover the area that there is, by the room that each sample has. Where many samples go, nearby
/// neighbours weigh nearly the same (Yuksel's limit, 0.65 r), or the clumps of the input would decide.
/// Shapes:      N samples, N normals or none; N - wanted indices
/// Pre:         coherent order makes it fast; few samples in one place; 1 <= wanted < N
/// Cost:        O(N k) for k = 24, parallel; about 400 bytes a sample while it runs
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between blocks of samples; what is returned must then be dropped
std::vector<std::uint32_t> eliminate_samples(const Points& position, const Points& normal, std::size_t wanted,
                                             const ExecutionContext* context);

}  // namespace pointwright
