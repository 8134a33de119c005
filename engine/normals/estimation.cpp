#include "engine/normals/estimation.h"

#include <atomic>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation_kernels.h"
#include "engine/normals/plane_fit.h"

namespace pointwright {

std::size_t estimate_normals(const Points& points, const NeighborGraph& graph, const NormalParams& params,
                             Points& normal, const ExecutionContext* context) {
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  POINTWRIGHT_CHECK(params.sigma > 0.0F && params.sigma <= 100.0F, "sigma must lie in (0, 100]");
  normal.resize(points.size());
  const NormalKernelArgs args{.x = points.x(),
                              .y = points.y(),
                              .z = points.z(),
                              .neighbors = graph.lanes.data(),
                              .k = graph.k,
                              .sigma_sq = params.sigma * params.sigma,
                              .count = points.size(),
                              .normal_x = normal.x(),
                              .normal_y = normal.y(),
                              .normal_z = normal.z()};
  const auto kernel = POINTWRIGHT_KERNEL(estimate_normals_kernel);
  std::atomic<std::size_t> degenerate{0};  // whole numbers: the order of additions does not matter
  parallel_for(
      points.size(), [&](std::size_t begin, std::size_t end) { degenerate += kernel(args, begin, end); },
      kParallelBlock, context);
  return degenerate;
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
