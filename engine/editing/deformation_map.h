#pragma once
// A deformation prepared for the vectorised kernels.

#include <cstdint>
#include <vector>

#include "engine/editing/deformation.h"
#include "engine/editing/deformation_kernels.h"

namespace pointwright {

/// Rotations are taken about the point of their axis that lies nearest to `origin`, and angles are split
/// into parts whose products with t are exact.
/// Pre: a valid deformation.
DeformMap to_deform_map(const Deformation& deformation, const Vec3d& origin);

/// Arguments that deform the samples of `blocks` of a level into `deformed`, which has its size.
/// Pre: ascending blocks, a field of the same samples, shape operators of those of the blocks where the map
///      goes along the normal.
DeformArgs deform_args(const DeformMap& map, const std::vector<std::uint32_t>& blocks,
                       const ScaleField& field, const Level& level, Level& deformed,
                       const ShapeOperators* shape);

}  // namespace pointwright
