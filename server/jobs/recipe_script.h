#pragma once
// A recipe played on a preview, without a session: what it says about all other samplings of the surface.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/execution_context.h"
#include "engine/multires/hierarchy.h"
#include "engine/transfer/transferred_edits.h"
#include "protocol/json/recipe.h"
#include "server/base/outcome.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

struct PlayedRecipe {
  EditScript script;
  /// The preview's own samples, before and after.
  Points rest;
  Points result;
  std::size_t inserted = 0;  ///< samples that resampling has inserted, less those it has collected
};

/// The builder's parameters for a recipe's levels on this cloud. Problem: kInvalidValue where no builder
/// takes them.
Outcome<HierarchyParams> hierarchy_for(const protocol::Recipe& recipe, const Cloud& preview,
                                       std::uint32_t neighbors);

/// Makes the recipe's edits on the preview, up to request.s, as a session that applies the recipe does: the
/// same regions, levels and bits.
/// Problems:    those of applying a recipe, with pointers into the request's document; kCancelled
/// Cost:        building the preview's levels, then a replay
/// Determinism: bitwise equal for any thread count
Outcome<PlayedRecipe> play_on_preview(const protocol::RecipeRequest& request,
                                      std::shared_ptr<const Cloud> preview, const HierarchyParams& params,
                                      const ExecutionContext& context);

/// A recipe's course from s = 0: one script, and the edits of each step.
struct PlayedSteps {
  struct Step {
    std::vector<TransferredEdit> edits;
    Points result;  ///< the preview's own samples; NaN where one was collected
    /// How many samples each of these has become, itself included; empty where no edit resamples.
    std::vector<std::uint32_t> families;
  };
  EditScript script;  ///< without edits
  Points rest;        ///< the preview's own samples
  std::vector<Step> steps;
};

/// Step k of count is the recipe at s = request.s k / (count - 1), as play_on_preview makes it; a single one
/// is request.s itself. What steps have in common is kept once.
Outcome<PlayedSteps> play_steps_on_preview(const protocol::RecipeRequest& request, std::uint32_t count,
                                           std::shared_ptr<const Cloud> preview,
                                           const HierarchyParams& params, const ExecutionContext& context);

/// The script's edits on levels of the cloud's own, with the preview's regions: volumes, whatever the
/// sampling.
/// Errors: those of building and editing
Result<SurfaceState> edit_directly(const EditScript& script, std::shared_ptr<const Cloud> cloud,
                                   const HierarchyParams& params, const ExecutionContext& context);

}  // namespace pointwright::server
