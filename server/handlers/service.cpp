#include "server/handlers/service.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "server/base/sha256.h"

namespace pointwright::server {
namespace {

std::size_t pool_threads(const Config& config) {
  const std::size_t machine = config.threads > 0 ? config.threads : std::thread::hardware_concurrency();
  return std::max<std::size_t>(machine, 2);
}

/// The program that does jobs: the one of the settings, or the one that is installed with the daemon.
std::string worker_program(const Config& config) {
  if (!config.worker.empty()) return std::filesystem::absolute(config.worker).string();
  std::error_code none;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", none);
  return (self.parent_path() / "pointwright").string();
}

}  // namespace

Service::Service(Config settings, ServiceParts parts)
    : config(std::move(settings)),
      folder(config.data),
      database(folder.lasts() ? folder.database() : std::string()),
      archive(folder.lasts() ? std::make_unique<Archive>(folder, database) : nullptr),
      kept_shares(folder.lasts() ? std::make_unique<ShareArchive>(database) : nullptr),
      answers(database, config.limits.max_kept_answers),
      decode(std::move(parts.decode)),
      decode_image(std::move(parts.decode_image)),
      decode_file(std::move(parts.decode_file)),
      assets(std::move(parts.assets)),
      metrics(parts.routes),
      interactive(pool_threads(config), static_cast<int>(config.threads), parts.report_failure),
      background(std::max<std::size_t>(pool_threads(config) / 2, 2), static_cast<int>(config.threads),
                 parts.report_failure),
      access(config.limits, token_file(config), kept_shares.get()),
      clouds(config.limits, archive.get(), cloud_loader(decode_file, decode, background, config.limits)),
      images(config.limits, archive.get()),
      uploads(config.limits, folder.uploads(),
              [this](int file) { return archive != nullptr && archive->has_file(file); }),
      sessions(
          config.limits, clouds,
          {.interactive = interactive,
           .background = background,
           .build = std::move(parts.build),
           .resample = std::move(parts.resample),
           .note_time = [this](const std::string& step, double ms) { metrics.add_time(step, ms / 1e3); }},
          archive.get(), [this](const std::string& session) { access.shares.forget(session); }),
      upload_memory(config.limits.max_upload_memory),
      json_memory(config.limits.max_json_memory),
      answer_memory(config.limits.max_answer_memory),
      streams(config.limits.max_streams),
      imports(config.limits, parts.report_failure),
      jobs({.folder = folder.jobs(),
            .worker = worker_program(config),
            .launchers = config.launchers,
            .threads = config.threads,
            .limits = config.limits},
           database, parts.report_failure),
      is_ready(archive == nullptr) {}

std::vector<std::string> Service::recover() {
  std::vector<std::string> notes;
  if (archive == nullptr) return notes;
  if (!database.is_sound()) notes.emplace_back("the database is damaged: what cannot be read is not served");
  try {
    std::size_t damaged = 0;
    auto kept_clouds = archive->clouds(damaged);
    for (KeptCloud& cloud : kept_clouds)
      cloud.quota =
          access.hold_again(cloud.owner, {{Quota::kStoredBytes, cloud.document.bytes}, {Quota::kClouds, 1}});
    clouds.restore(std::move(kept_clouds));
    auto kept_images = archive->images(damaged);
    for (KeptImage& image : kept_images)
      image.quota =
          access.hold_again(image.owner, {{Quota::kStoredBytes, image.document.bytes}, {Quota::kImages, 1}});
    images.restore(std::move(kept_images));
    if (damaged > 0)
      notes.push_back(std::to_string(damaged) +
                      " clouds or images are damaged and not served; no file is deleted");
    auto kept = archive->sessions();
    for (KeptSession& session : kept)
      session.quota =
          access.hold_again(session.owner, {{Quota::kSessions, 1}, {Quota::kSamples, session.samples}});
    for (const KeptSession& session : kept)
      if (session.damage) notes.push_back("session " + session.id + " is not served: " + *session.damage);
    sessions.restore(std::move(kept));
    std::size_t damaged_shares = 0;
    access.shares.restore(kept_shares->shares(damaged_shares));
    if (damaged_shares > 0)
      notes.push_back(std::to_string(damaged_shares) + " share links are damaged and open nothing");
    if (damaged == 0) archive->sweep();
    const auto hold = [this](KeptJob& job) {
      if (!job.document.has_ended()) job.quota = access.hold_again(job.owner, {{Quota::kJobs, 1}});
      job.stored = access.hold_again(job.owner, {{Quota::kStoredBytes, job.bytes}});
    };
    for (std::string& note : jobs.recover(hold)) notes.push_back(std::move(note));
  } catch (const DatabaseError& error) {
    throw std::runtime_error(std::string("the database cannot be read: ") + error.what());
  }
  is_ready = true;
  return notes;
}

KeptAnswer kept_answer(const KeyedRequest& keyed, const Response& response) {
  return {.caller = keyed.caller,
          .key = keyed.key,
          .fingerprint = keyed.fingerprint,
          .status = response.status,
          .content_type = response.content_type,
          .headers = response.headers,
          .body = std::get<std::string>(response.body)};
}

Response answer_once(Service& service, const Request& request, Handler handler) {
  constexpr std::size_t kMostBytes = 255;
  const auto key = request.head.header("idempotency-key");
  if (!key) return handler(service, request);
  const bool is_plain = !key->empty() && key->size() <= kMostBytes &&
                        std::all_of(key->begin(), key->end(), [](char c) { return c > ' ' && c <= '~'; });
  if (!is_plain)
    return problem_response(malformed_request("an Idempotency-Key has 1 to 255 visible ASCII characters"),
                            request);
  std::string asked = std::string(method_name(request.head.method)) + "\n" + request.head.path + "\n";
  for (const auto& [name, value] : request.head.query) asked += name + "=" + value + "\n";
  // What it asks for is not in the body alone.
  for (const char* const name : {"content-type", "prefer"})
    asked += std::string(request.head.header(name).value_or("")) + "\n";
  asked += sha256_hex(request.body_bytes());
  request.keyed = std::make_shared<KeyedRequest>(
      KeyedRequest{.caller = request.caller.key_owner(),
                   .key = std::string(*key),
                   .fingerprint = sha256_hex(std::as_bytes(std::span(asked.data(), asked.size())))});
  auto claim = service.answers.claim(request.keyed->caller, request.keyed->key, request.keyed->fingerprint);
  if (!claim.ok()) return problem_response(claim.problem(), request);
  if (auto* kept = std::get_if<KeptAnswer>(&claim.value()))
    return Response{.status = kept->status,
                    .content_type = std::move(kept->content_type),
                    .headers = std::move(kept->headers),
                    .body = std::move(kept->body)}
        .with_header("Idempotency-Replayed", "true");
  Response response = handler(service, request);
  // Where the effect was none, or does not last either, the answer is kept by itself.
  const bool is_kept = request.keyed->is_passing || (request.keyed->answer && service.archive != nullptr);
  if (response.status < 300 && !is_kept)
    if (auto kept = service.answers.put(kept_answer(*request.keyed, response)); !kept.ok())
      return problem_response(kept.problem(), request);
  return response;
}

Response json_response(const protocol::JsonDocument& document, int status) {
  return {.status = status,
          .content_type = "application/json; charset=utf-8",
          .body = protocol::to_text(document)};
}

Outcome<std::shared_ptr<Session>> session_of(Service& service, const Request& request) {
  return session_of(service, request.captures.at(0));
}

Outcome<std::shared_ptr<Session>> session_of(Service& service, const std::string& id) {
  auto session = service.sessions.get(id);
  if (session.ok() && session.value()->is_waking())
    session.value()->wait_until_built(std::chrono::steady_clock::now() +
                                      std::chrono::milliseconds(service.config.limits.wake_wait_ms));
  return session;
}

std::string revision_tag(std::uint64_t revision) {
  return std::string("\"r").append(std::to_string(revision)).append("\"");
}

Outcome<Session::Expected> expected_revision(const RequestHead& head) {
  const auto header = head.header("if-match");
  if (!header || *header == "*") return Session::Expected();
  std::uint64_t revision = 0;
  const bool quoted =
      header->size() > 3 && header->size() < 22 && header->substr(0, 2) == "\"r" && header->back() == '"';
  const char* const end = header->data() + header->size() - 1;
  if (quoted) {
    const auto [stop, error] = std::from_chars(header->data() + 2, end, revision);
    if (error == std::errc{} && stop == end) return Session::Expected(revision);
  }
  return malformed_request("If-Match must be one strong tag \"r<n>\", or *");
}

Outcome<Session::Expected> required_revision(const RequestHead& head) {
  if (head.header("if-match")) return expected_revision(head);
  return Problem{.kind = ProblemKind::kRevisionRequired,
                 .detail = "name the revision to build on: If-Match: \"r<n>\""};
}

protocol::ParseLimits json_limits(const Service& service) {
  return {.max_bytes = static_cast<std::size_t>(service.config.limits.max_json_bytes),
          .max_depth = static_cast<std::size_t>(service.config.limits.max_json_depth)};
}

protocol::ParseLimits large_limits(const Service& service) {
  // Most of a recipe are numbers with many digits: this is more values than any such text holds, and in
  // proportion to its bytes no more than an ordinary document may have.
  constexpr std::uint64_t kBytesPerValue = 8;
  protocol::ParseLimits limits = json_limits(service);
  limits.max_bytes = static_cast<std::size_t>(service.config.limits.max_recipe_bytes);
  limits.max_values = std::max(limits.max_values, limits.max_bytes / kBytesPerValue);
  return limits;
}

Response session_response(const Session& session, const Document& document, int status) {
  return json_response(protocol::to_json(session.describe(document)), status)
      .with_header("ETag", revision_tag(document.revision));
}

}  // namespace pointwright::server
