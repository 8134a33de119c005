#pragma once
// The uploaded clouds: what is known of them, and their samples once somebody needs them.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/core/cloud.h"
#include "protocol/json/documents.h"
#include "server/base/budget.h"
#include "server/base/outcome.h"
#include "server/config/limits.h"
#include "server/store/archive.h"
#include "server/store/places.h"

namespace pointwright::server {

/// One cloud. Immutable but for the number of sessions that use it, and for whether its samples are there:
/// those that nobody holds and an archive has make room for others.
struct StoredCloud {
  protocol::CloudDocument document;
  std::string owner;                  ///< the id of a token; empty: made where none were in use
  std::shared_ptr<const void> quota;  ///< its part of the owner's
  CloudSource source;
  std::string content;  ///< hash of the samples
  mutable std::atomic<int> users{0};

 private:
  friend class CloudStore;
  mutable std::mutex mutex_;  // guards the next two
  mutable std::shared_ptr<const Cloud> cloud_;
  mutable std::shared_ptr<void> memory_;         // its part of the budget
  mutable std::atomic<std::uint64_t> asked_{0};  // when its samples were last asked for, of all asking
};
using SharedCloud = std::shared_ptr<const StoredCloud>;

/// A cloud that is to be stored.
struct NewCloud {
  protocol::CloudDocument document;
  Cloud cloud;
  CloudSource source;
  std::string owner = {};
  std::shared_ptr<const void> quota = {};
};

/// Makes a cloud of its file once more. Problems: overloaded, whatever decoding refuses.
using CloudLoader = std::function<Outcome<Cloud>(const BlobContent&, const CloudSource&)>;

/// A hash of all columns. Cost: O(N), a copy of none.
std::string cloud_hash(const Cloud& cloud);

/// Thread-safe.
class CloudStore {
 public:
  /// `archive`: where clouds are kept; null: nowhere.
  explicit CloudStore(const Limits& limits, Archive* archive = nullptr, CloudLoader load = {});

  /// Takes over what the archive has, at start.
  void restore(std::vector<KeptCloud> clouds);
  /// Whether one more cloud may come: asked before its bytes are read. Problem: too many.
  Outcome<Done> check_room() const;
  /// Problems: too many clouds, out of space; those of the archive
  Outcome<SharedCloud> add(NewCloud cloud, const BlobContent& file,
                           const Seal<protocol::CloudDocument>& seal = {});
  [[nodiscard]] SharedCloud find(const std::string& id) const;
  /// The one of a file and a name; null where there is none.
  [[nodiscard]] SharedCloud find(const std::string& sha256, const std::string& name) const;
  /// Its samples, from the archive where they are not there. Problems: damaged; out of space (more than all
  /// clouds may take); overloaded (those that are in use leave no room now).
  [[nodiscard]] Outcome<std::shared_ptr<const Cloud>> samples_of(const StoredCloud& cloud) const;
  /// Lets the samples go where nobody else has them and the archive gives them again.
  void let_go(const StoredCloud& cloud) const;
  /// Marks the cloud as used until the returned handle is gone; null for an unknown id.
  [[nodiscard]] std::shared_ptr<const void> use(const std::string& id) const;
  [[nodiscard]] std::vector<SharedCloud> list() const;  ///< oldest first
  /// Problems: not found, in use; those of the archive
  Outcome<Done> remove(const std::string& id);

  /// What all of them take.
  [[nodiscard]] const Budget& memory() const { return memory_; }

 private:
  [[nodiscard]] protocol::Problem out_of_space(std::uint64_t bytes) const;
  /// A part of the budget, for which samples are let go that nobody holds, those first that were asked for
  /// longest ago. Null where there is none. `loading`: the cloud that it is for, locked by the caller.
  [[nodiscard]] std::shared_ptr<void> room_for(std::uint64_t bytes, const StoredCloud* loading) const;

  Archive* const archive_;
  const CloudLoader load_;
  mutable Budget memory_;
  mutable std::atomic<std::uint64_t> asking_{0};
  mutable std::mutex mutex_;  // guards what follows
  std::vector<SharedCloud> clouds_;
  Places places_;
};

}  // namespace pointwright::server
