#pragma once
// Links that open one session to whoever holds them.

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/json/access.h"
#include "server/access/share.h"
#include "server/base/outcome.h"

namespace pointwright::server {

/// Thread-safe.
class ShareStore {
 public:
  static constexpr std::size_t kMaxPerSession = 64;

  /// `most_of_token`, `most`: so many there may be of one token, and of all together.
  /// `keeper`: keeps them; null: they end with the process. It must outlive the store.
  ShareStore(std::uint64_t most_of_token, std::uint64_t most, ShareKeeper* keeper)
      : most_of_token_(most_of_token), most_(most), keeper_(keeper) {}

  /// Takes over what was kept, at start. Those that have expired are kept no longer.
  void restore(std::vector<Share> shares);

  struct NewShare {
    Share share;
    std::string capability;  ///< nowhere else
  };
  /// Problems: too many, of this session, of its token or of all; those of the keeper
  Outcome<NewShare> add(const std::string& session, const std::string& owner,
                        const protocol::ShareRequest& terms);
  /// The link whose capability this is, unless it has expired. Takes as long for any capability.
  [[nodiscard]] std::optional<Share> find_secret(std::string_view capability) const;
  [[nodiscard]] std::vector<protocol::ShareDocument> list(std::string_view session) const;
  /// Problems: not found; those of the keeper
  Outcome<Done> revoke(std::string_view session, std::string_view id);
  /// Forgets the links of a session that is gone, and that the keeper has no more.
  void forget(std::string_view session);
  /// Forgets the links of a token that is gone.
  void forget_owner(const std::string& owner);

 private:
  [[nodiscard]] std::optional<protocol::Problem> check_room(std::string_view session,
                                                            std::string_view owner) const;

  const std::uint64_t most_of_token_;
  const std::uint64_t most_;
  ShareKeeper* const keeper_;
  // Held while a change is kept and taken over: nobody who comes by a link waits for the disk.
  std::mutex change_mutex_;
  mutable std::mutex mutex_;  // guards shares_
  std::vector<Share> shares_;
};

}  // namespace pointwright::server
