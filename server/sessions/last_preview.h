#pragma once
// What a session remembers of previews: the last one, so that committing it need not compute it again, and
// the one that is to be shown next.

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>

#include "protocol/json/requests.h"
#include "server/sessions/surface_state.h"

namespace pointwright::server {

/// What decides t on the samples of a level.
struct FieldKey {
  std::shared_ptr<const MultiresSurface> surface;
  std::shared_ptr<const Marks> marks;
  std::uint32_t level = 0;
  Blend blend = Blend::kQuartic;
  friend bool operator==(const FieldKey&, const FieldKey&) = default;
};

struct LastPreview {
  FieldKey base;
  EditParams params;
  SurfaceState after;
  bool exact = true;  ///< what a commit would record
};

/// The newest preview that was asked for, and the numbers that tell one of a drag that has ended apart.
struct DragTurns {
  std::mutex mutex;  // guards the rest
  std::shared_ptr<const protocol::PreviewRequest> pending;
  bool is_scheduled = false;
  std::uint64_t newest_sequence = 0;
  std::chrono::steady_clock::time_point newest_time;
  std::uint64_t ended_sequence = 0;  ///< the last one of the drag before
  std::chrono::steady_clock::time_point ended_time;
};

}  // namespace pointwright::server
