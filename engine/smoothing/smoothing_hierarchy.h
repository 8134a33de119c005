#pragma once
// Coarser and coarser clouds for the V-cycle (§3.3), with what carries samples between them.

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/smoothing/reverse_neighbors.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// What the smoother knows of a level, all of it at rest.
struct LevelMeasure {
  float spacing = 0.0F;  ///< median of the local spacing, model units
  /// Median variance of the weights of 1, 2, 3 ... plain steps of lambda = 0.5, an axis of the tangent plane
  /// (KernelVariance): enough of them for any use, or up to where a step adds a hundredth of the first one's.
  std::vector<double> variance;
  bool is_exhausted = false;  ///< further steps add nothing: the object is smaller than the scale

  /// The variance that steps of these lambdas in all give, between and beyond the measured ones linearly.
  [[nodiscard]] double variance_of(double lambdas) const;
  /// The inverse; at most what exhausts the steps.
  [[nodiscard]] double lambdas_for(double variance) const;
  /// Variance of one step of lambda = 1, as the first steps have it: the umbrella's eigenvalue for wavelength
  /// L is (2 pi / L)^2 / 2 of it.
  [[nodiscard]] double step_variance() const;
};

/// One level below the finest.
struct CoarseLevel {
  Points position;  ///< the coarsener's, moved along the normals onto the surface of the finer samples
  Points normal;
  NeighborGraph graph;  ///< neighbours on the same side; short rows repeat the sample
  ReverseNeighbors listers;
  LevelMeasure measure;

  /// Psi, from the next finer level of N samples: a sample here moves by what the samples that it stands for
  /// moved in the mean, so that the shape does not shrink by the way.
  std::vector<std::uint32_t> child_first;  ///< M + 1
  std::vector<std::uint32_t> child;        ///< N, by parent, ascending
  Points child_offset;                     ///< M: this sample less the mean of its children, at rest

  /// Psi^-1: a finer sample is a weighted sum of its parent and the parent's neighbours.
  std::vector<std::uint32_t> parent;  ///< N
  std::vector<float> weights;         ///< N x graph.k, of the neighbours; the parent has what is left of 1
  double up_variance = 0.0;           ///< median over N of the variance of these weights, an axis
};

struct SmoothingHierarchy {
  ReverseNeighbors listers;  ///< of the finest level
  LevelMeasure measure;
  std::vector<CoarseLevel> coarse;  ///< finest first, about one octave in spacing apart; may be empty

  /// Bytes of all that hangs on it: about 160 a sample of the finest level with k = 10, of which compensated
  /// steps need 70.
  [[nodiscard]] std::size_t byte_count() const;
};

/// A cloud of about a quarter of the samples, each sample's parent among them (all have children).
struct Coarsening {
  Points position;
  Points normal;
  std::vector<std::uint32_t> parent;
};
using Coarsener = std::function<Result<Coarsening>(const Points&, const Points&, const NeighborGraph&)>;

/// Psi by pair contraction (§3.2), to a quarter of the samples, with the length term that keeps them even.
/// The context, where there is one, must outlive it.
Coarsener contracting_coarsener(const ExecutionContext* context = nullptr);

/// Levels until the spacing is more than a third of `scale`, the largest that the hierarchy will be used for,
/// or 100 samples are left, or a level has more than three quarters of the one before.
/// Psi^-1 is a degree-2 moving least-squares fit at the finer sample's place in the parent's tangent plane,
/// over the parent and its neighbours on the same side, all from rest positions: exact for heights that are
/// quadratic there. Where these samples do not carry one (weights beyond 3 in absolute sum) it is of degree
/// 1, then 0.
/// Shapes:      N points in coherent order, unit normals on consistent sides, their graph
/// Errors:      kInvalidArgument (scale not finite or negative), kCancelled, the coarsener's
/// Cost:        O(N k), about 1.5 us a sample and thread beside coarsening and the coarse graphs
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between levels and passes
Result<SmoothingHierarchy> build_smoothing_hierarchy(const Points& points, const Points& normals,
                                                     const NeighborGraph& graph, float scale,
                                                     const Coarsener& coarsen,
                                                     const ExecutionContext* context = nullptr);

}  // namespace pointwright
