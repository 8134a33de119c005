#pragma once
// Arguments of the normal estimation kernel (engine/core/simd_dispatch.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Padded columns; `neighbors` has the rows of the first block that the kernel is called for and of those
/// after it, [block][j][lane]. A neighbour that is the sample itself counts for nothing: it fills short rows.
struct NormalKernelArgs {
  const float* x;
  const float* y;
  const float* z;
  const std::uint32_t* neighbors;
  std::uint32_t k;
  float sigma_sq;
  std::size_t count;
  float* normal_x;
  float* normal_y;
  float* normal_z;
};

}  // namespace pointwright

/// Normals of the samples [begin, end), begin at a whole block; returns how many of them are degenerate.
POINTWRIGHT_DECLARE_KERNEL(std::size_t estimate_normals_kernel(const NormalKernelArgs& args,
                                                               std::size_t begin, std::size_t end))
