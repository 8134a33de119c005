#pragma once
// Parts of a scale field, for callers that know which samples a change can reach.

#include <cstddef>

#include "engine/core/points.h"
#include "engine/editing/region.h"
#include "engine/editing/scale_field.h"

namespace pointwright {

/// d_0 and d_1 of a range of points. Inside one region t does not depend on how far the other one is: there
/// the distance to it is a small limit.
struct DistancePair {
  RegionDistances zero;
  RegionDistances one;
};

/// t and its gradient of position[begin, end) into `field`, and the distances that they come from: t changes
/// only where a ball comes or goes within them. The bits of a sample do not depend on the range.
/// Pre:  both regions non-empty, begin a multiple of kSimdBlock, end another one or the last sample's; what
///       follows that in its block is overwritten
/// Cost: sequential
void compute_scale_range(const Points& position, const RegionPair& regions, Blend blend, std::size_t begin,
                         std::size_t end, DistancePair& distances, ScaleField& field);

/// A field of n samples, not filled yet.
ScaleField unfilled_scale_field(std::size_t n);
/// The padding belongs to no sample: it stays put.
void clear_padding(ScaleField& field);

}  // namespace pointwright
