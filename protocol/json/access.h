#pragma once
// Tokens and share links, as the server sends them, as clients ask for them, and as the file of tokens keeps
// them.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/json/documents.h"
#include "protocol/json/parse.h"

namespace pointwright::protocol {

/// What a caller may do. Each scope holds those before it.
enum class Scope { kView, kEdit, kAdmin };

std::string_view scope_name(Scope scope);
/// In the order of the enumeration.
inline constexpr std::array<std::string_view, 3> kScopeNames = {"view", "edit", "admin"};

/// What one token may take; absent: as the server's limits say.
struct Quotas {
  std::optional<std::uint64_t> sessions = std::nullopt;
  std::optional<std::uint64_t> samples = std::nullopt;       ///< of all sessions together
  std::optional<std::uint64_t> stored_bytes = std::nullopt;  ///< of uploads that are kept
  std::optional<std::uint64_t> upload_bytes_per_day = std::nullopt;
  std::optional<std::uint64_t> streams = std::nullopt;
  std::optional<std::uint64_t> requests_per_second = std::nullopt;
  std::optional<std::uint64_t> jobs = std::nullopt;  ///< that wait or run
  std::optional<std::uint64_t> clouds = std::nullopt;
  std::optional<std::uint64_t> images = std::nullopt;
  friend bool operator==(const Quotas&, const Quotas&) = default;
};

struct QuotaInfo {
  std::string_view name;
  std::optional<std::uint64_t> Quotas::*member;
};
/// Every quota by its name.
inline constexpr std::array kQuotas = {
    QuotaInfo{"sessions", &Quotas::sessions},
    QuotaInfo{"samples", &Quotas::samples},
    QuotaInfo{"stored_bytes", &Quotas::stored_bytes},
    QuotaInfo{"upload_bytes_per_day", &Quotas::upload_bytes_per_day},
    QuotaInfo{"streams", &Quotas::streams},
    QuotaInfo{"requests_per_second", &Quotas::requests_per_second},
    QuotaInfo{"jobs", &Quotas::jobs},
    QuotaInfo{"clouds", &Quotas::clouds},
    QuotaInfo{"images", &Quotas::images},
};

/// POST /v1/tokens
struct TokenRequest {
  std::string name;
  Scope scope = Scope::kView;
  std::optional<TimePoint> expires = std::nullopt;
  Quotas quotas = {};
};

struct TokenDocument {
  std::string id;
  TimePoint created;
  TokenRequest terms;
};

/// A token as the file keeps it.
struct TokenEntry {
  TokenDocument document;
  std::string sha256;  ///< of the token, in hexadecimal
};

/// POST …/shares
struct ShareRequest {
  Scope scope = Scope::kView;  ///< view or edit
  std::optional<TimePoint> expires = std::nullopt;
};

struct ShareDocument {
  std::string id;
  TimePoint created;
  ShareRequest terms;
};

/// What a caller is told of itself.
struct CallerDocument {
  std::string token;  ///< its id; empty: no tokens are in use
  std::string name;   ///< of the token
  Scope scope = Scope::kAdmin;
  std::optional<std::string> session;  ///< the only one, for share links
  struct Usage {
    std::string_view quota;
    std::uint64_t limit = 0;
    std::uint64_t used = 0;
  };
  std::vector<Usage> quotas;
};

Parsed<TokenRequest> parse_token_request(const Json& document);
Parsed<ShareRequest> parse_share_request(const Json& document);
/// The file of tokens: {"version": 1, "tokens": […]}
Parsed<std::vector<TokenEntry>> parse_token_file(const Json& document);
/// "2026-01-31T12:00:00Z", with or without a fraction of the second; nullopt for anything else.
std::optional<TimePoint> parse_rfc3339(std::string_view text);

JsonDocument to_json(const TokenDocument& token);
JsonDocument to_json(const ShareDocument& share);
JsonDocument to_json(const CallerDocument& caller);
JsonDocument token_list(const std::vector<TokenDocument>& tokens);
JsonDocument share_list(const std::vector<ShareDocument>& shares);
JsonDocument token_file(const std::vector<TokenEntry>& tokens);

}  // namespace pointwright::protocol
