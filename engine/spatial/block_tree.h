#pragma once
// Nearest neighbours of all samples of a coherently ordered cloud at once.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/points.h"

namespace pointwright {

struct BlockTreeLevel;

/// Boxes around every 16 consecutive samples, around every 16 of those boxes, and so on up to 16: what
/// coherent order leaves to build of a search tree. It refers to the points, which must outlive it and stay
/// unmoved.
/// Pre:  finite coordinates within 1e9; coherent order makes it fast, any order is legal
/// Cost: O(N) to build, parallel; 1.6 bytes a sample
class BlockTree {
 public:
  explicit BlockTree(const Points& points);
  ~BlockTree();
  BlockTree(BlockTree&&) noexcept;
  BlockTree& operator=(BlockTree&&) noexcept;

  [[nodiscard]] std::size_t size() const { return points_->size(); }

  /// Lists the nearest other samples of samples [begin, end), by distance, then index: at most `length` each,
  /// and only those whose squared distance, computed in float, is below `bound_sq`. `rows` becomes
  /// [block][j][lane], kSimdBlock lanes, of indices; -1 past a list's end and in the lanes past the last
  /// sample. Samples that stand in one place list each other: many such make many searches dear.
  /// Pre:         begin a multiple of kSimdBlock; length >= 1; bound_sq not NaN
  /// Determinism: the answer is unique
  void nearest_of_range(std::size_t begin, std::size_t end, std::uint32_t length, float bound_sq,
                        std::vector<std::int32_t>& rows) const;

 private:
  const Points* points_;
  std::vector<float> boxes_;  // [level][low x y z, high x y z][box]
  std::vector<BlockTreeLevel> levels_;
};

}  // namespace pointwright
