#include "engine/resampling/resampled_drag.h"

#include <algorithm>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
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
constexpr std::size_t kPreviewChildren = 100'000;
constexpr float kCoarserStep = 1.25F;

// Columns with their padding, which histories of surfaces compare as well.
void copy_from(const Points& from, std::size_t first, Points& to) {
  const std::size_t end = padded_to_block(from.size());
  const float* const source[3] = {from.x(), from.y(), from.z()};
  float* const target[3] = {to.x(), to.y(), to.z()};
  for (int c = 0; c < 3; ++c) std::copy(source[c] + first, source[c] + end, target[c] + first);
}

// Takes away what was appended to a copy of `whole`.
void truncate(const Points& whole, Points& points) {
  points.resize(whole.size());
  copy_from(whole, whole.size(), points);
}

void truncate(const MultiresSurface& whole, MultiresSurface& surface) {
  for (std::size_t k = 0; k < whole.levels.size(); ++k) {
    truncate(whole.levels[k].position, surface.levels[k].position);
    truncate(whole.levels[k].normal, surface.levels[k].normal);
  }
  for (std::vector<float>& detail : surface.detail) detail.resize(whole.sample_count());
}

void truncate(ScaleField& field, std::size_t count) {
  field.t.resize(padded_to_block(count));
  std::fill(field.t.begin() + static_cast<std::ptrdiff_t>(count), field.t.end(), 0.0F);
  field.gradient.resize(count);
}

void truncate(NeighborGraph& graph, std::size_t count) {
  graph.count = count;
  graph.lanes.resize(padded_to_block(count) * graph.k);
}

void copy_tail(const Points& from, std::size_t first, Points& to) {
  to.resize(from.size());
  copy_from(from, first, to);
}

// Makes `room` as large as `from`, with its samples from `first` on.
void copy_tail(const MultiresSurface& from, std::size_t first, MultiresSurface& room) {
  for (std::size_t k = 0; k < from.levels.size(); ++k) {
    copy_tail(from.levels[k].position, first, room.levels[k].position);
    copy_tail(from.levels[k].normal, first, room.levels[k].normal);
  }
  for (std::size_t k = 0; k < from.detail.size(); ++k) {
    room.detail[k].resize(from.detail[k].size());
    std::copy(from.detail[k].begin() + static_cast<std::ptrdiff_t>(first), from.detail[k].end(),
              room.detail[k].begin() + static_cast<std::ptrdiff_t>(first));
  }
}

}  // namespace

class ResampledDrag::Work {
 public:
  Work(std::shared_ptr<const MultiresSurface> surface, std::shared_ptr<const Sampling> sampling,
       const EditParams& params, std::shared_ptr<const ScaleField> field, RegionPair regions)
      : surface_(std::move(surface)),
        sampling_(std::move(sampling)),
        field_(std::move(field)),
        regions_(std::move(regions)),
        before_(surface_->sample_count()),
        shared_block_(static_cast<std::uint32_t>(before_ / kSimdBlock)),
        level_(surface_->levels[params.level]),
        blocks_(moving_blocks(*field_)),
        plan_(*surface_, *sampling_->graph, params, *field_),
        rest_cells_(cells_on_level(*sampling_, level_.normal, blocks_)),
        patches_(level_, *sampling_->graph),
        all_rest_(*surface_),
        all_field_(*field_),
        all_graph_(*sampling_->graph) {
    POINTWRIGHT_CHECK(sampling_->size() == before_ && field_->size() == before_,
                      "a sampling and a field of the surface");
    if (needs_shape_operators(params.deformation))
      shape_ = shape_operators(level_, NormalStencil(level_, *sampling_->graph, blocks_));
  }

  [[nodiscard]] bool serves(const EditParams& params) const {
    return params.resampling.has_value() && plan_.serves(params);
  }

  Result<ResampledEdit> frame(const EditParams& params, ResamplingEffort effort, MultiresSurface room,
                              const ExecutionContext* context) {
    POINTWRIGHT_CHECK(serves(params), "parameters that the drag was made for");
    const bool preview = effort == ResamplingEffort::kPreview;
    const DeformMap map = to_deform_map(params.deformation, sampling_->cloud->origin);
    const MappedCells mapped =
        map_cells(map, blocks_, *field_, level_, rest_cells_, plan_.shape() != nullptr ? &shape_ : nullptr);
    float coarser = 1.0F;
    auto splits = counted(mapped.cells, *params.resampling, preview, coarser);
    if (!splits) return splits.error();
    Births births = born(splits.value(), mapped.cells);
    relax({.map = map,
           .regions = regions_,
           .blend = params.blend,
           .splits = splits.value(),
           .patches = patches_,
           .sampling = *sampling_,
           .rest = rest_cells_,
           .rest_position = level_.position,
           .deformed = mapped.position,
           .blocks = blocks_,
           .params = *params.resampling,
           .coarser = coarser},
          preview ? std::min(params.resampling->sweeps, kPreviewSweeps) : params.resampling->sweeps, births,
          memory_, context);
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    const std::vector<ZombieWeights> weights =
        all_zombie_weights(splits.value(), patches_, births, level_.position);
    const Inserted inserted{
        .splits = splits.value(), .patches = patches_, .births = births, .weights = weights};
    insert(inserted, params);
    ResampledEdit result{.surface = std::move(room), .sampling = nullptr, .inserted = inserted.count()};
    const EditPlan tail_plan = apply(params, context, result.surface);
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    result.sampling = sampling_after(inserted, map, mapped.cells, tail_plan, preview, params, result.surface);
    if (!preview && params.resampling->collect > 0.0)
      collect(all_field_, static_cast<float>(params.resampling->collect), result, context);
    if (context != nullptr && context->is_cancelled()) return cancelled_error();
    return result;
  }

 private:
  Result<Splits> counted(const Cells& mapped, const ResamplingParams& params, bool preview,
                         float& coarser) const {
    auto splits = find_splits(*sampling_, mapped, *field_, blocks_, params);
    while (preview && splits && splits.value().inserted > kPreviewChildren) {
      coarser *= kCoarserStep;
      splits = find_splits(*sampling_, mapped, *field_, blocks_, params, coarser);
    }
    return splits;
  }

  Births born(const Splits& splits, const Cells& mapped) {
    std::vector<std::uint32_t> parents;
    parents.reserve(splits.splits.size());
    for (const Split& split : splits.splits) parents.push_back(split.sample);
    patches_.require(parents);
    return give_birth(splits, patches_, *sampling_, rest_cells_, mapped, *field_);
  }

  // The children in place of those of the frame before.
  void insert(const Inserted& inserted, const EditParams& params) {
    truncate(*surface_, all_rest_);
    truncate(all_field_, before_);
    truncate(all_graph_, before_);
    append_children(inserted, params.level, all_rest_);
    append_children(all_rest_.levels[params.level].position, regions_, params.blend, all_field_);
    append_children(inserted, all_graph_);
  }

  // The samples that were there before by the plan that all frames share: no row of theirs has a child in it.
  // Then the children, and once more the block that they begin in, by a plan of this frame.
  EditPlan apply(const EditParams& params, const ExecutionContext* context, MultiresSurface& edited) const {
    if (edited.levels.empty())
      edited = all_rest_;
    else
      copy_tail(all_rest_, std::size_t{shared_block_} * kSimdBlock, edited);
    const Vec3d& origin = sampling_->cloud->origin;
    apply_edit(all_rest_, plan_, params, all_field_, origin, edited);
    EditPlan tail(all_rest_, all_graph_, params, all_field_, context, {.begin = shared_block_});
    if (context == nullptr || !context->is_cancelled())
      apply_edit(all_rest_, tail, params, all_field_, origin, edited);
    return tail;
  }

  std::shared_ptr<const Sampling> sampling_after(const Inserted& inserted, const DeformMap& map,
                                                 const Cells& mapped, const EditPlan& tail, bool preview,
                                                 const EditParams& params,
                                                 const MultiresSurface& edited) const {
    auto after = std::make_shared<Sampling>(*sampling_);
    const std::size_t count = inserted.count();
    const Level& rest = all_rest_.levels[params.level];
    Cells cells = mapped;
    divide_cells(inserted, rest_cells_, map, all_field_, rest, tail.shape(), cells);
    after->cell_u = std::move(cells.u);
    after->cell_v = std::move(cells.v);
    if (count == 0) return after;
    after->cloud = std::make_shared<const Cloud>(
        with_children(inserted, *sampling_->cloud, edited.finest(), sampling_->next_id));
    after->graph = std::make_shared<const NeighborGraph>(
        preview ? all_graph_ : updated_neighborhoods(*sampling_->graph, inserted, edited.finest().position));
    after->parent.resize(before_, kNoParent);
    after->parent.reserve(before_ + count);
    after->spacing.reserve(before_ + count);
    for (std::size_t child = 0; child < count; ++child) {
      const std::uint32_t parent = inserted.split(child).sample;
      after->parent.push_back(sampling_->cloud->id[parent]);
      after->spacing.push_back(sampling_->spacing[parent]);
    }
    after->next_id += static_cast<std::uint32_t>(count);
    return after;
  }

  const std::shared_ptr<const MultiresSurface> surface_;
  const std::shared_ptr<const Sampling> sampling_;
  const std::shared_ptr<const ScaleField> field_;
  const RegionPair regions_;
  const std::size_t before_;          // samples
  const std::uint32_t shared_block_;  // whole blocks of them: children begin in the next one
  const Level& level_;
  const std::vector<std::uint32_t> blocks_;
  const EditPlan plan_;
  const Cells rest_cells_;
  ShapeOperators shape_;
  RestPatches patches_;
  RelaxationMemory memory_;
  // At rest, with the children of the last frame.
  MultiresSurface all_rest_;
  ScaleField all_field_;
  NeighborGraph all_graph_;
};

ResampledDrag::ResampledDrag(std::shared_ptr<const MultiresSurface> surface,
                             std::shared_ptr<const Sampling> sampling, const EditParams& params,
                             std::shared_ptr<const ScaleField> field, RegionPair regions)
    : work_(std::make_unique<Work>(std::move(surface), std::move(sampling), params, std::move(field),
                                   std::move(regions))) {}

ResampledDrag::~ResampledDrag() = default;

bool ResampledDrag::serves(const EditParams& params) const {
  return work_->serves(params);
}

Result<ResampledEdit> ResampledDrag::frame(const EditParams& params, ResamplingEffort effort,
                                           MultiresSurface room, const ExecutionContext* context) {
  return work_->frame(params, effort, std::move(room), context);
}

}  // namespace pointwright
