#pragma once
// Arguments of the all-nearest-neighbours kernel (engine/core/simd_dispatch.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// The boxes of one level, a column a side, padded with empty boxes to a whole number of 16.
struct BlockTreeLevel {
  const float* low[3];
  const float* high[3];
};

/// Padded columns of samples, and boxes over them: box b of level l holds the samples [b, b + 1) 16^(l + 1).
struct BlockTreeView {
  const float* x;
  const float* y;
  const float* z;
  std::size_t count;
  const BlockTreeLevel* levels;
  std::uint32_t level_count;  ///< 1 to 8; the last level has at most 16 boxes
};

struct NearestArgs {
  BlockTreeView tree;
  std::uint32_t length;  ///< of the lists, at least 1
  /// Only what is nearer than this is listed; at most the largest float.
  float bound_sq;
};

}  // namespace pointwright

/// Lists the nearest other samples of each sample of [begin, end), by distance, then index; begin is at a
/// whole block. `lanes` takes [block][j][lane] from begin's block on: indices, or -1 past a list's end and in
/// the lanes past the last sample. `scratch` holds 32 length floats, aligned to 64 bytes.
POINTWRIGHT_DECLARE_KERNEL(void nearest_of_all_kernel(const NearestArgs& args, std::size_t begin,
                                                      std::size_t end, std::int32_t* lanes, float* scratch))
