#include "engine/simplification/contraction.h"

#include <algorithm>
#include <cmath>

#include "engine/core/parallel.h"

namespace pointwright {

float unit_scale(const Points& position) {
  const Box3f box = bounds_of(position);
  const float extent = position.empty() ? 0.0F : (box.max - box.min).maxCoeff();
  if (!(extent > 0.0F) || !std::isfinite(extent)) return 1.0F;
  int exponent = 0;
  std::frexp(extent, &exponent);
  return std::ldexp(1.0F, std::clamp(-exponent, -100, 100));
}

ContractionNodes::ContractionNodes(const Points& position, const Points& normal, const NeighborGraph& graph,
                                   bool separate_sheets, const ExecutionContext* context)
    : nodes_(make_large_array<ContractionNode>(padded_to_block(position.size()))),
      count_(position.size()),
      scale_(unit_scale(position)) {
  const NodeKernelArgs args{.x = position.x(),
                            .y = position.y(),
                            .z = position.z(),
                            .normal_x = normal.x(),
                            .normal_y = normal.y(),
                            .normal_z = normal.z(),
                            .neighbors = graph.lanes.data(),
                            .k = graph.k,
                            .scale = scale_,
                            .separate_sheets = separate_sheets,
                            .nodes = nodes_[0].fields};
  const auto build = POINTWRIGHT_KERNEL(build_nodes_kernel);
  parallel_for(
      padded_to_block(count_), [&](std::size_t begin, std::size_t end) { build(args, begin, end); },
      kParallelBlock, context);
}

void ContractionNodes::compact(const std::uint32_t* source, std::size_t count) {
  pointwright::compact(nodes_, source, count);
  count_ = count;
}

void ContractionNodes::costs(const PairCost& rule, const std::uint32_t* first, const std::uint32_t* second,
                             std::size_t count, float* cost) const {
  POINTWRIGHT_KERNEL(contract_pairs_kernel)
  ({.nodes = data(), .first = first, .second = second, .rule = rule, .cost = cost, .merged = nullptr}, 0,
   padded_to_block(count));
}

void ContractionNodes::contract(const std::uint32_t* first, const std::uint32_t* second, std::size_t count,
                                ContractionNode* merged) const {
  POINTWRIGHT_KERNEL(contract_pairs_kernel)
  ({.nodes = data(), .first = first, .second = second, .rule = {}, .cost = nullptr, .merged = merged->fields},
   0, padded_to_block(count));
}

std::uint32_t starting_row(const Points& position, const NeighborGraph& graph, std::size_t i,
                           std::span<std::uint32_t, kRowNeighbors> row) {
  std::uint32_t length = 0;
  if (i > 0 && position[i] == position[i - 1]) row[length++] = static_cast<std::uint32_t>(i - 1);
  for (std::uint32_t j = 0; j < std::min(graph.k, kStartNeighbors); ++j) row[length++] = graph.index(i, j);
  return length;
}

SurvivorGraph survivor_graph(const ContractionNodes& nodes, const ExecutionContext* context) {
  SurvivorGraph result{.position = Points(nodes.count())};
  for (std::size_t i = 0; i < nodes.count(); ++i) {
    const float* p = nodes[i].fields;
    result.position.set(i, {p[0], p[1], p[2]});
  }
  result.graph = build_neighbor_graph(result.position, kStartNeighbors, context);
  return result;
}

}  // namespace pointwright
