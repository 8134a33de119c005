#include "engine/multires/hierarchy.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "engine/core/median.h"
#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/multires/decomposition.h"
#include "engine/normals/rest_surface.h"

namespace pointwright {
namespace {

// Closer scales would ask for a base of a grid much finer than the level that it smooths.
constexpr float kGreatestScaleRatio = 0.95F;

// One band: fills `below` with the base level of `above` and returns its detail coefficients.
Result<std::vector<float>> decompose_band(const Level& above, const Vec3d& origin, float scale, float spacing,
                                          const ExecutionContext& context, Level& below,
                                          DecompositionReport& report, BaseSurface& kept_base) {
  if (!(scale > 0.0F)) {  // all samples coincide: the surface is its own base
    below = above;
    report.base_samples = above.position.size();
    return std::vector<float>(above.position.size(), 0.0F);
  }
  auto base = build_base_surface(above.position, above.normal, origin, scale, context);
  if (!base) return base.error();
  report.scale = base.value().scale;
  report.base_samples = base.value().position.size();
  auto parts = decompose(above.position, above.normal, base.value(), spacing, DecomposeParams{}, context);
  if (!parts) return parts.error();
  Decomposition& found = parts.value();
  report.at_limit = found.at_limit;
  report.fallback = found.fallback;
  report.flipped = found.flipped;
  report.mean_iterations = found.mean_iterations;
  double squares = 0.0;
  for (const float d : found.detail) {
    report.max_detail = std::max(report.max_detail, std::abs(d));
    squares += static_cast<double>(d) * static_cast<double>(d);
  }
  report.rms_detail = static_cast<float>(std::sqrt(squares / static_cast<double>(found.detail.size())));
  kept_base = std::move(base).value();
  below.position = std::move(found.base);
  below.normal = std::move(found.normal);
  return std::move(found.detail);
}

}  // namespace

Result<void> validate(const HierarchyParams& params) {
  if (params.scales.empty() || params.scales.size() > kMaxBands) {
    return out_of_range("a hierarchy has 1 to " + std::to_string(kMaxBands) + " bands", "scales",
                        static_cast<double>(kMaxBands), static_cast<double>(params.scales.size()));
  }
  for (std::size_t level = 0; level < params.scales.size(); ++level) {
    const float scale = params.scales[level];
    if (!(scale >= 1e-4F && scale <= 0.2F)) {
      return out_of_range("a scale is a fraction of the bounding-box diagonal between 0.0001 and 0.2",
                          "scales", 0.2, static_cast<double>(scale));
    }
    if (level > 0 && !(scale <= kGreatestScaleRatio * params.scales[level - 1])) {
      return out_of_range("scales descend: each is at most 0.95 of the one before", "scales",
                          static_cast<double>(kGreatestScaleRatio * params.scales[level - 1]),
                          static_cast<double>(scale));
    }
  }
  return validate_neighbors(params.neighbors);
}

Result<Hierarchy> build_hierarchy(const Cloud& cloud, const HierarchyParams& params,
                                  const ExecutionContext& context) {
  if (const auto valid = validate(params); !valid) return valid.error();
  Hierarchy result;
  const std::size_t bands = params.scales.size();
  result.surface.levels.resize(bands + 1);
  result.surface.detail.resize(bands);
  result.reports.resize(bands);
  result.bases.resize(bands);
  Level& finest = result.surface.levels.back();
  finest.position = cloud.position;
  auto rest = rest_surface(cloud, params.neighbors, context);
  if (!rest) return rest.error();
  result.graph = std::move(rest.value().graph);
  result.component_count = rest.value().component_count;
  finest.normal = std::move(rest.value().normal);
  result.spacing = local_spacing(cloud.position, result.graph);

  const float diagonal = bounds_of(cloud.position).diagonal();
  const float spacing = median(result.spacing);
  double variance = 0.0;  // of all the smoothing down to level band + 1
  for (std::size_t band = bands; band-- > 0;) {
    context.begin_phase("decomposition",
                        0.55 + 0.45 * static_cast<double>(bands - 1 - band) / static_cast<double>(bands));
    // From the scales asked for, not from what the finer bands have reached: that depends on the sampling,
    // and the base's grid must be the same for every sampling of one object.
    const double asked = static_cast<double>(params.scales[band]) * static_cast<double>(diagonal);
    const double finer =
        band + 1 < bands ? static_cast<double>(params.scales[band + 1]) * static_cast<double>(diagonal) : 0.0;
    const double scale = std::sqrt(asked * asked - finer * finer);
    DecompositionReport& report = result.reports[band];
    auto detail = decompose_band(result.surface.levels[band + 1], cloud.origin, static_cast<float>(scale),
                                 spacing, context, result.surface.levels[band], report, result.bases[band]);
    if (!detail) return detail.error();
    result.surface.detail[band] = std::move(detail).value();
    variance += static_cast<double>(report.scale) * static_cast<double>(report.scale);
    report.scale = static_cast<float>(std::sqrt(variance));
  }
  context.begin_phase("ready", 1.0);
  return result;
}

}  // namespace pointwright
