#pragma once
// Sets of samples that depend on the sampling: what lies near the members of a region, and what a flood
// reaches.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/painting.h"

namespace pointwright {

/// The samples that are not in `members` but stand within `distance` of one that is; distances are computed
/// in float. None where nobody is a member.
/// Shapes:      N positions, N members
/// Cost:        O(N + M log M) to index the M members, O(log M) a sample; parallel
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks; the answer is then incomplete and must be dropped
SampleMask near_members(const Points& position, const SampleMask& members, double distance,
                        const ExecutionContext* context = nullptr);

/// The samples that a flood reaches from the one nearest to its seed (of equally near ones the first), each
/// from its nearest neighbours' lists: a sample that stands on nobody's list is not reached. Duplicates that
/// are adjacent are neighbours too. None where the first sample is `blocked` or outside the radius.
/// Shapes:      N positions, normals where the angle bounds, a graph; N entries of `blocked`, or none
/// Cost:        O(N) to find the first sample, parallel; O(k) for each sample reached
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the answer is then incomplete and must be dropped
SampleMask flood_fill(const PaintSurface& surface, const FloodFill& flood, const SampleMask& blocked,
                      const ExecutionContext* context = nullptr);

}  // namespace pointwright
