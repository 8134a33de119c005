#include "engine/resampling/resampled_edit.h"

#include "engine/core/check.h"
#include "engine/resampling/resampled_drag.h"

namespace pointwright {
namespace {

// What the caller keeps alive.
template <typename T>
std::shared_ptr<const T> borrowed(const T& value) {
  return {std::shared_ptr<const void>(), &value};
}

}  // namespace

Result<ResampledEdit> apply_resampled_edit(const MultiresSurface& surface,
                                           const std::shared_ptr<const Sampling>& sampling,
                                           const EditParams& params, const ScaleField& field,
                                           const RegionPair& regions, ResamplingEffort effort,
                                           const ExecutionContext* context) {
  return ResampledDrag(borrowed(surface), sampling, params, borrowed(field), regions)
      .frame(params, effort, {}, context);
}

}  // namespace pointwright
