#include "server/handlers/service.h"

#include <algorithm>
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
      assets(std::move(parts.assets)),
      interactive(pool_threads(config), static_cast<int>(config.threads), parts.report_failure),
      background(std::max<std::size_t>(pool_threads(config) / 2, 1), static_cast<int>(config.threads),
                 parts.report_failure),
      clouds(config.limits),
      sessions(config.limits,
               {.interactive = interactive, .background = background, .build = std::move(parts.build)}),
      upload_memory(config.limits.max_upload_memory),
      json_memory(config.limits.max_json_memory),
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

Response session_response(const Session& session, const Document& document, int status) {
  return json_response(protocol::to_json(session.describe(document)), status)
      .with_header("ETag", revision_tag(document.revision));
}

}  // namespace pointwright::server
