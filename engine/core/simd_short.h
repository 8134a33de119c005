#pragma once
// 16-bit integers in memory, one a lane, for kernel sources (engine/core/simd.h).

#include <cstdint>

#include "engine/core/simd.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

namespace detail {
typedef std::int16_t UnalignedShort __attribute__((vector_size(kWidth * 2), aligned(2), may_alias));
}  // namespace detail

POINTWRIGHT_SIMD_INLINE I load(const std::int16_t* p) {
  return __builtin_convertvector(*reinterpret_cast<const detail::UnalignedShort*>(p), I);
}
/// Pre: every lane fits.
POINTWRIGHT_SIMD_INLINE void store(std::int16_t* p, I v) {
  *reinterpret_cast<detail::UnalignedShort*>(p) = __builtin_convertvector(v, detail::UnalignedShort);
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
