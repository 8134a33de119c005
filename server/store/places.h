#pragma once
// How many entries a store's table takes.

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>

#include "protocol/json/problem.h"
#include "server/base/outcome.h"

namespace pointwright::server {

/// Guarded by the mutex of its table.
class Places {
 public:
  /// `entries`: what they are called, in the plural.
  Places(std::string entries, std::uint64_t most) : entries_(std::move(entries)), most_(most) {}

  /// Whether there is room for one more beside the `held` ones. Problem: too many; time lifts it where some
  /// of those that are being stored may yet come to nothing.
  [[nodiscard]] Outcome<Done> check(std::size_t held) const {
    if (held + coming_ < most_) return Done{};
    protocol::Problem problem{.kind = protocol::ProblemKind::kTooMany,
                              .detail = "the server holds as many " + entries_ + " as it may",
                              .limit = static_cast<double>(most_),
                              .actual = static_cast<double>(held + coming_)};
    if (held < most_) problem.retry_after = protocol::kPassingSeconds;
    return problem;
  }

  /// Puts an entry into the table after `keep` has stored it, which takes its time: that is done without the
  /// lock, the entry's place taken already.
  /// Problems: those of check() and of keep()
  template <typename Table, typename Keep>
  Outcome<Done> enter(std::mutex& mutex, Table& table, const typename Table::value_type& entry, Keep keep) {
    {
      const std::lock_guard lock(mutex);
      if (auto room = check(table.size()); !room.ok()) return room;
      ++coming_;
    }
    Outcome<Done> kept = Done{};
    try {
      kept = keep();
    } catch (...) {
      const std::lock_guard lock(mutex);
      --coming_;
      throw;
    }
    const std::lock_guard lock(mutex);
    --coming_;
    if (kept.ok()) table.push_back(entry);
    return kept;
  }

 private:
  const std::string entries_;
  const std::uint64_t most_;
  std::size_t coming_ = 0;
};

}  // namespace pointwright::server
