#pragma once
// How large tiles are, and how much around each of them its work needs.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/cloud.h"
#include "server/base/outcome.h"
#include "server/jobs/recipe_script.h"

namespace pointwright::server {

/// Whether any of the edits inserts samples.
bool resamples(const PlayedSteps& played);

/// Neighbourhoods around a sample that its own outcome depends on.
std::uint32_t rings_of(const PlayedSteps& played);

struct TilePlan {
  std::uint64_t most = 0;  ///< samples of a tile
  std::size_t lanes = 1;   ///< tiles that are edited side by side, whatever the number of threads
  double room = 0.0;       ///< samples that a lane may hold, with those around a tile and those inserted
  double around = 0.0;     ///< spacings that what is read is wider than a tile

  /// For how many samples of an undisturbed place one counts that becomes so many.
  [[nodiscard]] double weight_of(double family) const;
};
/// Of what memory leaves room for: tiles with all that is around them, two side by side where that makes them
/// no narrower than an eighth of what is read.
/// `samples`: of the whole scan, as many as they become; `neighbors`: of a neighbourhood; `value_bytes`: of
/// what a sample takes along besides, where samples are inserted
/// Problem: out of space, where the smallest tile takes more than the memory, with all that its samples
/// depend on and where they become most (memory of less than 256 MiB counts as that)
/// Cost:    256 searches among the preview's samples where samples are inserted
Outcome<TilePlan> plan_tiles(const PlayedSteps& played, std::uint64_t samples, std::uint32_t neighbors,
                             std::uint64_t value_bytes, std::uint64_t memory_bytes);

/// The candidates that tiles are cut by, each as often as it weighs: a tile whose samples become many holds
/// fewer of them. About the script's origin.
Points weighted_candidates(const Cloud& candidates, const PlayedSteps& played, const TilePlan& plan,
                           const ExecutionContext& context);

}  // namespace pointwright::server
