#include "server/sessions/sample_room.h"

#include <algorithm>
#include <string>

#include "engine/core/execution_context.h"

namespace pointwright::server {

std::uint64_t SampleRoom::most() const {
  if (bytes_each_ == 0) return limit_;
  const auto memory = memory_.lock();
  const std::lock_guard lock(mutex_);
  return std::min(limit_, samples_ + (memory == nullptr ? 0 : memory->left() / bytes_each_));
}

Result<void> SampleRoom::take(std::uint64_t samples) {
  if (bytes_each_ == 0) return {};
  const auto memory = memory_.lock();
  const std::lock_guard lock(mutex_);
  if (samples <= samples_) return {};
  if (memory == nullptr) return cancelled_error();
  if (!memory->grow_by((samples - samples_) * bytes_each_)) {
    const std::uint64_t most = samples_ + memory->left() / bytes_each_;
    return Error{.code = ErrorCode::kTooLarge,
                 .message = "the memory for sessions has no room for " + std::to_string(samples) + " samples",
                 .field = "resampling.max_samples",
                 .limit = static_cast<double>(most),
                 .actual = static_cast<double>(samples)};
  }
  samples_ = samples;
  return {};
}

}  // namespace pointwright::server
