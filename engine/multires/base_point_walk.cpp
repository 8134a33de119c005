#include "engine/multires/base_point_walk.h"

#include <limits>

#include "engine/multires/base_point_kernels.h"

namespace pointwright {

static_assert(kCachedNeighbors + 1 == kMaxPlaneCandidates);

BasePointWalk::BasePointWalk(const BaseSurface& base, const DecomposeParams& params, float tolerance)
    : base_(base), params_(params), tolerance_(tolerance) {}

void BasePointWalk::keep(std::size_t from, std::size_t to) {
  if (from == to) return;
  sample_[to] = sample_[from];
  q_[to] = q_[from];
  for (Points* column : {&p_, &r_, &normal_, &point_}) column->set(to, (*column)[from]);
  damping_[to] = damping_[from];
  step_[to] = step_[from];
}

void BasePointWalk::run(const Points& position, std::size_t begin, std::span<const std::uint32_t> start,
                        std::span<BasePoint> found) {
  std::size_t active = start.size();
  const std::size_t padded = padded_to_block(active);
  const bool adaptive = params_.damping == Damping::kAdaptive;
  sample_.resize(active);
  q_.assign(padded, 0);
  damping_.assign(padded, adaptive ? 1.0F : 0.5F);
  step_.assign(padded, std::numeric_limits<float>::max());  // no step is long after none
  for (Points* column : {&p_, &r_, &normal_, &point_}) column->resize(active);
  for (std::size_t i = 0; i < active; ++i) {
    const std::uint32_t q = start[i];
    const Vec3f p = position[begin + i];
    const Vec3f n = base_.normal[q];
    const Vec3f point = base_.position[q] - p;
    sample_[i] = static_cast<std::uint32_t>(i);
    q_[i] = q;
    p_.set(i, p);
    normal_.set(i, n);
    point_.set(i, point);
    r_.set(i, point.dot(n) * n);
    found[i] = {.plane = {base_.position[q].cast<double>(), n.cast<double>()}};
  }
  const float sigma_sq = params_.sigma * params_.sigma;
  const BasePointKernelArgs args{
      .base = {base_.position.x(), base_.position.y(), base_.position.z()},
      .base_normal = {base_.normal.x(), base_.normal.y(), base_.normal.z()},
      .neighbors = base_.graph.lanes.data(),
      .k = base_.graph.k,
      .plane_neighbors = kPlaneNeighbors,
      .inverse_sigma_sq = params_.weights == PlaneWeights::kGaussian ? 1.0F / sigma_sq : 0.0F,
      .adaptive = adaptive,
      .p = {p_.x(), p_.y(), p_.z()},
      .q = q_.data(),
      .r = {r_.x(), r_.y(), r_.z()},
      .normal = {normal_.x(), normal_.y(), normal_.z()},
      .point = {point_.x(), point_.y(), point_.z()},
      .damping = damping_.data(),
      .step = step_.data()};
  const auto step = POINTWRIGHT_KERNEL(base_point_step);
  for (std::uint32_t iteration = 1; iteration <= params_.walk_limit && active > 0; ++iteration) {
    step(args, 0, padded_to_block(active));
    std::size_t left = 0;
    for (std::size_t i = 0; i < active; ++i) {
      const bool converged = step_[i] < tolerance_;
      if (!converged && iteration < params_.walk_limit) {
        keep(i, left++);
        continue;
      }
      const Vec3d p = p_[i].cast<double>();
      found[sample_[i]] = {.plane = {p + point_[i].cast<double>(), normal_[i].cast<double>()},
                           .residual = static_cast<double>(step_[i]),
                           .iterations = iteration,
                           .converged = converged};
    }
    active = left;
  }
}

}  // namespace pointwright
