#pragma once
// What an edit without resampling does to the samples.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/editing/edit.h"
#include "engine/multires/sampling.h"
#include "engine/multires/surface.h"

namespace pointwright {

/// The sampling after an edit that inserts nothing: the same one where it carries no cells; else one that
/// shares its cloud and graph, with its cells mapped by the edit (Eq. 13). So what such an edit stretches
/// counts for the next one that resamples.
/// Shapes: N samples in all of them, the field that of level params.level
/// Cost:   O(N), parallel
std::shared_ptr<const Sampling> carried_sampling(const std::shared_ptr<const Sampling>& sampling,
                                                 const MultiresSurface& surface, const EditParams& params,
                                                 const ScaleField& field);

/// The blocks of kSimdBlock samples in which some t > 0, ascending. Cost: O(N), parallel.
std::vector<std::uint32_t> moving_blocks(const ScaleField& field);

}  // namespace pointwright
