#pragma once
// A link that opens one session to whoever holds it, and how links outlive the process.

#include <string>

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

/// Once a change returns, it is there whatever happens. A session that is removed takes its links along.
/// Problems of all changes: out of disk, storage failed; nothing was changed then.
class ShareKeeper {
 public:
  ShareKeeper() = default;
  ShareKeeper(const ShareKeeper&) = delete;
  ShareKeeper& operator=(const ShareKeeper&) = delete;
  virtual ~ShareKeeper() = default;

  /// Keeps the link, and no longer those that have expired. Problem besides: not found (the session)
  virtual Outcome<Done> keep(const Share& share) = 0;
  virtual Outcome<Done> forget(const std::string& id) = 0;
  virtual Outcome<Done> forget_owner(const std::string& owner) = 0;
  virtual Outcome<Done> forget_expired() = 0;
};

}  // namespace pointwright::server
