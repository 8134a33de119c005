#pragma once
// A session's state at one revision: immutable, shared by everyone who reads it.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/editing/painting.h"
#include "protocol/json/documents.h"
#include "server/sessions/history.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// The operations of a painting. Lists share them: appending copies none.
using OperationList = std::vector<std::shared_ptr<const PaintOperation>>;

/// One region as it was painted.
struct Painting {
  std::size_t samples = 0;
  std::size_t vertices = 0;  ///< of strokes and outlines, and balls
  std::shared_ptr<const OperationList> operations;
};

struct Document {
  protocol::SessionState state = protocol::SessionState::kBuilding;
  std::optional<protocol::Problem> error = std::nullopt;  ///< kFailed: why
  std::string name = {};                                  ///< of the session
  std::uint64_t revision = 0;  ///< grows with each change of a region, the name, the edits and the head
  SurfaceState surface = {};   ///< the committed one; null while building
  std::shared_ptr<const Marks> marks = {};
  Painting zero = {};
  Painting one = {};
  std::shared_ptr<const EditList> edits = {};  ///< the undone ones included
  std::size_t head = 0;                        ///< edits that are applied
  protocol::ModelBounds bounds = {};           ///< of the committed surface
  double spacing = 0.0;                        ///< of its samples, the median; 0 while building

  [[nodiscard]] const Painting& painting(RegionKind kind) const {
    return kind == RegionKind::kZero ? zero : one;
  }
};

using SharedDocument = std::shared_ptr<const Document>;

}  // namespace pointwright::server
