#include "protocol/frames/quantise.h"

#include <algorithm>

#include "engine/core/points.h"

namespace pointwright::protocol {
namespace {

template <std::size_t kStride>
void gather_fixed(const float* src, std::size_t count, float* dst) {
  for (std::size_t i = 0; i < count; ++i) dst[i] = src[i * kStride];
}

// Comparisons in this order are single min and max instructions, and turn NaN into the bound.
inline float clamp_low(float value, float low) {
  return value > low ? value : low;
}
inline float clamp_high(float value, float high) {
  return value < high ? value : high;
}
inline float absolute(float value) {
  return value < 0.0F ? -value : value;
}

/// To nearest, halves up. Pre: 0 <= value < 2^22.
inline std::int32_t round_unsigned(float value) {
  return static_cast<std::int32_t>(value + 0.5F);
}
/// To nearest, halves away from zero. Pre: |value| < 2^22.
inline std::int32_t round_signed(float value) {
  return static_cast<std::int32_t>(value + (value < 0.0F ? -0.5F : 0.5F));
}

inline std::uint32_t pack(std::int32_t low, std::int32_t high) {
  return (static_cast<std::uint32_t>(low) & 0xFFFFU) | (static_cast<std::uint32_t>(high) << 16);
}

}  // namespace

void gather_floats(const float* src, std::size_t stride, std::size_t count, float* dst) {
  switch (stride) {  // the strides that hold three quarters of the samples vectorise
    case 1:
      gather_fixed<1>(src, count, dst);
      break;
    case 2:
      gather_fixed<2>(src, count, dst);
      break;
    case 4:
      gather_fixed<4>(src, count, dst);
      break;
    default:
      for (std::size_t i = 0; i < count; ++i) dst[i] = src[i * stride];
  }
  std::fill(dst + count, dst + padded_to_block(count), dst[count - 1]);
}

void minimum_and_maximum(const float* values, std::size_t count, float& minimum, float& maximum) {
  float low[kSimdBlock];
  float high[kSimdBlock];
  std::copy_n(values, kSimdBlock, low);
  std::copy_n(values, kSimdBlock, high);
  for (std::size_t i = kSimdBlock; i < padded_to_block(count); i += kSimdBlock) {
    for (std::size_t j = 0; j < kSimdBlock; ++j) {
      const float value = values[i + j];
      low[j] = value < low[j] ? value : low[j];
      high[j] = value > high[j] ? value : high[j];
    }
  }
  minimum = *std::min_element(low, low + kSimdBlock);
  maximum = *std::max_element(high, high + kSimdBlock);
}

QuantiseAxis quantise_axis(float minimum, float maximum) {
  // Below this, 65535 / extent overflows; such a box is flat for every purpose.
  constexpr float kFlat = 1e-30F;
  const float extent = maximum - minimum;
  if (!(extent > kFlat)) return {.minimum = minimum, .extent = 0.0F, .scale = 0.0F};
  return {.minimum = minimum, .extent = extent, .scale = 65535.0F / extent};
}

void quantise_positions(const QuantiseAxis (&axes)[3], const float* x, const float* y, const float* z,
                        const float* t, std::size_t count, std::uint32_t* words) {
  const auto unorm = [](float value) { return round_unsigned(clamp_high(clamp_low(value, 0.0F), 65535.0F)); };
  const QuantiseAxis ax = axes[0];
  const QuantiseAxis ay = axes[1];
  const QuantiseAxis az = axes[2];
  for (std::size_t i = 0; i < padded_to_block(count); ++i) {
    const std::int32_t qx = unorm((x[i] - ax.minimum) * ax.scale);
    const std::int32_t qy = unorm((y[i] - ay.minimum) * ay.scale);
    const std::int32_t qz = unorm((z[i] - az.minimum) * az.scale);
    const std::int32_t qt = unorm(t[i] * 65535.0F);
    words[2 * i] = pack(qx, qy);
    words[2 * i + 1] = pack(qz, qt);
  }
}

void quantise_normals(const float* x, const float* y, const float* z, std::size_t count,
                      std::uint32_t* words) {
  const auto snorm = [](float value) {
    return round_signed(clamp_high(clamp_low(value * 32767.0F, -32767.0F), 32767.0F));
  };
  for (std::size_t i = 0; i < padded_to_block(count); ++i) {
    const float norm = absolute(x[i]) + absolute(y[i]) + absolute(z[i]);
    const float inverse = 1.0F / clamp_low(norm, 1e-30F);
    const float u = x[i] * inverse;
    const float v = y[i] * inverse;
    // The lower half folds over the diagonals of the square; both are computed, one is chosen.
    const float folded_u = u < 0.0F ? absolute(v) - 1.0F : 1.0F - absolute(v);
    const float folded_v = v < 0.0F ? absolute(u) - 1.0F : 1.0F - absolute(u);
    words[i] = pack(snorm(z[i] < 0.0F ? folded_u : u), snorm(z[i] < 0.0F ? folded_v : v));
  }
}

void quantise_detail(const float* detail, const float* stretch, float detail_range, float stretch_range,
                     std::size_t count, std::uint32_t* words) {
  const float detail_scale = detail_range > 0.0F ? 1.0F / detail_range : 0.0F;
  const float stretch_scale = stretch_range > 0.0F ? 1.0F / stretch_range : 0.0F;
  for (std::size_t i = 0; i < padded_to_block(count); ++i) {
    const float d = clamp_high(clamp_low(detail[i] * detail_scale, -1.0F), 1.0F);
    const float s = clamp_high(clamp_low(stretch[i] * stretch_scale, 0.0F), 1.0F);
    words[i] = pack(round_signed(d * 32767.0F), round_unsigned(s * 65535.0F));
  }
}

}  // namespace pointwright::protocol
