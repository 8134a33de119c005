#pragma once
// Uniform subsets for previews: some of the samples, as evenly spread over the surface as can be.

#include <cstdint>
#include <variant>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/simplification/simplification.h"

namespace pointwright {

struct SubsampleParams {
  std::variant<KeepCount, KeepRatio> target = KeepRatio{0.5};
  friend bool operator==(const SubsampleParams&, const SubsampleParams&) = default;
};

/// Errors: kInvalidArgument with the field at fault.
Result<void> validate(const SubsampleParams& params);

/// A blue-noise subset: exactly as many samples as asked for, evenly spaced wherever the input is dense
/// enough, however uneven it is. In two steps:
/// - One sample by chance for each cell, and each side in it, of a grid that is just fine enough to give five
///   candidates for each that is wanted; a bit of the Morton code more makes a finer grid. Where the input
///   has not as many, all of it.
/// - Of these the most crowded go, one after the other, until as many are left as asked for
///   (sample_elimination.h). From five candidates the nearest two are 0.7 of a hexagonal pattern's distance
///   apart; from all of 20 they would hardly be more, at four times the cost and more.
/// On the surface: samples whose normals oppose, n_i . n_j < 0, do not push each other away, so both sheets
/// of a thin part keep their share. Without normals distances in space alone count. Beyond the paper, whose
/// previews are simplified ones (§6).
/// Shapes:      N samples, N unit normals or none; the chosen ones' indices, ascending, so coherent order
///              stays. Exact duplicates are chosen only when nothing else is left
/// Pre:         finite coordinates within 1e9; coherent order, or the result is less even and late
/// Errors:      kInvalidArgument, kTooLarge (2^31 samples), kCancelled
/// Cost:        O(N + k min(N, 8 M)) for M wanted, k = 24; parallel; 14 bytes a sample, 450 for each of the
///              min(N, 8 M)
/// Determinism: bitwise equal for any thread count and instruction set
/// Cancels:     between blocks of samples
Result<std::vector<std::uint32_t>> subsample(const Points& position, const Points& normal,
                                             const SubsampleParams& params,
                                             const ExecutionContext* context = nullptr);

}  // namespace pointwright
