#pragma once
// Paintings in the making: operations onto marks, recorded in model space, within a session's limits.

#include <vector>

#include "engine/editing/painting.h"
#include "server/base/outcome.h"
#include "server/sessions/document.h"
#include "server/sessions/session_params.h"

namespace pointwright::server {

/// The finest level of a state as a surface to paint on. The state must outlive it.
PaintSurface paint_surface(const SurfaceState& state);

/// Two regions that are being painted. Each list gives its region's samples by itself, here and on another
/// sampling, in whatever order the two are replayed.
class Painter {
 public:
  /// `zero`, `one`: what is appended to; a default one is an empty painting.
  Painter(const SessionParams& params, const PaintSurface& surface, const Painting& zero,
          const Painting& one);

  /// Paints what the operation resolves to (engine/editing/resolved_painting.h) and records it. What it
  /// steals is recorded as removed from the other region, the rest without stealing.
  /// Pre:      the operation is valid and its image or model was found
  /// Problems: too many operations or vertices; marks and recording must then be dropped
  /// Cancels:  the same
  Outcome<Done> paint(RegionKind kind, const PaintOperation& operation, Marks& marks,
                      const ExecutionContext& context);

  /// The painting of a region as recorded so far.
  [[nodiscard]] Painting finish(RegionKind kind, const Marks& marks) const;

 private:
  struct Recording {
    OperationList operations;
    std::size_t vertices = 0;
  };
  static Recording recording_of(const Painting& painting);
  Outcome<Done> record(Recording& recording, std::vector<PaintOperation> operations) const;

  const SessionParams& params_;
  const PaintSurface surface_;
  Recording zero_;
  Recording one_;
};

}  // namespace pointwright::server
