// Jobs: what they are made of is gathered here; the queue does the rest.

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/cloud_io.h"
#include "server/base/file_types.h"
#include "server/handlers/event_stream.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"
#include "server/handlers/shape_data.h"
#include "server/handlers/viewing.h"
#include "server/ingest/files.h"
#include "server/sessions/recipes.h"

namespace pointwright::server {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kLogPiece = std::size_t{1} << 20U;
constexpr std::size_t kFilePiece = std::size_t{1} << 18U;
/// What the names of a job's results begin with.
constexpr std::string_view kResultStem = "result";
constexpr std::chrono::milliseconds kPollInterval{200};

Problem invalid(const char* pointer, const std::string& detail) {
  return {.kind = ProblemKind::kInvalidValue,
          .detail = detail,
          .errors = {{.pointer = pointer, .detail = detail}}};
}

Outcome<Done> stored(const Result<void>& written) {
  if (written) return Done{};
  Problem problem{.kind = ProblemKind::kStorageFailed, .detail = "the job's files cannot be written"};
  if (written.error().code == ErrorCode::kTooLarge)
    problem = {.kind = ProblemKind::kOutOfDisk, .detail = "the disk is full; the job was not taken"};
  return problem;
}

Outcome<Done> write_text(const std::string& path, std::string_view text) {
  return stored(write_file_atomically(path, std::as_bytes(std::span(text.data(), text.size()))));
}

/// The open file once more under another name; a copy where the file system has no such thing.
Outcome<Done> link_file(int file, std::uint64_t size, const std::string& path) {
  const std::string open_name = "/proc/self/fd/" + std::to_string(file);
  if (::linkat(AT_FDCWD, open_name.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) == 0) return Done{};
  return stored(copy_file_atomically(path, file, size));
}

Outcome<Done> write_ply(const Cloud& cloud, const std::string& path) {
  const auto bytes = write_cloud(cloud, CloudFormat::kPly, {});
  if (!bytes) return protocol::to_problem(bytes.error());
  return stored(write_file_atomically(path, bytes.value()));
}

/// The scan of a job, held until it is in the job's folder.
struct Scan {
  SharedCloud cloud;
  std::shared_ptr<UploadStore::Lease> upload;
  CloudFormat format = CloudFormat::kPly;
};

Outcome<SharedCloud> cloud_of(Service& service, const Caller& caller, const std::string& id,
                              const char* pointer) {
  const SharedCloud cloud = service.clouds.find(id);
  if (cloud == nullptr || !caller.may_see(cloud->owner)) return invalid(pointer, "there is no such cloud");
  return cloud;
}

Outcome<Scan> scan_of_upload(Service& service, const Caller& caller, const std::string& id) {
  const auto upload = service.uploads.find(id);
  const bool is_there = upload && caller.may_see(upload->record.owner);
  auto lease = service.uploads.lease(is_there ? id : std::string());
  if (!lease.ok()) {
    if (lease.problem().kind != ProblemKind::kNotFound) return lease.problem();
    return invalid("/upload", "there is no such upload");
  }
  // Enough of a file to know its format by.
  std::vector<std::byte> start(std::min<std::uint64_t>(lease.value()->record().length, 1U << 20U));
  const ssize_t count = ::pread(lease.value()->file(), start.data(), start.size(), 0);
  if (count < 0)
    return Problem{.kind = ProblemKind::kInternalError, .detail = "the upload cannot be read from the disk"};
  start.resize(static_cast<std::size_t>(count));
  const auto format = detect_format(start);
  if (!format) return protocol::to_problem(format.error());
  return Scan{.cloud = nullptr, .upload = std::move(lease.value()), .format = format.value()};
}

Outcome<Scan> scan_of(Service& service, const Caller& caller, const protocol::JobTerms& terms) {
  if (!terms.upload.empty()) return scan_of_upload(service, caller, terms.upload);
  auto cloud = cloud_of(service, caller, terms.cloud, "/cloud");
  if (!cloud.ok()) return cloud.problem();
  return Scan{.cloud = cloud.value(), .upload = nullptr, .format = cloud.value()->document.report.format};
}

Outcome<Done> write_scan(Service& service, const Scan& scan, const std::string& path) {
  if (scan.upload != nullptr) return link_file(scan.upload->file(), scan.upload->record().length, path);
  if (service.archive == nullptr) {
    const auto samples = service.clouds.samples_of(*scan.cloud);
    return samples.ok() ? write_ply(*samples.value(), path) : samples.problem();
  }
  const auto file = service.archive->open_file(scan.cloud->document.sha256);
  if (!file.ok()) return file.problem();
  return link_file(file.value()->file.get(), file.value()->size, path);
}

/// A session's edits and the samples that they were made on.
struct SessionPart {
  std::shared_ptr<Session> session;
  std::string recipe;
};

Outcome<SessionPart> session_part(Service& service, const Caller& caller, const std::string& id) {
  const auto owner = service.sessions.owner_of(id);
  if (!owner || !caller.may_see_session(*owner, id)) return invalid("/session", "there is no such session");
  auto session = session_of(service, id);
  if (!session.ok()) return session.problem();
  auto exported = computed(service.background, [&] {
    return export_recipe(*session.value(), service.config.limits.max_recipe_bytes);
  });
  if (!exported.ok()) return exported.problem();
  if (!exported.value().ok()) return exported.value().problem();
  return SessionPart{.session = session.value(), .recipe = std::move(exported.value().value().text)};
}

/// The samples that the session's first edit was made on.
Outcome<Done> write_rest(Session& session, const std::string& path) {
  const auto rest = session.known_state({}, 0);
  return rest.ok() ? write_ply(rest.value().state.samples->cloud(), path) : rest.problem();
}

std::string request_text(const protocol::JobTerms& terms, const std::string& recipe) {
  std::string rest = protocol::to_text(
      {{"s", terms.s}, {"timing", protocol::kTimingNames.at(static_cast<std::size_t>(terms.timing))}});
  rest.front() = ',';
  return std::string("{\"recipe\":").append(recipe).append(rest);
}

/// All that a job needs, with what it is written from.
Outcome<JobQueue::NewJob> gather(Service& service, const Request& request, protocol::JobRequest asked) {
  protocol::JobTerms& terms = asked.terms;
  if (auto problem = check_volumes(asked.recipe.recipe.edits, true)) return *problem;
  const auto part = std::make_shared<SessionPart>();
  std::string recipe = std::move(asked.recipe_text);
  if (!terms.session.empty()) {
    auto found = session_part(service, request.caller, terms.session);
    if (!found.ok()) return found.problem();
    *part = std::move(found.value());
    terms.neighbors = part->session->params().hierarchy.neighbors;
    if (terms.cloud.empty() && terms.upload.empty()) terms.cloud = part->session->cloud_id();
    recipe = request_text(terms, part->recipe);
  }
  SharedCloud preview;
  if (!terms.preview_cloud.empty()) {
    auto found = cloud_of(service, request.caller, terms.preview_cloud, "/preview/cloud");
    if (!found.ok()) return found.problem();
    preview = found.value();
  }
  auto found = scan_of(service, request.caller, terms);
  if (!found.ok()) return found.problem();
  const auto scan = std::make_shared<const Scan>(std::move(found.value()));
  if (!terms.format) {
    const auto& formats = protocol::kJobFormats;
    const bool can = std::find(formats.begin(), formats.end(), scan->format) != formats.end();
    terms.format = can ? scan->format : CloudFormat::kPly;
  }
  JobQueue::NewJob job;
  job.job.document.terms = terms;
  job.job.owner = request.caller.token;
  job.job.has_preview = part->session != nullptr || preview != nullptr;
  job.job.drop_non_finite = scan->cloud != nullptr && scan->cloud->document.report.dropped_non_finite > 0;
  // The scan, which stays whatever becomes of the cloud or the upload, and what is made of it.
  const std::uint64_t scan_bytes =
      scan->upload != nullptr ? scan->upload->record().length : scan->cloud->document.bytes;
  job.job.bytes = scan_bytes * (1 + std::max<std::uint64_t>(terms.steps, 1));
  job.job.result = std::string(kResultStem).append(file_type(*terms.format).extension);
  job.fill = [&service, part, preview, scan,
              recipe = std::move(recipe)](const std::string& folder) -> Outcome<Done> {
    if (auto done = write_text(folder + "/" + JobQueue::kRecipeName, recipe); !done.ok()) return done;
    if (auto done = write_scan(service, *scan, folder + "/" + JobQueue::kInputName); !done.ok()) return done;
    const std::string path = folder + "/" + JobQueue::kPreviewName;
    const auto written = computed(service.background, [&]() -> Outcome<Done> {
      if (part->session != nullptr) return write_rest(*part->session, path);
      if (preview == nullptr) return Done{};
      const auto samples = service.clouds.samples_of(*preview);
      return samples.ok() ? write_ply(*samples.value(), path) : samples.problem();
    });
    return written.ok() ? written.value() : written.problem();
  };
  return job;
}

Response file_response(const Request& request, const std::string& path, const protocol::JobResult& result,
                       const std::string& name) {
  const auto file =
      std::make_shared<const Descriptor>(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (!file->is_open())
    return problem_response(
        {.kind = ProblemKind::kInternalError, .detail = "the result cannot be read from the disk"}, request);
  Response response{.content_type = result.media_type};
  response.body = [file, due = static_cast<off_t>(result.bytes)](BodySink& sink) {
    std::vector<std::byte> piece(kFilePiece);
    for (off_t at = 0; at < due && !sink.is_peer_gone();) {
      const auto wanted = static_cast<std::size_t>(std::min<off_t>(due - at, off_t{kFilePiece}));
      const ssize_t count = ::pread(file->get(), piece.data(), wanted, at);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) throw std::runtime_error("a result is shorter than it was, or cannot be read");
      if (!sink.write(std::span(piece).first(static_cast<std::size_t>(count)))) return;
      at += count;
    }
  };
  // What follows the stem: of an animation's clouds the number, too.
  const std::string rest = result.name.substr(kResultStem.size());
  return response.with_header("ETag", etag_of({result.sha256}))
      .with_header("Cache-Control", "no-cache")
      .with_header("Content-Disposition",
                   download_name(name.empty() ? std::string(kResultStem) : name, rest));
}

Response no_such_job(const Request& request) {
  return not_found("there is no such job", request);
}

}  // namespace

Response list_jobs(Service& service, const Request& request) {
  const auto status = query_choice(request.head, "status", protocol::kJobStatusNames);
  if (!status.ok()) return problem_response(status.problem(), request);
  const auto limit = query_number(request.head, "limit");
  if (!limit.ok()) return problem_response(limit.problem(), request);
  auto jobs = service.jobs.list([&](const std::string& owner) { return request.caller.may_see(owner); });
  if (status.value())
    std::erase_if(jobs, [&](const protocol::JobDocument& job) {
      return static_cast<std::size_t>(job.status) != *status.value();
    });
  if (limit.value() && jobs.size() > *limit.value()) jobs.resize(*limit.value());
  return json_response(protocol::job_list(jobs));
}

Response create_job(Service& service, const Request& request) {
  auto asked = parsed_body(request, protocol::parse_job_request, large_limits(service));
  if (!asked.ok()) return problem_response(asked.problem(), request);
  const bool only_validate = asked.value().validate;
  auto quota = service.access.hold(request.caller, {{Quota::kJobs, 1}});
  if (!quota.ok()) return problem_response(quota.problem(), request);
  auto job = gather(service, request, std::move(asked.value()));
  if (!job.ok()) return problem_response(job.problem(), request);
  if (only_validate) {
    auto estimate = service.jobs.validate(std::move(job.value()));
    if (!estimate.ok()) return problem_response(estimate.problem(), request);
    return json_response({{"estimate", std::move(estimate.value())}});
  }
  auto stored = service.access.hold(request.caller, {{Quota::kStoredBytes, job.value().job.bytes}});
  if (!stored.ok()) return problem_response(stored.problem(), request);
  job.value().job.quota = std::move(quota.value());
  job.value().job.stored = std::move(stored.value());
  const auto answer = [](const protocol::JobDocument& document) {
    return json_response(protocol::to_json(document), 202).with_header("Location", "/v1/jobs/" + document.id);
  };
  const auto submitted =
      service.jobs.submit(std::move(job.value()), sealed<protocol::JobDocument>(request, answer));
  if (!submitted.ok()) return problem_response(submitted.problem(), request);
  return answer_of(request, submitted.value(), answer);
}

Response get_job(Service& service, const Request& request) {
  const auto job = service.jobs.find(request.captures.at(0));
  return job ? json_response(protocol::to_json(*job)) : no_such_job(request);
}

Response delete_job(Service& service, const Request& request) {
  using enum JobQueue::Dismissal;
  constexpr std::array<std::string_view, 2> kNames{"dismiss", "forget"};
  constexpr std::array<JobQueue::Dismissal, 2> kOnly{kDismiss, kForget};
  const auto only = query_choice(request.head, "only", kNames);
  if (!only.ok()) return problem_response(only.problem(), request);
  const auto job =
      service.jobs.dismiss(request.captures.at(0), only.value() ? kOnly.at(*only.value()) : kEither);
  if (!job.ok()) return problem_response(job.problem(), request);
  return json_response(protocol::to_json(job.value()));
}

Response restart_job(Service& service, const Request& request) {
  auto quota = service.access.hold(request.caller, {{Quota::kJobs, 1}});
  if (!quota.ok()) return problem_response(quota.problem(), request);
  const auto job = service.jobs.restart(request.captures.at(0), std::move(quota.value()));
  if (!job.ok()) return problem_response(job.problem(), request);
  return json_response(protocol::to_json(job.value()), 202)
      .with_header("Location", "/v1/jobs/" + job.value().id);
}

Response get_job_log(Service& service, const Request& request) {
  const auto offset = query_number(request.head, "offset");
  if (!offset.ok()) return problem_response(offset.problem(), request);
  if (!service.jobs.find(request.captures.at(0))) return no_such_job(request);
  const std::string path = service.jobs.log_path(request.captures.at(0));
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  std::string text(kLogPiece, '\0');
  const ssize_t count =
      file.is_open() ? ::pread(file.get(), text.data(), text.size(), offset.value().value_or(0)) : 0;
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  Response response{.content_type = "text/plain; charset=utf-8", .body = std::move(text)};
  return response.with_header("Cache-Control", "no-store");
}

Response get_job_results(Service& service, const Request& request) {
  const auto job = service.jobs.find(request.captures.at(0));
  if (!job) return no_such_job(request);
  if (job->status != protocol::JobStatus::kSuccessful)
    return problem_response(
        {.kind = ProblemKind::kWrongState,
         .detail = std::string("the job has no results: it is ").append(job_status_name(job->status))},
        request);
  return json_response(protocol::job_results(*job));
}

Response get_job_result(Service& service, const Request& request) {
  const auto job = service.jobs.find(request.captures.at(0));
  if (!job) return no_such_job(request);
  for (const protocol::JobResult& result : job->results)
    if (result.name == request.captures.at(1)) {
      if (const std::string etag = etag_of({result.sha256}); is_unchanged(request.head, etag))
        return not_modified(etag);
      return file_response(request, service.jobs.result_path(job->id, result.name), result, job->terms.name);
    }
  return problem_response({.kind = ProblemKind::kNotFound, .detail = "the job has no such result"}, request);
}

Response get_job_events(Service& service, const Request& request) {
  const std::string id = request.captures.at(0);
  if (!service.jobs.find(id)) return no_such_job(request);
  auto stream = admit_stream(service, request);
  if (!stream.ok()) return problem_response(stream.problem(), request);
  StreamBody body = [&service, id, head = request.head, stream = std::move(stream.value())](BodySink& sink) {
    const std::chrono::milliseconds heartbeat(service.config.limits.heartbeat_ms);
    std::uint64_t seen = 0;
    bool is_news = true;
    auto beat = SteadyClock::now() + heartbeat;
    while (!sink.is_peer_gone() && !sink.is_stopping()) {
      const auto job = service.jobs.find(id);
      if (!job || (is_news && !write_event(sink, protocol::job_event(*job))) || job->has_ended()) return;
      if (SteadyClock::now() >= beat) {
        if (!service.access.identify(head).ok()) return;
        if (!write_heartbeat(sink)) return;
        beat = SteadyClock::now() + heartbeat;
      }
      const auto changes = service.jobs.wait_beyond(id, seen, SteadyClock::now() + kPollInterval);
      if (!changes) return;
      is_news = *changes != seen;
      seen = *changes;
    }
  };
  return event_stream(std::move(body));
}

}  // namespace pointwright::server
