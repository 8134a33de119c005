// What a job's runner does: starts its worker, hears it out, and writes down how it ended.
#include <fcntl.h>

#include <filesystem>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "server/base/file_types.h"
#include "server/base/sha256.h"
#include "server/ingest/files.h"
#include "server/queue/job_queue.h"
#include "server/queue/worker_process.h"
#include "server/queue/worker_words.h"

namespace pointwright::server {

using protocol::JobDocument;
using protocol::JobStatus;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::ProblemKind;

namespace {

/// A worker that daemons were ended under so often is not started again by itself.
constexpr std::uint64_t kMostAttempts = 20;

Outcome<protocol::JobResult> result_of(const std::string& folder, const std::string& name,
                                       const protocol::JobTerms& terms) {
  const std::string path = folder + "/" + name;
  std::error_code none;
  const std::uint64_t bytes = std::filesystem::file_size(path, none);
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  Digest digest(Digest::Algorithm::kSha256);
  const bool is_read =
      !none && file.is_open() && read_pieces(file.get(), bytes, [&](std::span<const std::byte> piece) {
        digest.add(piece);
        return true;
      });
  if (!is_read)
    return Problem{.kind = ProblemKind::kInternalError,
                   .detail = "the worker says that it is done, but its result cannot be read"};
  return protocol::JobResult{
      .name = name,
      .media_type = std::string(file_type(terms.format.value_or(CloudFormat::kPly)).media_type),
      .bytes = bytes,
      .sha256 = to_hex(digest.finish())};
}

/// The files of a worker's report, which then no longer says where they are.
Outcome<std::vector<protocol::JobResult>> results_of(const std::string& folder, JsonDocument& report,
                                                     const protocol::JobTerms& terms) {
  std::vector<protocol::JobResult> results;
  const JsonDocument files = report.value("files", JsonDocument::array());
  report.erase("files");
  for (const JsonDocument& file : files) {
    const std::string name = std::filesystem::path(file.get<std::string>()).filename().string();
    auto result = result_of(folder, name, terms);
    if (!result.ok()) return result.problem();
    results.push_back(std::move(result.value()));
  }
  return results;
}

}  // namespace

void JobQueue::run_job(const SharedEntry& entry) {
  KeptJob job;
  {
    const std::lock_guard lock(mutex_);
    job = entry->kept;
  }
  const std::string& id = job.document.id;
  const auto command = command_of(job);
  if (!command.ok() || job.document.attempts > kMostAttempts) {
    const Problem problem =
        !command.ok()
            ? command.problem()
            : Problem{.kind = ProblemKind::kInternalError,
                      .detail = "its worker was interrupted too often: restart the job to try again",
                      .limit = static_cast<double>(kMostAttempts)};
    return settle(entry, {.status = 1}, protocol::to_text({{"problem", to_json(problem)}}));
  }
  note(id, "attempt " + std::to_string(job.document.attempts) + ", launcher " + job.document.terms.launcher);
  const Descriptor log = open_job_log(log_path(id));
  auto worker =
      WorkerProcess::start(command.value(), folder_of(id), log.get(), folder_of(id) + "/" + kWorkerPidName);
  if (!worker) {
    const Problem problem{
        .kind = ProblemKind::kInternalError,
        .detail = "no worker could be started by the launcher " + job.document.terms.launcher};
    return settle(entry, {.status = 1}, protocol::to_text({{"problem", to_json(problem)}}));
  }
  std::string last;
  const ChildEnd end = worker->run([&](const std::string& line) { take_line(entry, line, last); },
                                   [&] {
                                     const std::lock_guard lock(mutex_);
                                     return stopping_ || entry->must_end;
                                   });
  settle(entry, end, last);
}

void JobQueue::take_line(const SharedEntry& entry, const std::string& line, std::string& last) {
  const WorkerWord word = parse_worker_word(line);
  if (!word.progress) {
    last = line;
    return;
  }
  const std::lock_guard lock(mutex_);
  JobDocument& document = entry->kept.document;
  if (document.status != JobStatus::kRunning) return;
  if (word.progress->phase != document.progress.phase) note(document.id, word.progress->phase);
  document.progress = *word.progress;
  document.updated = std::chrono::system_clock::now();
  ++entry->changes;
  changed_.notify_all();
}

void JobQueue::settle(const SharedEntry& entry, const ChildEnd& end, const std::string& last) {
  KeptJob job;
  {
    const std::lock_guard lock(mutex_);
    job = entry->kept;
  }
  const std::string& id = job.document.id;
  WorkerWord word = parse_worker_word(last);
  std::optional<Problem> problem;
  std::vector<protocol::JobResult> results;
  if (word.report && end.signal == 0 && end.status == 0) {
    auto made = results_of(folder_of(id), *word.report, job.document.terms);
    if (made.ok())
      results = std::move(made.value());
    else
      problem = made.problem();
  } else {
    problem = problem_of_worker(end, word);
  }
  const std::lock_guard lock(mutex_);
  JobDocument& document = entry->kept.document;
  // Dismissed meanwhile; or the daemon stops: the next one goes on.
  if (document.status != JobStatus::kRunning || (stopping_ && end.by_cancel)) return;
  document.finished = document.updated = std::chrono::system_clock::now();
  document.status = problem ? JobStatus::kFailed : JobStatus::kSuccessful;
  document.message = problem ? problem->detail : "is done";
  document.problem = std::move(problem);
  document.results = std::move(results);
  if (word.report) document.report = *word.report;
  if (document.status == JobStatus::kSuccessful) document.progress = {.phase = "done", .fraction = 1.0};
  note(id, std::string(job_status_name(document.status)).append(": ").append(document.message));
  // Where it could not be kept, the next daemon knows it as running.
  if (keep_locked(*entry) && document.status == JobStatus::kSuccessful) remove_inputs(id);
}

void JobQueue::remove_inputs(const std::string& id) const {
  std::error_code none;  // what stays goes with the next start
  for (const char* const name : {kInputName, kPreviewName})
    std::filesystem::remove(folder_of(id) + "/" + name, none);
}

}  // namespace pointwright::server
