#include "engine/multires/sampling.h"

#include <algorithm>
#include <utility>

#include "engine/core/check.h"

namespace pointwright {

Sampling rest_sampling(std::shared_ptr<const Cloud> cloud, std::shared_ptr<const NeighborGraph> graph,
                       std::vector<float> spacing) {
  POINTWRIGHT_CHECK(graph->count == cloud->size() && spacing.size() == cloud->size(),
                    "a graph and spacings of the cloud's samples");
  const auto greatest = std::max_element(cloud->id.begin(), cloud->id.end());
  const std::uint32_t next_id = greatest == cloud->id.end() ? 0 : *greatest + 1;
  return {.cloud = std::move(cloud),
          .graph = std::move(graph),
          .spacing = std::move(spacing),
          .parent = {},
          .cell_u = {},
          .cell_v = {},
          .next_id = next_id};
}

std::uint64_t memory_of(const Sampling& sampling) {
  return memory_of(*sampling.cloud) + sampling.graph->lanes.size() * sizeof(std::uint32_t) +
         (sampling.spacing.size() + sampling.parent.size()) * sizeof(float) +
         (sampling.cell_u.size() + sampling.cell_v.size()) * 3 * sizeof(float);
}

}  // namespace pointwright
