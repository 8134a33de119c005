#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/execution_context.h"
#include "engine/io/cloud_io.h"
#include "server/handlers/cloud_file.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

std::string content_tag(const protocol::CloudDocument& cloud) {
  return etag_of({cloud.sha256});
}

Outcome<ImportRequest> import_request(const RequestHead& head) {
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

/// A complete upload that is to be a cloud.
struct LeasedUpload {
  std::shared_ptr<UploadStore::Lease> lease;
  ImportRequest import;
};
/// The upload that the request's document names.
Outcome<LeasedUpload> lease_upload(Service& service, const Request& request) {
  if (auto known = check_query(request.head, ""); !known.ok()) return known.problem();
  const auto asked = parsed_body(service, request, protocol::parse_import_cloud);
  if (!asked.ok()) return asked.problem();
  const auto upload = service.uploads.find(asked.value().upload);
  // Nothing of what belongs to another is told or held, not for a moment.
  const bool is_there = upload && request.caller.may_see(upload->record.owner);
  auto lease = service.uploads.lease(is_there ? asked.value().upload : std::string());
  if (!lease.ok()) {
    Problem problem = lease.problem();
    if (problem.kind == ProblemKind::kNotFound) {
      problem.kind = ProblemKind::kInvalidValue;
      problem.errors = {{.pointer = "/upload", .detail = "there is no such upload"}};
    }
    return problem;
  }
  const UploadRecord& record = lease.value()->record();
  auto quota =
      service.access.hold(request.caller, {{Quota::kStoredBytes, record.length}, {Quota::kClouds, 1}});
  if (!quota.ok()) return quota.problem();
  ImportRequest import{
      .name = asked.value().name.value_or(protocol::is_valid_name(record.name) ? record.name : "cloud"),
      .drop_non_finite = asked.value().drop_non_finite,
      .format = asked.value().format,
      .owner = request.caller.token,
      .quota = std::move(quota.value())};
  if (auto room = service.clouds.check_room(); !room.ok()) return room.problem();
  return LeasedUpload{.lease = std::move(lease.value()), .import = std::move(import)};
}

/// Imports the upload; it is removed where that succeeds.
Outcome<SharedCloud> import_upload(Service& service, LeasedUpload& upload,
                                   const Seal<protocol::CloudDocument>& seal,
                                   const ExecutionContext* context) {
  const UploadRecord record = upload.lease->record();
  auto cloud = import_cloud(service.clouds, service.decode_file, service.decode, service.background,
                            service.config.limits, {upload.lease->file(), record.length}, upload.import, seal,
                            context);
  upload.lease.reset();
  // The cloud has all of it; where another request was quicker, it is gone already.
  if (cloud.ok()) static_cast<void>(service.uploads.remove(record.id).ok());
  return cloud;
}

Outcome<ImportRequest> body_import(Service& service, const Request& request) {
  auto import = import_request(request.head);
  if (!import.ok()) return import.problem();
  auto quota =
      service.access.hold(request.caller, {{Quota::kStoredBytes, request.body.size()}, {Quota::kClouds, 1}});
  if (!quota.ok()) return quota.problem();
  import.value().owner = request.caller.token;
  import.value().quota = std::move(quota.value());
  return import;
}

bool names_upload(const RequestHead& head) {
  return head.media_type() == "application/json";
}

/// Waits for it.
Outcome<SharedCloud> import_now(Service& service, const Request& request,
                                const Seal<protocol::CloudDocument>& seal) {
  if (names_upload(request.head)) {
    auto upload = lease_upload(service, request);
    if (!upload.ok()) return upload.problem();
    return import_upload(service, upload.value(), seal, nullptr);
  }
  const auto import = body_import(service, request);
  if (!import.ok()) return import.problem();
  return import_cloud(service.clouds, service.decode, service.background, service.config.limits,
                      request.body_bytes(), import.value(), seal);
}

/// An import ends with the process: so does what is known of the request that has begun it.
std::string import_key(const Request& request) {
  return request.keyed == nullptr ? std::string() : request.keyed->key + "\n" + request.keyed->fingerprint;
}

/// Leaves it to the imports, with all that it needs.
Outcome<protocol::ImportDocument> import_later(Service& service, const Request& request) {
  if (auto begun = service.imports.find_key(request.caller.token, import_key(request)))
    return std::move(*begun);
  if (names_upload(request.head)) {
    auto upload = lease_upload(service, request);
    if (!upload.ok()) return upload.problem();
    const auto held = std::make_shared<LeasedUpload>(std::move(upload.value()));
    return service.imports.start({.name = held->import.name,
                                  .bytes = held->lease->record().length,
                                  .owner = request.caller.token,
                                  .key = import_key(request)},
                                 [&service, held](const ExecutionContext& context) {
                                   return import_upload(service, *held, {}, &context);
                                 });
  }
  const auto import = body_import(service, request);
  if (!import.ok()) return import.problem();
  if (request.body.empty())
    return Problem{.kind = ProblemKind::kEmptyBody, .detail = "the upload has no bytes"};
  struct Body {
    std::string bytes;
    std::vector<std::shared_ptr<void>> memory;
  };
  const auto body =
      std::make_shared<const Body>(Body{std::move(request.body), std::move(request.body_memory)});
  return service.imports.start(
      {.name = import.value().name,
       .bytes = body->bytes.size(),
       .owner = request.caller.token,
       .key = import_key(request)},
      [&service, body, import = import.value()](const ExecutionContext& context) {
        return import_cloud(service.clouds, service.decode, service.background, service.config.limits,
                            std::as_bytes(std::span(body->bytes.data(), body->bytes.size())), import, {},
                            &context);
      });
}

}  // namespace

Response list_clouds(Service& service, const Request& request) {
  std::vector<protocol::CloudDocument> documents;
  for (const SharedCloud& cloud : service.clouds.list())
    if (request.caller.may_see(cloud->owner)) documents.push_back(cloud->document);
  return json_response(protocol::cloud_list(documents));
}

Response upload_cloud(Service& service, const Request& request) {
  if (prefers(request.head, "respond-async")) {
    const auto import = import_later(service, request);
    if (!import.ok()) return problem_response(import.problem(), request);
    if (request.keyed != nullptr) request.keyed->is_passing = true;
    return json_response(protocol::to_json(import.value()), 202)
        .with_header("Location", "/v1/imports/" + import.value().id)
        .with_header("Preference-Applied", "respond-async");
  }
  const auto begin = std::chrono::steady_clock::now();
  const auto answer = [](const protocol::CloudDocument& document) {
    return json_response(protocol::to_json(document), 201)
        .with_header("Location", "/v1/clouds/" + document.id)
        .with_header("ETag", content_tag(document));
  };
  const auto seal = sealed<protocol::CloudDocument>(request, answer);
  const auto cloud = import_now(service, request, seal);
  if (!cloud.ok()) return problem_response(cloud.problem(), request);
  Response response = answer_of(request, cloud.value()->document, answer);
  response.timings.emplace_back(
      "decode", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response;
}

Response get_cloud(Service& service, const Request& request) {
  const SharedCloud cloud = service.clouds.find(request.captures.at(0));
  if (cloud == nullptr) return not_found("there is no such cloud", request);
  const std::string etag = content_tag(cloud->document);
  if (is_unchanged(request.head, etag)) return not_modified(etag);
  return json_response(protocol::to_json(cloud->document)).with_header("ETag", etag);
}

Response get_cloud_data(Service& service, const Request& request) {
  const SharedCloud cloud = service.clouds.find(request.captures.at(0));
  if (cloud == nullptr) return not_found("there is no such cloud", request);
  const auto format = negotiated_format(request.head, cloud_file_formats());
  if (!format.ok()) return problem_response(format.problem(), request);
  const auto options = query_file_options(request.head, format.value());
  if (!options.ok()) return problem_response(options.problem(), request);
  const std::string etag = etag_of({cloud->document.sha256, format.value().name, options.value().tag()});
  if (is_unchanged(request.head, etag)) return not_modified(etag);
  const auto samples = service.clouds.samples_of(*cloud);
  if (!samples.ok()) return problem_response(samples.problem(), request);
  return cloud_file_response(service, request, [&] { return samples.value(); }, memory_of(*samples.value()),
                             {.format = format.value(),
                              .name = cloud->document.name,
                              .etag = etag,
                              .options = options.value(),
                              .grid = cloud->document.report.grid});
}

Response delete_cloud(Service& service, const Request& request) {
  if (auto removed = service.clouds.remove(request.captures.at(0)); !removed.ok())
    return problem_response(removed.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
