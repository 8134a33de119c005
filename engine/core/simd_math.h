#pragma once
// Sine, cosine and exponential of vectors (engine/core/simd.h): the same bytes on every instruction set.
// Polynomials: interpolation at Chebyshev nodes of the reduced range, coefficients rounded to float.

#include "engine/core/simd.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

struct SinCos {
  F sin;
  F cos;
};

/// Sine and cosine of (quadrant + r / (pi / 2)) quarter turns, r in radians. Errors below 1e-7, 0 at r = 0.
/// Pre: |r| <= pi / 4 (1 + 1e-4)
POINTWRIGHT_SIMD_INLINE SinCos sincos_quadrant(F r, I quadrant) {
  const F z = r * r;
  const F s = r + r * z * (-0.166666641831398F + z * (0.008332747966051102F + z * -0.000195878412341699F));
  const F c = (1.0F - 0.5F * z) +
              z * z * (0.0416666641831398F + z * (-0.001388830249197781F + z * 2.454789137118496e-05F));
  const Mask swapped = (quadrant & 1) != 0;
  const I sin_sign = (quadrant & 2) << 30;
  const I cos_sign = ((quadrant + 1) & 2) << 30;
  return {from_bits(bits(select(swapped, c, s)) ^ sin_sign),
          from_bits(bits(select(swapped, s, c)) ^ cos_sign)};
}

/// Sine and cosine of radians, absolute error at most 2e-7. Pre: |x| <= 640 (100 turns and a little).
POINTWRIGHT_SIMD_INLINE SinCos sincos(F x) {
  const F n = round(x * 0.636619772367581343F);
  // Cody and Waite's reduction: the first two products are exact.
  F r = x - n * 1.5703125F;
  r = r - n * 0.0004837512969970703F;
  r = r - n * 7.549790126404332e-08F;
  return sincos_quadrant(r, to_int(n));
}

/// e^x with relative error at most 2e-7; 0 below -87.3, infinity above 88.7, NaN of NaN.
POINTWRIGHT_SIMD_INLINE F exp(F x) {
  const F clamped = min(max(x, splat(-87.3F)), splat(88.7F));
  const F n = round(clamped * 1.44269504088896341F);
  F r = clamped - n * 0.693115234375F;
  r = r - n * 3.194618329871446e-05F;
  const F e = 0.1666666716337204F +
              r * (0.04166646674275398F +
                   r * (0.00833331048488617F + r * (0.0013933649752289057F + r * 0.00019890991097781807F)));
  const F p = 1.0F + (r + r * r * (0.5F + r * e));
  // 2^n in two factors: n = 128 alone would not fit the exponent.
  const I half = to_int(n) >> 1;
  const I rest = to_int(n) - half;
  const F result = p * from_bits((half + 127) << 23) * from_bits((rest + 127) << 23);
  const F bounded = select(x < -87.3F, F{}, select(x > 88.7F, splat(__builtin_inff()), result));
  return select(x == x, bounded, x);
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
