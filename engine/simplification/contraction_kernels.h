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

/// Pairs of nodes, first < second, padded to whole blocks of 16 with any valid pair.
struct PairKernelArgs {
  const float* nodes;
  const std::uint32_t* first;
  const std::uint32_t* second;
  float length_weight;
  float limit;           ///< of the quadric part; beyond it a pair costs infinity
  bool separate_sheets;  ///< pairs of opposed normals cost infinity
  float* cost;           ///< where not null: of each pair
  float* merged;         ///< where not null: the contracted nodes, kNodeFloats each
};

/// Entries of a node's row of neighbours, and the bit that marks a number of map[] as contracted.
inline constexpr std::uint32_t kRowNeighbors = 16;
inline constexpr std::uint32_t kChanged = 1U << 31U;

struct ContractionRow {
  std::uint32_t neighbor[kRowNeighbors];
  float cost[kRowNeighbors];
};

/// Node i of the new numbering was source[i] of the old one, contracted with partner[source[i]] where that is
/// not 0xffffffff; map[] takes old numbers to new ones. Outputs are appended from 0; each has room for two
/// rows a node.
struct RowKernelArgs {
  const ContractionRow* rows;
  const std::uint8_t* length;
  const std::uint32_t* map;
  const std::uint32_t* source;
  const std::uint32_t* partner;
  std::uint32_t* neighbor;
  float* cost;             ///< the old one, valid where the entry is no pair below
  std::uint32_t* row_end;  ///< of each node of the range, in `neighbor`
  std::uint32_t* first;    ///< pairs whose cost has changed, and where in `neighbor` they stand
  std::uint32_t* second;
  std::uint32_t* target;
};

}  // namespace pointwright

/// The nodes of the samples [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void build_nodes_kernel(const NodeKernelArgs& args, std::size_t begin,
                                                   std::size_t end))
/// Costs or results of contracting the pairs [begin, end), begin at a whole block.
POINTWRIGHT_DECLARE_KERNEL(void contract_pairs_kernel(const PairKernelArgs& args, std::size_t begin,
                                                      std::size_t end))
/// Rows of the nodes [begin, end) under their new names, without repetitions; returns how many pairs have
/// changed.
POINTWRIGHT_DECLARE_KERNEL(std::size_t merge_rows_kernel(const RowKernelArgs& args, std::size_t begin,
                                                         std::size_t end))
