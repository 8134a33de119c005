#include "engine/spatial/neighbor_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/parallel.h"
#include "engine/spatial/block_tree.h"
#include "engine/spatial/distinct_points.h"

namespace pointwright {

NeighborGraph build_neighbor_graph(const Points& points, std::uint32_t k, const ExecutionContext* context) {
  NeighborGraph graph;
  graph.count = points.size();
  if (points.empty()) return graph;
  const DistinctPoints distinct(points);
  graph.duplicate_count = points.size() - distinct.points().size();
  graph.k = static_cast<std::uint32_t>(std::min<std::size_t>(k, distinct.points().size() - 1));
  graph.lanes.assign(padded_to_block(points.size()) * graph.k, 0U);
  if (graph.k == 0) return graph;

  const BlockTree tree(distinct.points());
  parallel_for(
      distinct.points().size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::int32_t> rows;
        tree.nearest_of_range(begin, end, graph.k, std::numeric_limits<float>::infinity(), rows);
        for (std::size_t d = begin; d < end; ++d) {
          const std::size_t row = (d - begin) / kSimdBlock * graph.k * kSimdBlock + d % kSimdBlock;
          for (std::size_t i = distinct.first(d); i < distinct.first(d + 1); ++i) {
            for (std::uint32_t j = 0; j < graph.k; ++j) {
              graph.index(i, j) = distinct.first(static_cast<std::size_t>(rows[row + j * kSimdBlock]));
            }
          }
        }
      },
      kParallelBlock, context);
  return graph;
}

std::vector<float> local_spacing(const Points& points, const NeighborGraph& graph) {
  std::vector<float> spacing(points.size(), 0.0F);
  if (graph.k == 0) return spacing;
  const float factor = std::sqrt(std::numbers::pi_v<float> / (static_cast<float>(graph.k) + 0.5F));
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      spacing[i] = (points[graph.index(i, graph.k - 1)] - points[i]).norm() * factor;
    }
  });
  return spacing;
}

}  // namespace pointwright
