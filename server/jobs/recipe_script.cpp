#include "server/jobs/recipe_script.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/core/median.h"
#include "engine/resampling/resampled_edit.h"
#include "server/sessions/recipe_play.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {
namespace {

using protocol::Problem;
using protocol::RecipeEdit;

LevelBases bases_of(Hierarchy& hierarchy) {
  return {.bands = std::move(hierarchy.bases), .spacing = median(hierarchy.spacing)};
}

RestModel rest_model(const Cloud& cloud, const HierarchyParams& params, HierarchyBuilder build) {
  return {.params = params,
          .origin = cloud.origin,
          .diagonal = bounds_of(cloud.position).diagonal(),
          .build = std::move(build),
          .resample = apply_resampled_edit,
          .room = std::make_shared<SampleRoom>(kNoParent)};
}

SurfaceState state_at_rest(std::shared_ptr<const Cloud> cloud, Hierarchy hierarchy) {
  SharedSamples samples = samples_at_rest(
      rest_sampling(std::move(cloud), std::make_shared<const NeighborGraph>(std::move(hierarchy.graph)),
                    std::move(hierarchy.spacing)),
      hierarchy.surface.finest());
  return {.surface = std::make_shared<const MultiresSurface>(std::move(hierarchy.surface)),
          .reports = std::make_shared<const std::vector<DecompositionReport>>(std::move(hierarchy.reports)),
          .first_valid_level = 0,
          .samples = std::move(samples)};
}

/// The state of a recipe that is being played, and the script that grows with it.
class Player {
 public:
  Player(std::shared_ptr<const Cloud> preview, const HierarchyParams& params, const ExecutionContext& context)
      : context_(context) {
    limits_.max_operations = protocol::kMaxPaintOperations;
    rest_ = rest_model(
        *preview, params,
        [this](const Cloud& cloud, const HierarchyParams& levels, const ExecutionContext& running) {
          auto built = build_hierarchy(cloud, levels, running);
          if (built) derived_ = bases_of(built.value());
          return built;
        });
    cloud_ = std::move(preview);
  }

  std::optional<Problem> start() {
    auto built = build_hierarchy(*cloud_, rest_.params, context_);
    if (!built) return protocol::to_problem(built.error());
    Hierarchy hierarchy = std::move(built).value();
    script_ = {.origin = cloud_->origin,
               .rest = hierarchy.surface.finest(),
               .bases = bases_of(hierarchy),
               .edits = {},
               .neighbors = rest_.params.neighbors,
               .spacing_ratio = 1.0F};
    at_rest_ = state_at_rest(cloud_, std::move(hierarchy));
    rest_.uploaded_ids = at_rest_.samples->sampling->next_id;
    return std::nullopt;
  }

  /// The recipe up to request.s, from rest.
  std::optional<Problem> play(const protocol::RecipeRequest& request) {
    whole_ = made_ = at_rest_;
    made_is_whole_ = true;
    shared_ids_ = rest_.uploaded_ids;
    marks_ = nullptr;
    script_.edits.clear();
    const std::vector<double> parts = parts_of_recipe(request);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (auto problem = add(i, request.recipe.edits[i], parts[i], i + 1 < parts.size())) return problem;
    }
    return std::nullopt;
  }

  /// `part` of an edit. `goes_on`: another one follows, which is painted on the surface of whole edits.
  std::optional<Problem> add(std::size_t index, const RecipeEdit& edit, double part, bool goes_on) {
    if (edit.paints) {
      if (auto problem = paint(index, edit)) return problem;
    }
    if (marks_ == nullptr) marks_ = std::make_shared<Marks>(whole_.surface->sample_count(), std::uint8_t{0});
    const SharedMarks marks = carried_marks(*whole_.samples, marks_, *made_.samples, nullptr,
                                            made_is_whole_ ? kAllIds : shared_ids_);
    const SharedSamples painted = whole_.samples;
    if (made_is_whole_) shared_ids_ = whole_.samples->sampling->next_id;
    auto next = make(made_, recordable_part(edit.edit, part), marks, &script_);
    if (!next) return problem_of_recipe_edit(next.error(), index);
    made_ = std::move(next).value();
    if (part == 1.0 && made_is_whole_) {
      whole_ = made_;
    } else if (goes_on) {
      made_is_whole_ = false;
      auto whole = make(whole_, edit.edit, marks_, nullptr);
      if (!whole) return problem_of_recipe_edit(whole.error(), index);
      whole_ = std::move(whole).value();
    }
    marks_ = carried_marks(*painted, marks_, *whole_.samples);
    return std::nullopt;
  }

  /// The edits and the preview's samples as play() left them.
  PlayedSteps::Step step() {
    return {.edits = std::exchange(script_.edits, {}), .result = own_samples(), .families = families()};
  }
  EditScript script() { return std::move(script_); }

  PlayedRecipe finish() {
    return {.script = std::move(script_),
            .rest = cloud_->position,
            .result = made_.surface->finest().position,
            .inserted = made_.samples->size() - std::min(made_.samples->size(), cloud_->size())};
  }

 private:
  /// PlayedSteps::Step::result
  [[nodiscard]] Points own_samples() const {
    const Points& position = made_.surface->finest().position;
    const Cloud& now = *made_.samples->sampling->cloud;
    if (made_.samples->sampling->parent.empty() && now.size() == cloud_->size()) return position;
    std::unordered_map<std::uint32_t, std::size_t> place;  // by id
    for (std::size_t i = 0; i < now.size(); ++i) place.emplace(now.id[i], i);
    Points own(cloud_->size());
    for (std::size_t i = 0; i < own.size(); ++i) {
      const auto found = place.find(cloud_->id[i]);
      own.set(i, found == place.end() ? Vec3f(Vec3f::Constant(std::numeric_limits<float>::quiet_NaN()))
                                      : position[found->second]);
    }
    return own;
  }
  /// PlayedSteps::Step::families
  [[nodiscard]] std::vector<std::uint32_t> families() const {
    const Sampling& sampling = *made_.samples->sampling;
    if (sampling.parent.empty()) return {};
    std::unordered_map<std::uint32_t, std::size_t> place;  // in the preview, by id
    for (std::size_t i = 0; i < cloud_->size(); ++i) place.emplace(cloud_->id[i], i);
    std::vector<std::uint32_t> families(cloud_->size(), 0);
    for (const std::uint32_t root : roots_of(sampling)) ++families[place.at(root)];
    return families;
  }

  std::optional<Problem> paint(std::size_t index, const RecipeEdit& edit) {
    auto painted = painted_for(limits_, whole_, index, edit, context_);
    if (!painted.ok()) return painted.problem();
    marks_ = std::move(painted.value().marks);
    return std::nullopt;
  }

  /// One edit; what it needs elsewhere goes into the script, where one is given.
  Result<SurfaceState> make(const SurfaceState& before, const EditParams& params, const SharedMarks& marks,
                            EditScript* script) {
    if (auto valid = validate(params, *before.surface); !valid) return valid.error();
    derived_ = {};
    auto state = with_valid_level(rest_, before, params.level, context_);
    if (!state) return state.error();
    auto field = field_of(state.value(), params.level, params.blend, *marks);
    if (!field) return field.error();
    auto after = edited(rest_, state.value(), params, field.value(), ResamplingEffort::kExact, context_);
    if (!after) return after.error();
    if (auto reach = check_reach(*after.value().surface, params.level); !reach) return reach.error();
    if (script != nullptr)
      script->edits.push_back({.params = params,
                               .regions = field.value().regions,
                               .derived = derived_.bands.empty()
                                              ? nullptr
                                              : std::make_shared<const LevelBases>(std::move(derived_))});
    return after;
  }

  std::shared_ptr<const Cloud> cloud_;
  const ExecutionContext& context_;
  SessionParams limits_;
  RestModel rest_;
  LevelBases derived_;  // what the last derivation of levels was made of
  EditScript script_;
  SurfaceState at_rest_;
  SurfaceState whole_;  // with all edits so far whole: what paintings are made on
  SurfaceState made_;   // with the parts that were asked for
  bool made_is_whole_ = true;
  std::uint32_t shared_ids_ = kAllIds;  // of samples that both may have
  SharedMarks marks_;                   // on the samples of whole_
};

}  // namespace

Outcome<HierarchyParams> hierarchy_for(const protocol::Recipe& recipe, const Cloud& preview,
                                       std::uint32_t neighbors) {
  HierarchyParams params{.scales = {}, .neighbors = neighbors};
  const auto diagonal = static_cast<double>(bounds_of(preview.position).diagonal());
  for (std::size_t k = 0; k + 1 < recipe.level_scales.size(); ++k)
    params.scales.push_back(static_cast<float>(diagonal > 0.0 ? recipe.level_scales[k] / diagonal : 0.0));
  if (auto valid = validate(params); !valid) {
    Problem problem = protocol::to_problem(valid.error());
    problem.detail = "the recipe's levels do not fit this cloud: " + problem.detail;
    problem.errors = {{.pointer = "/recipe/level_scales", .detail = valid.error().message}};
    return problem;
  }
  return params;
}

Outcome<PlayedRecipe> play_on_preview(const protocol::RecipeRequest& request,
                                      std::shared_ptr<const Cloud> preview, const HierarchyParams& params,
                                      const ExecutionContext& context) {
  Player player(std::move(preview), params, context);
  if (auto problem = player.start()) return *problem;
  if (auto problem = player.play(request)) return *problem;
  return player.finish();
}

Outcome<PlayedSteps> play_steps_on_preview(const protocol::RecipeRequest& request, std::uint32_t count,
                                           std::shared_ptr<const Cloud> preview,
                                           const HierarchyParams& params, const ExecutionContext& context) {
  PlayedSteps played;
  played.rest = preview->position;
  Player player(std::move(preview), params, context);
  if (auto problem = player.start()) return *problem;
  protocol::RecipeRequest part = request;
  std::vector<double> last_parts;
  for (std::uint32_t k = 0; k < count; ++k) {
    // The last one is request.s to the bit.
    if (k + 1 < count)
      part.s = request.s * static_cast<double>(k) / static_cast<double>(count - 1);
    else
      part.s = request.s;
    if (auto problem = player.play(part)) return *problem;
    PlayedSteps::Step step = player.step();
    // Regions and levels are those of the step before as far as the edits before them are.
    const std::vector<double> parts = parts_of_recipe(part);
    for (std::size_t i = 0; k > 0 && i < std::min(parts.size(), last_parts.size()); ++i) {
      step.edits[i].regions = played.steps.back().edits[i].regions;
      step.edits[i].derived = played.steps.back().edits[i].derived;
      if (parts[i] != last_parts[i]) break;
    }
    last_parts = parts;
    played.steps.push_back(std::move(step));
  }
  played.script = player.script();
  return played;
}

Result<SurfaceState> edit_directly(const EditScript& script, std::shared_ptr<const Cloud> cloud,
                                   const HierarchyParams& params, const ExecutionContext& context) {
  RestModel rest = rest_model(*cloud, params, build_hierarchy);
  auto built = build_hierarchy(*cloud, params, context);
  if (!built) return built.error();
  SurfaceState state = state_at_rest(std::move(cloud), std::move(built).value());
  rest.uploaded_ids = state.samples->sampling->next_id;
  for (const TransferredEdit& edit : script.edits) {
    auto ready = with_valid_level(rest, state, edit.params.level, context);
    if (!ready) return ready.error();
    state = std::move(ready).value();
    const Points& position = state.surface->levels[edit.params.level].position;
    const RegionField field{.t = std::make_shared<const ScaleField>(
                                compute_scale_field(position, *edit.regions, edit.params.blend, &context)),
                            .regions = edit.regions,
                            .samples = state.samples};
    if (context.is_cancelled()) return cancelled_error();
    auto after = edited(rest, state, edit.params, field, ResamplingEffort::kExact, context);
    if (!after) return after.error();
    state = std::move(after).value();
  }
  return state;
}

}  // namespace pointwright::server
