#pragma once
// Garbage collection (§5.3): what squeezed samples too close together is removed again, after the edit.

#include "engine/editing/scale_field.h"
#include "engine/resampling/resampled_edit.h"

namespace pointwright {

/// Removes one of each two samples that are each other's nearest, round by round, while they are closer than
/// `closest` spacings: first inserted ones alone, then any, the one with the higher id. Only samples with
/// t > 0 go, where cells are smaller than 0.7 of their area at rest, originals only while they are: noise
/// alone costs none. Who stays keeps its bits, and its cell grows by that of who goes; rows of neighbours are
/// filled up from the neighbourhood, or searched for where that is all gone.
/// Shapes:      t of result.surface's samples; closest in (0, kGreatestCollectDistance]
/// Cost:        O(S log S) a round for S squeezed samples, a copy of everything where one is removed
/// Determinism: bitwise equal for any thread count
/// Cancels:     between rounds; the result is then unfinished and must be dropped
void collect(const ScaleField& field, float closest, ResampledEdit& result,
             const ExecutionContext* context = nullptr);

}  // namespace pointwright
