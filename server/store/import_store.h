#pragma once
// Imports that their clients do not wait for: they are asked how far they are, and can be ended.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/execution_context.h"
#include "protocol/json/documents.h"
#include "server/base/outcome.h"
#include "server/config/limits.h"
#include "server/sessions/compute_pool.h"
#include "server/store/cloud_store.h"

namespace pointwright::server {

/// Thread-safe. As many run at once as decoders may; the others wait for their turn. Nothing of it outlives
/// the process.
class ImportStore {
 public:
  /// `report_failure` gets the text of what an import threw.
  ImportStore(const Limits& limits, std::function<void(const std::string&)> report_failure);
  ~ImportStore();
  ImportStore(const ImportStore&) = delete;
  ImportStore& operator=(const ImportStore&) = delete;

  struct NewImport {
    std::string name;
    std::uint64_t bytes = 0;
    std::string owner;
    /// Of the request, where it may come again: it then gets the import that it has begun. Its
    /// Idempotency-Key, a line end, and what else the request says. Empty: none.
    std::string key = {};
  };
  /// Stores the cloud, or says why not. Told when to end by the context, which it tells how far it is.
  using Work = std::function<Outcome<SharedCloud>(const ExecutionContext&)>;
  /// Where there are as many as may be, one that has ended makes room: of whoever holds most, the one that
  /// ended longest ago. Problem: too many, of the owner (token_imports) or of all, none of which has ended
  Outcome<protocol::ImportDocument> start(NewImport import, Work work);
  [[nodiscard]] std::optional<protocol::ImportDocument> find(const std::string& id) const;
  /// The one that the owner's request with this key has begun.
  [[nodiscard]] std::optional<protocol::ImportDocument> find_key(const std::string& owner,
                                                                 const std::string& key) const;
  /// Whether a request of the owner with this Idempotency-Key has begun one, whatever else it said.
  [[nodiscard]] bool has_begun(const std::string& owner, const std::string& idempotency_key) const;
  [[nodiscard]] std::optional<std::string> owner_of(const std::string& id) const;
  /// Of the owners that may be seen, oldest first.
  [[nodiscard]] std::vector<protocol::ImportDocument> list(
      const std::function<bool(const std::string&)>& may_see) const;
  /// Forgets an import; one that goes on ends without a cloud, unless it is stored already. Whether there was
  /// one.
  bool remove(const std::string& id);
  /// Ends all of them: the server stops.
  void cancel_all();

 private:
  struct Entry {
    protocol::ImportDocument document;  // guarded by the store's mutex
    std::string owner;
    std::string key;
    std::chrono::steady_clock::time_point ended{};
    ExecutionContext context;
    Work work;
  };
  void run(const std::shared_ptr<Entry>& entry);
  [[nodiscard]] std::shared_ptr<Entry> find_locked(const std::string& id) const;
  [[nodiscard]] static protocol::ImportDocument seen(const Entry& entry);

  const std::uint64_t max_imports_;
  const std::uint64_t token_imports_;
  mutable std::mutex mutex_;  // guards what follows
  std::vector<std::shared_ptr<Entry>> entries_;
  ComputePool pool_;  // its threads use all of the above
};

}  // namespace pointwright::server
