#include "server/store/answers.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "protocol/json/documents.h"
#include "protocol/json/requests.h"
#include "server/store/row_time.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr std::int64_t kKeptMs = 24LL * 60 * 60 * 1000;
/// No caller has a greater part of the room for answers than one of so many.
constexpr std::uint64_t kCallers = 16;
/// Room is made for a part of all answers at a time: that counts and sorts them.
constexpr std::uint64_t kRoomParts = 64;

void forget_oldest(Database::Access& access, const std::string& caller, std::int64_t count) {
  access.run(
      "DELETE FROM answers WHERE caller = ? AND key IN "
      "(SELECT key FROM answers WHERE caller = ? ORDER BY created LIMIT ?)",
      caller, caller, count);
}

std::int64_t count_all(Database::Access& access) {
  Statement count = access.query("SELECT count(*) FROM answers");
  count.step();
  return count.integer(0);
}

/// As many as each may keep, so that all keep `goal` at most; 0 where there are more callers than that.
std::int64_t level_of(std::vector<std::int64_t> counts, std::int64_t goal) {
  std::sort(counts.begin(), counts.end());
  auto left = static_cast<std::int64_t>(counts.size());
  for (const std::int64_t count : counts) {
    if (count * left > goal) return goal / left;
    goal -= count;
    --left;
  }
  return counts.empty() ? 0 : counts.back();
}

/// Whoever has most of them loses the oldest ones, until no more than `goal` are left. Callers are a token's
/// id and, of a share link, its session's: guests count with who shared it.
/// Cost: O(N log N)
void shrink_to(Database::Access& access, std::int64_t goal) {
  constexpr auto kOwnerLength = static_cast<std::int64_t>(protocol::kIdLength);
  std::vector<std::int64_t> counts;
  {
    Statement row = access.query("SELECT count(*) FROM answers GROUP BY substr(caller, 1, ?)", kOwnerLength);
    while (row.step()) counts.push_back(row.integer(0));
  }
  if (const std::int64_t level = level_of(std::move(counts), goal); level > 0) {
    access.run(
        "DELETE FROM answers WHERE (caller, key) IN (SELECT caller, key FROM (SELECT caller, key, "
        "row_number() "
        "OVER (PARTITION BY substr(caller, 1, ?) ORDER BY created DESC, key DESC) AS place FROM answers) "
        "WHERE place > ?)",
        kOwnerLength, level);
    return;
  }
  // More owners than room: of them, too, who came first.
  access.run(
      "DELETE FROM answers WHERE (caller, key) IN "
      "(SELECT caller, key FROM answers ORDER BY created LIMIT ?)",
      count_all(access) - goal);
}

}  // namespace

void Answers::put(Database::Access& access, const KeptAnswer& answer) {
  protocol::JsonDocument headers = protocol::JsonDocument::array();
  for (const auto& [name, value] : answer.headers)
    headers.push_back(protocol::JsonDocument::array({name, value}));
  const std::string text = protocol::to_text(headers);
  access.run(
      "INSERT OR IGNORE INTO answers (caller, key, fingerprint, created, status, type, headers, body) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
      answer.caller, answer.key, answer.fingerprint, now_ms(), answer.status, answer.content_type, text,
      answer.body);
}

Outcome<Done> Answers::put(const KeptAnswer& answer) {
  return database_.change([&](Database::Access& access) -> Outcome<Done> {
    put(access, answer);
    return Done{};
  });
}

std::optional<KeptAnswer> Answers::find(const std::string& caller, const std::string& key) {
  return database_.read([&](Database::Access& access) -> std::optional<KeptAnswer> {
    Statement row = access.query(
        "SELECT fingerprint, status, type, headers, body FROM answers WHERE caller = ? AND key = ? AND "
        "created > ?",
        caller, key, now_ms() - kKeptMs);
    if (!row.step()) return std::nullopt;
    KeptAnswer answer{.caller = caller,
                      .key = key,
                      .fingerprint = row.text(0),
                      .status = static_cast<int>(row.integer(1)),
                      .content_type = row.text(2),
                      .headers = {},
                      .body = row.text(4)};
    const auto headers = protocol::Json::parse(row.text(3), nullptr, false);
    for (const auto& header : headers)
      if (header.is_array() && header.size() == 2)
        answer.headers.emplace_back(header[0].get<std::string>(), header[1].get<std::string>());
    return answer;
  });
}

bool Answers::has(const std::string& caller, const std::string& key) {
  {
    const std::lock_guard lock(under_way_->mutex);
    if (under_way_->names.contains(Name(caller, key))) return true;
  }
  return find(caller, key).has_value();
}

Outcome<Done> Answers::make_room(const std::string& caller) {
  // Nobody takes keys away from callers that have fewer of them.
  const std::lock_guard lock(room_mutex_);
  const auto part = static_cast<std::int64_t>(std::max<std::uint64_t>(most_ / kCallers, 1));
  const auto most = static_cast<std::int64_t>(most_);
  std::int64_t bound = bound_.value_or(most) + 1;
  auto made = database_.change([&](Database::Access& access) -> Outcome<Done> {
    access.run("DELETE FROM answers WHERE created <= ?", now_ms() - kKeptMs);
    std::int64_t own = 0;
    {
      Statement count = access.query("SELECT count(*) FROM answers WHERE caller = ?", caller);
      count.step();
      own = count.integer(0);
    }
    if (own >= part) forget_oldest(access, caller, own - part + 1);
    if (bound <= most) return Done{};
    if (count_all(access) >= most) shrink_to(access, most - 1 - most / static_cast<std::int64_t>(kRoomParts));
    bound = count_all(access) + 1;
    return Done{};
  });
  if (made.ok()) bound_ = bound;
  return made;
}

Outcome<Answers::Claim> Answers::claim(const std::string& caller, const std::string& key,
                                       const std::string& fingerprint) {
  const Name name(caller, key);
  {
    const std::lock_guard lock(under_way_->mutex);
    if (!under_way_->names.insert(name).second)
      return Problem{.kind = ProblemKind::kKeyInUse,
                     .detail = "the first request with this Idempotency-Key is still under way"};
  }
  Turn turn(nullptr, [under_way = under_way_, name](const void*) {
    const std::lock_guard lock(under_way->mutex);
    under_way->names.erase(name);
  });
  if (auto kept = find(caller, key)) {
    if (kept->fingerprint == fingerprint) return Claim(std::move(*kept));
    return Problem{.kind = ProblemKind::kKeyReused,
                   .detail = "the Idempotency-Key came before, with another request"};
  }
  auto room = make_room(caller);
  if (!room.ok()) return room.problem();
  return Claim(std::move(turn));
}

}  // namespace pointwright::server
