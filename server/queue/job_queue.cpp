#include "server/queue/job_queue.h"

#include <algorithm>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "server/base/displaced.h"
#include "server/base/random_id.h"
#include "server/ingest/files.h"
#include "server/queue/worker_process.h"
#include "server/queue/worker_words.h"

namespace pointwright::server {

using protocol::JobDocument;
using protocol::JobStatus;
using protocol::JsonDocument;
using protocol::Problem;
using protocol::ProblemKind;

namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr const char* kLogName = "log";
constexpr std::chrono::seconds kSweepInterval{10};
constexpr std::chrono::seconds kRetryPause{1};
constexpr std::chrono::seconds kValidationDeadline{60};
/// Before this part is done nobody knows how long the rest takes.
constexpr double kLeastFraction = 0.05;

Problem no_such_job() {
  return {.kind = ProblemKind::kNotFound, .detail = "there is no such job"};
}

void remove_folder(const std::string& folder) {
  std::error_code none;  // what stays goes with the next start
  std::filesystem::remove_all(folder, none);
}

}  // namespace

JobQueue::JobQueue(JobSettings settings, Database& database,
                   std::function<void(const std::string&)> report_failure)
    : settings_(std::move(settings)), archive_(database), report_failure_(std::move(report_failure)) {}

JobQueue::~JobQueue() {
  stop();
}

std::string JobQueue::folder_of(const std::string& id) const {
  return settings_.folder + "/" + id;
}
std::string JobQueue::log_path(const std::string& id) const {
  return folder_of(id) + "/" + kLogName;
}
std::string JobQueue::result_path(const std::string& id, const std::string& name) const {
  return folder_of(id) + "/" + name;
}

void JobQueue::note(const std::string& id, const std::string& text) const {
  const std::string line =
      protocol::to_rfc3339(std::chrono::system_clock::now()).append(" ").append(text).append("\n");
  const Descriptor log = open_job_log(log_path(id));
  if (log.is_open()) write_all(log.get(), std::as_bytes(std::span(line.data(), line.size())));
}

JobQueue::SharedEntry JobQueue::find_locked(const std::string& id) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const auto& entry) { return entry->kept.document.id == id; });
  return found == entries_.end() ? nullptr : *found;
}

JobDocument JobQueue::seen_locked(const Entry& entry) const {
  JobDocument document = entry.kept.document;
  const double done = document.progress.fraction;
  if (document.status == JobStatus::kRunning && done >= kLeastFraction && done < 1.0) {
    const double elapsed = std::chrono::duration<double>(SteadyClock::now() - entry.begun).count();
    document.eta_s = elapsed * (1.0 - done) / done;
  }
  if (document.status == JobStatus::kAccepted) {
    document.queue_place = 1;
    bool is_before = true;  // those of the same priority that were there first
    for (const SharedEntry& other : entries_) {
      if (other.get() == &entry) is_before = false;
      if (other.get() == &entry || other->kept.document.status != JobStatus::kAccepted) continue;
      const std::uint64_t theirs = other->kept.document.terms.priority;
      if (theirs > document.terms.priority || (theirs == document.terms.priority && is_before))
        ++document.queue_place;
    }
  }
  return document;
}

std::optional<Problem> JobQueue::check_locked() const {
  if (stopping_) return Problem{.kind = ProblemKind::kOverloaded, .detail = "the server is stopping"};
  if (entries_.size() < settings_.limits.max_jobs) return std::nullopt;
  return Problem{.kind = ProblemKind::kTooMany,
                 .detail = "the server holds as many jobs as it may (max_jobs), and none has ended",
                 .limit = static_cast<double>(settings_.limits.max_jobs),
                 .actual = static_cast<double>(entries_.size() + 1),
                 .retry_after = protocol::kPassingSeconds};
}

Outcome<std::vector<std::string>> JobQueue::command_of(const KeptJob& job) const {
  // By names in its own folder: neither the log nor a problem says where that is.
  const WorkerFiles files{.recipe = kRecipeName,
                          .input = kInputName,
                          .preview = job.has_preview ? kPreviewName : "",
                          .output = job.result,
                          .work = "work"};
  const std::vector<std::string> worker =
      worker_words(settings_.worker, job, files, settings_.limits, settings_.threads);
  if (job.document.terms.launcher == protocol::kLocalLauncher) return worker;
  for (const Launcher& launcher : settings_.launchers)
    if (launcher.name == job.document.terms.launcher) return launched_words(launcher, worker);
  std::string names(protocol::kLocalLauncher);
  for (const Launcher& launcher : settings_.launchers) names += ", " + launcher.name;
  return Problem{.kind = ProblemKind::kInvalidValue,
                 .detail = "the server has no such launcher",
                 .errors = {{.pointer = "/launcher", .detail = "must be one of " + names}}};
}

Outcome<Done> JobQueue::prepare(const NewJob& job, const std::string& folder) const {
  std::error_code problem;
  std::filesystem::create_directories(folder, problem);
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all, problem);
  if (problem)
    return Problem{.kind = problem == std::errc::no_space_on_device ? ProblemKind::kOutOfDisk
                                                                    : ProblemKind::kStorageFailed,
                   .detail = "no folder can be made for the job: " + problem.message()};
  if (auto filled = job.fill(folder); !filled.ok()) return filled;
  if (!sync_folder(folder) || !sync_folder(settings_.folder))
    return Problem{.kind = ProblemKind::kStorageFailed, .detail = "the job cannot be brought to the disk"};
  return Done{};
}

Outcome<JobDocument> JobQueue::submit(NewJob job, const Seal<JobDocument>& seal) {
  JobDocument& document = job.job.document;
  document.id = random_id();
  document.created = document.updated = std::chrono::system_clock::now();
  document.status = JobStatus::kAccepted;
  document.message = "waits for its turn";
  document.progress = {.phase = "waiting", .fraction = 0.0};
  const std::string folder = folder_of(document.id);
  if (auto command = command_of(job.job); !command.ok()) return command.problem();
  SharedEntry removed;
  auto outcome = [&]() -> Outcome<JobDocument> {
    if (auto prepared = prepare(job, folder); !prepared.ok()) return prepared.problem();
    const std::lock_guard lock(mutex_);
    removed = make_room_locked();
    if (auto problem = check_locked()) return *problem;
    const auto entry = std::make_shared<Entry>();
    entry->kept = std::move(job.job);
    entries_.push_back(entry);
    JobDocument seen = seen_locked(*entry);
    std::optional<KeptAnswer> answer;
    if (seal) answer = seal(seen);
    if (auto kept = archive_.add(entry->kept, answer ? &*answer : nullptr); !kept.ok()) {
      entries_.pop_back();
      return kept.problem();
    }
    start_runners_locked();
    changed_.notify_all();
    return seen;
  }();
  if (!outcome.ok()) remove_folder(folder);
  if (removed != nullptr) remove_folder(folder_of(removed->kept.document.id));
  return outcome;
}

JobQueue::SharedEntry JobQueue::make_room_locked() {
  if (stopping_ || entries_.size() < settings_.limits.max_jobs) return nullptr;
  SharedEntry chosen = displaced(
      entries_, [](const Entry& entry) { return entry.kept.owner; },
      [](const Entry& entry) { return entry.kept.document.has_ended() && !entry.has_worker; },
      [](const Entry& entry) { return entry.kept.document.finished.value_or(entry.kept.document.updated); });
  if (chosen == nullptr || !archive_.remove(chosen->kept.document.id).ok()) return nullptr;
  std::erase(entries_, chosen);
  ++chosen->changes;
  changed_.notify_all();
  return chosen;
}

Outcome<JsonDocument> JobQueue::validate(NewJob job) {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_ || validating_ >= settings_.limits.max_running_jobs)
      return Problem{.kind = ProblemKind::kOverloaded,
                     .detail = "as many jobs are being looked at as may run (max_running_jobs)",
                     .limit = static_cast<double>(settings_.limits.max_running_jobs)};
    ++validating_;
  }
  const std::shared_ptr<void> slot(nullptr, [this](void*) {
    const std::lock_guard lock(mutex_);
    --validating_;
  });
  const std::string folder = folder_of("check-" + random_id());
  auto outcome = [&]() -> Outcome<JsonDocument> {
    if (auto command = command_of(job.job); !command.ok()) return command.problem();
    if (auto prepared = prepare(job, folder); !prepared.ok()) return prepared.problem();
    // Here, whatever the launcher: nothing is done but looking.
    KeptJob here = job.job;
    here.document.terms.launcher = protocol::kLocalLauncher;
    auto command = command_of(here);
    if (!command.ok()) return command.problem();
    command.value().emplace_back("--dry-run");
    const Descriptor log = open_job_log(folder + "/" + kLogName);
    auto worker = WorkerProcess::start(command.value(), folder, log.get(), folder + "/" + kWorkerPidName);
    if (!worker) return Problem{.kind = ProblemKind::kOverloaded, .detail = "no worker could be started"};
    const auto deadline = SteadyClock::now() + kValidationDeadline;
    std::string last;
    const ChildEnd end = worker->run([&](const std::string& line) { last = line; },
                                     [&] {
                                       const std::lock_guard lock(mutex_);
                                       return stopping_ || SteadyClock::now() > deadline;
                                     });
    if (end.by_cancel && SteadyClock::now() <= deadline)
      return Problem{.kind = ProblemKind::kOverloaded, .detail = "the server is stopping"};
    if (end.by_cancel)
      return Problem{.kind = ProblemKind::kTooManySamples,
                     .detail = "the scan could not be looked through in time",
                     .limit = static_cast<double>(kValidationDeadline.count())};
    WorkerWord word = parse_worker_word(last);
    if (word.estimate) return std::move(*word.estimate);
    return problem_of_worker(end, word);
  }();
  remove_folder(folder);
  return outcome;
}

std::optional<JobDocument> JobQueue::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const SharedEntry entry = find_locked(id);
  if (entry == nullptr) return std::nullopt;
  return seen_locked(*entry);
}

std::optional<std::string> JobQueue::owner_of(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const SharedEntry entry = find_locked(id);
  if (entry == nullptr) return std::nullopt;
  return entry->kept.owner;
}

std::vector<JobDocument> JobQueue::list(const std::function<bool(const std::string&)>& may_see) const {
  const std::lock_guard lock(mutex_);
  std::vector<JobDocument> documents;
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry)
    if (may_see((*entry)->kept.owner)) documents.push_back(seen_locked(**entry));
  return documents;
}

Outcome<JobDocument> JobQueue::dismiss(const std::string& id, Dismissal only) {
  std::string left;
  JobDocument seen;
  {
    const std::lock_guard lock(mutex_);
    const SharedEntry entry = find_locked(id);
    if (entry == nullptr) return no_such_job();
    const bool has_ended = entry->kept.document.has_ended();
    if (has_ended ? only == Dismissal::kDismiss : only == Dismissal::kForget)
      return Problem{.kind = ProblemKind::kWrongState,
                     .detail = std::string(has_ended ? "the job has ended already: it is "
                                                     : "the job has not ended yet: it is ")
                                   .append(job_status_name(entry->kept.document.status))};
    if (entry->has_worker && entry->must_end)
      return Problem{.kind = ProblemKind::kWrongState, .detail = "the job's worker is still ending"};
    if (has_ended) {
      if (auto removed = archive_.remove(id); !removed.ok()) return removed.problem();
      seen = seen_locked(*entry);
      std::erase(entries_, entry);
      left = folder_of(id);
    } else {
      KeptJob before = entry->kept;
      JobDocument& document = entry->kept.document;
      document.status = JobStatus::kDismissed;
      document.message = "was dismissed";
      document.finished = document.updated = std::chrono::system_clock::now();
      if (auto kept = archive_.update(entry->kept); !kept.ok()) {
        entry->kept = std::move(before);
        return kept.problem();
      }
      entry->kept.quota = nullptr;
      entry->must_end = entry->has_worker;
      ++entry->changes;
      seen = seen_locked(*entry);
      note(id, "dismissed");
    }
    changed_.notify_all();
  }
  if (!left.empty()) remove_folder(left);
  return seen;
}

Outcome<JobDocument> JobQueue::restart(const std::string& id, std::shared_ptr<const void> quota) {
  const std::lock_guard lock(mutex_);
  const SharedEntry entry = find_locked(id);
  if (entry == nullptr) return no_such_job();
  const JobStatus status = entry->kept.document.status;
  const bool may = (status == JobStatus::kFailed || status == JobStatus::kDismissed) && !entry->has_worker;
  if (!may)
    return Problem{
        .kind = ProblemKind::kWrongState,
        .detail = std::string("only jobs that failed or were dismissed are started again; this one ")
                      .append(entry->has_worker ? "is still ending" : "is ")
                      .append(entry->has_worker ? "" : job_status_name(status))};
  KeptJob before = entry->kept;
  JobDocument& document = entry->kept.document;
  document.status = JobStatus::kAccepted;
  document.message = "waits for its turn, once more";
  document.progress = {.phase = "waiting", .fraction = 0.0};
  document.finished = std::nullopt;
  document.problem = std::nullopt;
  document.attempts = 0;
  document.updated = std::chrono::system_clock::now();
  entry->kept.quota = std::move(quota);
  if (auto kept = archive_.update(entry->kept); !kept.ok()) {
    entry->kept = std::move(before);
    return kept.problem();
  }
  ++entry->changes;
  start_runners_locked();
  changed_.notify_all();
  return seen_locked(*entry);
}

std::optional<std::uint64_t> JobQueue::wait_beyond(const std::string& id, std::uint64_t seen,
                                                   SteadyClock::time_point deadline) {
  std::unique_lock lock(mutex_);
  while (true) {
    const SharedEntry entry = find_locked(id);
    if (entry == nullptr) return std::nullopt;
    if (entry->changes != seen || stopping_) return entry->changes;
    if (changed_.wait_until(lock, deadline) == std::cv_status::timeout) return seen;
  }
}

std::vector<std::string> JobQueue::recover(const std::function<void(KeptJob&)>& hold) {
  std::size_t damaged = 0;
  std::vector<std::string> notes;
  std::vector<KeptJob> jobs = archive_.jobs(damaged);
  const std::lock_guard lock(mutex_);
  for (KeptJob& kept : jobs) {
    end_left_worker(folder_of(kept.document.id) + "/" + kWorkerPidName);
    const auto entry = std::make_shared<Entry>();
    hold(kept);
    entry->kept = std::move(kept);
    JobDocument& document = entry->kept.document;
    document.progress = {.phase = "waiting", .fraction = 0.0};
    if (document.has_ended()) {
      if (document.status == JobStatus::kSuccessful) {
        document.progress = {.phase = "done", .fraction = 1.0};
        remove_inputs(document.id);
      }
    } else {
      document.status = JobStatus::kAccepted;
      document.message = document.attempts > 0 ? "waits to go on where it was" : "waits for its turn";
    }
    entries_.push_back(entry);
  }
  if (damaged > 0)
    notes.push_back(std::to_string(damaged) + " jobs are damaged and not known any more; no file is deleted");
  std::error_code none;
  for (const auto& folder : std::filesystem::directory_iterator(settings_.folder, none))
    if (damaged == 0 && find_locked(folder.path().filename().string()) == nullptr) {
      end_left_worker(folder.path().string() + "/" + kWorkerPidName);
      remove_folder(folder.path().string());
    }
  if (!entries_.empty()) start_runners_locked();  // those that have ended expire
  return notes;
}

void JobQueue::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  for (std::thread& runner : runners_) runner.join();
  runners_.clear();
}

void JobQueue::start_runners_locked() {
  while (!stopping_ && runners_.size() < settings_.limits.max_running_jobs)
    runners_.emplace_back([this] { run(); });
}

JobQueue::SharedEntry JobQueue::take_next_locked() const {
  SharedEntry next;
  for (const SharedEntry& entry : entries_) {
    if (entry->kept.document.status != JobStatus::kAccepted || entry->has_worker) continue;
    if (next == nullptr || entry->kept.document.terms.priority > next->kept.document.terms.priority)
      next = entry;
  }
  return next;
}

JobQueue::SharedEntry JobQueue::take_expired_locked() {
  if (settings_.limits.job_retention_s == 0) return nullptr;
  const auto oldest =
      std::chrono::system_clock::now() - std::chrono::seconds(settings_.limits.job_retention_s);
  const auto found = std::find_if(entries_.begin(), entries_.end(), [&](const SharedEntry& entry) {
    const JobDocument& document = entry->kept.document;
    return document.has_ended() && !entry->has_worker &&
           document.finished.value_or(document.updated) < oldest;
  });
  if (found == entries_.end()) return nullptr;
  SharedEntry entry = *found;
  if (!archive_.remove(entry->kept.document.id).ok()) return nullptr;
  entries_.erase(found);
  ++entry->changes;
  changed_.notify_all();
  return entry;
}

void JobQueue::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    if (const SharedEntry expired = take_expired_locked()) {
      lock.unlock();
      remove_folder(folder_of(expired->kept.document.id));
      lock.lock();
      continue;
    }
    const SharedEntry entry = take_next_locked();
    if (entry == nullptr) {
      const std::chrono::seconds retention(std::max<std::uint64_t>(settings_.limits.job_retention_s, 1));
      changed_.wait_for(lock, std::min(kSweepInterval, retention));
      continue;
    }
    JobDocument& document = entry->kept.document;
    const KeptJob before = entry->kept;
    const auto now = std::chrono::system_clock::now();
    document.status = JobStatus::kRunning;
    document.message = "is at work";
    document.started = document.started.value_or(now);
    document.updated = now;
    ++document.attempts;
    if (!archive_.update(entry->kept).ok()) {
      entry->kept = before;
      changed_.wait_for(lock, kRetryPause);
      continue;
    }
    entry->has_worker = true;
    entry->must_end = false;
    entry->begun = SteadyClock::now();
    ++entry->changes;
    changed_.notify_all();
    lock.unlock();
    try {
      run_job(entry);
    } catch (const std::exception& error) {
      report_failure_(std::string("job ").append(before.document.id).append(": ").append(error.what()));
      settle(entry, {.status = 1}, {});
    }
    lock.lock();
    entry->has_worker = false;
    ++entry->changes;
    changed_.notify_all();
  }
}

bool JobQueue::keep_locked(Entry& entry) {
  // Where the disk takes nothing, the job goes on from its checkpoints after a restart; here it is told of.
  const auto kept = archive_.update(entry.kept);
  if (!kept.ok())
    report_failure_("job " + entry.kept.document.id + " cannot be kept: " + kept.problem().detail);
  entry.kept.quota = nullptr;
  ++entry.changes;
  changed_.notify_all();
  return kept.ok();
}

}  // namespace pointwright::server
