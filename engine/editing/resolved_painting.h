#pragma once
// Painting as it is recorded: in model space, whatever the sampling.

#include <vector>

#include "engine/core/execution_context.h"
#include "engine/editing/painting.h"

namespace pointwright {

/// Operations that do to these marks what the operation does, and on another sampling of the surface select
/// the same part of it: an operation that depends on the sampling becomes point sets around the samples that
/// it covers (ball_cover()) or, where its filters keep nothing out, its shape without them. Any other stays
/// as it is. None where it changes nothing. Growing takes the members along and shrinking keeps the remaining
/// ones, so that on a finer sampling no seam opens between what was there and what joined. A sample at the
/// very place of a covered one counts as covered.
/// Pre:         validate(operation); N marks
/// Cost:        that of painting and of ball_cover()
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the answer is then incomplete and must be dropped
std::vector<PaintOperation> resolved(const PaintOperation& operation, RegionKind kind,
                                     const PaintSurface& surface, const Marks& marks,
                                     const ExecutionContext* context = nullptr);

/// Operations of the mode (one with a shape) over the ball cover of the samples, one for each of its point
/// sets. None where the mask is empty. Cost, Determinism, Cancels: those of ball_cover()
std::vector<PaintOperation> cover_operations(PaintMode mode, const SampleMask& mask, const Points& position,
                                             const Vec3d& origin, bool steal = false,
                                             const ExecutionContext* context = nullptr);

}  // namespace pointwright
