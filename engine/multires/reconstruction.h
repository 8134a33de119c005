#pragma once
// From a level back to the full surface (§3, Eq. 5): after the level was changed, or with gains on the bands.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "engine/multires/surface.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Of a band's detail, either way.
inline constexpr float kGreatestGain = 16.0F;

/// Where the normals of rebuilt levels come from.
enum class RebuiltNormals {
  /// Each rest normal is carried by how its neighbourhood has moved: a linear gradient stencil over the rest
  /// neighbours gives the two tangents, two tilts put the rest normal back exactly. Carries turns, spins and
  /// shear; has no sign to choose. Where the neighbours lie on a line the smallest rotation that the next
  /// coarser level's normal has made stands in.
  kCarried,
  /// Covariance normals of the moved samples on the sides of the rest ones, as the paper has it: they differ
  /// from the rest normals even where nothing moved, so the identity is lost by a few per cent of the detail.
  kReestimated,
};

struct ReconstructParams {
  std::uint32_t level = 0;  ///< stays as it is given; the finer ones are rebuilt
  /// What multiplies the detail of band k, the one between levels k and k + 1; n of them, of which those
  /// below `level` do not count, each within [-16, 16]. Empty: 1 everywhere.
  std::vector<float> gains;
  RebuiltNormals normals = RebuiltNormals::kCarried;
  friend bool operator==(const ReconstructParams&, const ReconstructParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault (level, gains).
Result<void> validate(const ReconstructParams& params, const MultiresSurface& surface);

/// Rebuilds the levels finer than params.level of `surface`, whose samples on that level now stand as `moved`
/// says: p'_{k+1} = p_{k+1} + (p'_k - p_k) + d_k (g_k n'_k - n_k), which is Eq. (5) written so that an
/// unmoved sample with gain 1 keeps its bits. The result's detail is that of the new surface: g_k d_k.
/// Paper:       §3, Eq. 5; gains and carried normals are beyond it
/// Shapes:      the surface's N samples; `graph` of its finest level's rest samples
/// Errors:      kInvalidArgument, kCancelled
/// Promises:    the identity to the bit with kCarried and gains 1; a rigid motion of the level moves all of
///              it rigidly, to 1e-6 of the diagonal
/// Cost:        O(N k) a level, vectorised, parallel
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between levels and blocks of samples
Result<MultiresSurface> reconstruct(const MultiresSurface& surface, const NeighborGraph& graph,
                                    const Level& moved, const ReconstructParams& params,
                                    const ExecutionContext* context = nullptr);

}  // namespace pointwright
