#pragma once
// Which samples split, into how many, and where their children are born (§5.1).

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/result.h"
#include "engine/editing/resampling_params.h"
#include "engine/editing/scale_field.h"
#include "engine/multires/sampling.h"
#include "engine/resampling/cells.h"
#include "engine/resampling/rest_patch.h"

namespace pointwright {

/// Into how many one sample splits at most in one edit: where the regions nearly touch the gradient of t, and
/// with it the stretch, has no limit.
inline constexpr std::uint32_t kMostParts = 64;

/// A sample that splits into major * minor parts. It stays where it is and is one of them; its children are
/// first_child .. first_child + major * minor - 2 of all that are inserted.
struct Split {
  std::uint32_t sample = 0;
  std::uint32_t major = 1;  ///< along the major principal axis
  std::uint32_t minor = 1;  ///< across it
  std::uint32_t first_child = 0;

  [[nodiscard]] std::uint32_t children() const { return major * minor - 1; }
};

struct Splits {
  std::vector<Split> splits;  ///< by ascending sample
  std::size_t inserted = 0;
};

/// The spacing asked for: lengths are divided into as many parts as come nearest to it.
/// `coarser` >= 1: how many times wider than the parameters say.
float wanted_spacing(float spacing, const ResamplingParams& params, float coarser = 1.0F);

/// Counts without inserting anything. A sample splits along a principal axis where that is at least 1.5
/// times the spacing wanted; those with t = 0 never do, nor those without a cell.
/// Shapes:      `mapped` of the sampling's samples; `blocks`: those that may move, ascending
/// Errors:      kTooLarge (field "resampling.max_samples") where more would be inserted than
///              params.max_samples leaves room for
/// Cost:        O(N), parallel
/// Determinism: bitwise equal for any thread count
Result<Splits> find_splits(const Sampling& sampling, const Cells& mapped, const ScaleField& field,
                           const std::vector<std::uint32_t>& blocks, const ResamplingParams& params,
                           float coarser = 1.0F);

/// Inserted samples: where they stand on their parents' patches at rest. C entries.
struct Births {
  std::vector<std::uint32_t> split;  ///< index into Splits::splits
  std::vector<float> x, y;           ///< in the frame of the parent's patch, model units
};

/// Children on a lattice of the rest cell's principal axes, the parent at its middle.
/// Pre:  patches of all samples that split
/// Cost: O(C), parallel
Births give_birth(const Splits& splits, const RestPatches& patches, const Sampling& sampling,
                  const Cells& rest, const Cells& mapped, const ScaleField& field);

/// The area of a sample's cell at rest over its tangent plane, model units squared.
float rest_area(const Vec3f& u, const Vec3f& v, float spacing);

}  // namespace pointwright
