#pragma once
// How space is cut into tiles of about equal numbers of samples.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright::server {

/// A kd-tree of planes across the axes. Leaves are tiles, numbered so that neighbours in number are
/// neighbours in space; together they fill all of space.
class TileCuts {
 public:
  /// Halves the samples, across the longest side of their box, until no part holds more than `most` of them
  /// (at least 1). Samples in one place stay together.
  /// Cost: O(N log N)
  TileCuts(const Points& samples, std::size_t most);

  [[nodiscard]] std::size_t tile_count() const { return boxes_.size(); }
  [[nodiscard]] std::uint32_t tile_of(const Vec3f& p) const;
  /// The tile's part of space; unbounded sides are infinite.
  [[nodiscard]] const Box3f& box(std::size_t tile) const { return boxes_[tile]; }
  /// The tiles that have a part of the box, ascending.
  [[nodiscard]] std::vector<std::uint32_t> tiles_in(const Box3f& box) const;

 private:
  struct Node {
    float cut = 0.0F;
    std::int32_t axis = -1;   // -1: a leaf
    std::uint32_t below = 0;  // the node of p[axis] < cut, or the leaf's tile
    std::uint32_t above = 0;
  };
  void divide(const Points& samples, std::vector<std::uint32_t>& order, std::size_t begin, std::size_t end,
              std::size_t most, const Box3f& space, std::uint32_t node);

  std::vector<Node> nodes_;
  std::vector<Box3f> boxes_;
};

}  // namespace pointwright::server
