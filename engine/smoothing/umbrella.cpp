// Taubin, "A signal processing approach to fair surface design", 1995; Desbrun et al., "Implicit fairing of
// irregular meshes using diffusion and curvature flow", 1999; local volume preservation after Hubeli and
// Gross, 2001.
#include "engine/smoothing/umbrella.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/smoothing/global_volume.h"
#include "engine/smoothing/ranges.h"
#include "engine/smoothing/umbrella_steps.h"

namespace pointwright {
namespace {

// Normalised umbrella weights per neighbour, in the graph's layout; empty for uniform ones.
std::vector<float> rest_weights(const Points& points, const NeighborGraph& graph) {
  std::vector<float> weights(graph.lanes.size(), 0.0F);
  const std::vector<float> spacing = local_spacing(points, graph);
  parallel_for(graph.count, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float* const own = weights.data() + i / kSimdBlock * graph.k * kSimdBlock + i % kSimdBlock;
      float sum = 0.0F;
      for (std::uint32_t j = 0; j < graph.k; ++j) {
        const float distance = (points[graph.index(i, j)] - points[i]).norm() + 0.3F * spacing[i];
        own[j * kSimdBlock] = distance > 0.0F ? 1.0F / distance : 1.0F;
        sum += own[j * kSimdBlock];
      }
      for (std::uint32_t j = 0; j < graph.k; ++j) own[j * kSimdBlock] /= sum;
    }
  });
  return weights;
}

}  // namespace

float taubin_mu(float lambda, float pass_band) {
  return lambda / (pass_band * lambda - 1.0F);  // 1 / lambda + 1 / mu = k_PB
}

Result<void> validate(const UmbrellaParams& params) {
  if (auto valid = validate_lambda(params.lambda); !valid) return valid;
  if (params.iterations > 100'000) {
    return out_of_range("at most 100,000 iterations", "iterations", 100'000,
                        static_cast<double>(params.iterations));
  }
  if (!(params.pass_band > 0.0F && params.pass_band <= 0.2F)) {
    return out_of_range("the pass-band frequency must lie in (0, 0.2]", "pass_band", 0.2,
                        static_cast<double>(params.pass_band));
  }
  if (params.preserve == VolumePreservation::kTaubin) {
    // The transfer function (1 - lambda k)(1 - mu k) at the highest frequency, k = 2.
    const double mu = static_cast<double>(taubin_mu(params.lambda, params.pass_band));
    const double highest = (1.0 - 2.0 * static_cast<double>(params.lambda)) * (1.0 - 2.0 * mu);
    if (std::abs(highest) > 1.0) {
      return out_of_range("Taubin's steps diverge with this lambda and pass-band frequency", "lambda", 1.0,
                          std::abs(highest));
    }
  }
  return {};
}

Result<Points> smooth(const Points& points, const Points& normals, const NeighborGraph& graph,
                      const UmbrellaParams& params, const ExecutionContext* context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  POINTWRIGHT_CHECK(graph.count == points.size(), "the graph must be of these points");
  const bool is_free = params.direction == SmoothingDirection::kFree;
  const bool is_global = params.preserve == VolumePreservation::kGlobal;
  POINTWRIGHT_CHECK((is_free && !is_global) || normals.size() == points.size(),
                    "smoothing along the normals and global rescaling need them");
  if (graph.k == 0) return points;

  const std::vector<float> weights =
      params.weights == UmbrellaWeights::kUniform ? std::vector<float>{} : rest_weights(points, graph);
  const Packed along = is_free ? Packed() : Packed(normals);
  const UmbrellaOperator umbrella{.graph = &graph,
                                  .weights = weights.empty() ? nullptr : weights.data(),
                                  .normals = is_free ? nullptr : &along};
  std::optional<GlobalVolume> volume;
  if (is_global) {
    auto measured = GlobalVolume::of(points, normals, graph);
    if (!measured) return measured.error();
    volume = std::move(measured).value();
  }
  const ReverseNeighbors listers =
      params.preserve == VolumePreservation::kLocal ? reverse_neighbors(graph) : ReverseNeighbors{};
  const float mu = taubin_mu(params.lambda, params.pass_band);

  Packed current(points);
  Packed other(points.size());
  std::uint32_t since_restored = 0;
  for (std::uint32_t iteration = 0; iteration < params.iterations; ++iteration) {
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    switch (params.preserve) {
      case VolumePreservation::kLocal:
        compensated_step(umbrella, listers, params.lambda, current, other);
        break;
      case VolumePreservation::kTaubin:
        plain_step(umbrella, params.lambda, current, other);
        plain_step(umbrella, mu, other, current);
        break;
      case VolumePreservation::kNone:
      case VolumePreservation::kGlobal:
        plain_step(umbrella, params.lambda, current, other);
        std::swap(current, other);
        break;
    }
    if (!volume) continue;
    ++since_restored;
    if (since_restored < volume->steps_until_due() && iteration + 1 < params.iterations) continue;
    if (const auto restored = volume->restore(current, since_restored); !restored) return restored.error();
    if (iteration + 1 < params.iterations) volume->follow(current);
    since_restored = 0;
  }
  return current.unpacked();
}

}  // namespace pointwright
