#include "engine/spatial/same_side_graph.h"

#include <algorithm>

#include "engine/core/parallel.h"

namespace pointwright {

NeighborGraph same_side_graph(const Points& position, const Points& normal, std::uint32_t k,
                              std::uint32_t candidates, const ExecutionContext* context) {
  const NeighborGraph all = build_neighbor_graph(position, candidates, context);
  NeighborGraph graph;
  graph.count = all.count;
  graph.k = std::min(k, all.k);
  graph.lanes.assign(padded_to_block(graph.count) * graph.k, 0U);
  parallel_for(graph.count, [&](std::size_t begin, std::size_t end) {
    for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
      std::uint32_t count = 0;
      for (std::uint32_t j = 0; j < all.k && count < graph.k; ++j) {
        const std::uint32_t other = all.index(i, j);
        if (normal[i].dot(normal[other]) > 0.0F) graph.index(i, count++) = other;
      }
      while (count < graph.k) graph.index(i, count++) = i;
    }
  });
  return graph;
}

}  // namespace pointwright
