#pragma once
// Cancel and progress of long work: a cheap handle that the caller keeps one copy of and the work another.

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "engine/core/result.h"

namespace pointwright {

/// Where long work stands.
struct Progress {
  std::string phase;      ///< what is being done, as a short lower-case phrase ("normals")
  double fraction = 0.0;  ///< of the whole work, in [0, 1], never decreasing
};

/// Shared handle on one piece of long work. All methods are thread-safe; copies share the same state.
/// Cancels: observed between phases and between blocks of a parallel loop that is given the context.
class ExecutionContext {
 public:
  ExecutionContext() : state_(std::make_shared<State>()) {}

  void cancel() const { state_->cancelled.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool is_cancelled() const { return state_->cancelled.load(std::memory_order_relaxed); }

  /// Names the phase that starts now and the fraction of the whole that is done before it.
  void begin_phase(std::string phase, double fraction_done) const {
    const std::lock_guard lock(state_->mutex);
    state_->progress.phase = std::move(phase);
    if (fraction_done > state_->progress.fraction) state_->progress.fraction = fraction_done;
  }
  [[nodiscard]] Progress progress() const {
    const std::lock_guard lock(state_->mutex);
    return state_->progress;
  }

 private:
  struct State {
    std::atomic<bool> cancelled{false};
    std::mutex mutex;  // guards progress
    Progress progress;
  };
  std::shared_ptr<State> state_;
};

/// The one Error of cancelled work.
inline Error cancelled_error() {
  return Error{.code = ErrorCode::kCancelled, .message = "the work was cancelled", .field = {}};
}

}  // namespace pointwright
