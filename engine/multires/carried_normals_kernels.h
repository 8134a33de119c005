#pragma once
// Arguments of the kernel that carries normals along (engine/multires/reconstruction.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Padded columns; `neighbors` is the blocked graph, [block][j][lane].
struct CarryKernelArgs {
  const float* rest_position[3];
  const float* rest_normal[3];
  const float* position[3];
  const float* rest_base_normal[3];  ///< of the next coarser level
  const float* base_normal[3];       ///< the same as it is now
  const std::uint32_t* neighbors;
  std::uint32_t k;
  float* normal[3];
};

}  // namespace pointwright

/// Normals of the samples [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void carry_normals(const CarryKernelArgs& args, std::size_t begin,
                                              std::size_t end))
