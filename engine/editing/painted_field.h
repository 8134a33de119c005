#pragma once
// The scale field of a painting, ready for the next stroke: what a change cannot reach is taken over.

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/core/points.h"
#include "engine/core/result.h"
#include "engine/editing/painting.h"
#include "engine/editing/region.h"
#include "engine/editing/scale_field.h"

namespace pointwright {

/// Immutable; copies share the field.
class PaintedField {
 public:
  /// The regions around the marks (regions_from_marks) and t on the samples of the level.
  /// Errors:      those of regions_from_marks
  /// Cost:        that of regions_from_marks and compute_scale_field
  /// Determinism: bitwise equal for any thread count; field() is bitwise that of compute_scale_field
  /// Cancels:     between blocks; the field is then incomplete (the caller checks is_cancelled())
  static Result<PaintedField> make(const Points& position, const std::vector<float>& spacing,
                                   const Marks& marks, const Vec3d& origin, Blend blend,
                                   const ExecutionContext* context = nullptr);

  /// The same with other marks, bitwise: windows of samples that no ball which came, went or changed its
  /// radius can reach within the distances that were found there keep their t.
  /// Pre:  position, spacing and origin as they were
  /// Cost: that of regions_from_marks, a copy of the field, and compute_scale_field over the other windows
  [[nodiscard]] Result<PaintedField> repainted(const Points& position, const std::vector<float>& spacing,
                                               const Marks& marks, const Vec3d& origin,
                                               const ExecutionContext* context = nullptr) const;

  [[nodiscard]] const std::shared_ptr<const ScaleField>& field() const { return field_; }
  [[nodiscard]] const RegionPair& regions() const { return regions_; }
  [[nodiscard]] Blend blend() const { return blend_; }
  /// Samples whose t the last repainted() computed anew; all of them after make().
  [[nodiscard]] std::size_t computed_samples() const { return computed_; }

 private:
  // Runs of samples, and the greatest distances that t depends on in each.
  struct Windows {
    Points middle;
    std::vector<float> half;  // how far the window's samples may be from it
    std::vector<float> zero_reach;
    std::vector<float> one_reach;
  };
  PaintedField(Marks marks, RegionPair regions, Blend blend)
      : marks_(std::move(marks)), regions_(std::move(regions)), blend_(blend) {}
  static Windows windows_of(const Points& position);
  [[nodiscard]] std::vector<std::uint8_t> reached_windows(const Points& position,
                                                          const PaintedField& now) const;
  void fill(const Points& position, const std::vector<std::uint8_t>& fresh, const ScaleField* before,
            const ExecutionContext* context);

  Marks marks_;
  RegionPair regions_;
  Blend blend_;
  Windows windows_;
  std::shared_ptr<const ScaleField> field_;
  std::size_t computed_ = 0;
};

}  // namespace pointwright
