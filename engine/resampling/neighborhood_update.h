#pragma once
// Neighbourhoods where samples were inserted: updated, not rebuilt.

#include "engine/core/points.h"
#include "engine/resampling/insertion.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Gives every inserted sample, its parent and the neighbours of that the k nearest among the families of
/// their old neighbourhoods, where they stand now. The rows of all others stay, to the bit.
/// Shapes:      `before`: the graph of the samples without the children; positions of all
/// Cost:        O(C k m), m the children of a family; parallel
/// Determinism: bitwise equal for any thread count
NeighborGraph updated_neighborhoods(const NeighborGraph& before, const Inserted& inserted,
                                    const Points& position);

}  // namespace pointwright
