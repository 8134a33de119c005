#pragma once
// The frames of whatever edit is being dragged.

#include <memory>

#include "server/sessions/drag.h"
#include "server/sessions/resampled_drag.h"

namespace pointwright::server {

/// Keeps what frames share for as long as they can. For one thread at a time.
class EditDrag {
 public:
  /// The state with the edit. Previews of an edit with resampling may differ from it; those without have its
  /// surface, on samples whose cells are still those before.
  /// Pre:    `field` belongs to params.level of `now`; one model for all frames, which outlives the drag
  /// Errors: those of edited()
  Result<SurfaceState> frame(const RestModel& rest, const SurfaceState& now, const RegionField& field,
                             const EditParams& params, ResamplingEffort effort,
                             const ExecutionContext& context);
  /// Drops what frames with resampling share: it is as large as several surfaces.
  void forget_resampled();
  /// Drops what was kept: the surface is another one, or memory is wanted.
  void forget();

 private:
  std::unique_ptr<Drag> plain_;
  std::unique_ptr<ResampledDrag> resampled_;
};

}  // namespace pointwright::server
