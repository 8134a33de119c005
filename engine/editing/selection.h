#pragma once
// Sets of samples that depend on the sampling: what lies near the members of a region.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/painting.h"

namespace pointwright {

/// A set of samples: one entry each, 0 or 1.
using SampleMask = std::vector<std::uint8_t>;

/// The samples that are not in `members` but stand within `distance` of one that is; distances are computed
/// in float. None where nobody is a member.
/// Shapes:      N positions, N members
/// Cost:        O(N + M log M) to index the M members, O(log M) a sample; parallel
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks; the answer is then incomplete and must be dropped
SampleMask near_members(const Points& position, const SampleMask& members, double distance,
                        const ExecutionContext* context = nullptr);

}  // namespace pointwright
