#include "server/http/exchange.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>

#include "server/base/random_id.h"
#include "server/base/request_scope.h"
#include "server/http/cors.h"
#include "server/http/problem_response.h"

namespace pointwright::server {
namespace {

/// For pages of the viewer and for everything else: nothing is loaded from elsewhere, nothing may frame us.
constexpr std::string_view kContentSecurityPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src "
    "'self'; "
    "font-src 'self'; worker-src 'self' blob:; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

bool is_well_formed_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 && std::all_of(id.begin(), id.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == '_' || c == '-';
  });
}

bool has_header(const Response& response, std::string_view name) {
  return std::any_of(response.headers.begin(), response.headers.end(),
                     [&](const NameValue& h) { return h.first == name; });
}

std::string server_timing(const std::vector<std::pair<std::string, double>>& timings) {
  std::string value;
  for (const auto& [name, ms] : timings) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), ";dur=%.2f", ms);
    if (!value.empty()) value += ", ";
    value += name + text.data();
  }
  return value;
}

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

std::chrono::milliseconds time_for(std::uint64_t bytes, std::uint64_t rate) {
  return std::chrono::milliseconds(bytes / std::max<std::uint64_t>(rate / 1000, 1));
}

}  // namespace

Exchange::Exchange(const ExchangeContext& context, Connection& connection, bool refuse)
    : context_(context),
      connection_(connection),
      refuse_(refuse),
      begin_(Clock::now()),
      write_deadline_(begin_ + context.options.write_grace),
      request_id_(random_id()) {}

bool Exchange::read_head() {
  std::string bytes;
  const auto patience = refuse_ ? std::chrono::milliseconds(250) : context_.options.head_deadline;
  const auto status = connection_.read_head(context_.options.head.max_bytes, begin_ + patience, bytes);
  log_.request_bytes = bytes.size();
  switch (status) {
    case Connection::HeadStatus::kComplete:
      head_ = parse_head(bytes, context_.options.head);
      break;
    case Connection::HeadStatus::kClosed:
      return false;
    case Connection::HeadStatus::kTimedOut:
      // An idle connection that never asked is closed without a word, like a kept-alive one.
      if (bytes.empty()) return false;
      head_ = Problem{.kind = ProblemKind::kRequestTimeout, .detail = "the head did not arrive in time"};
      break;
    case Connection::HeadStatus::kTooLarge:
      head_ = Problem{.kind = ProblemKind::kHeadTooLarge,
                      .detail = "the head is larger than the server reads",
                      .limit = static_cast<double>(context_.options.head.max_bytes)};
      break;
  }
  if (auto* head = std::get_if<RequestHead>(&head_)) {
    head->peer = connection_.peer_address();
    if (const auto id = head->header("x-request-id"); id && is_well_formed_id(*id)) request_id_ = *id;
    log_.method = method_name(head->method);
    log_.path = head->path;
  }
  return true;
}

bool Exchange::is_head_request() const {
  const auto* head = std::get_if<RequestHead>(&head_);
  return head != nullptr && head->method == Method::kHead;
}

Response Exchange::refuse(const Problem& problem) {
  const auto* head = std::get_if<RequestHead>(&head_);
  return problem_response(problem, head != nullptr ? head->path : "", request_id_);
}

std::optional<Problem> Exchange::check_body(const BodyPolicy& policy) const {
  const RequestHead& head = std::get<RequestHead>(head_);
  const std::uint64_t length = head.content_length.value_or(0);
  if (policy.kind == BodyPolicy::Kind::kNone) {
    if (length == 0) return std::nullopt;
    return Problem{.kind = ProblemKind::kBodyTooLarge,
                   .detail = "this request takes no body",
                   .limit = 0,
                   .actual = static_cast<double>(length)};
  }
  const std::string type = head.media_type();
  const bool is_json = policy.kind == BodyPolicy::Kind::kJson || policy.kind == BodyPolicy::Kind::kLargeJson;
  if (is_json && type != "application/json")
    return Problem{.kind = ProblemKind::kUnsupportedMediaType, .detail = "send application/json"};
  constexpr std::array<std::string_view, 8> kCloudTypes = {"application/json",  "application/octet-stream",
                                                           "application/x-ply", "application/vnd.las",
                                                           "model/obj",         "model/x-draco",
                                                           "model/x-pcd",       "text/plain"};
  if (policy.kind == BodyPolicy::Kind::kCloud &&
      std::find(kCloudTypes.begin(), kCloudTypes.end(), type) == kCloudTypes.end())
    return Problem{.kind = ProblemKind::kUnsupportedMediaType,
                   .detail =
                       "send application/octet-stream, model/x-draco, application/x-ply, "
                       "application/vnd.las, model/x-pcd, model/obj, text/plain (XYZ), or "
                       "application/json with an upload. LAZ and E57 are not read: convert them to LAS "
                       "first, with laszip, PDAL or CloudCompare"};
  if (policy.kind == BodyPolicy::Kind::kUpload && length > 0 && type != "application/offset+octet-stream")
    return Problem{.kind = ProblemKind::kUnsupportedMediaType,
                   .detail = "send application/offset+octet-stream"};
  if (policy.kind == BodyPolicy::Kind::kImage && type != "image/png")
    return Problem{.kind = ProblemKind::kUnsupportedMediaType, .detail = "send image/png"};
  const bool names_upload = policy.kind == BodyPolicy::Kind::kCloud && type == "application/json";
  const std::uint64_t most = names_upload ? policy.max_json_bytes : policy.max_bytes;
  if (length > most)
    return Problem{.kind = ProblemKind::kBodyTooLarge,
                   .detail = "the body is larger than this route takes",
                   .limit = static_cast<double>(most),
                   .actual = static_cast<double>(length)};
  return std::nullopt;
}

std::optional<Problem> Exchange::read_body(const Endpoint& endpoint, Request& request) {
  if (endpoint.body.kind == BodyPolicy::Kind::kNone) return std::nullopt;
  if (endpoint.open_target) {
    auto target = endpoint.open_target(request);
    if (!target.ok()) return target.problem();
    request.target = std::move(target.value());
  }
  const RequestHead& head = std::get<RequestHead>(head_);
  const std::uint64_t length = head.content_length.value_or(0);
  const HttpOptions& options = context_.options;
  if (head.header("expect") && length > 0)
    connection_.write_all(std::string_view("HTTP/1.1 100 Continue\r\n\r\n"),
                          Clock::now() + options.write_grace);
  const auto hold = [&](std::uint64_t bytes) {
    if (endpoint.body_memory == nullptr) return true;
    request.body_memory.push_back(endpoint.body_memory->hold(bytes));
    return request.body_memory.back() != nullptr;
  };
  const Connection::BodyPace pace{.grace = options.body_grace, .least_rate = options.least_body_rate};
  std::uint64_t count = 0;
  auto status = Connection::BodyStatus::kComplete;
  if (request.target != nullptr) {
    const auto take = [&](std::span<const std::byte> bytes) { return request.target->write(bytes); };
    status = connection_.stream_body(length, pace, take, count);
  } else {
    status = connection_.read_body(length, pace, hold, request.body);
    count = request.body.size();
  }
  log_.request_bytes += count;
  if (status == Connection::BodyStatus::kComplete) return std::nullopt;
  if (status == Connection::BodyStatus::kNoRoom && request.target != nullptr)
    return request.target->problem();
  if (status == Connection::BodyStatus::kTimedOut)
    return Problem{.kind = ProblemKind::kRequestTimeout, .detail = "the body came too slowly"};
  if (status == Connection::BodyStatus::kNoRoom)
    return Problem{.kind = ProblemKind::kOverloaded,
                   .detail = "other requests take the memory for bodies",
                   .limit = static_cast<double>(endpoint.body_memory->total())};
  return Problem{.kind = ProblemKind::kMalformedRequest,
                 .detail = "the body ended before its Content-Length",
                 .limit = std::nullopt,
                 .actual = static_cast<double>(count)};
}

Response Exchange::dispatch() {
  if (const auto* problem = std::get_if<Problem>(&head_)) return refuse(*problem);
  if (refuse_)
    return refuse({.kind = ProblemKind::kOverloaded,
                   .detail = "all connections are in use",
                   .limit = static_cast<double>(context_.options.max_connections)});
  if (context_.stopping)
    return refuse({.kind = ProblemKind::kOverloaded, .detail = "the server is stopping"});
  auto& head = std::get<RequestHead>(head_);
  if (auto problem = check_origin(head, context_.options.allowed_hosts, context_.options.cors_origins,
                                  context_.options.tls != nullptr))
    return refuse(*problem);
  if (is_preflight(head)) return preflight(head, context_.options.cors_origins);
  Resolution resolution = context_.resolver(head, request_id_);
  if (auto* response = std::get_if<Response>(&resolution)) return std::move(*response);
  auto& endpoint = std::get<Endpoint>(resolution);
  log_.route = endpoint.route;
  log_.token = endpoint.caller.token;
  if (auto problem = check_body(endpoint.body)) return refuse(*problem);
  if (endpoint.charge)
    if (auto charged = endpoint.charge(); !charged.ok()) return refuse(charged.problem());
  Request request{.head = head,
                  .id = request_id_,
                  .captures = std::move(endpoint.captures),
                  .body = {},
                  .caller = std::move(endpoint.caller)};
  if (auto problem = read_body(endpoint, request)) return refuse(*problem);
  // Beside what handlers tell of their own steps: what is left of the total is the reading of the body.
  const Clock::time_point begin = Clock::now();
  Response response = endpoint.handle(request);
  response.timings.emplace_back("handle", milliseconds_since(begin));
  return response;
}

Response Exchange::answer() {
  const RequestScope scope(request_id_);
  Response response;
  try {
    response = dispatch();
  } catch (const std::bad_alloc&) {
    note_failure("out of memory");
    response = refuse(
        {.kind = ProblemKind::kOutOfSpace, .detail = "the server has no memory left for this request"});
  } catch (const std::exception& error) {
    note_failure(error.what());
    response = refuse({.kind = ProblemKind::kInternalError, .detail = "the server failed; its log says why"});
  } catch (...) {
    note_failure("an unknown exception");
    response = refuse({.kind = ProblemKind::kInternalError, .detail = "the server failed; its log says why"});
  }
  log_.status = response.status;
  response.timings.emplace_back("total", milliseconds_since(begin_));
  log_.timings = response.timings;
  log_.is_stream = std::holds_alternative<StreamBody>(response.body);
  response.with_header("X-Request-Id", request_id_)
      .with_header("Server-Timing", server_timing(response.timings))
      .with_header("Content-Security-Policy", std::string(kContentSecurityPolicy))
      .with_header("X-Content-Type-Options", "nosniff")
      .with_header("Referrer-Policy", "no-referrer")
      .with_header("Cross-Origin-Resource-Policy", "same-origin")
      .with_header("Cross-Origin-Opener-Policy", "same-origin")
      .with_header("Accept-Ranges", "none");
  // What the protocol of uploads wants of every answer, those included that no handler made.
  if (const auto* head = std::get_if<RequestHead>(&head_)) {
    if (head->path.starts_with("/v1/uploads") && !has_header(response, "Tus-Resumable"))
      response.with_header("Tus-Resumable", "1.0.0");
    allow_reading(response, *head, context_.options.cors_origins);
    // Not for loopback names: browsers would want TLS of whatever else listens there.
    if (context_.options.tls != nullptr && !is_loopback_name(head->header("host").value_or("localhost")))
      response.with_header("Strict-Transport-Security", "max-age=31536000");
  }
  if (!has_header(response, "Cache-Control")) response.with_header("Cache-Control", "no-store");
  return response;
}

void Exchange::begin_answer(std::uint64_t bytes) {
  log_.response_bytes = bytes;
  const HttpOptions& options = context_.options;
  write_deadline_ = Clock::now() + options.write_grace + time_for(bytes, options.least_write_rate);
}

void Exchange::begin_stream_write() {
  write_deadline_ = Clock::now() + context_.options.stream_write_deadline;
}

bool Exchange::write_chunk(std::span<const std::byte> bytes) {
  begin_stream_write();
  log_.response_bytes += bytes.size();
  std::array<char, 2 * sizeof(std::size_t) + 2> head{};
  char* end = std::to_chars(head.data(), head.data() + head.size(), bytes.size(), 16).ptr;
  *end++ = '\r';
  *end++ = '\n';
  constexpr std::string_view kEnd = "\r\n";
  std::array pieces{std::as_bytes(std::span<const char>(head.data(), end)), bytes,
                    std::as_bytes(std::span<const char>(kEnd))};
  return connection_.write_all(std::span<std::span<const std::byte>>(pieces), write_deadline_);
}

void Exchange::finish() {
  log_.request_id = request_id_;
  log_.duration_ms = milliseconds_since(begin_);
  if (context_.log) context_.log(log_);
}

}  // namespace pointwright::server
