#include "server/sessions/surface_state.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/core/parallel.h"
#include "engine/editing/region.h"
#include "engine/resampling/carried_sampling.h"
#include "server/sessions/surface_hash.h"

namespace pointwright::server {
namespace {

/// The fractions of a diagonal that builders take as scales.
constexpr float kLeastScale = 1e-4F;
constexpr float kGreatestScale = 0.2F;
/// A little below the greatest ratio of neighbouring scales that builders take.
constexpr float kScaleRatio = 0.94F;

/// Moves scales that no builder takes to the nearest ones that it does, apart enough.
void fit_scales(std::vector<float>& scales) {
  float least = kLeastScale;
  for (std::size_t level = scales.size(); level-- > 0;) {
    scales[level] = std::max(scales[level], least);
    least = scales[level] / kScaleRatio;
  }
  float greatest = kGreatestScale;
  for (float& scale : scales) {
    scale = std::min(scale, greatest);
    greatest = kScaleRatio * scale;
  }
}

/// The parameters with no more samples than there is room for.
EditParams within_room(const EditParams& params, const SampleRoom& room, std::size_t now) {
  const std::uint64_t most =
      std::min<std::uint64_t>(std::max<std::uint64_t>(room.most(), now), kNoParent - 1);
  EditParams limited = params;
  std::uint32_t& asked = limited.resampling->max_samples;
  if (asked == 0 || asked > most) asked = static_cast<std::uint32_t>(most);
  return limited;
}

}  // namespace

std::uint64_t memory_of(const SurfaceState& state) {
  if (state.surface == nullptr) return 0;
  const std::uint64_t levels = state.surface->levels.size();
  const std::uint64_t bands = state.surface->band_count();
  return state.surface->sample_count() * sizeof(float) * (levels * 6 + bands);
}

Result<SurfaceState> with_valid_level(const RestModel& rest, const SurfaceState& state, std::uint32_t level,
                                      const ExecutionContext& context) {
  const std::uint32_t valid = state.first_valid_level;
  if (level >= valid) return state;
  // The levels that are valid stay as they are, to the bit: the coarsest of them is what the others are made
  // of. So looking at a level changes no later edit.
  const Level& from = state.surface->levels[valid];
  Cloud current = state.samples->cloud();
  current.position = from.position;
  current.normal = from.normal;
  current.exact_position.clear();
  current.position_is_double = false;
  // The scales are lengths of the model, not of whatever box the edited surface happens to fill; where that
  // box leaves no such fraction, the nearest one that a builder takes. The reports say what was reached.
  // Variances add: level `valid` has that of its own scale already.
  HierarchyParams params = rest.params;
  const float own = valid < params.scales.size() ? params.scales[valid] : 0.0F;
  params.scales.resize(valid);
  for (float& scale : params.scales) scale = std::sqrt(scale * scale - own * own);
  const float diagonal = bounds_of(current.position).diagonal();
  if (diagonal > 0.0F) {
    for (float& scale : params.scales) scale *= rest.diagonal / diagonal;
    if (!validate(params)) fit_scales(params.scales);
  }
  auto built = rest.build(current, params, context);
  if (!built) return built.error();
  auto surface = std::make_shared<MultiresSurface>(*state.surface);
  auto reports = std::make_shared<std::vector<DecompositionReport>>(*state.reports);
  for (std::uint32_t k = 0; k < valid; ++k) {
    surface->levels[k] = std::move(built.value().surface.levels[k]);
    surface->detail[k] = std::move(built.value().surface.detail[k]);
    (*reports)[k] = built.value().reports[k];
    const float derived = (*reports)[k].scale;
    const float base = valid < reports->size() ? (*reports)[valid].scale : 0.0F;
    (*reports)[k].scale = std::sqrt(derived * derived + base * base);
  }
  return SurfaceState{.surface = std::move(surface),
                      .reports = std::move(reports),
                      .first_valid_level = 0,
                      .samples = state.samples};
}

Result<RegionField> field_of(const SurfaceState& state, std::uint32_t level, Blend blend,
                             const Marks& marks) {
  const Points& position = state.surface->levels[level].position;
  const Sampling& sampling = *state.samples->sampling;
  auto regions = regions_from_marks(position, sampling.spacing, marks, sampling.cloud->origin);
  if (!regions) return regions.error();
  RegionField field{
      .t = std::make_shared<const ScaleField>(compute_scale_field(position, regions.value(), blend)),
      .regions = nullptr,
      .samples = state.samples};
  field.regions = std::make_shared<const RegionPair>(std::move(regions).value());
  return field;
}

SharedSamples carried_samples(const SurfaceState& before, const EditParams& params, const ScaleField& field) {
  const auto& sampling = before.samples->sampling;
  auto carried = carried_sampling(sampling, *before.surface, params, field);
  return carried == sampling ? before.samples : samples_after(*before.samples, std::move(carried));
}

Result<SurfaceState> edited(const RestModel& rest, const SurfaceState& state, const EditParams& params,
                            const RegionField& field, ResamplingEffort effort,
                            const ExecutionContext& context) {
  SurfaceState after{.surface = nullptr,
                     .reports = state.reports,
                     .first_valid_level = std::max(state.first_valid_level, params.level)};
  if (!params.resampling) {
    after.surface = std::make_shared<const MultiresSurface>(
        apply_edit(*state.surface, state.samples->graph(), params, *field.t, rest.origin));
    after.samples = carried_samples(state, params, *field.t);
    return after;
  }
  auto edit = rest.resample(*state.surface, state.samples->sampling,
                            within_room(params, *rest.room, state.samples->size()), *field.t, *field.regions,
                            effort, &context);
  if (!edit) return edit.error();
  if (auto room = rest.room->take(edit.value().sampling->size()); !room) return room.error();
  after.surface = std::make_shared<const MultiresSurface>(std::move(edit.value().surface));
  after.samples = samples_after(*state.samples, std::move(edit.value().sampling));
  return after;
}

Result<void> check_reach(const MultiresSurface& surface, std::uint32_t level) {
  for (std::size_t k = level; k < surface.levels.size(); ++k) {
    const Points& p = surface.levels[k].position;
    const auto beyond = parallel_sum<std::size_t>(p.size(), 0, [&](std::size_t begin, std::size_t end) {
      std::size_t count = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const float reach = std::abs(p.x()[i]) + std::abs(p.y()[i]) + std::abs(p.z()[i]);
        count += static_cast<std::size_t>(!(reach <= kMaxReach));  // NaN as well
      }
      return count;
    });
    if (beyond == 0) continue;
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "the edit takes " + std::to_string(beyond) + " samples farther than 1e12 away",
                 .field = "deformation",
                 .limit = double{kMaxReach},
                 .actual = static_cast<double>(bounds_of(p).diagonal())};
  }
  return {};
}

Result<SurfaceState> replayed(const RestModel& rest, const SurfaceState& before, const RecordedEdit& record,
                              const ExecutionContext& context) {
  auto state = with_valid_level(rest, before, record.params.level, context);
  if (!state) return state.error();
  auto field = field_of(state.value(), record.params.level, record.params.blend, *record.marks);
  if (!field) return field.error();
  return edited(rest, state.value(), record.params, field.value(), ResamplingEffort::kExact, context);
}

std::size_t count_moved(const SurfaceState& before, const SurfaceState& after) {
  const Level& a = before.surface->finest();
  const Level& b = after.surface->finest();
  const bool in_order = continues(*before.samples, *after.samples);
  const std::vector<std::uint32_t> places =
      in_order ? std::vector<std::uint32_t>{}
               : sources_of(*before.samples->sampling, *after.samples->sampling);
  const std::vector<std::uint32_t>& id = after.samples->cloud().id;
  const std::uint32_t first_new = before.samples->sampling->next_id;
  const std::size_t count = in_order ? a.position.size() : b.position.size();
  return parallel_sum<std::size_t>(count, 0, [&](std::size_t begin, std::size_t end) {
    std::size_t moved = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (id[i] >= first_new) continue;  // its source is where it was split from
      const std::size_t j = in_order ? i : places[i];
      if (a.position[j] != b.position[i] || a.normal[j] != b.normal[i]) ++moved;
    }
    return moved;
  });
}

std::shared_ptr<const RecordedEdit> record_of(std::size_t index, const EditParams& params, SharedMarks marks,
                                              const SurfaceState& before, const SurfaceState& after,
                                              std::chrono::system_clock::time_point created) {
  auto record = std::make_shared<RecordedEdit>();
  record->index = index;
  record->params = params;
  record->created = created;
  record->moved_samples = count_moved(before, after);
  record->zero_samples = count_marked(*marks, RegionKind::kZero);
  record->one_samples = count_marked(*marks, RegionKind::kOne);
  record->change = change_of(*before.samples, *after.samples);
  record->sample_count = after.samples->size();
  record->surface_hash = surface_hash(after);
  record->marks = std::move(marks);
  return record;
}

}  // namespace pointwright::server
