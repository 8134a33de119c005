#pragma once
// Which sample of a preview stands for each sample of the full scan.

#include <cstdint>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/multires/surface.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright {

/// The samples of a preview at rest, to be asked for the nearest one. Queries are thread-safe.
class AnchorIndex {
 public:
  /// Pre: at least one sample; unit normals; `preview` outlives the index
  explicit AnchorIndex(const Level& preview) : preview_(preview), tree_(preview.position) {}

  /// Per position the nearest sample of the preview that looks to the same side, n_i . n_j > 0; the nearest
  /// of all where no normals are given or none of the nearest 16 does.
  /// Cost:        O(log M) each, parallel
  /// Determinism: each depends on its own position and normal alone
  /// Cancels:     between blocks; the result is then incomplete
  [[nodiscard]] std::vector<std::uint32_t> anchors_of(const Points& position, const Points& normal,
                                                      const ExecutionContext& context) const;

 private:
  const Level& preview_;
  KdTree tree_;
};

}  // namespace pointwright
