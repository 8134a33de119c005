#pragma once
// The minimum spanning forest of a neighbour graph under the reflected criterion, and the sides along it.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Samples of a region: what is spanned by itself. Its edges fit a core's own cache.
inline constexpr std::size_t kSpanRegion = 8192;

/// Every sample's component and side.
struct SidedForest {
  std::vector<std::uint32_t> root;    ///< the first sample of the component
  std::vector<std::uint8_t> opposed;  ///< 1 where the normal's side differs from the root's
};

/// Joins neighbours along the edges on which the reflected normals agree best: the minimum spanning forest of
/// the symmetric neighbour graph, adjacent duplicates joined too. With e the unit vector of an edge, n_a is
/// reflected in the plane perpendicular to e, r = n_a - 2 e (e . n_a); the edge's weight is
/// sqrt(1 - |r . n_b|), which grows with the angle between the two, in 2,048 steps, and the sides are opposed
/// where r . n_b < 0.
///
/// Regions of consecutive samples are spanned at the same time. Inside one, Kruskal's algorithm joins two
/// trees while one of them has no lighter edge that leaves the region: such an edge is in every minimum
/// spanning forest (the cut property). What is left, the edges between regions and between trees that wait
/// for them, is a small graph that one thread finishes. Of equal weights those count as lighter that come
/// from an earlier region, then those that leave it, then the earlier samples.
/// Shapes:      N points, N unit normals, their graph
/// Cost:        O(N k alpha(N)); 8 bytes a sample, and the edges of one region a thread
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between regions and every 65,536 edges of the last part; the result is then empty
SidedForest span_normals(const Points& points, const NeighborGraph& graph, const Points& normals,
                         const ExecutionContext* context = nullptr);

}  // namespace pointwright
