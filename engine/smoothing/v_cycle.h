#pragma once
// Multilevel smoothing (§3.3): one V-cycle over a hierarchy of coarser clouds.

#include <cstdint>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/smoothing/smoothing_hierarchy.h"
#include "engine/smoothing/umbrella.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

struct VCycleParams {
  /// Standard deviation of the Gaussian that the smoothing equals, model units; finite, not negative. kLocal,
  /// which is no Gaussian, takes waves of length pi sqrt 2 scale down to 1 / e, as the Gaussian does, shorter
  /// ones further and longer ones less.
  float scale = 0.0F;
  /// kTaubin is refused: its pass band belongs to the spacing and has no scale.
  VolumePreservation preserve = VolumePreservation::kNone;
  /// kAlongNormal: the result takes of each sample's move what is along the smoothed surface's own normal
  /// there, so that samples keep their places along the surface.
  SmoothingDirection direction = SmoothingDirection::kAlongNormal;
  std::uint32_t pre_iterations = 2;   ///< Phi on the way down, every level but the coarsest; at most 100
  std::uint32_t post_iterations = 2;  ///< and on the way up
  float lambda = 0.5F;                ///< of Eq. (7), in (0, 0.7]
  friend bool operator==(const VCycleParams&, const VCycleParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault.
Result<void> validate(const VCycleParams& params);

struct VCycle {
  Points points;
  std::uint32_t depth = 0;              ///< coarse levels used
  float coarsest_spacing = 0.0F;        ///< model units
  std::uint32_t bottom_iterations = 0;  ///< on the coarsest of them
  /// What was reached. Differs from what was asked for where the object is too small to be smoothed so far,
  /// where the steps on the way alone smooth more, and at 100,000 iterations.
  float scale = 0.0F;
};

/// S' = Phi Psi^-1 Phi ... Phi Psi Phi (S), Eq. (10). Phi is a few umbrella steps with the chosen control of
/// shrinkage, Psi moves a coarse sample as its children moved, Psi^-1 is a weighted sum of coarse samples
/// that holds for quadratic heights (CoarseLevel): nothing finer than the coarse level comes back, and the
/// shape does not shrink by it. One level is one octave: the depth puts the coarsest spacing between a third
/// and two thirds of the scale, and iterations there supply what the other steps leave of the scale's
/// variance. kGlobal smooths plainly and scales the result once.
/// Shapes:      N points, their unit normals (read only with kGlobal), their graph, the hierarchy of these
/// Errors:      kInvalidArgument (field "preserve" also where kGlobal finds no volume to keep), kCancelled
/// Cost:        O(N k), nearly independent of the scale; parallel over samples; 32 bytes a sample of work
///              space, and half of that below
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between steps
Result<VCycle> v_cycle(const Points& points, const Points& normals, const NeighborGraph& graph,
                       const SmoothingHierarchy& hierarchy, const VCycleParams& params,
                       const ExecutionContext* context = nullptr);

}  // namespace pointwright
