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

Rows transposed(const NeighborGraph& graph) {
  Rows rows;
  rows.first.assign(padded_to_block(graph.count) + 1, 0);
  std::uint32_t* first = rows.first.data();
  for (std::size_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t j = 0; j < graph.k; ++j) ++first[graph.index(i, j) + 1U];
  }
  std::partial_sum(rows.first.begin(), rows.first.end(), rows.first.begin());
  rows.entry.resize(graph.count * graph.k);
  std::vector<std::uint32_t> cursor(rows.first.begin(), rows.first.end() - 1);
  for (std::size_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      rows.entry[cursor[graph.index(i, j)]++] = static_cast<std::uint32_t>(i);
    }
  }
  return rows;
}

}  // namespace

ReverseNeighbors reverse_neighbors(const NeighborGraph& graph) {
  POINTWRIGHT_CHECK(graph.count * graph.k < UINT32_MAX / 3, "too many neighbours for 32-bit offsets");
  const Rows plain = transposed(graph);
  const std::size_t slices = padded_to_block(graph.count) / kReverseLanes;
  const std::uint32_t most = 2 * graph.k;
  const auto length = [&](std::size_t i) { return plain.first[i + 1] - plain.first[i]; };

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
  parallel_for(
      slices,
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t slice = begin; slice < end; ++slice) {
          const std::uint32_t count = result.slice_first[slice + 1] - result.slice_first[slice];
          std::uint32_t* to = result.rows.data() + result.slice_first[slice] * kReverseLanes;
          for (std::size_t lane = 0; lane < kReverseLanes; ++lane) {
            const std::size_t i = slice * kReverseLanes + lane;
            const std::uint32_t* from = plain.entry.data() + plain.first[i];
            for (std::uint32_t row = 0; row < count; ++row) {
              to[row * kReverseLanes + lane] = row < length(i) ? from[row] : result.nothing;
            }
          }
        }
      },
      kParallelBlock / kReverseLanes);
  return result;
}

}  // namespace pointwright
