// Taubin, "A signal processing approach to fair surface design", 1995; Desbrun et al., "Implicit fairing of
// irregular meshes using diffusion and curvature flow", 1999; local volume preservation after Hubeli and
// Gross, 2001.
#include "engine/smoothing/umbrella.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"

namespace pointwright {
namespace {

constexpr float kLambda = 0.5F;

// Normalised umbrella weights per neighbour, in the graph's layout; empty for uniform ones.
std::vector<float> rest_weights(const Points& points, const NeighborGraph& graph) {
  std::vector<float> weights(graph.lanes.size(), 0.0F);
  const std::vector<float> spacing = local_spacing(points, graph);
  parallel_for(graph.count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float sum = 0.0F;
      const auto slot = [&](std::uint32_t j) {
        return (i / kSimdBlock * graph.k + j) * kSimdBlock + i % kSimdBlock;
      };
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const float distance = (points[graph.index(i, j)] - points[i]).norm() + 0.3F * spacing[i];
        weights[slot(j)] = distance > 0.0F ? 1.0F / distance : 1.0F;
        sum += weights[slot(j)];
      }
      for (std::uint32_t j = 0; j < graph.k; ++j) weights[slot(j)] /= sum;
    }
  });
  return weights;
}

// Reverse neighbours in compressed rows: who lists sample i, in ascending order.
struct ReverseGraph {
  std::vector<std::uint32_t> first;   // N + 1
  std::vector<std::uint32_t> lister;  // N k
};

ReverseGraph reverse(const NeighborGraph& graph) {
  ReverseGraph result;
  result.first.assign(graph.count + 1, 0);
  for (std::size_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t j = 0; j < graph.k; ++j) ++result.first[graph.index(i, j) + 1U];
  }
  std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
  result.lister.resize(graph.count * graph.k);
  std::vector<std::uint32_t> cursor(result.first.begin(), result.first.end() - 1);
  for (std::size_t i = 0; i < graph.count; ++i) {
    for (std::uint32_t j = 0; j < graph.k; ++j) {
      result.lister[cursor[graph.index(i, j)]++] = static_cast<std::uint32_t>(i);
    }
  }
  return result;
}

// Eq. (8) at one sample.
Vec3f umbrella(const Points& points, const NeighborGraph& graph, const std::vector<float>& weights,
               std::size_t i) {
  const Vec3f p = points[i];
  Vec3f sum = Vec3f::Zero();
  if (weights.empty()) {
    for (std::uint32_t j = 0; j < graph.k; ++j) sum += points[graph.index(i, j)] - p;
    return graph.k > 0 ? Vec3f(sum / static_cast<float>(graph.k)) : sum;
  }
  for (std::uint32_t j = 0; j < graph.k; ++j) {
    const float weight = weights[(i / kSimdBlock * graph.k + j) * kSimdBlock + i % kSimdBlock];
    sum += weight * (points[graph.index(i, j)] - p);
  }
  return sum;
}

// Double-precision columns of the calibration: |p|^2 and p under the same steps as the samples.
struct Moments {
  std::array<std::vector<double>, 4> column;  // x y z |p|^2

  Moments(const Points& points, const Vec3f& center) {
    for (auto& c : column) c.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec3d p = (points[i] - center).cast<double>();
      for (std::size_t axis = 0; axis < 3; ++axis) column[axis][i] = p[static_cast<Eigen::Index>(axis)];
      column[3][i] = p.squaredNorm();
    }
  }
  void step(const NeighborGraph& graph, double lambda) {
    for (auto& c : column) {
      std::vector<double> next(c.size());
      parallel_for(c.size(), [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
          double sum = 0.0;
          for (std::uint32_t j = 0; j < graph.k; ++j) sum += c[graph.index(i, j)];
          next[i] = c[i] + lambda * (sum / static_cast<double>(graph.k) - c[i]);
        }
      });
      c.swap(next);
    }
  }
  // Median over the samples of the per-axis kernel variance, var_i / 2 on a surface.
  [[nodiscard]] double median_variance() const {
    std::vector<double> variance(column[0].size());
    for (std::size_t i = 0; i < variance.size(); ++i) {
      double mean_sq = 0.0;
      for (std::size_t axis = 0; axis < 3; ++axis) mean_sq += column[axis][i] * column[axis][i];
      variance[i] = 0.5 * std::max(0.0, column[3][i] - mean_sq);
    }
    const auto middle = variance.begin() + static_cast<std::ptrdiff_t>(variance.size() / 2);
    std::nth_element(variance.begin(), middle, variance.end());
    return *middle;
  }
};

void add_step(const Points& change, SmoothingDirection direction, const Points& normals, Points& points) {
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Vec3f move = change[i];
      if (direction == SmoothingDirection::kAlongNormal) move = normals[i] * normals[i].dot(move);
      points.set(i, points[i] + move);
    }
  });
}

}  // namespace

Result<void> validate(const UmbrellaParams& params) {
  if (!(params.lambda > 0.0F && params.lambda <= 0.7F)) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "lambda must lie in (0, 0.7]",
                 .field = "lambda",
                 .limit = 0.7,
                 .actual = static_cast<double>(params.lambda)};
  }
  if (params.iterations > 100'000) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "at most 100,000 iterations",
                 .field = "iterations",
                 .limit = 100'000,
                 .actual = static_cast<double>(params.iterations)};
  }
  return {};
}

Result<Points> smooth(const Points& points, const Points& normals, const NeighborGraph& graph,
                      const UmbrellaParams& params, const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  POINTWRIGHT_CHECK(params.direction == SmoothingDirection::kFree || normals.size() == points.size(),
                    "smoothing along the normals needs them");
  Points result = points;
  if (graph.k == 0) return result;
  const std::vector<float> weights =
      params.weights == UmbrellaWeights::kUniform ? std::vector<float>{} : rest_weights(points, graph);
  const ReverseGraph listers =
      params.preserve == VolumePreservation::kLocal ? reverse(graph) : ReverseGraph{};
  Points step(points.size());
  Points compensated(points.size());
  for (std::uint32_t iteration = 0; iteration < params.iterations; ++iteration) {
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        step.set(i, params.lambda * umbrella(result, graph, weights, i));  // Eq. (7)
      }
    });
    if (params.preserve == VolumePreservation::kNone) {
      add_step(step, params.direction, normals, result);
      continue;
    }
    // Eq. (9): every neighbour of p moves by (p - p') / k. Gathered: sample i collects from those that list
    // it.
    const float share = 1.0F / static_cast<float>(graph.k);
    parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Vec3f returned = Vec3f::Zero();
        for (std::uint32_t r = listers.first[i]; r < listers.first[i + 1]; ++r)
          returned += step[listers.lister[r]];
        compensated.set(i, step[i] - share * returned);
      }
    });
    add_step(compensated, params.direction, normals, result);
  }
  return result;
}

Result<ScaledSmoothing> smooth_to_scale(const Points& points, const Points& normals,
                                        const NeighborGraph& graph, float scale, SmoothingDirection direction,
                                        const ExecutionContext* context) {
  constexpr std::uint32_t kMaxIterations = 10'000;
  if (!std::isfinite(scale) || scale < 0.0F) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the smoothing scale must be finite and not negative",
                 .field = "scale"};
  }
  ScaledSmoothing result{.points = points};
  const double goal = static_cast<double>(scale) * static_cast<double>(scale);
  if (graph.k == 0 || goal == 0.0) return result;
  const Box3f box = bounds_of(points);
  const Vec3f center = 0.5F * (box.min + box.max);
  Moments moments(points, center);
  double reached = 0.0;
  double stalled_at = -1.0;
  while (reached < goal * (1.0 - 1e-3)) {
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    if (result.iterations == kMaxIterations || reached <= stalled_at) {
      return Error{.code = ErrorCode::kInvalidArgument,
                   .message = "the smoothing scale is out of reach of iteration at this density",
                   .field = "scale",
                   .limit = std::sqrt(reached),
                   .actual = static_cast<double>(scale)};
    }
    Moments trial = moments;
    trial.step(graph, static_cast<double>(kLambda));
    const double next = trial.median_variance();
    float lambda = kLambda;
    if (next > goal) {  // the last step: variance grows in proportion to lambda
      lambda = kLambda * static_cast<float>((goal - reached) / (next - reached));
      trial = moments;
      trial.step(graph, static_cast<double>(lambda));
    }
    UmbrellaParams params{.direction = direction, .lambda = lambda, .iterations = 1};
    auto smoothed = smooth(result.points, normals, graph, params, context);
    if (!smoothed) return smoothed.error();
    result.points = std::move(smoothed).value();
    moments = std::move(trial);
    ++result.iterations;
    stalled_at = reached;
    reached = moments.median_variance();
  }
  result.scale = static_cast<float>(std::sqrt(reached));
  return result;
}

}  // namespace pointwright
