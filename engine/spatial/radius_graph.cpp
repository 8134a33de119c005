#include "engine/spatial/radius_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/spatial/block_tree.h"
#include "engine/spatial/distinct_points.h"

namespace pointwright {
namespace {

// The lists of the samples of one parallel block, and how many were cut.
struct Part {
  std::vector<std::uint32_t> neighbors;
  std::size_t cut_count = 0;
};

}  // namespace

Result<void> validate(const RadiusParams& params) {
  if (!(params.radius > 0.0F) || !std::isfinite(params.radius)) {
    return out_of_range("a radius is a finite distance above 0", "radius", 0.0,
                        static_cast<double>(params.radius));
  }
  if (params.limit < 1 || params.limit > kMaxRadiusNeighbors) {
    return out_of_range("the limit of neighbours lies between 1 and " + std::to_string(kMaxRadiusNeighbors),
                        "limit", static_cast<double>(kMaxRadiusNeighbors), static_cast<double>(params.limit));
  }
  return {};
}

Result<RadiusGraph> build_radius_graph(const Points& points, const RadiusParams& params,
                                       const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  RadiusGraph graph;
  graph.first.assign(points.size() + 1, 0);
  const DistinctPoints distinct(points);
  const std::size_t n = distinct.points().size();
  graph.duplicate_count = points.size() - n;
  if (n < 2) return graph;

  // One slot more than the limit: whatever stands there was cut.
  const auto length = static_cast<std::uint32_t>(std::min<std::size_t>(params.limit + 1U, n));
  const float bound_sq =
      std::nextafter(params.radius * params.radius, std::numeric_limits<float>::infinity());
  const BlockTree tree(distinct.points());
  std::vector<Part> parts((n + kParallelBlock - 1) / kParallelBlock);
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) {
        Part& part = parts[begin / kParallelBlock];
        std::vector<std::int32_t> rows;
        tree.nearest_of_range(begin, end, length, bound_sq, rows);
        for (std::size_t d = begin; d < end; ++d) {
          const std::int32_t* row =
              rows.data() + (d - begin) / kSimdBlock * length * kSimdBlock + d % kSimdBlock;
          std::uint32_t found = 0;
          while (found < length && row[found * kSimdBlock] >= 0) ++found;
          const std::uint32_t kept = std::min(found, params.limit);
          for (std::size_t i = distinct.first(d); i < distinct.first(d + 1); ++i) {
            for (std::uint32_t j = 0; j < kept; ++j) {
              part.neighbors.push_back(distinct.first(static_cast<std::size_t>(row[j * kSimdBlock])));
            }
            graph.first[i + 1] = kept;
            part.cut_count += found > kept ? 1U : 0U;
          }
        }
      },
      kParallelBlock, context);
  if (context != nullptr && context->is_cancelled()) return cancelled_error();

  for (std::size_t i = 0; i < points.size(); ++i) graph.first[i + 1] += graph.first[i];
  graph.neighbors.resize(graph.first.back());
  parallel_for(
      parts.size(),
      [&](std::size_t begin, std::size_t end) {
        for (std::size_t p = begin; p < end; ++p) {
          const std::uint64_t at = graph.first[distinct.first(p * kParallelBlock)];
          std::copy(parts[p].neighbors.begin(), parts[p].neighbors.end(),
                    graph.neighbors.begin() + static_cast<std::ptrdiff_t>(at));
          parts[p].neighbors = {};
        }
      },
      1);
  for (const Part& part : parts) graph.cut_count += part.cut_count;
  return graph;
}

}  // namespace pointwright
