#pragma once
// What the frames of one drag with resampling share.

#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// For one thread at a time.
class ResampledDrag {
 public:
  /// Pre: `field` belongs to the level of the edits. The model outlives the drag.
  ResampledDrag(const RestModel& rest, SurfaceState state, RegionField field);

  /// Whether frames can be made of this surface with this field.
  [[nodiscard]] bool serves(const SurfaceState& state, const RegionField& field) const;
  /// The state with the edit. Exact ones are those of edited(), to the bit.
  /// Errors: those of edited()
  [[nodiscard]] Result<SurfaceState> frame(const EditParams& params, ResamplingEffort effort,
                                           const ExecutionContext& context) const;

 private:
  const RestModel& rest_;
  const SurfaceState state_;
  const RegionField field_;
};

}  // namespace pointwright::server
