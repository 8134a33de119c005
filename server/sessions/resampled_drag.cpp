#include "server/sessions/resampled_drag.h"

#include <utility>

namespace pointwright::server {

ResampledDrag::ResampledDrag(const RestModel& rest, SurfaceState state, RegionField field)
    : rest_(rest), state_(std::move(state)), field_(std::move(field)) {}

bool ResampledDrag::serves(const SurfaceState& state, const RegionField& field) const {
  return state.surface == state_.surface && field.t == field_.t;
}

Result<SurfaceState> ResampledDrag::frame(const EditParams& params, ResamplingEffort effort,
                                          const ExecutionContext& context) const {
  return edited(rest_, state_, params, field_, effort, context);
}

}  // namespace pointwright::server
