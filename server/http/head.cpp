#include "server/http/head.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace pointwright::server {
namespace {

bool is_token_char(char c) {
  constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || kMarks.find(c) != std::string_view::npos;
}

bool is_token(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), is_token_char);
}

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::optional<Method> method_of(std::string_view name) {
  for (const Method method : {Method::kGet, Method::kHead, Method::kPost, Method::kPut, Method::kPatch,
                              Method::kDelete, Method::kOptions})
    if (method_name(method) == name) return method;
  return std::nullopt;
}

/// Cuts the next CRLF line off `rest`; nullopt where a bare CR or LF stands in it.
std::optional<std::string_view> next_line(std::string_view& rest) {
  const std::size_t end = rest.find("\r\n");
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end + 2);
  if (line.find_first_of("\r\n") != std::string_view::npos) return std::nullopt;
  return line;
}

std::optional<Problem> parse_target(std::string_view target, const HeadLimits& limits, RequestHead& head) {
  if (target.empty() || target.front() != '/') return malformed_request("the request target must be a path");
  const bool is_plain =
      std::all_of(target.begin(), target.end(), [](char c) { return c > ' ' && c < '\x7f'; });
  if (!is_plain) return malformed_request("the request target holds characters that must be percent-encoded");
  const std::size_t mark = target.find('?');
  const std::string_view path = target.substr(0, mark);
  if (path.size() > limits.max_path_bytes)
    return Problem{.kind = ProblemKind::kPathTooLong,
                   .detail = "the path is longer than the server reads",
                   .limit = static_cast<double>(limits.max_path_bytes),
                   .actual = static_cast<double>(path.size())};
  auto decoded = percent_decode(path, false);
  if (!decoded) return malformed_request("the path holds a broken escape, NUL or a control character");
  head.path = std::move(*decoded);
  if (mark == std::string_view::npos) return std::nullopt;
  std::string_view query = target.substr(mark + 1);
  while (!query.empty()) {
    const std::size_t end = query.find('&');
    const std::string_view pair = query.substr(0, end);
    query = end == std::string_view::npos ? std::string_view{} : query.substr(end + 1);
    if (pair.empty()) continue;
    const std::size_t equals = pair.find('=');
    auto name = percent_decode(pair.substr(0, equals), true);
    auto value =
        percent_decode(equals == std::string_view::npos ? std::string_view{} : pair.substr(equals + 1), true);
    if (!name || !value)
      return malformed_request("the query holds a broken escape, NUL or a control character");
    head.query.emplace_back(std::move(*name), std::move(*value));
  }
  return std::nullopt;
}

std::optional<Problem> parse_request_line(std::string_view line, const HeadLimits& limits,
                                          RequestHead& head) {
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == std::string_view::npos || first == last)
    return malformed_request("the request line is not METHOD TARGET VERSION");
  const std::string_view method = line.substr(0, first);
  const std::string_view version = line.substr(last + 1);
  if (!is_token(method)) return malformed_request("the method is not a token");
  if (version != "HTTP/1.1" && version != "HTTP/1.0") {
    if (version.substr(0, 5) != "HTTP/")
      return malformed_request("the request line is not METHOD TARGET VERSION");
    return Problem{.kind = ProblemKind::kHttpVersion, .detail = "this server speaks HTTP/1.1"};
  }
  const auto known = method_of(method);
  if (!known)
    return Problem{.kind = ProblemKind::kNotImplemented, .detail = "the method is unknown to this server"};
  head.method = *known;
  return parse_target(line.substr(first + 1, last - first - 1), limits, head);
}

std::optional<Problem> parse_header_line(std::string_view line, RequestHead& head) {
  if (line.front() == ' ' || line.front() == '\t')
    return malformed_request("folded header lines are not accepted");
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon)))
    return malformed_request("a header line is not NAME: VALUE");
  const std::string_view value = trimmed(line.substr(colon + 1));
  const bool has_control = std::any_of(value.begin(), value.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < 0x20 && byte != '\t') || byte == 0x7f;
  });
  if (has_control) return malformed_request("a header value holds a control character");
  head.headers.emplace_back(lower(line.substr(0, colon)), std::string(value));
  return std::nullopt;
}

std::size_t count_of(const RequestHead& head, std::string_view name) {
  return static_cast<std::size_t>(std::count_if(head.headers.begin(), head.headers.end(),
                                                [&](const NameValue& h) { return h.first == name; }));
}

/// How long the body is: one plain number, or none at all.
std::optional<Problem> check_length(RequestHead& head) {
  const std::size_t length_count = count_of(head, "content-length");
  if (const auto coding = head.header("transfer-encoding")) {
    if (length_count > 0) return malformed_request("Transfer-Encoding and Content-Length exclude each other");
    if (lower(*coding) != "chunked")
      return Problem{.kind = ProblemKind::kNotImplemented, .detail = "this transfer coding is not supported"};
    return Problem{.kind = ProblemKind::kLengthRequired,
                   .detail = "send Content-Length; chunked bodies are not accepted"};
  }
  if (length_count > 1) return malformed_request("Content-Length is given more than once");
  if (length_count == 1) {
    const std::string_view text = *head.header("content-length");
    const bool digits = !text.empty() && text.size() <= 18 &&
                        std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!digits) return malformed_request("Content-Length is not a number of at most 18 digits");
    std::uint64_t length = 0;
    std::from_chars(text.data(), text.data() + text.size(), length);
    head.content_length = length;
  }
  const bool owes_length =
      head.method == Method::kPost || head.method == Method::kPut || head.method == Method::kPatch;
  if (owes_length && !head.content_length)
    return Problem{.kind = ProblemKind::kLengthRequired, .detail = "this method needs a Content-Length"};
  return std::nullopt;
}

std::optional<Problem> check_framing(RequestHead& head) {
  if (count_of(head, "host") != 1) return malformed_request("exactly one Host header is needed");
  if (auto problem = check_length(head)) return problem;
  if (const auto coding = head.header("content-encoding"); coding && lower(*coding) != "identity")
    return Problem{.kind = ProblemKind::kUnsupportedMediaType,
                   .detail = "compressed request bodies are not accepted"};
  if (count_of(head, "range") > 1 || head.header("range").value_or("").find(',') != std::string_view::npos)
    return Problem{.kind = ProblemKind::kRangeNotSatisfiable, .detail = "at most one range may be asked for"};
  if (const auto expect = head.header("expect"); expect && lower(*expect) != "100-continue")
    return Problem{.kind = ProblemKind::kExpectationFailed,
                   .detail = "the only expectation met is 100-continue"};
  return std::nullopt;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// The name of a host without its port, in lower case; empty where it is none.
std::string host_name(std::string_view host) {
  std::string name = lower(host);
  if (!name.empty() && name.front() == '[') {
    const std::size_t close = name.find(']');
    if (close == std::string::npos) return {};
    const std::string port = name.substr(close + 1);
    if (!port.empty() && port.front() != ':') return {};
    name.resize(close + 1);
  } else if (const std::size_t colon = name.find(':'); colon != std::string::npos) {
    const bool digits = std::all_of(name.begin() + static_cast<std::ptrdiff_t>(colon) + 1, name.end(),
                                    [](char c) { return c >= '0' && c <= '9'; });
    if (!digits) return {};
    name.resize(colon);
  }
  return name;
}

}  // namespace

std::optional<std::string> percent_decode(std::string_view text, bool plus_is_space) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && plus_is_space) c = ' ';
    if (text[i] == '%') {
      const int high = i + 1 < text.size() ? hex_value(text[i + 1]) : -1;
      const int low = i + 2 < text.size() ? hex_value(text[i + 2]) : -1;
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == '\x7f') return std::nullopt;
    result.push_back(c);
  }
  return result;
}

std::variant<RequestHead, Problem> parse_head(std::string_view bytes, const HeadLimits& limits) {
  RequestHead head;
  if (bytes.find('\0') != std::string_view::npos) return malformed_request("the head holds a NUL");
  std::string_view rest = bytes;
  const auto request_line = next_line(rest);
  if (!request_line) return malformed_request("the request line does not end with CR LF");
  if (auto problem = parse_request_line(*request_line, limits, head)) return std::move(*problem);
  while (true) {
    const auto line = next_line(rest);
    if (!line) return malformed_request("a header line does not end with CR LF");
    if (line->empty()) break;
    if (head.headers.size() == limits.max_headers)
      return Problem{.kind = ProblemKind::kHeadTooLarge,
                     .detail = "the request has more headers than the server reads",
                     .limit = static_cast<double>(limits.max_headers)};
    if (auto problem = parse_header_line(*line, head)) return std::move(*problem);
  }
  if (auto problem = check_framing(head)) return std::move(*problem);
  return head;
}

bool is_loopback_name(std::string_view host) {
  const std::string name = host_name(host);
  return name == "localhost" || name == "127.0.0.1" || name == "[::1]";
}

bool is_allowed_host(std::string_view host, const std::vector<std::string>& allowed_hosts) {
  const std::string name = host_name(host);
  return is_loopback_name(name) || (!name.empty() && std::find(allowed_hosts.begin(), allowed_hosts.end(),
                                                               name) != allowed_hosts.end());
}

std::optional<Problem> check_origin(const RequestHead& head, const std::vector<std::string>& allowed_hosts,
                                    const std::vector<std::string>& cors_origins, bool is_tls) {
  const std::string host = lower(head.header("host").value_or(""));
  if (!is_allowed_host(host, allowed_hosts))
    return Problem{
        .kind = ProblemKind::kHostNotAllowed,
        .detail = "this server does not answer for that host name; the operator can list it as allowed"};
  if (!changes_state(head.method)) return std::nullopt;
  for (const NameValue& entry : head.headers) {
    if (entry.first != "origin") continue;
    const std::string origin = lower(entry.second);
    const bool is_listed = std::find(cors_origins.begin(), cors_origins.end(), origin) != cors_origins.end();
    const bool is_own = origin == "https://" + host || (!is_tls && origin == "http://" + host);
    if (!is_listed && !is_own)
      return Problem{.kind = ProblemKind::kOriginNotAllowed,
                     .detail = "changes are taken from this server's own pages only"};
  }
  return std::nullopt;
}

}  // namespace pointwright::server
