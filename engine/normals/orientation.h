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

/// Flips normals in place so that neighbours agree along the minimum spanning forest of the neighbour graph
/// under the reflected criterion (spanning_forest.h): on a circular arc the reflected normal equals its
/// neighbour's exactly, so creases and thin sheets keep their sides where the plain n_a . n_b fails. Each
/// component is turned outward at its most extreme sample. Where two sheets stand so close that the estimated
/// normals mix them (a gap below a quarter of the neighbourhood's radius), no criterion on normals can tell
/// them apart.
/// Shapes:      N points, N unit normals, their graph
/// Cost:        O(N k alpha(N)), nearly all of it parallel; about 20 bytes a sample while it runs
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between regions of samples and every 65,536 edges; the sides are then undetermined
OrientationReport orient_normals(const Points& points, const NeighborGraph& graph, Points& normals,
                                 const ExecutionContext* context = nullptr);

/// Flips each normal to the side of its counterpart in `reference` (a predecessor, or an uploaded normal).
/// Cost: O(N), parallel
void orient_like(const Points& reference, Points& normals);

/// Flips each normal to face the viewpoint, as a scanner saw its sample: in the coordinates of the points. A
/// normal at a right angle to the line of sight stays.
/// Cost: O(N), parallel
void orient_toward(const Vec3f& viewpoint, const Points& points, Points& normals);

/// The same with a viewpoint a sample: scans merged from several stations.
void orient_toward(const Points& viewpoints, const Points& points, Points& normals);

}  // namespace pointwright
