#include "engine/multires/sampling.h"

#include <algorithm>
#include <unordered_map>
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

std::vector<std::uint32_t> roots_of(const Sampling& sampling) {
  std::vector<std::uint32_t> roots = sampling.cloud->id;
  // Parents come before their children, and who was split from a sample that is gone was given to its parent.
  std::unordered_map<std::uint32_t, std::uint32_t> root_of_inserted;  // by id
  for (std::size_t i = 0; i < sampling.parent.size(); ++i) {
    const std::uint32_t parent = sampling.parent[i];
    if (parent == kNoParent) continue;
    const auto found = root_of_inserted.find(parent);
    const std::uint32_t root = found == root_of_inserted.end() ? parent : found->second;
    root_of_inserted.emplace(sampling.cloud->id[i], root);
    roots[i] = root;
  }
  return roots;
}

std::uint64_t memory_of(const Sampling& sampling) {
  return memory_of(*sampling.cloud) + sampling.graph->lanes.size() * sizeof(std::uint32_t) +
         (sampling.spacing.size() + sampling.parent.size()) * sizeof(float) +
         (sampling.cell_u.size() + sampling.cell_v.size()) * 3 * sizeof(float);
}

}  // namespace pointwright
