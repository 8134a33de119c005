#include "server/access/share_store.h"

#include <algorithm>
#include <chrono>
#include <utility>

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

std::optional<Problem> check_count(std::uint64_t count, std::uint64_t most, const char* detail) {
  if (count < most) return std::nullopt;
  return Problem{.kind = ProblemKind::kTooMany,
                 .detail = detail,
                 .limit = static_cast<double>(most),
                 .actual = static_cast<double>(count + 1)};
}

}  // namespace

void ShareStore::restore(std::vector<Share> shares) {
  const std::lock_guard change_lock(change_mutex_);
  // Those that the disk does not let go now are swept with the next link, or at the next start.
  if (std::erase_if(shares, has_expired) > 0 && keeper_ != nullptr) (void)keeper_->forget_expired();
  const std::lock_guard lock(mutex_);
  shares_ = std::move(shares);
}

std::optional<Problem> ShareStore::check_room(std::string_view session, std::string_view owner) const {
  const std::lock_guard lock(mutex_);
  std::uint64_t of_session = 0;
  std::uint64_t of_owner = 0;
  std::uint64_t all = 0;
  for (const Share& share : shares_) {
    if (has_expired(share)) continue;
    ++all;
    if (share.session == session) ++of_session;
    if (share.owner == owner) ++of_owner;
  }
  if (auto problem =
          check_count(of_session, kMaxPerSession, "the session has as many links as it may; revoke some"))
    return problem;
  if (!owner.empty())
    if (auto problem = check_count(of_owner, most_of_token_,
                                   "the token has as many links as it may (token_shares); revoke some"))
      return problem;
  return check_count(all, most_, "there are as many links as there may be (max_shares); revoke some");
}

Outcome<ShareStore::NewShare> ShareStore::add(const std::string& session, const std::string& owner,
                                              const protocol::ShareRequest& terms) {
  NewShare made;
  made.capability = new_secret(kSharePrefix);
  made.share.document.id = random_id();
  // Kept to the millisecond, as clients are told it.
  made.share.document.created =
      std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
  made.share.document.terms = terms;
  made.share.session = session;
  made.share.owner = owner;
  made.share.sha256 = digest_of(made.capability);
  const std::lock_guard change_lock(change_mutex_);
  if (auto problem = check_room(session, owner)) return std::move(*problem);
  if (keeper_ != nullptr)
    if (auto kept = keeper_->keep(made.share); !kept.ok()) return kept.problem();
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, has_expired);
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
  const std::lock_guard change_lock(change_mutex_);
  const auto is_it = [&](const Share& s) { return s.session == session && s.document.id == id; };
  {
    const std::lock_guard lock(mutex_);
    if (std::none_of(shares_.begin(), shares_.end(), is_it))
      return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such link"};
  }
  if (keeper_ != nullptr)
    if (auto forgotten = keeper_->forget(std::string(id)); !forgotten.ok()) return forgotten;
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, is_it);
  return Done{};
}

void ShareStore::forget(std::string_view session) {
  // After a link of this session that is just being kept.
  const std::lock_guard change_lock(change_mutex_);
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, [&](const Share& s) { return s.session == session; });
}

void ShareStore::forget_owner(const std::string& owner) {
  const std::lock_guard change_lock(change_mutex_);
  // Where the disk does not let them go they open nothing either: their token is gone.
  if (keeper_ != nullptr) (void)keeper_->forget_owner(owner);
  const std::lock_guard lock(mutex_);
  std::erase_if(shares_, [&](const Share& s) { return s.owner == owner; });
}

}  // namespace pointwright::server
