#pragma once
// Builds the multiresolution surface of a cloud: smoothing (§3.1), then decomposition (§3.4), band by band.

#include <cstdint>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/core/result.h"
#include "engine/multires/base_surface.h"
#include "engine/multires/surface.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// Bands that a hierarchy can have.
inline constexpr std::size_t kMaxBands = 8;

struct HierarchyParams {
  /// Smoothing scale of each base level: the standard deviation of the Gaussian that all the smoothing from
  /// the full surface down to that level equals, as a fraction of the bounding-box diagonal, in [0.0001,
  /// 0.2]; one to kMaxBands of them, level 0 first, each at most 0.95 of the one before.
  std::vector<float> scales = {0.02F};
  std::uint32_t neighbors = 10;  ///< k of §2.1, 4 to 32 (the paper: 8 to 12)
  friend bool operator==(const HierarchyParams&, const HierarchyParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault.
Result<void> validate(const HierarchyParams& params);

/// How the damped Newton iteration of one band ended (§3.4).
struct DecompositionReport {
  /// Of the band's base level, model units: the root of the sum of the squares that this band's base and the
  /// finer ones have reached (BaseSurface::scale).
  float scale = 0.0F;
  std::size_t base_samples = 0;  ///< samples of the coarse cloud Q that carries the base surface
  std::size_t at_limit = 0;      ///< samples whose iteration ended at the limit, above the tolerance
  std::size_t fallback = 0;      ///< of those and the flipped: samples that took the fallback plane
  std::size_t flipped = 0;       ///< samples whose base normal opposes their own
  double mean_iterations = 0.0;
  float max_detail = 0.0F;  ///< largest |d|, model units
  float rms_detail = 0.0F;
};

/// Everything of a session that depends on the rest cloud alone.
struct Hierarchy {
  MultiresSurface surface;
  NeighborGraph graph;                       ///< of the rest samples of the finest level; serves all levels
  std::vector<float> spacing;                ///< local sample spacing of the rest surface, model units
  std::vector<DecompositionReport> reports;  ///< one per band
  /// The base surface of each band: what other samplings of the same surface are decomposed against
  /// (engine/transfer). Without samples where all samples of the cloud coincide.
  std::vector<BaseSurface> bases;
  /// Connected components of the neighbour graph, each of which has a side chosen for it; 0 where normals
  /// were uploaded, which choose it.
  std::size_t component_count = 0;
};

/// Level n is the full surface; level k is the base of level k + 1 (§3: the decomposition applied
/// recursively), whose own smoothing is what the scale of level k has beyond that of level k + 1: variances
/// of Gaussians add.
/// Paper:       §3, §3.4; engine/README.md says where it departs
/// Shapes:      N >= 1 samples in coherent order; uploaded normals, where the cloud has them, are kept and
///              say which side is out
/// Errors:      kInvalidArgument, kEmptyCloud, kCancelled
/// Cost:        O(N k log N + n N k); about 90 + 28 n bytes a sample while it runs
/// Determinism: bitwise equal for any thread count
/// Cancels:     between phases and between blocks of samples
Result<Hierarchy> build_hierarchy(const Cloud& cloud, const HierarchyParams& params,
                                  const ExecutionContext& context);

}  // namespace pointwright
