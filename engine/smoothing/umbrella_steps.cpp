#include "engine/smoothing/umbrella_steps.h"

#include <algorithm>
#include <array>

#include "engine/core/check.h"
#include "engine/core/parallel.h"

namespace pointwright {
namespace {

// Samples whose sums run together; two groups make a block of the graph.
constexpr std::size_t kGroup = 8;
// Blocks of the graph, and slices of reverse rows, that are asked for ahead of their use.
constexpr std::size_t kAhead = 6;

using Sums = std::array<Float4, kGroup>;

// Sums of w_j (p_j - p) of the samples [i, i + kGroup), w_j = 1 without weights.
Sums umbrella_sums(const UmbrellaOperator& umbrella, const Float4* p, std::size_t i) {
  const std::uint32_t k = umbrella.graph->k;
  const std::size_t offset = i / kSimdBlock * k * kSimdBlock + i % kSimdBlock;
  const std::uint32_t* row = umbrella.graph->lanes.data() + offset;
  const Float4* own = p + i;
  Sums sums{};
  Float4* sum = sums.data();
  if (umbrella.weights == nullptr) {
    for (std::uint32_t j = 0; j < k; ++j, row += kSimdBlock) {
      for (std::size_t lane = 0; lane < kGroup; ++lane) sum[lane] += p[row[lane]] - own[lane];
    }
    return sums;
  }
  const float* weight = umbrella.weights + offset;
  for (std::uint32_t j = 0; j < k; ++j, row += kSimdBlock, weight += kSimdBlock) {
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      sum[lane] += weight[lane] * (p[row[lane]] - own[lane]);
    }
  }
  return sums;
}

// Calls store(i, lambda umbrella(p)_i) for the samples [begin, end), whole groups of them.
template <typename Store>
void for_each_umbrella(const UmbrellaOperator& umbrella, float lambda, const Float4* p, std::size_t begin,
                       std::size_t end, Store store) {
  const NeighborGraph& graph = *umbrella.graph;
  const float factor = umbrella.weights == nullptr ? lambda / static_cast<float>(graph.k) : lambda;
  for (std::size_t i = begin; i < end; i += kGroup) {
    if (i % kSimdBlock == 0) {
      const std::size_t ahead = (i / kSimdBlock + kAhead) * graph.k * kSimdBlock;
      for (std::uint32_t j = 0; j < graph.k && ahead < graph.lanes.size(); ++j) {
        __builtin_prefetch(graph.lanes.data() + ahead + j * kSimdBlock);
      }
    }
    const Sums sum = umbrella_sums(umbrella, p, i);
    for (std::size_t lane = 0; lane < kGroup; ++lane) {
      Float4 step = sum[lane] * factor;
      if (umbrella.rates != nullptr && i + lane < graph.count) {
        step = sum[lane] * (factor * static_cast<float>(umbrella.rates[i + lane]));
      }
      store(i + lane, step);
    }
  }
}

Float4 projected(const UmbrellaOperator& umbrella, std::size_t i, const Float4& step) {
  return umbrella.normals == nullptr ? step : component_along(umbrella.normals->data()[i], step);
}

}  // namespace

void plain_step(const UmbrellaOperator& umbrella, float lambda, const Packed& from, Packed& to) {
  const Float4* p = from.data();
  Float4* q = to.data();
  parallel_for(from.size(), [&](std::size_t begin, std::size_t end) {
    for_each_umbrella(umbrella, lambda, p, begin, padded_to_block(end),
                      [&](std::size_t i, const Float4& step) { q[i] = p[i] + projected(umbrella, i, step); });
  });
}

void compensated_step(const UmbrellaOperator& umbrella, const ReverseNeighbors& listers, float lambda,
                      Packed& points, Packed& change) {
  POINTWRIGHT_CHECK(umbrella.rates == nullptr, "compensated steps have one lambda");
  Float4* p = points.data();
  Float4* u = change.data();
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for_each_umbrella(umbrella, lambda, p, begin, padded_to_block(end),
                      [&](std::size_t i, const Float4& step) { u[i] = step; });
  });
  const float share = 1.0F / static_cast<float>(umbrella.graph->k);
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    auto rest = static_cast<std::size_t>(
        std::lower_bound(listers.rest_sample.begin(), listers.rest_sample.end(), begin) -
        listers.rest_sample.begin());
    const std::uint32_t* rows = listers.rows.data();
    for (std::size_t i = begin; i < padded_to_block(end); i += kReverseLanes) {
      const std::uint32_t* row = rows + listers.slice_first[i / kReverseLanes] * kReverseLanes;
      const std::uint32_t* last = rows + listers.slice_first[i / kReverseLanes + 1] * kReverseLanes;
      std::array<Float4, kReverseLanes> sums{};
      Float4* sum = sums.data();
      for (; row != last; row += kReverseLanes) {
        __builtin_prefetch(row + 64 * kReverseLanes);
        for (std::size_t lane = 0; lane < kReverseLanes; ++lane) sum[lane] += u[row[lane]];
      }
      while (rest < listers.rest_sample.size() && listers.rest_sample[rest] < i + kReverseLanes) {
        Float4& more = sum[listers.rest_sample[rest] - i];
        for (std::uint32_t r = listers.rest_first[rest]; r < listers.rest_first[rest + 1]; ++r) {
          more += u[listers.rest[r]];
        }
        ++rest;
      }
      for (std::size_t lane = 0; lane < kReverseLanes; ++lane) {
        p[i + lane] += projected(umbrella, i + lane, u[i + lane] - sum[lane] * share);
      }
    }
  });
}

// K' = (1 - lambda) K + lambda W K, and about another center: sum_m K_jm |r_m - r_i|^2 = S_j + 2 (q_j - r_j)
// . (r_j - r_i) + |r_j - r_i|^2, q_j = sum_m K_jm r_m being sample j's position now.
void spread_step(const NeighborGraph& graph, float lambda, const Packed& rest, const Packed& from,
                 Packed& to) {
  const Float4* r = rest.data();
  const Float4* q = from.data();
  const float factor = lambda / static_cast<float>(graph.k);
  parallel_for(from.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < padded_to_block(end); ++i) {
      const std::uint32_t* row = graph.lanes.data() + i / kSimdBlock * graph.k * kSimdBlock + i % kSimdBlock;
      Float4 sum{};
      Float4 shift{};
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const std::uint32_t other = row[j * kSimdBlock];
        Float4 drift = q[other] - r[other];
        drift[3] = 0.0F;
        Float4 e = r[other] - r[i];
        e[3] = 0.0F;
        sum += q[other] - q[i];
        shift += (drift + drift + e) * e;
      }
      sum[3] += (shift[0] + shift[1]) + shift[2];
      to.data()[i] = q[i] + sum * factor;
    }
  });
}

}  // namespace pointwright
