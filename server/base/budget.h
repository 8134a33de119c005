#pragma once
// A shared amount of something (bytes, slots) of which parts can be held for a while.

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>

namespace pointwright::server {

/// Thread-safe.
class Budget {
  struct State;

 public:
  explicit Budget(std::uint64_t total) : state_(std::make_shared<State>(total)) {}

  /// A part of the budget, given back when it is destroyed.
  class Hold {
   public:
    Hold(std::shared_ptr<State> state, std::uint64_t amount) : state_(std::move(state)), amount_(amount) {}
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;
    ~Hold() { shrink_to(0); }
    /// Gives back all but `amount`; nothing where that much is not held.
    void shrink_to(std::uint64_t amount) {
      const std::lock_guard lock(state_->mutex);
      if (amount >= amount_) return;
      state_->held -= amount_ - amount;
      amount_ = amount;
    }

    /// Holds so much more, where it is left. Returns whether it was.
    [[nodiscard]] bool grow_by(std::uint64_t amount) {
      const std::lock_guard lock(state_->mutex);
      if (amount > state_->left()) return false;
      state_->held += amount;
      amount_ += amount;
      return true;
    }
    /// What nobody holds of the whole budget.
    [[nodiscard]] std::uint64_t left() const {
      const std::lock_guard lock(state_->mutex);
      return state_->left();
    }

   private:
    std::shared_ptr<State> state_;
    std::uint64_t amount_;  // guarded by the state's mutex
  };

  /// Holds `amount` until the last copy of the returned handle is gone; null where that much is not left.
  [[nodiscard]] std::shared_ptr<Hold> hold(std::uint64_t amount) { return hold(amount, false); }
  /// As hold(), but where nothing else is held any amount is granted: what is larger than the whole budget
  /// gets its turn alone.
  [[nodiscard]] std::shared_ptr<Hold> hold_or_alone(std::uint64_t amount) { return hold(amount, true); }
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
    [[nodiscard]] std::uint64_t left() const { return held < total ? total - held : 0; }
  };

  [[nodiscard]] std::shared_ptr<Hold> hold(std::uint64_t amount, bool even_beyond) {
    {
      const std::lock_guard lock(state_->mutex);
      const bool fits = state_->held <= state_->total && amount <= state_->left();
      if (!fits && !(even_beyond && state_->held == 0)) return nullptr;
      state_->held += amount;
    }
    return std::make_shared<Hold>(state_, amount);
  }

  std::shared_ptr<State> state_;
};

}  // namespace pointwright::server
