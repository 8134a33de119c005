#pragma once
// Arguments of the kernel that weighs the edges of a neighbour graph (engine/core/simd_dispatch.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Padded columns; `neighbors` is the blocked graph, [block][j][lane].
struct EdgeWeightArgs {
  const float* x;
  const float* y;
  const float* z;
  const float* normal_x;
  const float* normal_y;
  const float* normal_z;
  const std::uint32_t* neighbors;
  std::uint32_t k;
};

/// The edges of a region of samples, as edge_weights_kernel gave them, and room for its lists.
struct RegionEdgesArgs {
  const std::uint32_t* neighbors;  ///< the blocked graph
  const std::int32_t* packed;      ///< from the region's first block on
  std::int32_t* lists;             ///< room for 16 ceil(k / 16) numbers a sample; best aligned to 64 bytes
  std::uint32_t k;
};

}  // namespace pointwright

/// The edges of the samples [begin, end), both at whole blocks: `edges` takes [block][j][lane] from begin's
/// block on, twice the weight (0 to 2,047) plus 1 where the sides are opposed.
POINTWRIGHT_DECLARE_KERNEL(void edge_weights_kernel(const EdgeWeightArgs& args, std::size_t begin,
                                                    std::size_t end, std::int32_t* edges))

/// Those edges of the region [begin, end) that have both ends in it, each once, ordered by sample, then
/// neighbour: weight, first end and second end in 16 bits each (ends count from `begin`), and the side in the
/// lowest bit. Returns how many; `edges` has room for k a sample and one more.
POINTWRIGHT_DECLARE_KERNEL(std::size_t region_edges_kernel(const RegionEdgesArgs& args, std::size_t begin,
                                                           std::size_t end, std::uint64_t* edges))
