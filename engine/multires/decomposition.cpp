// Alexa et al., "Point set surfaces", 2001 (the projection).
#include "engine/multires/decomposition.h"

#include <algorithm>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/multires/base_point_kernels.h"
#include "engine/multires/base_point_walk.h"
#include "engine/normals/plane_fit.h"

namespace pointwright {
namespace {

constexpr float kFallbackResidual = 0.05F;  // in sample spacings
constexpr float kFallbackDetail = 4.0F;     // in scales

// Fits planes to Q around a point by exact neighbours. One for each thread: it owns the candidate list.
class PlaneFitter {
 public:
  PlaneFitter(const BaseSurface& base, const KdTree& tree, const DecomposeParams& params)
      : base_(base),
        tree_(tree),
        gaussian_(params.weights == PlaneWeights::kGaussian),
        sigma_sq_(static_cast<double>(params.sigma) * static_cast<double>(params.sigma)) {}

  // The sample of Q nearest to p.
  std::uint32_t nearest(const Vec3f& p) {
    tree_.nearest(p, 1, found_);
    return found_[0].index;
  }

  // The weighted plane of Q's samples around r, those of another sheet left out.
  Plane fit(const Vec3f& r, const Plane& last) {
    tree_.nearest(r, 2 * (kCachedNeighbors + 1), found_);
    std::size_t count = 0;
    for (const Neighbor& neighbor : found_) {
      if (count > kCachedNeighbors) break;
      if (base_.normal[neighbor.index].cast<double>().dot(last.normal) > 0.0) found_[count++] = neighbor;
    }
    found_.resize(count);
    if (count == 0) return last;
    const double radius_sq = support_sq();
    PlaneFit plane;
    Vec3d side = Vec3d::Zero();
    for (const Neighbor& q : found_) {
      const double near = weight_at(radius_sq > 0.0 ? static_cast<double>(q.distance_sq) / radius_sq : 0.0);
      if (near <= 0.0) continue;
      const Vec3d n = base_.normal[q.index].cast<double>();
      // Samples of an opposite sheet fade out; same-sheet ones count whole.
      const double facing = std::clamp(2.0 * n.dot(last.normal), 0.0, 1.0);
      const double weight = near * facing;
      const Vec3f e = base_.position[q.index] - r;
      plane.add(static_cast<double>(e.x()), static_cast<double>(e.y()), static_cast<double>(e.z()), weight);
      side += weight * n;
    }
    if (!(plane.weight() > 1e-12)) return last;
    Plane result{plane.centroid() + r.cast<double>(), last.normal};
    Vec3d n;
    if (plane.normal(n)) result.normal = n.dot(side) < 0.0 ? Vec3d(-n) : n;
    return result;
  }

 private:
  // Squared radius at which the weights vanish: the distance of the first neighbour beyond the
  // kPlaneNeighbors nearest; a little beyond the farthest where there are no more.
  [[nodiscard]] double support_sq() const {
    if (found_.size() <= kPlaneNeighbors) return 1.5 * static_cast<double>(found_.back().distance_sq);
    return static_cast<double>(found_[kPlaneNeighbors].distance_sq);
  }

  // Of a sample whose squared distance is `x` times that of the support. None lies beyond it.
  [[nodiscard]] double weight_at(double x) const {
    const double inside = 1.0 - x;
    if (inside < 0.0) return 0.0;
    return gaussian_ ? std::exp(-x / sigma_sq_) : inside * inside * inside * inside;
  }

  const BaseSurface& base_;
  const KdTree& tree_;
  const bool gaussian_;
  const double sigma_sq_;
  std::vector<Neighbor> found_;  // ascending
};

Vec3d project(const Vec3d& p, const Plane& plane) {
  return p - (p - plane.point).dot(plane.normal) * plane.normal;
}

// Half Newton steps from p's projection onto `start` until one moves less than the tolerance.
void iterate_by_tree(const Vec3d& p, const Plane& start, double tolerance, std::uint32_t limit,
                     PlaneFitter& fitter, BasePoint& state) {
  state.plane = start;
  Vec3d r = project(p, start);
  for (std::uint32_t i = 0; i < limit && !state.converged; ++i) {
    state.plane = fitter.fit(r.cast<float>(), state.plane);
    const Vec3d step = project(p, state.plane) - r;
    ++state.iterations;
    state.residual = step.norm();
    state.converged = state.residual < tolerance;
    r += 0.5 * step;
  }
}

Plane plane_at(const BaseSurface& base, std::uint32_t q) {
  return {base.position[q].cast<double>(), base.normal[q].cast<double>()};
}

}  // namespace

Result<Decomposition> decompose(const Points& position, const Points& normal, const BaseSurface& base,
                                float spacing, const DecomposeParams& params,
                                const ExecutionContext& context) {
  return decompose(position, normal, base, base.counterpart, spacing, params, context);
}

Result<Decomposition> decompose(const Points& position, const Points& normal, const BaseSurface& base,
                                std::span<const std::uint32_t> counterpart, float spacing,
                                const DecomposeParams& params, const ExecutionContext& context) {
  if (!(params.sigma > 0.0F && params.sigma <= 100.0F)) {
    return out_of_range("sigma must lie in (0, 100]", "sigma", 100.0, static_cast<double>(params.sigma));
  }
  constexpr std::size_t kMostBaseSamples = (std::size_t{1} << 31) / kMaxPlaneCandidates;  // 32-bit indices
  if (base.position.size() > kMostBaseSamples) {
    return too_large("the base of a band has at most 85 million samples", "scales",
                     static_cast<double>(kMostBaseSamples), static_cast<double>(base.position.size()));
  }
  const std::size_t n = position.size();
  POINTWRIGHT_CHECK(normal.size() == n && counterpart.size() == n, "a normal and a counterpart per sample");
  Decomposition result;
  result.base.resize(n);
  result.normal.resize(n);
  result.detail.assign(n, 0.0F);
  const KdTree tree(base.position);
  const double tolerance = static_cast<double>(params.tolerance_spacing) * static_cast<double>(spacing);
  const double give_up = static_cast<double>(kFallbackResidual * spacing);
  const double far = static_cast<double>(kFallbackDetail * base.scale);
  struct Counts {
    std::size_t at_limit = 0, fallback = 0, flipped = 0, iterations = 0;
  };
  std::vector<Counts> counts((n + kParallelBlock - 1) / kParallelBlock);
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) {
        PlaneFitter fitter(base, tree, params);
        BasePointWalk walk(base, params, static_cast<float>(tolerance));
        Counts& count = counts[begin / kParallelBlock];
        std::vector<std::uint32_t> start(counterpart.begin() + static_cast<std::ptrdiff_t>(begin),
                                         counterpart.begin() + static_cast<std::ptrdiff_t>(end));
        if (params.start == IterationStart::kNearest) {
          for (std::size_t i = begin; i < end; ++i) start[i - begin] = fitter.nearest(position[i]);
        }
        std::vector<BasePoint> base_points(end - begin);
        walk.run(position, begin, start, base_points);
        for (std::size_t i = begin; i < end; ++i) {
          const Vec3d p = position[i].cast<double>();
          BasePoint& found = base_points[i - begin];
          if (!found.converged) {
            iterate_by_tree(p, plane_at(base, start[i - begin]), tolerance, params.tree_limit, fitter, found);
            if (!found.converged) ++count.at_limit;
          }
          count.iterations += found.iterations;
          // Undamped: p = r + d n holds whatever the convergence.
          Vec3d r = project(p, found.plane);
          const bool flipped = found.plane.normal.dot(normal[i].cast<double>()) <= 0.0;
          const bool lost = (!found.converged && found.residual > give_up) || (p - r).norm() > far;
          if (flipped) ++count.flipped;
          if (flipped || lost) {
            ++count.fallback;
            found.plane = plane_at(base, counterpart[i]);
            r = project(p, found.plane);
          }
          result.base.set(i, r.cast<float>());
          result.normal.set(i, found.plane.normal.cast<float>());
          result.detail[i] = static_cast<float>((p - r).dot(found.plane.normal));
        }
      },
      kParallelBlock, &context);
  if (context.is_cancelled()) return cancelled_error();
  std::size_t iterations = 0;
  for (const Counts& count : counts) {
    result.at_limit += count.at_limit;
    result.fallback += count.fallback;
    result.flipped += count.flipped;
    iterations += count.iterations;
  }
  result.mean_iterations = n > 0 ? static_cast<double>(iterations) / static_cast<double>(n) : 0.0;
  return result;
}

}  // namespace pointwright
