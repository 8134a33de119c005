#pragma once
// Share links as rows of the database.

#include <cstddef>
#include <string>
#include <vector>

#include "server/access/share.h"
#include "server/base/outcome.h"
#include "server/store/database.h"

namespace pointwright::server {

/// Thread-safe.
class ShareArchive : public ShareKeeper {
 public:
  /// The database must outlive it.
  explicit ShareArchive(Database& database) : database_(database) {}

  /// Oldest first. Rows that are damaged, or that this program would not have written, are left out;
  /// `damaged` counts them. Throws DatabaseError.
  [[nodiscard]] std::vector<Share> shares(std::size_t& damaged);

  Outcome<Done> keep(const Share& share) override;
  Outcome<Done> forget(const std::string& id) override;
  Outcome<Done> forget_owner(const std::string& owner) override;
  Outcome<Done> forget_expired() override;

 private:
  Database& database_;
};

}  // namespace pointwright::server
