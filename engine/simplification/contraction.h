#pragma once
// What the two orders of contraction share (internal to simplification.cpp, greedy.cpp and batched.cpp).

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/mixed_bits.h"
#include "engine/core/points.h"
#include "engine/simplification/contraction_kernels.h"
#include "engine/simplification/large_array.h"
#include "engine/simplification/simplification.h"
#include "engine/spatial/neighbor_graph.h"

namespace pointwright {

/// A node of contraction_kernels.h, a cache line of its own.
struct alignas(64) ContractionNode {
  float fields[kNodeFloats];
};
/// And its neighbours.
struct alignas(64) ContractionRow {
  std::uint32_t neighbor[kRowNeighbors];
};

/// Neighbours that a sample brings along at most; a contracted one keeps kRowNeighbors.
inline constexpr std::uint32_t kStartNeighbors = 12;

/// When to stop, and what a pair may cost; lengths in the nodes' scale.
struct ContractionGoal {
  std::size_t count = 1;  ///< samples to be left
  PairCost rule{
      .length_weight = 0.0F, .limit = std::numeric_limits<float>::infinity(), .separate_sheets = true};
};

/// The contractions as they were made. Both orders fill it; simplify() brings it in order of cost.
struct ContractionLog {
  struct alignas(64) Step {   // a cache line: the order of cost is as good as random
    Contraction contraction;  ///< its error in the nodes' scale
    float cost;               ///< never less than those of the steps that it builds on
    float position[3];        ///< of the survivor
    float normal[3];
    std::uint32_t neighbor_count;
    std::uint64_t first_neighbor;
  };
  LargeArray<Step> steps;  ///< not touched, so not resident, beyond the count
  std::size_t count = 0;
  LargeArray<std::uint32_t> neighbors;  ///< of the survivors
};

/// The nodes of the samples, and kernel calls over them. The scale is a power of two that brings the cloud's
/// extent near 1, so that squares of squares neither vanish nor overflow.
class ContractionNodes {
 public:
  ContractionNodes(const Points& position, const Points& normal, const NeighborGraph& graph,
                   bool separate_sheets, const ExecutionContext* context);

  [[nodiscard]] float scale() const { return scale_; }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] const ContractionNode& operator[](std::size_t i) const { return nodes_[i]; }
  [[nodiscard]] const float* data() const { return nodes_[0].fields; }
  void set(std::size_t i, const ContractionNode& node) { nodes_[i] = node; }
  /// Leaves the nodes source[0], source[1], ..., which get the numbers 0, 1, ...
  void compact(const std::uint32_t* source, std::size_t count);

  /// Costs of the pairs (first[i], second[i]). The columns have room for whole blocks, the pairs' with valid
  /// indices.
  void costs(const PairCost& rule, const std::uint32_t* first, const std::uint32_t* second, std::size_t count,
             float* cost) const;
  /// The contracted nodes, which are not stored yet; columns as above.
  void contract(const std::uint32_t* first, const std::uint32_t* second, std::size_t count,
                ContractionNode* merged) const;

 private:
  LargeArray<ContractionNode> nodes_;
  std::size_t count_ = 0;
  float scale_ = 1.0F;
};

/// Sample i's first neighbours, and the sample before it where that stands at the same place: no list of the
/// graph contains those. Returns how many were written to `row`.
std::uint32_t starting_row(const Points& position, const NeighborGraph& graph, std::size_t i,
                           std::span<std::uint32_t, kRowNeighbors> row);

/// The samples that are left and their nearest neighbours, for when rows have run out of partners: far parts
/// of a cloud share no neighbour.
struct SurvivorGraph {
  Points position;  ///< of all nodes
  NeighborGraph graph;
};
SurvivorGraph survivor_graph(const ContractionNodes& nodes, const ExecutionContext* context);

/// The power of two that brings the longest side of the box into [1/2, 1).
float unit_scale(const Points& position);

/// Orders pairs of equal cost as if at random, so that on exact flats many of them are the first of both
/// their samples.
inline std::uint64_t tie_key(std::uint32_t first, std::uint32_t second) {
  return mixed_bits((static_cast<std::uint64_t>(first) << 32U) | second);
}

/// Both return false where they were cancelled.
bool contract_greedily(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                       ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context);
bool contract_in_batches(const Points& position, const NeighborGraph& graph, const ContractionGoal& goal,
                         ContractionNodes& nodes, ContractionLog& log, const ExecutionContext* context);

}  // namespace pointwright
