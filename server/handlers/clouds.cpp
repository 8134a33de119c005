#include "engine/io/cloud_io.h"
#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

Response not_found(const Request& request) {
  return problem_response({.kind = ProblemKind::kNotFound, .detail = "there is no such cloud"}, request);
}

std::string content_tag(const StoredCloud& cloud) {
  return etag_of({cloud.document.sha256});
}

Outcome<ImportRequest> import_request(const RequestHead& head) {
  if (auto known = check_query(head, {"name", "nonfinite"}); !known.ok()) return known.problem();
  ImportRequest import{.name = query_value(head, "name").value_or("cloud"), .media_type = head.media_type()};
  if (!protocol::is_valid_name(import.name))
    return Problem{
        .kind = ProblemKind::kInvalidValue,
        .detail = "a name has 1 to 120 bytes of UTF-8 without control characters",
        .errors = {{.pointer = "?name", .detail = "1 to 120 bytes of UTF-8 without control characters"}}};
  if (const auto policy = query_value(head, "nonfinite")) {
    if (*policy != "drop" && *policy != "reject")
      return Problem{.kind = ProblemKind::kInvalidValue,
                     .detail = "nonfinite is drop or reject",
                     .errors = {{.pointer = "?nonfinite", .detail = "drop or reject"}}};
    import.drop_non_finite = *policy == "drop";
  }
  return import;
}

}  // namespace

Response list_clouds(Service& service, const Request&) {
  std::vector<protocol::CloudDocument> documents;
  for (const SharedCloud& cloud : service.clouds.list()) documents.push_back(cloud->document);
  return json_response(protocol::cloud_list(documents));
}

Response upload_cloud(Service& service, const Request& request) {
  const auto import = import_request(request.head);
  if (!import.ok()) return problem_response(import.problem(), request);
  const auto begin = std::chrono::steady_clock::now();
  const auto cloud = import_cloud(service.clouds, service.decode, service.background, service.config.limits,
                                  request.body_bytes(), import.value());
  if (!cloud.ok()) return problem_response(cloud.problem(), request);
  Response response = json_response(protocol::to_json(cloud.value()->document), 201);
  response.timings.emplace_back(
      "decode", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response.with_header("Location", "/v1/clouds/" + cloud.value()->document.id)
      .with_header("ETag", content_tag(*cloud.value()));
}

Response get_cloud(Service& service, const Request& request) {
  const SharedCloud cloud = service.clouds.find(request.captures.at(0));
  if (cloud == nullptr) return not_found(request);
  if (is_unchanged(request.head, content_tag(*cloud))) return not_modified(content_tag(*cloud));
  return json_response(protocol::to_json(cloud->document)).with_header("ETag", content_tag(*cloud));
}

Response get_cloud_data(Service& service, const Request& request) {
  const SharedCloud cloud = service.clouds.find(request.captures.at(0));
  if (cloud == nullptr) return not_found(request);
  if (auto known = check_query(request.head, {"format"}); !known.ok())
    return problem_response(known.problem(), request);
  const auto format = negotiated_format(request.head, cloud_file_formats());
  if (!format.ok()) return problem_response(format.problem(), request);
  const std::string etag = etag_of({cloud->document.sha256, format.value().name});
  if (is_unchanged(request.head, etag)) return not_modified(etag);
  return cloud_file_response(service, request, [&cloud] { return cloud->cloud; }, memory_of(*cloud->cloud),
                             {.format = format.value(), .name = cloud->document.name, .etag = etag});
}

Response delete_cloud(Service& service, const Request& request) {
  if (auto removed = service.clouds.remove(request.captures.at(0)); !removed.ok())
    return problem_response(removed.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
