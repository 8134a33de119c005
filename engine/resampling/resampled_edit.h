#pragma once
// One edit with dynamic resampling (§5): samples are inserted where the deformation stretches the surface.

#include <cstddef>
#include <memory>

#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "engine/editing/edit.h"
#include "engine/editing/region.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"

namespace pointwright {

/// How much may be spent on one.
enum class ResamplingEffort {
  kExact,  ///< what is recorded
  /// Of a drag's frame: fewer sweeps of relaxation, at most 100,000 samples inserted, wider apart where it
  /// would be more; nothing is collected, and the sampling's graph has neighbours at rest.
  kPreview,
};

/// The surface after an edit, and its samples: those before the edit first, in their order, then the inserted
/// ones; what was collected is missing.
struct ResampledEdit {
  MultiresSurface surface;
  std::shared_ptr<const Sampling> sampling;
  std::size_t inserted = 0;
  std::size_t removed = 0;
};

/// apply_edit() with params.resampling.
/// Shapes:      N samples in the surface, the sampling and the field, which is that of the regions on
///              level params.level
/// Errors:      kTooLarge (field "resampling.max_samples") before memory is asked for; kCancelled
/// Promises:    samples that were there before end with the bits that apply_edit() gives them, inserted ones
///              exactly on the deformed surface of their level: p' = F(p, t(p))
/// Determinism: bitwise equal for any thread count and instruction set
Result<ResampledEdit> apply_resampled_edit(const MultiresSurface& surface,
                                           const std::shared_ptr<const Sampling>& sampling,
                                           const EditParams& params, const ScaleField& field,
                                           const RegionPair& regions, ResamplingEffort effort,
                                           const ExecutionContext* context = nullptr);

}  // namespace pointwright
