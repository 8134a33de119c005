#pragma once
// Surface normals by weighted least-squares planes over the neighbour graph (§2.2).

#include <cstddef>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"
#include "engine/spatial/radius_graph.h"

namespace pointwright {

struct NormalParams {
  /// sigma of Eq. (3), phi(x) = exp(-x^2 / (sigma^2 r^2)), r the radius of the neighbourhood; in (0, 100].
  float sigma = 0.7F;
  friend bool operator==(const NormalParams&, const NormalParams&) = default;
};

/// Unit normals of all samples, their sides undetermined (see orientation.h). The sample itself counts with
/// weight 1; r is the distance to its farthest neighbour. Degenerate neighbourhoods (collinear, coincident,
/// fewer than two neighbours) get some unit vector across their direction; returns how many there are.
/// Paper:       §2.2, Eq. (2)-(4)
/// Shapes:      N points and their graph; `normal` is resized to N
/// Errors:      none; LogicError for a sigma out of range or a graph of other points
/// Cost:        O(N k), vectorised over blocks of samples, parallel
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between blocks of samples; the normals are then incomplete and must be dropped
std::size_t estimate_normals(const Points& points, const NeighborGraph& graph, const NormalParams& params,
                             Points& normal, const ExecutionContext* context = nullptr);

/// The same over all neighbours within a radius (radius_graph.h).
std::size_t estimate_normals(const Points& points, const RadiusGraph& graph, const NormalParams& params,
                             Points& normal, const ExecutionContext* context = nullptr);

/// Unit normals fitted anew by unweighted planes over each sample and its neighbours, on the side of the old
/// ones, which stay where the neighbours span no plane.
/// Shapes:      N points, their graph, N unit normals
/// Cost:        O(N k), parallel
/// Determinism: bitwise equal for any thread count
void refit_normals(const Points& points, const NeighborGraph& graph, Points& normals);

}  // namespace pointwright
