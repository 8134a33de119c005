#include "engine/multires/reconstruction.h"

#include <algorithm>
#include <string>

#include "engine/core/check.h"
#include "engine/core/out_of_range.h"
#include "engine/core/parallel.h"
#include "engine/multires/normal_stencil.h"
#include "engine/normals/estimation.h"
#include "engine/normals/orientation.h"

namespace pointwright {
namespace {

// Positions of the level above `k`, from where level k has moved to.
void rebuild_positions(const MultiresSurface& rest, std::size_t k, float gain, const Level& base,
                       Level& above, const ExecutionContext* context) {
  const Level& rest_base = rest.levels[k];
  const Level& rest_above = rest.levels[k + 1];
  const std::vector<float>& detail = rest.detail[k];
  const auto rebuild = [&](const float* p, const float* r, const float* n, const float* r_now,
                           const float* n_now, float* p_now, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      p_now[i] = p[i] + (r_now[i] - r[i]) + detail[i] * (gain * n_now[i] - n[i]);
    }
  };
  parallel_for(
      detail.size(),
      [&](std::size_t begin, std::size_t end) {
        rebuild(rest_above.position.x(), rest_base.position.x(), rest_base.normal.x(), base.position.x(),
                base.normal.x(), above.position.x(), begin, end);
        rebuild(rest_above.position.y(), rest_base.position.y(), rest_base.normal.y(), base.position.y(),
                base.normal.y(), above.position.y(), begin, end);
        rebuild(rest_above.position.z(), rest_base.position.z(), rest_base.normal.z(), base.position.z(),
                base.normal.z(), above.position.z(), begin, end);
      },
      kParallelBlock, context);
}

// Normals of the level above `k`, whose samples have moved already.
void carry(const MultiresSurface& rest, std::size_t k, float gain, const NeighborGraph& graph,
           const Level& base, Level& above, const ExecutionContext* context) {
  const NormalStencil stencil(rest.levels[k + 1], graph, NormalStencil::all_blocks(graph.count), context);
  const NormalStencil::Moved moved{.rest = &rest.levels[k + 1],
                                   .rest_base = &rest.levels[k],
                                   .base_normal = &base.normal,
                                   .position = &above.position,
                                   .normal = &above.normal,
                                   .gains = gain != 1.0F};
  parallel_for(
      stencil.blocks().size(), [&](std::size_t begin, std::size_t end) { stencil.carry(moved, begin, end); },
      kParallelBlock / kSimdBlock, context);
}

}  // namespace

Result<void> validate(const ReconstructParams& params, const MultiresSurface& surface) {
  const std::size_t bands = surface.band_count();
  if (params.level > bands)
    return out_of_range("the surface has no such level", "level", static_cast<double>(bands),
                        static_cast<double>(params.level));
  if (!params.gains.empty() && params.gains.size() != bands)
    return out_of_range("there is one gain for each band", "gains", static_cast<double>(bands),
                        static_cast<double>(params.gains.size()));
  for (const float gain : params.gains) {
    if (!(gain >= -kGreatestGain && gain <= kGreatestGain))
      return out_of_range("a gain lies within -16 and 16", "gains", static_cast<double>(kGreatestGain),
                          static_cast<double>(gain));
  }
  return {};
}

Result<MultiresSurface> reconstruct(const MultiresSurface& surface, const NeighborGraph& graph,
                                    const Level& moved, const ReconstructParams& params,
                                    const ExecutionContext* context) {
  if (auto valid = validate(params, surface); !valid) return valid.error();
  POINTWRIGHT_CHECK(moved.position.size() == surface.sample_count() && graph.count == surface.sample_count(),
                    "the moved level and the graph are of the surface's samples");
  MultiresSurface result = surface;
  result.levels[params.level] = moved;
  for (std::size_t k = params.level; k < surface.band_count(); ++k) {
    const float gain = params.gains.empty() ? 1.0F : params.gains[k];
    const Level& base = result.levels[k];
    Level& above = result.levels[k + 1];
    rebuild_positions(surface, k, gain, base, above, context);
    if (params.normals == RebuiltNormals::kReestimated) {
      const Points rest_normal = above.normal;
      estimate_normals(above.position, graph, NormalParams{}, above.normal, context);
      orient_like(rest_normal, above.normal);
    } else {
      carry(surface, k, gain, graph, base, above, context);
    }
    if (gain != 1.0F)
      for (float& d : result.detail[k]) d *= gain;
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
  }
  return result;
}

}  // namespace pointwright
