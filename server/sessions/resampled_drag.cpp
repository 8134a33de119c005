#include "server/sessions/resampled_drag.h"

#include <utility>

namespace pointwright::server {
namespace {

bool is_engines(const Resampler& resampler) {
  const auto* function = resampler.target<decltype(&apply_resampled_edit)>();
  return function != nullptr && *function == &apply_resampled_edit;
}

}  // namespace

ResampledDrag::ResampledDrag(const RestModel& rest, SurfaceState state, RegionField field)
    : state_(std::move(state)), field_(std::move(field)), rest_(rest) {
  if (!is_engines(rest.resample)) return;
  // Every frame is of this state and field; of another kind of deformation than the last it starts anew.
  rest_.resample = [kept = std::make_shared<Kept>(), this](
                       const MultiresSurface&, const std::shared_ptr<const Sampling>& sampling,
                       const EditParams& params, const ScaleField&, const RegionPair& regions,
                       ResamplingEffort effort, const ExecutionContext* context) {
    if (kept->drag == nullptr || !kept->drag->serves(params)) {
      kept->drag = nullptr;
      kept->drag =
          std::make_unique<pointwright::ResampledDrag>(state_.surface, sampling, params, field_.t, regions);
    }
    auto drag = std::move(kept->drag);  // gone where the frame throws
    auto frame = drag->frame(params, effort, {}, context);
    kept->drag = std::move(drag);
    return frame;
  };
}

bool ResampledDrag::serves(const SurfaceState& state, const RegionField& field) const {
  return state.surface == state_.surface && field.t == field_.t;
}

Result<SurfaceState> ResampledDrag::frame(const EditParams& params, ResamplingEffort effort,
                                          const ExecutionContext& context) const {
  return edited(rest_, state_, params, field_, effort, context);
}

}  // namespace pointwright::server
