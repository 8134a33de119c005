#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {

Response get_asset(Service& service, const Request& request) {
  const Asset* asset = service.assets.find(request.head.path);
  if (asset == nullptr) return not_found("there is no such page", request);
  // Files below /assets/ carry a hash in their names, so that they never change; pages are asked for anew.
  const bool is_hashed = request.head.path.rfind("/assets/", 0) == 0;
  const std::string caching = is_hashed ? "public, max-age=31536000, immutable" : "no-cache";
  if (is_unchanged(request.head, asset->etag))
    return not_modified(asset->etag).with_header("Cache-Control", caching);
  Response response{.content_type = asset->content_type, .body = asset->bytes};
  return response.with_header("ETag", asset->etag)
      .with_header("Cache-Control", caching)
      .with_header("Vary", "Accept");
}

}  // namespace pointwright::server
