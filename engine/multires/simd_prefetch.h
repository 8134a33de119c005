#pragma once
// Asking memory for columns ahead of their use, for kernel sources (engine/core/simd.h). The kernels of an
// edit read more columns at once than the hardware follows, and what it follows it loses at every page.

#include "engine/core/simd.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

/// Blocks of kSimdBlock samples between the one that is worked on and the one that is asked for.
inline constexpr std::size_t kPrefetchAhead = 4;

POINTWRIGHT_SIMD_INLINE void prefetch(const void* p) {
  __builtin_prefetch(p);
}
POINTWRIGHT_SIMD_INLINE void prefetch3(const float* const* columns, std::size_t i) {
  for (int axis = 0; axis < 3; ++axis) prefetch(columns[axis] + i);
}
/// Every cache line of `count` entries.
template <typename T>
POINTWRIGHT_SIMD_INLINE void prefetch_row(const T* row, std::size_t count) {
  for (std::size_t i = 0; i < count; i += 64 / sizeof(T)) prefetch(row + i);
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
