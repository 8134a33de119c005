#pragma once
// What rules balls of a region out as the nearest of any point of a box, kWidth balls at a time; for kernel
// sources (engine/core/simd.h).
//
// Exactness: a box's gap is computed by the same float operations as a ball's distance, each of them
// monotone, so it never exceeds that distance. Squares are compared with a margin far above their rounding
// and that of the distances. So ruling out loses nothing, not even a tie.

#include <cstdint>

#include "engine/core/simd.h"
#include "engine/editing/region_kernels.h"

namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE {

// No distance up to `best` is missed where squares beyond (best + radius)^2, widened so, are skipped.
template <typename T>
POINTWRIGHT_SIMD_INLINE T squared_reach(T best, T radius) {
  const T reach = (best + radius) * 1.000001F;
  return reach * reach + 1e-37F;
}

// The box of the points that ask, and the largest distance that one of them still has.
struct Query {
  float low[3], high[3];
  float best;
};

POINTWRIGHT_SIMD_INLINE F gap(const float* lower, const float* upper, float low, float high) {
  return max(max(load(lower) - high, low - load(upper)), F{});
}

// A ball a near the middle of a box. It beats a ball b at a point p where |p - b| - |p - a| > more, the
// radius of b less its own; that is |p - b|^2 - |p - a|^2 > more (2 |p - a| + more). The left side is a sum
// over axes, each of them least at an end of the box.
struct Rival {
  float center[3];
  float radius;
  float low_sq[3], high_sq[3];  // of the box's ends from the centre
  float reach;                  // the greatest |p - a| of the box
  float margin;                 // of squares, for rounding; NaN where squares overflow: it beats none
};

POINTWRIGHT_SIMD_INLINE Rival rival_of(const Query& query, float x, float y, float z, float radius) {
  Rival rival{{x, y, z}, radius, {}, {}, 0.0F, 0.0F};
  float squared = 0.0F;
  for (int axis = 0; axis < 3; ++axis) {
    const float low = query.low[axis] - rival.center[axis];
    const float high = query.high[axis] - rival.center[axis];
    rival.low_sq[axis] = low * low;
    rival.high_sq[axis] = high * high;
    squared += low * low > high * high ? low * low : high * high;
  }
  rival.reach = __builtin_sqrtf(squared) * 1.000001F;
  rival.margin = squared < 1e30F ? squared * 1e-5F + 1e-37F : __builtin_nanf("");
  return rival;
}

// Bits of those balls, or nodes, that the rival beats all over the box: `ahead` is the least of
// |p - b|^2 - |p - a|^2 there.
POINTWRIGHT_SIMD_INLINE std::uint32_t beaten(const Rival& rival, F ahead, F radius) {
  const F more = max(radius - rival.radius, F{});
  return less_equal_bits(more * (2.0F * rival.reach + more) * 1.00001F + rival.margin, ahead);
}

// Bits of kWidth balls that may be the nearest of a point of the box, none of them missing.
POINTWRIGHT_SIMD_INLINE std::uint32_t near_balls(const float* const* center, const float* radii,
                                                 const Query& query, const Rival& rival) {
  F gap_sq{}, ahead{};
  for (int axis = 0; axis < 3; ++axis) {
    const F c = load(center[axis]);
    const F low = query.low[axis] - c;
    const F high = query.high[axis] - c;
    const F outside = max(max(low, -high), F{});
    gap_sq = gap_sq + outside * outside;
    ahead = ahead + min(low * low - rival.low_sq[axis], high * high - rival.high_sq[axis]);
  }
  const F radius = load(radii);
  return less_equal_bits(gap_sq, squared_reach(splat(query.best), radius)) & ~beaten(rival, ahead, radius) &
         less_equal_bits(F{}, radius);
}

// The same for kWidth children of a node.
POINTWRIGHT_SIMD_INLINE std::uint32_t near_children(const BallNode& node, std::size_t first,
                                                    const Query& query, const Rival& rival) {
  const float* const lower[3] = {node.min_x + first, node.min_y + first, node.min_z + first};
  const float* const upper[3] = {node.max_x + first, node.max_y + first, node.max_z + first};
  F gap_sq{}, ahead{};
  for (int axis = 0; axis < 3; ++axis) {
    const F below = load(lower[axis]);
    const F above = load(upper[axis]);
    const F low = max(max(below - query.low[axis], query.low[axis] - above), F{});
    const F high = max(max(below - query.high[axis], query.high[axis] - above), F{});
    const F outside = max(max(below - query.high[axis], query.low[axis] - above), F{});
    gap_sq = gap_sq + outside * outside;
    ahead = ahead + min(low * low - rival.low_sq[axis], high * high - rival.high_sq[axis]);
  }
  const F radius = load(node.max_radius + first);
  // A missing child has no number for a radius and is not within any reach.
  return less_equal_bits(gap_sq, squared_reach(splat(query.best), radius)) & ~beaten(rival, ahead, radius);
}

}  // namespace pointwright::POINTWRIGHT_SIMD_NAMESPACE
