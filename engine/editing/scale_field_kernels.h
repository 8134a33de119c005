#pragma once
// Blending two region distances into t (engine/editing/scale_field.h).

#include <cstddef>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Distance and gradient columns of a region.
struct DistanceColumns {
  const float* distance;
  const float* gradient_x;
  const float* gradient_y;
  const float* gradient_z;
};

struct ScaleBlend {
  DistanceColumns zero;
  DistanceColumns one;
  float* t;
  float* gradient_x;
  float* gradient_y;
  float* gradient_z;
};

}  // namespace pointwright

/// t and grad t of entries [0, count), count a multiple of 16, with each of the blends.
POINTWRIGHT_DECLARE_KERNEL(void blend_quartic(const ScaleBlend& columns, std::size_t count))
POINTWRIGHT_DECLARE_KERNEL(void blend_cubic(const ScaleBlend& columns, std::size_t count))
POINTWRIGHT_DECLARE_KERNEL(void blend_quintic(const ScaleBlend& columns, std::size_t count))
POINTWRIGHT_DECLARE_KERNEL(void blend_cosine(const ScaleBlend& columns, std::size_t count))
