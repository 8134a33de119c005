#include "server/http/cors.h"

#include <algorithm>

namespace pointwright::server {
namespace {

/// The request's origin as the operator's list has it; null where it is not there.
const std::string* listed_origin(const RequestHead& head, const std::vector<std::string>& origins) {
  const auto origin = head.header("origin");
  if (!origin) return nullptr;
  const auto it = std::find(origins.begin(), origins.end(), *origin);
  return it == origins.end() ? nullptr : &*it;
}

}  // namespace

bool is_preflight(const RequestHead& head) {
  return head.method == Method::kOptions && head.header("origin") &&
         head.header("access-control-request-method");
}

Response preflight(const RequestHead& head, const std::vector<std::string>& origins) {
  Response response{.status = 204};
  if (listed_origin(head, origins) == nullptr) return response;
  return response.with_header("Access-Control-Allow-Methods", "GET, HEAD, POST, PUT, PATCH, DELETE")
      .with_header("Access-Control-Allow-Headers",
                   "Authorization, Content-Type, If-Match, If-None-Match, Idempotency-Key, X-Request-Id, "
                   "Last-Event-ID, Tus-Resumable, Upload-Length, Upload-Offset, Upload-Metadata, "
                   "Upload-Checksum, Upload-Defer-Length")
      .with_header("Access-Control-Max-Age", "600");
}

void allow_reading(Response& response, const RequestHead& head, const std::vector<std::string>& origins) {
  if (origins.empty()) return;
  const auto vary = std::find_if(response.headers.begin(), response.headers.end(),
                                 [](const NameValue& header) { return header.first == "Vary"; });
  if (vary == response.headers.end()) {
    response.with_header("Vary", "Origin");
  } else {
    vary->second += ", Origin";
  }
  const std::string* const origin = listed_origin(head, origins);
  if (origin == nullptr) return;
  response.with_header("Access-Control-Allow-Origin", *origin)
      .with_header("Access-Control-Expose-Headers",
                   "ETag, Location, Retry-After, Server-Timing, X-Request-Id, Content-Disposition, "
                   "WWW-Authenticate, Upload-Offset, Upload-Length, Upload-Expires, Tus-Resumable, "
                   "Tus-Version, Tus-Extension, Tus-Max-Size, Tus-Checksum-Algorithm");
}

}  // namespace pointwright::server
