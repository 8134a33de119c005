#pragma once
// All sessions: those that are awake, and those that sleep in the archive until somebody asks for them.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/base/caller.h"
#include "server/sessions/session.h"
#include "server/store/archive.h"
#include "server/store/cloud_store.h"

namespace pointwright::server {

/// Thread-safe.
class SessionStore {
 public:
  using Removed = std::function<void(const std::string& id)>;
  /// `archive`: where sessions are kept; null: nowhere, and none ever sleeps. Both must outlive the store.
  /// `removed` hears of each session that is gone, whether it was deleted or nobody asked for it.
  SessionStore(const Limits& limits, const CloudStore& clouds, SessionServices services,
               Archive* archive = nullptr, Removed removed = {});
  ~SessionStore();
  SessionStore(const SessionStore&) = delete;
  SessionStore& operator=(const SessionStore&) = delete;

  /// Takes over what the archive has, at start: all of them asleep. The clouds are there already.
  void restore(std::vector<KeptSession> sessions);
  /// Opens a session, the caller's, on a cloud that the caller may see, and starts building it. `quota` is
  /// held as long as the session is in the store.
  /// Problems: not found (the cloud), too many, out of space, overloaded (nobody can be put to sleep); those
  /// of the archive
  Outcome<std::shared_ptr<Session>> create(const protocol::CreateSessionRequest& request,
                                           const Caller& caller = {}, std::shared_ptr<const void> quota = {},
                                           const Seal<std::shared_ptr<Session>>& seal = {});
  /// The session, woken where it sleeps, or where it was not brought back for a reason that may have passed:
  /// it is then built once more, as its state says.
  /// Problems: not found, damaged, out of space, overloaded
  Outcome<std::shared_ptr<Session>> get(const std::string& id);
  [[nodiscard]] std::vector<std::shared_ptr<Session>> awake() const;  ///< oldest first
  /// The owner of a session, awake or not.
  [[nodiscard]] std::optional<std::string> owner_of(const std::string& id) const;
  /// Of those that may be seen, by owner and id, oldest first. Nobody is woken.
  using MaySee = std::function<bool(const std::string& owner, const std::string& id)>;
  [[nodiscard]] std::vector<protocol::SessionSummary> summaries(const MaySee& may_see = {}) const;
  /// Removes a session and ends it, at the expected revision where one is given.
  /// Problems: not found, stale revision; those of the archive
  Outcome<Done> remove(const std::string& id, Session::Expected expected = {});
  /// Removes those that nobody asked for since then and nobody uses. Returns how many.
  std::size_t expire(protocol::TimePoint last_used);
  /// Ends all sessions: the server stops.
  void close_all(const std::string& reason);

  /// What all of them take.
  [[nodiscard]] const Budget& memory() const { return memory_; }

 private:
  struct Entry {
    KeptSession kept;
    std::shared_ptr<Session> session;  // null: it sleeps
    std::shared_ptr<const void> cloud_use;
    std::shared_ptr<const void> quota;
    std::shared_ptr<Budget::Hold> memory;
    std::uint64_t bytes = 0;  // of the memory, but for what resampling took
    /// When it was last woken; none where it was opened and has not slept since.
    std::optional<std::chrono::steady_clock::time_point> woken = std::nullopt;
    std::shared_ptr<std::mutex> turn = std::make_shared<std::mutex>();  // of whoever wakes or removes it

    /// Nobody else has it, not even its strand. Under the store's mutex, which hands it out.
    [[nodiscard]] bool is_idle() const;
    /// It was not brought back, for a reason that may have passed by now.
    [[nodiscard]] bool may_wake_again() const;
  };
  struct Needs {
    std::uint64_t live = 0;
    std::uint64_t history = 0;
    std::uint64_t inserted_each = 0;
  };
  /// Of so many samples that have the columns of the cloud.
  [[nodiscard]] Needs needs_of(const HierarchyParams& params, std::uint64_t samples,
                               const Cloud& cloud) const;
  /// What the session begins with: the cloud's samples, or how some of them are chosen. Problems: those of
  /// room_for(), for what choosing needs beyond `held` bytes
  Outcome<Done> put_samples(SessionParams& params, const KeptSession& kept, const SharedCloud& cloud,
                            std::shared_ptr<const Cloud> samples, std::uint64_t held);
  std::vector<Entry>::iterator entry_of(const std::string& id);
  Outcome<std::shared_ptr<Budget::Hold>> room_for(std::uint64_t bytes);
  void put_to_sleep(Entry& entry);
  Outcome<std::shared_ptr<Session>> wake(const std::string& id);
  [[nodiscard]] SessionParams params_of(const KeptSession& kept, std::uint64_t first, const Needs& needs,
                                        const std::shared_ptr<Budget::Hold>& memory) const;
  void mark_damaged(const std::string& id, const std::string& reason);
  void watch_expiry(const std::stop_token& stop);

  const Limits limits_;
  const CloudStore& clouds_;
  const SessionServices services_;
  Archive* const archive_;
  const Removed removed_;
  Budget memory_;
  mutable std::mutex mutex_;  // guards what follows
  std::vector<Entry> entries_;
  std::size_t coming_ = 0;  // sessions that are being stored
  std::condition_variable_any watch_;
  std::jthread watcher_;
};

}  // namespace pointwright::server
