#pragma once
// Distance queries of sixteen coherent points at a time against a tree of balls (engine/editing/region.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Balls per leaf and children per inner node of the implicit tree.
inline constexpr std::uint32_t kBallsPerLeaf = 8;
inline constexpr std::uint32_t kBallTreeFanout = 4;
/// Enough for 2^29 balls.
inline constexpr std::uint32_t kBallTreeMaxLevels = 16;

struct Ball {
  float x, y, z, radius;
};

/// Bounds of a run of balls: the box of the centres and the largest radius.
struct BallNode {
  float min_x, min_y, min_z, max_radius;
  float max_x, max_y, max_z, unused;
};

/// The tree: leaf j (level 0) holds balls [j * kBallsPerLeaf, ...), node j of level l + 1 the nodes
/// [j * kBallTreeFanout, ...) of level l. The top level has one node.
struct BallTreeView {
  const Ball* ball;
  const std::int32_t* id;  ///< index of each ball in its caller's order
  const BallNode* node;
  std::uint32_t ball_count;
  std::uint32_t level_count;
  std::uint32_t level_begin[kBallTreeMaxLevels];  ///< first node of each level
  std::uint32_t level_size[kBallTreeMaxLevels];
};

/// Columns of whole SIMD blocks; results of point i go to entry i.
struct BallQueries {
  const float* x;
  const float* y;
  const float* z;
  float* distance;
  float* gradient_x;
  float* gradient_y;
  float* gradient_z;
};

}  // namespace pointwright

/// Distances and gradients of the points [begin, end), both multiples of 16, by region.h's definition.
POINTWRIGHT_DECLARE_KERNEL(void query_balls(const BallTreeView& tree, const BallQueries& queries,
                                            std::size_t begin, std::size_t end))
