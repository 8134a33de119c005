#pragma once
// One edit: deform level k, put the detail back (§4, Eq. 5).

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/core/result.h"
#include "engine/editing/deformation.h"
#include "engine/editing/resampling_params.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/surface.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

class EditPlan;

/// What a drag changes from frame to frame; the regions stand still meanwhile.
struct EditParams {
  std::uint32_t level = 0;  ///< the level k that F moves; band_count() means single-resolution editing
  Blend blend = Blend::kQuartic;
  Deformation deformation;
  /// What multiplies the detail of each band where t = 1, 1 + t (g - 1) elsewhere; one for each band of the
  /// surface, of which those below `level` do not count, each within [-16, 16]. Empty: 1 everywhere.
  std::vector<float> gains;
  /// Samples are inserted where the deformation stretches the surface (engine/resampling); none: the samples
  /// stay the same ones.
  std::optional<ResamplingParams> resampling = std::nullopt;

  friend bool operator==(const EditParams&, const EditParams&) = default;
};

/// Errors: those of the deformation; kInvalidArgument for a level beyond the surface's or gains that do not
/// fit its bands (fields "level", "gains").
Result<void> validate(const EditParams& params, const MultiresSurface& surface);

/// Deforms level k with the field (computed on that level) and rebuilds the finer ones from their detail
/// coefficients: p' = p + (r' - r) + d (g n' - n), which is Eq. (5) written so that an unmoved sample keeps
/// its bits. Levels coarser than k are returned as they were; the session re-derives them when next needed.
/// Normals:     on level k those of the deformed surface, cofactor(J) n, exactly; on finer levels carried by
///              how their neighbourhoods move (engine/multires/normal_stencil.h), and turned exactly where a
///              rigid motion takes a sample whole (t = 1 without a gradient)
/// Promises:    t = 0 samples bit-identical on every level; a zero deformation with gains 1 is the identity,
///              to the bit; a rigid motion of everything is reproduced to 1e-6 of the diagonal
/// Pre:         valid parameters, finite input, the graph of the samples at rest. Never gives NaN
/// Cost:        O(N k) a level, parallel, vectorised; samples with t = 0 are only copied
/// Determinism: bitwise equal for any thread count and instruction set
MultiresSurface apply_edit(const MultiresSurface& surface, const NeighborGraph& graph,
                           const EditParams& params, const ScaleField& field, const Vec3d& origin);

/// The same from a plan that serves the parameters, writing only what may move: what a drag calls on every
/// frame. `edited` is a copy of `surface`, or what this function made of one with the same plan.
void apply_edit(const MultiresSurface& surface, const EditPlan& plan, const EditParams& params,
                const ScaleField& field, const Vec3d& origin, MultiresSurface& edited);

}  // namespace pointwright
