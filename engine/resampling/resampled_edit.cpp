#include "engine/resampling/resampled_edit.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "engine/core/check.h"
#include "engine/editing/deformation_map.h"
#include "engine/editing/edit_plan.h"
#include "engine/resampling/carried_sampling.h"
#include "engine/resampling/cells.h"
#include "engine/resampling/collection.h"
#include "engine/resampling/insertion.h"
#include "engine/resampling/neighborhood_update.h"
#include "engine/resampling/relaxation.h"

namespace pointwright {
namespace {

constexpr std::uint32_t kPreviewSweeps = 2;
// A preview inserts at most so many, wider apart if it must be: it has to come in time.
constexpr std::size_t kPreviewChildren = 100'000;
constexpr float kCoarserStep = 1.25F;

struct Stretched {
  std::vector<std::uint32_t> blocks;
  ShapeOperators shape;
  Cells rest;
  MappedCells mapped;
};

const ShapeOperators* pointer_to(const ShapeOperators& shape) {
  return shape.size() > 0 ? &shape : nullptr;
}

Stretched stretch(const Level& level, const Sampling& sampling, const EditParams& params,
                  const ScaleField& field, const DeformMap& map, const ExecutionContext* context) {
  Stretched result{.blocks = moving_blocks(field), .shape = {}, .rest = {}, .mapped = {}};
  if (needs_shape_operators(params.deformation)) {
    result.shape =
        shape_operators(level, NormalStencil(level, *sampling.graph, result.blocks, context), context);
  }
  result.rest = cells_on_level(sampling, level.normal, result.blocks);
  result.mapped = map_cells(map, result.blocks, field, level, result.rest, pointer_to(result.shape));
  return result;
}

}  // namespace

Result<ResampledEdit> apply_resampled_edit(const MultiresSurface& surface,
                                           const std::shared_ptr<const Sampling>& sampling,
                                           const EditParams& params, const ScaleField& field,
                                           const RegionPair& regions, ResamplingEffort effort,
                                           const ExecutionContext* context) {
  const std::size_t before = surface.sample_count();
  POINTWRIGHT_CHECK(params.resampling.has_value(), "parameters of resampling");
  POINTWRIGHT_CHECK(sampling->size() == before && field.size() == before,
                    "a sampling and a field of the surface");
  if (before == 0) return ResampledEdit{.surface = surface, .sampling = sampling};
  const ResamplingParams& wanted = *params.resampling;
  const bool preview = effort == ResamplingEffort::kPreview;
  const Level& level = surface.levels[params.level];
  const DeformMap map = to_deform_map(params.deformation, sampling->cloud->origin);
  const Stretched stretched = stretch(level, *sampling, params, field, map, context);

  float coarser = 1.0F;
  auto splits = find_splits(*sampling, stretched.mapped.cells, field, stretched.blocks, wanted);
  while (preview && splits && splits.value().inserted > kPreviewChildren) {
    coarser *= kCoarserStep;
    splits = find_splits(*sampling, stretched.mapped.cells, field, stretched.blocks, wanted, coarser);
  }
  if (!splits) return splits.error();

  std::vector<std::uint32_t> parents;
  parents.reserve(splits.value().splits.size());
  for (const Split& split : splits.value().splits) parents.push_back(split.sample);
  RestPatches patches(level, *sampling->graph);
  patches.require(parents);
  Births births =
      give_birth(splits.value(), patches, *sampling, stretched.rest, stretched.mapped.cells, field);
  relax({.map = map,
         .regions = regions,
         .blend = params.blend,
         .splits = splits.value(),
         .patches = patches,
         .sampling = *sampling,
         .rest = stretched.rest,
         .rest_position = level.position,
         .deformed = stretched.mapped.position,
         .params = wanted,
         .coarser = coarser},
        preview ? std::min(wanted.sweeps, kPreviewSweeps) : wanted.sweeps, births, context);
  if (context != nullptr && context->is_cancelled()) return cancelled_error();

  const std::vector<ZombieWeights> weights =
      all_zombie_weights(splits.value(), patches, births, level.position);
  const Inserted inserted{.splits = splits.value(), .patches = patches, .births = births, .weights = weights};
  MultiresSurface rest = surface;
  append_children(inserted, params.level, rest);
  ScaleField all_field = field;
  append_children(rest.levels[params.level].position, regions, params.blend, all_field);
  NeighborGraph rest_graph = *sampling->graph;
  append_children(inserted, rest_graph);
  if (context != nullptr && context->is_cancelled()) return cancelled_error();

  ResampledEdit result{.surface = rest, .sampling = nullptr, .inserted = inserted.count()};
  const EditPlan plan(rest, rest_graph, params, all_field, context);
  if (context != nullptr && context->is_cancelled()) return cancelled_error();
  apply_edit(rest, plan, params, all_field, sampling->cloud->origin, result.surface);

  const Cells divided =
      divided_rest_cells(inserted, stretched.rest, stretched.mapped.cells, rest.levels[params.level].normal);
  MappedCells mapped =
      map_cells(map, plan.moving(), all_field, rest.levels[params.level], divided, plan.shape());
  auto after = std::make_shared<Sampling>(*sampling);
  after->cell_u = std::move(mapped.cells.u);
  after->cell_v = std::move(mapped.cells.v);
  if (inserted.count() > 0) {
    after->cloud = std::make_shared<const Cloud>(
        with_children(inserted, *sampling->cloud, result.surface.finest(), sampling->next_id));
    after->graph = std::make_shared<const NeighborGraph>(
        preview ? std::move(rest_graph)
                : updated_neighborhoods(*sampling->graph, inserted, result.surface.finest().position));
    after->parent.resize(before, kNoParent);
    after->parent.reserve(before + inserted.count());
    after->spacing.reserve(before + inserted.count());
    for (std::size_t child = 0; child < inserted.count(); ++child) {
      const std::uint32_t parent = inserted.split(child).sample;
      after->parent.push_back(sampling->cloud->id[parent]);
      after->spacing.push_back(sampling->spacing[parent]);
    }
    after->next_id += static_cast<std::uint32_t>(inserted.count());
  }
  result.sampling = std::move(after);
  if (!preview && wanted.collect > 0.0) collect(all_field, static_cast<float>(wanted.collect), result);
  return result;
}

}  // namespace pointwright
