#pragma once
// `pointwright smooth` and `pointwright simplify`: §3's operations on whole clouds.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "engine/core/cloud.h"
#include "engine/core/result.h"

namespace pointwright::server {

/// Exactly one of scale and iterations.
struct SmoothOptions {
  std::optional<double> scale;              ///< of the diagonal, in (0, 0.2]: one V-cycle (§3.3)
  std::optional<std::uint32_t> iterations;  ///< umbrella steps (§3.1)
  std::string preserve = "none";            ///< none, local, global; taubin with iterations only
  std::uint32_t neighbors = 10;
};
/// The cloud with its samples smoothed and their normals fitted anew; `report` becomes a line for people.
/// Errors: kInvalidArgument (fields of the options), those of the engine
Result<Cloud> smoothed(const Cloud& cloud, const SmoothOptions& options, std::string& report);

/// Exactly one of count, ratio and error.
struct SimplifyOptions {
  /// quadrics: by pair contraction (§3.2), where the surface needs samples; uniform: evenly spaced input
  /// samples
  std::string method = "quadrics";
  std::optional<std::size_t> count;  ///< samples to keep
  std::optional<double> ratio;       ///< of the samples, in (0, 1]
  /// Of the diagonal: what a sample may be off the planes that it stands for; quadrics only.
  std::optional<double> error;
  std::optional<std::uint32_t> neighbors;  ///< 10 where not given; quadrics only
};
/// The cloud with fewer samples and all its attributes. By quadrics samples move and attributes are blended;
/// what the uniform method keeps is as it was, to the bit.
/// Errors: kInvalidArgument (fields of the options), those of the engine
Result<Cloud> simplified(const Cloud& cloud, const SimplifyOptions& options, std::string& report);

}  // namespace pointwright::server
