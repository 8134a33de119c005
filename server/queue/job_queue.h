#pragma once
// Jobs of the daemon: they wait for their turn by priority, run as processes of their own, and are there
// after a restart.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "protocol/json/jobs.h"
#include "server/base/outcome.h"
#include "server/config/config.h"
#include "server/ingest/child_process.h"
#include "server/queue/job_archive.h"
#include "server/store/upload_store.h"

namespace pointwright::server {

/// Who runs them and where.
struct JobSettings {
  std::string folder;               ///< a folder for each job goes into it
  std::string worker;               ///< the program `pointwright`
  std::vector<Launcher> launchers;  ///< besides the local one
  std::uint32_t threads = 0;        ///< of one worker; 0: all
  Limits limits;
};

/// Thread-safe.
class JobQueue {
 public:
  /// `report_failure` gets the text of what went wrong beyond a job.
  JobQueue(JobSettings settings, Database& database, std::function<void(const std::string&)> report_failure);
  ~JobQueue();  ///< as stop()
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;

  struct NewJob {
    KeptJob job;  ///< terms, owner, result and what goes with them; id, times and status are given here
    /// Writes kRecipeName and kInputName, and kPreviewName where the job has one, into the job's folder.
    std::function<Outcome<Done>(const std::string& folder)> fill;
  };
  static constexpr const char* kRecipeName = "recipe.json";
  static constexpr const char* kInputName = kJobInputName;
  static constexpr const char* kPreviewName = "preview.ply";

  /// Problems: too many, invalid value (a launcher that there is not), those of fill() and of the archive
  Outcome<protocol::JobDocument> submit(NewJob job, const Seal<protocol::JobDocument>& seal = {});
  /// What the job would take, by its worker: {"mode", "sample_count", …}. Nothing is kept.
  /// As many at once as jobs run. Problems: besides, overloaded; the worker's; too many samples where that
  /// takes longer than kValidationDeadline
  Outcome<protocol::JsonDocument> validate(NewJob job);
  [[nodiscard]] std::optional<protocol::JobDocument> find(const std::string& id) const;
  [[nodiscard]] std::optional<std::string> owner_of(const std::string& id) const;
  /// Of the owners that may be seen, newest first.
  [[nodiscard]] std::vector<protocol::JobDocument> list(
      const std::function<bool(const std::string&)>& may_see) const;
  /// What dismiss() may do: where the job has come to be in another state, nothing is done.
  enum class Dismissal { kEither, kDismiss, kForget };
  /// Ends a job that waits or runs; its checkpoints stay. One that has ended is forgotten, with its files.
  /// Problems: not found, wrong state, those of the archive
  Outcome<protocol::JobDocument> dismiss(const std::string& id, Dismissal only = Dismissal::kEither);
  /// Puts a job that failed or was dismissed back into the queue; it goes on from its checkpoints.
  /// Problems: not found, wrong state, too many, those of the archive
  Outcome<protocol::JobDocument> restart(const std::string& id, std::shared_ptr<const void> quota);
  /// Waits until the job has changed more than `seen` says, at most until the deadline; how often it has by
  /// then. None: it is gone.
  std::optional<std::uint64_t> wait_beyond(const std::string& id, std::uint64_t seen,
                                           std::chrono::steady_clock::time_point deadline);
  [[nodiscard]] std::string log_path(const std::string& id) const;
  [[nodiscard]] std::string result_path(const std::string& id, const std::string& name) const;

  /// Knows the jobs of the process before: those that ran go on. Ends what it has left running. Notes are for
  /// the log. `hold` takes the parts of quotas that a job has. Throws DatabaseError.
  std::vector<std::string> recover(const std::function<void(KeptJob&)>& hold);
  /// Ends all workers; their jobs go on with the next process.
  void stop();

 private:
  struct Entry {
    KeptJob kept;
    std::chrono::steady_clock::time_point begun{};  // of this attempt
    std::uint64_t changes = 0;
    bool has_worker = false;
    bool must_end = false;
  };
  using SharedEntry = std::shared_ptr<Entry>;

  [[nodiscard]] SharedEntry find_locked(const std::string& id) const;
  [[nodiscard]] protocol::JobDocument seen_locked(const Entry& entry) const;
  [[nodiscard]] std::optional<protocol::Problem> check_locked() const;
  [[nodiscard]] std::string folder_of(const std::string& id) const;
  [[nodiscard]] Outcome<std::vector<std::string>> command_of(const KeptJob& job) const;
  Outcome<Done> prepare(const NewJob& job, const std::string& folder) const;
  void start_runners_locked();
  void run();
  [[nodiscard]] SharedEntry take_next_locked() const;
  void run_job(const SharedEntry& entry);
  void take_line(const SharedEntry& entry, const std::string& line, std::string& last);
  void settle(const SharedEntry& entry, const ChildEnd& end, const std::string& last);
  bool keep_locked(Entry& entry);  // whether it could
  /// Nobody starts a job again that was successful: what it was made from goes.
  void remove_inputs(const std::string& id) const;
  void note(const std::string& id, const std::string& text) const;
  [[nodiscard]] SharedEntry take_expired_locked();
  /// Where there are as many as may be: the job that ended longest ago, of whoever holds most; taken out.
  [[nodiscard]] SharedEntry make_room_locked();

  const JobSettings settings_;
  JobArchive archive_;
  const std::function<void(const std::string&)> report_failure_;
  mutable std::mutex mutex_;  // guards what follows, and the entries
  std::condition_variable changed_;
  bool stopping_ = false;
  std::size_t validating_ = 0;
  std::vector<SharedEntry> entries_;  // oldest first
  std::vector<std::thread> runners_;
};

}  // namespace pointwright::server
