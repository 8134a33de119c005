#include "engine/smoothing/reverse_neighbors.h"

#include <algorithm>
#include <numeric>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Plain compressed rows: listers of sample i in ascending order.
struct Rows {
  std::vector<std::uint32_t> first;  // padded samples + 1
  std::vector<std::uint32_t> entry;
};

// Calls visit(i, neighbour) for every entry of the graph, sample by sample.
template <typename Visit>
void for_each_entry(const NeighborGraph& graph, Visit visit) {
  for (std::size_t block = 0; block * kSimdBlock < graph.count; ++block) {
    const std::uint32_t* rows = graph.lanes.data() + block * graph.k * kSimdBlock;
    const std::size_t lanes = std::min(kSimdBlock, graph.count - block * kSimdBlock);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        visit(static_cast<std::uint32_t>(block * kSimdBlock + lane), rows[j * kSimdBlock + lane]);
      }
    }
  }
}

Rows transposed(const NeighborGraph& graph) {
  Rows rows;
  rows.first.assign(padded_to_block(graph.count) + 1, 0);
  std::uint32_t* count = rows.first.data() + 1;
  for_each_entry(graph, [&](std::uint32_t, std::uint32_t neighbor) { ++count[neighbor]; });
  std::partial_sum(rows.first.begin(), rows.first.end(), rows.first.begin());
  rows.entry.resize(graph.count * graph.k);
  std::vector<std::uint32_t> cursors(rows.first.begin(), rows.first.end() - 1);
  std::uint32_t* cursor = cursors.data();
  std::uint32_t* entry = rows.entry.data();
  for_each_entry(graph, [&](std::uint32_t i, std::uint32_t neighbor) { entry[cursor[neighbor]++] = i; });
  return rows;
}

}  // namespace

ReverseNeighbors reverse_neighbors(const NeighborGraph& graph) {
  POINTWRIGHT_CHECK(graph.count * graph.k < UINT32_MAX / 3, "too many neighbours for 32-bit offsets");
  const Rows plain = transposed(graph);
  const std::size_t slices = padded_to_block(graph.count) / kReverseLanes;
  const std::uint32_t most = 2 * graph.k;
  const std::uint32_t* plain_first = plain.first.data();
  const auto length = [plain_first](std::size_t i) { return plain_first[i + 1] - plain_first[i]; };

  ReverseNeighbors result;
  result.nothing = static_cast<std::uint32_t>(padded_to_block(graph.count));
  result.slice_first.assign(slices + 1, 0);
  result.rest_first.push_back(0);
  for (std::size_t slice = 0; slice < slices; ++slice) {
    std::uint32_t longest = 0;
    for (std::size_t i = slice * kReverseLanes; i < (slice + 1) * kReverseLanes; ++i) {
      longest = std::max(longest, length(i));
      if (length(i) <= most) continue;
      result.rest_sample.push_back(static_cast<std::uint32_t>(i));
      result.rest.insert(result.rest.end(), plain.entry.begin() + plain.first[i] + most,
                         plain.entry.begin() + plain.first[i + 1]);
      result.rest_first.push_back(static_cast<std::uint32_t>(result.rest.size()));
    }
    result.slice_first[slice + 1] = result.slice_first[slice] + std::min(longest, most);
  }
  result.rows.resize(result.slice_first[slices] * kReverseLanes);
  const std::uint32_t nothing = result.nothing;
  parallel_for(
      slices,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t slice = begin; slice < end; ++slice) {
          const std::uint32_t count = result.slice_first[slice + 1] - result.slice_first[slice];
          std::uint32_t* to = result.rows.data() + result.slice_first[slice] * kReverseLanes;
          for (std::size_t lane = 0; lane < kReverseLanes; ++lane) {
            const std::size_t i = slice * kReverseLanes + lane;
            const std::uint32_t listers = length(i);
            const std::uint32_t* from = plain.entry.data() + plain_first[i];
            for (std::uint32_t row = 0; row < count; ++row) {
              to[row * kReverseLanes + lane] = row < listers ? from[row] : nothing;
            }
          }
        }
      },
      kParallelBlock / kReverseLanes);
  return result;
}

}  // namespace pointwright
