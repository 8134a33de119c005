#pragma once
// Gives unoriented normals consistent sides.

#include <cstddef>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// What the orientation found.
struct OrientationReport {
  std::size_t components = 0;  ///< connected components of the symmetric neighbour graph
  /// Of those, with fewer than 50 samples: they follow the nearest larger one.
  std::size_t small_components = 0;
};

/// Flips normals in place so that neighbours agree: a minimum spanning tree (Kruskal) of the neighbour graph
/// under the reflected criterion. With e the unit vector between two samples, n_a is reflected in the plane
/// perpendicular to e, r = n_a - 2 e (e . n_a); the edge's weight is 1 - |r . n_b| and its sign that of r .
/// n_b: on a circular arc r equals n_b exactly, so creases and thin sheets keep their sides where the plain
/// n_a . n_b fails. Each component is turned outward at its most extreme sample.
/// Shapes:      N points, N unit normals, their graph
/// Cost:        O(N k alpha(N)) after one stable counting sort of the edges; about 14 k bytes a sample
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples and every 65,536 edges; the sides are then undetermined
OrientationReport orient_normals(const Points& points, const NeighborGraph& graph, Points& normals,
                                 const ExecutionContext* context = nullptr);

/// Flips each normal to the side of its counterpart in `reference` (a predecessor, or an uploaded normal).
void orient_like(const Points& reference, Points& normals);

}  // namespace pointwright
