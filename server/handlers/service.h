#pragma once
// What the handlers work on. Handlers are free functions: request in, response out, no HTTP library, no
// sockets.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/access/access.h"
#include "server/base/budget.h"
#include "server/config/config.h"
#include "server/http/message.h"
#include "server/http/problem_response.h"
#include "server/metrics/metrics.h"
#include "server/queue/job_queue.h"
#include "server/sessions/compute_pool.h"
#include "server/store/answers.h"
#include "server/store/archive.h"
#include "server/store/assets.h"
#include "server/store/cloud_store.h"
#include "server/store/data_folder.h"
#include "server/store/database.h"
#include "server/store/image_store.h"
#include "server/store/import_store.h"
#include "server/store/importer.h"
#include "server/store/session_store.h"
#include "server/store/share_archive.h"
#include "server/store/upload_store.h"

namespace pointwright::server {

/// The parts of the daemon that a test may replace.
struct ServiceParts {
  Decoder decode;
  ImageDecoder decode_image;
  HierarchyBuilder build;
  Resampler resample;
  AssetTable assets;
  std::function<void(const std::string&)> report_failure = {};  ///< of tasks that nobody waits for
  FileDecoder decode_file = {};          ///< null: whole files are read and given to `decode`
  std::vector<std::string> routes = {};  ///< "METHOD pattern" of all rows, to count requests by
};

/// Everything that lives as long as the daemon does. Members are thread-safe.
class Service {
 public:
  /// Throws std::runtime_error with a sentence where the data folder cannot be had.
  Service(Config config, ServiceParts parts);

  const Config config;
  const DataFolder folder;  ///< locked before anything else is made
  Database database;        ///< in memory where the folder does not last
  /// What outlives the process; null where nothing does.
  const std::unique_ptr<Archive> archive;
  const std::unique_ptr<ShareArchive> kept_shares;  ///< the same of share links
  Answers answers;
  const Decoder decode;
  const ImageDecoder decode_image;
  const FileDecoder decode_file;
  const AssetTable assets;
  Metrics metrics;  // sessions on the pools count in it: it must outlive them
  // Builders post to strands of the interactive pool: it must outlive the background one.
  ComputePool interactive;  ///< what a hand waits for: painting, previews, edits
  ComputePool background;   ///< what lasts for seconds: building, exporting
  Access access;            ///< who asks, and their quotas
  CloudStore clouds;
  ImageStore images;
  UploadStore uploads;
  SessionStore sessions;
  Budget upload_memory;  ///< of clouds and images that are received or decoded
  Budget json_memory;    ///< of documents
  Budget answer_memory;  ///< of files and frames on their way out
  Budget streams;
  ImportStore imports;  ///< they use all of the above
  JobQueue jobs;
  std::atomic<bool> stopping{false};
  std::function<std::size_t()> connections;  ///< how many are served; set before the first request
  std::atomic<bool> is_ready;                ///< clouds, images and sessions are known

  /// Finds what the process before has left: cleans up after it, and knows clouds, images and sessions from
  /// then on. Notes are for the log. Throws std::runtime_error where the database cannot be read.
  std::vector<std::string> recover();
};

using Handler = Response (*)(Service&, const Request&);

/// The answer as it is kept. Pre: its body is text.
KeptAnswer kept_answer(const KeyedRequest& keyed, const Response& response);

/// 200 with a document.
Response json_response(const protocol::JsonDocument& document, int status = 200);

/// The session that the first capture names; a problem where there is none. One that is brought back is
/// waited for, but not for ever.
Outcome<std::shared_ptr<Session>> session_of(Service& service, const Request& request);
/// The same by its id.
Outcome<std::shared_ptr<Session>> session_of(Service& service, const std::string& id);

/// How the answer to a request is kept together with its effect: `make` makes it. Empty where the request has
/// no Idempotency-Key.
template <typename T, typename Make>
Seal<T> sealed(const Request& request, Make make) {
  if (request.keyed == nullptr) return {};
  return [keyed = request.keyed, make](const T& result) {
    keyed->answer = make(result);
    return kept_answer(*keyed, *keyed->answer);
  };
}
/// The answer that was kept, or else the one that `make` makes.
template <typename T, typename Make>
Response answer_of(const Request& request, const T& result, Make make) {
  if (request.keyed != nullptr && request.keyed->answer) return *request.keyed->answer;
  return make(result);
}

/// Answers a request with an Idempotency-Key: once.
Response answer_once(Service& service, const Request& request, Handler handler);

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
