#pragma once
// Arguments of the pair contraction kernels (engine/core/simd_dispatch.h).

#include <cstddef>
#include <cstdint>

#include "engine/core/simd_dispatch.h"

namespace pointwright {

/// Floats of one node, a cache line: where it stands (3), its quadric about that place, Q(p + x) = c + 2 g x
/// + x A x, as A (6: xx yy zz xy xz yz), g (3) and c (1), and its unit normal (3). The trace of A is the
/// number of samples that the node stands for.
inline constexpr std::size_t kNodeFloats = 16;

/// Neighbours of a node, a cache line: what is left of them comes first, the node's own number fills up.
inline constexpr std::uint32_t kRowNeighbors = 16;

/// No node: of a node without partner.
inline constexpr std::uint32_t kNoNode = 0xffffffffU;

/// Padded columns; `neighbors` is the blocked graph, [block][j][lane].
struct NodeKernelArgs {
  const float* x;
  const float* y;
  const float* z;
  const float* normal_x;
  const float* normal_y;
  const float* normal_z;
  const std::uint32_t* neighbors;
  std::uint32_t k;
  float scale;           ///< of the positions, a power of two
  bool separate_sheets;  ///< neighbours of opposed normals span no plane
  float* nodes;          ///< padded samples x kNodeFloats
};

/// What a pair costs: the same bits whichever of its nodes comes first.
struct PairCost {
  float length_weight;
  float limit;           ///< of the quadric part; beyond it a pair costs infinity
  bool separate_sheets;  ///< pairs of opposed normals cost infinity
};

/// Pairs of nodes, first < second, padded to whole blocks of 16 with any valid pair.
struct PairKernelArgs {
  const float* nodes;
  const std::uint32_t* first;
  const std::uint32_t* second;
  PairCost rule;
  float* cost;    ///< where not null: of each pair
  float* merged;  ///< where not null: the contracted nodes, kNodeFloats each
};

/// The list `live` is padded to whole blocks with any of its nodes; all else is addressed by node.
struct PartnerKernelArgs {
  const float* nodes;
  const std::uint32_t* rows;  ///< kRowNeighbors a node
  const std::uint32_t* live;
  PairCost rule;
  float* cost;             ///< of each node's cheapest pair over its own row; infinity without one
  std::uint32_t* key;      ///< of that pair: orders pairs of equal cost as if at random
  std::uint32_t* partner;  ///< or kNoNode; where cost and key are equal, too, the lower one
};

/// `mate` is what a node of the list has been contracted with, or kNoNode; `forward` takes every node to what
/// it is part of now.
struct RowKernelArgs {
  const float* nodes;
  const std::uint32_t* forward;
  const std::uint32_t* live;
  const std::uint32_t* mate;
  std::uint32_t* rows;
  std::uint8_t* length;  ///< of contracted nodes, from `begin` on: entries of the new row
};

}  // namespace pointwright

/// The nodes of the samples [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void build_nodes_kernel(const NodeKernelArgs& args, std::size_t begin,
                                                   std::size_t end))
/// Costs or results of contracting the pairs [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void contract_pairs_kernel(const PairKernelArgs& args, std::size_t begin,
                                                      std::size_t end))
/// The cheapest pairs of the nodes live[begin] .. live[end - 1], begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void best_partners_kernel(const PartnerKernelArgs& args, std::size_t begin,
                                                     std::size_t end))
/// Brings the rows of the nodes live[begin] .. live[end - 1] up to date. A contracted node gets what both
/// had, without repetitions, the nearest where that is too many; others may list a node twice.
POINTWRIGHT_DECLARE_KERNEL(void merge_rows_kernel(const RowKernelArgs& args, std::size_t begin,
                                                  std::size_t end))
