// Multilevel smoothing after Kobbelt, Campagna, Vorsatz and Seidel, "Interactive multi-resolution modeling on
// arbitrary meshes", 1998.
#include "engine/smoothing/v_cycle.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/smoothing/global_volume.h"
#include "engine/smoothing/ranges.h"
#include "engine/smoothing/umbrella_steps.h"

namespace pointwright {
namespace {

constexpr double kMostIterations = 100'000.0;

// The levels that a cycle visits, the finest first.
class Levels {
 public:
  Levels(const NeighborGraph& graph, const SmoothingHierarchy& hierarchy)
      : graph_(&graph), hierarchy_(&hierarchy) {}

  [[nodiscard]] std::size_t deepest() const { return hierarchy_->coarse.size(); }
  [[nodiscard]] const NeighborGraph& graph(std::size_t level) const {
    return level == 0 ? *graph_ : hierarchy_->coarse[level - 1].graph;
  }
  [[nodiscard]] const ReverseNeighbors& listers(std::size_t level) const {
    return level == 0 ? hierarchy_->listers : hierarchy_->coarse[level - 1].listers;
  }
  [[nodiscard]] const LevelMeasure& measure(std::size_t level) const {
    return level == 0 ? hierarchy_->measure : hierarchy_->coarse[level - 1].measure;
  }
  // The level below `level`, with its Psi and Psi^-1.
  [[nodiscard]] const CoarseLevel& below(std::size_t level) const { return hierarchy_->coarse[level]; }

 private:
  const NeighborGraph* graph_;
  const SmoothingHierarchy* hierarchy_;
};

// How deep, how much there, and what comes of it.
struct Plan {
  std::size_t depth = 0;
  std::uint32_t iterations = 0;  // on the coarsest level
  float lambda = 0.0F;           // of these
  double scale = 0.0;            // reached
};

// Steps of at most lambda that make up `lambdas`.
void set_steps(double lambdas, double lambda, Plan& plan) {
  if (lambdas <= 0.0) return;
  const double steps = std::min(std::ceil(lambdas / lambda - 1e-9), kMostIterations);
  plan.iterations = static_cast<std::uint32_t>(std::max(steps, 1.0));
  plan.lambda = static_cast<float>(std::min(lambdas / std::max(steps, 1.0), lambda));
}

// Plain steps: the variances of all levels add up to the scale's. Psi adds none, as it carries moves.
Plan plain_plan(const Levels& levels, std::size_t depth, const VCycleParams& params) {
  const auto lambda = static_cast<double>(params.lambda);
  const double goal = static_cast<double>(params.scale) * static_cast<double>(params.scale);
  double variance = 0.0;
  for (std::size_t level = 0; level < depth; ++level) {
    const double steps = params.pre_iterations + params.post_iterations;
    variance += levels.measure(level).variance_of(steps * lambda) + levels.below(level).up_variance;
  }
  Plan plan{.depth = depth};
  if (variance < goal) set_steps(levels.measure(depth).lambdas_for(goal - variance), lambda, plan);
  variance += levels.measure(depth).variance_of(plan.iterations * static_cast<double>(plan.lambda));
  plan.scale = std::sqrt(std::max(variance, 0.0));
  return plan;
}

// Compensated steps take a wave down by exp(-n lambda mu^2), mu = (2 pi / L)^2 g / 2 with g the variance of a
// plain step. At L = pi sqrt 2 s, where a Gaussian gives 1 / e, mu = g / s^2: the exponents of all levels,
// and those of Psi^-1, variance / s^2, add up to 1.
Plan compensated_plan(const Levels& levels, std::size_t depth, const VCycleParams& params) {
  const auto lambda = static_cast<double>(params.lambda);
  const double scale_sq = static_cast<double>(params.scale) * static_cast<double>(params.scale);
  double fourth = 0.0;  // sum of n lambda g^2
  double second = 0.0;  // variances of Psi^-1
  for (std::size_t level = 0; level < depth; ++level) {
    const double gain = levels.measure(level).step_variance();
    fourth += (params.pre_iterations + params.post_iterations) * lambda * gain * gain;
    second += levels.below(level).up_variance;
  }
  Plan plan{.depth = depth};
  const double gain = levels.measure(depth).step_variance();
  const double rest = scale_sq * scale_sq - scale_sq * second - fourth;
  if (rest > 0.0 && gain > 0.0) set_steps(rest / (gain * gain), lambda, plan);
  fourth += plan.iterations * static_cast<double>(plan.lambda) * gain * gain;
  // fourth / s^4 + second / s^2 = 1
  plan.scale = std::sqrt(std::max(0.0, 0.5 * (second + std::sqrt(second * second + 4.0 * fourth))));
  return plan;
}

Plan plan_for(const Levels& levels, const VCycleParams& params) {
  std::size_t depth = 0;
  while (depth < levels.deepest() && 3.0F * levels.measure(depth).spacing <= params.scale) ++depth;
  const auto at = [&](std::size_t d) {
    return params.preserve == VolumePreservation::kLocal ? compensated_plan(levels, d, params)
                                                         : plain_plan(levels, d, params);
  };
  // Many iterations on the way can be more than the scale: then less deep.
  Plan plan = at(depth);
  while (plan.iterations == 0 && plan.depth > 0) plan = at(plan.depth - 1);
  return plan;
}

// Samples of one level in the course of a cycle.
class State {
 public:
  State(Packed points, const NeighborGraph& graph, const ReverseNeighbors& listers, bool is_compensated)
      : graph_(&graph), listers_(&listers), is_compensated_(is_compensated), points_(std::move(points)) {}

  [[nodiscard]] Packed& points() { return points_; }

  // Phi. False where it was cancelled.
  bool smooth(std::uint32_t iterations, float lambda, const ExecutionContext* context) {
    if (graph_->k == 0) return true;
    if (iterations > 0 && other_.size() != points_.size()) other_ = Packed(points_.size());
    const UmbrellaOperator umbrella{.graph = graph_};
    for (std::uint32_t iteration = 0; iteration < iterations; ++iteration) {
      if (context != nullptr && context->is_cancelled()) return false;
      if (is_compensated_) {
        compensated_step(umbrella, *listers_, lambda, points_, other_);
      } else {
        plain_step(umbrella, lambda, points_, other_);
        std::swap(points_, other_);
      }
    }
    return true;
  }

 private:
  const NeighborGraph* graph_;
  const ReverseNeighbors* listers_;
  bool is_compensated_;
  Packed points_;
  Packed other_;
};

// Psi.
Packed restricted(const Packed& fine, const CoarseLevel& level) {
  Packed result(level.position.size());
  parallel_for(result.size(), [&](std::size_t begin, std::size_t end) {
    const Float4* p = fine.data();
    const std::uint32_t* child = level.child.data();
    for (std::size_t m = begin; m < end; ++m) {
      const std::uint32_t first = level.child_first[m];
      const std::uint32_t last = level.child_first[m + 1];
      Float4 sum{};
      for (std::uint32_t c = first; c < last; ++c) sum += p[child[c]];
      const Vec3f offset = level.child_offset[m];
      result.data()[m] =
          sum / static_cast<float>(last - first) + Float4{offset.x(), offset.y(), offset.z(), 0.0F};
    }
  });
  return result;
}

// Psi^-1.
void prolong(const Packed& coarse, const CoarseLevel& level, Packed& fine) {
  const std::uint32_t k = level.graph.k;
  parallel_for(fine.size(), [&](std::size_t begin, std::size_t end) {
    const Float4* q = coarse.data();
    const float* weight = level.weights.data() + begin * k;
    for (std::size_t i = begin; i < end; ++i, weight += k) {
      const std::uint32_t parent = level.parent[i];
      const std::uint32_t* row =
          level.graph.lanes.data() + parent / kSimdBlock * k * kSimdBlock + parent % kSimdBlock;
      const Float4 base = q[parent];
      Float4 sum{};
      for (std::uint32_t j = 0; j < k; ++j) sum += weight[j] * (q[row[j * kSimdBlock]] - base);
      fine.data()[i] = base + sum;
    }
  });
}

// Of each sample's move what is along the smoothed surface's normal.
Points moved_along_normals(const Points& points, const Points& smoothed, const NeighborGraph& graph) {
  Points normal;
  estimate_normals(smoothed, graph, NormalParams{}, normal);
  Points result(points.size());
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f move = smoothed[i] - points[i];
      result.set(i, points[i] + normal[i] * normal[i].dot(move));
    }
  });
  return result;
}

}  // namespace

Result<void> validate(const VCycleParams& params) {
  if (auto valid = validate_scale(params.scale); !valid) return valid;
  if (auto valid = validate_lambda(params.lambda); !valid) return valid;
  if (params.pre_iterations > 100) {
    return out_of_range("at most 100 iterations on the way down", "pre_iterations", 100,
                        params.pre_iterations);
  }
  if (params.post_iterations > 100) {
    return out_of_range("at most 100 iterations on the way up", "post_iterations", 100,
                        params.post_iterations);
  }
  if (params.preserve == VolumePreservation::kTaubin) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "Taubin's pass band belongs to the spacing and has no scale",
                 .field = "preserve"};
  }
  return {};
}

Result<VCycle> v_cycle(const Points& points, const Points& normals, const NeighborGraph& graph,
                       const SmoothingHierarchy& hierarchy, const VCycleParams& params,
                       const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  const bool is_global = params.preserve == VolumePreservation::kGlobal;
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  POINTWRIGHT_CHECK(hierarchy.coarse.empty() || hierarchy.coarse.front().parent.size() == points.size(),
                    "the hierarchy must be of these points");
  POINTWRIGHT_CHECK(!is_global || normals.size() == points.size(), "global rescaling needs normals");
  VCycle result;
  result.coarsest_spacing = hierarchy.measure.spacing;
  if (graph.k == 0 || params.scale == 0.0F) {
    result.points = points;
    return result;
  }
  std::optional<GlobalVolume> volume;
  if (is_global) {
    auto measured = GlobalVolume::of(points, normals, graph);
    if (!measured) return measured.error();
    volume = std::move(measured).value();
  }
  const Levels levels(graph, hierarchy);
  const Plan plan = plan_for(levels, params);
  result.depth = static_cast<std::uint32_t>(plan.depth);
  result.coarsest_spacing = levels.measure(plan.depth).spacing;
  result.bottom_iterations = plan.iterations;
  result.scale = static_cast<float>(plan.scale);

  const bool is_compensated = params.preserve == VolumePreservation::kLocal;
  std::vector<State> states;
  for (std::size_t level = 0; level <= plan.depth; ++level) {
    Packed start = level == 0 ? Packed(points) : restricted(states.back().points(), levels.below(level - 1));
    states.emplace_back(std::move(start), levels.graph(level), levels.listers(level), is_compensated);
    const bool is_bottom = level == plan.depth;
    if (!states.back().smooth(is_bottom ? plan.iterations : params.pre_iterations,
                              is_bottom ? plan.lambda : params.lambda, context)) {
      return cancelled_error();
    }
  }
  for (std::size_t level = plan.depth; level-- > 0;) {
    prolong(states.back().points(), levels.below(level), states[level].points());
    states.pop_back();
    if (!states.back().smooth(params.post_iterations, params.lambda, context)) return cancelled_error();
  }
  if (volume) {
    if (const auto restored = volume->restore(states.front().points(), 1); !restored) return restored.error();
  }
  if (context != nullptr && context->is_cancelled()) return cancelled_error();
  result.points = states.front().points().unpacked();
  if (params.direction == SmoothingDirection::kAlongNormal) {
    result.points = moved_along_normals(points, result.points, graph);
  }
  return result;
}

}  // namespace pointwright
