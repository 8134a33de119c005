#pragma once
// Links that open one session to whoever holds them.

#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/json/access.h"
#include "server/base/outcome.h"

namespace pointwright::server {

/// One link. Its capability is kept as a SHA-256 only.
struct Share {
  protocol::ShareDocument document;
  std::string session;
  std::string owner;  ///< the token of who shared; empty: none were in use
  std::string sha256;
};

/// Thread-safe. In memory: links end with the daemon.
class ShareStore {
 public:
  static constexpr std::size_t kMaxPerSession = 64;

  struct NewShare {
    Share share;
    std::string capability;  ///< nowhere else
  };
  /// Problem: too many of this session
  Outcome<NewShare> add(const std::string& session, const std::string& owner,
                        const protocol::ShareRequest& terms);
  /// The link whose capability this is, unless it has expired. Takes as long for any capability.
  [[nodiscard]] std::optional<Share> find_secret(std::string_view capability) const;
  [[nodiscard]] std::vector<protocol::ShareDocument> list(std::string_view session) const;
  /// Problem: not found
  Outcome<Done> revoke(std::string_view session, std::string_view id);
  /// Forgets the links of a session that is gone.
  void forget(std::string_view session);

 private:
  mutable std::mutex mutex_;  // guards shares_
  std::vector<Share> shares_;
};

}  // namespace pointwright::server
