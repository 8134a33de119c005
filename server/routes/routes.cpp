#include "server/routes/routes.h"

#include <algorithm>
#include <array>
#include <utility>

#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/uploads.h"

namespace pointwright::server {
namespace {

using enum Method;
using enum Permission;
using Body = BodyPolicy::Kind;
/// An Idempotency-Key makes the request have one effect.
constexpr bool kOnce = true;
constexpr bool kOften = false;

constexpr std::array kRoutes = {
    Route{kGet, "/", Body::kNone, get_service, kOpen},
    Route{kGet, "/healthz", Body::kNone, get_health, kOpen},
    Route{kGet, "/readyz", Body::kNone, get_readiness, kOpen},
    Route{kGet, "/openapi.yaml", Body::kNone, get_openapi_yaml, kOpen},
    Route{kGet, "/openapi.json", Body::kNone, get_openapi_json, kOpen},
    Route{kGet, "/problems/{slug}", Body::kNone, get_problem, kOpen},
    Route{kGet, "/metrics", Body::kNone, get_metrics, kNoGuests},
    Route{kGet, "/docs", Body::kNone, get_docs, kOpen},
    Route{kGet, "/docs/docs.css", Body::kNone, get_docs_file, kOpen},
    Route{kGet, "/docs/docs.js", Body::kNone, get_docs_file, kOpen},
    Route{kGet, "/v1/info", Body::kNone, get_info},
    Route{kGet, "/v1/tokens", Body::kNone, list_tokens, kAdmin},
    Route{kPost, "/v1/tokens", Body::kJson, create_token, kAdmin},
    Route{kDelete, "/v1/tokens/{id}", Body::kNone, revoke_token, kAdmin},
    Route{kGet, "/v1/clouds", Body::kNone, list_clouds},
    Route{kPost, "/v1/clouds", Body::kCloud, upload_cloud, kOwner, kOnce, "name nonfinite"},
    Route{kGet, "/v1/clouds/{id}", Body::kNone, get_cloud},
    Route{kDelete, "/v1/clouds/{id}", Body::kNone, delete_cloud},
    Route{kGet, "/v1/clouds/{id}/data", Body::kNone, get_cloud_data, kByMethod, kOften,
          "format attributes encoding"},
    Route{kGet, "/v1/imports", Body::kNone, list_imports},
    Route{kGet, "/v1/imports/{id}", Body::kNone, get_import},
    Route{kDelete, "/v1/imports/{id}", Body::kNone, delete_import},
    Route{kGet, "/v1/jobs", Body::kNone, list_jobs, kByMethod, kOften, "status limit"},
    Route{kPost, "/v1/jobs", Body::kLargeJson, create_job, kOwner, kOnce},
    Route{kGet, "/v1/jobs/{id}", Body::kNone, get_job},
    Route{kDelete, "/v1/jobs/{id}", Body::kNone, delete_job, kByMethod, kOften, "only"},
    Route{kPost, "/v1/jobs/{id}/restart", Body::kNone, restart_job, kByMethod, kOnce},
    Route{kGet, "/v1/jobs/{id}/log", Body::kNone, get_job_log, kByMethod, kOften, "offset"},
    Route{kGet, "/v1/jobs/{id}/events", Body::kNone, get_job_events},
    Route{kGet, "/v1/jobs/{id}/results", Body::kNone, get_job_results},
    Route{kGet, "/v1/jobs/{id}/results/{file}", Body::kNone, get_job_result},
    Route{kGet, "/v1/uploads", Body::kNone, list_uploads},
    Route{kPost, "/v1/uploads", Body::kUpload, create_upload, kOwner},
    Route{kGet, "/v1/uploads/{id}", Body::kNone, get_upload},
    Route{kPatch, "/v1/uploads/{id}", Body::kUpload, patch_upload},
    Route{kDelete, "/v1/uploads/{id}", Body::kNone, delete_upload},
    Route{kGet, "/v1/images", Body::kNone, list_images},
    Route{kPost, "/v1/images", Body::kImage, upload_image, kOwner, kOnce},
    Route{kGet, "/v1/images/{id}", Body::kNone, get_image},
    Route{kDelete, "/v1/images/{id}", Body::kNone, delete_image},
    Route{kGet, "/v1/images/{id}/data", Body::kNone, get_image_data},
    Route{kGet, "/v1/sessions", Body::kNone, list_sessions},
    Route{kPost, "/v1/sessions", Body::kJson, create_session, kOwner, kOnce},
    Route{kGet, "/v1/sessions/{id}", Body::kNone, get_session},
    Route{kPatch, "/v1/sessions/{id}", Body::kJson, patch_session},
    Route{kDelete, "/v1/sessions/{id}", Body::kNone, delete_session, kOwner},
    Route{kGet, "/v1/sessions/{id}/shares", Body::kNone, list_shares, kOwner},
    Route{kPost, "/v1/sessions/{id}/shares", Body::kJson, create_share, kOwner},
    Route{kDelete, "/v1/sessions/{id}/shares/{id}", Body::kNone, revoke_share, kOwner},
    Route{kGet, "/v1/sessions/{id}/regions", Body::kNone, list_regions},
    Route{kGet, "/v1/sessions/{id}/regions/{region}", Body::kNone, get_painting},
    Route{kPut, "/v1/sessions/{id}/regions/{region}", Body::kLargeJson, replace_painting},
    Route{kDelete, "/v1/sessions/{id}/regions/{region}", Body::kNone, clear_painting},
    Route{kPost, "/v1/sessions/{id}/regions/{region}/operations", Body::kJson, paint_region, kByMethod,
          kOnce},
    Route{kPut, "/v1/sessions/{id}/preview", Body::kJson, put_preview},
    Route{kPost, "/v1/sessions/{id}/preview", Body::kJson, post_preview, kByMethod, kOften, "attributes"},
    Route{kDelete, "/v1/sessions/{id}/preview", Body::kNone, delete_preview},
    Route{kGet, "/v1/sessions/{id}/edits", Body::kNone, list_edits},
    Route{kPost, "/v1/sessions/{id}/edits", Body::kJson, post_edit, kByMethod, kOnce},
    Route{kGet, "/v1/sessions/{id}/edits/{edit}", Body::kNone, get_edit},
    Route{kPut, "/v1/sessions/{id}/edits/{edit}", Body::kJson, put_edit},
    Route{kDelete, "/v1/sessions/{id}/edits/{edit}", Body::kNone, delete_edit, kByMethod, kOnce},
    Route{kPut, "/v1/sessions/{id}/head", Body::kJson, put_head},
    Route{kGet, "/v1/sessions/{id}/recipe", Body::kNone, get_recipe},
    Route{kPost, "/v1/sessions/{id}/recipe", Body::kLargeJson, post_recipe, kByMethod, kOnce},
    Route{kGet, "/v1/sessions/{id}/samples", Body::kNone, get_samples, kByMethod, kOften,
          "format level attributes encoding s timing"},
    Route{kGet, "/v1/sessions/{id}/stream", Body::kNone, get_stream, kByMethod, kOften, "attributes viewer"},
    Route{kGet, "/v1/sessions/{id}/events", Body::kNone, get_events, kByMethod, kOften, "viewer"},
};
/// The viewer's files answer for every other path that is in their table.
constexpr Route kAssetRoute{kGet, "/{asset}", Body::kNone, get_asset, kOpen};

bool fits(std::string_view placeholder, std::string_view text) {
  if (placeholder == "{id}") return protocol::is_valid_id(text);
  if (placeholder == "{region}")
    return protocol::region_of_name(text).has_value() || protocol::is_valid_region_name(text);
  if (placeholder == "{edit}")
    return !text.empty() && text.size() <= 9 &&
           text.find_first_not_of("0123456789") == std::string_view::npos;
  if (placeholder == "{file}")
    return !text.empty() && text.size() <= 64 && text.front() != '.' &&
           std::all_of(text.begin(), text.end(), [](char c) {
             return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
           });
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
      return {
          .kind = route.body, .max_bytes = limits.max_upload_bytes, .max_json_bytes = limits.max_json_bytes};
    case Body::kUpload:
      return {.kind = route.body, .max_bytes = limits.max_upload_file_bytes};
    case Body::kImage:
      return {.kind = route.body, .max_bytes = limits.max_image_file_bytes};
  }
  return {};
}

/// Whether there is room for what the body of an upload is to become, before it is read. A request that comes
/// once more gets the answer that it got, whatever there is room for now.
Outcome<Done> admit_upload(Service& service, const BodyPolicy& policy, const RequestHead& head,
                           const Caller& caller) {
  const auto key = head.header("idempotency-key");
  if (key && service.answers.has(caller.key_owner(), std::string(*key))) return Done{};
  if (key && service.imports.has_begun(caller.token, std::string(*key))) return Done{};
  const bool is_cloud = policy.kind == Body::kCloud;
  if (auto room = is_cloud ? service.clouds.check_room() : service.images.check_room(); !room.ok())
    return room;
  return service.access.check(caller, {{Quota::kStoredBytes, head.content_length.value_or(0)},
                                       {is_cloud ? Quota::kClouds : Quota::kImages, 1}});
}

/// Where the bytes of a body are held from as they arrive. Documents have a reserve of their own, so that no
/// upload keeps a hand waiting. A body for which there is no room now is refused before it is read; one over
/// its limit is let through: the fence refuses it.
Outcome<Budget*> admit_body(Service& service, const BodyPolicy& policy, const RequestHead& head,
                            const Caller& caller) {
  const bool is_upload = policy.kind == Body::kCloud || policy.kind == Body::kImage;
  Budget& memory = is_upload ? service.upload_memory : service.json_memory;
  const std::uint64_t length = head.content_length.value_or(0);
  if (length > policy.max_bytes) return &memory;
  if (is_upload)
    if (auto admitted = admit_upload(service, policy, head, caller); !admitted.ok())
      return admitted.problem();
  const std::uint64_t held = memory.held();
  if (length > memory.total() - held)
    return Problem{.kind = ProblemKind::kOverloaded,
                   .detail = "other requests take the memory for bodies",
                   .limit = static_cast<double>(memory.total()),
                   .actual = static_cast<double>(held + length)};
  return &memory;
}

/// Why the caller may not use the row at all.
std::optional<Problem> check_permission(const Route& route, const Caller& caller) {
  Scope needed = changes_state(route.method) ? Scope::kEdit : Scope::kView;
  if (route.permission == kOwner) needed = Scope::kEdit;
  if (route.permission == kAdmin) needed = Scope::kAdmin;
  const bool no_guests =
      route.permission == kNoGuests || route.permission == kOwner || route.permission == kAdmin;
  if (caller.session && no_guests)
    return Problem{.kind = ProblemKind::kForbidden, .detail = "a share link does not permit this"};
  if (!caller.may(needed))
    return Problem{.kind = ProblemKind::kForbidden,
                   .detail = std::string("this takes a token with the scope ")
                                 .append(protocol::scope_name(needed))
                                 .append("; this one has ")
                                 .append(protocol::scope_name(caller.scope))};
  return std::nullopt;
}

/// Why the caller gets nothing of what the path names: it is not there, or not for this caller. Both read the
/// same, on every route and before any byte of a body is read.
std::optional<Problem> check_sight(Service& service, const Route& route,
                                   const std::vector<std::string>& captures, const Caller& caller) {
  const auto is_below = [&](std::string_view prefix) {
    return route.pattern.substr(0, prefix.size()) == prefix;
  };
  const auto missing = [](const char* detail) {
    return Problem{.kind = ProblemKind::kNotFound, .detail = detail};
  };
  std::string owner;
  if (is_below("/v1/sessions/{id}")) {
    auto found = service.sessions.owner_of(captures.front());  // wakes nobody
    if (!found || !caller.may_see_session(*found, captures.front()))
      return missing("there is no such session");
    owner = std::move(*found);
  } else if (is_below("/v1/clouds/{id}")) {
    const SharedCloud cloud = service.clouds.find(captures.front());
    if (cloud == nullptr || !caller.may_see(cloud->owner)) return missing("there is no such cloud");
    owner = cloud->owner;
  } else if (is_below("/v1/imports/{id}")) {
    auto found = service.imports.owner_of(captures.front());
    if (!found || !caller.may_see(*found)) return missing("there is no such import");
    owner = std::move(*found);
  } else if (is_below("/v1/jobs/{id}")) {
    auto found = service.jobs.owner_of(captures.front());
    if (!found || !caller.may_see(*found)) return missing("there is no such job");
    owner = std::move(*found);
  } else if (is_below("/v1/images/{id}")) {
    const SharedImage image = service.images.find(captures.front());
    if (image == nullptr || !caller.may_see(image->owner)) return missing("there is no such image");
    owner = image->owner;
  } else if (is_below("/v1/uploads/{id}")) {
    const auto upload = service.uploads.find(captures.front());
    if (!upload || !caller.may_see(upload->record.owner)) return missing("there is no such upload");
    owner = upload->record.owner;
  } else {
    return std::nullopt;
  }
  if (changes_state(route.method) && !caller.may_change(owner))
    return Problem{.kind = ProblemKind::kForbidden,
                   .detail = "this belongs to all; only an admin changes it"};
  return std::nullopt;
}

/// Who asks, after everything that speaks against answering. A session that the caller may not see does not
/// exist for it, so that is said before what the scope forbids.
Outcome<Caller> admit_caller(Service& service, const Route& route, const RequestHead& head,
                             const std::vector<std::string>& captures) {
  if (route.permission == kOpen) return Caller{.scope = Scope::kView};
  auto caller = service.access.identify(head);
  if (!caller.ok()) return caller;
  if (auto charged = service.access.charge_request(caller.value()); !charged.ok()) return charged.problem();
  if (auto problem = check_sight(service, route, captures, caller.value())) return std::move(*problem);
  if (auto problem = check_permission(route, caller.value())) return std::move(*problem);
  return caller;
}

Resolution endpoint_of(Service& service, const Route& route, std::vector<std::string> captures,
                       const RequestHead& head, const std::string& request_id) {
  // Before anything is looked for: what is not known yet must not read as missing.
  const bool tells_state = route.handler == get_health || route.handler == get_readiness;
  if (!service.is_ready && !tells_state)
    return problem_response({.kind = ProblemKind::kOverloaded, .detail = "the server is starting"}, head.path,
                            request_id);
  auto caller = admit_caller(service, route, head, captures);
  if (!caller.ok()) return problem_response(caller.problem(), head.path, request_id);
  const bool is_upload = is_upload_path(head.path);
  if (route.permission != kOpen)
    if (const auto known = check_query(head, route.query); !known.ok()) {
      Response refusal = problem_response(known.problem(), head.path, request_id);
      return is_upload ? with_tus_headers(service, std::move(refusal), true) : refusal;
    }
  if (is_upload)
    if (const auto problem = check_tus(head))
      return with_tus_headers(service, problem_response(*problem, head.path, request_id), true);
  Endpoint endpoint{
      .body = policy_of(route, service.config.limits),
      .route = std::string(route.pattern),
      .captures = std::move(captures),
      .handle = [&service, handler = route.handler](const Request& r) { return handler(service, r); }};
  if (route.once)
    endpoint.handle = [&service, handler = route.handler](const Request& r) {
      return answer_once(service, r, handler);
    };
  if (route.body == Body::kUpload) {
    // These bodies go to the disk: they need no memory.
    const auto open = route.method == kPost ? open_new_upload : open_upload;
    endpoint.open_target = [&service, open](const Request& r) { return open(service, r); };
  } else if (route.body != Body::kNone) {
    auto admitted = admit_body(service, endpoint.body, head, caller.value());
    if (!admitted.ok()) return problem_response(admitted.problem(), head.path, request_id);
    endpoint.body_memory = admitted.value();
    if (endpoint.body_memory == &service.upload_memory)
      endpoint.charge = [&service, who = caller.value(), bytes = head.content_length.value_or(0)] {
        return service.access.charge_upload(who, bytes);
      };
  }
  endpoint.caller = std::move(caller.value());
  return endpoint;
}

}  // namespace

std::span<const Route> all_routes() {
  return kRoutes;
}

std::vector<std::string> route_names() {
  std::vector<std::string> names;
  const auto add = [&](const Route& route) {
    names.push_back(std::string(method_name(route.method)).append(" ").append(route.pattern));
  };
  for (const Route& route : kRoutes) add(route);
  add(kAssetRoute);
  return names;
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
  if (head.method == kOptions) {
    Response response{.status = 204};
    response.with_header("Allow", allowed + ", OPTIONS");
    return is_upload_path(head.path) ? with_tus_headers(service, std::move(response), true) : response;
  }
  return problem_response(
             {.kind = ProblemKind::kMethodNotAllowed, .detail = "this resource takes " + allowed}, head.path,
             request_id)
      .with_header("Allow", allowed + ", OPTIONS");
}

}  // namespace pointwright::server
