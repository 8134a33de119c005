#pragma once
// The scale parameter t of §4 (Eq. 12) on every sample, with its gradient.

#include <string_view>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/editing/region.h"

namespace pointwright {

/// Blending functions on [0, 1] with beta(0) = 1, beta(1) = 0 and zero slope at both ends.
enum class Blend {
  kQuartic,  ///< the paper's beta(x) = (x^2 - 1)^2
};

float blend_value(Blend blend, float x);
float blend_slope(Blend blend, float x);

/// t and its gradient per sample. Both depend on the regions and the surface at rest only: computed once a painting
/// changes, never per frame.
struct ScaleField {
  std::vector<float> t;   ///< N (padded to whole SIMD blocks with 0), in [0, 1]: 0 in the zero-region, 1 in the one-region
  Points gradient;        ///< N, in 1 / model unit; 0 inside the regions
};

/// Paper:       Eq. (11), (12). As printed, Eq. (12) contradicts the text (it gives t = 1 in the zero-region):
///              t = beta(d_1 / (d_0 + d_1)). See engine/README.md.
/// Pre:         both regions non-empty
/// Cost:        O(N log M), parallel
/// Determinism: bitwise equal for any thread count
ScaleField compute_scale_field(const Points& position, const RegionPair& regions, Blend blend,
                               const ExecutionContext* context = nullptr);

}  // namespace pointwright
