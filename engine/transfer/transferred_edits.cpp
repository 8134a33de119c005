#include "engine/transfer/transferred_edits.h"

#include <algorithm>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/gather.h"
#include "engine/core/parallel.h"
#include "engine/multires/decomposition.h"
#include "engine/normals/rest_surface.h"
#include "engine/resampling/carried_sampling.h"
#include "engine/resampling/resampled_edit.h"

namespace pointwright {
namespace {

using Anchors = std::vector<std::uint32_t>;

/// Estimated normals, turned to the sides of the samples that stand for them.
void take_sides(const Level& preview, const Anchors& anchors, Points& normal) {
  parallel_for(normal.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3f n = normal[i];
      if (preview.normal[anchors[i]].dot(n) < 0.0F) normal.set(i, -n);
    }
  });
}

/// Levels bands.size() - 1 .. 0 of the surface, whose level bands.size() stands.
Result<void> decompose_onto(const LevelBases& bases, float spacing_ratio, const Anchors& anchors,
                            MultiresSurface& surface, const ExecutionContext& context) {
  std::vector<std::uint32_t> counterpart(anchors.size());
  const float spacing = bases.spacing * spacing_ratio;
  for (std::size_t band = bases.bands.size(); band-- > 0;) {
    const BaseSurface& base = bases.bands[band];
    const Level& above = surface.levels[band + 1];
    if (base.position.empty()) {  // all samples of the preview coincide: every level is the surface itself
      surface.levels[band] = above;
      surface.detail[band].assign(anchors.size(), 0.0F);
      continue;
    }
    for (std::size_t i = 0; i < anchors.size(); ++i) counterpart[i] = base.counterpart[anchors[i]];
    auto parts =
        decompose(above.position, above.normal, base, counterpart, spacing, DecomposeParams{}, context);
    if (!parts) return parts.error();
    surface.levels[band].position = std::move(parts.value().base);
    surface.levels[band].normal = std::move(parts.value().normal);
    surface.detail[band] = std::move(parts.value().detail);
  }
  return {};
}

/// The anchors of the samples after an edit: inserted ones have their parents'.
Anchors carried_anchors(const Sampling& before, const Anchors& anchors, const Sampling& after) {
  std::unordered_map<std::uint32_t, std::uint32_t> place;  // by id
  place.reserve(after.size());
  for (std::size_t i = 0; i < before.size(); ++i) place.emplace(before.cloud->id[i], anchors[i]);
  Anchors carried(after.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    std::uint32_t id = after.cloud->id[i];
    auto found = place.find(id);
    if (found == place.end()) {
      found = place.find(after.parent[i]);
      POINTWRIGHT_CHECK(found != place.end(), "an inserted sample was split from one that was there");
      found = place.emplace(id, found->second).first;
    }
    carried[i] = found->second;
  }
  return carried;
}

Result<void> check_edits(const EditScript& script, std::span<const TransferredEdit> edits,
                         const MultiresSurface& surface) {
  for (std::size_t i = 0; i < edits.size(); ++i) {
    const TransferredEdit& edit = edits[i];
    if (auto valid = validate(edit.params, surface); !valid) {
      Error error = valid.error();
      error.message = "edit " + std::to_string(i + 1) + ": " + error.message;
      return error;
    }
    POINTWRIGHT_CHECK(!edit.regions->zero.empty() && !edit.regions->one.empty(), "regions have volume");
    if (edit.derived == nullptr) continue;
    POINTWRIGHT_CHECK(edit.derived->bands.size() <= surface.band_count(), "a base for each derived level");
    for (const BaseSurface& base : edit.derived->bands)
      POINTWRIGHT_CHECK(base.counterpart.size() >= (base.position.empty() ? 0 : script.rest.position.size()),
                        "bases of the preview's samples");
  }
  return {};
}

}  // namespace

Result<TransferredSamples> decompose_samples(const EditScript& script, const AnchorIndex& index,
                                             std::shared_ptr<const Cloud> cloud,
                                             const ExecutionContext& context) {
  if (cloud->size() == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "the cloud has no samples", .field = "cloud"};
  POINTWRIGHT_CHECK(cloud->origin == script.origin, "positions relative to the script's origin");
  auto graph =
      std::make_shared<NeighborGraph>(build_neighbor_graph(cloud->position, script.neighbors, &context));
  if (context.is_cancelled()) return cancelled_error();

  TransferredSamples result;
  MultiresSurface& surface = result.surface;
  surface.levels.resize(script.bases.bands.size() + 1);
  surface.detail.resize(script.bases.bands.size());
  Level& finest = surface.levels.back();
  finest.position = cloud->position;
  finest.normal = usable_normals(*cloud, *graph, context);
  if (context.is_cancelled()) return cancelled_error();
  result.anchor = index.anchors_of(cloud->position, cloud->has_normals() ? finest.normal : Points(), context);
  if (context.is_cancelled()) return cancelled_error();
  if (!cloud->has_normals()) take_sides(script.rest, result.anchor, finest.normal);
  if (auto made = decompose_onto(script.bases, script.spacing_ratio, result.anchor, surface, context); !made)
    return made.error();
  std::vector<float> spacing = local_spacing(cloud->position, *graph);
  result.sampling =
      std::make_shared<const Sampling>(rest_sampling(std::move(cloud), std::move(graph), std::move(spacing)));
  return result;
}

Result<TransferredSamples> make_edits(const EditScript& script, std::span<const TransferredEdit> edits,
                                      TransferredSamples samples, const ExecutionContext& context) {
  MultiresSurface& surface = samples.surface;
  if (auto valid = check_edits(script, edits, surface); !valid) return valid.error();
  for (const TransferredEdit& edit : edits) {
    if (edit.derived != nullptr) {
      auto made = decompose_onto(*edit.derived, script.spacing_ratio, samples.anchor, surface, context);
      if (!made) return made.error();
    }
    const ScaleField field = compute_scale_field(surface.levels[edit.params.level].position, *edit.regions,
                                                 edit.params.blend, &context);
    if (context.is_cancelled()) return cancelled_error();
    if (edit.params.resampling) {
      auto made = apply_resampled_edit(surface, samples.sampling, edit.params, field, *edit.regions,
                                       ResamplingEffort::kExact, &context);
      if (!made) return made.error();
      samples.anchor = carried_anchors(*samples.sampling, samples.anchor, *made.value().sampling);
      surface = std::move(made.value().surface);
      samples.sampling = std::move(made.value().sampling);
    } else {
      MultiresSurface edited =
          apply_edit(surface, *samples.sampling->graph, edit.params, field, script.origin);
      samples.sampling = carried_sampling(samples.sampling, surface, edit.params, field);
      surface = std::move(edited);
    }
  }
  return samples;
}

Result<TransferredSamples> transfer_edits(const EditScript& script, const AnchorIndex& anchors,
                                          std::shared_ptr<const Cloud> cloud, const ExecutionContext& context,
                                          MultiresSurface* rest) {
  auto samples = decompose_samples(script, anchors, std::move(cloud), context);
  if (!samples) return samples.error();
  if (rest != nullptr) *rest = samples.value().surface;
  return make_edits(script, script.edits, std::move(samples).value(), context);
}

}  // namespace pointwright
