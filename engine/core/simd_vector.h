#pragma once
// 3-vectors of vectors, one 3-vector a lane, for kernel sources (engine/core/simd.h).

#include "engine/core/simd.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

struct V3 {
  F x, y, z;
};

POINTWRIGHT_SIMD_INLINE V3 load3(const float* const* columns, std::size_t i) {
  return {load(columns[0] + i), load(columns[1] + i), load(columns[2] + i)};
}
POINTWRIGHT_SIMD_INLINE void store3(float* const* columns, std::size_t i, const V3& v) {
  store(columns[0] + i, v.x);
  store(columns[1] + i, v.y);
  store(columns[2] + i, v.z);
}
POINTWRIGHT_SIMD_INLINE V3 gather3(const float* const* columns, I index) {
  return {gather(columns[0], index), gather(columns[1], index), gather(columns[2], index)};
}
POINTWRIGHT_SIMD_INLINE V3 splat3(const float* v) {
  return {splat(v[0]), splat(v[1]), splat(v[2])};
}
POINTWRIGHT_SIMD_INLINE V3 operator+(const V3& a, const V3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
POINTWRIGHT_SIMD_INLINE V3 operator-(const V3& a, const V3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
POINTWRIGHT_SIMD_INLINE V3 operator*(F s, const V3& a) {
  return {s * a.x, s * a.y, s * a.z};
}
POINTWRIGHT_SIMD_INLINE F dot(const V3& a, const V3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
POINTWRIGHT_SIMD_INLINE V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
POINTWRIGHT_SIMD_INLINE V3 select3(Mask m, const V3& a, const V3& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
POINTWRIGHT_SIMD_INLINE Mask equal(const V3& a, const V3& b) {
  return (a.x == b.x) & (a.y == b.y) & (a.z == b.z);
}
POINTWRIGHT_SIMD_INLINE F largest(const V3& a) {
  return max(max(abs(a.x), abs(a.y)), abs(a.z));
}
/// a / |a|; small where a is 0.
POINTWRIGHT_SIMD_INLINE V3 unit(const V3& a) {
  return (1.0F / sqrt(max(dot(a, a), splat(1e-30F)))) * a;
}

/// u, v with u x v = n (Duff et al., "Building an orthonormal basis, revisited", 2017).
struct Frame {
  V3 u, v;
};
POINTWRIGHT_SIMD_INLINE Frame frame_of(const V3& n) {
  const F sign = copysign(splat(1.0F), n.z);
  const F a = -1.0F / (sign + n.z);
  const F b = n.x * n.y * a;
  return {{1.0F + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}};
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
