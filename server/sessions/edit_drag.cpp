#include "server/sessions/edit_drag.h"

#include <algorithm>

namespace pointwright::server {

Result<SurfaceState> EditDrag::frame(const RestModel& rest, const SurfaceState& now, const RegionField& field,
                                     const EditParams& params, ResamplingEffort effort,
                                     const ExecutionContext& context) {
  if (params.resampling) {
    plain_.reset();
    if (resampled_ == nullptr || !resampled_->serves(now, field))
      resampled_ = std::make_unique<ResampledDrag>(rest, now, field);
    return resampled_->frame(params, effort, context);
  }
  resampled_.reset();
  if (plain_ == nullptr || !plain_->serves(now, field.t, params)) {
    plain_.reset();
    plain_ = std::make_unique<Drag>(rest, now, field.t, params);
  }
  const bool exact = effort == ResamplingEffort::kExact;
  return SurfaceState{.surface = plain_->frame(params),
                      .reports = now.reports,
                      .first_valid_level = std::max(now.first_valid_level, params.level),
                      .samples = exact ? carried_samples(now, params, *field.t) : now.samples};
}

void EditDrag::forget_resampled() {
  resampled_.reset();
}

void EditDrag::forget() {
  plain_.reset();
  resampled_.reset();
}

}  // namespace pointwright::server
