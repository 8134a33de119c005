#pragma once
// Paintings in the making: operations onto marks, recorded in model space, within a session's limits.

#include <vector>

#include "engine/editing/painting.h"
#include "server/base/outcome.h"
#include "server/sessions/document.h"
#include "server/sessions/session_params.h"

namespace pointwright::server {

/// The finest level of a state as a surface to paint on. The rest model and the state must outlive it.
PaintSurface paint_surface(const RestModel& rest, const SurfaceState& state);

/// A region that is being painted.
class Painter {
 public:
  /// `before`: what is appended to; a default one is an empty painting.
  Painter(const SessionParams& params, const PaintSurface& surface, RegionKind kind, const Painting& before);

  /// Paints what the operation resolves to (engine/editing/resolved_painting.h): what is recorded gives these
  /// marks again, here and on another sampling.
  /// Pre:      the operation is valid and its image or model was found
  /// Problems: too many operations or vertices; the marks are then as they were before the operation
  /// Cancels:  the marks and the recording are then incomplete and must be dropped
  Outcome<Done> paint(const PaintOperation& operation, Marks& marks, const ExecutionContext& context);

  /// The painting as recorded so far.
  [[nodiscard]] Painting finish(const Marks& marks) const;

 private:
  const SessionParams& params_;
  const PaintSurface surface_;
  RegionKind kind_;
  OperationList operations_;
  std::size_t vertices_ = 0;
};

}  // namespace pointwright::server
