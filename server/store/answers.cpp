#include "server/store/answers.h"

#include <algorithm>
#include <chrono>

#include "protocol/json/documents.h"
#include "server/store/row_time.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr std::int64_t kKeptMs = 24LL * 60 * 60 * 1000;
/// So many callers at least share the room for answers.
constexpr std::uint64_t kCallers = 16;

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
  // Nobody takes the keys away from others: beyond its part of them a caller loses its own oldest.
  const auto part = static_cast<std::int64_t>(std::max<std::uint64_t>(most_ / kCallers, 1));
  auto room = database_.change([&](Database::Access& access) -> Outcome<std::uint64_t> {
    access.run("DELETE FROM answers WHERE created <= ?", now_ms() - kKeptMs);
    std::int64_t own = 0;
    {
      Statement count = access.query("SELECT count(*) FROM answers WHERE caller = ?", caller);
      count.step();
      own = count.integer(0);
    }
    if (own >= part)
      access.run(
          "DELETE FROM answers WHERE caller = ? AND key IN (SELECT key FROM answers WHERE caller = ? ORDER "
          "BY "
          "created LIMIT ?)",
          caller, caller, own - part + 1);
    Statement count = access.query("SELECT count(*) FROM answers");
    count.step();
    return static_cast<std::uint64_t>(count.integer(0));
  });
  if (!room.ok()) return room.problem();
  if (room.value() >= most_)
    return Problem{.kind = ProblemKind::kTooMany,
                   .detail = "the server remembers as many Idempotency-Keys as it may; each for a day",
                   .limit = static_cast<double>(most_),
                   .actual = static_cast<double>(room.value())};
  return Claim(std::move(turn));
}

}  // namespace pointwright::server
