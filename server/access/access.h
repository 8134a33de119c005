#pragma once
// Who asks, and how much of everything they may have.

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>

#include "server/access/accounts.h"
#include "server/access/buckets.h"
#include "server/access/share.h"
#include "server/access/share_store.h"
#include "server/access/token_store.h"
#include "server/base/caller.h"
#include "server/base/outcome.h"
#include "server/config/limits.h"
#include "server/http/message.h"

namespace pointwright::server {

/// Thread-safe. Where no tokens are in use everybody is a local admin without quotas, but for share links.
class Access {
 public:
  /// `token_file`: empty where no tokens are in use. Throws std::runtime_error where it cannot be used.
  /// `keeper`: keeps share links; null: nobody does. It must outlive this.
  Access(const Limits& limits, std::string token_file, ShareKeeper* keeper = nullptr);

  TokenStore tokens;
  ShareStore shares;

  /// The caller that the request's credentials name. A wrong token is told so (401), and after some of them
  /// from one address (429); right ones are always let in, whoever else fails from the same address.
  Outcome<Caller> identify(const RequestHead& head);
  /// One more request of this caller. Problem: too many (429, with the seconds to wait)
  Outcome<Done> charge_request(const Caller& caller);
  /// Bytes that this caller is about to upload. Problem: too many
  Outcome<Done> charge_upload(const Caller& caller, std::uint64_t bytes);
  /// Holds parts of the caller's quotas, but for the two above: all of them, or none. Problem: too many
  Outcome<QuotaHold> hold(const Caller& caller, std::initializer_list<QuotaPart> parts);
  /// Whether hold() would have room now; nothing is held, so that nobody else is refused for it meanwhile.
  [[nodiscard]] Outcome<Done> check(const Caller& caller, std::initializer_list<QuotaPart> parts) const;

  /// The same for what its owner has already, whatever the quota is now: after a restart.
  QuotaHold hold_again(const std::string& owner, std::initializer_list<QuotaPart> parts);

  /// What the quota comes to for the caller.
  [[nodiscard]] std::uint64_t limit_of(const Caller& caller, Quota quota) const;
  [[nodiscard]] protocol::CallerDocument describe(const Caller& caller) const;

 private:
  Outcome<QuotaHold> hold_part(const Caller& caller, Quota quota, std::uint64_t amount);
  [[nodiscard]] protocol::Problem quota_problem(const std::string& account, Quota quota, std::uint64_t amount,
                                                std::uint64_t limit) const;
  [[nodiscard]] Outcome<Caller> caller_of(std::string_view secret) const;
  [[nodiscard]] Buckets::Flow request_flow(const Caller& caller) const;
  [[nodiscard]] Buckets::Flow upload_flow(const Caller& caller) const;

  const Limits limits_;
  Accounts accounts_;
  Buckets requests_;
  Buckets uploads_;
  Buckets failures_;
};

}  // namespace pointwright::server
