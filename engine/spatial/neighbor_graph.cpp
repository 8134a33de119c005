#include "engine/spatial/neighbor_graph.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/parallel.h"
#include "engine/spatial/kd_tree.h"

namespace pointwright {
namespace {

// representative[i]: the first of the adjacent samples that stand exactly where sample i stands.
std::vector<std::uint32_t> representatives(const Points& points) {
  std::vector<std::uint32_t> result(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool repeats = i > 0 && points[i] == points[i - 1];
    result[i] = repeats ? result[i - 1] : static_cast<std::uint32_t>(i);
  }
  return result;
}

}  // namespace

NeighborGraph build_neighbor_graph(const Points& points, std::uint32_t k, const ExecutionContext* context) {
  NeighborGraph graph;
  graph.count = points.size();
  if (points.empty()) return graph;
  const std::vector<std::uint32_t> representative = representatives(points);
  std::vector<std::uint32_t> distinct;
  for (std::uint32_t i = 0; i < representative.size(); ++i) {
    if (representative[i] == i) distinct.push_back(i);
  }
  graph.duplicate_count = points.size() - distinct.size();
  graph.k = static_cast<std::uint32_t>(std::min<std::size_t>(k, distinct.size() - 1));
  graph.lanes.assign(padded_to_block(points.size()) * graph.k, 0U);
  if (graph.k == 0) return graph;

  // Only distinct samples enter the tree: a pile of duplicates would make every query near it visit them all.
  const KdTree tree = distinct.size() == points.size() ? KdTree(points) : KdTree(points, distinct);
  parallel_for(
      points.size(),
      [&](std::size_t begin, std::size_t end) {
        std::vector<Neighbor> found;
        for (std::size_t i = begin; i < end; ++i) {
          if (i > begin && representative[i] == representative[i - 1]) {
            for (std::uint32_t j = 0; j < graph.k; ++j) graph.index(i, j) = graph.index(i - 1, j);
            continue;
          }
          tree.nearest(points[i], graph.k + 1, found);
          std::uint32_t j = 0;
          for (const Neighbor& neighbor : found) {
            if (neighbor.index != representative[i] && j < graph.k) graph.index(i, j++) = neighbor.index;
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
