#pragma once
// Distance queries against a tree of balls (engine/editing/region.h): sixteen coherent points at a time, or
// one.

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Balls of a leaf and children of an inner node.
inline constexpr std::uint32_t kBallFanout = 16;
/// Enough for 2^29 balls.
inline constexpr std::uint32_t kBallTreeMaxLevels = 8;

/// Sixteen balls; a missing one has the radius -infinity and the largest id.
struct BallLeaf {
  float x[kBallFanout], y[kBallFanout], z[kBallFanout], radius[kBallFanout];
  std::int32_t id[kBallFanout];  ///< index in the caller's order
};

/// The bounds of sixteen children: boxes of the centres and the largest radii. A missing child has a NaN
/// radius.
struct BallNode {
  float min_x[kBallFanout], min_y[kBallFanout], min_z[kBallFanout];
  float max_x[kBallFanout], max_y[kBallFanout], max_z[kBallFanout];
  float max_radius[kBallFanout];
};

/// An implicit tree: node j of level 0 bounds the leaves [16 j, 16 j + 16), node j of level l + 1 the nodes
/// [16 j, 16 j + 16) of level l. The top level has one node.
struct BallTreeView {
  const BallLeaf* leaf;
  const BallNode* node;
  std::uint32_t leaf_count;
  std::uint32_t level_count;
  std::uint32_t level_begin[kBallTreeMaxLevels];  ///< first node of each level
};

/// Columns of whole SIMD blocks; results of point i go to entry i.
struct BallQueries {
  const float* x;
  const float* y;
  const float* z;
  const float* limit;  ///< per point: farther is as good as this; null for no limits
  float* distance;
  float* gradient_x;
  float* gradient_y;
  float* gradient_z;
};

}  // namespace pointwright

/// Distances and gradients of the points [0, count), count a multiple of 16, by region.h's definition.
POINTWRIGHT_DECLARE_KERNEL(void query_balls(const BallTreeView& tree, const BallQueries& queries,
                                            std::size_t count))
/// The same for one point: distance, then gradient, into `result`. `hint` is a leaf: in, a guess; out, the
/// nearest's.
POINTWRIGHT_DECLARE_KERNEL(void query_ball(const BallTreeView& tree, const float* point, std::uint32_t& hint,
                                           float* result))
