// Alexa et al., "Point set surfaces", 2001 (the projection); adaptive damping instead of the paper's fixed
// 0.5.
#include "engine/multires/decomposition.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/normals/plane_fit.h"

namespace pointwright {
namespace {

constexpr float kFallbackResidual = 0.05F;  // in sample spacings
constexpr float kFallbackDetail = 4.0F;     // in scales
constexpr double kMinDamping = 0.25;

struct Plane {
  Vec3d point;
  Vec3d normal;
};

// What one sample's iteration came to.
struct BasePoint {
  Vec3d r;
  Plane plane;
  double residual = 0.0;
  std::uint32_t iterations = 0;
  bool converged = false;
};

class Projector {
 public:
  Projector(const BaseSurface& base, const KdTree& tree) : base_(base), tree_(tree) {}

  // The weighted plane of Q's samples around r, by walking the cached graph from `q` (updated to the nearest
  // found).
  Plane plane_by_walk(const Vec3f& r, std::uint32_t& q, const Plane& last) {
    q = walk(r, q);
    count_ = 0;
    candidate(q, r);
    for (std::uint32_t j = 0; j < base_.graph.k; ++j) {
      if (base_.graph.index(q, j) != q) candidate(base_.graph.index(q, j), r);
    }
    return fit(r, last);
  }
  Plane plane_by_tree(const Vec3f& r, const Plane& last) {
    tree_.nearest(r, 2 * (kCachedNeighbors + 1), found_);
    count_ = 0;
    for (const Neighbor& neighbor : found_) {
      if (count_ > kCachedNeighbors) break;
      if (base_.normal[neighbor.index].cast<double>().dot(last.normal) <= 0.0) continue;  // another sheet
      index_[count_] = neighbor.index;
      distance_sq_[count_++] = neighbor.distance_sq;
    }
    return fit(r, last);
  }

 private:
  void candidate(std::uint32_t q, const Vec3f& r) {
    index_[count_] = q;
    distance_sq_[count_++] = (base_.position[q] - r).squaredNorm();
  }
  // Hops to the nearest of the cached neighbours until none is nearer.
  std::uint32_t walk(const Vec3f& r, std::uint32_t q) const {
    float best = (base_.position[q] - r).squaredNorm();
    for (bool moved = true; moved;) {
      moved = false;
      const std::uint32_t from = q;
      for (std::uint32_t j = 0; j < base_.graph.k; ++j) {
        const std::uint32_t next = base_.graph.index(from, j);
        const float distance_sq = (base_.position[next] - r).squaredNorm();
        if (distance_sq < best) {
          best = distance_sq;
          q = next;
          moved = true;
        }
      }
    }
    return q;
  }
  Plane fit(const Vec3f& r, const Plane& last) {
    if (count_ == 0) return last;
    // r_k: the distance to the first sample beyond the kPlaneNeighbors nearest, where the weights vanish.
    std::array<float, kCachedNeighbors + 1> sorted{};
    std::copy_n(distance_sq_.begin(), count_, sorted.begin());
    const std::size_t rank = std::min<std::size_t>(kPlaneNeighbors, count_ - 1);
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(rank),
                     sorted.begin() + static_cast<std::ptrdiff_t>(count_));
    const double radius_sq = static_cast<double>(sorted[rank]) * (count_ <= kPlaneNeighbors ? 1.5 : 1.0);
    PlaneFit plane;
    Vec3d side = Vec3d::Zero();
    for (std::size_t c = 0; c < count_; ++c) {
      const double inside = radius_sq > 0.0 ? 1.0 - static_cast<double>(distance_sq_[c]) / radius_sq : 1.0;
      if (inside <= 0.0) continue;
      const Vec3d n = base_.normal[index_[c]].cast<double>();
      // Samples of an opposite sheet fade out; same-sheet ones count whole.
      const double facing = std::clamp(2.0 * n.dot(last.normal), 0.0, 1.0);
      const double weight = inside * inside * inside * inside * facing;
      plane.add((base_.position[index_[c]] - r).cast<double>(), weight);
      side += weight * n;
    }
    if (!(plane.weight() > 1e-12)) return last;
    Plane result{plane.centroid() + r.cast<double>(), last.normal};
    Vec3d n;
    if (plane.normal(n)) result.normal = n.dot(side) < 0.0 ? Vec3d(-n) : n;
    return result;
  }

  const BaseSurface& base_;
  const KdTree& tree_;
  std::vector<Neighbor> found_;
  std::array<std::uint32_t, kCachedNeighbors + 1> index_{};
  std::array<float, kCachedNeighbors + 1> distance_sq_{};
  std::size_t count_ = 0;
};

Vec3d project(const Vec3d& p, const Plane& plane) {
  return p - (p - plane.point).dot(plane.normal) * plane.normal;
}

// Newton steps from r until one moves less than the tolerance. `next_plane(r, last)` fits the plane around r.
template <typename NextPlane>
void iterate(const Vec3d& p, double tolerance, std::uint32_t limit, bool adaptive, NextPlane next_plane,
             BasePoint& state) {
  double damping = adaptive ? 1.0 : 0.5;
  double last_step = 0.0;
  for (std::uint32_t i = 0; i < limit; ++i) {
    state.plane = next_plane(state.r.template cast<float>(), state.plane);
    const Vec3d projected = project(p, state.plane);
    const double step = (projected - state.r).norm();
    ++state.iterations;
    state.residual = step;
    if (step < tolerance) {
      state.converged = true;
      break;
    }
    if (adaptive && i > 0)
      damping = step > 0.7 * last_step ? std::max(kMinDamping, 0.5 * damping) : std::min(1.0, 1.5 * damping);
    last_step = step;
    state.r += damping * (projected - state.r);
  }
  state.r = project(p, state.plane);  // undamped: p = r + d n holds whatever the convergence
}

}  // namespace

Result<Decomposition> decompose(const Points& position, const Points& normal, const BaseSurface& base,
                                float spacing, const DecomposeParams& params,
                                const ExecutionContext& context) {
  const std::size_t n = position.size();
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
        Projector projector(base, tree);
        Counts& count = counts[begin / kParallelBlock];
        for (std::size_t i = begin; i < end; ++i) {
          const Vec3d p = position[i].cast<double>();
          const std::uint32_t own = base.counterpart[i];
          const Plane own_plane{base.position[own].cast<double>(), base.normal[own].cast<double>()};
          std::uint32_t q = own;
          BasePoint found{.r = project(p, own_plane), .plane = own_plane};
          iterate(
              p, tolerance, params.walk_limit, true,
              [&](const Vec3f& r, const Plane& last) { return projector.plane_by_walk(r, q, last); }, found);
          if (!found.converged) {
            found.r = project(p, own_plane);
            found.plane = own_plane;
            iterate(
                p, tolerance, params.tree_limit, false,
                [&](const Vec3f& r, const Plane& last) { return projector.plane_by_tree(r, last); }, found);
            if (!found.converged) ++count.at_limit;
          }
          count.iterations += found.iterations;
          const Vec3d own_normal = normal[i].cast<double>();
          const bool flipped = found.plane.normal.dot(own_normal) <= 0.0;
          const bool lost = (!found.converged && found.residual > give_up) || (p - found.r).norm() > far;
          if (flipped) ++count.flipped;
          if (flipped || lost) {
            ++count.fallback;
            found.plane = own_plane;
            found.r = project(p, own_plane);
          }
          result.base.set(i, found.r.cast<float>());
          result.normal.set(i, found.plane.normal.cast<float>());
          result.detail[i] = static_cast<float>((p - found.r).dot(found.plane.normal));
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
