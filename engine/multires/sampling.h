#pragma once
// The samples of a surface, apart from where they stand on its levels: what an edit with resampling (§5)
// replaces where it inserts or removes some.

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/points.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// The parent of a sample that was not inserted.
inline constexpr std::uint32_t kNoParent = std::numeric_limits<std::uint32_t>::max();

/// N samples in the order of the surface's columns: those that were there before an edit keep their order,
/// inserted ones follow them. Immutable once shared.
struct Sampling {
  /// Attributes and ids. Positions and normals are those at rest; of an inserted sample, where its edit put
  /// it.
  std::shared_ptr<const Cloud> cloud;
  /// Of the samples at rest; of inserted samples and those around them, where their edit put them.
  std::shared_ptr<const NeighborGraph> graph;
  /// The distance that a sample is to keep from its neighbours, model units: its local spacing at rest, or
  /// that of the sample that it was split from. It travels through all edits.
  std::vector<float> spacing;
  /// The id of the sample that each one was split from, kNoParent for those that were uploaded. Empty where
  /// no sample has been inserted.
  std::vector<std::uint32_t> parent;
  /// The tangent vectors u and v of §5.1: the sides of each sample's cell, in units of its spacing, as the
  /// edits with resampling so far have left it (Eq. 13). Empty before the first of them: a unit square.
  Points cell_u, cell_v;
  /// What the next inserted sample will be called: ids never come back.
  std::uint32_t next_id = 0;

  [[nodiscard]] std::size_t size() const { return spacing.size(); }
};

/// The samples of an uploaded cloud, with nothing inserted.
/// Shapes: one spacing for each sample; the graph of the same samples
Sampling rest_sampling(std::shared_ptr<const Cloud> cloud, std::shared_ptr<const NeighborGraph> graph,
                       std::vector<float> spacing);

/// By sample, the id of the uploaded one that it descends from: its own where it was not inserted. That one
/// may have been collected since.
/// Cost: O(N)
std::vector<std::uint32_t> roots_of(const Sampling& sampling);

/// Bytes that the sampling's columns take, those of its cloud and graph included.
std::uint64_t memory_of(const Sampling& sampling);

}  // namespace pointwright
