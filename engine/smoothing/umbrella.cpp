// Taubin, "A signal processing approach to fair surface design", 1995; Desbrun et al., "Implicit fairing of
// irregular meshes using diffusion and curvature flow", 1999; local volume preservation after Hubeli and
// Gross, 2001.
#include "engine/smoothing/umbrella.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"

namespace pointwright {
namespace {

constexpr float kLambda = 0.5F;
// The variance no longer grows where a step adds less than this part of what the first one did.
constexpr double kExhausted = 0.01;
// Bounds of a sample's part of lambda = 0.5: plain steps are stable up to 1.2.
constexpr double kLeastRate = 0.25;
constexpr double kGreatestRate = 1.6;
// Determinant over squared trace of a flat neighbourhood's scatter, below which it is a line.
constexpr double kCollinear = 1e-12;

// Where the weight of neighbour j of sample i stands, in the graph's layout.
std::size_t slot_of(const NeighborGraph& graph, std::size_t i, std::uint32_t j) {
  return (i / kSimdBlock * graph.k + j) * kSimdBlock + i % kSimdBlock;
}

// Normalised umbrella weights per neighbour, in the graph's layout; empty for uniform ones.
std::vector<float> rest_weights(const Points& points, const NeighborGraph& graph) {
  std::vector<float> weights(graph.lanes.size(), 0.0F);
  const std::vector<float> spacing = local_spacing(points, graph);
  parallel_for(graph.count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float sum = 0.0F;
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const float distance = (points[graph.index(i, j)] - points[i]).norm() + 0.3F * spacing[i];
        weights[slot_of(graph, i, j)] = distance > 0.0F ? 1.0F / distance : 1.0F;
        sum += weights[slot_of(graph, i, j)];
      }
      for (std::uint32_t j = 0; j < graph.k; ++j) weights[slot_of(graph, i, j)] /= sum;
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
    const float weight = weights[slot_of(graph, i, j)];
    sum += weight * (points[graph.index(i, j)] - p);
  }
  return sum;
}

// What a step along the normals does to heights over the tangent planes. The normal is that of the plane
// fitted to a sample and its neighbours, so n . u leaves out of the umbrella vector u what a plane's slope
// would give: sum (f_j - f_i) / k - u . grad f, grad f the least-squares gradient. That is an umbrella with
// weights 1 / k - c_j, c_j = (y_j - m)' C^-1 u, m and C the mean and the scatter of the k + 1 points y: plane
// heights stay, so the weights' mean stays on the sample. Each c_j is at most (k + 1) / k, the leverages
// being at most 1.
std::vector<float> level_weights(const Points& points, const Points& normals, const NeighborGraph& graph) {
  std::vector<float> weights(graph.lanes.size(), 0.0F);
  parallel_for(graph.count, [&](std::size_t begin, std::size_t end) {
    std::vector<Eigen::Vector2d> y(graph.k);
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d along = normals[i].cast<double>().unitOrthogonal();
      const Vec3d across = normals[i].cast<double>().cross(along);
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const Vec3d e = (points[graph.index(i, j)] - points[i]).cast<double>();
        y[j] = {e.dot(along), e.dot(across)};
        sum += y[j];
        scatter += y[j] * y[j].transpose();
      }
      const Eigen::Vector2d mean = sum / static_cast<double>(graph.k + 1);
      scatter -= static_cast<double>(graph.k + 1) * mean * mean.transpose();
      const double size = scatter.trace();
      const bool spans_plane = scatter.determinant() > kCollinear * size * size;
      const Eigen::Vector2d slope =
          spans_plane ? Eigen::Vector2d(scatter.inverse() * sum / static_cast<double>(graph.k))
                      : Eigen::Vector2d(Eigen::Vector2d::Zero());
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        weights[slot_of(graph, i, j)] =
            static_cast<float>(1.0 / static_cast<double>(graph.k) - slope.dot(y[j] - mean));
      }
    }
  });
  return weights;
}

// Mean squared distance to the neighbours, plain (no weights) or weighted: lambda times this is the variance
// that a step adds to a sample's weights.
std::vector<double> mean_squares(const Points& points, const NeighborGraph& graph,
                                 const std::vector<float>& weights = {}) {
  std::vector<double> result(points.size());
  parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      double sum = 0.0;
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const auto square = static_cast<double>((points[graph.index(i, j)] - points[i]).squaredNorm());
        sum += weights.empty() ? square / static_cast<double>(graph.k)
                               : static_cast<double>(weights[slot_of(graph, i, j)]) * square;
      }
      result[i] = sum;
    }
  });
  return result;
}

// Of each sample's lambda: what makes steps mean the same where samples are dense and where they are sparse.
std::vector<double> step_rates(const std::vector<double>& gain, const NeighborGraph& graph) {
  std::vector<double> smooth_gain(gain.size());  // a single sample's own gain scatters too much
  for (std::size_t i = 0; i < gain.size(); ++i) {
    double sum = gain[i];
    for (std::uint32_t j = 0; j < graph.k; ++j) sum += gain[graph.index(i, j)];
    smooth_gain[i] = sum / static_cast<double>(graph.k + 1);
  }
  const double middle = median(smooth_gain);
  std::vector<double> rate(gain.size(), 1.0);
  for (std::size_t i = 0; i < gain.size(); ++i) {
    if (smooth_gain[i] > 0.0) rate[i] = std::clamp(middle / smooth_gain[i], kLeastRate, kGreatestRate);
  }
  return rate;
}

// The variance that the steps have given to the weights of each sample's neighbourhood, in double precision.
//
// Free steps: rows of W^n; |p|^2 and p under the same steps give it about the mean, and samples drift to that
// mean. Steps along the normals leave the drift out (level_weights) and keep the mean on the sample: a step
// adds its gain and carries on, under the same weights, what the neighbours have. The first of them takes the
// normals that it is given for the surface's own, which have no error of a fit: its gain is the plain one.
class KernelVariance {
 public:
  KernelVariance(const Points& points, const Points& normals, const NeighborGraph& graph,
                 SmoothingDirection direction)
      : graph_(&graph), is_free_(direction == SmoothingDirection::kFree), columns_(is_free_ ? 4 : 1) {
    for (auto& c : columns_) c.resize(points.size());
    if (!is_free_) {
      weights_ = level_weights(points, normals, graph);
      first_gain_ = mean_squares(points, graph);
      gain_ = mean_squares(points, graph, weights_);
      rate_ = step_rates(first_gain_, graph);
      return;
    }
    const Box3f box = bounds_of(points);
    const Vec3f center = 0.5F * (box.min + box.max);
    for_each_sample([&](std::size_t i) {
      const Vec3d p = (points[i] - center).cast<double>();
      for (std::size_t axis = 0; axis < 3; ++axis) columns_[axis][i] = p[static_cast<Eigen::Index>(axis)];
      columns_[3][i] = p.squaredNorm();
    });
  }

  // A sample's part of a step's lambda.
  [[nodiscard]] double rate(std::size_t i) const { return is_free_ ? 1.0 : rate_[i]; }

  // What changes from step to step: x y z |p|^2, or the variance itself.
  using Columns = std::vector<std::vector<double>>;

  // The columns after one more step of lambda.
  [[nodiscard]] Columns stepped(double lambda) const {
    Columns result(columns_.size(), std::vector<double>(graph_->count));
    for (std::size_t column = 0; column < columns_.size(); ++column) {
      const std::vector<double>& c = columns_[column];
      for_each_sample([&](std::size_t i) {
        double sum = 0.0;
        for (std::uint32_t j = 0; j < graph_->k; ++j) {
          const double weight = is_free_ ? 1.0 / static_cast<double>(graph_->k)
                                         : static_cast<double>(weights_[slot_of(*graph_, i, j)]);
          sum += weight * (c[graph_->index(i, j)] - c[i]);
        }
        const double gain = is_free_ ? 0.0 : is_first_ ? first_gain_[i] : gain_[i];
        result[column][i] = c[i] + lambda * rate(i) * (sum + gain);
      });
    }
    return result;
  }
  void take(Columns stepped) {
    columns_ = std::move(stepped);
    is_first_ = false;
  }

  // Median over the samples of the variance per axis, half of the whole on a surface.
  [[nodiscard]] double median(const Columns& columns) const {
    std::vector<double> variance = columns.back();
    if (is_free_) {
      for_each_sample([&](std::size_t i) {
        for (std::size_t axis = 0; axis < 3; ++axis) variance[i] -= columns[axis][i] * columns[axis][i];
      });
    }
    return 0.5 * std::max(0.0, pointwright::median(std::move(variance)));
  }

 private:
  template <typename Body>
  void for_each_sample(Body body) const {
    parallel_for(graph_->count, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) body(i);
    });
  }

  const NeighborGraph* graph_;
  bool is_free_;
  Columns columns_;
  std::vector<float> weights_;  // along the normals, as the next three
  std::vector<double> first_gain_, gain_, rate_;
  bool is_first_ = true;
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
                                        std::uint32_t max_iterations, const ExecutionContext* context) {
  if (!std::isfinite(scale) || scale < 0.0F) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the smoothing scale must be finite and not negative",
                 .field = "scale"};
  }
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  POINTWRIGHT_CHECK(direction == SmoothingDirection::kFree || normals.size() == points.size(),
                    "smoothing along the normals needs them");
  ScaledSmoothing result{.points = points};
  const double goal = static_cast<double>(scale) * static_cast<double>(scale);
  if (graph.k == 0 || goal == 0.0) return result;
  KernelVariance variance(points, normals, graph, direction);
  Points current = normals;
  Points change(points.size());
  double reached = 0.0;
  double first_gain = 0.0;
  while (reached < goal * (1.0 - 1e-3) && result.iterations < max_iterations) {
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    KernelVariance::Columns trial = variance.stepped(static_cast<double>(kLambda));
    double next = variance.median(trial);
    if (result.iterations == 0) first_gain = next;
    if (next - reached <= kExhausted * first_gain) break;
    float lambda = kLambda;
    if (next > goal) {  // the last step: variance grows in proportion to lambda
      lambda = kLambda * static_cast<float>((goal - reached) / (next - reached));
      trial = variance.stepped(static_cast<double>(lambda));
      next = variance.median(trial);
    }
    if (direction == SmoothingDirection::kAlongNormal && result.iterations > 0) {
      refit_normals(result.points, graph, current);
    }
    parallel_for(points.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        change.set(i, lambda * static_cast<float>(variance.rate(i)) * umbrella(result.points, graph, {}, i));
      }
    });
    add_step(change, direction, current, result.points);
    variance.take(std::move(trial));
    ++result.iterations;
    reached = next;
  }
  result.scale = static_cast<float>(std::sqrt(reached));
  return result;
}

}  // namespace pointwright
