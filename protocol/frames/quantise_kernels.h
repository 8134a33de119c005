#pragma once
// The inner loops of the encoder, compiled once per instruction set (engine/core/simd_dispatch.h). Every
// result is a pure function of its own lane, in IEEE single precision without fused operations: the same bits
// on every machine. All counts are rounded up to whole SIMD blocks: columns are padded, `end` is a multiple
// of kSimdBlock.

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright::protocol {

/// One axis of a quantisation box: q = (p - minimum) * scale, with scale = 65535 / extent (0 where flat).
struct QuantiseAxis {
  float minimum = 0.0F;
  float extent = 0.0F;
  float scale = 0.0F;
};

/// dst[i] = src[i * stride]
struct GatherArgs {
  const float* src;
  std::size_t stride;
  float* dst;
};

/// Least and greatest of values[begin, end), one per axis; not empty.
struct RangeArgs {
  const float* values[3];
  float* minimum;
  float* maximum;
};

/// words[2 i] = x | y << 16, words[2 i + 1] = z | t << 16, each to nearest of 0..65535.
struct PositionArgs {
  QuantiseAxis axes[3];
  const float* position[3];
  const float* t;
  std::uint32_t* words;
};

/// words[i] = u | v << 16 of the octahedral map, snorm. A zero vector becomes (0, 0), which decodes to +z.
struct NormalArgs {
  const float* normal[3];
  std::uint32_t* words;
};

/// words[i] = snorm(detail * detail_scale) | unorm(stretch * stretch_scale) << 16, clamped.
struct DetailArgs {
  const float* detail;
  const float* stretch;
  float detail_scale;
  float stretch_scale;
  std::uint32_t* words;
};

}  // namespace pointwright::protocol

POINTWRIGHT_DECLARE_KERNEL(void frame_gather(const protocol::GatherArgs& args, std::size_t begin,
                                             std::size_t end))
POINTWRIGHT_DECLARE_KERNEL(void frame_range(const protocol::RangeArgs& args, std::size_t begin,
                                            std::size_t end))
POINTWRIGHT_DECLARE_KERNEL(void frame_positions(const protocol::PositionArgs& args, std::size_t begin,
                                                std::size_t end))
POINTWRIGHT_DECLARE_KERNEL(void frame_normals(const protocol::NormalArgs& args, std::size_t begin,
                                              std::size_t end))
POINTWRIGHT_DECLARE_KERNEL(void frame_detail(const protocol::DetailArgs& args, std::size_t begin,
                                             std::size_t end))
