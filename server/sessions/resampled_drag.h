#pragma once
// What the frames of one drag with resampling share.

#include <memory>

#include "engine/resampling/resampled_drag.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// For one thread at a time. Frames share what the engine's ResampledDrag keeps; those of a stand-in for the
/// engine's resampler share nothing.
class ResampledDrag {
 public:
  /// Pre: `field` belongs to the level of the edits
  ResampledDrag(const RestModel& rest, SurfaceState state, RegionField field);
  ResampledDrag(const ResampledDrag&) = delete;
  ResampledDrag& operator=(const ResampledDrag&) = delete;

  /// Whether frames can be made of this surface with this field.
  [[nodiscard]] bool serves(const SurfaceState& state, const RegionField& field) const;
  /// The state with the edit. Exact ones are those of edited(), to the bit.
  /// Errors: those of edited()
  [[nodiscard]] Result<SurfaceState> frame(const EditParams& params, ResamplingEffort effort,
                                           const ExecutionContext& context) const;

 private:
  struct Kept {
    std::unique_ptr<pointwright::ResampledDrag> drag;
  };

  const SurfaceState state_;
  const RegionField field_;
  RestModel rest_;  // with a resampler that makes frames
};

}  // namespace pointwright::server
