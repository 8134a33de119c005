#pragma once
// What the samples of a simplified or subsampled cloud bring along besides where they stand.

#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/simplification/simplification.h"

namespace pointwright {

/// Of each survivor, the input sample nearest to it among those that it stands for (ties: the first). Any
/// column can be taken from these.
/// Pre:  position is what `simplified` was made of
/// Cost: O(N)
std::vector<std::uint32_t> representatives(const Simplification& simplified, const Points& position);

/// Of each survivor, the mean over the samples that it stands for.
/// Shapes: N x components values in, interleaved; M x components out
/// Cost:   O(N components), sums in double precision
std::vector<float> averaged(const Simplification& simplified, std::span<const float> values,
                            std::size_t components = 1);

/// The simplified cloud with all its columns: positions and normals are the survivors', colours and texture
/// coordinates are means, scalars of floating-point type, too; integer ones (labels, counts) are the
/// representatives'. Ids count up.
/// Pre:  `simplified` was made of this cloud's positions
/// Cost: O(N) a column
Cloud simplified_cloud(const Simplification& simplified, const Cloud& cloud);

/// The chosen samples with all their columns, as they were to the bit; ids count up in the caller's order.
/// Pre:  ascending indices of `cloud`, as subsample() gives them
/// Cost: O(M log M) for M chosen
Cloud chosen_cloud(const Cloud& cloud, const std::vector<std::uint32_t>& kept);

}  // namespace pointwright
