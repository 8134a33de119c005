#include "server/store/share_archive.h"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "protocol/json/requests.h"
#include "server/store/archive.h"
#include "server/store/row_time.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;
using protocol::Scope;

namespace {

/// What `expires` is where a link has no end.
constexpr std::int64_t kNever = -1;

/// Nothing where no clock of this program shows that time.
std::optional<protocol::TimePoint> time_of(std::int64_t ms) {
  constexpr std::int64_t kLast = 9'000'000'000'000;  // in the year 2255
  if (ms < 0 || ms > kLast) return std::nullopt;
  return protocol::TimePoint(std::chrono::milliseconds(ms));
}

bool is_digest(std::string_view text) {
  constexpr std::size_t kDigits = 64;
  return text.size() == kDigits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

/// A seal is no signature: whoever can write rows can seal them too. So a row opens no more than a request
/// could have asked for.
std::optional<Scope> scope_of(std::string_view name) {
  for (const Scope scope : {Scope::kView, Scope::kEdit})
    if (protocol::scope_name(scope) == name) return scope;
  return std::nullopt;
}

std::string seal_of(std::string_view id, std::string_view session, std::string_view owner,
                    std::string_view scope, std::int64_t created, std::int64_t expires,
                    std::string_view sha256) {
  return row_seal({id, session, owner, scope, std::to_string(created), std::to_string(expires), sha256});
}

/// From the columns as shares() selects them. Returns whether they are a link.
bool read_share(const Statement& row, Share& share) {
  share.document.id = row.text(0);
  share.session = row.text(1);
  share.owner = row.text(2);
  share.sha256 = row.text(6);
  const auto scope = scope_of(row.text(3));
  const auto created = time_of(row.integer(4));
  const std::int64_t expires = row.integer(5);
  const auto end = time_of(expires);
  const bool is_whole = row.text(7) == seal_of(share.document.id, share.session, share.owner, row.text(3),
                                               row.integer(4), expires, share.sha256);
  const bool has_owner = share.owner.empty() || protocol::is_valid_id(share.owner);
  const bool names_session = row.integer(8) == 1;
  if (!is_whole || !scope || !created || (!end && expires != kNever) || !has_owner || !names_session ||
      !protocol::is_valid_id(share.document.id) || !is_digest(share.sha256))
    return false;
  share.document.created = *created;
  share.document.terms = {.scope = *scope, .expires = end};
  return true;
}

void erase_expired(Database::Access& access) {
  access.run("DELETE FROM shares WHERE expires BETWEEN 0 AND ?", now_ms());
}

}  // namespace

std::vector<Share> ShareArchive::shares(std::size_t& damaged) {
  return database_.read([&](Database::Access& access) {
    std::vector<Share> shares;
    Statement row = access.query(
        "SELECT id, session, owner, scope, created, expires, sha256, seal, EXISTS (SELECT 1 FROM sessions "
        "WHERE sessions.id = shares.session) FROM shares ORDER BY place");
    while (row.step()) {
      if (Share share; read_share(row, share))
        shares.push_back(std::move(share));
      else
        ++damaged;
    }
    return shares;
  });
}

Outcome<Done> ShareArchive::keep(const Share& share) {
  const protocol::ShareDocument& document = share.document;
  const std::string scope(protocol::scope_name(document.terms.scope));
  const std::int64_t created = to_ms(document.created);
  const std::int64_t expires = document.terms.expires ? to_ms(*document.terms.expires) : kNever;
  const std::string seal =
      seal_of(document.id, share.session, share.owner, scope, created, expires, share.sha256);
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    {
      Statement session = access.query("SELECT 1 FROM sessions WHERE id = ?", share.session);
      if (!session.step())
        return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such session"};
    }
    erase_expired(access);
    access.run(
        "INSERT INTO shares (id, session, owner, scope, created, expires, sha256, seal) VALUES (?, ?, ?, ?, "
        "?, ?, ?, ?)",
        document.id, share.session, share.owner, scope, created, expires, share.sha256, seal);
    return Done{};
  });
}

Outcome<Done> ShareArchive::forget(const std::string& id) {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM shares WHERE id = ?", id);
    return Done{};
  });
}

Outcome<Done> ShareArchive::forget_owner(const std::string& owner) {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM shares WHERE owner = ?", owner);
    return Done{};
  });
}

Outcome<Done> ShareArchive::forget_expired() {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    erase_expired(access);
    return Done{};
  });
}

}  // namespace pointwright::server
