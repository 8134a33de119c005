#pragma once
// The smooth base Q of a band (§3.1, §3.4): a coarse, even cloud in a canonical grid, smoothed to a scale.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/spatial/kd_tree.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Neighbours that a moving least-squares plane is fitted to, and those cached to walk among.
inline constexpr std::uint32_t kPlaneNeighbors = 16;
inline constexpr std::uint32_t kCachedNeighbors = 24;

/// Q: M smoothed samples that define a degree-1 moving least-squares surface.
struct BaseSurface {
  Points position;
  Points normal;        ///< unit, on the side of the samples they stand for
  NeighborGraph graph;  ///< kCachedNeighbors neighbours on the same side; short rows repeat the sample
  std::vector<std::uint32_t> counterpart;  ///< per sample of P: the sample of Q that stands for it
  /// Smoothing scale of the whole that was reached, model units: the root of what grid, umbrella and
  /// least-squares planes have as variance. Less than was asked for where Q has too few samples to be
  /// smoothed further or lies in clusters that 200 iterations do not join, more where the planes alone, over
  /// kPlaneNeighbors sparse samples, smooth more.
  float scale = 0.0F;
  std::uint32_t iterations = 0;  ///< umbrella iterations spent
};

/// One sample of Q for each cell of a grid with fixed origin in model space and cell 0.7 scale (two where
/// opposite sheets share a cell; slivers that the cells' borders cut off joined to their neighbours), at the
/// centroid; then umbrella smoothing along the normals until grid,
/// umbrella and moving least squares together amount to a Gaussian of standard deviation `scale`. The grid is
/// what makes a base mean the same on a preview and on the full scan, keeps it even (no samples pile up under
/// smoothing), and makes the cost independent of the scale.
/// Shapes:      N samples with unit normals, consistently oriented; M <= 2 N
/// Pre:         scale > 0
/// Errors:      kCancelled
/// Cost:        O(N) sort and O(M k) an iteration, about 5 of them and at most 200
/// Determinism: bitwise equal for any thread count
Result<BaseSurface> build_base_surface(const Points& position, const Points& normal, const Vec3d& origin,
                                       float scale, const ExecutionContext& context);

}  // namespace pointwright
