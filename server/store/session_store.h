#pragma once
// All sessions that live.

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/sessions/session.h"
#include "server/store/cloud_store.h"

namespace pointwright::server {

/// Thread-safe.
class SessionStore {
 public:
  SessionStore(const Limits& limits, SessionServices services);
  ~SessionStore();
  SessionStore(const SessionStore&) = delete;
  SessionStore& operator=(const SessionStore&) = delete;

  /// Opens a session on a cloud and starts building it.
  /// Problems: not found (the cloud), too many, out of space
  Outcome<std::shared_ptr<Session>> create(const CloudStore& clouds,
                                           const protocol::CreateSessionRequest& request);
  [[nodiscard]] std::shared_ptr<Session> find(const std::string& id) const;
  [[nodiscard]] std::vector<std::shared_ptr<Session>> list() const;  ///< oldest first
  /// Removes a session and ends it, at the expected revision where one is given.
  /// Problems: not found, stale revision
  Outcome<Done> remove(const std::string& id, Session::Expected expected = {});
  /// Ends all sessions: the server stops.
  void close_all(const std::string& reason);

 private:
  struct Entry {
    std::shared_ptr<Session> session;
    std::shared_ptr<const void> cloud_use;
    std::shared_ptr<void> memory;
  };

  const Limits limits_;
  const SessionServices services_;
  Budget memory_;
  mutable std::mutex mutex_;  // guards entries_
  std::vector<Entry> entries_;
};

}  // namespace pointwright::server
