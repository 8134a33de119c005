#pragma once
// Neighbours that face the same way, for work that must not join opposite sheets.

#include <cstdint>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Of each sample's `candidates` nearest neighbours, the k nearest whose normals are on its side: n . n' > 0.
/// Short rows are filled up with the sample itself, at their end.
/// Shapes, pre, cost, determinism, cancel: as build_neighbor_graph() with `candidates` neighbours
NeighborGraph same_side_graph(const Points& position, const Points& normal, std::uint32_t k,
                              std::uint32_t candidates, const ExecutionContext* context = nullptr);

}  // namespace pointwright
