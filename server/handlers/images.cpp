#include "server/base/sha256.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

constexpr std::string_view kMediaType = "image/png";

std::string content_tag(const StoredImage& image) {
  return etag_of({image.sha256});
}

}  // namespace

Response list_images(Service& service, const Request& request) {
  std::vector<protocol::ImageDocument> documents;
  for (const SharedImage& image : service.images.list())
    if (request.caller.may_see(image->owner)) documents.push_back(image->document);
  return json_response(protocol::image_list(documents));
}

Response upload_image(Service& service, const Request& request) {
  auto quota =
      service.access.hold(request.caller, {{Quota::kStoredBytes, request.body.size()}, {Quota::kImages, 1}});
  if (!quota.ok()) return problem_response(quota.problem(), request);
  const auto begin = std::chrono::steady_clock::now();
  const auto answer = [sha256 = sha256_hex(request.body_bytes())](const protocol::ImageDocument& document) {
    return json_response(protocol::to_json(document), 201)
        .with_header("Location", "/v1/images/" + document.id)
        .with_header("ETag", etag_of({sha256}));
  };
  const auto image =
      service.images.add(service.decode_image, request.body_bytes(), request.caller.token,
                         std::move(quota.value()), sealed<protocol::ImageDocument>(request, answer));
  if (!image.ok()) return problem_response(image.problem(), request);
  Response response = answer_of(request, image.value()->document, answer);
  response.timings.emplace_back(
      "decode", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  return response;
}

Response get_image(Service& service, const Request& request) {
  const SharedImage image = service.images.find(request.captures.at(0));
  if (image == nullptr) return not_found("there is no such image", request);
  if (is_unchanged(request.head, content_tag(*image))) return not_modified(content_tag(*image));
  return json_response(protocol::to_json(image->document)).with_header("ETag", content_tag(*image));
}

Response get_image_data(Service& service, const Request& request) {
  const SharedImage image = service.images.find(request.captures.at(0));
  if (image == nullptr) return not_found("there is no such image", request);
  const std::string etag = etag_of({image->sha256, "data"});
  if (is_unchanged(request.head, etag)) return not_modified(etag);
  const auto content = service.images.content_of(service.decode_image, *image);
  if (!content.ok()) return problem_response(content.problem(), request);
  const std::string& file = content.value()->file;
  Response response{.content_type = std::string(kMediaType),
                    .body = SharedBytes{.owner = content.value(),
                                        .bytes = std::as_bytes(std::span(file.data(), file.size()))}};
  return response.with_header("ETag", etag);
}

Response delete_image(Service& service, const Request& request) {
  if (auto removed = service.images.remove(request.captures.at(0)); !removed.ok())
    return problem_response(removed.problem(), request);
  return {.status = 204};
}

}  // namespace pointwright::server
