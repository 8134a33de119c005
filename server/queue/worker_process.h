#pragma once
// The process that does a job: its words come line by line, and it ends with all that it has started.

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/base/descriptor.h"
#include "server/ingest/child_process.h"

namespace pointwright::server {

/// One worker, started in a process group of its own. One thread uses it; end() is for any.
class WorkerProcess {
 public:
  /// `command`:  the program, looked up in $PATH, and its arguments
  /// `folder`:   that it starts in
  /// `log`:      where its standard error goes
  /// `pid_file`: says who it is for as long as it runs, so that the next daemon can end what this one left
  /// Null where it cannot be started.
  static std::optional<WorkerProcess> start(const std::vector<std::string>& command,
                                            const std::string& folder, int log, const std::string& pid_file);
  WorkerProcess(WorkerProcess&&) noexcept = default;
  WorkerProcess& operator=(WorkerProcess&&) = delete;
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;
  ~WorkerProcess() = default;

  /// Hands every line of its standard output to `take` until it is gone, and asks `must_end` many times a
  /// second: the group is then asked to end, and made to a moment later. Lines beyond kMostLineBytes are cut.
  ChildEnd run(const std::function<void(const std::string&)>& take, const std::function<bool()>& must_end);

  static constexpr std::size_t kMostLineBytes = std::size_t{1} << 20U;
  /// What a group that was asked to end has left: launchers cancel what they started elsewhere.
  static constexpr std::chrono::milliseconds kGrace{3000};

 private:
  WorkerProcess(pid_t group, Descriptor output, std::string pid_file)
      : group_(group), output_(std::move(output)), pid_file_(std::move(pid_file)) {}

  pid_t group_;
  Descriptor output_;
  std::string pid_file_;
};

/// The name of a job's pid file in its folder.
inline constexpr const char* kWorkerPidName = "worker.pid";

/// A job's log, to write at its end.
Descriptor open_job_log(const std::string& path);

/// Ends the group that a pid file names, where that is still the process it was written for. Blocks until it
/// is gone, a second at most. The file goes with it.
void end_left_worker(const std::string& pid_file);

}  // namespace pointwright::server
