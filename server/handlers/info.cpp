#include "protocol/json/documents.h"
#include "server/handlers/handlers.h"
#include "server/handlers/openapi.h"
#include "server/handlers/query.h"

namespace pointwright::server {

Response get_service(Service& service, const Request& request) {
  const bool wants_json = accepts(request.head, "application/json") && !accepts(request.head, "text/html");
  if (!wants_json && service.assets.find("/") != nullptr) return get_asset(service, request);
  return json_response({{"service", "pointwright"},
                        {"version", POINTWRIGHT_VERSION},
                        {"links",
                         {{"info", "/v1/info"},
                          {"clouds", "/v1/clouds"},
                          {"images", "/v1/images"},
                          {"imports", "/v1/imports"},
                          {"jobs", "/v1/jobs"},
                          {"sessions", "/v1/sessions"},
                          {"health", "/healthz"},
                          {"readiness", "/readyz"},
                          {"openapi", "/openapi.json"},
                          {"docs", "/docs"},
                          {"metrics", "/metrics"}}}})
      .with_header("Vary", "Accept");
}

Response get_health(Service&, const Request&) {
  return json_response({{"status", "alive"}});
}

Response get_readiness(Service& service, const Request& request) {
  if (service.stopping)
    return problem_response({.kind = ProblemKind::kOverloaded, .detail = "the server is stopping"}, request);
  if (!service.is_ready)
    return problem_response({.kind = ProblemKind::kOverloaded, .detail = "the server is starting"}, request);
  if (service.uploads.has_failed() || (service.archive != nullptr && service.archive->has_failed()))
    return problem_response(
        {.kind = ProblemKind::kStorageFailed, .detail = "the disk has failed: nothing can be changed"},
        request);
  return json_response({{"status", "ready"}});
}

Response get_info(Service& service, const Request& request) {
  protocol::InfoDocument info{
      .version = POINTWRIGHT_VERSION,
      .limits = {},
      .formats = {"draco", "ply", "xyz", "las", "draco-tiles", "pcd", "obj"},
      .features = {"preview-stream", "undo", "single-resolution", "images", "model-regions",
                   "visible-outlines", "recipes", "partial-play", "resampling", "amend", "idempotency-keys",
                   "tus", "tokens", "shares", "previews", "named-regions", "imports", "jobs"},
      .launchers = {std::string(protocol::kLocalLauncher)},
      .caller = protocol::to_json(service.access.describe(request.caller))};
  for (const Launcher& launcher : service.config.launchers) info.launchers.push_back(launcher.name);
  for (const LimitInfo& limit : limit_table())
    info.limits.emplace_back(std::string(limit.name), service.config.limits.*limit.member);
  return json_response(protocol::to_json(info));
}

Response get_problem(Service&, const Request& request) {
  const protocol::ProblemInfo* info = protocol::find_problem(request.captures.at(0));
  if (info == nullptr)
    return problem_response({.kind = ProblemKind::kNotFound, .detail = "there is no problem of that name"},
                            request);
  return {.content_type = "text/plain; charset=utf-8",
          .body = std::string(info->title) + " (" + std::to_string(info->status) + ")\n\n" +
                  std::string(info->explanation) + "\n"};
}

Response get_openapi_yaml(Service&, const Request&) {
  return {.content_type = "application/yaml; charset=utf-8", .body = std::string(openapi_yaml())};
}

Response get_openapi_json(Service&, const Request&) {
  return {.content_type = "application/json; charset=utf-8", .body = openapi_json()};
}

}  // namespace pointwright::server
