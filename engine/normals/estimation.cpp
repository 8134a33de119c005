#include "engine/normals/estimation.h"

#include <atomic>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/normals/plane_fit.h"

namespace pointwright {

std::size_t estimate_normals(const Points& points, const NeighborGraph& graph, const NormalParams& params,
                             Points& normal) {
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  POINTWRIGHT_CHECK(params.sigma > 0.0F && params.sigma <= 100.0F, "sigma must lie in (0, 100]");
  normal.resize(points.size());
  std::atomic<std::size_t> degenerate{0};
  const double sigma_sq = static_cast<double>(params.sigma) * static_cast<double>(params.sigma);
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      PlaneFit fit;
      fit.add(Vec3d::Zero(), 1.0);
      double r2 = 0;
      for (std::uint32_t j = 0; j < graph.k; ++j) r2 = std::max(r2, (double)(points[graph.index(i, j)] - points[i]).squaredNorm());
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const Vec3d d = (points[graph.index(i, j)] - points[i]).cast<double>();
        fit.add(d, r2 > 0 ? std::exp(-d.squaredNorm() / (sigma_sq * r2)) : 1.0);
      }
      Vec3d n;
      if (!fit.normal(n)) degenerate++;
      normal.set(i, n.cast<float>());
    }
  });
  return degenerate;
}
}
