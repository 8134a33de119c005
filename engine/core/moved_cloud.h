#pragma once
// A cloud whose samples have moved.

#include "engine/core/cloud.h"
#include "engine/core/points.h"

namespace pointwright {

/// The cloud with its samples at other places and with other normals; everything else stays, and so do the
/// exact positions of samples that did not move: they leave with the very bits they came with.
/// Shapes: N positions and normals, in the cloud's order
/// Cost:   a copy of the cloud, parallel
Cloud moved_cloud(const Cloud& cloud, const Points& position, const Points& normal);

}  // namespace pointwright
