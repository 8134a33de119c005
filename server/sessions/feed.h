#pragma once
// How streams learn that something new is there.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace pointwright::server {

/// Counts changes and wakes whoever waits for the next one. Thread-safe.
class Feed {
 public:
  void notify() {
    {
      const std::lock_guard lock(mutex_);
      ++changes_;
    }
    changed_.notify_all();
  }
  /// Waits until there were more than `seen` changes, or the deadline. Returns their number.
  std::uint64_t wait_beyond(std::uint64_t seen, std::chrono::steady_clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, deadline, [&] { return changes_ > seen; });
    return changes_;
  }

 private:
  std::mutex mutex_;  // guards changes_
  std::condition_variable changed_;
  std::uint64_t changes_ = 0;
};

}  // namespace pointwright::server
