#pragma once
// Which samples a view shows, and which it hides behind others.

#include "engine/core/execution_context.h"
#include "engine/editing/painting.h"
#include "engine/editing/screen_shape.h"

namespace pointwright {

/// The samples in the bounding box of the outline that no other sample hides. Every sample is a disc of its
/// splat_radii() in its tangent plane; a sample is hidden where a disc, seen from the eye, lies in front of
/// its own tangent plane by more than two radii across the surface (its own, or the disc's if that is
/// larger). Discs are drawn into a pyramid of depth grids of at most 2048 x 2048 texels over that box, each
/// on the level whose texels are a few to its radius: no gap opens however near the eye is, and none is drawn
/// at great cost. Both sides of a surface are seen. Outside the view's depth range (clip-space |z| > w)
/// samples are neither shown nor hide others. Depth grows with w; in parallel views (w the same everywhere)
/// with z.
/// Pre:         a valid shape; the surface has normals and the graph of its samples
/// Cost:        O(N k) for the radii, O(N) to draw (at most 81 texels a disc) and to look up; parallel
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples; the answer is then incomplete and must be dropped
SampleMask visible_samples(const ScreenShape& shape, const PaintSurface& surface,
                           const ExecutionContext* context = nullptr);

}  // namespace pointwright
