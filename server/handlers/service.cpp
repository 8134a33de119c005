#include "server/handlers/service.h"

#include <algorithm>
#include <charconv>
#include <thread>

namespace pointwright::server {
namespace {

std::size_t pool_threads(const Config& config) {
  const std::size_t machine = config.threads > 0 ? config.threads : std::thread::hardware_concurrency();
  return std::max<std::size_t>(machine, 2);
}

}  // namespace

Service::Service(Config settings, ServiceParts parts)
    : config(std::move(settings)),
      decode(std::move(parts.decode)),
      decode_image(std::move(parts.decode_image)),
      assets(std::move(parts.assets)),
      interactive(pool_threads(config), static_cast<int>(config.threads), parts.report_failure),
      background(std::max<std::size_t>(pool_threads(config) / 2, 2), static_cast<int>(config.threads),
                 parts.report_failure),
      clouds(config.limits),
      images(config.limits),
      sessions(config.limits, {.interactive = interactive,
                               .background = background,
                               .build = std::move(parts.build),
                               .resample = std::move(parts.resample)}),
      upload_memory(config.limits.max_upload_memory),
      json_memory(config.limits.max_json_memory),
      answer_memory(config.limits.max_answer_memory),
      streams(config.limits.max_streams) {}

Response json_response(const protocol::JsonDocument& document, int status) {
  return {.status = status,
          .content_type = "application/json; charset=utf-8",
          .body = protocol::to_text(document)};
}

Outcome<std::shared_ptr<Session>> session_of(Service& service, const Request& request) {
  auto session = service.sessions.find(request.captures.at(0));
  if (session == nullptr)
    return Problem{.kind = ProblemKind::kNotFound, .detail = "there is no such session"};
  return session;
}

std::string revision_tag(std::uint64_t revision) {
  return std::string("\"r").append(std::to_string(revision)).append("\"");
}

Outcome<Session::Expected> expected_revision(const RequestHead& head) {
  const auto header = head.header("if-match");
  if (!header || *header == "*") return Session::Expected();
  std::uint64_t revision = 0;
  const bool quoted =
      header->size() > 3 && header->size() < 22 && header->substr(0, 2) == "\"r" && header->back() == '"';
  const char* const end = header->data() + header->size() - 1;
  if (quoted) {
    const auto [stop, error] = std::from_chars(header->data() + 2, end, revision);
    if (error == std::errc{} && stop == end) return Session::Expected(revision);
  }
  return Problem{.kind = ProblemKind::kMalformedRequest,
                 .detail = "If-Match must be one strong tag \"r<n>\", or *"};
}

Outcome<Session::Expected> required_revision(const RequestHead& head) {
  if (head.header("if-match")) return expected_revision(head);
  return Problem{.kind = ProblemKind::kRevisionRequired,
                 .detail = "name the revision to build on: If-Match: \"r<n>\""};
}

protocol::ParseLimits json_limits(const Service& service) {
  return {.max_bytes = static_cast<std::size_t>(service.config.limits.max_json_bytes),
          .max_depth = static_cast<std::size_t>(service.config.limits.max_json_depth)};
}

protocol::ParseLimits large_limits(const Service& service) {
  // Most of a recipe are numbers with many digits: this is more values than any such text holds, and in
  // proportion to its bytes no more than an ordinary document may have.
  constexpr std::uint64_t kBytesPerValue = 8;
  protocol::ParseLimits limits = json_limits(service);
  limits.max_bytes = static_cast<std::size_t>(service.config.limits.max_recipe_bytes);
  limits.max_values = std::max(limits.max_values, limits.max_bytes / kBytesPerValue);
  return limits;
}

Response session_response(const Session& session, const Document& document, int status) {
  return json_response(protocol::to_json(session.describe(document)), status)
      .with_header("ETag", revision_tag(document.revision));
}

}  // namespace pointwright::server
