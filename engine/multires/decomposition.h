#pragma once
// Base points on the degree-1 moving least-squares surface by damped Newton iteration (§3.4).

#include <cstdint>
#include <span>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/multires/base_surface.h"

namespace pointwright {

/// p = base + detail * normal for every sample.
struct Decomposition {
  Points base;                ///< r
  Points normal;              ///< n, unit, normal of the base surface at r, on the side of the base's samples
  std::vector<float> detail;  ///< d, model units, signed along n
  std::size_t at_limit = 0;   ///< iterations that ended at the limit, above the tolerance
  std::size_t fallback = 0;   ///< samples that took the plane of their counterpart instead
  std::size_t flipped = 0;    ///< samples whose base normal opposes their own normal
  double mean_iterations = 0.0;
};

/// Where the iteration of a sample starts.
enum class IterationStart {
  kCounterpart,  ///< the sample of Q that stands for it
  kNearest,      ///< the nearest sample of Q, as §3.4 has it: on thin parts it may be another sheet's
};

/// How much of a Newton step is taken.
enum class Damping {
  kAdaptive,  ///< all of it, less where steps stop shrinking, at least a quarter
  kFixed,     ///< a half, as §3.4 has it
};

/// What weighs the samples of Q in a plane's fit; d is a sample's distance, r that of the first sample beyond
/// the nearest kPlaneNeighbors.
enum class PlaneWeights {
  kCompact,   ///< (1 - d^2/r^2)^4: vanishes where the neighbour set changes
  kGaussian,  ///< exp(-d^2 / (sigma r)^2) of Eq. 3: steps over such changes, so some iterations never end
};

/// The defaults are what converges best; the paper's own ways are there to be compared with.
struct DecomposeParams {
  IterationStart start = IterationStart::kCounterpart;
  Damping damping = Damping::kAdaptive;
  PlaneWeights weights = PlaneWeights::kCompact;
  float sigma = 0.5F;  ///< of kGaussian, in (0, 100]
  /// Converged where a step moves less than this times the median sample spacing.
  float tolerance_spacing = 1e-3F;
  std::uint32_t walk_limit = 30;  ///< Newton steps over the cached graph before the tree takes over
  std::uint32_t tree_limit = 50;  ///< Newton steps with exact neighbours and half steps
  friend bool operator==(const DecomposeParams&, const DecomposeParams&) = default;
};

/// For every p the point r of the moving least-squares surface of Q with p - r normal to it. Each step fits
/// the weighted plane to the samples of Q around the current estimate, weights (1 - d^2/r_k^2)^4 that vanish
/// where the neighbour set changes, and projects p onto it; steps are damped adaptively, the last one is not
/// damped, so p = r + d n holds by construction. The start is p's own counterpart, not the nearest sample of
/// Q, which may lie on another sheet. Where no base point is found (limit reached with a residual above 0.05
/// spacings, a flipped normal, |d| beyond four scales) the plane through the counterpart with its normal
/// stands in, and is counted.
/// Shapes:      N samples with unit normals; spacing > 0 is their median spacing
/// Errors:      kInvalidArgument (sigma), kCancelled
/// Cost:        O(N iterations k); about 2.5 iterations a sample
/// Determinism: bitwise equal for any thread count
/// Cancels:     between blocks of samples
Result<Decomposition> decompose(const Points& position, const Points& normal, const BaseSurface& base,
                                float spacing, const DecomposeParams& params,
                                const ExecutionContext& context);

/// The same of samples that the base was not made of: `counterpart` names a sample of Q near each one, on its
/// side.
Result<Decomposition> decompose(const Points& position, const Points& normal, const BaseSurface& base,
                                std::span<const std::uint32_t> counterpart, float spacing,
                                const DecomposeParams& params, const ExecutionContext& context);

}  // namespace pointwright
