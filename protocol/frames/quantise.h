#pragma once
// The inner loops of the encoder: a strided gather, and quantisation of whole SIMD blocks. Every result is a
// pure function of its own lane, in IEEE single precision without fused operations: the same bits on every
// machine.

#include <cstddef>
#include <cstdint>

namespace pointwright::protocol {

/// Lanes that the encoder handles at a time; a multiple of kSimdBlock.
inline constexpr std::size_t kQuantiseChunk = 512;

/// dst[i] = src[i * stride] for i < count, then dst repeats the last value up to a whole SIMD block.
/// Pre: count >= 1; dst holds padded_to_block(count).
void gather_floats(const float* src, std::size_t stride, std::size_t count, float* dst);

/// Least and greatest of padded_to_block(count) values.
void minimum_and_maximum(const float* values, std::size_t count, float& minimum, float& maximum);

/// The three axes of a quantisation box: q = (p - minimum) * scale, with scale = 65535 / extent (0 where
/// flat).
struct QuantiseAxis {
  float minimum = 0.0F;
  float extent = 0.0F;
  float scale = 0.0F;
};
QuantiseAxis quantise_axis(float minimum, float maximum);

/// words[2 i] = qx | qy << 16, words[2 i + 1] = qz | qt << 16, rounded to nearest. Pre: t in [0, 1] or
/// clamped to it.
void quantise_positions(const QuantiseAxis (&axes)[3], const float* x, const float* y, const float* z,
                        const float* t, std::size_t count, std::uint32_t* words);

/// words[i] = u | v << 16 of the octahedral map. A zero vector becomes (0, 0), which decodes to +z.
void quantise_normals(const float* x, const float* y, const float* z, std::size_t count,
                      std::uint32_t* words);

/// words[i] = snorm(detail / detail_range) | unorm(stretch / stretch_range) << 16, clamped; a range of 0
/// gives 0.
void quantise_detail(const float* detail, const float* stretch, float detail_range, float stretch_range,
                     std::size_t count, std::uint32_t* words);

}  // namespace pointwright::protocol
