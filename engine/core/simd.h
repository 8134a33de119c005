#pragma once
// Vectors of the machine's width for kernel sources. Every operation rounds as IEEE 754 says and lanes never
// mix, so a kernel gives the same bytes at every width: no reciprocal estimates, fused operations or libm.
//
// How to write a kernel (see engine/core/simd_dispatch.h for the caller's side):
//   - the source is `x_kernels.inc`; CMake compiles it once per instruction set by pointwright_add_kernels();
//   - it includes this header, <cstddef>, <cstdint> and its own argument structs, nothing else: an inline
//     function of a shared header that is compiled with AVX-512 here may be the copy that the linker keeps
//     for everyone;
//   - everything stands in namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE; arguments are raw pointers to
//     columns padded to kSimdBlock (16) samples; loops run `for (i = begin; i < end; i += kWidth)` between
//     whole blocks;
//   - branches on any()/all() may skip work, never change what a lane computes.

#include <cstddef>
#include <cstdint>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#ifndef POINTWRIGHT_SIMD_NAMESPACE
#define POINTWRIGHT_SIMD_NAMESPACE simd_base
#endif
#define POINTWRIGHT_SIMD_INLINE __attribute__((always_inline)) static inline

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

#if defined(__AVX512F__) && defined(__AVX512DQ__)
inline constexpr std::size_t kWidth = 16;
#elif defined(__AVX2__)
inline constexpr std::size_t kWidth = 8;
#else
inline constexpr std::size_t kWidth = 4;
#endif

/// kWidth floats, and kWidth 32-bit integers. Arithmetic and comparison operators work lane by lane.
typedef float F __attribute__((vector_size(kWidth * 4)));
typedef std::int32_t I __attribute__((vector_size(kWidth * 4)));
/// What a comparison gives: all bits of a lane set (true) or none.
using Mask = I;

namespace detail {
typedef float UnalignedF __attribute__((vector_size(kWidth * 4), aligned(4), may_alias));
typedef std::int32_t UnalignedI __attribute__((vector_size(kWidth * 4), aligned(4), may_alias));
}  // namespace detail

POINTWRIGHT_SIMD_INLINE F load(const float* p) {
  return *reinterpret_cast<const detail::UnalignedF*>(p);
}
POINTWRIGHT_SIMD_INLINE I load(const std::int32_t* p) {
  return *reinterpret_cast<const detail::UnalignedI*>(p);
}
POINTWRIGHT_SIMD_INLINE I load(const std::uint32_t* p) {
  return *reinterpret_cast<const detail::UnalignedI*>(p);
}
POINTWRIGHT_SIMD_INLINE void store(float* p, F v) {
  *reinterpret_cast<detail::UnalignedF*>(p) = v;
}
POINTWRIGHT_SIMD_INLINE void store(std::int32_t* p, I v) {
  *reinterpret_cast<detail::UnalignedI*>(p) = v;
}

POINTWRIGHT_SIMD_INLINE F splat(float v) {
  return F{} + v;
}
POINTWRIGHT_SIMD_INLINE I splat_int(std::int32_t v) {
  return I{} + v;
}
/// 0, 1, 2, ... in the lanes.
POINTWRIGHT_SIMD_INLINE I iota() {
  I v{};
  for (std::size_t lane = 0; lane < kWidth; ++lane) v[lane] = static_cast<std::int32_t>(lane);
  return v;
}

POINTWRIGHT_SIMD_INLINE I bits(F v) {
  return reinterpret_cast<I>(v);
}
POINTWRIGHT_SIMD_INLINE F from_bits(I v) {
  return reinterpret_cast<F>(v);
}
POINTWRIGHT_SIMD_INLINE F to_float(I v) {
  return __builtin_convertvector(v, F);
}
/// Rounds toward zero. Pre: |v| < 2^31.
POINTWRIGHT_SIMD_INLINE I to_int(F v) {
  return __builtin_convertvector(v, I);
}

POINTWRIGHT_SIMD_INLINE F select(Mask m, F a, F b) {
  return m ? a : b;
}
POINTWRIGHT_SIMD_INLINE I select(Mask m, I a, I b) {
  return m ? a : b;
}
/// a < b ? a : b, so b where either is NaN.
POINTWRIGHT_SIMD_INLINE F min(F a, F b) {
  return a < b ? a : b;
}
POINTWRIGHT_SIMD_INLINE F max(F a, F b) {
  return a > b ? a : b;
}
POINTWRIGHT_SIMD_INLINE F abs(F v) {
  return from_bits(bits(v) & 0x7fffffff);
}
/// |magnitude| with the sign bit of `sign`.
POINTWRIGHT_SIMD_INLINE F copysign(F magnitude, F sign) {
  return from_bits((bits(magnitude) & 0x7fffffff) | (bits(sign) & INT32_MIN));
}

POINTWRIGHT_SIMD_INLINE F sqrt(F v) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  // Masked forms: gcc 12 warns of its own header's undefined vector in the plain ones.
  return reinterpret_cast<F>(_mm512_maskz_sqrt_ps(0xffff, reinterpret_cast<__m512>(v)));
#elif defined(__AVX2__)
  return reinterpret_cast<F>(_mm256_sqrt_ps(reinterpret_cast<__m256>(v)));
#elif defined(__x86_64__)
  return reinterpret_cast<F>(_mm_sqrt_ps(reinterpret_cast<__m128>(v)));
#elif defined(__aarch64__)
  return reinterpret_cast<F>(vsqrtq_f32(reinterpret_cast<float32x4_t>(v)));
#else
  F r{};
  for (std::size_t lane = 0; lane < kWidth; ++lane) r[lane] = __builtin_sqrtf(v[lane]);
  return r;
#endif
}

/// base[index[lane]] in every lane. Indices are unsigned: below 2^31.
POINTWRIGHT_SIMD_INLINE F gather(const float* base, I index) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return reinterpret_cast<F>(
      _mm512_mask_i32gather_ps(_mm512_setzero_ps(), 0xffff, reinterpret_cast<__m512i>(index), base, 4));
#elif defined(__AVX2__)
  return reinterpret_cast<F>(_mm256_i32gather_ps(base, reinterpret_cast<__m256i>(index), 4));
#else
  return F{base[index[0]], base[index[1]], base[index[2]], base[index[3]]};
#endif
}

POINTWRIGHT_SIMD_INLINE I gather(const std::int32_t* base, I index) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return reinterpret_cast<I>(
      _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), 0xffff, reinterpret_cast<__m512i>(index), base, 4));
#elif defined(__AVX2__)
  return reinterpret_cast<I>(_mm256_i32gather_epi32(base, reinterpret_cast<__m256i>(index), 4));
#else
  return I{base[index[0]], base[index[1]], base[index[2]], base[index[3]]};
#endif
}

/// The lanes of the mask as bits, lane 0 the lowest.
POINTWRIGHT_SIMD_INLINE std::uint32_t mask_bits(Mask m) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return _mm512_movepi32_mask(reinterpret_cast<__m512i>(m));
#elif defined(__AVX2__)
  return static_cast<std::uint32_t>(_mm256_movemask_ps(reinterpret_cast<__m256>(m)));
#elif defined(__x86_64__)
  return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<__m128>(m)));
#else
  std::uint32_t joined = 0;
  for (std::size_t lane = 0; lane < kWidth; ++lane) joined |= static_cast<std::uint32_t>(m[lane] & 1) << lane;
  return joined;
#endif
}
/// Whether a lane (every lane) of the mask is true.
POINTWRIGHT_SIMD_INLINE bool any(Mask m) {
  return mask_bits(m) != 0;
}
POINTWRIGHT_SIMD_INLINE bool all(Mask m) {
  return mask_bits(~m) == 0;
}

/// mask_bits(a <= b), without the detour over a vector where comparisons give bits.
POINTWRIGHT_SIMD_INLINE std::uint32_t less_equal_bits(F a, F b) {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
  return _mm512_cmp_ps_mask(reinterpret_cast<__m512>(a), reinterpret_cast<__m512>(b), _CMP_LE_OQ);
#else
  return mask_bits(a <= b);
#endif
}

/// The nearest integer, ties to even. Pre: |v| <= 2^22.
POINTWRIGHT_SIMD_INLINE F round(F v) {
  return (v + 12582912.0F) - 12582912.0F;
}
/// Pre: |v| < 2^31.
POINTWRIGHT_SIMD_INLINE F floor(F v) {
  const F t = to_float(to_int(v));
  return select(t > v, t - 1.0F, t);
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
