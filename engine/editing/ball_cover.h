#pragma once
// A selection of samples as a volume in model space, which other samplings of the surface can be painted
// with.

#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/selection.h"
#include "engine/editing/shape.h"

namespace pointwright {

/// The least radius of a ball: it holds what stands at its centre to the last bit and nothing else.
inline constexpr double kLeastBallRadius = 1e-200;

/// Balls around members that together hold every member of this surface and no other sample: painting with
/// them marks exactly the members. They reach halfway to the nearest samples that are none, so that on a
/// finer or coarser sampling they select the same part of the surface up to the spacing at its border. Taken
/// in descending order of radius, ties by index, each around a member that no ball before it holds together
/// with the surface around it (as far as its sixth neighbour, or as its own ball reaches): inner parts take
/// few, their number follows the length of the border. Where no other sample is near, one ball holds all
/// members. A member at the very place of another sample (in double precision) cannot be told from it by a
/// volume: its ball has kLeastBallRadius, and the other joins.
/// Shapes:      N positions (coherent order is fast, any order is right), N members; point sets of at most
///              kMaxStrokeVertices balls each, to be painted one after the other; none for no members
/// Cost:        O(N) to find the members and what is near them, O(M log N) for M members: distances are
///              parallel, the choice of balls is sequential
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks; the answer is then incomplete and must be dropped
std::vector<PointSet> ball_cover(const Points& position, const SampleMask& members, const Vec3d& origin,
                                 const ExecutionContext* context = nullptr);

}  // namespace pointwright
