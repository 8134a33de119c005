#pragma once
// Single steps of the umbrella operator on packed samples: what smooth(), smooth_to_scale() and the V-cycle
// are made of.

#include <vector>

#include "engine/smoothing/packed.h"
#include "engine/smoothing/reverse_neighbors.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Neighbours and weights of the umbrella, and what restricts its steps. Pointers are not owned.
struct UmbrellaOperator {
  const NeighborGraph* graph = nullptr;  ///< k > 0
  const float* weights = nullptr;        ///< in the graph's layout, of sum 1 a sample; none: uniform, 1 / k
  const Packed* normals = nullptr;       ///< steps are projected onto these; none: free
  const double* rates = nullptr;         ///< each sample's part of lambda; none: 1
};

/// `to` = `from` + lambda umbrella(`from`), Eq. (7) and (8).
/// Cost:        O(N k), parallel over samples
/// Determinism: bitwise equal for any thread count and instruction set, as all of these
void plain_step(const UmbrellaOperator& umbrella, float lambda, const Packed& from, Packed& to);

/// A plain step, every neighbour of a sample moved by 1 / k of what the sample moved, the other way (Eq. 9).
/// Gathered: `change` takes the plain steps, then each sample collects from those that list it.
/// Pre: no rates; `listers` of the same graph
void compensated_step(const UmbrellaOperator& umbrella, const ReverseNeighbors& listers, float lambda,
                      Packed& points, Packed& change);

/// A plain, free, uniform step of positions that carries along, in the fourth lane, the second moment of the
/// weights about the rest position: S_i = sum_j K_ij |rest_j - rest_i|^2, K the weights of all steps so far.
/// S_i less the squared distance of `from` and rest is the variance of sample i's weights. From lane 3 = 0 at
/// rest. Everything is relative to the sample, so floats are enough, however far away 0 is.
void spread_step(const NeighborGraph& graph, float lambda, const Packed& rest, const Packed& from,
                 Packed& to);

}  // namespace pointwright
