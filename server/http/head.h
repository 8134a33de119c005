#pragma once
// The strict reader of request heads. A pure function over bytes: no socket, no library.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/http/message.h"
#include "server/http/problem_response.h"

namespace pointwright::server {

/// Bounds of a request's head.
struct HeadLimits {
  std::size_t max_bytes = 32 * 1024;
  std::size_t max_headers = 64;
  std::size_t max_path_bytes = 512;
};

/// Parses everything up to and including the empty line. Refused, among others: bare LF or CR, NUL and
/// control characters, folded lines, spaces before the colon, a missing or repeated Host, Content-Length that
/// is not one run of digits, any Transfer-Encoding or Content-Encoding, more than one range, methods that owe
/// a length without one.
/// Errors: a Problem with status 400, 411, 414, 415, 416, 417, 431, 501 or 505
std::variant<RequestHead, Problem> parse_head(std::string_view bytes, const HeadLimits& limits);

/// Percent-decodes; nullopt for a broken escape, NUL or control characters. `plus_is_space` for query
/// strings.
std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space);

/// Whether the host (with or without port) may be asked for: loopback names and those that the operator
/// listed.
bool is_allowed_host(std::string_view host, const std::vector<std::string>& allowed_hosts);

/// Whether the host is a loopback name, with or without port.
bool is_loopback_name(std::string_view host);

/// Host allow-list on every request; Origin absent, the request's own host or one of the listed origins on
/// state changes (403 otherwise). `is_tls`: pages without TLS are then not our own.
std::optional<Problem> check_origin(const RequestHead& head, const std::vector<std::string>& allowed_hosts,
                                    const std::vector<std::string>& cors_origins = {}, bool is_tls = false);

}  // namespace pointwright::server
