#pragma once
// What the handlers work on. Handlers are free functions: request in, response out, no HTTP library, no
// sockets.

#include <atomic>
#include <functional>
#include <string>

#include "server/base/budget.h"
#include "server/config/config.h"
#include "server/http/message.h"
#include "server/http/problem_response.h"
#include "server/sessions/compute_pool.h"
#include "server/store/assets.h"
#include "server/store/cloud_store.h"
#include "server/store/image_store.h"
#include "server/store/importer.h"
#include "server/store/session_store.h"

namespace pointwright::server {

/// The parts of the daemon that a test may replace.
struct ServiceParts {
  Decoder decode;
  ImageDecoder decode_image;
  HierarchyBuilder build;
  Resampler resample;
  AssetTable assets;
  std::function<void(const std::string&)> report_failure = {};  ///< of tasks that nobody waits for
};

/// Everything that lives as long as the daemon does. Members are thread-safe.
class Service {
 public:
  Service(Config config, ServiceParts parts);

  const Config config;
  const Decoder decode;
  const ImageDecoder decode_image;
  const AssetTable assets;
  // Builders post to strands of the interactive pool: it must outlive the background one.
  ComputePool interactive;  ///< what a hand waits for: painting, previews, edits
  ComputePool background;   ///< what lasts for seconds: building, exporting
  CloudStore clouds;
  ImageStore images;
  SessionStore sessions;
  Budget upload_memory;  ///< of clouds and images that are received or decoded
  Budget json_memory;    ///< of documents
  Budget answer_memory;  ///< of files and frames on their way out
  Budget streams;
  std::atomic<bool> stopping{false};
};

using Handler = Response (*)(Service&, const Request&);

/// 200 with a document.
Response json_response(const protocol::JsonDocument& document, int status = 200);

/// The session that the first capture names; a problem where there is none.
Outcome<std::shared_ptr<Session>> session_of(Service& service, const Request& request);

/// The revision that If-Match names: "r<number>"; none where it is absent or *.
Outcome<Session::Expected> expected_revision(const RequestHead& head);

/// The same where the change must name a revision. Problem besides: revision required
Outcome<Session::Expected> required_revision(const RequestHead& head);

/// The session document with its ETag.
Response session_response(const Session& session, const Document& document, int status = 200);
std::string revision_tag(std::uint64_t revision);

/// What parsers accept of an ordinary document; of a recipe or a whole painting.
protocol::ParseLimits json_limits(const Service& service);
protocol::ParseLimits large_limits(const Service& service);

/// Parses the body with one of the protocol's parsers, within the limits.
template <typename T>
Outcome<T> parsed_body(const Request& request, protocol::Parsed<T> (*parse)(const protocol::Json&),
                       const protocol::ParseLimits& limits) {
  if (request.body.empty())
    return Problem{.kind = ProblemKind::kEmptyBody, .detail = "this request needs a JSON body"};
  auto parsed = protocol::parse_body(request.body, limits, parse);
  if (!parsed) return protocol::to_problem(parsed.errors());
  return std::move(parsed).value();
}
template <typename T>
Outcome<T> parsed_body(const Service& service, const Request& request,
                       protocol::Parsed<T> (*parse)(const protocol::Json&)) {
  return parsed_body(request, parse, json_limits(service));
}

}  // namespace pointwright::server
