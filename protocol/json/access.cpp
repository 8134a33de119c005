#include "protocol/json/access.h"

#include <algorithm>
#include <chrono>

#include "protocol/json/request_members.h"

namespace pointwright::protocol {
namespace {

constexpr std::uint64_t kGreatestQuota = 1ULL << 53U;  // what JSON carries exactly
constexpr std::size_t kMaxTokens = 10'000;
constexpr std::size_t kDigestDigits = 64;

std::optional<TimePoint> read_time(const Json& value, const std::string& pointer, JsonErrors& errors) {
  const auto text = read_string(value, pointer, errors);
  if (!text) return std::nullopt;
  const auto time = parse_rfc3339(*text);
  if (!time) errors.add(pointer, "must be a time in UTC like 2026-01-31T12:00:00Z");
  return time;
}

std::optional<TimePoint> optional_time(ObjectReader& object, std::string_view name) {
  const Json* const member = object.optional(name);
  return member == nullptr ? std::nullopt : read_time(*member, object.pointer_to(name), object.errors());
}

/// One of the first `count` scopes.
Scope required_scope(ObjectReader& object, std::size_t count) {
  const auto index = required_choice(object, "scope", std::span(kScopeNames).first(count));
  return static_cast<Scope>(index.value_or(0));
}

Quotas optional_quotas(ObjectReader& object) {
  Quotas quotas;
  const Json* const member = object.optional("quotas");
  if (member == nullptr) return quotas;
  ObjectReader reader(*member, object.pointer_to("quotas"), object.errors());
  for (const QuotaInfo& quota : kQuotas)
    if (const Json* const value = reader.optional(quota.name))
      quotas.*quota.member =
          read_integer(*value, reader.pointer_to(quota.name), object.errors(), 0, kGreatestQuota);
  reader.finish();
  return quotas;
}

TokenRequest read_terms(ObjectReader& object) {
  TokenRequest terms;
  if (const Json* const name = object.required("name")) {
    terms.name = read_string(*name, object.pointer_to("name"), object.errors()).value_or("");
    if (name->is_string() && !is_valid_name(terms.name))
      object.errors().add(object.pointer_to("name"), "must be 1 to 120 bytes without control characters");
  }
  terms.scope = required_scope(object, kScopeNames.size());
  terms.expires = optional_time(object, "expires");
  terms.quotas = optional_quotas(object);
  return terms;
}

TokenEntry read_entry(const Json& value, const std::string& pointer, JsonErrors& errors) {
  TokenEntry entry;
  ObjectReader object(value, pointer, errors);
  entry.document.id = required_id(object, "id", "a token");
  if (const Json* const digest = object.required("sha256")) {
    entry.sha256 = read_string(*digest, object.pointer_to("sha256"), errors).value_or("");
    const bool is_digest = entry.sha256.size() == kDigestDigits &&
                           entry.sha256.find_first_not_of("0123456789abcdef") == std::string::npos;
    if (!is_digest) errors.add(object.pointer_to("sha256"), "must be 64 hexadecimal digits in lower case");
  }
  if (const Json* const created = object.required("created"))
    entry.document.created = read_time(*created, object.pointer_to("created"), errors).value_or(TimePoint());
  entry.document.terms = read_terms(object);
  object.finish();
  return entry;
}

JsonDocument quota_members(const Quotas& quotas) {
  JsonDocument members = JsonDocument::object();
  for (const QuotaInfo& quota : kQuotas)
    if (const auto& value = quotas.*quota.member) members[std::string(quota.name)] = *value;
  return members;
}

/// The digits at `begin` as a number; nullopt where others stand there.
std::optional<int> digits_of(std::string_view text, std::size_t begin, std::size_t count) {
  int value = 0;
  for (const char c : text.substr(begin, count)) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value * 10 + (c - '0');
  }
  return value;
}

}  // namespace

std::string_view scope_name(Scope scope) {
  return kScopeNames.at(static_cast<std::size_t>(scope));
}

std::optional<TimePoint> parse_rfc3339(std::string_view text) {
  constexpr std::string_view kShape = "0000-00-00T00:00:00";
  if (text.size() <= kShape.size() || text.back() != 'Z') return std::nullopt;
  for (std::size_t i = 0; i < kShape.size(); ++i)
    if (kShape[i] != '0' && kShape[i] != text[i]) return std::nullopt;
  std::string_view fraction = text.substr(kShape.size());
  fraction.remove_suffix(1);
  std::chrono::milliseconds part(0);
  if (!fraction.empty()) {
    constexpr std::size_t kMostDigits = 9;
    if (fraction.front() != '.' || fraction.size() < 2 || fraction.size() > kMostDigits + 1)
      return std::nullopt;
    if (!digits_of(fraction, 1, kMostDigits)) return std::nullopt;
    const std::string padded = std::string(fraction.substr(1)).append("000");
    part = std::chrono::milliseconds(*digits_of(padded, 0, 3));
  }
  std::array<int, 6> fields{};
  constexpr std::array<std::array<std::size_t, 2>, 6> kPlaces{
      {{{0, 4}}, {{5, 2}}, {{8, 2}}, {{11, 2}}, {{14, 2}}, {{17, 2}}}};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const auto number = digits_of(text, kPlaces[i][0], kPlaces[i][1]);
    if (!number) return std::nullopt;
    fields[i] = *number;
  }
  const auto [year, month, day, hour, minute, second] = fields;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(unsigned(month)),
                                         std::chrono::day(unsigned(day))};
  if (!date.ok() || year < 1970 || year > 2200 || hour > 23 || minute > 59 || second > 59)
    return std::nullopt;
  return TimePoint(std::chrono::sys_days(date)) + std::chrono::hours(hour) + std::chrono::minutes(minute) +
         std::chrono::seconds(second) + part;
}

Parsed<TokenRequest> parse_token_request(const Json& document) {
  JsonErrors errors;
  ObjectReader object(document, "", errors);
  TokenRequest request = read_terms(object);
  object.finish();
  return value_or_errors(std::move(request), std::move(errors));
}

Parsed<ShareRequest> parse_share_request(const Json& document) {
  JsonErrors errors;
  ObjectReader object(document, "", errors);
  ShareRequest request;
  request.scope = required_scope(object, 2);  // a link never makes an admin
  request.expires = optional_time(object, "expires");
  object.finish();
  return value_or_errors(request, std::move(errors));
}

Parsed<std::vector<TokenEntry>> parse_token_file(const Json& document) {
  JsonErrors errors;
  std::vector<TokenEntry> tokens;
  ObjectReader object(document, "", errors);
  if (const Json* const version = object.required("version"))
    read_integer(*version, "/version", errors, 1, 1);
  if (const Json* const list = object.required("tokens"))
    if (const Json* const array = read_array(*list, "/tokens", errors, 0, kMaxTokens))
      for (std::size_t i = 0; i < array->size(); ++i)
        tokens.push_back(read_entry((*array)[i], child_pointer("/tokens", i), errors));
  object.finish();
  return value_or_errors(std::move(tokens), std::move(errors));
}

JsonDocument to_json(const TokenDocument& token) {
  JsonDocument document{{"id", token.id},
                        {"name", token.terms.name},
                        {"scope", scope_name(token.terms.scope)},
                        {"created", to_rfc3339(token.created)}};
  if (token.terms.expires) document["expires"] = to_rfc3339(*token.terms.expires);
  document["quotas"] = quota_members(token.terms.quotas);
  return document;
}

JsonDocument to_json(const ShareDocument& share) {
  JsonDocument document{
      {"id", share.id}, {"scope", scope_name(share.terms.scope)}, {"created", to_rfc3339(share.created)}};
  if (share.terms.expires) document["expires"] = to_rfc3339(*share.terms.expires);
  return document;
}

JsonDocument to_json(const CallerDocument& caller) {
  JsonDocument document{{"scope", scope_name(caller.scope)}};
  if (!caller.token.empty()) {
    document["token"] = caller.token;
    document["name"] = caller.name;
  }
  if (caller.session) document["session"] = *caller.session;
  JsonDocument quotas = JsonDocument::object();
  for (const CallerDocument::Usage& usage : caller.quotas)
    quotas[std::string(usage.quota)] = JsonDocument{{"limit", usage.limit}, {"used", usage.used}};
  document["quotas"] = std::move(quotas);
  return document;
}

JsonDocument token_list(const std::vector<TokenDocument>& tokens) {
  JsonDocument list = JsonDocument::array();
  for (const TokenDocument& token : tokens) list.push_back(to_json(token));
  return JsonDocument{{"tokens", std::move(list)}};
}

JsonDocument share_list(const std::vector<ShareDocument>& shares) {
  JsonDocument list = JsonDocument::array();
  for (const ShareDocument& share : shares) list.push_back(to_json(share));
  return JsonDocument{{"shares", std::move(list)}};
}

JsonDocument token_file(const std::vector<TokenEntry>& tokens) {
  JsonDocument list = JsonDocument::array();
  for (const TokenEntry& token : tokens) {
    JsonDocument entry = to_json(token.document);
    entry["sha256"] = token.sha256;
    list.push_back(std::move(entry));
  }
  return JsonDocument{{"version", 1}, {"tokens", std::move(list)}};
}

}  // namespace pointwright::protocol
