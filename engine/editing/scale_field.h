#pragma once
// The scale parameter t of §4 (Eq. 12) on every sample, with its gradient.

#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/region.h"

namespace pointwright {

/// Blending functions on [0, 1] with beta(0) = 1, beta(1) = 0 and zero slope at both ends.
enum class Blend {
  kQuartic,  ///< the paper's beta(x) = (x^2 - 1)^2: steepest near the zero-region's side of the middle
  kCubic,    ///< (1 - x)^2 (1 + 2 x): the same both ways
  kQuintic,  ///< (1 - x)^3 (1 + 3 x + 6 x^2): no curvature at the ends either
  kCosine,   ///< (1 + cos(pi x)) / 2
};

/// beta(x) and beta'(x), x in [0, 1].
float blend_value(Blend blend, float x);
float blend_slope(Blend blend, float x);

/// t and its gradient per sample. Both depend on the regions and the surface at rest only: computed once a
/// painting changes, never per frame.
struct ScaleField {
  std::vector<float> t;  ///< N (padded to SIMD blocks with 0), in [0, 1]: 0 in the zero-region, 1 in the one
  Points gradient;       ///< N, in 1 / model unit; 0 inside the regions

  [[nodiscard]] std::size_t size() const { return gradient.size(); }
  friend bool operator==(const ScaleField&, const ScaleField&) = default;
};

/// Paper:       Eq. (11), (12). As printed, Eq. (12) contradicts the text (t would be 1 in the zero-region):
///              t = beta(d_1 / (d_0 + d_1)). See engine/README.md. A point in both regions, which the paper
///              excludes, stays where it is: t = 0.
/// Pre:         both regions non-empty, finite positions
/// Cost:        O(N log M), parallel, vectorised; coherent samples are fast
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between blocks; the field is then incomplete (the caller checks is_cancelled())
ScaleField compute_scale_field(const Points& position, const RegionPair& regions, Blend blend,
                               const ExecutionContext* context = nullptr);

}  // namespace pointwright
