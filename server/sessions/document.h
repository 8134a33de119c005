#pragma once
// A session's state at one revision: immutable, shared by everyone who reads it.

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "engine/editing/painting.h"
#include "protocol/json/documents.h"
#include "server/sessions/history.h"
#include "server/sessions/named_regions.h"
#include "server/sessions/painting.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

struct Document {
  protocol::SessionState state = protocol::SessionState::kBuilding;
  std::optional<protocol::Problem> error = std::nullopt;  ///< kFailed: why
  std::string name = {};                                  ///< of the session
  std::uint64_t revision = 0;  ///< grows with each change of a region, the name, the edits and the head
  SurfaceState surface = {};   ///< the committed one; null while building
  std::shared_ptr<const Marks> marks = {};
  Painting zero = {};
  Painting one = {};
  SharedNamedRegions named = {};
  std::shared_ptr<const EditList> edits = {};  ///< the undone ones included
  std::size_t head = 0;                        ///< edits that are applied
  protocol::ModelBounds bounds = {};           ///< of the committed surface
  double spacing = 0.0;                        ///< of its samples, the median; 0 while building

  [[nodiscard]] const Painting& painting(RegionKind kind) const {
    return kind == RegionKind::kZero ? zero : one;
  }
};

/// The box of samples in model coordinates; of none: the origin.
protocol::ModelBounds model_bounds(const Points& position, const Vec3d& origin);

using SharedDocument = std::shared_ptr<const Document>;

}  // namespace pointwright::server
