#pragma once
// A cloud as it came, as a surface: neighbourhoods and normals on consistent sides (§2).

#include <cstddef>
#include <cstdint>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

struct RestSurface {
  NeighborGraph graph;
  /// Unit: the uploaded ones, made unit, where the cloud has them; else estimated and oriented.
  Points normal;
  /// Connected components of the graph, each of which has a side chosen for it; 0 where normals were
  /// uploaded, which choose it.
  std::size_t component_count = 0;
};

/// k of §2.1: 4 to 32 (the paper: 8 to 12). Error: kInvalidArgument, field "neighbors".
Result<void> validate_neighbors(std::uint32_t neighbors);

/// Unit normals: the uploaded ones, made unit, where the cloud has them and they are directions; else
/// estimated, on whatever side.
/// Shapes:  N samples and their graph
/// Cost:    that of estimate_normals
/// Cancels: between blocks of samples; the normals are then incomplete and must be dropped
Points usable_normals(const Cloud& cloud, const NeighborGraph& graph, const ExecutionContext& context);

/// Shapes:      N >= 1 samples in coherent order; k neighbours each
/// Errors:      kInvalidArgument (neighbors), kEmptyCloud, kCancelled
/// Cost:        O(N k log N)
/// Determinism: bitwise equal for any thread count
/// Cancels:     between phases ("neighbours", "normals") and blocks of samples
Result<RestSurface> rest_surface(const Cloud& cloud, std::uint32_t neighbors,
                                 const ExecutionContext& context);

}  // namespace pointwright
