#pragma once
// How large a disc each sample needs for the discs of all samples to close the surface.

#include <vector>

#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Disc radii that close an unevenly sampled surface: 0.9 times the distance to the nearest neighbour in that
/// quadrant of the tangent plane where it is farthest, looked for among the neighbours that face the same way
/// and, where a quadrant has none, among theirs (and, on thin sheets, whose other side takes places in the
/// graph, among those of theirs). Past the rim of an open surface no neighbour is found: there half of the
/// distance to the k-th one counts. At most three times the median of the neighbours' radii, so that outliers
/// stay small; 0 where a sample has no neighbour elsewhere.
/// Shapes:      N positions with unit normals on consistent sides, their graph
/// Cost:        O(N k), k^2 for samples with an empty quadrant, k^3 for those of thin sheets; parallel
/// Determinism: bitwise equal for any thread count
std::vector<float> splat_radii(const Points& position, const Points& normal, const NeighborGraph& graph);

}  // namespace pointwright
