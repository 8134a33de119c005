#pragma once
// What the frames of a drag share: which blocks of samples move, and the stencils that carry their normals.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/editing/edit.h"
#include "engine/multires/normal_stencil.h"
#include "engine/multires/shape_operator.h"

namespace pointwright {

/// Blocks of kSimdBlock samples [begin, end).
struct BlockRange {
  std::uint32_t begin = 0;
  std::uint32_t end = std::numeric_limits<std::uint32_t>::max();  ///< beyond the last one: all that there are
};

/// Made once the regions or the surface change, not per frame. Immutable; the surface, the graph and the
/// field that it was made of must outlive it and stay as they were.
class EditPlan {
 public:
  /// `range`: the blocks that the plan moves, the others stay. A plan of a range and one of the rest, one
  /// after the other, make the bits of one plan of all, where no sample of the first range has a neighbour
  /// in the second.
  /// Of `params`, the level, the kinds of deformation and whether there are gains count, not their amounts.
  /// Cost:    O(N k) for each level finer than params.level, parallel; there 4 k + 16 bytes a sample that may
  ///          bend
  /// Cancels: between blocks; the plan is then incomplete and must be dropped
  EditPlan(const MultiresSurface& surface, const NeighborGraph& graph, const EditParams& params,
           const ScaleField& field, const ExecutionContext* context = nullptr, BlockRange range = {});

  /// Whether edits with these parameters can be made from this plan. All plans that serve the same parameters
  /// make the same bits of them.
  [[nodiscard]] bool serves(const EditParams& params) const;
  [[nodiscard]] std::uint32_t level() const { return level_; }
  /// Whether it serves rigid motions of the one-region alone, with gains 1.
  [[nodiscard]] bool rigid_only() const { return rigid_only_; }
  [[nodiscard]] std::size_t memory() const;

  /// Blocks of kSimdBlock samples, ascending: all that may move; of these, those that may bend; and those
  /// that move as one rigid body with all their samples (t = 1 without a gradient), where nothing else is
  /// asked for.
  [[nodiscard]] const std::vector<std::uint32_t>& moving() const { return moving_; }
  [[nodiscard]] const std::vector<std::uint32_t>& bending() const { return bending_; }
  [[nodiscard]] const std::vector<std::uint32_t>& rigid() const { return rigid_; }
  /// By entry of bending(), whether a sample of the block moves whole: t = 1 without a gradient.
  [[nodiscard]] const std::vector<std::uint8_t>& any_whole() const { return any_whole_; }
  /// Over bending(). Pre: level() < level <= the finest.
  [[nodiscard]] const NormalStencil& stencil(std::size_t level) const {
    return stencils_[level - level_ - 1];
  }
  /// Of the edited level; null where no deformation that the plan serves needs them.
  [[nodiscard]] const ShapeOperators* shape() const { return shape_.size() > 0 ? &shape_ : nullptr; }

 private:
  std::uint32_t level_;
  bool rigid_only_;
  bool offsets_;
  std::vector<std::uint32_t> moving_, bending_, rigid_;
  std::vector<std::uint8_t> any_whole_;
  std::vector<NormalStencil> stencils_;
  ShapeOperators shape_;
};

}  // namespace pointwright
