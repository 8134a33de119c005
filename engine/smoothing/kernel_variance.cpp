// The second moments of a composition of local averages; bounds after Bhatia and Davis, "A better bound on
// the variance", 2000; strongly connected components after Tarjan, 1972.
#include "engine/smoothing/kernel_variance.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/median.h"
#include "engine/core/parallel.h"
#include "engine/smoothing/umbrella_steps.h"

namespace pointwright {
namespace {

// Bounds of a sample's part of lambda = 0.5: plain steps are stable up to 1.2.
constexpr double kLeastRate = 0.25;
constexpr double kGreatestRate = 1.6;
// Determinant over squared trace of a flat neighbourhood's scatter, below which it is a line.
constexpr double kCollinear = 1e-12;

// Where the weight of neighbour j of sample i stands, in the graph's layout.
std::size_t slot_of(const NeighborGraph& graph, std::size_t i, std::uint32_t j) {
  return (i / kSimdBlock * graph.k + j) * kSimdBlock + i % kSimdBlock;
}

template <typename Body>
void for_each_sample(std::size_t count, Body body) {
  parallel_for(count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
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

// The boxes of what each sample's steps can reach, itself included: samples that reach each other share one,
// and a component is complete after those that it leads to (Tarjan's order). Iterative: paths are as long as
// the cloud.
std::vector<Box3f> reachable_boxes(const Points& points, const NeighborGraph& graph) {
  constexpr std::uint32_t kNone = UINT32_MAX;
  const std::size_t n = points.size();
  std::vector<std::uint32_t> order(n, kNone);   // of discovery
  std::vector<std::uint32_t> lowest(n, kNone);  // the earliest one on the stack that is reached
  std::vector<std::uint32_t> component(n, kNone);
  std::vector<std::uint32_t> next(n, 0);  // neighbour to look at
  std::vector<std::uint32_t> path;
  std::vector<std::uint32_t> stack;
  std::vector<Box3f> box;
  std::uint32_t discovered = 0;
  for (std::uint32_t root = 0; root < n; ++root) {
    if (order[root] != kNone) continue;
    path.push_back(root);
    while (!path.empty()) {
      const std::uint32_t i = path.back();
      if (order[i] == kNone) {
        order[i] = lowest[i] = discovered++;
        stack.push_back(i);
      }
      if (next[i] < graph.k) {
        const std::uint32_t j = graph.index(i, next[i]++);
        if (order[j] == kNone) {
          path.push_back(j);
        } else if (component[j] == kNone) {
          lowest[i] = std::min(lowest[i], order[j]);
        }
        continue;
      }
      path.pop_back();
      if (!path.empty()) lowest[path.back()] = std::min(lowest[path.back()], lowest[i]);
      if (lowest[i] != order[i]) continue;
      const auto first = std::find(stack.rbegin(), stack.rend(), i).base() - 1;
      Box3f reach;
      for (auto member = first; member != stack.end(); ++member) {
        component[*member] = static_cast<std::uint32_t>(box.size());
      }
      for (auto member = first; member != stack.end(); ++member) {
        reach.extend(points[*member]);
        for (std::uint32_t j = 0; j < graph.k; ++j) {
          const std::uint32_t other = component[graph.index(*member, j)];
          if (other == box.size()) continue;
          reach.extend(box[other].min);
          reach.extend(box[other].max);
        }
      }
      stack.erase(first, stack.end());
      box.push_back(reach);
    }
  }
  std::vector<Box3f> result(n);
  for (std::size_t i = 0; i < n; ++i) result[i] = box[component[i]];
  return result;
}

// The most that the variance of a sample's weights can be.
std::vector<double> greatest_variances(const Points& points, const NeighborGraph& graph) {
  const std::vector<Box3f> reach = reachable_boxes(points, graph);
  std::vector<double> most(points.size());
  for_each_sample(points.size(), [&](std::size_t i) {
    const Vec3d below = (points[i] - reach[i].min).cast<double>();
    const Vec3d above = (reach[i].max - points[i]).cast<double>();
    most[i] = below.dot(above);
  });
  return most;
}

}  // namespace

KernelVariance::KernelVariance(const Points& points, const Points& normals, const NeighborGraph& graph,
                               SmoothingDirection direction)
    : graph_(&graph) {
  if (direction == SmoothingDirection::kFree) {
    rest_ = Packed(points);
    state_.spread = rest_;
    return;
  }
  weights_ = level_weights(points, normals, graph);
  first_gain_ = mean_squares(points, graph);
  gain_ = mean_squares(points, graph, weights_);
  rate_ = step_rates(first_gain_, graph);
  most_ = greatest_variances(points, graph);
  state_.variance.assign(points.size(), 0.0);
}

KernelVariance::State KernelVariance::stepped(double lambda) const {
  State result;
  if (rate_.empty()) {
    result.spread = Packed(graph_->count);
    spread_step(*graph_, static_cast<float>(lambda), rest_, state_.spread, result.spread);
    return result;
  }
  const std::vector<double>& c = state_.variance;
  result.variance.resize(c.size());
  for_each_sample(c.size(), [&](std::size_t i) {
    double sum = 0.0;
    for (std::uint32_t j = 0; j < graph_->k; ++j) {
      sum += static_cast<double>(weights_[slot_of(*graph_, i, j)]) * (c[graph_->index(i, j)] - c[i]);
    }
    const double gain = is_first_ ? first_gain_[i] : gain_[i];
    result.variance[i] = std::min(c[i] + lambda * rate_[i] * (sum + gain), most_[i]);
  });
  return result;
}

void KernelVariance::take(State stepped) {
  state_ = std::move(stepped);
  is_first_ = false;
}

double KernelVariance::median(const State& state) const {
  std::vector<double> variance = state.variance;
  if (rate_.empty()) {
    variance.resize(graph_->count);
    for_each_sample(variance.size(), [&](std::size_t i) {
      const Float4 q = state.spread.data()[i];
      const Vec3f drift = state.spread[i] - rest_[i];
      variance[i] = static_cast<double>(q[3]) - drift.cast<double>().squaredNorm();
    });
  }
  return 0.5 * std::max(0.0, pointwright::median(std::move(variance)));
}

}  // namespace pointwright
