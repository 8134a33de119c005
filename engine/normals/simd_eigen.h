#pragma once
// The smallest eigenvector of symmetric 3x3 matrices, one a lane, for kernel sources (engine/core/simd.h).

#include "engine/core/simd.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

struct Symmetric {
  F xx, yy, zz, xy, xz, yz;
};

struct Direction {
  F x, y, z;
};

namespace eigen_detail {

constexpr float kCollinear = 1e-6F;  // l2 l3 / (l1 + l2 + l3)^2, above the rounding of the cofactors
constexpr float kTiny = 1e-30F;

POINTWRIGHT_SIMD_INLINE Symmetric scaled(const Symmetric& m, F s) {
  return {m.xx * s, m.yy * s, m.zz * s, m.xy * s, m.xz * s, m.yz * s};
}
POINTWRIGHT_SIMD_INLINE F trace(const Symmetric& m) {
  return m.xx + m.yy + m.zz;
}
POINTWRIGHT_SIMD_INLINE F norm_sq(const Symmetric& m) {
  return m.xx * m.xx + m.yy * m.yy + m.zz * m.zz + 2.0F * (m.xy * m.xy + m.xz * m.xz + m.yz * m.yz);
}
POINTWRIGHT_SIMD_INLINE Symmetric normalized(const Symmetric& m) {
  return scaled(m, 1.0F / max(trace(m), splat(kTiny)));
}
POINTWRIGHT_SIMD_INLINE Symmetric adjugate(const Symmetric& m) {
  return {m.yy * m.zz - m.yz * m.yz, m.xx * m.zz - m.xz * m.xz, m.xx * m.yy - m.xy * m.xy,
          m.xz * m.yz - m.xy * m.zz, m.xy * m.yz - m.xz * m.yy, m.xy * m.xz - m.xx * m.yz};
}
POINTWRIGHT_SIMD_INLINE Symmetric squared(const Symmetric& m) {
  return {m.xx * m.xx + m.xy * m.xy + m.xz * m.xz, m.xy * m.xy + m.yy * m.yy + m.yz * m.yz,
          m.xz * m.xz + m.yz * m.yz + m.zz * m.zz, m.xx * m.xy + m.xy * m.yy + m.xz * m.yz,
          m.xx * m.xz + m.xy * m.yz + m.xz * m.zz, m.xy * m.xz + m.yy * m.yz + m.yz * m.zz};
}
POINTWRIGHT_SIMD_INLINE Symmetric selected(Mask mask, const Symmetric& a, const Symmetric& b) {
  return {select(mask, a.xx, b.xx), select(mask, a.yy, b.yy), select(mask, a.zz, b.zz),
          select(mask, a.xy, b.xy), select(mask, a.xz, b.xz), select(mask, a.yz, b.yz)};
}

// A power of `a`, whose trace is 1, whose columns are its dominant eigenvector to float rounding: the 4th, or
// the 16th or 64th where the other eigenvalues want it. The largest eigenvalue is at least a third of the
// trace, so two squarings leave at least 1/81 of it.
POINTWRIGHT_SIMD_INLINE Symmetric dominant_power(const Symmetric& a) {
  // 1 - |a|^2 is twice the share of the other eigenvalues, to first order: 1 % is 1e-8 in the 4th power.
  constexpr float kNearlyOne = 0.98F;
  Symmetric power = squared(squared(a));
  Symmetric last = a;
  for (int more = 0; more < 2; ++more) {
    const Mask settled = norm_sq(last) >= kNearlyOne;
    if (all(settled)) return power;
    last = normalized(power);
    power = selected(settled, power, squared(squared(last)));
  }
  return power;
}

// The column with the largest diagonal element, as a unit vector.
POINTWRIGHT_SIMD_INLINE Direction dominant_column(const Symmetric& m) {
  const Mask first = (m.xx >= m.yy) & (m.xx >= m.zz);
  const Mask second = m.yy >= m.zz;
  Direction v{select(first, m.xx, select(second, m.xy, m.xz)),
              select(first, m.xy, select(second, m.yy, m.yz)),
              select(first, m.xz, select(second, m.yz, m.zz))};
  const F inverse = 1.0F / sqrt(max(v.x * v.x + v.y * v.y + v.z * v.z, splat(kTiny)));
  return {v.x * inverse, v.y * inverse, v.z * inverse};
}

// Some unit vector across `along`: its cross product with the axis that it is farthest from.
POINTWRIGHT_SIMD_INLINE Direction across(const Direction& along) {
  const F ax = abs(along.x);
  const F ay = abs(along.y);
  const F az = abs(along.z);
  const Mask use_x = (ax <= ay) & (ax <= az);
  const Mask use_y = ay <= az;
  const F zero{};
  Direction v{select(use_x, zero, select(use_y, -along.z, along.y)),
              select(use_x, along.z, select(use_y, zero, -along.x)),
              select(use_x, -along.y, select(use_y, along.x, zero))};
  const F length_sq = v.x * v.x + v.y * v.y + v.z * v.z;
  const F inverse = 1.0F / sqrt(max(length_sq, splat(kTiny)));
  const Mask none = length_sq <= kTiny;  // coincident points: no direction at all
  return {v.x * inverse, v.y * inverse, select(none, splat(1.0F), v.z * inverse)};
}

}  // namespace eigen_detail

struct SmallestEigenvector {
  Direction direction;  ///< unit; some vector across the line of a degenerate matrix
  /// The two smallest eigenvalues vanish next to the largest: points on a line, or one point.
  Mask degenerate;
};

/// Of positive semi-definite matrices, Eq. (4): the dominant eigenvector of the adjugate, by repeated
/// squaring.
POINTWRIGHT_SIMD_INLINE SmallestEigenvector smallest_eigenvector(const Symmetric& matrix) {
  const Symmetric m = eigen_detail::normalized(matrix);
  const Symmetric a = eigen_detail::adjugate(m);
  SmallestEigenvector result{
      .direction = eigen_detail::dominant_column(eigen_detail::dominant_power(eigen_detail::normalized(a))),
      .degenerate = ~(eigen_detail::trace(a) >= eigen_detail::kCollinear)};
  if (!any(result.degenerate)) return result;
  const Direction substitute = eigen_detail::across(eigen_detail::dominant_column(m));
  Direction& v = result.direction;
  v = {select(result.degenerate, substitute.x, v.x), select(result.degenerate, substitute.y, v.y),
       select(result.degenerate, substitute.z, v.z)};
  return result;
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
