#include "server/access/access.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "server/access/secret.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr std::size_t kMaxCallers = 65'536;
constexpr std::size_t kMaxAddresses = 4096;
/// Wrong tokens that one address may send in a row, and then in a second.
constexpr Buckets::Flow kFailures{.capacity = 20.0, .per_second = 0.2};
constexpr double kSecondsOfBurst = 2.0;
constexpr double kDay = 86'400.0;

/// The limit that stands in where a token names none, in the order of the quotas.
constexpr std::array<std::uint64_t Limits::*, kQuotaCount> kDefaults = {
    &Limits::token_sessions,     &Limits::token_samples,
    &Limits::token_stored_bytes, &Limits::token_upload_bytes_per_day,
    &Limits::token_streams,      &Limits::token_requests_per_second,
    &Limits::token_jobs,         &Limits::token_clouds,
    &Limits::token_images};

Problem unauthorized(std::string detail) {
  return Problem{.kind = ProblemKind::kUnauthorized, .detail = std::move(detail)};
}

/// The secret of the one Authorization header; empty where there is no such header.
Outcome<std::string> bearer_of(const RequestHead& head) {
  constexpr std::string_view kScheme = "bearer ";
  constexpr std::size_t kMostBytes = 256;
  std::optional<std::string_view> value;
  for (const NameValue& header : head.headers) {
    if (header.first != "authorization") continue;
    if (value) return unauthorized("Authorization is given more than once");
    value = header.second;
  }
  if (!value) return std::string();
  const bool is_bearer = value->size() > kScheme.size() && value->size() <= kMostBytes &&
                         std::equal(kScheme.begin(), kScheme.end(), value->begin(), [](char a, char b) {
                           return a == std::tolower(static_cast<unsigned char>(b));
                         });
  if (!is_bearer) return unauthorized("Authorization must be Bearer and a token");
  return std::string(value->substr(kScheme.size()));
}

/// One key for all addresses that one network hands to a client.
std::string network_of(const std::string& address) {
  if (address.find(':') == std::string::npos) return address;
  std::size_t end = 0;
  for (int groups = 0; groups < 4 && end != std::string::npos; ++groups) end = address.find(':', end + 1);
  return address.substr(0, end);
}

/// Guests of a shared session have a bucket of their own: they do not slow down who shared it.
std::string request_key(const Caller& caller) {
  return caller.session ? caller.token + "/" + *caller.session : caller.token;
}

Problem over_rate(std::string detail, double limit, double seconds) {
  Problem problem{.kind = ProblemKind::kTooMany, .detail = std::move(detail), .limit = limit};
  if (std::isfinite(seconds))
    problem.retry_after = static_cast<std::uint32_t>(std::clamp(std::ceil(seconds), 1.0, kDay));
  return problem;
}

}  // namespace

Access::Access(const Limits& limits, std::string token_file, ShareKeeper* keeper)
    : tokens(std::move(token_file)),
      shares(limits.token_shares, limits.max_shares, keeper),
      limits_(limits),
      requests_(kMaxCallers),
      uploads_(kMaxCallers),
      failures_(kMaxAddresses) {}

Outcome<Caller> Access::caller_of(std::string_view secret) const {
  if (secret.substr(0, kSharePrefix.size()) == kSharePrefix) {
    const auto share = shares.find_secret(secret);
    if (!share) return unauthorized("the link is unknown, has expired or was revoked");
    Caller caller{
        .token = share->owner, .name = {}, .scope = share->document.terms.scope, .session = share->session};
    if (!tokens.in_use()) return caller;
    // A link gives no more than its maker has now.
    const auto owner = tokens.find(share->owner);
    if (!owner) return unauthorized("the token that this link came from has expired or was revoked");
    caller.scope = std::min(caller.scope, owner->document.terms.scope);
    return caller;
  }
  if (!tokens.in_use()) return Caller();
  const auto token = tokens.find_secret(secret);
  if (!token) return unauthorized("the token is unknown, has expired or was revoked");
  const protocol::TokenDocument& document = token->document;
  return Caller{.token = document.id, .name = document.terms.name, .scope = document.terms.scope};
}

Outcome<Caller> Access::identify(const RequestHead& head) {
  auto secret = bearer_of(head);
  if (!secret.ok()) return secret.problem();
  if (secret.value().empty()) {
    if (!tokens.in_use()) return Caller();
    return unauthorized("send a token: Authorization: Bearer <token>");
  }
  auto caller = caller_of(secret.value());
  if (caller.ok()) return caller;
  if (const double wait = failures_.take(network_of(head.peer), kFailures, 1.0); wait > 0.0)
    return over_rate("too many wrong tokens came from this address", kFailures.capacity, wait);
  return caller;
}

std::uint64_t Access::limit_of(const Caller& caller, Quota quota) const {
  const auto index = static_cast<std::size_t>(quota);
  const std::uint64_t fallback = limits_.*kDefaults.at(index);
  const auto token = tokens.find(caller.token);
  if (!token) return fallback;
  return (token->document.terms.quotas.*protocol::kQuotas.at(index).member).value_or(fallback);
}

Buckets::Flow Access::request_flow(const Caller& caller) const {
  const auto rate = static_cast<double>(limit_of(caller, Quota::kRequestsPerSecond));
  return {.capacity = rate * kSecondsOfBurst, .per_second = rate};
}

Buckets::Flow Access::upload_flow(const Caller& caller) const {
  const auto bytes = static_cast<double>(limit_of(caller, Quota::kUploadBytesPerDay));
  return {.capacity = bytes, .per_second = bytes / kDay};
}

Outcome<Done> Access::charge_request(const Caller& caller) {
  if (caller.token.empty()) return Done{};
  const Buckets::Flow flow = request_flow(caller);
  if (const double wait = requests_.take(request_key(caller), flow, 1.0); wait > 0.0) {
    Problem problem =
        over_rate("the token's requests a second (requests_per_second) are used up", flow.per_second, wait);
    problem.actual = requests_.taken(request_key(caller), flow);
    return problem;
  }
  return Done{};
}

Outcome<Done> Access::charge_upload(const Caller& caller, std::uint64_t bytes) {
  if (caller.token.empty()) return Done{};
  const Buckets::Flow flow = upload_flow(caller);
  if (const double wait = uploads_.take(caller.token, flow, static_cast<double>(bytes)); wait > 0.0) {
    Problem problem =
        over_rate("the token's uploads of a day (upload_bytes_per_day) are used up", flow.capacity, wait);
    problem.actual = uploads_.taken(caller.token, flow) + static_cast<double>(bytes);
    return problem;
  }
  return Done{};
}

Outcome<QuotaHold> Access::hold(const Caller& caller, std::initializer_list<QuotaPart> parts) {
  if (caller.token.empty()) return QuotaHold();
  auto holds = std::make_shared<std::vector<QuotaHold>>();
  for (const QuotaPart& part : parts) {
    auto held = hold_part(caller, part.quota, part.amount);
    if (!held.ok()) return held.problem();
    holds->push_back(std::move(held.value()));
  }
  return QuotaHold(std::move(holds));
}

Outcome<QuotaHold> Access::hold_part(const Caller& caller, Quota quota, std::uint64_t amount) {
  const std::uint64_t limit = limit_of(caller, quota);
  // Guests' streams are their own: they leave those of who shared the session alone.
  const std::string account = quota == Quota::kStreams ? request_key(caller) : caller.token;
  if (auto held = accounts_.hold(account, quota, amount, limit)) return held;
  return quota_problem(account, quota, amount, limit);
}

Outcome<Done> Access::check(const Caller& caller, std::initializer_list<QuotaPart> parts) const {
  if (caller.token.empty()) return Done{};
  for (const auto& [quota, amount] : parts) {
    const std::uint64_t limit = limit_of(caller, quota);
    const std::uint64_t held = accounts_.held(caller.token, quota);
    if (held > limit || amount > limit - held) return quota_problem(caller.token, quota, amount, limit);
  }
  return Done{};
}

Problem Access::quota_problem(const std::string& account, Quota quota, std::uint64_t amount,
                              std::uint64_t limit) const {
  const std::string name(protocol::kQuotas.at(static_cast<std::size_t>(quota)).name);
  Problem problem{.kind = ProblemKind::kTooMany,
                  .detail = std::string("one more would exceed the token's quota ").append(name),
                  .limit = static_cast<double>(limit),
                  .actual = static_cast<double>(accounts_.held(account, quota) + amount)};
  // Streams and jobs end by themselves; what else is held stays until it is deleted.
  const bool is_passing = quota == Quota::kStreams || quota == Quota::kJobs;
  if (is_passing && amount <= limit) problem.retry_after = protocol::kPassingSeconds;
  return problem;
}

QuotaHold Access::hold_again(const std::string& owner, std::initializer_list<QuotaPart> parts) {
  if (owner.empty()) return {};
  auto holds = std::make_shared<std::vector<QuotaHold>>();
  for (const QuotaPart& part : parts)
    holds->push_back(
        accounts_.hold(owner, part.quota, part.amount, std::numeric_limits<std::uint64_t>::max()));
  return holds;
}

protocol::CallerDocument Access::describe(const Caller& caller) const {
  protocol::CallerDocument document{.token = caller.token,
                                    .name = caller.name,
                                    .scope = caller.scope,
                                    .session = caller.session,
                                    .quotas = {}};
  // What the one who shared a session has left is no business of guests.
  if (caller.token.empty() || caller.session) return document;
  for (std::size_t i = 0; i < kQuotaCount; ++i) {
    const auto quota = static_cast<Quota>(i);
    std::uint64_t used = accounts_.held(caller.token, quota);
    if (quota == Quota::kRequestsPerSecond)
      used = static_cast<std::uint64_t>(requests_.taken(request_key(caller), request_flow(caller)));
    if (quota == Quota::kUploadBytesPerDay)
      used = static_cast<std::uint64_t>(uploads_.taken(caller.token, upload_flow(caller)));
    document.quotas.push_back(
        {.quota = protocol::kQuotas.at(i).name, .limit = limit_of(caller, quota), .used = used});
  }
  return document;
}

}  // namespace pointwright::server
