#pragma once
// A shared amount of something (bytes, slots) of which parts can be held for a while.

#include <cstdint>
#include <memory>
#include <mutex>

namespace pointwright::server {

/// Thread-safe.
class Budget {
 public:
  explicit Budget(std::uint64_t total) : state_(std::make_shared<State>(total)) {}

  /// Holds `amount` until the last copy of the returned handle is gone; null where that much is not left.
  [[nodiscard]] std::shared_ptr<void> hold(std::uint64_t amount) {
    const std::lock_guard lock(state_->mutex);
    if (amount > state_->total - state_->held) return nullptr;
    state_->held += amount;
    return {state_.get(), [state = state_, amount](void*) {
              const std::lock_guard release_lock(state->mutex);
              state->held -= amount;
            }};
  }
  [[nodiscard]] std::uint64_t held() const {
    const std::lock_guard lock(state_->mutex);
    return state_->held;
  }
  [[nodiscard]] std::uint64_t total() const { return state_->total; }

 private:
  struct State {
    explicit State(std::uint64_t amount) : total(amount) {}
    const std::uint64_t total;
    std::mutex mutex;  // guards held
    std::uint64_t held = 0;
  };
  std::shared_ptr<State> state_;
};

}  // namespace pointwright::server
