#pragma once
// Who looks at a session right now.

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "protocol/json/documents.h"

namespace pointwright::server {

/// Viewers come with their stream and go with it. Thread-safe.
class Presence : public std::enable_shared_from_this<Presence> {
 public:
  /// `changed` is called after each coming and going, by whoever came or went.
  explicit Presence(std::function<void()> changed) : changed_(std::move(changed)) {}

  /// Counts a viewer in until the handle is gone.
  [[nodiscard]] std::shared_ptr<const void> join(std::string name);

  struct Now {
    std::uint64_t version = 0;  ///< grows with each change
    std::vector<protocol::Viewer> viewers;
  };
  [[nodiscard]] Now now() const;  ///< in the order in which they came
  [[nodiscard]] std::uint64_t version() const;

 private:
  std::function<void()> changed_;
  mutable std::mutex mutex_;  // guards the rest
  std::uint64_t version_ = 0;
  std::list<protocol::Viewer> viewers_;
};

}  // namespace pointwright::server
