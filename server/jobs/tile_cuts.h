#pragma once
// How space is cut into tiles of about equal numbers of samples.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright::server {

/// A kd-tree of planes across the axes. Its leaves are cells, numbered so that neighbours in number are
/// neighbours in space; together they fill all of space. A tile is what stands below one node: some cells in
/// a row.
class TileCuts {
 public:
  /// Halves the samples, across the longest side of their box, until no tile holds more than `most` of them
  /// and no cell more than `most_of_cell` (each at least 1). Samples in one place stay together.
  /// Cost: O(N log N)
  TileCuts(const Points& samples, std::size_t most, std::size_t most_of_cell);

  [[nodiscard]] std::size_t tile_count() const { return first_cells_.size(); }
  [[nodiscard]] std::size_t cell_count() const { return cell_count_; }
  /// The tile's cells are those from first_cell(tile) to before first_cell(tile + 1).
  [[nodiscard]] std::uint32_t first_cell(std::size_t tile) const {
    return tile < first_cells_.size() ? first_cells_[tile] : cell_count_;
  }
  [[nodiscard]] std::uint32_t cell_of(const Vec3f& p) const;
  /// The cells that have a part of the box, ascending.
  [[nodiscard]] std::vector<std::uint32_t> cells_in(const Box3f& box) const;

 private:
  struct Node {
    float cut = 0.0F;
    std::int32_t axis = -1;   // -1: a leaf
    std::uint32_t below = 0;  // the node of p[axis] < cut, or the leaf's cell
    std::uint32_t above = 0;
  };
  struct Most {
    std::size_t tile = 1;
    std::size_t cell = 1;
  };
  void divide(const Points& samples, std::vector<std::uint32_t>& order, std::size_t begin, std::size_t end,
              Most most, bool in_tile, std::uint32_t node);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> first_cells_;  // of each tile
  std::uint32_t cell_count_ = 0;
};

}  // namespace pointwright::server
