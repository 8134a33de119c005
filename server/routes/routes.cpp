#include "server/routes/routes.h"

#include <algorithm>
#include <array>

#include "server/handlers/handlers.h"

namespace pointwright::server {
namespace {

using enum Method;
using Body = BodyPolicy::Kind;

constexpr std::array kRoutes = {
    Route{kGet, "/", Body::kNone, get_service},
    Route{kGet, "/healthz", Body::kNone, get_health},
    Route{kGet, "/readyz", Body::kNone, get_readiness},
    Route{kGet, "/openapi.yaml", Body::kNone, get_openapi_yaml},
    Route{kGet, "/openapi.json", Body::kNone, get_openapi_json},
    Route{kGet, "/problems/{slug}", Body::kNone, get_problem},
    Route{kGet, "/v1/info", Body::kNone, get_info},
    Route{kGet, "/v1/clouds", Body::kNone, list_clouds},
    Route{kPost, "/v1/clouds", Body::kCloud, upload_cloud},
    Route{kGet, "/v1/clouds/{id}", Body::kNone, get_cloud},
    Route{kDelete, "/v1/clouds/{id}", Body::kNone, delete_cloud},
    Route{kGet, "/v1/clouds/{id}/data", Body::kNone, get_cloud_data},
    Route{kGet, "/v1/images", Body::kNone, list_images},
    Route{kPost, "/v1/images", Body::kImage, upload_image},
    Route{kGet, "/v1/images/{id}", Body::kNone, get_image},
    Route{kDelete, "/v1/images/{id}", Body::kNone, delete_image},
    Route{kGet, "/v1/images/{id}/data", Body::kNone, get_image_data},
    Route{kGet, "/v1/sessions", Body::kNone, list_sessions},
    Route{kPost, "/v1/sessions", Body::kJson, create_session},
    Route{kGet, "/v1/sessions/{id}", Body::kNone, get_session},
    Route{kDelete, "/v1/sessions/{id}", Body::kNone, delete_session},
    Route{kGet, "/v1/sessions/{id}/regions/{region}", Body::kNone, get_painting},
    Route{kPut, "/v1/sessions/{id}/regions/{region}", Body::kLargeJson, replace_painting},
    Route{kDelete, "/v1/sessions/{id}/regions/{region}", Body::kNone, clear_painting},
    Route{kPost, "/v1/sessions/{id}/regions/{region}/operations", Body::kJson, paint_region},
    Route{kPut, "/v1/sessions/{id}/preview", Body::kJson, put_preview},
    Route{kPost, "/v1/sessions/{id}/preview", Body::kJson, post_preview},
    Route{kDelete, "/v1/sessions/{id}/preview", Body::kNone, delete_preview},
    Route{kGet, "/v1/sessions/{id}/edits", Body::kNone, list_edits},
    Route{kPost, "/v1/sessions/{id}/edits", Body::kJson, post_edit},
    Route{kPut, "/v1/sessions/{id}/head", Body::kJson, put_head},
    Route{kGet, "/v1/sessions/{id}/recipe", Body::kNone, get_recipe},
    Route{kPost, "/v1/sessions/{id}/recipe", Body::kLargeJson, post_recipe},
    Route{kGet, "/v1/sessions/{id}/samples", Body::kNone, get_samples},
    Route{kGet, "/v1/sessions/{id}/stream", Body::kNone, get_stream},
};
/// The viewer's files answer for every other path that is in their table.
constexpr Route kAssetRoute{kGet, "/{asset}", Body::kNone, get_asset};

bool fits(std::string_view placeholder, std::string_view text) {
  if (placeholder == "{id}") return protocol::is_valid_id(text);
  if (placeholder == "{region}") return protocol::region_of_name(text).has_value();
  if (placeholder == "{slug}")
    return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
    });
  return false;
}

BodyPolicy policy_of(const Route& route, const Limits& limits) {
  switch (route.body) {
    case Body::kNone:
      return {.kind = route.body, .max_bytes = 0};
    case Body::kJson:
      return {.kind = route.body, .max_bytes = limits.max_json_bytes};
    case Body::kLargeJson:
      return {.kind = route.body, .max_bytes = limits.max_recipe_bytes};
    case Body::kCloud:
      return {.kind = route.body, .max_bytes = limits.max_upload_bytes};
    case Body::kImage:
      return {.kind = route.body, .max_bytes = limits.max_image_file_bytes};
  }
  return {};
}

/// Where the bytes of a body are held from as they arrive. Documents have a reserve of their own, so that no
/// upload keeps a hand waiting. A body for which there is no room now is refused before it is read; one over
/// its limit is let through: the fence refuses it.
Outcome<Budget*> admit_body(Service& service, const BodyPolicy& policy, const RequestHead& head) {
  const bool is_upload = policy.kind == Body::kCloud || policy.kind == Body::kImage;
  Budget& memory = is_upload ? service.upload_memory : service.json_memory;
  const std::uint64_t length = head.content_length.value_or(0);
  if (length > policy.max_bytes) return &memory;
  if (policy.kind == Body::kCloud)
    if (auto room = service.clouds.check_room(); !room.ok()) return room.problem();
  if (policy.kind == Body::kImage)
    if (auto room = service.images.check_room(); !room.ok()) return room.problem();
  const std::uint64_t held = memory.held();
  if (length > memory.total() - held)
    return Problem{.kind = ProblemKind::kOverloaded,
                   .detail = "other requests take the memory for bodies",
                   .limit = static_cast<double>(memory.total()),
                   .actual = static_cast<double>(held + length)};
  return &memory;
}

Resolution endpoint_of(Service& service, const Route& route, std::vector<std::string> captures,
                       const RequestHead& head, const std::string& request_id) {
  Endpoint endpoint{
      .body = policy_of(route, service.config.limits),
      .route = std::string(route.pattern),
      .captures = std::move(captures),
      .handle = [&service, handler = route.handler](const Request& r) { return handler(service, r); }};
  if (route.body != Body::kNone) {
    auto admitted = admit_body(service, endpoint.body, head);
    if (!admitted.ok()) return problem_response(admitted.problem(), head.path, request_id);
    endpoint.body_memory = admitted.value();
  }
  return endpoint;
}

}  // namespace

std::span<const Route> all_routes() {
  return kRoutes;
}

bool matches(std::string_view pattern, std::string_view path, std::vector<std::string>& captures) {
  captures.clear();
  while (!pattern.empty() && !path.empty()) {
    if (pattern.front() != '/' || path.front() != '/') return false;
    const std::size_t pattern_end = std::min(pattern.find('/', 1), pattern.size());
    const std::size_t path_end = std::min(path.find('/', 1), path.size());
    const std::string_view expected = pattern.substr(1, pattern_end - 1);
    const std::string_view actual = path.substr(1, path_end - 1);
    if (!expected.empty() && expected.front() == '{') {
      if (!fits(expected, actual)) return false;
      captures.emplace_back(actual);
    } else if (expected != actual) {
      return false;
    }
    pattern.remove_prefix(pattern_end);
    path.remove_prefix(path_end);
  }
  return pattern.empty() && path.empty();
}

Resolution resolve(Service& service, const RequestHead& head, const std::string& request_id) {
  const Method method = head.method == kHead ? kGet : head.method;
  std::vector<std::string> captures;
  std::string allowed;
  for (const Route& route : kRoutes) {
    if (!matches(route.pattern, head.path, captures)) continue;
    if (route.method == method) return endpoint_of(service, route, std::move(captures), head, request_id);
    allowed += (allowed.empty() ? "" : ", ") + std::string(method_name(route.method));
    if (route.method == kGet) allowed += ", HEAD";
  }
  if (allowed.empty() && service.assets.find(head.path) != nullptr) {
    if (method == kGet) return endpoint_of(service, kAssetRoute, {}, head, request_id);
    allowed = "GET, HEAD";
  }
  if (allowed.empty())
    return problem_response({.kind = ProblemKind::kNotFound, .detail = "there is nothing under this path"},
                            head.path, request_id);
  if (head.method == kOptions) return Response{.status = 204}.with_header("Allow", allowed + ", OPTIONS");
  return problem_response(
             {.kind = ProblemKind::kMethodNotAllowed, .detail = "this resource takes " + allowed}, head.path,
             request_id)
      .with_header("Allow", allowed + ", OPTIONS");
}

}  // namespace pointwright::server
