#pragma once
// Jobs as rows of the database.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/json/jobs.h"
#include "server/base/outcome.h"
#include "server/sessions/keeper.h"
#include "server/store/database.h"

namespace pointwright::server {

/// A job as it is kept.
struct KeptJob {
  protocol::JobDocument document;
  std::string owner;
  bool has_preview = false;  ///< the recipe is played on a cloud of its own
  bool drop_non_finite = false;
  std::string result;                       ///< the name of the file that it makes
  std::uint64_t bytes = 0;                  ///< that its scan and its results may take on the disk
  std::shared_ptr<const void> quota = {};   ///< its part of the owner's jobs; not kept
  std::shared_ptr<const void> stored = {};  ///< its part of the owner's stored bytes; not kept
};

/// Thread-safe. Changes are on the disk when they return, where the database lasts. Problems of all of them:
/// out of disk, storage failed.
class JobArchive {
 public:
  explicit JobArchive(Database& database) : database_(database) {}

  Outcome<Done> add(const KeptJob& job, const KeptAnswer* answer);
  /// Status, message, times, attempts, report and results: all that changes.
  Outcome<Done> update(const KeptJob& job);
  Outcome<Done> remove(const std::string& id);
  /// Oldest first. Rows that are damaged are left out; `damaged` counts them. Throws DatabaseError.
  [[nodiscard]] std::vector<KeptJob> jobs(std::size_t& damaged);

 private:
  Database& database_;
};

}  // namespace pointwright::server
