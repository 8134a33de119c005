#include "engine/normals/estimation.h"

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation_kernels.h"
#include "engine/normals/plane_fit.h"

namespace pointwright {

namespace {

// The lists of a block of samples as rows [j][lane], short ones filled up with the sample itself; returns how
// many rows.
std::uint32_t fill_rows(const RadiusGraph& graph, std::size_t begin, std::vector<std::uint32_t>& rows) {
  const std::size_t end = std::min(graph.count(), begin + kSimdBlock);
  std::size_t k = 0;
  for (std::size_t i = begin; i < end; ++i) k = std::max(k, graph.of(i).size());
  rows.assign(k * kSimdBlock, 0U);
  for (std::size_t i = begin; i < end; ++i) {
    const auto list = graph.of(i);
    for (std::size_t j = 0; j < k; ++j) {
      rows[j * kSimdBlock + i - begin] = j < list.size() ? list[j] : static_cast<std::uint32_t>(i);
    }
  }
  return static_cast<std::uint32_t>(k);
}

// Calls kernel(args, begin, end) for blocks of samples; it returns how many of them are degenerate.
template <typename Kernel>
std::size_t estimate(const Points& points, const NormalParams& params, Points& normal,
                     const ExecutionContext* context, const Kernel& kernel) {
  POINTWRIGHT_CHECK(params.sigma > 0.0F && params.sigma <= 100.0F, "sigma must lie in (0, 100]");
  normal.resize(points.size());
  const NormalKernelArgs args{.x = points.x(),
                              .y = points.y(),
                              .z = points.z(),
                              .neighbors = nullptr,
                              .k = 0,
                              .sigma_sq = params.sigma * params.sigma,
                              .count = points.size(),
                              .normal_x = normal.x(),
                              .normal_y = normal.y(),
                              .normal_z = normal.z()};
  std::atomic<std::size_t> degenerate{0};  // whole numbers: the order of additions does not matter
  parallel_for(
      points.size(), [&](std::size_t begin, std::size_t end) { degenerate += kernel(args, begin, end); },
      kParallelBlock, context);
  return degenerate;
}

}  // namespace

std::size_t estimate_normals(const Points& points, const NeighborGraph& graph, const NormalParams& params,
                             Points& normal, const ExecutionContext* context) {
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  const auto kernel = POINTWRIGHT_KERNEL(estimate_normals_kernel);
  return estimate(points, params, normal, context,
                  [&](NormalKernelArgs args, std::size_t begin, std::size_t end) {
                    args.neighbors = graph.row(begin / kSimdBlock, 0);
                    args.k = graph.k;
                    return kernel(args, begin, end);
                  });
}

std::size_t estimate_normals(const Points& points, const RadiusGraph& graph, const NormalParams& params,
                             Points& normal, const ExecutionContext* context) {
  POINTWRIGHT_CHECK(graph.count() == points.size(), "the graph must be of these points");
  const auto kernel = POINTWRIGHT_KERNEL(estimate_normals_kernel);
  return estimate(points, params, normal, context,
                  [&](NormalKernelArgs args, std::size_t begin, std::size_t end) {
                    std::size_t degenerate = 0;
                    std::vector<std::uint32_t> rows;
                    for (; begin < end; begin += kSimdBlock) {
                      args.k = fill_rows(graph, begin, rows);
                      args.neighbors = rows.data();
                      degenerate += kernel(args, begin, begin + kSimdBlock);
                    }
                    return degenerate;
                  });
}

void refit_normals(const Points& points, const NeighborGraph& graph, Points& normals) {
  Points fitted(points.size());
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      PlaneFit fit;
      fit.add(0.0, 0.0, 0.0, 1.0);
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const Vec3d e = (points[graph.index(i, j)] - points[i]).cast<double>();
        fit.add(e.x(), e.y(), e.z(), 1.0);
      }
      const Vec3d before = normals[i].cast<double>();
      Vec3d n;
      if (!fit.normal(n)) n = before;
      fitted.set(i, (n.dot(before) < 0.0 ? Vec3d(-n) : n).cast<float>());
    }
  });
  normals = std::move(fitted);
}

}  // namespace pointwright
