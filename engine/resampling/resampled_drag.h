#pragma once
// What the frames of a drag with resampling share.

#include <memory>

#include "engine/resampling/resampled_edit.h"

namespace pointwright {

/// Not thread-safe. Its frames are those of apply_resampled_edit(), to the bit.
class ResampledDrag {
 public:
  /// Of `params`, the level, the kinds of deformation and whether there are gains count, not their amounts.
  /// Shapes: as apply_resampled_edit()
  /// Cost:   that of an EditPlan and a copy of the surface
  ResampledDrag(std::shared_ptr<const MultiresSurface> surface, std::shared_ptr<const Sampling> sampling,
                const EditParams& params, std::shared_ptr<const ScaleField> field, RegionPair regions);
  ~ResampledDrag();
  ResampledDrag(const ResampledDrag&) = delete;
  ResampledDrag& operator=(const ResampledDrag&) = delete;

  /// Whether frames of these parameters can be made, given the same surface, field and regions.
  [[nodiscard]] bool serves(const EditParams& params) const;

  /// `room`: the surface of a frame of this drag that nobody needs any more, whose memory is written over, or
  /// an empty one.
  /// Errors: those of apply_resampled_edit()
  /// Cost:   what the samples that move and those that are inserted cost; a copy of the surface without room
  Result<ResampledEdit> frame(const EditParams& params, ResamplingEffort effort, MultiresSurface room = {},
                              const ExecutionContext* context = nullptr);

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace pointwright
