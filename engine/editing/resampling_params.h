#pragma once
// What an edit may ask of dynamic resampling (§5).

#include <cstdint>

#include "engine/core/result.h"

namespace pointwright {

/// Limits of what resampling may be asked for.
inline constexpr double kLeastStretchBound = 1.05;
inline constexpr double kGreatestStretchBound = 16.0;
inline constexpr double kGreatestMinSpacing = 1e9;
inline constexpr std::uint32_t kMaxRelaxationSweeps = 64;
inline constexpr double kGreatestCollectDistance = 0.9;

/// An edit's dynamic resampling. A sample is split along a principal axis of its cell where the axis has
/// grown to `bound` of the sample's own spacing and to `min_spacing`.
struct ResamplingParams {
  double bound = 1.5;        ///< in [1.05, 16], of the spacing that the sample has at rest
  double min_spacing = 0.0;  ///< model units, >= 0: axes shorter than this are not split
  /// Samples that the surface may have afterwards; 0: no limit of the edit's own.
  std::uint32_t max_samples = 0;
  /// Counts a stretch along one axis less where the other axis is squeezed: shear splits less (beyond the
  /// paper).
  bool shear_aware = false;
  std::uint32_t sweeps = 8;  ///< of relaxation, 0 to 64
  /// Garbage collection (§5.3) after the edit: of two samples that are each other's nearest in a squeezed
  /// place, one goes while they are closer than this, in spacings. 0: none is removed. At most 0.9.
  double collect = 0.0;

  friend bool operator==(const ResamplingParams&, const ResamplingParams&) = default;
};

/// Errors: kInvalidArgument, kNonFinite with the field ("resampling.bound" and the like) and its limit.
Result<void> validate(const ResamplingParams& params);

}  // namespace pointwright
