#pragma once
// A deformation prepared for the vectorised kernels.

#include "engine/editing/deformation.h"
#include "engine/editing/deformation_kernels.h"

namespace pointwright {

/// Rotations are taken about the point of their axis that lies nearest to `origin`, and the angle is split
/// into parts whose products with t are exact.
/// Pre: a valid deformation.
DeformMap to_deform_map(const Deformation& deformation, const Vec3d& origin);

}  // namespace pointwright
