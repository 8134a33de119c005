#include "server/access/share_store.h"

#include <algorithm>
#include <chrono>

#include "server/access/secret.h"
#include "server/base/random_id.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

bool has_expired(const Share& share) {
  const auto& expires = share.document.terms.expires;
  return expires && *expires <= std::chrono::system_clock::now();
}

}  // namespace

Outcome<ShareStore::NewShare> ShareStore::add(const std::string& session, const std::string& owner,
                                              const protocol::ShareRequest& terms) {
  NewShare made;
  made.capability = new_secret(kSharePrefix);
  made.share.document.id = random_id();
  made.share.document.created = std::chrono::system_clock::now();
  made.share.document.terms = terms;
  made.share.session = session;
  made.share.owner = owner;
  made.share.sha256 = digest_of(made.capability);
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, has_expired);
  const auto count = static_cast<std::size_t>(
      std::count_if(shares_.begin(), shares_.end(), [&](const Share& s) { return s.session == session; }));
  if (count >= kMaxPerSession)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the session has as many links as it may; revoke some",
                   .limit = static_cast<double>(kMaxPerSession),
                   .actual = static_cast<double>(count)};
  shares_.push_back(made.share);
  return made;
}

std::optional<Share> ShareStore::find_secret(std::string_view capability) const {
  const std::string digest = digest_of(capability);
  const std::lock_guard lock(mutex_);
  const Share* found = nullptr;
  for (const Share& share : shares_)
    if (same_digest(share.sha256, digest)) found = &share;
  if (found == nullptr || has_expired(*found)) return std::nullopt;
  return *found;
}

std::vector<protocol::ShareDocument> ShareStore::list(std::string_view session) const {
  const std::lock_guard lock(mutex_);
  std::vector<protocol::ShareDocument> documents;
  for (const Share& share : shares_)
    if (share.session == session && !has_expired(share)) documents.push_back(share.document);
  return documents;
}

Outcome<Done> ShareStore::revoke(std::string_view session, std::string_view id) {
  const std::lock_guard lock(mutex_);
  const auto erased =
      std::erase_if(shares_, [&](const Share& s) { return s.session == session && s.document.id == id; });
  if (erased == 0) return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such link"};
  return Done{};
}

void ShareStore::forget(std::string_view session) {
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, [&](const Share& s) { return s.session == session; });
}

}  // namespace pointwright::server
