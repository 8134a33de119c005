#include <cmath>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/normals/estimation.h"
#include "engine/smoothing/kernel_variance.h"
#include "engine/smoothing/ranges.h"
#include "engine/smoothing/umbrella.h"
#include "engine/smoothing/umbrella_steps.h"

namespace pointwright {
namespace {

constexpr float kLambda = 0.5F;

}  // namespace

Result<ScaledSmoothing> smooth_to_scale(const Points& points, const Points& normals,
                                        const NeighborGraph& graph, float scale, SmoothingDirection direction,
                                        std::uint32_t max_iterations, const ExecutionContext* context) {
  if (const auto valid = validate_scale(scale); !valid) return valid.error();
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  const bool is_free = direction == SmoothingDirection::kFree;
  POINTWRIGHT_CHECK(is_free || normals.size() == points.size(), "smoothing along the normals needs them");
  ScaledSmoothing result{.points = points};
  const double goal = static_cast<double>(scale) * static_cast<double>(scale);
  if (graph.k == 0 || goal == 0.0) return result;

  KernelVariance variance(points, normals, graph, direction);
  Points fitted = is_free ? Points() : normals;
  Packed along = is_free ? Packed() : Packed(normals);
  const UmbrellaOperator umbrella{.graph = &graph,
                                  .normals = is_free ? nullptr : &along,
                                  .rates = variance.rates().empty() ? nullptr : variance.rates().data()};
  Packed current(points);
  Packed other(points.size());
  double reached = 0.0;
  double first_gain = 0.0;
  while (reached < goal * (1.0 - 1e-3) && result.iterations < max_iterations) {
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    KernelVariance::State trial = variance.stepped(static_cast<double>(kLambda));
    double next = variance.median(trial);
    if (result.iterations == 0) first_gain = next;
    if (next - reached <= KernelVariance::kExhausted * first_gain) break;
    float lambda = kLambda;
    if (next > goal) {  // the last step: variance grows in proportion to lambda
      lambda = kLambda * static_cast<float>((goal - reached) / (next - reached));
      trial = variance.stepped(static_cast<double>(lambda));
      next = variance.median(trial);
    }
    if (!is_free && result.iterations > 0) {
      refit_normals(current.unpacked(), graph, fitted);
      along = Packed(fitted);
    }
    plain_step(umbrella, lambda, current, other);
    std::swap(current, other);
    variance.take(std::move(trial));
    ++result.iterations;
    reached = next;
  }
  result.points = current.unpacked();
  result.scale = static_cast<float>(std::sqrt(reached));
  return result;
}

}  // namespace pointwright
