// Alexa et al., "Point set surfaces", 2001 (the projection).
#include "engine/multires/decomposition.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/out_of_range.h"
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

// One sample of Q beside its normal, so that a candidate costs one cache line.
struct alignas(32) PackedSample {
  float x, y, z;
  float nx, ny, nz;
};

std::vector<PackedSample> pack(const BaseSurface& base) {
  std::vector<PackedSample> packed(base.position.size());
  for (std::size_t i = 0; i < packed.size(); ++i) {
    const Vec3f p = base.position[i];
    const Vec3f n = base.normal[i];
    packed[i] = {p.x(), p.y(), p.z(), n.x(), n.y(), n.z()};
  }
  return packed;
}

// Fits planes to Q around a point. One for each thread: it owns the candidate list.
class PlaneFitter {
 public:
  PlaneFitter(const BaseSurface& base, const std::vector<PackedSample>& samples, const KdTree& tree,
              const DecomposeParams& params)
      : base_(base),
        samples_(samples),
        tree_(tree),
        gaussian_(params.weights == PlaneWeights::kGaussian),
        sigma_sq_(static_cast<double>(params.sigma) * static_cast<double>(params.sigma)) {}

  // The sample of Q nearest to p.
  std::uint32_t nearest(const Vec3f& p) {
    tree_.nearest(p, 1, found_);
    return found_[0].index;
  }

  // The weighted plane of Q's samples around r: hops from `q` to the nearest of its cached neighbours until
  // none is nearer (q is updated), then fits to that sample and its neighbours.
  Plane by_walk(const Vec3f& r, std::uint32_t& q, const Plane& last) {
    for (;;) {
      count_ = 0;
      add_candidate(q, r);
      std::size_t nearest = 0;
      for (std::uint32_t j = 0; j < base_.graph.k; ++j) {
        const std::uint32_t next = base_.graph.index(q, j);
        if (next == q) continue;
        add_candidate(next, r);
        if (distance_sq_[count_ - 1] < distance_sq_[nearest]) nearest = count_ - 1;
      }
      if (nearest == 0) break;
      q = index_[nearest];
    }
    return fit(r, last);
  }

  // The same with exact neighbours, those of another sheet left out.
  Plane by_tree(const Vec3f& r, const Plane& last) {
    tree_.nearest(r, 2 * (kCachedNeighbors + 1), found_);
    count_ = 0;
    for (const Neighbor& neighbor : found_) {
      if (count_ > kCachedNeighbors) break;
      if (base_.normal[neighbor.index].cast<double>().dot(last.normal) <= 0.0) continue;
      index_[count_] = neighbor.index;
      distance_sq_[count_++] = neighbor.distance_sq;
    }
    return fit(r, last);
  }

 private:
  void add_candidate(std::uint32_t q, const Vec3f& r) {
    const PackedSample& s = samples_[q];
    const float dx = s.x - r.x();
    const float dy = s.y - r.y();
    const float dz = s.z - r.z();
    index_[count_] = q;
    distance_sq_[count_++] = dx * dx + dy * dy + dz * dz;
  }

  // Squared radius at which the weights vanish: the distance of the first candidate beyond the
  // kPlaneNeighbors nearest; a little beyond the farthest where there are no more.
  [[nodiscard]] double support_sq() const {
    std::array<float, kCachedNeighbors + 1> sorted{};
    const auto end = std::copy_n(distance_sq_.begin(), count_, sorted.begin());
    if (count_ <= kPlaneNeighbors) return 1.5 * static_cast<double>(*std::max_element(sorted.begin(), end));
    std::nth_element(sorted.begin(), sorted.begin() + kPlaneNeighbors, end);
    return static_cast<double>(sorted[kPlaneNeighbors]);
  }

  // Of a sample whose squared distance is `x` times that of the support. None lies beyond it.
  [[nodiscard]] double weight_at(double x) const {
    const double inside = 1.0 - x;
    if (inside < 0.0) return 0.0;
    return gaussian_ ? std::exp(-x / sigma_sq_) : inside * inside * inside * inside;
  }

  Plane fit(const Vec3f& r, const Plane& last) {
    if (count_ == 0) return last;
    const double radius_sq = support_sq();
    PlaneFit plane;
    Vec3d side = Vec3d::Zero();
    for (std::size_t c = 0; c < count_; ++c) {
      const double near = weight_at(radius_sq > 0.0 ? static_cast<double>(distance_sq_[c]) / radius_sq : 0.0);
      if (near <= 0.0) continue;
      const PackedSample& s = samples_[index_[c]];
      const Vec3d n(static_cast<double>(s.nx), static_cast<double>(s.ny), static_cast<double>(s.nz));
      // Samples of an opposite sheet fade out; same-sheet ones count whole.
      const double facing = std::clamp(2.0 * n.dot(last.normal), 0.0, 1.0);
      const double weight = near * facing;
      plane.add(static_cast<double>(s.x - r.x()), static_cast<double>(s.y - r.y()),
                static_cast<double>(s.z - r.z()), weight);
      side += weight * n;
    }
    if (!(plane.weight() > 1e-12)) return last;
    Plane result{plane.centroid() + r.cast<double>(), last.normal};
    Vec3d n;
    if (plane.normal(n)) result.normal = n.dot(side) < 0.0 ? Vec3d(-n) : n;
    return result;
  }

  const BaseSurface& base_;
  const std::vector<PackedSample>& samples_;
  const KdTree& tree_;
  const bool gaussian_;
  const double sigma_sq_;
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
  if (!(params.sigma > 0.0F && params.sigma <= 100.0F)) {
    return out_of_range("sigma must lie in (0, 100]", "sigma", 100.0, static_cast<double>(params.sigma));
  }
  const std::size_t n = position.size();
  Decomposition result;
  result.base.resize(n);
  result.normal.resize(n);
  result.detail.assign(n, 0.0F);
  const KdTree tree(base.position);
  const std::vector<PackedSample> samples = pack(base);
  const double tolerance = static_cast<double>(params.tolerance_spacing) * static_cast<double>(spacing);
  const double give_up = static_cast<double>(kFallbackResidual * spacing);
  const double far = static_cast<double>(kFallbackDetail * base.scale);
  struct Counts {
    std::size_t at_limit = 0, fallback = 0, flipped = 0, iterations = 0;
  };
  const bool start_nearest = params.start == IterationStart::kNearest;
  const bool adaptive = params.damping == Damping::kAdaptive;
  std::vector<Counts> counts((n + kParallelBlock - 1) / kParallelBlock);
  parallel_for(
      n,
      [&](std::size_t begin, std::size_t end) {
        PlaneFitter fitter(base, samples, tree, params);
        Counts& count = counts[begin / kParallelBlock];
        for (std::size_t i = begin; i < end; ++i) {
          const Vec3d p = position[i].cast<double>();
          const std::uint32_t own = base.counterpart[i];
          const Plane own_plane{base.position[own].cast<double>(), base.normal[own].cast<double>()};
          std::uint32_t q = start_nearest ? fitter.nearest(position[i]) : own;
          const Plane start{base.position[q].cast<double>(), base.normal[q].cast<double>()};
          BasePoint found{.r = project(p, start), .plane = start};
          iterate(
              p, tolerance, params.walk_limit, adaptive,
              [&](const Vec3f& r, const Plane& last) { return fitter.by_walk(r, q, last); }, found);
          if (!found.converged) {
            found.r = project(p, start);
            found.plane = start;
            iterate(
                p, tolerance, params.tree_limit, false,
                [&](const Vec3f& r, const Plane& last) { return fitter.by_tree(r, last); }, found);
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
