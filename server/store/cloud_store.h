#pragma once
// The uploaded clouds, in memory.

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "protocol/json/documents.h"
#include "server/base/budget.h"
#include "server/base/outcome.h"
#include "server/config/limits.h"

namespace pointwright::server {

/// One cloud. Immutable but for the number of sessions that use it.
struct StoredCloud {
  protocol::CloudDocument document;
  std::shared_ptr<const Cloud> cloud;
  std::shared_ptr<void> memory;  ///< its part of the budget
  mutable std::atomic<int> users{0};
};
using SharedCloud = std::shared_ptr<const StoredCloud>;

/// Thread-safe.
class CloudStore {
 public:
  explicit CloudStore(const Limits& limits);

  /// Whether one more cloud may come: asked before its bytes are read. Problem: too many.
  Outcome<Done> check_room() const;
  /// Problems: too many clouds, out of space.
  Outcome<SharedCloud> add(protocol::CloudDocument document, Cloud cloud);
  [[nodiscard]] SharedCloud find(const std::string& id) const;
  /// Marks the cloud as used until the returned handle is gone; null for an unknown id.
  [[nodiscard]] std::shared_ptr<const void> use(const std::string& id) const;
  [[nodiscard]] std::vector<SharedCloud> list() const;  ///< oldest first
  /// Problems: not found, in use.
  Outcome<Done> remove(const std::string& id);

 private:
  [[nodiscard]] Outcome<Done> check_room_locked() const;

  const std::uint64_t max_clouds_;
  mutable Budget memory_;
  mutable std::mutex mutex_;  // guards clouds_
  std::vector<SharedCloud> clouds_;
};

}  // namespace pointwright::server
