#pragma once
// How many samples the surface of a session may come to have.

#include <cstdint>
#include <memory>
#include <mutex>

#include "engine/core/result.h"
#include "server/base/budget.h"

namespace pointwright::server {

/// A limit, and what the memory for sessions has left. Memory that was taken is kept as long as its holder
/// lives: undone edits can be redone. Thread-safe.
class SampleRoom {
 public:
  /// Without memory that it would have to account for.
  explicit SampleRoom(std::uint64_t limit) : limit_(limit) {}
  /// `memory`: held for `samples`; each further one takes `bytes_each`, at least 1. There is no more room
  /// once its holder has dropped it.
  SampleRoom(std::uint64_t limit, const std::shared_ptr<Budget::Hold>& memory, std::uint64_t samples,
             std::uint64_t bytes_each)
      : limit_(limit), memory_(memory), bytes_each_(bytes_each), samples_(samples) {}

  /// Samples that there is room for right now.
  [[nodiscard]] std::uint64_t most() const;
  /// Takes the memory for so many samples, where they are more than before.
  /// Errors: kTooLarge (field "resampling.max_samples"); kCancelled once the memory was dropped
  Result<void> take(std::uint64_t samples);

 private:
  const std::uint64_t limit_;
  const std::weak_ptr<Budget::Hold> memory_;
  const std::uint64_t bytes_each_ = 0;  // 0: nothing is accounted for
  mutable std::mutex mutex_;            // guards samples_
  std::uint64_t samples_ = 0;
};

}  // namespace pointwright::server
