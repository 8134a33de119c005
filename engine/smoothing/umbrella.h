#pragma once
// The umbrella operator of §3.1 with cached neighbourhoods, and its controls of shrinkage.

#include <cstdint>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

enum class UmbrellaWeights {
  kUniform,          ///< w_i = 1
  kInverseDistance,  ///< w_i = 1 / (|p_i - p| + 0.3 h), from the rest positions: the scale-dependent
                     ///< umbrella. The paper's bare 1/|p_i - p| on moving samples pulls close pairs together
                     ///< without limit
};

/// The controls of shrinkage of §3.1.
enum class VolumePreservation {
  kNone,
  kLocal,   ///< each step's change is compensated by moving the k neighbours of p by (p - p')/k (Eq. 9): a
            ///< biharmonic flow, which keeps volume part by part and smooths less
  kGlobal,  ///< the whole is scaled about its centroid to the volume that it had (Desbrun et al. 1999): thin
            ///< parts shrink all the same and thick ones grow. Closed surfaces with oriented normals only
            ///< (engine/smoothing/global_volume.h says what counts as closed); an open one is refused, as it
            ///< has no volume to keep
  kTaubin,  ///< every step is followed by one of mu < 0, 1 / lambda + 1 / mu = pass_band (Taubin 1995)
};

enum class SmoothingDirection {
  kFree,         ///< samples move by the whole umbrella vector; they also drift along the surface
  kAlongNormal,  ///< only its component along the given normals: no drift, no pile-up, borders stay
};

struct UmbrellaParams {
  UmbrellaWeights weights = UmbrellaWeights::kUniform;
  VolumePreservation preserve = VolumePreservation::kNone;
  SmoothingDirection direction = SmoothingDirection::kFree;
  float lambda = 0.5F;           ///< lambda of Eq. (7), in (0, 0.7]; beyond 0.8 compensated steps diverge
  std::uint32_t iterations = 1;  ///< up to 100,000; of kTaubin pairs of steps
  /// k_PB of kTaubin, in (0, 0.2]: the umbrella's eigenvalue, 17 (h / L)^2 for wavelength L at spacing h and
  /// k = 10, below which waves stay. Pairs of steps that diverge are refused.
  float pass_band = 0.1F;
  friend bool operator==(const UmbrellaParams&, const UmbrellaParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault.
Result<void> validate(const UmbrellaParams& params);

/// mu of kTaubin, negative.
float taubin_mu(float lambda, float pass_band);

/// p' = p + lambda * umbrella(p), Eq. (7) and (8), `iterations` times, over the neighbourhoods of the graph.
/// With local preservation a step is P += u - (1/k) A^T u, u = lambda * umbrella and A the neighbour relation
/// (Eq. 9, whatever the weights), gathered over reverse neighbours so that the result never depends on the
/// thread count. Where samples move freely that keeps the mean of all positions; along the normals it does
/// not, each sample taking its own normal's component only.
/// Shapes:      N points, their graph, N unit normals (read only with kAlongNormal and kGlobal)
/// Errors:      kInvalidArgument (field "preserve" where kGlobal finds no volume to keep), kCancelled
/// Cost:        O(iterations N k), parallel over samples; 32 bytes a sample, and about 60 with kLocal
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between iterations
Result<Points> smooth(const Points& points, const Points& normals, const NeighborGraph& graph,
                      const UmbrellaParams& params, const ExecutionContext* context = nullptr);

/// Smooths to a scale: iterates plain uniform umbrella steps until the median over all samples of the
/// kernel's standard deviation s_i reaches `scale`, the last step weakened to meet it. s_i^2 is half the
/// variance of the weights that the steps have given to the rest neighbourhood of sample i, so the scale
/// means the same at every density and on uneven samplings.
///   kFree: var_i = (W^n |p|^2)_i - |(W^n p)_i|^2.
///   kAlongNormal: the normals are fitted anew, on their old sides, before each step but the first, so
///   heights that are linear over a neighbourhood stay and the variance, about the sample itself, is that of
///   umbrella weights less the part of a least-squares slope; dense samples take smaller steps, sparse ones
///   larger, so that every s_i is near the median.
/// No s_i is more than the box of what the sample's steps can reach allows (KernelVariance), so no more than
/// the radius on a sphere. Smoothing ends before the scale where a step adds less than a hundredth of the
/// first one's variance, as on an object that is smaller than the scale and where the steps of most samples
/// stay within clusters far smaller than it, and after `max_iterations`.
struct ScaledSmoothing {
  Points points;
  std::uint32_t iterations = 0;
  float scale =
      0.0F;  ///< the median reached, model units; less than asked for where smoothing ended before it
};
/// Errors: kInvalidArgument (scale not finite or < 0), kCancelled
/// Cost:   O(iterations N k), parallel over samples
Result<ScaledSmoothing> smooth_to_scale(const Points& points, const Points& normals,
                                        const NeighborGraph& graph, float scale, SmoothingDirection direction,
                                        std::uint32_t max_iterations,
                                        const ExecutionContext* context = nullptr);

}  // namespace pointwright
