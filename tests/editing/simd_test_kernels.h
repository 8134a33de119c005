#pragma once
// Every vector operation on arrays, so that tests can compare values and bytes across instruction sets.

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

struct SimdProbe {
  const float* a = nullptr;
  const float* b = nullptr;
  const std::uint32_t* index = nullptr;  ///< into a, and into itself
  float* out = nullptr;                  ///< kSimdProbeColumns columns of `count`
  std::size_t count = 0;                 ///< a multiple of 16
};
inline constexpr std::size_t kSimdProbeColumns = 18;

}  // namespace pointwright

POINTWRIGHT_DECLARE_KERNEL(void probe_simd(const SimdProbe& probe))
