#pragma once
// What the frames of one drag share: the plan of the edit, and surfaces whose memory goes round.

#include <memory>

#include "engine/editing/edit_plan.h"
#include "server/base/recycler.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// Immutable but for the memory that frames hand back; frame() is for one thread at a time, frames may be
/// dropped by any.
class Drag {
 public:
  /// Pre:  `field` belongs to params.level of the state
  /// Cost: that of an EditPlan
  Drag(const RestModel& rest, SurfaceState state, std::shared_ptr<const ScaleField> field,
       const EditParams& params);
  Drag(const Drag&) = delete;
  Drag& operator=(const Drag&) = delete;

  /// Whether frames of these parameters can be made: the same surface, field and kind of deformation.
  [[nodiscard]] bool serves(const SurfaceState& state, const std::shared_ptr<const ScaleField>& field,
                            const EditParams& params) const;
  /// The surface with the edit, the same bits as apply_edit() without a plan gives. The first frames copy the
  /// surface; later ones write only what moves over a frame that was dropped.
  [[nodiscard]] std::shared_ptr<const MultiresSurface> frame(const EditParams& params);

 private:
  const Vec3d origin_;
  const SurfaceState state_;
  const std::shared_ptr<const ScaleField> field_;
  const EditPlan plan_;
  // Surfaces that nobody looks at any more, equal to the drag's but for what moves.
  Recycler<MultiresSurface> free_;
};

}  // namespace pointwright::server
